"""Settings of navigation, one frozen dataclass a stage; the source stands beside each value."""

from dataclasses import dataclass, field

from lemtomap.settings import check_order, refuse, within


@dataclass(frozen=True, slots=True)
class BodyLimits:
    """What a Kobuki can do and how much room it takes."""

    radius_m: float = within(0.18, 0.1, 0.6)  # body diameter 0.3515 m (Kobuki drawing), rounded up
    v_max_mps: float = within(0.5, 0.05, 0.7)  # thesis' DWA setting; the base can do 0.7
    w_max_radps: float = within(1.5, 0.1, 3.2)  # below 110 deg/s, where the gyro degrades (Kobuki manual)
    acceleration_mps2: float = within(0.5, 0.05, 2.0)  # yocs smoother default of the TurtleBot 2
    braking_mps2: float = within(0.8, 0.05, 2.0)  # smoother decel_factor 1.5 and the wheels' own drag
    turn_acceleration_radps2: float = within(3.0, 0.1, 20.0)  # yocs smoother: 3.5
    reaction_s: float = within(0.15, 0.02, 1.0)  # one control period and the base's own 20 ms cycles

    def __post_init__(self) -> None:
        for name in ("radius_m", "v_max_mps", "w_max_radps", "acceleration_mps2", "braking_mps2"):
            if not getattr(self, name) > 0.0:
                refuse("must be above 0", **{name: getattr(self, name)})


@dataclass(frozen=True, slots=True)
class CostmapConfig:
    """Layers of the costmap over the rolling window."""

    occupied_percent: int = within(50, 1, 100)  # a cell at least this full is a wall
    margin_m: float = within(0.025, 0.0, 0.5)  # half a cell: where in its cell the wall stands is not known
    inflation_m: float = within(0.60, 0.1, 3.0)  # as far as walls are felt; 0.50 in the thesis' setting
    near_wall_cost: float = within(4.0, 0.0, 1000.0)  # extra cost per metre right beside a wall
    falloff_m: float = within(0.12, 0.01, 2.0)  # e-folding of that extra cost
    unknown_factor: float = within(4.0, 1.0, 1000.0)
    """Unseen floor is driven only where nothing seen leads there."""
    live_hits: int = within(2, 1, 20)
    """Scans that must agree before a live obstacle counts: single ghosts do not."""
    live_decay_s: float = within(8.0, 0.2, 600.0)  # a live obstacle out of sight is believed this long
    depth_decay_s: float = within(60.0, 0.2, 3600.0)
    """A depth camera is blind below 0.8 m, just where it matters."""
    depth_grow_cells: int = within(1, 0, 10)
    """What it saw is passed blind, by a pose that has moved by some centimetres since."""
    live_range_m: float = within(4.0, 0.5, 30.0)  # beyond, the window alone is good enough
    contact_radius_m: float = within(0.18, 0.02, 1.0)
    """Of what was bumped into only one side is known; a chair's foot is wider."""
    contact_hard_s: float = within(300.0, 1.0, 86400.0)
    """What the laser overlooks cannot be seen to go away: shut this long, ..."""
    contact_growth: float = within(4.0, 1.0, 100.0)
    """... so many times as long when it is felt there again, ..."""
    contact_memory_s: float = within(1800.0, 1.0, 86400.0)  # ... and dear for as long as this
    contact_price: float = within(8.0, 0.0, 1000.0)
    """Of a metre beside it: a bar is longer than the piece that was touched, ..."""
    contact_wide_m: float = within(0.35, 0.0, 2.0)
    """... by this much; it stays open, for there may be no other way."""
    contact_edge_m: float = within(0.2, 0.0, 2.0)
    """Over this much that price falls off."""
    contact_again_s: float = within(30.0, 1.0, 3600.0)
    """What is felt again after so long was not gone when its mark was forgotten."""
    tight_price: float = within(25.0, 1.0, 1000.0)
    """Of a metre inside the body's margin, open only to leave it."""
    agree_s: float = within(0.5, 0.05, 10.0)  # the laser saw it so lately: then it watches what a camera saw
    hold_m: float = within(0.9, 0.1, 5.0)
    """Live obstacles this near to a closed place are believed until it opens."""


