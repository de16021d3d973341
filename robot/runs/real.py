"""`lemtomap run`: the real robot on two USB cables."""

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from lemtomap.drivers.port import BytePort, open_serial
from lemtomap.errors import BadSetting
from lemtomap.grid import DEFAULT_SLAM
from lemtomap.robot.config import PortsConfig, RobotConfig
from lemtomap.robot.devices import ports
from lemtomap.robot.devices.parts import DEFAULT_LIMIT
from lemtomap.robot.missions.missions import parse_mission
from lemtomap.robot.motion.teleop import KeyListener, driven_by_hand
from lemtomap.robot.output.display import has_display
from lemtomap.robot.output.progress import Bar, first_use
from lemtomap.robot.runs.run import Run, RunPlan, Teller
from lemtomap.robot.runs.runtime import Ports, Runtime
from lemtomap.robot.runs.warmup import warm_up
from lemtomap.topo.events import LevelChanged
from lemtomap.topo.file.store import TopoStore


@dataclass(frozen=True, slots=True)
class RobotOptions:
    """What the user asked for; None: the default."""

    mission: str
    duration_s: float
    config: RobotConfig = field(default_factory=RobotConfig)
    map_path: Path | None = None
    out: Path | None = None
    seed: int = 0
    slam: str = DEFAULT_SLAM
    by_hand: bool = False
    """Drive by the keyboard, over whatever the mission wants."""
    record_limit: int = DEFAULT_LIMIT
    """Bytes of each recording."""


def run_robot(options: RobotOptions, bar: Bar) -> dict[str, Any]:
    """Run until the mission is over or somebody stops it; return the summary.

    Raises BadSetting, BadMap, PortError and WrongDevice before anything moves; then nothing is left behind.
    """
    mission = parse_mission(options.mission)
    found = find_ports(options.config.ports)
    asyncio.run(_try(found))
    out = options.out or Path("runs") / datetime.now(UTC).astimezone().strftime("%Y-%m-%d_%H-%M-%S")
    plan = RunPlan(
        out=out,
        map_path=_map_path(out, options.map_path),
        title=f"{out.name}: {options.mission}",
        seed=options.seed,
        slam=options.slam,
        config=replace(options.config, ports=found),
        live=has_display(),
        record_limit=options.record_limit,
        facts={"mission": options.mission, "kobuki": found.kobuki, "hokuyo": found.hokuyo},
    )
    with Run(plan, Teller(bar, options.duration_s)) as run:
        with first_use(bar):
            warm_up(plan.config, options.slam)
        runtime = Runtime(run.core, Ports(_opener(found.kobuki), _opener(found.hokuyo)), run.files)
        with _hands(options, runtime):
            run.end(runtime.run(mission, options.duration_s))
    return run.summary


def _hands(options: RobotOptions, runtime: Runtime) -> AbstractContextManager[None]:
    """Return what lets a person drive, or nothing."""
    if not options.by_hand:
        return nullcontext()
    core = runtime.core

    def change_level(level: int) -> None:
        core.exchange.nav_events.put(LevelChanged(level))

    listener = KeyListener(core.base.teleop, change_level, runtime.stop.set)
    return driven_by_hand(listener, runtime.clock.now_s, options.config.teleop)


def find_ports(config: PortsConfig) -> PortsConfig:
    """Return both ports: as configured, else by USB identity. Raises PortMissing, BadSetting."""
    kobuki = config.kobuki or ports.find(ports.KOBUKI)
    hokuyo = config.hokuyo or ports.find(ports.HOKUYO)
    if kobuki == hokuyo:
        raise BadSetting(f"{kobuki}: given for both devices")
    return PortsConfig(kobuki, hokuyo)


def _map_path(out: Path, wanted: Path | None) -> Path:
    """Return where the map is or will be; an existing one must be asked for by name."""
    if wanted is not None:
        if wanted.exists():
            TopoStore.view(wanted).close()
        return wanted
    path = out / "map.lemto"
    if path.exists():
        raise BadSetting(
            f"{path}: a map is there already; go on with it by --map {path}, or give another --out"
        )
    return path


async def _try(found: PortsConfig) -> None:
    """Open and close both ports, so that a bad one is told at once. Raises PortError."""
    for path in (found.kobuki, found.hokuyo):
        await (await open_serial(path)).aclose()


def _opener(path: str) -> Callable[[], Awaitable[BytePort]]:
    """Return what opens this port."""
    return lambda: open_serial(path)
