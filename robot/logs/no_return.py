"""The reading by which a laser says that a beam did not come back."""

import math
from collections import Counter
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
    scans = [record.ranges_m for record in records]
    seen = (ranges[~np.isnan(ranges)] for ranges in scans)
    largest_m = max((float(ranges.max()) for ranges in seen if len(ranges)), default=0.0)
    counts: Counter[int] = Counter()
    beams: dict[int, set[int]] = {}
    for ranges in scans:
        for beam in np.flatnonzero(ranges >= largest_m - 2.0 * PILE_WIDTH_M):
            centimetres = round(100.0 * float(ranges[beam]))
            counts[centimetres] += 1
            beams.setdefault(centimetres, set()).add(int(beam))
    pile, _ = counts.most_common(1)[0] if counts else (0, 0)
    if len(beams.get(pile, ())) < PILE_BEAMS:
        return math.inf
    return max(pile / 100.0 - PILE_WIDTH_M / 2.0, 0.0)
