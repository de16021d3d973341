"""Settings from a TOML file and from the command line, with who said what.

What cannot be used is refused in one line: file and line, or the option, then key, value and rule.
"""

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lemtomap.errors import BadSetting
from lemtomap.robot.config import BadKey, Key, PortsConfig, RobotConfig
from lemtomap.robot.devices.ports import HOKUYO, KOBUKI, ListPorts, describe, matches_identity
from lemtomap.robot.settings.check import from_mapping
from lemtomap.robot.settings.tree import all_settings, to_mapping

Options = Mapping[str, tuple[str, Any]]
"""The option of a command that is short for a setting -> name and value of that; None: not given."""

LARGEST_BYTES = 1 << 20
"""Of a settings file: all settings with all that is said of them take a twentieth."""


@dataclass(frozen=True, slots=True)
class ReadSettings:
    """The settings of a run, and where each that somebody chose was said."""

    config: RobotConfig = field(default_factory=RobotConfig)
    sources: Mapping[Key, str] = field(default_factory=dict)
    """`robot.toml:3` or `command line`; what is not in it is the default."""


def load(path: Path, ports: ListPorts | None = None) -> RobotConfig:
    """Read and check a TOML file. Raises BadSetting.

    `ports` lists the machine's serial ports, to notice a swapped pair; None: not checked.
    """
    return read_settings(path, ports=ports).config


def read_settings(
    path: Path | None = None,
    orders: Sequence[str] = (),
    *,
    options: Options | None = None,
    base: RobotConfig | None = None,
    ports: ListPorts | None = None,
) -> ReadSettings:
    """Return the defaults, changed by a file, that by `--set KEY=VALUE`, and that by a command's own options.

    base: what is changed, instead of the defaults; the file, if there is one, replaces all of it.
    Raises BadSetting.
    """
    data = to_mapping(base) if base is not None and path is None else {}
    places: dict[Key, str] = {}
    if path is not None:
        text = _text(path)
        data = _parsed(text, path)
        places = {key: f"{path}:{line}" for key, line in key_lines(text).items()}
    for key, value, place in [*_orders(orders), *_options(options or {})]:
        _put(data, key, value, place)
        places[key] = place
    try:
        config = from_mapping(data)
        _check_ports(config.ports, ports)
    except BadKey as error:
        key, place = _place(error.keys, places)
        where = f"{place}: " if place else f"{path}:1: " if path is not None else ""
        raise BadSetting(f"{where}{'.'.join(key)}: {error.reason}") from None
    return ReadSettings(config, _sources(data, places))


def _sources(data: Mapping[str, Any], places: Mapping[Key, str]) -> dict[Key, str]:
    """Return where each setting that somebody chose was said."""
    said = {key: _place((key,), places)[1] for key in all_settings() if _is_said(data, key)}
    return {key: "command line" if place.startswith("--") else place for key, place in said.items() if place}


def _text(path: Path) -> str:
    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise BadSetting(f"{path}: larger than {LARGEST_BYTES >> 20} MB, no file of settings")
        return path.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        raise BadSetting(f"{path}: no such file") from None
    except UnicodeDecodeError as error:
        raise BadSetting(f"{path}: not UTF-8 text (byte {error.start + 1})") from None
    except OSError as error:
        raise BadSetting(f"{path}: cannot be read ({error.strerror})") from None


def _parsed(text: str, path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise BadSetting(f"{path}: nested too deep") from None
    except ValueError as error:  # no TOML, or a number of 5,000 digits
        told = re.fullmatch(r"(.*) \(at line (\d+), column \d+\)", str(error), re.DOTALL)
        last = text.count("\n") + 1
        place, reason = (f"{path}:{told[2]}", told[1]) if told else (f"{path}:{last}", str(error))
        raise BadSetting(f"{place}: not TOML: {reason}") from None


def _orders(orders: Sequence[str]) -> list[tuple[Key, Any, str]]:
    """Return key, value and place of each `KEY=VALUE`; text needs no quotes."""
    found = []
    for order in orders:
        name, equals, text = order.partition("=")
        if not equals or not name.strip():
            raise BadSetting(f"--set {order}: must be KEY=VALUE, such as nav.body.v_max_mps=0.3")
        try:
            value = tomllib.loads(f"value = {text}")["value"]
        except (ValueError, RecursionError):
            value = text.strip()
        found.append((_split(name.strip()), value, f"--set {order}"))
    return found


def _options(options: Options) -> list[tuple[Key, Any, str]]:
    """Return key, value and place of the options that are short for a setting."""
    return [(_split(name), value, option) for option, (name, value) in options.items() if value is not None]


def _put(data: dict[str, Any], key: Key, value: Any, place: str) -> None:
    """Set one of nested values, making the tables round it."""
    at = data
    for depth, table in enumerate(key[:-1], start=1):
        at = at.setdefault(table, {})
        if not isinstance(at, dict):
            raise BadSetting(f"{place}: {'.'.join(key[:depth])} is no table")
    at[key[-1]] = value


def _is_said(data: Mapping[str, Any], key: Key) -> bool:
    at: Any = data
    for name in key:
        if not isinstance(at, Mapping) or name not in at:
            return False
        at = at[name]
    return True


def key_lines(text: str) -> dict[Key, int]:
    """Return the line of each table and key of a TOML text, counted from 1."""
    lines: dict[Key, int] = {}
    table: Key = ()
    for number, line in enumerate(text.splitlines(), start=1):
        if header := re.match(r"\s*\[{1,2}\s*([^\[\]]+?)\s*\]", line):
            table = _split(header.group(1))
            lines.setdefault(table, number)
        elif pair := re.match(r"\s*([A-Za-z0-9_\-.\"' ]+?)\s*=", line):
            lines.setdefault((*table, *_split(pair.group(1))), number)
    return lines


def _split(dotted: str) -> Key:
    return tuple(part.strip().strip("\"'") for part in dotted.split("."))


def _place(keys: Sequence[Key], places: Mapping[Key, str]) -> tuple[Key, str]:
    """Return the first of the keys that was said, and where.

    For want of that the first one, and where something within it or the table round it was said.
    """
    for key in keys:
        if key in places:
            return key, places[key]
    for key in keys:
        for said, place in places.items():
            if said[: len(key)] == key:
                return key, place
        for length in range(len(key) - 1, 0, -1):
            if key[:length] in places:
                return key, places[key[:length]]
    return keys[0], ""


def _check_ports(config: PortsConfig, ports: ListPorts | None) -> None:
    """Notice one port given twice, and ports whose USB identity is the other device's."""
    if config.kobuki and config.kobuki == config.hokuyo:
        raise BadKey(f"{config.hokuyo} is given for both devices", ("ports", "hokuyo"), ("ports", "kobuki"))
    if ports is None:
        return
    for key, path, wrong in (("kobuki", config.kobuki, HOKUYO), ("hokuyo", config.hokuyo, KOBUKI)):
        real = str(Path(path).resolve()) if path else ""
        for port in ports():
            if port.device == real and matches_identity(port, wrong):
                raise BadKey(
                    f"{describe(port)} is a {wrong.name}; are the two ports swapped?", ("ports", key)
                )
