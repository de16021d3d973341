"""Every setting by its key: what it is, what it may be, and what it is unless somebody says otherwise."""

import ast
import dataclasses
import inspect
import io
import textwrap
import tokenize
import typing
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

from lemtomap.robot.config import RANGES, SAID_ONCE, Key, RobotConfig, value_at
from lemtomap.settings import Range, range_of

UNITS = {
    "m": "m",
    "metres": "m",
    "s": "s",
    "rad": "rad",
    "deg": "deg",
    "mps": "m/s",
    "mps2": "m/s²",
    "radps": "rad/s",
    "radps2": "rad/s²",
    "dps": "deg/s",
    "cdeg": "0.01 deg",
    "hz": "Hz",
    "v": "V",
    "dv": "0.1 V",
    "ms": "ms",
    "percent": "%",
    "cells": "cells",
    "beams": "beams",
    "ticks": "ticks",
    "tick": "tick",
    "m2": "m²",
    "rad2": "rad²",
}
"""How a unit at the end of a name is written."""


@dataclass(frozen=True, slots=True)
class Setting:
    """One value that a file may hold."""

    key: Key
    table: type
    """The dataclass it stands in."""
    kind: type
    """int, float, bool or str."""
    default: Any
    """None where that is allowed: then the program finds the value itself."""
    allowed: Range | None
    """None for what is no number."""

    @property
    def name(self) -> str:
        """The key as it is written: `nav.body.v_max_mps`."""
        return ".".join(self.key)

    @property
    def unit(self) -> str:
        """The unit its name ends in; empty for counts, shares and words."""
        return unit_of(self.key[-1])

    @property
    def note(self) -> str:
        """What the source says of it: the comment beside it, or the text below it."""
        return notes_of(self.table)[self.key[-1]]


@dataclass(frozen=True, slots=True)
class SettingTable:
    """A dataclass in the tree: the settings between one `[header]` and the next."""

    key: Key
    cls: type
    settings: tuple[Setting, ...]

    @property
    def about(self) -> str:
        """What its docstring says, in one line."""
        return " ".join(inspect.cleandoc(self.cls.__doc__ or "").replace("Raises BadSetting.", "").split())


@cache
def tables() -> tuple[SettingTable, ...]:
    """Return every table, each before those within it."""
    return tuple(_tables((), RobotConfig()))


@cache
def all_settings() -> dict[Key, Setting]:
    """Return every setting by its key, in the order of the tables."""
    return {setting.key: setting for table in tables() for setting in table.settings}


def all_keys() -> list[Key]:
    """Return the keys of all tables and settings."""
    return [table.key for table in tables() if table.key] + list(all_settings())


def _tables(key: Key, default: Any) -> Iterator[SettingTable]:
    cls, inner, plain = type(default), [], []
    hints = typing.get_type_hints(cls)
    for declared in dataclasses.fields(cls):
        here, value = (*key, declared.name), getattr(default, declared.name)
        if here in SAID_ONCE or _is_given(declared):
            continue
        if dataclasses.is_dataclass(value):
            inner.append((here, value))
        else:
            allowed = RANGES.get(here) or range_of(declared, value)
            plain.append(Setting(here, cls, _kind(hints[declared.name]), value, allowed))
    yield SettingTable(key, cls, tuple(plain))
    for here, value in inner:
        yield from _tables(here, value)


def _is_given(declared: "dataclasses.Field[Any]") -> bool:
    """Return True for a field without a default: a fact of a device, and nobody's choice."""
    return declared.default is dataclasses.MISSING and declared.default_factory is dataclasses.MISSING


def _kind(hint: Any) -> type:
    """Return the type of a field, of `float | None` the number's."""
    kinds = [kind for kind in typing.get_args(hint) or (hint,) if kind is not type(None)]
    return typing.cast("type", kinds[0])


def to_mapping(config: RobotConfig) -> dict[str, Any]:
    """Return settings as plain nested values, each where a file says it."""
    data: dict[str, Any] = {}
    for key in all_settings():
        at = data
        for table in key[:-1]:
            at = at.setdefault(table, {})
        at[key[-1]] = value_at(config, key)
    return data


def unit_of(name: str) -> str:
    """Return the unit at the end of a name, such as rad/m of `drift_rad_per_m`; empty if there is none."""
    upper, per, lower = name.rpartition("_per_")
    if not per:
        return UNITS.get(name.rpartition("_")[2], "")
    below = UNITS.get(lower.removeprefix("sqrt_"), "")
    root = "√" if lower.startswith("sqrt_") else ""
    return f"{unit_of(upper) or '1'}/{root}{below}" if below else ""


@cache
def notes_of(cls: type) -> dict[str, str]:
    """Return what the source says of each field: the comment beside it, or the string below it."""
    source = textwrap.dedent(inspect.getsource(cls))
    comments = _comments(source)
    body = typing.cast("ast.ClassDef", ast.parse(source).body[0]).body
    notes: dict[str, str] = {}
    for statement, following in zip(body, [*body[1:], None], strict=True):
        if not isinstance(statement, ast.AnnAssign) or not isinstance(statement.target, ast.Name):
            continue
        lines = range(statement.lineno, (statement.end_lineno or 0) + 1)
        beside = [comments[line] for line in lines if line in comments]
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
