"""Settings of doors and areas, each with its unit and source."""

from dataclasses import dataclass

from lemtomap.errors import BadSetting
from lemtomap.settings import within


@dataclass(frozen=True, slots=True)
class AreaConfig:
    """Defaults hold for every building; a bad value is refused."""

    look_every_m: float = within(0.4, 0.1, 5.0)
    """Way between two looks at the window: nearer by, they see the same."""
    look_every_s: float = within(2.0, 0.2, 600.0)  # ... and time, for doors that move while the robot stands
    look_radius_m: float = within(5.0, 2.0, 9.0)
    """Around the robot: there a URG-04LX sees both ends of a gap."""
    door_least_m: float = within(0.6, 0.3, 2.0)  # width; what Kobuki can just pass
    door_most_m: float = within(1.6, 0.7, 5.0)  # width of a double door; what is wider is an opening
    opens: float = within(1.2, 1.05, 5.0)
    """On both sides of a gap the clearance grows to so many times that in it."""
    depth_m: float = within(1.2, 0.3, 5.0)
    """... within this way: a wall's thickness, and floor as wide again."""
    wall_least_m: float = within(0.5, 0.1, 0.65)
    """So far the wall at a gap's end can be followed; the leg of a chair cannot."""
    narrow_most_m: float = within(3.5, 0.7, 8.0)  # width of an opening without a door that parts two areas
    narrow_opens: float = within(1.3, 1.05, 10.0)  # ... and how much the clearance grows on both sides of it
    same_door_m: float = within(0.5, 0.1, 2.0)  # between two sightings of one door
    evidence_seen: float = within(0.85, 0.01, 5.0)
    """Log-odds of a door, for each look at it; ..."""
    evidence_gone: float = within(0.4, 0.01, 5.0)  # ... against it, where the floor lies open
    evidence_needed: float = within(1.5, 0.1, 10.0)
    """Two looks: one odd scan makes no door."""
    evidence_most: float = within(4.0, 0.5, 20.0)
    """... and ten against it take it away again, unless the robot has passed it."""
    sure_within_m: float = within(3.5, 0.5, 9.0)
    """A door that is not seen from so near is gone, or shut."""
    shut_share: float = within(0.7, 0.3, 1.0)  # of a door's width that is closed; a person leaves more open
    block_s: float = within(60.0, 1.0, 86400.0)
    """A shut door closes its edges for so long; as an edge that navigation found closed."""
    settled_m: float = within(0.15, 0.01, 1.0)
    """A node nearer to a door's line may be on either side: it stays on the one it had."""

    def __post_init__(self) -> None:
        if self.door_most_m <= self.door_least_m:
            raise BadSetting("door_most_m must be above door_least_m")
        if self.narrow_most_m < self.door_most_m:
            raise BadSetting("narrow_most_m must not be below door_most_m")
