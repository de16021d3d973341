"""How true the topological map is where the robot has been before: a simulated drive against ground truth.

    python -m tools.bench.revisit [--world office | plan.yaml | plan.yaml@4] [--metres 40] [--seeds 3]

The robot drives to a place and back the same way, twice (the thesis' errand: 40 m in the small world, 170 m
in the large one), with slipping wheels, a biased gyro and a noisy laser; loop closing is off. `--keep FOLDER`
keeps the recorded drives, the dearer part, for the next time.

For every scan: how far is the associated node from where it truly is, as seen from the robot? Is it the
nearest node in sight? Does a near-neighbour edge cross a wall? Truth is used here only to judge.
"""

import argparse
import sys
import tempfile
import time
from dataclasses import dataclass, field, replace
from pathlib import Path

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from lemtomap.grid import SlamConfig, WindowMatcher
from lemtomap.robot.devices.bridge import URG_SILENT_FREE_M
from lemtomap.robot.logs import open_log
from lemtomap.se2 import Pose, between, compose
from lemtomap.sim import worlds
from lemtomap.sim.carmen import record_tour
from lemtomap.sim.route import FloorRoutePlanner, path_length_m
from lemtomap.sim.simulator import Simulator
from lemtomap.sim.tours import ScriptedTour, plan_errand
from lemtomap.sim.world import Raster, World
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.mapper import TopoMapper
from lemtomap.types import EdgeType
from tools.truth.walls import wall_between

RIGHT_WITHIN_M = 0.3  # association has a margin: a node this little further than the nearest is right too


@dataclass
class Findings:
    """What one drive showed."""

    off_m: list[float] = field(default_factory=list)
    off_rad: list[float] = field(default_factory=list)
    right: list[bool] = field(default_factory=list)
    measured: list[bool] = field(default_factory=list)
    crossing: int = 0
    near: int = 0
    nodes: int = 0
    map_bytes: int = 0
    place_bytes: float = 0.0
    detour: float = 0.0
    """Way over edges from the first node to the one furthest off, over the truly shortest way."""
    cpu_s: float = 0.0
    driven_s: float = 0.0


def truths(log: Path) -> NDArray[np.float64]:
    """Return T_world_base of each scan, float64 (N, 3), from the TRUEPOS lines of a simulated log."""
    rows = [line.split()[1:4] for line in log.read_text().splitlines() if line.startswith("TRUEPOS")]
    return np.array(rows, dtype=np.float64)


def record(world: World, metres: float, seeds: int, folder: Path) -> list[Path]:
    """Drive the errand in simulation, once for each seed that is not in the folder yet; return the logs."""
    logs = [folder / f"errand{seed}.log" for seed in range(seeds)]
    missing = [(seed, log) for seed, log in enumerate(logs) if not log.exists()]
    path = plan_errand(world, metres).path if missing else None
    for seed, log in missing:
        assert path is not None  # noqa: S101
        part = log.with_suffix(".part")
        record_tour(Simulator(world, seed=seed), ScriptedTour(path), part)
        part.rename(log)
        print(f"recorded {log}", file=sys.stderr, flush=True)
    return logs


def judge(world: World, log: Path, folder: Path, config: TopoConfig) -> Findings:
    """Map one errand and judge it."""
    truth = truths(log)
    slam = WindowMatcher(SlamConfig())
    mapper = TopoMapper(config, TopoStore.create(folder / f"{log.stem}.lemto", durable=False))
    found = Findings()
    born: dict[int, Pose] = {}
    view = None
    for at, (odometry, scan) in zip(truth, open_log(log), strict=True):
        scan = replace(scan, silent_free_m=URG_SILENT_FREE_M)  # noqa: PLW2901 - as on the robot
        update = slam.update(scan, odometry)
        if view is None or update.integrated:
            view = slam.view()
        start = time.thread_time()
        mapper.update(update, view, slam.points_base())
        found.cpu_s += time.thread_time() - start
        found.driven_s = scan.stamp_s
        born.setdefault(mapper.associated_id, at)  # a new node's frame is where the robot is
        _judge(found, mapper, at, born, world.raster)
    found.near, found.crossing = _walls_crossed(mapper, born, world.raster)
    found.nodes = mapper.store.count("node")
    sizes = [len(place.boundary) + len(place.descriptor) for _, place in mapper.store.places()]
    found.place_bytes = float(np.mean(sizes))
    found.detour = _detour(mapper, born, world)
    mapper.close()
    found.map_bytes = mapper.store.path.stat().st_size
    print(f"{log.stem}: p99 {np.percentile(found.off_m, 99):.3f} m", file=sys.stderr, flush=True)
    return found


