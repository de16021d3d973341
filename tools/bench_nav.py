"""Measure navigation: planners, control cycle, the thesis' tasks against the metric baseline, random goals.

    lemtomap bench nav planner        first plan and re-plan on 2,000 to 1,000,000 nodes
    lemtomap bench nav dwa            one control cycle's parts
    lemtomap bench nav tasks --world office --metres 15 --seeds 5 --out runs/nav
                                      topological against metric navigation, there and back twice

CPU is thread time. Everything that drives runs in lock-step with the simulator.
"""

import argparse
from pathlib import Path

from tools.nav_planner import bench_dwa, bench_planner
from tools.nav_tasks import bench_tasks


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="lemtomap bench nav", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["planner", "dwa", "tasks"])
    parser.add_argument("--world", default="office")
    parser.add_argument("--metres", type=float, default=40.0)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("runs/nav"))
    args = parser.parse_args()
    if args.what == "planner":
        bench_planner()
    elif args.what == "dwa":
        bench_dwa()
    else:
        bench_tasks(args.world, args.metres, range(args.seeds), args.out)


if __name__ == "__main__":
    main()
