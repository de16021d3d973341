"""When a drive comes back to old ground, and how soon the map knows: the standard revisits are counted by.

A revisit begins where new ground gives way to old within a few metres: the robot has just been among nodes
laid down a moment ago, and now stands beside one from long before. Going back the way one came is none: there
the ground grows older by two metres for each one driven.
"""

from dataclasses import dataclass

FRESH_M, OLD_M = 10.0, 30.0  # of way since a node was laid down: new ground, old ground
CHANGE_M = 4.0  # of way in which new ground gives way to old
CLOSED_WITHIN_M = 5.0


@dataclass
class Revisits:
    """Counts the times that a drive came back, and those that the map knew of soon enough."""

    closed: int = 0
    """Known within CLOSED_WITHIN_M of travel."""
    missed: int = 0
    brief: int = 0
    """Left again before the map knew and before that way was driven: neither."""
    closed_after_m: float = 0.0
    """Way driven on old ground until the map knew, of all that were closed."""
    _fresh_at_m: float = -float("inf")
    _since_m: float | None = None

    def look(self, way_m: float, age_m: float | None, *, known: bool) -> None:
        """Take the ground beside the robot after way_m of drive.

        age_m: way since the oldest node beside the robot was laid down, None where there is none.
        known: the map has an old node beside the robot near the one that it believes to be at.
        """
        if age_m is not None and age_m < OLD_M:
            self._leave()
            if age_m <= FRESH_M:
                self._fresh_at_m = way_m
        elif age_m is not None and self._since_m is None and way_m - self._fresh_at_m <= CHANGE_M:
            self._since_m, self._fresh_at_m = way_m, -float("inf")
        if self._since_m is not None:
            self._judge(way_m - self._since_m, known=known)

    def _judge(self, driven_m: float, *, known: bool) -> None:
        if known:
            self.closed += 1
            self.closed_after_m += driven_m
        elif driven_m > CLOSED_WITHIN_M:
            self.missed += 1
        else:
            return
        self._since_m = None

    def _leave(self) -> None:
        if self._since_m is not None:
            self.brief += 1
            self._since_m = None
