"""Commands that drive a robot, real or simulated, and look at what it did."""

import math
from pathlib import Path
from typing import Annotated

import typer

from robot.cli_help import add


def register(app: typer.Typer) -> None:
    """Add this module's commands to the program, in the order of the help page."""
    add(
        app,
        sim,
        "lemtomap sim                                        explore the office, go to its far end and back",
        "lemtomap sim --fast --mission goto:12               lock-step: faster, and the same every time",
        "lemtomap sim --world plan.yaml --duration 600       any ROS map_server floor plan",
        "lemtomap sim --serve                                only the fake hardware, on two pseudo-terminals",
    )
    add(
        app,
        view,
        "lemtomap view runs/demo",
        "lemtomap view runs/demo --web        on a machine without a display",
    )


def sim(
    *,
    world: Annotated[
        str, typer.Option(metavar="NAME|FILE", help="a built-in world or a floor plan .yaml")
    ] = "office",
    mission: Annotated[
        str,
        typer.Option(
            metavar="WHAT",
            help="explore, tour, goto:PLACE (a node's number or name), several joined by commas",
        ),
    ] = "explore,goto:far,goto:start",
    duration: Annotated[
        float, typer.Option(metavar="S", min=1.0, help="end at the latest after this many seconds")
    ] = 900.0,
    fast: Annotated[
        bool, typer.Option("--fast", help="lock-step on a virtual clock, as fast as the machine can")
    ] = False,
    serve: Annotated[bool, typer.Option("--serve", help="only the fake hardware, until interrupted")] = False,
    seed: Annotated[int, typer.Option(metavar="N", help="of noise in the world and of the particles")] = 0,
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="folder for the results; an earlier run's are replaced")
    ] = Path("runs/sim"),
) -> None:
    """Run the whole robot in a simulated building, on fake serial ports."""
    if serve:
        from sim.serve import serve_world

        serve_world(world, seed, duration_s=math.inf, truth_path=None, gui=False)
        return
    from robot.progress import progress_bar
    from robot.sim_run import SimOptions, run_sim
    from robot.told import told_after_run

    options = SimOptions(world, mission, duration, out, seed, fast=fast)
    with progress_bar(f"sim {world}") as bar:
        summary = run_sim(options, bar)
    typer.echo(told_after_run(out, summary))


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
