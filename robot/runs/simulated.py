"""`lemtomap sim`: the whole robot in a simulated building, in lock-step or in real time."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from lemtomap.drivers.port import open_serial
from lemtomap.errors import BadSetting
from lemtomap.grid import DEFAULT_SLAM
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.core import RobotCore
from lemtomap.robot.devices.depth import DepthFeed
from lemtomap.robot.devices.parts import DEFAULT_LIMIT
from lemtomap.robot.missions.missions import parse_mission
from lemtomap.robot.missions.places import mission_from
from lemtomap.robot.output.display import has_display
from lemtomap.robot.output.onlooker import LOOK_PERIOD_S
from lemtomap.robot.output.progress import Bar, first_use
from lemtomap.robot.runs.lockstep import run_lockstep
from lemtomap.robot.runs.run import (
    Run,
    RunPlan,
    Stopped,
    Teller,
)
from lemtomap.robot.runs.runtime import Ports, Runtime
from lemtomap.robot.runs.sim_server import FakeHardware, mounting_of
from lemtomap.robot.runs.warmup import warm_up
from lemtomap.sim import worlds
from lemtomap.sim.picture import outlines
from lemtomap.sim.simulator import Simulator
from lemtomap.topo.file.store import TopoStore


@dataclass(frozen=True, slots=True)
class SimOptions:
    """What the user asked for."""

    world: str
    mission: str
    duration_s: float
    out: Path
    seed: int = 0
    slam: str = DEFAULT_SLAM
    fast: bool = False
    gui: bool = False
    live: bool = True
    map_path: Path | None = None
    """A map to go on with, wherever in it the robot stands; None: a new one."""
    depth: bool = False
    """Carry the simulated depth camera, too."""
    record_limit: int = DEFAULT_LIMIT
    """Bytes of each recording."""
    config: RobotConfig = field(default_factory=RobotConfig)
    """The robot's settings; the simulated laser sits where they say."""


def run_sim(options: SimOptions, bar: Bar) -> dict[str, Any]:
    """Run until the mission is over or the time is up; return the summary. Raises BadWorld, BadSetting."""
    for remark in worlds.load(options.world).remarks:
        bar.say(remark)
    if options.map_path is not None and options.map_path.exists():
        TopoStore.view(options.map_path).close()
    parse_mission(options.mission)
    options = replace(options, mission=mission_from(options.mission, options.map_path))
    if options.depth and not options.fast:
        raise BadSetting("--depth: the simulated camera has no cable in real time; add --fast")
    plan = RunPlan(
        out=options.out,
        map_path=options.map_path or options.out / "map.lemto",
        title=f"{Path(options.world).stem}: {options.mission}",
        seed=options.seed,
        slam=options.slam,
        config=options.config,
        live=options.live and has_display(),
        record_limit=options.record_limit,
        replace=True,
        keep_map=options.map_path is not None,
        facts={"world": options.world, "mission": options.mission},
    )
    with Run(plan, Teller(bar, options.duration_s)) as run:
        if not options.fast:
            with first_use(bar):
                warm_up(plan.config, options.slam)
        drive = _drive_fast if options.fast else _drive_in_real_time
        drive(options, run)
    return run.summary


def _drive_fast(options: SimOptions, run: Run) -> None:
    """Run in lock-step on a virtual clock."""
    mounting = mounting_of(options.config)
    simulator = Simulator(worlds.load(options.world), options.seed, gui=options.gui, mounting=mounting)
    run.files.show_world(outlines(simulator.world), lambda: simulator.truth().T_world_base)
    look_at_s = 0.0
    camera = camera_of(simulator, run.core) if options.depth else None

    def watch(now_s: float) -> None:
        nonlocal look_at_s
        run.check()
        if camera is not None:
            camera.poll(now_s)
        if now_s >= look_at_s:
            look_at_s = now_s + LOOK_PERIOD_S
            run.files.look(now_s)

    try:
        mission = parse_mission(options.mission)
        times = run.core.efforts.threads
        with run.until_asked(), times.running(), times.thread("robot and simulator"):
            ended = run_lockstep(simulator, run.core, mission, options.duration_s, run.files.raw.put, watch)
        run.end(ended, truth_of(simulator))
    except Stopped as stopped:
        run.stopped(simulator.now_s, stopped, truth_of(simulator))
    finally:
        simulator.close()


def camera_of(simulator: Simulator, core: RobotCore) -> DepthFeed:
    """Return the simulated depth camera as the robot takes it."""
    return DepthFeed(lambda: simulator.camera.points_base(simulator.depth_image()), core.exchange)


def truth_of(simulator: Simulator) -> dict[str, Any]:
    """Return what only the simulator knows of how it went."""
    truth = simulator.truth()
    return {"contacts": truth.contact_count, "contact_s": truth.contact_s, "true_path_m": truth.path_m}


def _drive_in_real_time(options: SimOptions, run: Run) -> None:
    """Run on the wall clock, the simulator in a process of its own behind pseudo-terminals."""
    mounting = mounting_of(options.config)
    with FakeHardware(options.world, options.seed, gui=options.gui, mounting=mounting) as hardware:
        run.files.show_world(outlines(worlds.load(options.world)), hardware.true_pose)
        ports = Ports(lambda: open_serial(hardware.kobuki), lambda: open_serial(hardware.hokuyo))
        runtime = Runtime(run.core, ports, run.files)
        ended = runtime.run(parse_mission(options.mission), options.duration_s)
    truth = hardware.truth
    told = {key: truth[key] for key in ("contacts", "contact_s") if key in truth}
    run.end(ended, told | ({"true_path_m": truth["path_m"]} if truth else {}))
