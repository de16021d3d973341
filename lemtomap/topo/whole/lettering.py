"""Words in pictures of maps: shown as they stand, however long or strange."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from matplotlib import rc_context
from matplotlib.axes import Axes

from lemtomap.se2 import Pose
from lemtomap.topo.naming import shown

LABEL = 40  # characters of a name in a picture


@contextmanager
def plain_text() -> Iterator[None]:
    """Draw every text as it stands: a name is no formula, a letter that the font lacks is a box."""
    with rc_context({"text.parse_math": False}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph \d+ .*missing from", UserWarning)
        yield


def write_name(axes: Axes, name: str, place: Pose, **how: Any) -> None:
    """Write a name beside a place, float64 (2+,). However long, the rest of the picture keeps its size."""
    at = (float(place[0]), float(place[1]))
    label = axes.annotate(shown(name, LABEL), at, textcoords="offset points", **how)
    label.set_in_layout(False)
