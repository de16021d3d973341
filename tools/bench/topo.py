"""What the topological map costs as it grows to a million nodes, and what a kill loses.

    python tools/bench/topo.py scale [--nodes 1000000] [--all-driven]   synthetic drive, no rays
    python tools/bench/topo.py kill [--times 200]                       kill -9 at random moments
    python tools/bench/topo.py turned                                   the map is the same in any grid frame

A million nodes are laid by the store in bulk between the stretches that are really driven and timed
(`--all-driven` drives every metre). The drive is a meander of lanes 3 m apart through a free hall.
"""

import argparse
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lemtomap.robot.child import python
from lemtomap.se2 import (
    Pose,
    between,
    compose,
    inverse,
    pose,
)
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import Edge, Place
from lemtomap.topo.mapper import TopoMapper
from lemtomap.topo.place import encode_place
from lemtomap.types import EdgeType, GridView, SlamUpdate

LANE_M = 100.0
GAP_M = 3.0
STEP_M = 0.35
TIMED = 3000
WARM_SCANS = 30  # before a kill: the writer is past compiling
PLACE_BYTES, DESCRIPTOR_BYTES = 190, 18  # means over Intel, ACES and Killian
PLACES = 50  # different ones in the synthetic map
NEAR_PER_NODE = 1.0
STEP_COVARIANCE = np.diag([1e-4, 1e-4, 1e-5])
MATCH_COVARIANCE = np.diag([1e-4, 1e-4, 1e-5])


def meander(start_m: float = 0.0, step_m: float = STEP_M) -> Iterator[Pose]:
    """Yield poses along lanes to and fro, from `start_m` of the way on."""
    way_m = start_m
    while True:
        lane, along = divmod(way_m, LANE_M + GAP_M)
        forth = int(lane) % 2 == 0
        x = min(along, LANE_M)
        x = x if forth else LANE_M - x
        y = GAP_M * lane + max(0.0, along - LANE_M)
        heading = np.pi / 2 if along > LANE_M else (0.0 if forth else np.pi)
        yield pose(x, y, heading)
        way_m += step_m


class Hall:
    """A free window that moves with the robot."""

    def __init__(self) -> None:
        self._cells = np.zeros((400, 400), np.int8)
        self._cells.setflags(write=False)
        self._view: GridView | None = None

    def view(self, at: Pose) -> GridView:
        """Return the window, shifted when the robot is 5 m off its middle."""
        if self._view is None or np.abs(at[:2] - np.array(self._view.origin_m) - 10.0).max() > 5.0:
            corner = (round(at[0]) - 10.0, round(at[1]) - 10.0)
            self._view = GridView(0.0, self._cells, 0.05, corner)
        return self._view


def said(stamp_s: float, at: Pose) -> SlamUpdate:
    """Return what a perfect window SLAM says at a pose."""
    zero = np.zeros(3)
    return SlamUpdate(stamp_s, at, zero, MATCH_COVARIANCE, STEP_COVARIANCE, 1.0, 1.0, True, True)


