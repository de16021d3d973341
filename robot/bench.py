"""`lemtomap bench`: the measuring programs under tools/, by name."""

import pkgutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import tools
from lemtomap.errors import BadSetting
from robot.child import python

PREFIX = "bench_"


def benches() -> dict[str, str]:
    """Return each bench's name and the first line of what it says about itself."""
    found = {}
    for module in pkgutil.iter_modules(tools.__path__):
        if module.name.startswith(PREFIX):
            found[module.name.removeprefix(PREFIX)] = _about(module.name)
    return found


def _about(name: str) -> str:
    """Return the first line of a module's docstring without running it."""
    source = Path(tools.__path__[0]) / f"{name}.py"
    return source.read_text(encoding="utf-8").splitlines()[0].strip('" ')


def run_bench(name: str, arguments: Sequence[str]) -> int:
    """Run one bench in a process of its own and return its exit code. Raises BadSetting."""
    known = benches()
    if name not in known:
        raise BadSetting(f"bench '{name}': must be one of {', '.join(sorted(known))}")
    command = python("-m", f"tools.{PREFIX}{name}", *arguments)
    return subprocess.run(command, check=False).returncode  # noqa: S603 - our own interpreter and module
