"""Closures on recorded logs: are they all right, how good is the map, what does it cost; false ones injected.

    lemtomap bench loops logs intel.clf.xz aces.clf.xz [--starts 10] [--ranges full 5.6] [--out runs/loops]
    lemtomap bench loops injected intel.clf.xz [--times 5]

`logs` maps each log from several starts (scans left out at its beginning) and holds every committed closure
against the relations beside the log. `injected` puts one false closure into each drive and tells whether it
was taken back, after how much way, and what it did to the map. A run that is there already is not repeated.
"""

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lemtomap.errors import LemtomapError
from lemtomap.grid import DEFAULT_SLAM, SLAMS, SlamConfig
from lemtomap.pipeline import Mapper
from lemtomap.robot.logs import Log, open_log
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.loops import LoopRecogniser
from lemtomap.topo.mapper import TopoMapper
from lemtomap.topo.whole.smooth import Smoothed, smooth
from tools.bench.parts.mapping_runs import table
from tools.truth.loop_truth import nearest_scans, reference
from tools.truth.relations import read_relations, relation_errors

WRONG_M, WRONG_RAD = 0.5, 0.15  # further off the truth a closure is wrong
FURTHEST_START = 0.2  # share of the log left out by the last start
WARM_SCANS = 2000
INJECTED_SIGMA = np.diag([0.03, 0.03, 0.01])  # as sure as a usual closure
LEAST_WAY_M = 20.0  # between the ends of a false closure
HEADER = ["log", "range", "runs", "mean m", "median m", "max m", "closures", "checked", "wrong", "taken back"]


@dataclass(frozen=True, slots=True)
class Run:
    """One drive through a log."""

    log: Path
    max_range_m: float | None = None
    start: int = 0
    """Scans left out at the beginning."""
    inject_at: float | None = None
    """Share of the scans after which a false closure is put in."""

    @property
    def name(self) -> str:
        """What the run's result is called."""
        told = [self.log.name.split(".")[0], f"{self.max_range_m:g}" if self.max_range_m else "full"]
        told += [str(self.start)] + ([] if self.inject_at is None else [f"false{self.inject_at:.2f}"])
        return "-".join(told)


class Driven:
    """A log driven through, with all that is asked of it afterwards."""

    def __init__(self, run: Run, log: Log, folder: Path, stop: int | None = None) -> None:
        config = SlamConfig(max_range_m=run.max_range_m, particles=1)
        self.store = TopoStore.create(folder / "map.lemto", durable=False)
        self.recogniser = LoopRecogniser()
        self.topo = TopoMapper(TopoConfig(), self.store, recogniser=self.recogniser)
        self.false_edge_id = 0
        self.taken_back_m: float | None = None
        self._injected_m = 0.0
        mapper = Mapper(lambda: SLAMS[DEFAULT_SLAM](config, 0), self.topo, watched=False)
        inject_at = None if run.inject_at is None else round(run.inject_at * (len(log) - run.start))
        self.update_s: list[float] = []
        begun_s = time.process_time()
        for number, (odometry, scan) in enumerate(islice(iter(log), run.start, stop)):
            update_begun_s = time.thread_time()
            mapper.update(scan, odometry)
            self.update_s.append(time.thread_time() - update_begun_s)
            if inject_at is not None and number >= inject_at and not self.false_edge_id:
                self._inject(np.random.default_rng(number))
            if self.taken_back_m is None and self.false_edge_id in self.recogniser.revoked:
                self.taken_back_m = self.topo.travelled_m - self._injected_m
        self.cpu_s = time.process_time() - begun_s
        self.records = np.concatenate(list(self.topo.trail.records()))
        self.smoothed: Smoothed = smooth(self.store, self.topo.trail)
        self.fit_s = time.process_time() - begun_s - self.cpu_s

    def _inject(self, rng: np.random.Generator) -> None:
        """Say that the robot is at a place far away."""
        here_id = self.topo.associated_id
        near = set(self.topo.graph.reach(here_id, LEAST_WAY_M, 100_000))
        far = [node.node_id for node in self.store.nodes() if node.node_id not in near]
        if not far or not self.topo.local.standings[here_id].anchored:
            return
        T = np.array([*rng.uniform(-1.0, 1.0, 2), rng.uniform(-np.pi, np.pi)])
        edge = self.topo.close_loop(here_id, int(rng.choice(far)), T, INJECTED_SIGMA**2)
        self.false_edge_id, self._injected_m = edge.edge_id, self.topo.travelled_m


def measure(run: Run, log: Log, relations: NDArray[np.float64]) -> dict[str, Any]:
    """Drive once and return the figures."""
    with tempfile.TemporaryDirectory() as folder:
        driven = Driven(run, log, Path(folder))
        errors, _, _ = relation_errors(relations, driven.smoothed.stamps_s, driven.smoothed.T_map_base)
        lengths = np.hypot(errors[:, 0], errors[:, 1])
        closures = list(checked_closures(driven, relations))
        told = {
            "mean_m": float(lengths.mean()),
            "median_m": float(np.median(lengths)),
            "max_m": float(lengths.max()),
            "closures": len(closures),
            "checked": sum(checked for *_, checked in closures),
            "wrong": [
                f"{here}->{there} off {off_m:.2f} m"
                for here, there, off_m, is_wrong, checked in closures
                if is_wrong and checked
            ],
            "worst_off_m": max((off_m for *_, off_m, _, checked in closures if checked), default=0.0),
            "taken_back": len(driven.recogniser.revoked),
            "cpu_s": driven.cpu_s,
            "fit_s": driven.fit_s,
            "worst_update_ms": 1000.0 * max(driven.update_s),
            "nodes": len(driven.smoothed.T_map_node),
        }
        if run.inject_at is not None:
            told["injected"] = driven.false_edge_id > 0
            told["taken_back_after_m"] = driven.taken_back_m
        driven.topo.close()
    return told


