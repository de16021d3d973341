"""Where the laser sits on the base."""

from dataclasses import dataclass

from lemtomap.sim.world import Pose2


@dataclass(frozen=True, slots=True)
class Mounting:
    """Where the laser sits on the base."""

    T_base_laser: Pose2 = (0.0, 0.0, 0.0)
    upside_down: bool = False
    """True: its beams turn clockwise."""