@dataclass(frozen=True, slots=True)
class DwaConfig:
    """Dynamic Window Approach (Fox, Burgard and Thrun, 1997)."""

    v_samples: int = within(21, 3, 101)
    w_samples: int = within(51, 3, 201)  # odd, so that straight on is among them: 1,071 trajectories
    window_s: float = within(0.3, 0.05, 2.0)  # velocities reachable in this time are tried
    horizon_s: float = within(1.0, 0.2, 5.0)
    step_s: float = within(0.1, 0.02, 0.5)
    margin_m: float = within(0.025, 0.0, 0.5)  # as the costmap's
    forward_m: float = within(0.30, 0.0, 2.0)
    """The way ahead is read this far before the axle; thesis: 0.325."""
    dearest: float = within(10.0, 1.0, 1000.0)  # a metre inside the margin counts as so many
    price_share: float = within(0.5, 0.0, 1.0)
    """Of what the way made cost; with all of it no arc in a narrow place is worth it."""
    turn_weight: float = within(0.02, 0.0, 10.0)
    """Metres of way per rad/s: prefer straight of equal choices."""
    change_weight: float = within(0.03, 0.0, 10.0)
    """Metres of way per rad/s of change: prefer steady of equal choices."""
    tightest_m: float = within(0.10, 0.02, 0.18)
    """With an obstacle this near to the axle the map is wrong or the robot is: stand still."""
    creep_mps: float = within(0.06, 0.01, 0.3)  # the last centimetres to where it stops, no slower
    held_mps: float = within(0.03, 0.0, 0.2)  # an arc that is slower than this leads nowhere
    near_m: float = within(1.3, 0.0, 5.0)
    """This near to where it stops, the robot looks at the spot itself and no longer at the way ahead."""


@dataclass(frozen=True, slots=True)
class CollisionConfig:
    """The last check on raw range points, before the command leaves navigation."""

    skin_m: float = within(0.015, 0.005, 0.2)
    """Beyond the body's radius; the URG-04LX errs by 30 mm at 1 m, so a wider skin would stick at walls."""
    stop_short_m: float = within(0.03, 0.0, 0.5)  # of whatever stands on the arc
    horizon_s: float = within(2.0, 1.0, 10.0)  # of the arc: longer than braking from full speed takes
    step_s: float = within(0.05, 0.005, 0.1)  # 2.5 cm at full speed: less than a chair's leg and the skins
    standing_share: float = within(0.05, 0.0, 0.5)
    """A robot held to less than this share of its speed may turn freely: it is round."""
    turn_away_radps: float = within(0.5, 0.0, 1.5)  # from what holds it; a slight turn slips past a door post
    fresh_s: float = within(0.6, 0.15, 2.0)
    """Range points older than this say nothing about what is in front of the body now."""
    reach_m: float = within(
        1.6, 0.5, 10.0
    )  # further points are not looked at: the horizon at full speed and a bit


@dataclass(frozen=True, slots=True)
class FollowConfig:
    """When the robot turns on the spot and when it bends round."""

    look_m: float = within(0.40, 0.1, 3.0)
    """The way's direction is read this far along it."""
    moving_mps: float = within(0.10, 0.0, 0.5)  # faster than this the robot is under way ...
    moving_turn_rad: float = within(1.9, 0.1, 3.15)
    """... and bends round rather than stops, unless the way leads back."""
    held_turn_rad: float = within(0.15, 0.02, 1.6)
    """A robot that no arc lets forward faces its way first."""
    at_node_m: float = within(0.5, 0.1, 3.0)  # a node this near is passed, ...
    by_node_m: float = within(1.2, 0.1, 5.0)  # ... and also one this near, when the way to it is roundabout


@dataclass(frozen=True, slots=True)
class RouteConfig:
    """Costs of the topological route."""

    usual_speed_mps: float = within(0.4, 0.02, 1.0)
    """What an edge without a learnt time is expected to take."""
    unproven_s: float = within(60.0, 0.0, 3600.0)
    """On top for a closure nobody has driven: mostly a wall stands between its ends."""
    learnt_weight: float = within(0.5, 0.0, 1.0)  # share of learnt time against length over usual speed
    large_nodes: int = within(3000, 1, 10000000)  # from here on flat arrays are worth their building
    bucket_s: float = within(1.0, 0.01, 60.0)
    """About the least price of an edge: then few nodes are corrected."""