def checked_closures(
    driven: Driven, relations: NDArray[np.float64]
) -> Iterator[tuple[int, int, float, bool, bool]]:
    """Yield (node, node, metres off, whether wrong, whether a relation vouches for the truth there)."""
    records = driven.records
    scans, found = nearest_scans(records["stamp_s"], relations[:, :2])
    first: dict[int, int] = {}
    for scan, node_id in enumerate(records["node_id"].tolist()):
        first.setdefault(node_id, scan)
    closures = driven.recogniser.closures
    asked = np.array([first[n] for c in closures for n in (c.source_id, c.target_id)], dtype=np.int64)
    truth = reference(
        relations[found], scans[found], records["T_grid_base"], driven.smoothed.T_map_base, asked
    )
    for closure in closures:
        a, b = first[closure.source_id], first[closure.target_id]
        off = truth.off(a, b, closure.T_source_target)
        off_m = float(np.hypot(off[0], off[1]))
        is_wrong = off_m > WRONG_M or abs(float(off[2])) > WRONG_RAD
        yield closure.source_id, closure.target_id, off_m, is_wrong, truth.vouches(a, b)


def results(runs: list[Run], out: Path) -> dict[Run, dict[str, Any]]:
    """Return the figures of all runs, those that are there already read from their files."""
    out.mkdir(parents=True, exist_ok=True)
    told: dict[Run, dict[str, Any]] = {}
    opened: tuple[Path, Log] | None = None
    for run in runs:
        file = out / f"{run.name}.json"
        if not file.exists():
            if opened is None or opened[0] != run.log:
                opened = run.log, open_log(run.log)
                with tempfile.TemporaryDirectory() as folder:  # compiled code is loaded before times count
                    Driven(run, opened[1], Path(folder), run.start + WARM_SCANS).topo.close()
            figures = measure(run, opened[1], read_relations(relations_of(run.log)))
            file.write_text(json.dumps(figures, indent=1))
            print(f"  {run.name}: mean {figures['mean_m']:.4f} m, {len(figures['wrong'])} wrong", flush=True)
        told[run] = json.loads(file.read_text())
    return told


def relations_of(log: Path) -> Path:
    """Return the relations that belong to a log."""
    return log.with_name(log.name.split(".")[0] + ".relations")


def bench_logs(options: argparse.Namespace) -> str:
    """Map each log from several starts; return the table, the worst of the starts."""
    rows = []
    for log in options.logs:
        scans = len(open_log(log))
        starts = np.linspace(0.0, FURTHEST_START * scans, options.starts).astype(int).tolist()
        for max_range in options.ranges:
            runs = [Run(log, None if max_range == "full" else float(max_range), start) for start in starts]
            told = list(results(runs, options.out).values())
            wrong = [text for each in told for text in each["wrong"]]
            rows.append(
                [
                    log.name,
                    max_range,
                    str(len(told)),
                    *(f"{max(each[key] for each in told):.4f}" for key in ("mean_m", "median_m", "max_m")),
                    *(str(sum(each[key] for each in told)) for key in ("closures", "checked")),
                    str(len(wrong)),
                    str(sum(each["taken_back"] for each in told)),
                    f"{max(each['cpu_s'] + each['fit_s'] for each in told):.1f}",
                    f"{max(each['worst_update_ms'] for each in told):.0f}",
                ]
            )
    return table([*HEADER, "CPU s", "worst update ms"], rows)


def bench_injected(options: argparse.Namespace) -> str:
    """Put a false closure into each drive; return the table."""
    rows = []
    for log in options.logs:
        shares = np.linspace(0.35, 0.85, options.times).tolist()
        runs = [Run(log), *(Run(log, inject_at=share) for share in shares)]
        clean, *told = results(runs, options.out).values()
        for share, each in zip(shares, told, strict=True):
            after_m = each["taken_back_after_m"]
            rows.append(
                [
                    log.name,
                    f"{share:.2f}",
                    "not put in" if not each["injected"] else "no" if after_m is None else f"{after_m:.1f} m",
                    f"{clean['mean_m']:.4f}",
                    f"{each['mean_m']:.4f}",
                    f"{each['mean_m'] / clean['mean_m'] - 1.0:+.1%}",
                ]
            )
    return table(["log", "at", "taken back after", "clean mean m", "mean m", "change"], rows)


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="lemtomap bench loops", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(required=True)
    for name, bench in (("logs", bench_logs), ("injected", bench_injected)):
        command = commands.add_parser(name)
        command.add_argument("logs", type=Path, nargs="+")
        command.add_argument("--out", type=Path, default=Path("runs/loops"))
        command.set_defaults(bench=bench)
        if name == "logs":
            command.add_argument("--starts", type=int, default=10)
            command.add_argument("--ranges", nargs="+", default=["full", "5.6"])
        else:
            command.add_argument("--times", type=int, default=5)
    options = parser.parse_args(arguments)
    try:
        print(options.bench(options))
    except LemtomapError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
