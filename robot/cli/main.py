"""The `lemtomap` command: what a person types, and the one line they read when it cannot be done.

Exit codes: 0 done, 1 a fault of ours or a failed check, 2 unusable input or device, 130 interrupted.
"""

import contextlib
import os
import sys
import traceback
from collections.abc import Sequence
from typing import Annotated

import typer

from lemtomap.drivers.errors import DriverError
from lemtomap.errors import LemtomapError
from lemtomap.robot.cli import config as cli_config
from lemtomap.robot.cli import doctor as cli_doctor
from lemtomap.robot.cli import drive as cli_drive
from lemtomap.robot.cli import file as cli_file
from lemtomap.robot.cli import map as cli_map
from lemtomap.robot.cli.help import Interrupted
from lemtomap.robot.runs.interrupts import on_interrupt, raise_interrupt
from lemtomap.sim.errors import SimError
from lemtomap.topo.naming import shown

LINE = 2000  # characters that a person is told at once
INTERRUPTED = 130  # as shells say it: 128 and SIGINT
DEBUG_VARIABLE = "LEMTOMAP_DEBUG"  # set: show the traceback of an unexpected error

app = typer.Typer(
    name="lemtomap",
    help=(
        "Map a building with a TurtleBot 2 and send it to places by name.\n\n"
        "\b\n"
        "lemtomap sim                              the whole robot in simulation, no hardware needed\n"
        "lemtomap run --map office.lemto           the real robot on two USB cables\n"
        "lemtomap map intel.clf --out out/intel    a recorded log\n"
        "lemtomap doctor                           what is missing, and its cure\n"
        "lemtomap --install-completion             let the shell complete commands and options"
    ),
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def _say_version(wanted: bool) -> None:  # noqa: FBT001 - typer's signature
    if wanted:
        from lemtomap.robot.output.files import versions

        typer.echo("\n".join(f"{name} {version}" for name, version in versions().items()))
        raise typer.Exit


@app.callback()
def _program(
    *,
    version: Annotated[
        bool,
        typer.Option("--version", callback=_say_version, is_eager=True, help="say which version this is"),
    ] = False,
) -> None:
    """Take what concerns no single command."""


cli_drive.register(app)
cli_config.register(app)
cli_doctor.register(app)
cli_map.register(app)
cli_file.register(app)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; when it goes wrong the user reads one line, no traceback."""
    try:
        with on_interrupt(raise_interrupt):
            result = app(
                args=list(sys.argv[1:] if arguments is None else arguments),
                prog_name="lemtomap",
                standalone_mode=False,
            )
    except typer.TyperException as error:
        return _usage(error)
    except (LemtomapError, DriverError, SimError) as error:
        return _fail(2, str(error))
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        return _fail(2, f"{place}{error.strerror or error}")
    except (KeyboardInterrupt, typer.Abort, Interrupted) as stopped:
        return _fail(INTERRUPTED, str(stopped) or "interrupted")
    except Exception as error:  # noqa: BLE001 - the user gets one line, whatever it is
        if os.environ.get(DEBUG_VARIABLE):
            traceback.print_exc()
        return _fail(1, f"unexpected {type(error).__name__}: {error} ({DEBUG_VARIABLE}=1 shows where)")
    code = result if isinstance(result, int) else 0
    return _fail(code, "interrupted") if code == INTERRUPTED else code  # typer's own word for Ctrl-C


def _usage(error: typer.TyperException) -> int:
    """Say in one line what is wrong with the options; the bare command shows its help instead."""
    context = getattr(error, "ctx", None)
    command = context.command_path if context else "lemtomap"
    text = error.format_message()
    if "\n" in text:
        sys.stdout.write(text + "\n")
        return 2
    return _fail(2, f"{text.rstrip('.')} (see '{command} --help')")


def _fail(code: int, text: str) -> int:
    """Write one line to stderr, nothing in it that a terminal would obey."""
    line = shown(" ".join(text.split()), LINE)
    with contextlib.suppress(OSError):  # nobody reads any more
        sys.stderr.write(f"lemtomap: {line}\n")
    return code
