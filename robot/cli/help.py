"""How every command's help page looks: examples to copy first, then what it does, then its options."""

import re
from collections.abc import Callable
from typing import Any

import typer


def add(
    app: typer.Typer,
    command: Callable[..., Any],
    *examples: str,
    name: str | None = None,
    takes_minus: bool = False,
) -> None:
    """Add a command whose help starts with runnable examples; its docstring follows.

    `takes_minus`: a word that begins with a minus and is no option is an argument (a level, a name).
    """
    told = (command.__doc__ or "").strip()
    brief = re.split(r"[:;.] ?", told)[0] + "."
    text = "\b\n" + "\n".join(examples) + "\n\n" + told
    settings = {"ignore_unknown_options": takes_minus}
    app.command(name=name, help=text, short_help=brief, context_settings=settings)(command)


class Interrupted(Exception):
    """Ctrl-C, in words: what was stopped and what is left of it."""