@dataclass(frozen=True, slots=True)
class RecoveryConfig:
    """When it does not work: each rung of the ladder is bounded in time and distance."""

    progress_m: float = within(0.20, 0.02, 5.0)  # nearer to the goal by this much ...
    progress_s: float = within(6.0, 0.5, 120.0)  # ... within this time, or something is wrong
    longer_way_m: float = within(2.0, 0.1, 100.0)
    """This much made good of a way that proved longer than believed is progress too, ..."""
    longer_ways: int = within(3, 0, 100)  # ... so many times for a goal
    polite_wait_s: float = within(6.0, 0.0, 600.0)  # what moves is given this long to make way
    closed_after_s: float = within(2.5, 0.2, 600.0)  # what stands still for this long is closed
    turn_s: float = within(7.0, 0.5, 60.0)
    turn_radps: float = within(1.0, 0.1, 3.0)
    back_off_m: float = within(0.40, 0.02, 2.0)
    back_off_s: float = within(5.0, 0.5, 60.0)
    back_off_mps: float = within(0.10, 0.02, 0.2)
    barred_patience_s: float = within(20.0, 0.0, 3600.0)
    """With no other way, what stands in the only one is given this long."""
    block_s: float = within(60.0, 1.0, 86400.0)  # a closed edge is tried again after this, ...
    block_growth: float = within(4.0, 1.0, 100.0)
    """... after so many times as long when it is closed once more, ..."""
    block_longest_s: float = within(1800.0, 1.0, 604800.0)  # ... but not after longer than this
    lost_patience_s: float = within(20.0, 1.0, 3600.0)
    bump_back_m: float = within(0.15, 0.02, 1.0)  # off what was just bumped into
    stayed_m: float = within(0.4, 0.0, 5.0)
    """A robot that has not come further than this is as stuck with a new goal as with the old one."""
    attempts: int = within(2, 1, 100)  # times through the ladder before giving up ...
    forgive_m: float = within(3.0, 0.1, 1000.0)  # ... unless this much way was made good in between


@dataclass(frozen=True, slots=True)
class ExploreConfig:
    """When an opening is worth a visit, and when exploration is over."""

    period_s: float = 0.5
    least_size_m: float = 0.35  # a 0.8 m door leaves 0.4 m to the middle of a Kobuki
    rest_size_m: float = 0.30  # ... and what is left of it is worth a look while it is larger than this
    least_depth_m: float = 0.20  # dark seams less than twice this deep are gaps between beams
    spoke_m: float = 0.15  # ... and seen floor narrower than this is such a beam: it shows nothing of a room
    goal_tolerance_m: float = 0.40
    switch_share: float = 0.5  # another opening must cost less than this share of the present one's
    here_price_m: float = 3.0  # an opening beside the robot will mostly be seen in passing
    turn_price_m: float = 1.0  # turning right round costs about this much way
    window_first_m: float = 6.0  # look for openings beyond the window when none in it is nearer than this
    patience_s: float = 240.0  # for one opening, and on top of that its way ...
    slow_mps: float = 0.1  # ... at this speed; the navigator gives up much sooner, with a reason
    pause_s: float = 65.0  # an opening that failed is left alone until a closed edge is tried again
    attempts: int = 2
    barred_attempts: int = 4  # ... when no open route led there: somebody stands in the only door
    linger_s: float = 1.5  # having arrived, the mapper gets this long to see
    sure_looks: int = 4  # looks without any opening before saying that all is explored


@dataclass(frozen=True, slots=True)
class NavConfig:
    """Everything the navigator can be told."""

    body: BodyLimits = field(default_factory=BodyLimits)
    costmap: CostmapConfig = field(default_factory=CostmapConfig)
    dwa: DwaConfig = field(default_factory=DwaConfig)
    follow: FollowConfig = field(default_factory=FollowConfig)
    collision: CollisionConfig = field(default_factory=CollisionConfig)
    route: RouteConfig = field(default_factory=RouteConfig)
    recovery: RecoveryConfig = field(default_factory=RecoveryConfig)
    explore: ExploreConfig = field(default_factory=ExploreConfig)
    period_s: float = within(0.1, 0.02, 0.2)  # control cycle, design section 4
    plan_period_s: float = within(0.2, 0.05, 5.0)
    """The field near the robot is renewed this often, as the thesis' local costmap."""
    look_period_s: float = within(1.0, 0.1, 30.0)
    """And the one over the whole window; the thesis' global plan: 1 Hz."""
    goal_tolerance_m: float = within(0.12, 0.02, 1.0)  # thesis' DWA setting: 0.15
    yaw_tolerance_rad: float = within(0.10, 0.01, 3.15)
    turn_start_rad: float = within(1.05, 0.1, 3.15)
    """Turn in place when the way starts further off than this (60 degrees)."""
    turn_end_rad: float = within(0.30, 0.02, 3.15)

    def __post_init__(self) -> None:
        check_order(self, "turn_end_rad", "turn_start_rad")
        check_order(self, "period_s", "plan_period_s", "look_period_s")
