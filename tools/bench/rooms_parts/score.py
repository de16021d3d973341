"""Scores of rooms and doors against the truth: plain arrays in, figures out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

Labels = NDArray[np.int64]
NEAR_M, WIDTH_M = 0.3, 0.2
OVERLAP = 0.5


def contingency(truth: Labels, answer: Labels) -> NDArray[np.float64]:
    """Return how many cells each pair of labels shares, float64 (rooms, areas); label 0 has a row, too."""
    rows, row = np.unique(truth.ravel(), return_inverse=True)
    cols, col = np.unique(answer.ravel(), return_inverse=True)
    counts = np.zeros((len(rows), len(cols)))
    np.add.at(counts, (row, col), 1)
    return counts


def room_f1(truth: Labels, answer: Labels) -> float:
    """Return F1 over rooms and areas that overlap by more than half of their union; 0 is no label."""
    counts = contingency(truth, answer)
    rooms, areas = counts.sum(axis=1), counts.sum(axis=0)
    overlap = counts / (rooms[:, None] + areas[None, :] - counts)
    keep_room, keep_area = np.unique(truth) != 0, np.unique(answer) != 0
    both = int(keep_room.sum() + keep_area.sum())
    hits = int((overlap[np.ix_(keep_room, keep_area)] > OVERLAP).sum())
    return 2.0 * hits / both if both else 1.0


def adjusted_rand(truth: Labels, answer: Labels) -> float:
    """Return the adjusted Rand index over what has a label in both."""
    labelled = (truth != 0) & (answer != 0)
    counts = contingency(truth[labelled], answer[labelled])
    together = _pairs(counts).sum()
    rooms, areas = _pairs(counts.sum(axis=1)).sum(), _pairs(counts.sum(axis=0)).sum()
    all_pairs = float(_pairs(counts.sum()))
    chance = rooms * areas / all_pairs if all_pairs else 0.0
    most = (rooms + areas) / 2.0
    return float((together - chance) / (most - chance)) if most != chance else 1.0


def _pairs(count: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(count * (count - 1.0) / 2.0)


@dataclass(frozen=True, slots=True)
class DoorMatch:
    """Which doors of the robot are which true ones."""

    pairs: tuple[tuple[int, int], ...]
    """(true door, found door)."""
    found: int
    """How many found doors were judged: all but those that are true ones which do not count."""
    counted: int
    """How many true doors count."""
    hits: int
    """How many of those were found."""

    @property
    def precision(self) -> float:
        """Share of the found doors that are true ones; 1 if there is nothing to find and nothing found."""
        return self.hits / self.found if self.found else float(self.counted == 0)

    @property
    def recall(self) -> float:
        """Share of the true doors that count which were found."""
        return self.hits / self.counted if self.counted else 1.0


def match_doors(
    true: NDArray[np.float64], counts: NDArray[np.bool_], found: NDArray[np.float64]
) -> DoorMatch:
    """Match found doors to true ones, both float64 (N, 3) rows of x, y, width in metres, each at most once.

    A door counts as found within 0.3 m and 0.2 m of width. A found door that is a true one which does not
    count (an opening, or not seen open from near by) is neither right nor wrong.
    """
    off_m = np.hypot(*(true[:, None, :2] - found[None, :, :2]).transpose(2, 0, 1))
    fits = (off_m <= NEAR_M) & (np.abs(true[:, None, 2] - found[None, :, 2]) <= WIDTH_M)
    # as many pairs as can be, those that count first, and of those the nearest ones
    cost = np.where(fits, off_m - 10.0 * (1.0 + counts[:, None]), 0.0)
    rows, cols = linear_sum_assignment(cost)
    pairs = tuple((int(r), int(c)) for r, c in zip(rows, cols, strict=True) if fits[r, c])
    hits = sum(bool(counts[r]) for r, _ in pairs)
    return DoorMatch(pairs, len(found) - (len(pairs) - hits), int(counts.sum()), hits)
