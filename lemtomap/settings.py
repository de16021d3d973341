"""A number of the settings and the range in which it makes sense, declared in one place: beside its default.

    own_parts_m: float = within(0.15, 0.0, 0.17, "further out it would be the world")

Whoever reads settings from a file refuses what lies outside; documentation lists the ranges. A number without
a range of its own may be a tenth of its default, ten times as much, or what lies between.
"""

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NoReturn, TypeVar

from lemtomap.errors import BadSetting

T = TypeVar("T")
_KEY = "range"
TENFOLD = 10


@dataclass(frozen=True, slots=True)
class Range:
    """What a number may be, both ends included."""

    low: float
    high: float
    why: str = ""
    """What goes wrong outside, where that is not plain."""

    def __contains__(self, value: float) -> bool:
        return self.low <= value <= self.high  # false for a NaN

    def __str__(self) -> str:
        why = f" ({self.why})" if self.why else ""
        return f"between {self.low:g} and {self.high:g}{why}"


def within(default: T, low: float, high: float, why: str = "") -> T:
    """Return the dataclass field of a number with its default and its range; None may be a default, too."""
    declared: T = field(default=default, metadata={_KEY: Range(low, high, why)})
    return declared


def range_of(declared: "dataclasses.Field[Any]", default: Any = None) -> Range | None:
    """Return the range of a field; None when it has none, for it is no number.

    default: where the table holds another than its dataclass says.
    """
    found: Range | None = declared.metadata.get(_KEY)
    usual = declared.default if default is None else default
    if found is None and isinstance(usual, int | float) and not isinstance(usual, bool):
        return _tenfold(usual)
    return found


def _tenfold(default: float) -> Range:
    """Return a tenth to ten times a number; of a count at least 1."""
    ends = sorted((default / TENFOLD, default * TENFOLD))
    low = max(1, round(ends[0])) if isinstance(default, int) and default > 0 else ends[0]
    return Range(low, ends[1])


def check_ranges(settings: Any) -> None:
    """Refuse a dataclass with a number outside its range, however it was made. Raises BadSetting."""
    for name, value, allowed in _numbers(settings):
        if value not in allowed:
            refuse(f"must lie {allowed}", **{name: value})


def _numbers(settings: Any) -> Iterator[tuple[str, float, Range]]:
    for declared in dataclasses.fields(settings):
        allowed, value = range_of(declared), getattr(settings, declared.name)
        if allowed is not None and value is not None:
            yield declared.name, value, allowed


def refuse(rule: str, **values: Any) -> NoReturn:
    """Refuse these settings of a dataclass: raise BadSetting that names each with its value, and the rule."""
    told = ", ".join(f"{name} = {value:g}" for name, value in values.items())
    raise BadSetting(f"{told}: {rule}", *values)


def check_order(settings: Any, *names: str) -> None:
    """Refuse settings of which one is above the one named after it. Raises BadSetting."""
    for lower, upper in pairwise(names):
        low, high = getattr(settings, lower), getattr(settings, upper)
        if low > high:
            refuse(f"{lower} must not be above {upper}", **{lower: low, upper: high})
