"""Measure doors and areas: the robot explores plans with rooms as ground truth, with all noise.

    lemtomap bench rooms --plans /data/plans --jobs 2
    lemtomap bench rooms --plans /data/plans --quick
    lemtomap bench rooms offices:30:1 /data/plans/gdc/2/2.yaml --seeds 3 --twice

Runs in lock-step without recording. A door is found within 0.3 m, its width within 0.2 m; of the true ones
only those count that stood open in view within 3 m. Areas are scored over nodes (adjusted Rand index) and
over floor (F1 at IoU 0.5; each cell that was seen belongs to its nearest visible node; rooms in which no node
was born are left out). Every plan and seed is kept as JSON with a picture in --out, and is not run again.
"""

import argparse
import json
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from lemtomap.sim import worlds
from lemtomap.sim.errors import BadWorld
from lemtomap.sim.world import World
from tools.bench.parts.mapping_runs import table
from tools.bench.rooms_parts.drive import drive
from tools.bench.rooms_parts.judge import judge
from tools.bench.rooms_parts.picture import picture

KINDS = ("bare", "furnished", "cluttered", "gdc")
QUICK = 4  # plans of each kind at most


@dataclass(frozen=True, slots=True)
class Job:
    """One plan with one seed."""

    world: str
    kind: str
    seed: int
    duration_s: float
    twice: bool
    out: Path

    @property
    def kept(self) -> Path:
        """Where its figures are kept."""
        path = Path(self.world)
        label = f"{path.parent.name}_{path.stem}" if path.suffix else self.world.replace(":", "-")
        return self.out / f"{label}_{self.seed}{'_twice' if self.twice else ''}.json"


@dataclass(slots=True)
class Figures:
    """What came of one plan and seed."""

    world: str
    kind: str
    seed: int
    state: str
    doors_found: int
    doors_counted: int
    door_hits: int
    passed: int
    noticed: int
    false_changes: int
    path_m: float
    nodes: int
    ari: float
    f1: float
    relabelled: int
    second_changed: int | None
    cost_ms: float
    growth: float
    time_s: float


def measure(job: Job) -> Figures:
    """Return the figures of a job, kept ones where there are any. Raises BadWorld."""
    if job.kept.exists():
        return Figures(**json.loads(job.kept.read_text()))
    begin = time.monotonic()
    world = load(job.world)
    driven = drive(world, job.seed, job.duration_s, twice=job.twice)
    verdict = judge(world, driven)
    match = verdict.match
    figures = Figures(
        job.kept.stem, job.kind, job.seed, driven.state, match.found, match.counted, match.hits,
        verdict.passed, verdict.noticed, verdict.false_changes, round(verdict.path_m, 1),
        len(driven.T_world_node), verdict.ari, verdict.f1, driven.relabelled, driven.second_changed,
        driven.cost_ms, driven.growth, round(time.monotonic() - begin, 1),
    )  # fmt: skip
    title = (
        f"{figures.world}: doors P {match.precision:.2f} R {match.recall:.2f}, "
        f"ARI {verdict.ari:.2f}, F1 {verdict.f1:.2f}; {driven.state}"
    )
    picture(world, driven, verdict, title, job.kept.with_suffix(".png"))
    _keep(job.kept, figures)
    return figures


def load(name: str) -> World:
    """Return a world with rooms as truth. Raises BadWorld where that is damaged or missing."""
    world = worlds.load(name)
    if world.truth.damage:
        raise BadWorld(world.truth.damage[0])
    if not world.truth.rooms:
        raise BadWorld(f"{name}: no rooms are known beside it (locations.yaml or rooms.png)")
    return world


def _keep(path: Path, figures: Figures) -> None:
    """Write figures whole or not at all."""
    part = path.with_suffix(".part")
    part.write_text(json.dumps(asdict(figures), indent=1))
    part.replace(path)


def plans_in(folder: Path) -> list[tuple[str, str]]:
    """Return (plan, kind) of all plans under a folder that have rooms beside them."""
    found = []
    for path in sorted(folder.rglob("*.yaml")):
        if not any((path.parent / name).exists() for name in ("locations.yaml", "rooms.png")):
            continue
        if not any(line.startswith("image:") for line in path.read_text(errors="replace").splitlines()):
            continue
        kind = path.stem if path.stem in KINDS else "gdc" if "gdc" in path.parts else "bare"
        found.append((str(path), kind))
    return found


