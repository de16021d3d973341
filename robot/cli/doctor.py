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
        "sudo lemtomap doctor --install-udev                 stable names and prompt bytes for both cables",
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
    install_udev: Annotated[
        bool, typer.Option("--install-udev", help="write the udev rules for both cables; needs root")
    ] = False,
    seconds: Annotated[float, typer.Option(metavar="S", min=2.0, help="how long to listen to each")] = 6.0,
) -> int:
    """Check machine, ports and devices, and name every fault with its cure: moves nothing."""
    if install_udev:
        from lemtomap.robot.doctor import udev_rules

        typer.echo(f"{udev_rules.install_udev()}: written; plug both cables in again")
        return 0
    from lemtomap.robot.doctor.examine import examine, report

    return report(examine(kobuki, hokuyo, seconds))
