"""Every metric layer on recorded logs: error against the official relations, CPU, memory, map size.

    lemtomap bench logs intel.clf.xz aces.clf.xz [--out runs/logs] [--seeds 3] [--compare OLD/logs.json]

Relations are looked for beside each log (intel.clf.xz: intel.relations). A run that is there already is not
repeated, so the bench can be stopped and taken up again. A picture of each run stands in its own folder.
"""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from tools.bench_compare import compare
from tools.mapping_runs import MappingRun, slam_cpu_s, table
from tools.relations import read_relations, read_tum, relation_errors

LAYERS = {
    "rolling": 5,
    "window": 1,
    "gmapping": 30,
}  # particles
HEADER = ["log", "layer", "mean m", "median m", "CPU s", "peak MB", "map kB", "nodes", "closures"]


def errors_m(log: Path, out: Path) -> tuple[float, float]:
    """Return mean and median translational error, NaN where the log has no relations beside it."""
    relations = log.with_name(log.name.split(".")[0] + ".relations")
    if not relations.exists():
        return float("nan"), float("nan")
    errors, _, _ = relation_errors(read_relations(relations), *read_tum(out / "trajectory.tum"))
    lengths = np.hypot(errors[:, 0], errors[:, 1])
    return float(lengths.mean()), float(np.median(lengths))


def measure(log: Path, layer: str, seeds: int, out: Path) -> dict[str, Any]:
    """Return the figures of one layer on one log, the errors' worst over the seeds."""
    runs = [
        MappingRun(log, layer, LAYERS[layer], seed, out / f"{log.name.split('.')[0]}-{layer}-{seed}")
        for seed in range(seeds)
    ]
    told = [run.summary() for run in runs]
    errors = [errors_m(log, run.out) for run in runs]
    return {
        "log": log.name,
        "layer": layer,
        "mean_m": max(mean for mean, _ in errors),
        "median_m": max(median for _, median in errors),
        "cpu_s": float(np.mean([slam_cpu_s(each) for each in told])),
        "peak_mb": max(each["peak_rss_mb"] for each in told),
        "map_kb": told[0]["map_bytes"] / 1000,
        "nodes": told[0]["nodes"],
        "closures": told[0]["loop_closures"],
    }


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="lemtomap bench logs", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("logs", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, default=Path("runs/logs"))
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--layers", nargs="+", choices=LAYERS, default=list(LAYERS))
    parser.add_argument("--compare", type=Path, metavar="OLD.json")
    options = parser.parse_args(arguments)
    missing = [log for log in options.logs if not log.exists()]
    if missing:
        print(f"{missing[0]}: no such file", file=sys.stderr)
        return 2
    found = [
        measure(log, layer, options.seeds, options.out) for log in options.logs for layer in options.layers
    ]
    report = {f"{each['log']} {each['layer']}": each for each in found}
    (options.out / "logs.json").write_text(json.dumps(report, indent=1))
    rows = [
        [
            each["log"],
            each["layer"],
            f"{each['mean_m']:.4f}",
            f"{each['median_m']:.4f}",
            f"{each['cpu_s']:.1f}",
            f"{each['peak_mb']:.0f}",
            f"{each['map_kb']:.0f}",
            str(each["nodes"]),
            str(each["closures"]),
        ]
        for each in found
    ]
    text = table(HEADER, rows)
    (options.out / "logs.md").write_text(text + "\n")
    print(text)
    if options.compare is not None:
        print(compare(json.loads(options.compare.read_text()), report))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