def _judge(found: Findings, mapper: TopoMapper, at: Pose, born: dict[int, Pose], raster: Raster) -> None:
    node_id = mapper.associated_id
    off = between(compose(at, between([0.0, 0.0, 0.0], _seen(mapper, node_id))), born[node_id])
    found.off_m.append(float(np.hypot(off[0], off[1])))
    found.off_rad.append(abs(float(off[2])))
    found.measured.append(mapper.transform.measured)
    away = np.array([T[:2] for T in born.values()]) - at[:2]
    within_m = float(np.hypot(*(born[node_id][:2] - at[:2]))) - RIGHT_WITHIN_M
    nearer = [T for T, gap_m in zip(born.values(), np.hypot(*away.T), strict=True) if gap_m < within_m]
    found.right.append(all(wall_between(raster, at, T) for T in nearer))


def _seen(mapper: TopoMapper, node_id: int) -> Pose:
    """Return T_base_node as the map has it."""
    return between(mapper.now[0].T_grid_base, mapper.local.standings[node_id].T_grid_node)


def _detour(mapper: TopoMapper, born: dict[int, Pose], world: World) -> float:
    graph: nx.Graph[int] = nx.Graph()
    graph.add_weighted_edges_from((e.source_id, e.target_id, e.length_m) for e in mapper.store.edges())
    over_edges = nx.single_source_dijkstra_path_length(graph, 1)
    goal = max(over_edges, key=lambda node_id: over_edges[node_id])
    ends = [(float(born[node_id][0]), float(born[node_id][1])) for node_id in (1, goal)]
    true_m = path_length_m(FloorRoutePlanner(world.raster).path(*ends))
    return float(over_edges[goal] / true_m)


def _walls_crossed(mapper: TopoMapper, born: dict[int, Pose], raster: Raster) -> tuple[int, int]:
    near = [edge for edge in mapper.store.edges() if edge.type is EdgeType.NEAR_NEIGHBOUR]
    return len(near), sum(wall_between(raster, born[edge.source_id], born[edge.target_id]) for edge in near)


def report(found: list[Findings]) -> None:
    """Print the figures of all drives together."""
    off_m, off_rad = (np.concatenate([getattr(f, name) for f in found]) for name in ("off_m", "off_rad"))
    right = np.concatenate([f.right for f in found])
    measured = np.concatenate([f.measured for f in found])
    turn = np.rad2deg(off_rad)
    print(f"scans {len(off_m)}, nodes {[f.nodes for f in found]}")
    print(f"associated node, metres off: median {np.median(off_m):.3f}  p99 {np.percentile(off_m, 99):.3f}")
    print(f"associated node, degrees off: median {np.median(turn):.2f}  p99 {np.percentile(turn, 99):.2f}")
    print(f"right associated node {right.mean():.2%}; transform measured {measured.mean():.2%}")
    print(
        f"near-neighbour edges {sum(f.near for f in found)}, through a wall {sum(f.crossing for f in found)}"
    )
    print(f"localisation data {np.mean([f.place_bytes for f in found]):.0f} bytes a node")
    cpu = sum(f.cpu_s for f in found) / sum(f.driven_s for f in found)
    print(f"way over edges to the furthest node {np.mean([f.detour for f in found]):.3f} of the shortest way")
    print(f"map {[f.map_bytes for f in found]} bytes; topological part {cpu:.2%} of one core in real time")


def main() -> None:
    """Run the drives and print what they showed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--world", default="office")
    parser.add_argument("--metres", type=float, default=40.0)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--node-distance", type=float, nargs="+", default=[1.0], help="placements to compare")
    parser.add_argument("--keep", type=Path, default=None, help="where recorded drives are kept")
    args = parser.parse_args()
    world = worlds.load(args.world)
    with tempfile.TemporaryDirectory() as own:
        folder = args.keep or Path(own)
        folder.mkdir(parents=True, exist_ok=True)
        logs = record(world, args.metres, args.seeds, folder)
        for distance_m in args.node_distance:
            config = TopoConfig(new_node_distance_m=distance_m)
            with tempfile.TemporaryDirectory() as maps:
                found = [judge(world, log, Path(maps), config) for log in logs]
            print(f"-- a node every {distance_m:g} m at most")
            report(found)
            worst, pgm_bytes = max(f.map_bytes for f in found), world.raster.occupied.size
            print(f"the whole plan as PGM: {pgm_bytes} bytes; the map takes {worst / pgm_bytes:.1%} of that")


if __name__ == "__main__":
    main()
