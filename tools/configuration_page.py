"""Write docs/configuration.md: every key of a settings file, its default, its range and what it is for.

    python tools/configuration_page.py       after any change to a setting; a test tells when it was forgotten

The page is made from the dataclasses themselves: it says what stands beside or below a field there.
"""

from pathlib import Path
from typing import Any

from lemtomap.robot.settings.tree import Setting, SettingTable, tables
from lemtomap.settings import Range

PAGE = Path(__file__).resolve().parent.parent / "docs" / "configuration.md"
HEAD = """# Settings

`lemtomap sim`, `run`, `goto`, `teleop`, `record`, `map` and `replay` take a TOML file of settings that differ
from the defaults, and single ones over it:

    lemtomap config                              # every setting, its unit, its default
    lemtomap config --write robot.toml           # a file to begin from, with what each is for
    lemtomap config robot.toml --section nav     # what a file makes of them: value, and file:line or default
    lemtomap run --config robot.toml
    lemtomap sim --config robot.toml --set nav.body.v_max_mps=0.3

    # robot.toml
    [ports]
    hokuyo = "/dev/ttyACM1"

    [laser]
    x_m = 0.05              # it stands 5 cm before the axle

    [nav.body]
    v_max_mps = 0.3

A key that is unknown, of the wrong type or outside its range is refused in one line that names file, line,
key, value and rule, before anything moves. The bounds of `[safety]` and `[smoother]` hold for programs too.
Each run keeps the settings it used in its `summary.json` and in its recording: `replay` maps with those,
unless `--config` gives others or `--set` changes some, and says so. In simulation the laser sits where
`[laser]` says. Names end in their unit: m, s, rad, mps (m/s),
radps (rad/s), mps2 (m/s²), v (volt).

This page is made by `tools/configuration_page.py` from the program itself.
"""


def page() -> str:
    """Return the whole page."""
    return HEAD + "".join(_table(table) for table in tables() if table.key)


def _table(table: SettingTable) -> str:
    rows = "".join(_row(setting) for setting in table.settings)
    head = f"\n## [{'.'.join(table.key)}]\n\n{table.about}\n"
    return head + ("\n| key | default | unit | range | |\n|---|---|---|---|---|\n" + rows if rows else "")


def _row(setting: Setting) -> str:
    allowed = setting.allowed
    why = allowed.why if allowed is not None else ""
    text = "; ".join(part for part in (setting.note.rstrip("."), f"bounds: {why}" if why else "") if part)
    cells = [f"`{setting.key[-1]}`", _shown(setting.default), setting.unit, _span(allowed), _cell(text)]
    return f"| {' | '.join(cells)} |\n"


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


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
