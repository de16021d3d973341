"""Write docs/configuration.md: every key of a settings file, its default, its range and what it is for.

    python tools/configuration_page.py       after any change to a setting; a test tells when it was forgotten

The page is made from the dataclasses themselves: it says what stands beside or below a field there.
"""

import ast
import dataclasses
import inspect
import io
import textwrap
import tokenize
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lemtomap.robot.config import RobotConfig
from lemtomap.settings import Range, range_of

PAGE = Path(__file__).resolve().parent.parent / "docs" / "configuration.md"
HEAD = """# Settings

`lemtomap run`, `goto`, `teleop` and `record` take a TOML file of settings that differ from the defaults:

    lemtomap run --config robot.toml

    # robot.toml
    [ports]
    hokuyo = "/dev/ttyACM1"

    [laser]
    x_m = 0.05              # it stands 5 cm before the axle

    [nav.body]
    v_max_mps = 0.3

A key that is unknown, of the wrong type or outside its range is refused in one line that names file, line,
key, value and rule, before anything moves. The bounds of `[safety]` and `[smoother]` hold for programs too.
Each run keeps the settings it used in its `summary.json`. Names end in their unit: m, s, rad, mps (m/s),
radps (rad/s), mps2 (m/s²), v (volt).

This page is made by `tools/configuration_page.py` from the program itself.
"""


def page() -> str:
    """Return the whole page."""
    return HEAD + "".join(_table(cls, key, about) for cls, key, about in _tables(RobotConfig, ()))


def _tables(cls: Any, key: tuple[str, ...]) -> Iterator[tuple[Any, tuple[str, ...], dict[str, str]]]:
    """Yield (dataclass, key, what is said of each field), each table before those within it."""
    about = notes_of(cls)
    if key:
        yield cls, key, about
    hints = typing.get_type_hints(cls)
    for field in dataclasses.fields(cls):
        if dataclasses.is_dataclass(hints[field.name]):
            yield from _tables(hints[field.name], (*key, field.name))


def _table(cls: Any, key: tuple[str, ...], about: dict[str, str]) -> str:
    told = " ".join(inspect.cleandoc(cls.__doc__ or "").replace("Raises BadSetting.", "").split())
    rows = [_row(field, about.get(field.name, "")) for field in dataclasses.fields(cls) if _is_plain(field)]
    head = f"\n## [{'.'.join(key)}]\n\n{told}\n"
    return head + ("\n| key | default | range | |\n|---|---|---|---|\n" + "".join(rows) if rows else "")


def _is_plain(field: "dataclasses.Field[Any]") -> bool:
    return field.default is not dataclasses.MISSING


def _row(field: "dataclasses.Field[Any]", note: str) -> str:
    allowed = range_of(field)
    why = allowed.why if allowed is not None else ""
    text = "; ".join(part for part in (note.rstrip("."), f"bounds: {why}" if why else "") if part)
    return f"| `{field.name}` | {_shown(field.default)} | {_span(allowed)} | {_cell(text)} |\n"


def _span(allowed: Range | None) -> str:
    return f"{allowed.low:g} to {allowed.high:g}" if allowed is not None else ""


def _shown(value: Any) -> str:
    if value is None:
        return "none"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    return f"{value:.6g}"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def notes_of(cls: Any) -> dict[str, str]:
    """Return what the source says of each field: the comment beside it, or the string below it."""
    source = textwrap.dedent(inspect.getsource(cls))
    comments = _comments(source)
    body = typing.cast("ast.ClassDef", ast.parse(source).body[0]).body
    notes: dict[str, str] = {}
    for statement, following in zip(body, [*body[1:], None], strict=True):
        if not isinstance(statement, ast.AnnAssign) or not isinstance(statement.target, ast.Name):
            continue
        beside = [
            comments[line]
            for line in range(statement.lineno, (statement.end_lineno or 0) + 1)
            if line in comments
        ]
        below = _string(following)
        notes[statement.target.id] = " ".join([*beside, *([" ".join(below.split())] if below else [])])
    return notes


def _comments(source: str) -> dict[int, str]:
    """Return the comment that ends each line, by its number."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    return {
        token.start[0]: token.string.lstrip("# ")
        for token in tokens
        if token.type == tokenize.COMMENT and token.line[: token.start[1]].strip()
    }


def _string(statement: ast.stmt | None) -> str:
    value = statement.value if isinstance(statement, ast.Expr) else None
    return value.value if isinstance(value, ast.Constant) and isinstance(value.value, str) else ""


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
