"""One change of one expression: a comparison, an operator, a constant, a returned value."""

import ast
import copy
import random
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.GtE,
    ast.GtE: ast.Lt,
    ast.Gt: ast.LtE,
    ast.LtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
ARITHMETIC: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
}
"""What each operator becomes."""


@dataclass(frozen=True, slots=True)
class Mutant:
    """One change of one place of one file."""

    name: str
    path: str
    """Of the file, from the root of the checkout."""
    old: str
    new: str
    offset: int | None = None
    """Bytes before `old`; None: it occurs only once."""

    def applied(self, text: str) -> str:
        """Return the file's text with the change in it. Raises ValueError where `old` is not to be found."""
        if self.offset is None:
            if text.count(self.old) != 1:
                raise ValueError(f"mutant '{self.name}': its text occurs {text.count(self.old)} times")
            return text.replace(self.old, self.new)
        data, old = text.encode(), self.old.encode()
        end = self.offset + len(old)
        if data[self.offset : end] != old:
            raise ValueError(f"mutant '{self.name}': the file has changed since")
        return (data[: self.offset] + self.new.encode() + data[end:]).decode()


def random_mutants(root: Path, folders: list[str], count: int, seed: int) -> list[Mutant]:
    """Return so many mutants of the files below some folders (or of single files), the same for one seed."""
    files = sorted({file for folder in folders for file in _files(root / folder)})
    every = [mutant for file in files for mutant in mutants_of(file, root)]
    return random.Random(seed).sample(every, min(count, len(every)))


def mutants_of(file: Path, root: Path) -> list[Mutant]:
    """Return all mutants of a file, in the order of its text."""
    text = file.read_text(encoding="utf-8")
    line_starts = [0]
    for line in text.encode().splitlines(keepends=True):
        line_starts.append(line_starts[-1] + len(line))
    path, found = file.relative_to(root).as_posix(), []
    for node in _worth_changing(ast.parse(text)):
        new = _changed(node)
        if new is None or node.end_lineno is None or node.end_col_offset is None:
            continue
        start = line_starts[node.lineno - 1] + node.col_offset
        end = line_starts[node.end_lineno - 1] + node.end_col_offset
        old = text.encode()[start:end].decode()
        shown = " ".join(old.split())
        found.append(Mutant(f"{path}:{node.lineno}: {shown} -> {new}", path, old, new, start))
    return found


def _files(folder: Path) -> list[Path]:
    found = [folder] if folder.is_file() else sorted(folder.rglob("*.py"))
    if not found:
        raise ValueError(f"{folder}: no Python files there")
    return found


def _worth_changing(tree: ast.AST) -> Iterator[ast.expr | ast.Return]:
    """Iterate over expressions whose change a run can notice: no annotations, texts or messages."""
    for name, value in ast.iter_fields(tree):
        if name in {"annotation", "returns", "decorator_list"}:
            continue
        for child in value if isinstance(value, list) else [value]:
            if not isinstance(child, ast.AST) or isinstance(child, ast.JoinedStr | ast.Raise | ast.Assert):
                continue
            if isinstance(child, ast.expr | ast.Return):
                yield child
            yield from _worth_changing(child)


def _changed(node: ast.expr | ast.Return) -> str | None:
    """Return an expression's text after its change, None where there is nothing to change."""
    if isinstance(node, ast.Return):
        empty = node.value is None or (isinstance(node.value, ast.Constant) and node.value.value is None)
        return None if empty else "return None"
    if isinstance(node, ast.Constant):
        return _other_constant(node.value)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        return f"({ast.unparse(node.operand)})"
    changed = copy.deepcopy(node)
    if isinstance(changed, ast.Compare):
        changed.ops[0] = COMPARISONS[type(changed.ops[0])]()
    elif isinstance(changed, ast.BoolOp):
        changed.op = ast.Or() if isinstance(changed.op, ast.And) else ast.And()
    elif isinstance(changed, ast.BinOp) and type(changed.op) in ARITHMETIC:
        changed.op = ARITHMETIC[type(changed.op)]()
    else:
        return None
    return f"({ast.unparse(changed)})"


def _other_constant(value: object) -> str | None:
    if isinstance(value, bool):
        return str(not value)
    if isinstance(value, int):
        return str(value + 1)
    if isinstance(value, float):
        return repr(2.0 * value if value else 1.0)
    return None
