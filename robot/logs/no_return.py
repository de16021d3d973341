"""The reading by which a laser says that a beam did not come back."""

import math
from collections.abc import Sequence

import numpy as np

from lemtomap.robot.logs.records import Record

PILE_WIDTH_M = (
    0.12  # a SICK's no-return code scatters this far below its most frequent value (unit conversions)
)
PILE_BEAMS = 5  # a code comes from beams of many directions, a real surface at one distance does not


def infer_no_return_m(records: Sequence[Record]) -> float:
    """Return the reading from which on a beam saw nothing, metres; infinity when the log has no such code.

    A laser writes a fixed code, its largest reading, for a beam that does not come back. The code shows as
    a pile of equal readings at the top of the log that comes from many directions.
    """
    if not records:
        return math.inf
    ranges_m = np.concatenate([record.ranges_m for record in records])
    largest_m = float(np.fmax.reduce(ranges_m, initial=0.0))
    top = np.flatnonzero(ranges_m >= largest_m - 2.0 * PILE_WIDTH_M)
    if not len(top):
        return math.inf
    begins = np.cumsum([0, *(len(record.ranges_m) for record in records)])
    beams = top - begins[np.searchsorted(begins, top, side="right") - 1]
    centimetres = np.rint(100.0 * ranges_m[top].astype(np.float64)).astype(np.int64)
    codes, first, counts = np.unique(centimetres, return_index=True, return_counts=True)
    pile = codes[np.lexsort((first, -counts))[0]]  # of equal piles the one met first
    if len(np.unique(beams[centimetres == pile])) < PILE_BEAMS:
        return math.inf
    return max(float(pile) / 100.0 - PILE_WIDTH_M / 2.0, 0.0)
