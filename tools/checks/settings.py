"""Settings that nothing reads, and numbers of the stages that no setting reaches: found in the source.

    python -m tools.checks.settings

A setting is read where the program says `TABLE.NAME` by the name of its table (`audit.way_m`), or else
`config.NAME` in a file that names its dataclass or takes the whole table. What only checks does not count.

Out of reach is a dataclass of settings that does not hang in the tree, and a number with a unit at the top of
a file without a reason beside or below it why nobody should turn it.
"""

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import zip_longest
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


UNIT = re.compile(r"^[A-Z_][A-Z0-9_]*_(M|MM|S|MS|RAD|DEG|MPS|MPS2|RADPS|HZ|V|SHARE|SHARES|TIMES|SIGMAS)$")
"""Names of numbers that somebody might want to turn."""


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


def out_of_reach() -> list[str]:
    """Return the dataclasses of settings and the numbers that no settings file reaches, with their files."""
    return [
        f"{path.relative_to(ROOT).as_posix()}: {name}"
        for path in sources()
        if path.relative_to(ROOT).parts[0] != "sim"
        for name in [*stray_tables(path), *bare_numbers(path.read_text(encoding="utf-8"))]
    ]


def stray_tables(path: Path) -> list[str]:
    """Return the dataclasses of settings in a file that do not hang in the tree."""
    known = {table.cls.__name__ for table in tables()}
    classes = [
        node.name for node in _body(path.read_text(encoding="utf-8")) if isinstance(node, ast.ClassDef)
    ]
    return [name for name in classes if re.fullmatch(r"[A-Z]\w*(Config|Limits)", name) and name not in known]


def bare_numbers(source: str) -> list[str]:
    """Return the constants of a file that are numbers with a unit and give no reason."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    told = {token.start[0] for token in tokens if token.type == tokenize.COMMENT}
    found, body = [], _body(source)
    for statement, following in zip_longest(body, body[1:]):
        if not isinstance(statement, ast.Assign | ast.AnnAssign) or statement.value is None:
            continue
        targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
        names = [node.id for target in targets for node in ast.walk(target) if isinstance(node, ast.Name)]
        lines = range(statement.lineno - 1, (statement.end_lineno or 0) + 1)
        below = isinstance(following, ast.Expr) and isinstance(following.value, ast.Constant)
        if _is_number(statement.value) and not below and told.isdisjoint(lines):
            found += [name for name in names if UNIT.search(name)]
    return found


def _body(source: str) -> list[ast.stmt]:
    return ast.parse(source).body


def _is_number(node: ast.expr) -> bool:
    """Return True for a number, several of them, or what is reckoned of numbers alone."""
    return not any(
        isinstance(part, ast.Name | ast.List | ast.Dict | ast.Set) for part in ast.walk(node)
    ) and any(
        isinstance(part, ast.Constant) and isinstance(part.value, int | float) for part in ast.walk(node)
    )


def main() -> None:
    """Print both, and how many."""
    for title, names in (("settings that nothing reads", unread()), ("out of reach", out_of_reach())):
        print(f"{title}: {len(names)}", *names, sep="\n    ")


if __name__ == "__main__":
    main()
