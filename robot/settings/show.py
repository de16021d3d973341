"""All settings as a person reads them, as a program does, and as a file to begin from."""

import json
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from lemtomap.errors import BadSetting
from lemtomap.robot.config import value_at
from lemtomap.robot.settings.read import ReadSettings
from lemtomap.robot.settings.tree import Setting, SettingTable, tables

DEFAULT = "default"
HEADINGS = ("setting", "value", "unit", "default", "source")
WIDTH = 100
"""Characters of a line of comment."""


@dataclass(frozen=True, slots=True)
class Shown:
    """One setting as it is now."""

    setting: Setting
    value: Any
    source: str
    """`default`, `robot.toml:3` or `command line`."""

    @property
    def cells(self) -> tuple[str, ...]:
        """What stands under HEADINGS."""
        setting = self.setting
        return (setting.name, shown(self.value), setting.unit, shown(setting.default), self.source)


def shown_tables(read: ReadSettings, section: str = "") -> list[tuple[SettingTable, list[Shown]]]:
    """Return the settings of a section and of those within it; of all for an empty one. Raises BadSetting."""
    wanted = tuple(section.split(".")) if section else ()
    found = [table for table in tables() if table.key and table.key[: len(wanted)] == wanted]
    if not found:
        names = ", ".join(table.key[0] for table in tables() if len(table.key) == 1)
        raise BadSetting(f"--section {section}: no such section; there are {names}, and those within them")
    return [(table, [_now(setting, read) for setting in table.settings]) for table in found]


def _now(setting: Setting, read: ReadSettings) -> Shown:
    return Shown(setting, value_at(read.config, setting.key), read.sources.get(setting.key, DEFAULT))


def shown(value: Any) -> str:
    """Return a value as a settings file has it; `none` where there is none."""
    if value is None:
        return "none"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    return repr(value)


def aligned(rows: Sequence[Shown]) -> str:
    """Return a line for each setting, in columns, under their headings."""
    cells = [HEADINGS, *(row.cells for row in rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = ("  ".join(map(str.ljust, line, widths)) for line in cells)
    return "\n".join(line.rstrip() for line in lines)


def as_json(rows: Sequence[Shown]) -> str:
    """Return the settings by name, each with value, default, unit, range, source and what it is for."""
    return json.dumps({row.setting.name: _facts(row) for row in rows}, indent=2, ensure_ascii=False)


def _facts(row: Shown) -> dict[str, Any]:
    allowed = row.setting.allowed
    return {
        "value": row.value,
        "default": row.setting.default,
        "unit": row.setting.unit,
        "range": [allowed.low, allowed.high] if allowed is not None else None,
        "source": row.source,
        "about": row.setting.note,
    }


def as_toml(shown_by_table: Sequence[tuple[SettingTable, Sequence[Shown]]]) -> str:
    """Return a settings file that says everything, with what each is for."""
    head = "# Settings of lemtomap. A line that is taken out, or begins with #, leaves the default.\n"
    return head + "".join(_table_lines(table, rows) for table, rows in shown_by_table if rows)


def _table_lines(table: SettingTable, rows: Sequence[Shown]) -> str:
    lines = ["", *_comment(table.about), f"[{'.'.join(table.key)}]"]
    for row in rows:
        lines += ["", *_comment("; ".join(_remarks(row.setting)))]
        none = "# " if row.value is None else ""
        lines.append(f"{none}{row.setting.key[-1]} = {shown(row.value) if not none else '...'}")
    return "\n".join(lines) + "\n"


def _remarks(setting: Setting) -> Iterator[str]:
    """Yield what is to be said of a setting: what it is for, its unit and its range."""
    if setting.note:
        yield setting.note.rstrip(".")
    if setting.allowed is not None:
        yield f"{setting.unit} {setting.allowed}".strip()


def _comment(text: str) -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent="# ", subsequent_indent="# ")
