"""Commands that drive a robot, real or simulated, and look at what it did."""

from pathlib import Path
from typing import Annotated

import typer

from robot.cli_help import add


def register(app: typer.Typer) -> None:
    """Add this module's commands to the program, in the order of the help page."""
    add(
        app,
        view,
        "lemtomap view runs/demo",
        "lemtomap view runs/demo --web        on a machine without a display",
    )


def view(
    path: Annotated[Path, typer.Argument(metavar="RUN", help="a run's folder, or its run.rrd")],
    *,
    web: Annotated[
        bool, typer.Option("--web", help="serve it to a browser instead of opening a window")
    ] = False,
) -> None:
    """Look at a recording in the Rerun viewer."""
    from robot.view import open_recording

    open_recording(path, web=web)
