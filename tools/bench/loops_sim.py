"""Closures, cold starts, kidnaps and changed buildings in simulation, judged by truth.

    lemtomap bench loops_sim closures [--seeds 10] [--willow willow.yaml]   wrong closures, revisits closed
    lemtomap bench loops_sim atria    [--seeds 50]                          driven round halls, 4 starts each
    lemtomap bench loops_sim cold     [--world office] [--starts 50]        switched on anywhere in a map
    lemtomap bench loops_sim elsewhere [--world offices:24] [--starts 50]   ... where only a part is mapped
    lemtomap bench loops_sim kidnap   [--world office] [--starts 50]        carried or pushed somewhere else
    lemtomap bench loops_sim change   [--world office] [--starts 50]        furniture moved, doors shut
    lemtomap bench loops_sim steady   [--world office] [--rounds 12]        does the map stop growing?
    lemtomap bench loops_sim lookup   [--nodes 1000000]                     time of one look-up

What was measured stands in --out, one file a case, and is not measured again: stop and go on as you like.
Only mapping runs: real bytes through drivers, odometry, window and topological map, led by a script.
"""

import argparse
import json
import sqlite3
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from lemtomap.sim.tours import plan_tour
from lemtomap.sim.world import World
from lemtomap.topo.loops.descriptor import BYTES
from lemtomap.topo.loops.index import PlaceIndex
from tools.bench.parts import atria as halls
from tools.bench.parts.mapping_runs import table
from tools.bench.parts.sim_buildings import building, next_day
from tools.bench.parts.sim_maps import BINS, JudgedMap, still_true
from tools.bench.parts.sim_robot import SimRobot
from tools.bench.parts.sim_trials import (
    ENDS,
    LIMIT_M,
    LIMIT_S,
    Found,
    Trial,
)
from tools.bench.slam_parts import sparse

CLOSURE_WORLDS = {"office@3": 600.0, "loop": 420.0, "alike:16": 420.0, "offices:24": 600.0}  # seconds of tour
WILLOW_S, WILLOW_LARGE_S = 600.0, 1200.0
PART_S = 240.0  # of a tour that sees a part of a floor
MAP_S = {"office": 420.0}
MAP_USUAL_S = 5000.0  # of a tour that is to see a whole floor


