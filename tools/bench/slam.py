"""Accuracy, spread, CPU and memory of the metric layer: the whole table, each figure with its seeds.

    lemtomap bench slam [--data DIR] [--quick]       everything; a quarter of an hour on a quiet core
    lemtomap bench slam corridor kernels             some of it: logs corridor sparse drives kernels real-time
                                                     memory first-use
    lemtomap bench slam logs --slam window --seeds 20

DIR holds LOG.clf.xz and LOG.relations of the recorded logs; without it that part is left out and said so.
A seed also moves the start: seed s begins at scan 7 s, so that single-hypothesis runs differ too. Poses are
those said online (the growing map: its best particle's path); large loops are the topological layer's work.
"""

import argparse
import sys
import time
from pathlib import Path

from lemtomap.grid import SLAMS
from tools.bench.slam_parts import corridor, costs, drives, logs, sparse
from tools.bench.slam_parts.figures import Figure, markdown

PARTS = {
    "logs": logs.figures,
    "corridor": corridor.figures,
    "sparse": sparse.figures,
    "drives": drives.figures,
    **costs.PARTS,
}


def _options(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="lemtomap bench slam", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("parts", nargs="*", help=f"some of {', '.join(PARTS)}; none: all")
    parser.add_argument("--data", type=Path, default=Path("../shared/data/carmen"))
    parser.add_argument("--slam", nargs="+", choices=sorted(SLAMS), default=sorted(SLAMS))
    parser.add_argument("--logs", nargs="+", default=["intel", "aces"])
    parser.add_argument("--ranges", nargs="+", type=float, default=[10.0, 5.6])
    parser.add_argument("--worlds", nargs="+", default=list(drives.WORLDS))
    parser.add_argument("--particles", type=int, help="instead of 5, and of 30 for gmapping")
    parser.add_argument("--seeds", type=int, help="of everything but the growing map (default 10)")
    parser.add_argument("--grown-seeds", type=int, default=3, help="of the growing map")
    parser.add_argument("--hours", type=float, default=1.0, help="of driving, for the memory")
    parser.add_argument("--quick", action="store_true", help="few seeds, short drives, growing map left out")
    parser.add_argument("--out", type=Path, help="Markdown file to leave the table in")
    options = parser.parse_args(arguments)
    unknown = [part for part in options.parts if part not in PARTS]
    if unknown:
        parser.error(f"'{unknown[0]}' is none of {', '.join(PARTS)}")
    options.parts = options.parts or list(PARTS)
    options.drive_seeds, options.drive_s, options.grown_s = 3, 200.0, 600.0
    if options.quick:
        options.seeds = options.seeds or 2
        options.slam = [kind for kind in options.slam if kind != "gmapping"]
        options.drive_seeds, options.drive_s, options.grown_s, options.hours = 1, 60.0, 60.0, 0.2
    options.seeds = options.seeds or 10
    return options


def main(arguments: list[str]) -> int:
    options = _options(arguments)
    rows: list[Figure] = []
    for part in options.parts:
        if part == "logs" and not options.data.is_dir():
            print(f"{options.data}: no such folder; the recorded logs are left out", file=sys.stderr)
            continue
        begun = time.perf_counter()
        found = PARTS[part](options)
        rows += found
        print(f"{part}: {time.perf_counter() - begun:.0f} s", file=sys.stderr, flush=True)
        if len(options.parts) > 1:
            print(markdown(found), file=sys.stderr, flush=True)
    print(markdown(rows))
    if options.out:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text(markdown(rows) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
