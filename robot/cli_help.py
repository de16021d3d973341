"""How every command's help page looks: examples to copy first, then what it does, then its options."""

import re
from collections.abc import Callable
from typing import Any

import typer


def add(app: typer.Typer, command: Callable[..., Any], *examples: str, name: str | None = None) -> None:
    """Add a command whose help starts with runnable examples; its docstring follows."""
    told = (command.__doc__ or "").strip()
    brief = re.split(r"[:;.] ?", told)[0] + "."
    text = "\b\n" + "\n".join(examples) + "\n\n" + told
    app.command(name=name, help=text, short_help=brief)(command)


class Interrupted(Exception):
    """Ctrl-C, in words: what was stopped and what is left of it."""
