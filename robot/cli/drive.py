"""Commands that drive a robot, real or simulated, and look at what it did."""

import math
from collections.abc import Sequence
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from lemtomap.robot.cli.help import add
from lemtomap.robot.cli.options import Config, Set
from lemtomap.robot.missions.places import check_places, mission_from

MISSIONS = (
    "explore, tour, goto:PLACE (a node's number, its name, far, start), level:N (on that floor now), dock, "
    "several joined by commas"
)

Mission = Annotated[str, typer.Option(metavar="WHAT", help=MISSIONS)]
Kobuki = Annotated[str | None, typer.Option(metavar="PORT", help="the base; default: found by USB identity")]
Hokuyo = Annotated[str | None, typer.Option(metavar="PORT", help="the laser; default: found by USB identity")]
MapFile = Annotated[
    Path | None, typer.Option("--map", metavar="FILE.lemto", help="map to go on with, or to make")
]
Out = Annotated[
    Path | None, typer.Option(metavar="DIR", help="folder for the results; default runs/DATE_TIME")
]
RecordLimit = Annotated[
    str,
    typer.Option(
        metavar="SIZE",
        help="of run.mcap and of run.rrd, each; beyond it the oldest parts go",
    ),
]
Duration = Annotated[
    float, typer.Option(metavar="S", min=1.0, help="end at the latest after this many seconds")
]


class Nav(StrEnum):
    """What plans the way in a simulated building."""

    TOPOLOGICAL = "topological"
    METRIC = "metric"


def register(app: typer.Typer) -> None:
    """Add this module's commands to the program, in the order of the help page."""
    add(
        app,
        sim,
        "lemtomap sim                                        explore the office, drive to its far end",
        "lemtomap sim --fast --mission goto:12               lock-step: explore, then go there",
        "lemtomap sim --map office.lemto --mission goto:12   find its place in that map, then go",
        "lemtomap sim --world plan.yaml --duration 600       any ROS map_server floor plan",
        "lemtomap sim --fast --nav metric --mission goto:13:3    the metric baseline, to a point of the plan",
        "lemtomap sim --config robot.toml --set nav.body.v_max_mps=0.3    other settings",
        "lemtomap sim --serve                                only the fake hardware, on two pseudo-terminals",
    )
    add(
        app,
        run,
        "lemtomap run                                        explore with the robot found on USB",
        "lemtomap run --map office.lemto                     go on with a map, or begin it",
        "lemtomap run --map office.lemto --mission goto:kitchen",
        "lemtomap run --kobuki /dev/pts/3 --hokuyo /dev/pts/4    the ports of 'lemtomap sim --serve'",
    )
    add(
        app,
        goto,
        "lemtomap goto kitchen --map office.lemto",
        "lemtomap goto 12 --map office.lemto",
    )
    add(
        app,
        teleop,
        "lemtomap teleop                                     drive by the keyboard, mapping on the way",
    )
    add(app, record, "lemtomap record --out runs/carried                  the robot stands or is pushed")
    add(
        app,
        replay,
        "lemtomap replay runs/demo --out runs/again",
        "lemtomap replay runs/demo --out runs/window --slam window",
        "lemtomap replay runs/demo --set slam.window_m=12     the run's own settings, but for one",
    )
    add(
        app,
        view,
        "lemtomap view runs/demo",
        "lemtomap view runs/demo --web                       on a machine without a display",
    )


