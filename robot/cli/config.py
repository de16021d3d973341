"""The command that shows every setting: what it is now, and who said so."""

import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer

from lemtomap.errors import BadSetting
from lemtomap.robot.cli.help import add
from lemtomap.robot.cli.options import Set


def register(app: typer.Typer) -> None:
    """Add this module's command to the program."""
    add(
        app,
        config,
        "lemtomap config                                     every setting, its unit and its default",
        "lemtomap config robot.toml --section nav.body       what a file makes of them, and in which line",
        "lemtomap config --write robot.toml                  a file to begin from",
        "lemtomap config robot.toml --json                   for programs",
    )


def config(
    file: Annotated[
        Path | None, typer.Argument(metavar="[FILE.toml]", help="settings that differ from the defaults")
    ] = None,
    *,
    section: Annotated[
        str, typer.Option(metavar="S", help="only a table and those within it: nav, nav.body")
    ] = "",
    orders: Set = None,
    as_json: Annotated[bool, typer.Option("--json", help="for programs")] = False,
    write: Annotated[
        Path | None, typer.Option(metavar="FILE.toml", help="write them there, with what each is for")
    ] = None,
) -> None:
    """Show every setting with its unit and default, what it is now and who said so."""
    from lemtomap.robot.settings import show
    from lemtomap.robot.settings.read import read_settings

    tables = show.shown_tables(read_settings(file, orders or ()), section)
    if write is not None:
        write_new(write, show.as_toml(tables))
        typer.echo(f"{write}: written; look at it with: lemtomap config {write}")
        return
    rows = [row for _, shown in tables for row in shown]
    with suppress(BrokenPipeError):  # nobody reads any more
        if as_json:
            typer.echo(show.as_json(rows))
        elif sys.stdout.isatty():
            _print_table(show.HEADINGS, rows, show.DEFAULT)
        else:
            typer.echo(show.aligned(rows))
        sys.stdout.flush()


def write_new(path: Path, text: str) -> None:
    """Write a file that is not there yet, whole or not at all. Raises BadSetting."""
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise BadSetting(f"{path}: exists already, and is not overwritten") from None
    except OSError as error:
        path.unlink(missing_ok=True)
        raise BadSetting(f"{path}: cannot be written ({error.strerror})") from None


def _print_table(headings: tuple[str, ...], rows: list[Any], default: str) -> None:
    """Print a table on the terminal; what differs from the default stands out."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(*headings, box=None, pad_edge=False)
    for column in table.columns:
        column.overflow = "fold"
    for row in rows:
        table.add_row(*map(Text, row.cells), style="" if row.source == default else "bold green")
    Console().print(table)
