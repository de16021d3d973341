"""Backing off from what was just hit: the one motion that no planner has to ask for.

Only a robot that was driving forward when it was stopped retreats; a bumper pressed by a person on a standing
robot moves nothing. Bounded in time and way, straight, slow, and still judged by the safety gate.
"""

from dataclasses import dataclass

from lemtomap.types import Twist


@dataclass(frozen=True, slots=True)
class ReflexConfig:
    """How the robot retreats."""

    back_mps: float = 0.10  # the official safety controller's speed
    back_m: float = 0.06  # off the switch and over the cliff's edge, not more: nothing is seen behind
    limit_s: float = 1.5
    driving_mps: float = 0.02  # slower than this the robot was not driving into anything


class Retreat:
    """Starts at a contact while driving forward, ends after its way or its time."""

    def __init__(self, config: ReflexConfig | None = None) -> None:
        self.config = config or ReflexConfig()
        self._until_s: float | None = None

    def contact(self, sent_v_mps: float, now_s: float) -> None:
        """Take note of a contact; `sent_v_mps` is what the wheels were told before it."""
        if sent_v_mps > self.config.driving_mps and self._until_s is None:
            c = self.config
            self._until_s = now_s + min(c.limit_s, 0.3 + c.back_m / c.back_mps)

    def wish(self, now_s: float) -> Twist | None:
        """Return the velocity wanted now; None: no retreat."""
        if self._until_s is None:
            return None
        if now_s >= self._until_s:
            self._until_s = None
            return None
        return Twist(-self.config.back_mps, 0.0)
