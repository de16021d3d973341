"""`lemtomap bench`: the measuring programs under tools/bench/ of a checkout, by name."""

import os
import subprocess
from collections.abc import Sequence
from pathlib import Path

import lemtomap
from lemtomap.errors import BadSetting
from lemtomap.robot.child import python

ROOT = Path(lemtomap.__file__).resolve().parent.parent
FOLDER = ROOT / "tools" / "bench"


def benches() -> dict[str, str]:
    """Return each bench's name and the first line of what it says about itself.

    Raises BadSetting for an installed program: what measures is in the checkout alone.
    """
    found = {path.stem: _about(path) for path in sorted(FOLDER.glob("[a-z]*.py"))}
    if not found:
        raise BadSetting("bench: needs a checkout of the project, installed with pip install -e")
    return found


def _about(path: Path) -> str:
    """Return the first line of a module's docstring without running it."""
    return path.read_text(encoding="utf-8").splitlines()[0].strip('" ')


def run_bench(name: str, arguments: Sequence[str]) -> int:
    """Run one bench in a process of its own and return its exit code. Raises BadSetting."""
    known = benches()
    if name not in known:
        raise BadSetting(f"bench '{name}': must be one of {', '.join(sorted(known))}")
    command = python("-m", f"tools.bench.{name}", *arguments)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(command, check=False, env=environment).returncode  # noqa: S603 - our own module