@dataclass
class Driver:
    """Drives a mapper along the meander."""

    mapper: TopoMapper
    way_m: float = 0.0
    stamp_s: float = 0.0

    def drive(self, updates: int) -> float:
        """Return the thread time of one update, s: the median over hundreds, so that stalls do not count."""
        hall, spent = Hall(), []
        for at, _ in zip(meander(self.way_m), range(updates), strict=False):
            view = hall.view(at)
            start = time.thread_time()
            self.mapper.update(said(self.stamp_s, at), view)
            self.mapper.view()
            spent.append(time.thread_time() - start)
            self.stamp_s += 0.5
            self.way_m += STEP_M
        chunks = np.array(spent[: len(spent) // 100 * 100]).reshape(-1, 100).mean(axis=1)
        return float(np.median(chunks))


def walls(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return points of some walls around a node, float64 (N, 2), metres."""
    along = np.arange(0.0, 3.0, 0.02)[:, None]
    heading = rng.uniform(0.0, np.pi, 14)
    starts = rng.uniform(-5.0, 5.0, (14, 2))
    every = zip(starts, heading, strict=True)
    return np.concatenate([at + along * [np.cos(turn), np.sin(turn)] for at, turn in every])


def lay_in_bulk(store: TopoStore, until: int, rng: np.random.Generator) -> int:
    """Add nodes, odometry and near-neighbour edges and places as driving would; returns the last node."""
    node_id = store.count("node")
    places = [encode_place(walls(rng), byte_budget=PLACE_BYTES) for _ in range(PLACES)]
    r, stiff = np.array([1.05, 0.0, 0.0]), STEP_COVARIANCE * 3
    while node_id < until:
        new = store.add_node(created_s=float(node_id)).node_id
        store.add_edge(Edge(0, new - 1, new, r, stiff, EdgeType.ODOMETRY))
        if rng.random() < NEAR_PER_NODE and new > 100:
            near = Edge(0, new, new - 4, np.array([3.0, 0.1, 0.0]), stiff, EdgeType.NEAR_NEIGHBOUR, 0.5)
            store.add_edge(near)
        store.put_place(new, Place(float(new), places[new % PLACES], rng.bytes(DESCRIPTOR_BYTES)))
        node_id = new
        if node_id % 5000 == 0:
            store.commit()
    store.commit()
    return node_id


def resident_mb() -> float:
    """Return the memory this process holds now, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 2**20


def scale(args: argparse.Namespace) -> None:
    """Print a table of cost against size."""
    path = Path(args.dir) / "scale.lemto"
    path.unlink(missing_ok=True)
    rng = np.random.default_rng(0)
    config = TopoConfig(durable=False)
    driver = Driver(TopoMapper(config, TopoStore.create(path, durable=False)))
    driver.drive(500)  # compiles
    print(f"{'nodes':>9} {'ms/update':>10} {'resident MB':>12} {'bytes/node':>11} {'reopen s':>9}")
    for target in [n for n in (1_000, 10_000, 100_000, 300_000, 1_000_000) if n <= args.nodes]:
        if args.all_driven:
            while driver.mapper.store.count("node") < target - TIMED * STEP_M:
                driver.drive(2000)
            reopen_s = np.nan
        else:
            driver, reopen_s = grown(driver, path, target, config, rng)
        ms = 1e3 * driver.drive(TIMED)
        driver.mapper.store.commit()
        nodes = driver.mapper.store.count("node")
        size = path.stat().st_size / nodes
        print(f"{nodes:9d} {ms:10.3f} {resident_mb():12.1f} {size:11.1f} {reopen_s:9.3f}", flush=True)
    driver.mapper.close()


def stand_on(mapper: TopoMapper, node_id: int, stamp_s: float, at: Pose) -> None:
    """Go on with a map at a node that is recognised at once."""
    mapper.update(said(stamp_s, at), Hall().view(at))
    mapper.relocate(node_id, at, MATCH_COVARIANCE)


def grown(
    driver: Driver, path: Path, target: int, config: TopoConfig, rng: np.random.Generator
) -> tuple[Driver, float]:
    """Close, let the map grow on disk, reopen and go on; return how long that took, s."""
    at = next(meander(driver.way_m))
    driver.mapper.close()
    with TopoStore.open(path, durable=False) as store:
        last = lay_in_bulk(store, target - int(TIMED * STEP_M), rng)
    start = time.perf_counter()
    mapper = TopoMapper(config, TopoStore.open(path, durable=False))
    stand_on(mapper, last, driver.stamp_s, at)
    return replace(driver, mapper=mapper), time.perf_counter() - start


WRITER = """
import itertools, sys
import tools.bench.topo as bench
mapper = bench.TopoMapper(bench.TopoConfig(), bench.TopoStore.open(sys.argv[1]))
hall, clock = bench.Hall(), float(sys.argv[2])
for k, at in enumerate(bench.meander(float(sys.argv[3]))):
    mapper.update(bench.said(clock + 0.1 * k, at), hall.view(at))
    print(clock + 0.1 * k, flush=True)
"""


def kill(args: argparse.Namespace) -> None:
    """Kill a mapper at random moments; open the map after each; print what was lost at most."""
    path = Path(args.dir) / "kill.lemto"
    path.unlink(missing_ok=True)
    TopoStore.create(path).close()
    rng, clock, lost, place = np.random.default_rng(1), 0.0, [], encode_place(np.zeros((1, 2)))
    for k in range(args.times):
        command = python("-c", WRITER, str(path), str(clock), str(1000.0 * k))
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as writer:  # noqa: S603
            assert writer.stdout is not None  # noqa: S101
            first = [writer.stdout.readline() for _ in range(WARM_SCANS)][-1]
            time.sleep(float(rng.uniform(0.0, 1.0)))
            os.kill(writer.pid, signal.SIGKILL)
            clock = float((first + writer.stdout.read()).split("\n")[-2])
        with TopoStore.open(path) as store:
            saved = max((node.created_s for node in store.nodes()), default=0.0)
            store.put_place(1, Place(0.0, place))  # and it can be written
            lost.append(clock - saved)
        clock += 1.0
    # a node is born every third scan, so up to 0.3 s of this is not loss but no node being due
    print(f"{args.times} kills: the map opened each time; newest node at most {max(lost):.2f} s old")


def turned(args: argparse.Namespace) -> None:
    """Drive the same way in ten grid frames; print the largest difference of any relative pose."""
    rng, maps = np.random.default_rng(2), []
    for k in range(10):
        # whole metres and quarter turns: the square window then covers the same ground
        shift = rng.integers([-500, -500, 0], [500, 500, 4]) * np.array([1.0, 1.0, np.pi / 2])
        path = Path(args.dir) / f"turned{k}.lemto"
        path.unlink(missing_ok=True)
        mapper = TopoMapper(TopoConfig(), TopoStore.create(path, durable=False))
        hall = Hall()
        for i, at in zip(range(3000), meander(step_m=0.0973), strict=False):
            at = compose(shift, at)  # noqa: PLW2901
            mapper.update(said(0.1 * i, at), hall.view(at))
        here = inverse(mapper.local.standings[mapper.associated_id].T_grid_node)
        local = {i: compose(here, s.T_grid_node) for i, s in mapper.local.standings.items()}
        edges = [(e.source_id, e.target_id, str(e.type), e.T_source_target) for e in mapper.store.edges()]
        maps.append((local, edges))
        mapper.close()
    (local, edges), worst = maps[0], 0.0
    for other_local, other_edges in maps[1:]:
        if [e[:3] for e in edges] != [e[:3] for e in other_edges] or set(local) != set(other_local):
            sys.exit("the map has another shape in another frame")
        for mine, theirs in zip(edges, other_edges, strict=True):
            worst = max(worst, float(np.abs(between(mine[3], theirs[3])).max()))
        for node_id, T in local.items():
            worst = max(worst, float(np.abs(between(T, other_local[node_id])).max()))
    print(f"{len(edges)} edges, 10 frames: largest difference of a relative pose {worst:.1e}")


def main() -> None:
    """Run one of the benchmarks."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("what", choices=["scale", "kill", "turned"])
    parser.add_argument("--nodes", type=int, default=1_000_000)
    parser.add_argument("--all-driven", action="store_true")
    parser.add_argument("--times", type=int, default=200)
    parser.add_argument("--dir", default=None, help="where the map is made; a folder of its own by default")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as own:
        args.dir = args.dir or own
        {"scale": scale, "kill": kill, "turned": turned}[args.what](args)


if __name__ == "__main__":
    main()
