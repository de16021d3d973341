"""Commands about maps and recorded logs."""

import typer


def register(app: typer.Typer) -> None:
    """Add this module's commands to the program."""
    del app
