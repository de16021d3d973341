"""Settings of the topological map, each with its unit and source."""

from dataclasses import dataclass, field

from lemtomap.displacement import WatchConfig
from lemtomap.settings import check_order, refuse, within
from lemtomap.topo.place.align import AlignConfig


@dataclass(frozen=True, slots=True)
class TopoConfig:
    """Defaults hold for every building; a bad value is refused."""

    new_node_distance_m: float = within(1.0, 0.2, 10.0)
    """Thesis section 3-3-2; ros_lemtomap A.3 new_node_distance."""
    association_margin_m: float = within(0.1, 0.0, 5.0)
    """A neighbour must be nearer by this: no flicker half-way between two."""
    local_radius_m: float = within(25.0, 2.0, 100.0)
    """Local solve and D_nn, thesis section 3-3-2: the same; a window across."""
    local_limit: int = within(400, 10, 5000)
    """Nodes in a local solve at most, nearest first: bounds the step in dense maps."""
    near_neighbour_max_m: float = within(4.0, 0.5, 10.0)
    """As ros_lemtomap A.3: the next node always lies well inside the window."""
    near_neighbour_gain: float = within(0.02, 0.0, 1.0)
    """An edge must shorten the way between its ends by this share (Fig. 3-9)."""
    near_neighbour_sigma_m: float = within(0.2, 0.01, 2.0)
    """A node only predicted must be predicted this well: a robot's radius."""
    seam_sigma_m: float = within(0.5, 0.01, 5.0)
    """For an edge that is only driven along, from one round's nodes to another's."""
    seam_open_sigma_m: float = within(1.5, 0.01, 10.0)
    """... in the open, where that much doubt leads through no wall."""
    robot_radius_m: float = within(0.18, 0.1, 0.6)  # Kobuki's body, 351.5 mm across
    occupied_from: int = within(50, 1, 100)  # occupancy of GridView that stops the robot
    place_radius_m: float = within(5.0, 1.0, 30.0)
    """Half the window less the distance at which data is taken."""
    place_taken_at_m: float = within(3.5, 0.5, 30.0)
    """With the radius: still whole in a 20 m window, surroundings all seen."""
    place_byte_budget: int = within(240, 40, 4000)
    """At most; some 150 on average, so that 300 hold with the descriptor."""
    place_apart_m: float = within(0.1, 0.01, 1.0)
    """Half of what a point must be off all others to be another thing."""
    place_new_within_m: float = within(2.5, 0.5, 30.0)
    """Of the node: what is new farther off may only not have been seen before."""
    place_changes: int = within(6, 1, 1000)
    """Points that are new or gone (0.3 m of surface) make another place, ..."""
    place_stale_visits: int = within(2, 1, 100)
    """... and so many visits in a row that find it so have it taken anew."""
    match: AlignConfig = field(default_factory=AlignConfig)
    watch: WatchConfig = field(default_factory=WatchConfig)
    fresh_m: float = within(10.0, 0.5, 1000.0)
    """Way after which a node's place in the window is measured again."""
    align_again_m: float = within(0.3, 0.05, 10.0)  # a refused match is tried again after this way
    align_widen: float = within(2.0, 1.0, 100.0)
    """And its prediction believed that much less (variance), up to."""
    align_widest_m: float = within(0.3, 0.01, 2.0)  # this standard deviation of its place
    align_widest_rad: float = within(0.05, 0.005, 0.5)
    """And of its heading: what a gyro drifts by in some minutes."""
    implicit_sigma_m: float = within(0.3, 0.01, 2.0)
    """A near neighbour predicted this well may be matched at once."""
    commit_every_s: float = within(0.5, 0.05, 60.0)  # design section 7: at most a second is lost
    paged_nodes: int = within(1024, 20, 1000000)  # nodes kept in memory with their edges, some 2 kB each
    durable: bool = True  # sync to disk with each commit; batch runs over a log need not

    def __post_init__(self) -> None:
        if self.new_node_distance_m <= 0.0:
            refuse("must be above 0", new_node_distance_m=self.new_node_distance_m)
        if not 0.0 <= self.association_margin_m < self.new_node_distance_m:
            refuse(
                "the margin must be at least 0 and below the distance",
                association_margin_m=self.association_margin_m,
                new_node_distance_m=self.new_node_distance_m,
            )
        check_order(self, "near_neighbour_max_m", "local_radius_m")
        if self.paged_nodes < 2 * self.local_limit:
            refuse(
                "paged_nodes must be at least twice local_limit",
                paged_nodes=self.paged_nodes,
                local_limit=self.local_limit,
            )
