"""Settings of navigation, one frozen dataclass a stage; the source stands beside each value."""

from dataclasses import dataclass, field

from lemtomap.errors import BadSetting


@dataclass(frozen=True, slots=True)
class BodyLimits:
    """What a Kobuki can do and how much room it takes."""

    radius_m: float = 0.18  # body diameter 0.3515 m (Kobuki drawing), rounded up
    v_max_mps: float = 0.5  # thesis' DWA setting; the base can do 0.7
    w_max_radps: float = 1.5  # below 110 deg/s, where the gyro degrades (Kobuki manual)
    acceleration_mps2: float = 0.5  # yocs smoother default of the TurtleBot 2
    braking_mps2: float = 0.8  # smoother decel_factor 1.5 and the wheels' own drag
    turn_acceleration_radps2: float = 3.0  # yocs smoother: 3.5
    reaction_s: float = 0.15  # one control period and the base's own 20 ms cycles

    def __post_init__(self) -> None:
        for name in ("radius_m", "v_max_mps", "w_max_radps", "acceleration_mps2", "braking_mps2"):
            if not getattr(self, name) > 0.0:
                raise BadSetting(f"navigation: {name} = {getattr(self, name)} must be above 0")


@dataclass(frozen=True, slots=True)
class CostmapConfig:
    """Layers of the costmap over the rolling window."""

    occupied_percent: int = 50  # a cell at least this full is a wall
    margin_m: float = 0.025  # half a cell: where in its cell the wall stands is not known
    inflation_m: float = 0.60  # as far as walls are felt; 0.50 in the thesis' setting
    near_wall_cost: float = 4.0  # extra cost per metre right beside a wall
    falloff_m: float = 0.12  # e-folding of that extra cost
    unknown_factor: float = 4.0  # unseen floor is driven only where nothing seen leads there
    live_hits: int = 2  # scans that must agree before a live obstacle counts: single ghosts do not
    live_decay_s: float = 8.0  # a live obstacle out of sight is believed this long
    depth_decay_s: float = 60.0  # a depth camera is blind below 0.8 m, just where it matters
    depth_grow_cells: int = (
        1  # what it saw is passed blind, by a pose that has moved by some centimetres since
    )
    live_range_m: float = 4.0  # beyond, the window alone is good enough
    contact_radius_m: float = 0.18  # of what was bumped into only one side is known; a chair's foot is wider
    contact_hard_s: float = 300.0  # what the laser overlooks cannot be seen to go away: shut this long, ...
    contact_growth: float = 4.0  # ... so many times as long when it is felt there again, ...
    contact_memory_s: float = 1800.0  # ... and dear for as long as this
    contact_price: float = 8.0  # of a metre beside it: a bar is longer than the piece that was touched, ...
    contact_wide_m: float = 0.35  # ... by this much; it stays open, for there may be no other way


@dataclass(frozen=True, slots=True)
class DwaConfig:
    """Dynamic Window Approach (Fox, Burgard and Thrun, 1997)."""

    v_samples: int = 21
    w_samples: int = 51  # odd, so that straight on is among them: 1,071 trajectories
    window_s: float = 0.3  # velocities reachable in this time are tried
    horizon_s: float = 1.0
    step_s: float = 0.1
    margin_m: float = 0.025  # as the costmap's
    forward_m: float = 0.30  # the way ahead is read this far before the axle; thesis: 0.325
    dearest: float = 10.0  # a metre inside the margin counts as so many
    price_share: float = 0.5  # of what the way made cost; with all of it no arc in a narrow place is worth it
    turn_weight: float = 0.02  # metres of way per rad/s: prefer straight of equal choices
    change_weight: float = 0.03  # metres of way per rad/s of change: prefer steady of equal choices


@dataclass(frozen=True, slots=True)
class RouteConfig:
    """Costs of the topological route."""

    usual_speed_mps: float = 0.4  # what an edge without a learnt time is expected to take
    unproven_s: float = 60.0  # on top for a closure nobody has driven: mostly a wall stands between its ends
    learnt_weight: float = 0.5  # share of learnt time against length over usual speed
    large_nodes: int = 3000  # from here on flat arrays are worth their building
    bucket_s: float = 1.0  # about the least price of an edge: then few nodes are corrected


@dataclass(frozen=True, slots=True)
class RecoveryConfig:
    """When it does not work: each rung of the ladder is bounded in time and distance."""

    progress_m: float = 0.20  # nearer to the goal by this much ...
    progress_s: float = 6.0  # ... within this time, or something is wrong
    longer_way_m: float = (
        2.0  # this much made good of a way that proved longer than believed is progress too, ...
    )
    longer_ways: int = 3  # ... so many times for a goal
    polite_wait_s: float = 6.0  # what moves is given this long to make way
    closed_after_s: float = 2.5  # what stands still for this long is closed
    turn_s: float = 7.0
    turn_radps: float = 1.0
    back_off_m: float = 0.40
    back_off_s: float = 5.0
    back_off_mps: float = 0.10
    barred_patience_s: float = 20.0  # with no other way, what stands in the only one is given this long
    block_s: float = 60.0  # a closed edge is tried again after this, ...
    block_growth: float = 4.0  # ... after so many times as long when it is closed once more, ...
    block_longest_s: float = 1800.0  # ... but not after longer than this
    lost_patience_s: float = 20.0
    attempts: int = 2  # times through the ladder before giving up ...
    forgive_m: float = 3.0  # ... unless this much way was made good in between


@dataclass(frozen=True, slots=True)
class NavConfig:
    """Everything the navigator can be told."""

    body: BodyLimits = field(default_factory=BodyLimits)
    costmap: CostmapConfig = field(default_factory=CostmapConfig)
    dwa: DwaConfig = field(default_factory=DwaConfig)
    route: RouteConfig = field(default_factory=RouteConfig)
    recovery: RecoveryConfig = field(default_factory=RecoveryConfig)
    period_s: float = 0.1  # control cycle, design section 4
    plan_period_s: float = 0.2  # the field near the robot is renewed this often, as the thesis' local costmap
    look_period_s: float = 1.0  # and the one over the whole window; the thesis' global plan: 1 Hz
    goal_tolerance_m: float = 0.12  # thesis' DWA setting: 0.15
    yaw_tolerance_rad: float = 0.10
    turn_start_rad: float = 1.05  # turn in place when the way starts further off than this (60 degrees)
    turn_end_rad: float = 0.30


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
