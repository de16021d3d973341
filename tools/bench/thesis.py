"""Chapter 5 of the thesis again: mapping drives and navigation tasks beside the 2014 baseline, as a report.

    lemtomap bench thesis --quick         one repetition, the large drive cut to 3 minutes, the short task
    lemtomap bench thesis                 both drives, three repetitions each, both tasks
    lemtomap bench thesis --small plan.yaml --large plan.yaml@4      in a building of your own

The drives (about 3 and 11 minutes at constant speed, section 5-2-1) are recorded in simulation once. The same
recordings go to LEMTOMap as it is by default, to LEMTOMap with the thesis' 5 particles, and to the baseline
(GMapping with 80 particles on a growing grid). Each subsystem runs in a process of its own and is measured by
its own clock. Finished pieces are kept: stop with Ctrl-C, run again, and it goes on. Leaves report.html
(self-contained), report.md and thesis.json; --compare OLD.json tells what changed.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

from lemtomap.sim.errors import BadWorld
from tools.bench.compare import compare_files
from tools.bench.thesis_parts.experiment import Experiment, Plan
from tools.bench.thesis_parts.worlds import LARGE_WORLD, SMALL_WORLD


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="lemtomap bench thesis",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--quick", action="store_true", help="under 10 minutes on 2 cores")
    parser.add_argument("--out", type=Path, default=Path("runs/thesis"))
    parser.add_argument("--small", metavar="WORLD", default=SMALL_WORLD, help="default: %(default)s")
    parser.add_argument("--large", metavar="WORLD", default=LARGE_WORLD, help="default: %(default)s")
    parser.add_argument("--jobs", type=int, default=2, help="runs at a time (CPU time is what is measured)")
    parser.add_argument("--no-navigation", action="store_true", help="only the mapping drives")
    parser.add_argument("--fresh", action="store_true", help="forget finished pieces")
    parser.add_argument("--compare", type=Path, metavar="OLD.json", help="thesis.json of an earlier run")
    options: Any = parser.parse_args(arguments)
    if options.compare is not None and not options.compare.exists():
        print(f"{options.compare}: no such file", file=sys.stderr)
        return 2
    plan = Plan(
        small=options.small,
        large=options.large,
        out=options.out / ("quick" if options.quick else "full"),
        repetitions=1 if options.quick else 3,
        large_s=180.0 if options.quick else 660.0,
        tasks=() if options.no_navigation else ("small",) if options.quick else ("small", "large"),
        jobs=max(1, options.jobs),
    )
    experiment = Experiment(plan)
    try:
        experiment.run(fresh=options.fresh)
    except BadWorld as error:
        print(error, file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted: what is finished is kept; the same command goes on", file=sys.stderr)
        return 130
    print(experiment.report())
    print(f"\nreport: {plan.out / 'report.html'}")
    if options.compare is not None:
        print(compare_files(options.compare, plan.out / "thesis.json"))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
