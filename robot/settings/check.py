"""From plain nested values to the frozen dataclasses: every key known, every value in its range.

Nothing is repaired: what does not fit is refused with its key, its value and the rule.
"""

import dataclasses
import difflib
import math
from collections.abc import Mapping
from typing import Any

from lemtomap.errors import BadSetting
from lemtomap.robot.config import SAID_ONCE, BadKey, Key, RobotConfig
from lemtomap.robot.settings.tree import Setting, all_keys, all_settings

WORDS = {bool: "true or false", str: "text", int: "an integer", float: "a number"}
SHOWN = 60
"""Characters of a refused value at most."""


def from_mapping(data: Mapping[str, Any]) -> RobotConfig:
    """Build the settings from plain nested values. Raises BadSetting naming the key."""
    built: RobotConfig = _build(RobotConfig(), data, ())
    return built


def _build(default: Any, data: Any, key: Key) -> Any:
    """Return `default` with what `data` says instead; a table says it of those within it, too."""
    if not isinstance(data, Mapping):
        raise BadKey(f"{_shown(data)} must be a table of settings", key)
    settings, values = all_settings(), {}
    for name, value in data.items():
        inner = (*key, name)
        if inner in settings:
            values[name] = _checked(settings[inner], value)
        elif inner in all_keys():
            values[name] = _build(getattr(default, name), value, inner)
        else:
            raise BadKey(_unknown(inner), inner)
    try:
        return dataclasses.replace(default, **values)
    except BadKey:
        raise
    except BadSetting as error:
        raise BadKey(str(error), *((*key, name) for name in error.names), key) from None
    except ValueError as error:  # a driver's
        raise BadKey(str(error), key) from None


def _checked(setting: Setting, value: Any) -> Any:
    """Return a value as its dataclass takes it. Raises BadKey."""
    if value is None and setting.default is None:
        return None
    whole = isinstance(value, int) and not isinstance(value, bool)
    if isinstance(value, Mapping):
        raise BadKey(f"must be {WORDS[setting.kind]}, not a table", setting.key)
    fits = whole or isinstance(value, float) if setting.kind is float else type(value) is setting.kind
    if not fits:
        raise BadKey(f"{_shown(value)} must be {WORDS[setting.kind]}", setting.key)
    if isinstance(value, float) and not math.isfinite(value):
        raise BadKey(f"{value} must be a finite number", setting.key)
    if setting.allowed is not None and value not in setting.allowed:
        raise BadKey(f"{_shown(value)} must lie {setting.allowed}", setting.key)
    return float(value) if setting.kind is float else value


def _shown(value: Any) -> str:
    """Return a value as the user knows it, cut where it is long."""
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    return text if len(text) < SHOWN else f"{text[: SHOWN - 4]} ..."


def _unknown(key: Key) -> str:
    """Return what is wrong with a key that no setting has: where it is said, or what may have been meant."""
    if key in SAID_ONCE:
        return f"unknown key; it is said once, by {'.'.join(SAID_ONCE[key])}"
    near = _nearest(key)
    return f"unknown key; is {near} meant?" if near else "unknown key"


def _nearest(key: Key) -> str:
    """Return the key that is written most alike, first of those in the same table; empty if none is."""
    known = {".".join(each): each for each in all_keys()}
    beside = [each[-1] for each in known.values() if each[:-1] == key[:-1]]
    for name in difflib.get_close_matches(key[-1], beside, n=1, cutoff=0.7):
        return ".".join((*key[:-1], name))
    for name in difflib.get_close_matches(".".join(key), known, n=1, cutoff=0.5):
        return name
    ends = {each[-1]: name for name, each in known.items()}
    return "".join(ends[end] for end in difflib.get_close_matches(key[-1], ends, n=1, cutoff=0.6))