def sim(
    *,
    world: Annotated[
        str,
        typer.Option(
            metavar="NAME|FILE", help="a built-in world ('list' shows them), or a .yaml or .toml file"
        ),
    ] = "office",
    mission: Mission = "explore,goto:far,goto:start",
    duration: Duration = 900.0,
    fast: Annotated[
        bool, typer.Option("--fast", help="lock-step on a virtual clock, as fast as the machine can")
    ] = False,
    gui: Annotated[
        bool, typer.Option("--gui", help="also open pybullet's own window (needs a display)")
    ] = False,
    serve: Annotated[bool, typer.Option("--serve", help="only the fake hardware, until interrupted")] = False,
    seed: Annotated[int, typer.Option(metavar="N", help="of noise in the world and of the particles")] = 0,
    map_file: MapFile = None,
    depth: Annotated[
        bool, typer.Option("--depth", help="carry a depth camera, which sees what the laser overlooks")
    ] = False,
    record_limit: RecordLimit = "2GB",
    nav: Annotated[
        Nav, typer.Option(help="metric: the baseline, AMCL and a planner over the whole plan; goto:X:Y")
    ] = Nav.TOPOLOGICAL,
    config: Config = None,
    orders: Set = None,
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="folder for the results; an earlier run's are replaced")
    ] = Path("runs/sim"),
) -> None:
    """Run the whole robot in a simulated building, on fake serial ports."""
    from lemtomap.robot.settings.read import read_settings

    settings = read_settings(config, orders or ())
    if world == "list":
        typer.echo(list_worlds(out))
        return
    if serve:
        from lemtomap.robot.runs.sim_server import mounting_of
        from lemtomap.sim.serve import serve_world

        serve_world(
            world, seed, duration_s=math.inf, truth_path=None, gui=gui, mounting=mounting_of(settings.config)
        )
        return
    if nav is Nav.TOPOLOGICAL:
        check_places(mission_from(mission, map_file), map_file)
    from lemtomap.robot.devices.parts import parse_size
    from lemtomap.robot.output.closing_lines import conclude
    from lemtomap.robot.output.progress import progress_bar
    from lemtomap.robot.runs.simulated import SimOptions, run_sim

    options = SimOptions(
        world,
        mission,
        duration,
        out,
        seed,
        fast=fast,
        gui=gui,
        map_path=map_file,
        depth=depth,
        record_limit=parse_size(record_limit),
        config=settings.config,
    )
    if nav is Nav.METRIC:
        from lemtomap.robot.runs.metric import run_metric, told_after_metric

        with progress_bar(f"sim {world}, metric") as bar:
            summary = run_metric(options, bar)
        typer.echo(told_after_metric(summary))
        raise typer.Exit(summary["result"] == "failed")
    with progress_bar(f"sim {world}") as bar:
        summary = run_sim(options, bar)
    conclude(summary)


def list_worlds(out: Path) -> str:
    """Return a line about each built-in world, and draw each into out/worlds."""
    from lemtomap.sim import worlds
    from lemtomap.sim.picture import save_picture

    folder = out / "worlds"
    folder.mkdir(parents=True, exist_ok=True)
    lines = []
    for name, about in worlds.describe().items():
        picture = folder / f"{name}.png"
        save_picture(worlds.load(name), picture)
        lines.append(f"{name:9s} {about}\n          {picture}")
    return "\n".join(lines)


def run(
    *,
    kobuki: Kobuki = None,
    hokuyo: Hokuyo = None,
    map_file: MapFile = None,
    mission: Mission = "explore",
    duration: Duration = math.inf,
    out: Out = None,
    config: Config = None,
    orders: Set = None,
    record_limit: RecordLimit = "2GB",
    seed: Annotated[int, typer.Option(metavar="N", help="of the particles")] = 0,
) -> None:
    """Run the real robot: map, explore, drive to places. Ctrl-C stops it and writes the results."""
    check_places(mission, map_file)
    from lemtomap.robot.devices.parts import parse_size
    from lemtomap.robot.runs.real import RobotOptions

    settings = _settings(config, orders, kobuki, hokuyo)
    limit = parse_size(record_limit)
    _drive("run", RobotOptions(mission, duration, settings, map_file, out, seed, record_limit=limit))


def goto(
    place: Annotated[
        str,
        typer.Argument(metavar="PLACE", help="a node's number or name, an area's name, area:7, far, start"),
    ],
    map_file: Annotated[
        Path, typer.Option("--map", metavar="FILE.lemto", help="the map that knows the place")
    ],
    *,
    kobuki: Kobuki = None,
    hokuyo: Hokuyo = None,
    out: Out = None,
    config: Config = None,
    orders: Set = None,
) -> None:
    """Drive the real robot to a place of a map."""
    if not map_file.exists():
        raise typer.BadParameter(f"{map_file}: no such map file", param_hint="--map")
    check_places(f"goto:{place}", map_file)
    from lemtomap.robot.runs.real import RobotOptions

    settings = _settings(config, orders, kobuki, hokuyo)
    _drive("goto", RobotOptions(f"goto:{place}", math.inf, settings, map_file, out))


