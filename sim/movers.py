"""Things that move: what they are made of, and where they are as time goes by."""

from typing import Protocol

from sim.world import Box, Pose2


class Motion(Protocol):
    """One moving thing in one run; may hold state."""

    def step(self, now_s: float, dt_s: float, robot: Pose2) -> Pose2:
        """Return where the thing is at now_s."""
        ...


class Mover(Protocol):
    """A thing that moves, as the world describes it."""

    @property
    def parts(self) -> tuple[Box, ...]:
        """Boxes in the thing's own frame."""
        ...

    def begin(self, seed: int) -> Motion:
        """Start one run."""
        ...
