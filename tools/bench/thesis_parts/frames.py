"""What the processes of one system hand to one another along their chain: one frame for each scan."""

import pickle
from collections.abc import Iterator
from dataclasses import dataclass
from typing import IO

import numpy as np
from numpy.typing import NDArray

from lemtomap.nav.types import ObstacleSighting
from lemtomap.types import (
    GridView,
    MapView,
    Odometry,
    Scan,
    SlamUpdate,
)


@dataclass(slots=True)
class Frame:
    """One scan and what the parts so far made of it."""

    drive_s: float
    """Time since the first scan."""
    odometry: Odometry
    scan: Scan
    sighting: ObstacleSighting
    update: SlamUpdate | None = None
    grid: GridView | None = None
    """Only when the metric map was published anew."""
    points_base: NDArray[np.float32] | None = None
    view: MapView | None = None
    node_id: int = 0
    """The associated node; only when it is another than before, else 0."""


@dataclass(frozen=True, slots=True)
class Begin:
    """What came before was to compile and to load; from here on everything is new."""

    measured: bool = True
    """False: load more, by meeting the map made so far as one of an earlier day."""


@dataclass(frozen=True, slots=True)
class End:
    """No frame comes any more."""


Message = Frame | Begin | End


def send(pipe: IO[bytes], message: Message) -> None:
    """Write one message."""
    pickle.dump(message, pipe, protocol=pickle.HIGHEST_PROTOCOL)


def receive(pipe: IO[bytes]) -> Iterator[Message]:
    """Yield messages, the end among them; EOFError when the sender died before."""
    message: Message | None = None
    while not isinstance(message, End):
        message = pickle.load(pipe)  # noqa: S301 - written by our own process a moment ago
        yield message
