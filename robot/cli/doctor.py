"""The command that says what is missing, and its cure."""

from typing import Annotated

import typer

from lemtomap.robot.cli.help import add


def register(app: typer.Typer) -> None:
    """Add this module's command to the program."""
    add(
        app,
        doctor,
        "lemtomap doctor                                     find both devices and listen to them",
        "lemtomap doctor --kobuki /dev/ttyUSB0 --seconds 20  a longer look, for the gyro's drift",
    )


def doctor(
    *,
    kobuki: Annotated[
        str | None, typer.Option(metavar="PORT", help="the base's port; default: found by its USB identity")
    ] = None,
    hokuyo: Annotated[
        str | None, typer.Option(metavar="PORT", help="the laser's port; default: found by its USB identity")
    ] = None,
    seconds: Annotated[float, typer.Option(metavar="S", min=2.0, help="how long to listen to each")] = 6.0,
) -> int:
    """Check machine, ports and devices, and name every fault with its cure: moves nothing."""
    from lemtomap.robot.doctor.examine import examine, report

    return report(examine(kobuki, hokuyo, seconds))