def summary(kind: str, runs: list[Figures]) -> list[str]:
    """Return a line of the table: all runs of a kind of plan, spread over the seeds in brackets."""
    found, counted = sum(run.doors_found for run in runs), sum(run.doors_counted for run in runs)
    hits = sum(run.door_hits for run in runs)
    passed, noticed = sum(run.passed for run in runs), sum(run.noticed for run in runs)
    path_m, nodes = sum(run.path_m for run in runs), sum(run.nodes for run in runs)
    second = [run for run in runs if run.second_changed is not None]
    again = sum(run.second_changed or 0 for run in second) / max(1, sum(run.nodes for run in second))
    return [
        kind,
        str(len(runs)),
        f"{hits / max(1, found):.3f}",
        f"{hits / max(1, counted):.3f}",
        f"{noticed / max(1, passed):.3f} of {passed}",
        f"{500.0 * sum(run.false_changes for run in runs) / max(1.0, path_m):.2f}",
        _spread([run.ari for run in runs]),
        _spread([run.f1 for run in runs]),
        f"{sum(run.relabelled for run in runs) / max(1, nodes):.3f}",
        f"{100 * again:.1f} %" if second else "-",
        f"{float(np.mean([run.cost_ms for run in runs])):.2f}",
        f"{100 * float(np.mean([run.growth for run in runs])):.1f} %",
    ]


def _spread(values: list[float]) -> str:
    return f"{np.mean(values):.3f} ({min(values):.2f} to {max(values):.2f})"


HEADER = [
    "plans", "runs", "door precision", "door recall", "passing noticed", "false a 500 m", "ARI nodes",
    "F1 rooms", "relabelled a node", "second tour", "ms a scan", "file",
]  # fmt: skip


def report(runs: list[Figures]) -> str:
    """Return the table of runs, and a line for each."""
    by_kind = {kind: [run for run in runs if run.kind == kind] for kind in KINDS}
    rows = [summary(kind, some) for kind, some in by_kind.items() if some]
    each = [summary(f"{run.world}: {run.state}", [run]) for run in runs]
    return f"{table(HEADER, rows)}\n\n{table(HEADER, each)}"


def jobs_of(args: argparse.Namespace) -> list[Job]:
    """Return what is to be run."""
    plans = [(name, next((k for k in KINDS if k in Path(name).with_suffix("").parts), "bare"))
             for name in args.worlds]  # fmt: skip
    if args.plans is not None:
        found = plans_in(args.plans)
        if not found:
            raise BadWorld(f"{args.plans}: no plans with rooms beside them")
        by_kind = [[plan for plan in found if plan[1] == kind] for kind in KINDS]
        plans += [plan for some in by_kind for plan in (some[:QUICK] if args.quick else some)]
    plans = plans or [("offices:30:1", "bare")]
    seeds = range(1, 2) if args.quick else range(args.first_seed, args.first_seed + args.seeds)
    return [
        Job(name, kind, seed, args.duration, args.twice, args.out) for name, kind in plans for seed in seeds
    ]


def run(jobs: list[Job], workers: int) -> list[Figures]:
    """Run jobs, several at a time where asked for; each is kept as soon as it is done."""
    runs = []
    with ProcessPoolExecutor(workers) as pool:
        for figures in pool.map(measure, jobs):
            print(
                f"  {figures.world}: ARI {figures.ari:.3f}, F1 {figures.f1:.3f}, {figures.state}", flush=True
            )
            runs.append(figures)
    return runs


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("worlds", nargs="*")
    parser.add_argument("--plans", type=Path, metavar="DIR", help="all plans under a folder")
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} plans of each kind, one seed")
    parser.add_argument("--seeds", type=int, default=3, help="runs of each plan")
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--twice", action="store_true", help="drive the same way a second time")
    parser.add_argument("--duration", type=float, default=5400.0, metavar="S")
    parser.add_argument("--jobs", type=int, default=1, help="plans at a time")
    parser.add_argument("--out", type=Path, default=Path("runs/rooms"))
    args = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    try:
        args.out.mkdir(parents=True, exist_ok=True)
        jobs = jobs_of(args)
        for name in {job.world for job in jobs}:
            load(name)  # bad files are told before hours of driving
        text = report(run(jobs, max(1, args.jobs)))
    except (BadWorld, OSError) as error:
        print(f"bench rooms: {error}", file=sys.stderr)
        sys.exit(2)
    (args.out / "report.md").write_text(text + "\n")
    print(text)


if __name__ == "__main__":
    main()
