"""Measure navigation: planners, control cycle, the thesis' tasks against the metric baseline, random goals.

    lemtomap bench nav planner        first plan and re-plan on 2,000 to 1,000,000 nodes
    lemtomap bench nav dwa            one control cycle's parts
    lemtomap bench nav tasks --world office --metres 15 --seeds 5 --out runs/nav
                                      topological against metric navigation, there and back twice
    lemtomap bench nav goals --world offices:24:3 --count 40 [--people 6] [--depth]
                                      random goals after one led round; --world may be given several times
    lemtomap bench nav doors --world loop --count 5
                                      ways that are barred, open again, or the only ones
    lemtomap bench nav obstacles --world loop --count 10 [--depth]
                                      chairs and low bars the laser overlooks

CPU is thread time. Everything that drives runs in lock-step with the simulator.
"""

import argparse
from itertools import product
from pathlib import Path

from tools.bench.nav_parts.goals import bench_goals
from tools.bench.nav_parts.planner import bench_dwa, bench_planner
from tools.bench.nav_parts.tasks import bench_tasks
from tools.bench.nav_parts.trouble import bench_doors, bench_obstacles


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="lemtomap bench nav", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["planner", "dwa", "tasks", "goals", "doors", "obstacles"])
    parser.add_argument("--world", action="append", default=[])
    parser.add_argument("--metres", type=float, default=40.0)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--count", type=int, default=40, help="goals for each world and seed")
    parser.add_argument("--people", type=int, default=0)
    parser.add_argument("--depth", action="store_true", help="with the simulated depth camera")
    parser.add_argument("--out", type=Path, default=Path("runs/nav"))
    args = parser.parse_args()
    worlds, seeds = args.world or ["office"], range(args.seeds)
    if args.what == "planner":
        bench_planner()
    elif args.what == "dwa":
        bench_dwa()
    elif args.what == "goals":
        bench_goals(worlds, seeds, args.count, args.out, people=args.people, depth=args.depth)
    elif args.what in {"doors", "obstacles"}:
        for world, seed in product(worlds, seeds):
            if args.what == "doors":
                bench_doors(world, seed, args.count)
            else:
                bench_obstacles(world, seed, args.count, depth=args.depth)
    else:
        for world in worlds:
            bench_tasks(world, args.metres, seeds, args.out)


if __name__ == "__main__":
    main()
