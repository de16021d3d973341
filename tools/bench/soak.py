"""Hours of simulated driving in the large building: memory, CPU, closures and goals, minute by minute.

    lemtomap bench soak --hours 4             lock-step, many times faster than real time
    lemtomap bench soak --report runs/soak    the report of a soak that still runs or was stopped

The robot explores, then drives to places drawn at random from its own map. Each simulated minute leaves a
line in samples.jsonl, so that a soak can be looked at while it runs and Ctrl-C loses nothing. Resident
memory is read after the allocator has given back what is free (malloc_trim), and is that of one process
with robot and simulator in it: its slope is what counts, not its height. Closures are judged by the truth
that only the simulator knows. Leaves soak.json, soak.md and soak.png; exit code 1 when a limit is broken.
"""

import argparse
import json
import signal
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from lemtomap.robot.build import build_core
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.runs.lockstep import run_lockstep
from lemtomap.robot.runs.warmup import warm_up
from lemtomap.sim import worlds
from lemtomap.sim.errors import BadWorld
from lemtomap.sim.simulator import Simulator
from tools.bench.soak_parts.judging import Verdict, judge
from tools.bench.soak_parts.mission import ExploreThenGoals
from tools.bench.soak_parts.watching import Watcher
from tools.bench.thesis_parts.worlds import LARGE_WORLD


@dataclass(frozen=True, slots=True)
class SoakOptions:
    """What to drive."""

    world: str = LARGE_WORLD
    hours: float = 4.0
    explore_min: float = 45.0
    """At most so long is explored; the rest of the time goes to goals."""
    seed: int = 0


def soak(options: SoakOptions, out: Path) -> None:
    """Drive; what is seen goes into files of `out`. Ctrl-C ends it early."""
    out.mkdir(parents=True, exist_ok=True)
    map_path = out / "map.lemto"
    for old in out.glob("map.lemto*"):
        old.unlink()
    warm_up(RobotConfig())  # as every run does: what is loaded once is no growth
    simulator = Simulator(worlds.load(options.world), seed=options.seed)
    core = build_core(RobotConfig(), map_path, durable=False, seed=options.seed)
    mission = ExploreThenGoals(options.explore_min * 60.0, options.seed)
    (out / "options.json").write_text(json.dumps(asdict(options)))
    signal.signal(
        signal.SIGTERM, signal.default_int_handler
    )  # stopped by another program: report all the same
    try:
        with Watcher(simulator, core, mission, out) as watcher:
            run_lockstep(simulator, core, mission, options.hours * 3600.0, watch=watcher.watch)
    except KeyboardInterrupt:
        print("interrupted: the report is of what was driven so far", file=sys.stderr)
    finally:
        core.close()
        simulator.close()


def report(out: Path) -> Verdict:
    """Write soak.json, soak.md and soak.png from what a soak left; return what it showed."""
    verdict = judge(out)
    (out / "soak.json").write_text(json.dumps(asdict(verdict), indent=1))
    (out / "soak.md").write_text(verdict.text() + "\n")
    return verdict


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="lemtomap bench soak", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    usual = SoakOptions()
    parser.add_argument("--world", default=usual.world)
    parser.add_argument("--hours", type=float, default=usual.hours, help="simulated time, default 4")
    parser.add_argument("--explore-min", type=float, default=usual.explore_min, metavar="MIN")
    parser.add_argument("--seed", type=int, default=usual.seed)
    parser.add_argument("--out", type=Path, default=Path("runs/soak"))
    parser.add_argument("--report", type=Path, metavar="DIR", help="only report on what stands there")
    asked: Any = parser.parse_args(arguments)
    if asked.hours <= 0.0:
        print(f"--hours {asked.hours}: must be more than 0", file=sys.stderr)
        return 2
    out = asked.report or asked.out
    if asked.report is None:
        try:
            soak(SoakOptions(asked.world, asked.hours, asked.explore_min, asked.seed), out)
        except BadWorld as error:
            print(error, file=sys.stderr)
            return 2
    elif not (out / "samples.jsonl").exists():
        print(f"{out / 'samples.jsonl'}: no such file; no soak was run there", file=sys.stderr)
        return 2
    verdict = report(out)
    print(verdict.text())
    print(f"\npicture: {out / 'soak.png'}")
    return 0 if verdict.passed else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
