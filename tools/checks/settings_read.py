"""Settings that nothing reads, found in the source.

    python -m tools.checks.settings_read

A setting is read where the program says `TABLE.NAME` by the name of its table (`audit.way_m`), or else
`config.NAME` in a file that names its dataclass or takes the whole table. What only checks does not count.
"""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from lemtomap.robot.config import SAID_ONCE
from lemtomap.robot.settings.tree import Setting, all_settings, tables
from tools.checks.house import ROOT, sources

HOLDERS = {"config", "limits", "lim", "c"}
"""What the program calls settings, with or without an underscore in front."""
OF_ITS_OWN = ("sim/", "robot/settings/")
"""The simulator's settings are its own; what reads them all tells nothing of one."""
CHECKS = {"_relations"}
"""Functions that only look whether settings can work; those of the dataclasses themselves, too."""


@dataclass(frozen=True, slots=True)
class Reads:
    """What one file reads off settings."""

    path: Path
    names: frozenset[str]
    """Of classes and functions that stand in it."""
    read: frozenset[tuple[str, str]]
    """Holder and attribute: ("config", "period_s")."""


def unread() -> list[str]:
    """Return the names of the settings that nothing reads."""
    files = [_reads(path) for path in sources() if not _is_left_out(path)]
    return [setting.name for setting in all_settings().values() if not _is_read(setting, files)]


def _is_left_out(path: Path) -> bool:
    return path.relative_to(ROOT).as_posix().startswith(OF_ITS_OWN)


def _is_read(setting: Setting, files: list[Reads]) -> bool:
    attribute, table = setting.key[-1], setting.key[-2]
    stages = {table, *(stage[-2] for stage, source in SAID_ONCE.items() if source == setting.key)}
    attributes = {attribute, *(stage[-1] for stage, source in SAID_ONCE.items() if source == setting.key)}
    for file in files:
        for holder, read in file.read:
            if read in attributes and (holder in stages or (holder in HOLDERS and _knows(file, setting))):
                return True
    return False


def _knows(file: Reads, setting: Setting) -> bool:
    takes_table = any(read == setting.key[-2] for _, read in file.read)
    return takes_table or setting.table.__name__ in file.names


def _reads(path: Path) -> Reads:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    names |= {node.name for node in ast.walk(tree) if isinstance(node, ast.ClassDef)}
    return Reads(path, frozenset(names), frozenset(_attributes(tree, in_settings=False)))


def _attributes(tree: ast.AST, *, in_settings: bool) -> Iterator[tuple[str, str]]:
    """Yield holder and attribute of each read; `self` of a class of settings is such a holder."""
    known = {table.cls.__name__ for table in tables()}
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef) and _only_checks(node.name, in_settings=in_settings):
            continue
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load):
            holder = _holder(node.value)
            yield "config" if holder == "self" and in_settings else holder.removeprefix("_"), node.attr
        inside = node.name in known if isinstance(node, ast.ClassDef) else in_settings
        yield from _attributes(node, in_settings=inside)


def _only_checks(name: str, *, in_settings: bool) -> bool:
    return name in CHECKS or (in_settings and name == "__post_init__")


def _holder(node: ast.expr) -> str:
    """Return the last word before the dot."""
    if isinstance(node, ast.Attribute):
        return node.attr
    return node.id if isinstance(node, ast.Name) else ""


if __name__ == "__main__":
    print(*unread(), sep="\n")