def main(arguments: list[str]) -> int:
    """Run one part of the bench and print its figures."""
    parser = argparse.ArgumentParser(
        prog="lemtomap bench loops_sim",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("part", choices=PARTS)
    parser.add_argument("--world", default="office")
    parser.add_argument(
        "--willow", help="the thesis' floor plan; without it only built-in buildings are driven"
    )
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--starts", type=int, default=50)
    parser.add_argument("--rounds", type=int, default=12)
    parser.add_argument("--nodes", type=int, default=1_000_000)
    parser.add_argument("--out", type=Path, default=Path("runs/loops_sim"))
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    PARTS[options.part](options)
    return 0


# -- closures
# ------------------------------------------------------------------------------------------------


def closures(options: argparse.Namespace) -> None:
    """Map buildings that tempt to err, and count what was joined wrongly and what was not joined."""
    cases = dict(CLOSURE_WORLDS)
    if options.willow:
        cases |= {options.willow: WILLOW_S, f"{options.willow}@2": WILLOW_LARGE_S}
    found: dict[str, list[Found]] = {name: [] for name in cases}
    for seed in range(options.seeds):
        for name, seconds in cases.items():
            case = options.out / f"closures-{_key(name)}-{seed}"
            found[name].append(_kept(case, partial(_mapped, name, seed, seconds, case)))
            print(f"{Path(name).name} {seed}: {_brief(found[name][-1])}", flush=True)
    rows = [[Path(name).name, *_closure_row(each)] for name, each in found.items()]
    rows.append(["all", *_closure_row([each for many in found.values() for each in many])])
    head = ["world", "drives", "km", "closures", "wrong", "worst m", "revisits", "closed in 5 m", "map CPU s"]
    print(table(head, rows))
    _print_quality(each for many in found.values() for each in many)


def _mapped(name: str, seed: int, seconds: float, case: Path) -> Found:
    world = building(_seeded(name, seed))
    robot, path = SimRobot(world, seed), case.with_suffix(".lemto")
    for end in ENDS:
        path.with_suffix(end).unlink(missing_ok=True)
    judged = JudgedMap(path, world)
    judged.feed(robot.stand(1.0))
    judged.feed(robot.drive(plan_tour(world, seconds, seed=seed)))
    robot.close()
    return asdict(judged.close())


def _seeded(name: str, seed: int) -> str:
    return f"{name}:{seed}" if name.startswith("offices:") else name


def _brief(found: Found) -> str:
    return (
        f"{found['closures']} closures, {found['wrong']} wrong, {found['closed']} revisits closed, "
        f"{found['missed']} missed, {found['brief']} brief, {found['nodes']} nodes, "
        f"{found['cpu_s']:.0f} s CPU"
    )


def _closure_row(found: Sequence[Found]) -> list[str]:
    total = {
        key: sum(each[key] for each in found) for key in ("path_m", "closures", "wrong", "closed", "missed")
    }
    revisits = total["closed"] + total["missed"]
    share = f"{total['closed'] / revisits:.1%}" if revisits else "-"
    cpu_s = sum(each["cpu_s"] for each in found)
    worst_m = max((each["worst_m"] for each in found), default=0.0)
    return [
        str(len(found)),
        f"{total['path_m'] / 1000:.1f}",
        str(total["closures"]),
        str(total["wrong"]),
        f"{worst_m:.2f}",
        str(revisits),
        share,
        f"{cpu_s:.0f}",
    ]


def atria(options: argparse.Namespace) -> None:
    """Drive round atria, triangles and halls, and count what a person would have closed at once."""
    found: dict[str, list[Found]] = {}
    for wheels in sparse.WHEELS:
        for seed, start in product(range(options.seeds), range(halls.STARTS)):
            name = f"{halls.KINDS[seed % len(halls.KINDS)]}, {wheels}"
            case = options.out / f"atria-{wheels.replace(' ', '_')}-{seed}-{start}"
            told = _kept(case, partial(_driven_round, seed, start, wheels))
            found.setdefault(name, []).append(told)
            print(f"{name}, {seed} from {start}: {told}", flush=True)
    rows = []
    for name, each in [*found.items(), ("all", [told for many in found.values() for told in many])]:
        total = {key: sum(told[key] for told in each) for key in ("closures", "wrong", "closed", "missed")}
        share = f"{total['closed'] / max(1, total['closed'] + total['missed']):.1%}"
        worst_m = f"{max(told['worst_m'] for told in each):.2f}"
        rows.append([name, str(len(each)), str(total["closures"]), str(total["wrong"]), worst_m, share])
    print(table(["floor", "drives", "closures", "wrong", "worst m", "closed in 5 m"], rows))


def _driven_round(seed: int, start: int, wheels: str) -> Found:
    with tempfile.TemporaryDirectory() as folder:
        driven = halls.drive(seed, start, Path(folder), wheels)
    closures = {"closures": driven.closures, "wrong": driven.wrong, "worst_m": round(driven.worst_m, 3)}
    return closures | {"closed": driven.revisits.closed, "missed": driven.revisits.missed}


# -- finding itself
# ------------------------------------------------------------------------------------------------


def cold(options: argparse.Namespace) -> None:
    """Switch the robot on at random places of a mapped building."""
    world = building(options.world)
    trial = Trial(_place(options, world), options.out)
    _campaign("cold", options, lambda seed: trial.started(world, seed))


def elsewhere(options: argparse.Namespace) -> None:
    """Switch the robot on in the part of a building that its map does not hold; it must not be sure."""
    world = building(options.world)
    path: Path = options.out / f"part-{_key(options.world)}.lemto"
    if not path.with_suffix(".born.json").exists():
        path.unlink(missing_ok=True)
        _tour(path, world, PART_S, seed=0)
    trial = Trial(path, options.out)
    _campaign("elsewhere", options, lambda seed: trial.elsewhere(world, seed))


def change(options: argparse.Namespace) -> None:
    """The same the day after; then drive three rounds there, and see what of the map is still true."""
    world = building(options.world)
    source = _place(options, world)

    trial = Trial(source, options.out)
    _campaign("change", options, lambda seed: trial.started(next_day(world, seed), seed))
    rounds = _kept(options.out / f"follow-{_key(options.world)}", lambda: _followed(source, world, options))
    shares = "  ".join(f"{1.0 - share:.2%}" for share in rounds["true"])
    print(f"stored points that stand no more in the changed building, before and after each round: {shares}")
    print(f"the same in the unchanged building: {1.0 - rounds['usual']:.2%}")


def kidnap(options: argparse.Namespace) -> None:
    """Carry or push the robot, which knows where it is, somewhere else; every second time no wheel tells."""
    world = building(options.world)
    trial = Trial(_place(options, world), options.out)
    _campaign("kidnap", options, lambda seed: trial.carried(world, seed))


def _campaign(part: str, options: argparse.Namespace, run: Callable[[int], Found]) -> None:
    found = []
    for seed in range(options.starts):
        case = options.out / f"{part}-{_key(options.world)}-{seed}"
        found.append(_kept(case, partial(run, seed)))
        print(f"{part} {seed}: {found[-1]['told']}", flush=True)
    ok, wrong = sum(each["ok"] for each in found), sum(each["wrong"] for each in found)
    way_m = [each["way_m"] for each in found if each["found"]]
    time_s = [each["time_s"] for each in found if each["found"]]
    print(
        f"\n{part}, {Path(options.world).name}: right within {LIMIT_S:.0f} s and {LIMIT_M:.0f} m "
        f"{ok} of {len(found)} ({ok / len(found):.0%}), confidently wrong {wrong}"
    )
    if way_m:
        print(
            f"way until found: median {np.median(way_m):.1f} m, 95 % {np.percentile(way_m, 95):.1f} m; "
            f"time: median {np.median(time_s):.1f} s, 95 % {np.percentile(time_s, 95):.1f} s"
        )
    _print_quality(each["score"] for each in found)


def _place(options: argparse.Namespace, world: World) -> Path:
    """Return the map of a building, made once."""
    path: Path = options.out / f"map-{_key(options.world)}.lemto"
    if not path.with_suffix(".born.json").exists():
        path.unlink(missing_ok=True)
        _tour(path, world, MAP_S.get(options.world, MAP_USUAL_S), seed=0)
    return path


def _tour(path: Path, world: World, seconds: float, seed: int) -> Found:
    robot, judged = SimRobot(world, seed), JudgedMap(path, world)
    judged.feed(robot.stand(1.0))
    judged.feed(robot.drive(plan_tour(world, seconds, seed=seed)))
    robot.close()
    return asdict(judged.close())


# -- long-term operation, look-up
# ------------------------------------------------------------------------------------------------


def _followed(source: Path, world: World, options: argparse.Namespace) -> Found:
    """Drive three rounds in the changed building on the old map."""
    changed = next_day(world, 1)
    path = options.out / f"follow-{_key(options.world)}.lemto"
    for end in ENDS:
        path.with_suffix(end).write_bytes(source.with_suffix(end).read_bytes())
    shares = [still_true(path, changed)]
    for seed in range(3):
        _tour(path, changed, MAP_S.get(options.world, MAP_USUAL_S), seed=10 + seed)
        shares.append(still_true(path, changed))
    return {"true": shares, "usual": still_true(source, world)}


def steady(options: argparse.Namespace) -> None:
    """Drive round after round in one building, each a run of its own on the same map."""
    world = building(options.world)
    path: Path = options.out / f"steady-{_key(options.world)}.lemto"
    if not path.with_suffix(".born.json").exists():
        path.unlink(missing_ok=True)
    for seed in range(options.rounds):
        case = options.out / f"steady-{_key(options.world)}-{seed}"
        found = _kept(case, partial(_tour, path, world, MAP_S.get(options.world, MAP_USUAL_S), seed))
        print(f"round {seed + 1}: {_brief(found)}", flush=True)


class _Memory:
    """A table in memory, as the index wants one."""

    def __init__(self) -> None:
        self._db = sqlite3.connect(":memory:", isolation_level=None)

    def write(self, sql: str, values: Iterable[Any] = ()) -> None:
        """Run one statement."""
        self._db.execute(sql, tuple(values))

    def query(self, sql: str, values: Iterable[Any] = ()) -> Iterator[tuple[Any, ...]]:
        """Iterate over the rows of a read."""
        yield from self._db.execute(sql, tuple(values))


def lookup(options: argparse.Namespace) -> None:
    """Time look-ups among descriptors that cluster as places do: kinds of rooms, each a little different."""
    rng = np.random.default_rng(0)
    kinds = rng.normal(90.0, 40.0, (500, BYTES))
    every = kinds[rng.integers(len(kinds), size=options.nodes)] + rng.normal(
        0.0, 15.0, (options.nodes, BYTES)
    )
    codes = every.clip(0, 255).astype(np.uint8)
    index, begun_s = PlaceIndex(_Memory()), time.thread_time()
    for node_id, code in enumerate(codes):
        index.add(node_id, code.tobytes())
    print(f"{options.nodes} places added, {1e6 * (time.thread_time() - begun_s) / options.nodes:.0f} us each")
    asked = (codes[rng.integers(options.nodes, size=200)] + rng.normal(0.0, 8.0, (200, BYTES))).clip(0, 255)
    for leaves in (24, 96):
        begun_s = time.thread_time()
        for code in asked.astype(np.uint8):
            index.nearest(code.tobytes(), 48, leaves=leaves)
        print(f"one look-up, {leaves} leaves: {1e3 * (time.thread_time() - begun_s) / len(asked):.2f} ms")


# -- keeping and printing
# ------------------------------------------------------------------------------------------------


def _kept(case: Path, measure: Callable[[], Found]) -> Found:
    """Return what was measured before, or measure it now and keep it."""
    told = Path(f"{case}.json")
    if not told.exists():
        told.write_text(json.dumps(measure(), default=float))
    found: Found = json.loads(told.read_text())
    return found


def _print_quality(scores: Iterable[Found]) -> None:
    """Print how often poses of each quality are right."""
    scores = list(scores)
    poses = np.sum([score["poses"] for score in scores], axis=0)
    right = np.sum([score["right"] for score in scores], axis=0)
    rows = []
    for low, high in ((0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 0.9), (0.9, 1.0)):
        span = slice(round(low * BINS), round(high * BINS))
        count = int(poses[span].sum())
        share = f"{right[span].sum() / count:.2%}" if count else "-"
        rows.append([f"{low:.2f} to {high:.2f}", str(count), share])
    print(table(["pose quality", "poses", "within 10 cm and 2 degrees"], rows))


def _key(name: str) -> str:
    return Path(name).name.replace(":", "_").replace(".", "_")  # a dot would begin the suffix of each file


PARTS: dict[str, Callable[[argparse.Namespace], None]] = {
    "closures": closures,
    "atria": atria,
    "cold": cold,
    "elsewhere": elsewhere,
    "kidnap": kidnap,
    "change": change,
    "steady": steady,
    "lookup": lookup,
}

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
