"""Does every reader refuse damaged files in one line? Seeded damage to each kind of input.

    python -m tools.checks.fuzz_readers                                300 cases of each kind
    python -m tools.checks.fuzz_readers --only recording --count 50
    python -m tools.checks.fuzz_readers --only map --case 17 --keep /tmp/case    one case once more, kept

Each case hands a damaged file to a command of `lemtomap` in a process of its own. It may end with 0, or with
2 and one line that says what is wrong; it may use 10 s of CPU and 1 GB, and leaves nothing half-written. The
sound files are made by this program. Exit code 1, and a table, when a case does anything else.
"""

import argparse
import importlib.util
import random
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from lemtomap.robot.cli.main import main as lemtomap
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.runs.warmup import warm_up
from tools.checks import inputs
from tools.checks.isolation import (
    Limits,
    Outcome,
    Task,
    run_all,
)
from tools.checks.mcap_damage import MCAP
from tools.checks.mutations import (
    BYTES,
    GZIP,
    TEXT,
    XZ,
    YAML,
    Mutation,
)
from tools.checks.sqlite_damage import SQLITE

OUT = "out"
REFUSED = 2
NO_ROBOT = "no/robot"  # the port of a sound configuration, which is refused for nothing else
SHOWN_FAILURES = 40
MAP = ("map", "{file}", "--out", OUT)
SIM = ("sim", "--world", "{world}", "--fast", "--duration", "1", "--mission", "explore", "--out", OUT)


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of input: how a sound one is made, how it is damaged, and who reads it."""

    file: str
    """The damaged one."""
    make: Callable[[Path], bytes]
    """Returns the sound file; may work in the folder given."""
    mutations: Sequence[Mutation]
    commands: Sequence[Sequence[str]]
    beside: Mapping[str, bytes] = field(default_factory=dict)
    """Sound files that belong to it."""
    changes_input: bool = False
    """Some of its commands write to the file itself."""
    simulated: bool = False
    """Needs pybullet."""


def _sim(world: str) -> tuple[str, ...]:
    return tuple(word.format(world=world) for word in SIM)


KINDS: dict[str, Kind] = {
    "carmen": Kind("hall.clf", lambda _: inputs.carmen(), TEXT, [MAP]),
    "carmen.gz": Kind("hall.clf.gz", lambda _: inputs.gzipped(inputs.carmen()), GZIP, [MAP]),
    "carmen.xz": Kind("hall.log.xz", lambda _: inputs.xz(inputs.carmen()), XZ, [MAP]),
    "tinyslam": Kind("hall.dat", lambda _: inputs.tinyslam(), TEXT, [MAP]),
    "plan.yaml": Kind(
        "plan.yaml",
        lambda _: inputs.plan_yaml("plan.pgm"),
        YAML,
        [_sim("plan.yaml")],
        beside={"plan.pgm": inputs.plan_image("pgm")},
        simulated=True,
    ),
    "plan.pgm": Kind(
        "plan.pgm",
        lambda _: inputs.plan_image("pgm"),
        TEXT,
        [_sim("plan.yaml")],
        beside={"plan.yaml": inputs.plan_yaml("plan.pgm")},
        simulated=True,
    ),
    "plan.png": Kind(
        "plan.png",
        lambda _: inputs.plan_image("png"),
        BYTES,
        [_sim("plan.yaml")],
        beside={"plan.yaml": inputs.plan_yaml("plan.png")},
        simulated=True,
    ),
    "world": Kind("flat.toml", lambda _: inputs.world(), TEXT, [_sim("flat.toml")], simulated=True),
    "recording": Kind(
        "run.mcap", inputs.recording, MCAP, [("replay", "{file}", "--out", OUT)], simulated=True
    ),
    "map": Kind(
        "hall.lemto",
        inputs.map_file,
        SQLITE,
        [
            ("info", "{file}"),
            ("edit", "{file}", "name", "2", "kitchen"),
            ("edit", "{file}", "delete", "2"),
            ("edit", "{file}", "level", "2", "1"),
            ("edit", "{file}", "undo"),
            ("edit", "{file}", "history"),
            *[
                ("export", "{file}", f"{OUT}.{suffix}")
                for suffix in ("geojson", "tmap2", "g2o", "graphml", "png")
            ],
        ],
        changes_input=True,
    ),
    "config": Kind(
        "robot.toml",
        lambda _: inputs.config(),
        TEXT,
        [("run", "--config", "{file}", "--kobuki", NO_ROBOT, "--hokuyo", f"{NO_ROBOT}2", "--out", OUT)],
    ),
}


@dataclass(frozen=True, slots=True)
class Case:
    """One damaged file and the command that reads it."""

    kind: str
    number: int
    seed: int
    data: bytes
    mutation: str
    command: Sequence[str]

    def lay_out(self, folder: Path) -> None:
        """Write its files."""
        kind = KINDS[self.kind]
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in {**kind.beside, kind.file: self.data}.items():
            (folder / name).write_bytes(content)

    @property
    def again(self) -> str:
        """How to run it once more."""
        seed = f" --seed {self.seed}" if self.seed else ""
        return f"python -m tools.checks.fuzz_readers --only {self.kind} --case {self.number}{seed} --keep DIR"


def make_case(kind_name: str, sound: bytes, number: int, seed: int) -> Case:
    """Return a case, the same for the same arguments; number 0 is the sound file."""
    kind = KINDS[kind_name]
    rng = random.Random(f"{seed} {kind_name} {number}")
    command = tuple(word.format(file=kind.file) for word in rng.choice(kind.commands))
    if number == 0:
        return Case(kind_name, number, seed, sound, "sound", command)
    mutation = rng.choice(kind.mutations)
    return Case(kind_name, number, seed, mutation(sound, rng), mutation.__name__, command)


def judge(case: Case, outcome: Outcome, folder: Path) -> str:
    """Return what is wrong with an outcome, "" when nothing is."""
    lines = outcome.stderr.splitlines()
    refusals = sum(line.startswith("lemtomap: ") for line in lines)
    if outcome.overrun:
        return outcome.overrun
    if "Traceback" in outcome.stderr or outcome.code not in {0, REFUSED}:
        return f"exit {outcome.code}: {lines[-1] if lines else 'nothing said'}"
    if case.number == 0 and outcome.code != 0 and NO_ROBOT not in outcome.stderr:
        return f"refuses a sound file: {lines[-1] if lines else 'nothing said'}"
    if outcome.code == REFUSED and (refusals != 1 or not lines[-1].startswith("lemtomap: ")):
        return f"{refusals} lines of refusal"
    return _left_behind(case, outcome, folder)


def _left_behind(case: Case, outcome: Outcome, folder: Path) -> str:
    """Return what lies in the folder that should not, "" when nothing does."""
    kind = KINDS[case.kind]
    for name, content in {**kind.beside, kind.file: case.data}.items():
        touched = not (folder / name).exists() or (folder / name).read_bytes() != content
        edited = kind.changes_input and case.command[0] == "edit" and outcome.code == 0
        if touched and not edited:
            return f"{name} is not what it was"
    written = {path.relative_to(folder) for path in folder.rglob("*")} - {
        Path(kind.file),
        *map(Path, kind.beside),
    }
    half = [path for path in written if path.name.startswith(".") or path.suffix in {".part", ".lemto-wal"}]
    left = half if outcome.code == 0 else sorted(written)
    return f"left behind: {', '.join(map(str, left[:4]))}" if left else ""


@dataclass(slots=True)
class Tally:
    """What became of the cases of one kind."""

    read: int = 0
    refused: int = 0
    failed: int = 0
    worst_cpu_s: float = 0.0
    worst_mb: float = 0.0

    def count(self, outcome: Outcome, *, failed: bool) -> None:
        """Add one."""
        self.failed += failed
        self.read += not failed and outcome.code == 0
        self.refused += not failed and outcome.code == REFUSED
        self.worst_cpu_s = max(self.worst_cpu_s, outcome.cpu_s)
        self.worst_mb = max(self.worst_mb, outcome.peak_mb)


def fuzz(
    kind_name: str, numbers: Sequence[int], seed: int, *, jobs: int, keep: Path | None
) -> tuple[Tally, list[tuple[Case, str]]]:
    """Run the cases of one kind; return the tally and each failure with its reason."""
    tally, failures = Tally(), list[tuple[Case, str]]()
    with tempfile.TemporaryDirectory(prefix="fuzz-") as held:
        made = Path(held) / "made"
        made.mkdir()
        sound = KINDS[kind_name].make(made)
        cases: dict[str, Case] = {}

        def tasks() -> Iterator[Task]:
            for number in numbers:
                case = make_case(kind_name, sound, number, seed)
                folder = Path(held) / str(number)
                case.lay_out(folder)
                cases[str(number)] = case
                yield Task(str(number), folder, lambda case=case: lemtomap(case.command))  # type: ignore[misc]

        for task, outcome in run_all(tasks(), Limits(), jobs):
            case = cases.pop(task.name)
            wrong = judge(case, outcome, task.folder)
            tally.count(outcome, failed=bool(wrong))
            if wrong:
                failures.append((case, wrong))
            if keep is not None:
                case.lay_out(keep)
                print(
                    f"cd {keep}; lemtomap {' '.join(case.command)}\n{outcome.stdout}{outcome.stderr}", end=""
                )
            shutil.rmtree(task.folder, ignore_errors=True)
    return tally, failures


def usable_kinds(only: Sequence[str]) -> list[str]:
    """Return the kinds to run; without a simulator some cannot be."""
    wanted = list(only) or list(KINDS)
    if importlib.util.find_spec("pybullet") is not None:
        return wanted
    left_out = [name for name in wanted if KINDS[name].simulated]
    if left_out:
        print(f"no pybullet here, left out: {', '.join(left_out)}")
    return [name for name in wanted if name not in left_out]


def report(failures: Sequence[tuple[Case, str]]) -> None:
    """Print each failure, and how often each kind of failure was."""
    for case, wrong in failures[:SHOWN_FAILURES]:
        print(f"\n{case.kind} {case.number} ({case.mutation}, {case.command[0]}): {wrong[:300]}")
        print(f"    {case.again}")
    kinds = Counter((case.kind, wrong.split(" (", maxsplit=1)[0][:70]) for case, wrong in failures)
    print("\ncount  kind        failure")
    for (kind, wrong), count in kinds.most_common():
        print(f"{count:5d}  {kind:11s} {wrong}")


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=300, help="cases of each kind")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=list(KINDS), action="append", default=[], help="may be repeated")
    parser.add_argument("--case", type=int, help="this one only")
    parser.add_argument(
        "--keep", type=Path, metavar="DIR", help="lay the case out there and show what was said"
    )
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args(arguments)
    numbers = range(options.count + 1) if options.case is None else [options.case]
    warm_up(RobotConfig(), "window")
    failures: list[tuple[Case, str]] = []
    print("kind         read  refused  failed  worst CPU  most memory")
    for name in usable_kinds(options.only):
        tally, failed = fuzz(name, numbers, options.seed, jobs=options.jobs, keep=options.keep)
        failures += failed
        print(
            f"{name:11s} {tally.read:5d}  {tally.refused:7d}  {tally.failed:6d}  "
            f"{tally.worst_cpu_s:7.1f} s  {tally.worst_mb:8.0f} MB",
            flush=True,
        )
    if failures:
        report(failures)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
