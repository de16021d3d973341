"""Break the code on purpose, one change at a time: the tests should notice.

    python -m tools.checks.mutate lemtomap/topo/loops lemtomap/nav --count 10 --seed 3
    python -m tools.checks.mutate robot/motion/safety.py
    python -m tools.checks.mutate --safety [--only cliff]

With folders or files: random mutants of comparisons, logic, arithmetic, constants and returned values. With
`--safety`: the hand-made mutants of the safety chain, of which none may survive.

All happens in a copy: whatever ends a run, the checkout stays as it is. For each mutant the tests nearest to
its file run first, then those of its package, then whole missions, until one fails.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lemtomap.robot.child import python
from tools.checks.mutants import Mutant, random_mutants
from tools.checks.safety_mutants import MUTANTS as SAFETY_MUTANTS

ROOT = Path(__file__).resolve().parent.parent.parent
COPIED = ("drivers", "lemtomap", "robot", "sim", "tools", "tests", "docs", "README.md", "pyproject.toml")
MISSIONS = [
    f"tests/robot/{name}.py"
    for name in ("missions/test_lost", "missions/test_mission", "runs/test_lockstep", "test_reactions")
]
SAFETY_TESTS = [
    [
        "tests/robot/motion/test_safety.py",
        "tests/robot/motion/test_velocity.py",
        "tests/robot/motion/test_watchdog.py",
    ]
]
LONGEST_S = 600.0  # of one round of tests: a mutant that never ends is noticed as well
FAILED = 1  # pytest: some tests failed
BROKEN = 2  # pytest: they could not even be imported, which is noticed too
NONE_FOUND = 5
ABORTED = 134  # by a shell's count: 128 + SIGABRT


class Sandbox:
    """A copy of the checkout, compiled kernels included, in which one mutant after another is tried."""

    def __init__(self, root: Path, folder: Path) -> None:
        self.folder = folder / "copy"
        self._root = root
        self.folder.mkdir()
        for name in COPIED:
            source = root / name
            if source.is_dir():
                shutil.copytree(source, self.folder / name, symlinks=True)
            elif source.exists():
                shutil.copy2(source, self.folder / name)
        shared = root.parent / "shared"
        if shared.exists():  # recorded logs: tests skip without them
            (folder / "shared").symlink_to(shared)

    def killed_by(self, mutant: Mutant | None, rounds: list[list[str]]) -> str:
        """Return the test that fails first with a mutant in place (None: without any); empty if none does."""
        with self._changed(mutant):
            for tests in rounds:
                failed = self._run(tests)
                if failed:
                    return failed
        return ""

    @contextmanager
    def _changed(self, mutant: Mutant | None) -> Iterator[None]:
        if mutant is None:
            yield
            return
        target = self.folder / mutant.path
        text = target.read_text(encoding="utf-8")
        with _compiled_anew(self.folder, target):
            target.write_text(mutant.applied(text), encoding="utf-8")
            try:
                yield
            finally:
                shutil.copy2(self._root / mutant.path, target)  # with its time: compiled code fits again

    def _run(self, tests: list[str]) -> str:
        command = python("-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *tests)
        environment = dict(os.environ, PYTHONPATH=str(self.folder), PYTHONDONTWRITEBYTECODE="1")
        try:
            run = subprocess.run(  # noqa: S603 -- our own tests
                command,
                cwd=self.folder,
                env=environment,
                capture_output=True,
                text=True,
                check=False,
                timeout=LONGEST_S,
            )
        except subprocess.TimeoutExpired:
            return f"no end within {LONGEST_S:.0f} s"
        if run.returncode < 0 or run.returncode == ABORTED:
            return "the interpreter crashed"  # a kernel wrote past its array, which is noticed as well
        if run.returncode in {FAILED, BROKEN}:
            failed = re.search(r"^(?:FAILED|ERROR) (\S+)", run.stdout, re.MULTILINE)
            return failed[1] if failed else "tests that cannot run"
        if run.returncode not in {0, NONE_FOUND}:
            raise SystemExit(f"pytest failed to run\n{run.stdout}{run.stderr}")
        return ""


@contextmanager
def _compiled_anew(folder: Path, target: Path) -> Iterator[None]:
    """Put away what was compiled from a file of kernels and from those that call it, and bring it back."""
    kept: list[tuple[Path, bytes, tuple[int, int]]] = []
    stale = kernels_on(target, folder)
    for file in stale:
        for compiled in _compiled(file):
            stat = compiled.stat()
            kept.append((compiled, compiled.read_bytes(), (stat.st_atime_ns, stat.st_mtime_ns)))
            compiled.unlink()
    try:
        yield
    finally:
        for file in stale:
            for compiled in _compiled(file):
                compiled.unlink()
        for compiled, data, times in kept:
            compiled.write_bytes(data)
            os.utime(compiled, ns=times)


def kernels_on(target: Path, folder: Path) -> list[Path]:
    """Return a file of kernels and all that call into it, by their imports; nothing for any other file."""
    texts = {file: file.read_text(encoding="utf-8") for file in (folder / "lemtomap").rglob("*.py")}
    kernels = {file: text for file, text in texts.items() if re.search(r"^@.*njit", text, re.MULTILINE)}
    found = [target] if target in kernels else []
    for file in found:  # grows while it is gone through
        package, _, name = ".".join(file.relative_to(folder).with_suffix("").parts).rpartition(".")
        imports = re.compile(
            rf"^(from {re.escape(package)}\.{name} import|import {re.escape(package)}\.{name}\b"
            rf"|from {re.escape(package)} import .*\b{name}\b)",
            re.MULTILINE,
        )
        found += [other for other, text in kernels.items() if other not in found and imports.search(text)]
    return found


def _compiled(file: Path) -> list[Path]:
    return [
        found for kind in ("nbi", "nbc") for found in file.parent.glob(f"__pycache__/{file.stem}.*.{kind}")
    ]


def rounds_for(path: str, root: Path) -> list[list[str]]:
    """Return the rounds of tests for a file: its own, those of its room, of its package, whole missions."""
    file, tests = Path(path), root / "tests"
    package = tests / file.parts[0]
    named = sorted(package.rglob(f"test_{file.stem}.py"))
    rooms = [room for room in _rooms(file, package) if room.is_dir() and room != package]
    rounds = [_names(named, root), _names(rooms[:1], root), _names([package], root), MISSIONS]
    return [each for each in rounds if each]


def _rooms(file: Path, package: Path) -> Iterator[Path]:
    """Iterate over the folders whose tests are nearest to a file, the nearest first."""
    rooms = file.parts[1:-1]
    for depth in range(len(rooms), 0, -1):
        yield package.joinpath(*rooms[:depth])
        yield package / rooms[depth - 1]


def _names(paths: list[Path], root: Path) -> list[str]:
    return [path.relative_to(root).as_posix() for path in paths]


def _options(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tools.checks.mutate",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("where", nargs="*", help="folders or files, from the root of the checkout")
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--skip", type=int, default=0, help="the first of them, tried in a run that was cut off"
    )
    parser.add_argument("--safety", action="store_true", help="the hand-made mutants of the safety chain")
    parser.add_argument("--only", default="", help="those whose name contains this")
    options = parser.parse_args(arguments)
    if bool(options.where) == options.safety:
        parser.error("name folders or files to mutate, or --safety")
    return options


def main(arguments: list[str] | None = None, root: Path = ROOT) -> int:
    """Try the mutants and print which survive; return 1 when any does, 2 for what cannot be mutated."""
    options = _options(arguments)
    try:
        chosen = (
            list(SAFETY_MUTANTS)
            if options.safety
            else random_mutants(root, options.where, options.count, options.seed)
        )
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    chosen = [mutant for mutant in chosen if options.only in mutant.name][options.skip :]
    survivors = 0
    with tempfile.TemporaryDirectory() as name:
        sandbox = Sandbox(root, Path(name))
        rounds = [SAFETY_TESTS if options.safety else rounds_for(each.path, root) for each in chosen]
        every = sorted({test for tests in rounds for each in tests for test in each})
        if chosen and (red := sandbox.killed_by(None, [every])):
            raise SystemExit(f"{red} fails without any mutant")
        for mutant, tests in zip(chosen, rounds, strict=True):
            begun_s = time.monotonic()
            test = sandbox.killed_by(mutant, tests)
            survivors += not test
            took_s = time.monotonic() - begun_s
            how = f"   [{test}, {took_s:.0f} s]" if test else f"   [{took_s:.0f} s]"
            print(f"{'killed' if test else 'SURVIVED':9} {mutant.name}{how}", flush=True)
    print(f"{len(chosen) - survivors} of {len(chosen)} mutants killed")
    return 1 if survivors else 0


if __name__ == "__main__":
    raise SystemExit(main())