def teleop(
    *,
    kobuki: Kobuki = None,
    hokuyo: Hokuyo = None,
    map_file: MapFile = None,
    out: Out = None,
    config: Config = None,
    orders: Set = None,
) -> None:
    """Drive the real robot by the keyboard, mapping on the way; a digit says on which floor it is now."""
    from lemtomap.robot.motion.teleop import HELP
    from lemtomap.robot.runs.real import RobotOptions

    settings = _settings(config, orders, kobuki, hokuyo)
    typer.echo(HELP)
    _drive("teleop", RobotOptions("idle", math.inf, settings, map_file, out, by_hand=True))


def record(
    *,
    kobuki: Kobuki = None,
    hokuyo: Hokuyo = None,
    duration: Duration = math.inf,
    out: Out = None,
    config: Config = None,
    orders: Set = None,
    record_limit: RecordLimit = "2GB",
) -> None:
    """Record both devices' bytes, and map, without driving; 'lemtomap replay' maps the recording anew."""
    from lemtomap.robot.devices.parts import parse_size
    from lemtomap.robot.runs.real import RobotOptions

    settings = _settings(config, orders, kobuki, hokuyo)
    limit = parse_size(record_limit)
    _drive("record", RobotOptions("idle", duration, settings, None, out, record_limit=limit))


def replay(
    recording: Annotated[Path, typer.Argument(metavar="RUN", help="a run's folder, or its run.mcap")],
    *,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="folder for the results; default runs/replay_DATE_TIME")
    ] = None,
    slam: Annotated[
        str | None, typer.Option(help="window, rolling or gmapping; default: as the run mapped")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(metavar="N", help="of the particles; default: as the run mapped")
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(metavar="FILE.toml", help="settings instead of those that the run recorded"),
    ] = None,
    orders: Set = None,
) -> None:
    """Feed a recorded run's bytes through the same drivers and map it anew, as fast as the machine can."""
    from lemtomap.robot.output.closing_lines import conclude
    from lemtomap.robot.output.progress import progress_bar
    from lemtomap.robot.runs.replayed import Changes, replay_run

    folder = out or Path("runs") / f"replay_{datetime.now(UTC).astimezone():%Y-%m-%d_%H-%M-%S}"
    with progress_bar("replay") as bar:
        summary = replay_run(recording, folder, bar, Changes(slam, seed, config, tuple(orders or ())))
    conclude(summary)


def view(
    path: Annotated[Path, typer.Argument(metavar="RUN", help="a run's folder, or its run.rrd")],
    *,
    web: Annotated[
        bool, typer.Option("--web", help="serve it to a browser instead of opening a window")
    ] = False,
) -> None:
    """Look at a recording in the Rerun viewer."""
    from lemtomap.robot.output.view import open_recording

    open_recording(path, typer.echo, web=web)


def _settings(
    config: Path | None, orders: Sequence[str] | None, kobuki: str | None, hokuyo: str | None
) -> Any:
    """Return the settings of the real robot, a RobotConfig. Raises BadSetting."""
    from serial.tools import list_ports

    from lemtomap.robot.settings.read import read_settings

    options = {"--kobuki": ("ports.kobuki", kobuki), "--hokuyo": ("ports.hokuyo", hokuyo)}
    return read_settings(config, orders or (), options=options, ports=list_ports.comports).config


def _drive(name: str, options: object) -> None:
    """Run the real robot and tell what came of it."""
    from lemtomap.robot.output.closing_lines import conclude
    from lemtomap.robot.output.progress import progress_bar
    from lemtomap.robot.runs.real import RobotOptions, run_robot

    assert isinstance(options, RobotOptions)  # noqa: S101 - typed loosely, so that the import stays in here
    with progress_bar(name) as bar:
        summary = run_robot(options, bar)
    conclude(summary)
