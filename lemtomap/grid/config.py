"""Settings of the rolling-window SLAM, each with its unit and where its value comes from."""

from dataclasses import dataclass

from lemtomap.errors import BadSetting


@dataclass(frozen=True, slots=True)
class SlamConfig:
    """One parameter set for every robot and log; raises BadSetting when it cannot work.

    Values without another source were measured over the Intel, ACES, Killian and URG-04LX logs together.
    """

    particles: int = 5  # thesis 3-4: "3 to 10 should suffice"
    window_m: float = 20.0  # W of algorithm E-4
    resolution_m: float = 0.05
    max_range_m: float | None = None  # usable range; None: the smaller of the sensor's range and W/2

    # when a scan is matched, and when it goes into the window
    match_distance_m: float = 0.02
    match_turn_rad: float = 0.0175
    integrate_distance_m: float = 0.2
    integrate_turn_rad: float = 0.35
    integrate_period_s: float = 1.0  # a standing robot still learns that a door opened

    # evidence of one scan on one cell, and its bounds: a moved chair is learnt within a few integrations,
    # one hit makes a cell occupied even where it was free, one miss takes that back
    evidence_hit: int = 6
    evidence_miss: int = 2
    evidence_floor: int = -12
    evidence_ceiling: int = 12
    hits_averaged: int = 40

    # match: point to line against averaged hits
    match_sigma_m: float = 0.05  # reach of the robust weight
    match_noise_m: float = 0.04  # of one beam, widened because beams err together
    point_weight: float = 0.8  # of a hit that lies on no plane, against one that does
    degenerate_below: float = 0.08  # diversity (Appendix D) under which the weak axis follows odometry; from
    # there to twice as much the scan gains a say bit by bit
    min_points: int = 20
    min_quality: float = 0.25  # a worse match is refused
    new_ground_below: float = 0.25  # share of hits in cells the window knows; below it odometry leads on
    climb_below: float = 0.75  # quality under which the hill climb is tried too
    large_turn_rad: float = 0.3  # odometry that turns more between two scans is searched all round
    search_rad: float = 1.6  # how far round: the worst of the logs turns 85 degrees between two scans
    search_m: float = 0.3
    doubted_share: float = 0.5  # of the wheels' way; a match further off is made again without what moves
    good_share: float = 0.9  # of the usual quality; under it the share of known ground is looked at
    collapse_share: float = 0.7  # of the usual quality; below it the wheels are taken to have slipped: search
    quality_memory: float = 0.05  # share of the newest match in the usual quality
    rival_gain: float = 0.15  # a pose far from odometry must be so much better

    # odometry since the previous match, until matches teach otherwise: floor plus share of the motion
    odometry_floor_m: float = 0.01
    odometry_floor_rad: float = 0.001
    odometry_m_per_m: float = 0.05
    odometry_rad_per_rad: float = 0.2
    odometry_m_per_rad: float = 0.02
    odometry_rad_per_m: float = 0.1

    # what matches teach about the odometry, as factors on its standard deviations: on the shares of one step,
    trust_memory: float = 0.01  # share of the newest match
    trust_least: float = 0.2
    trust_most: float = 4.0
    odometry_turns_rad: float = 0.01  # settings' share of a turn, above which a step tells about turning

    # ... and on the drift of the heading over a stretch
    heading_stretch_m: float = 3.6
    heading_stretch_rad: float = 6.0
    heading_memory: float = 0.05  # share of the newest stretch
    heading_least: float = 0.01  # a good gyro's: 0.5 mrad in a metre
    heading_most: float = 2.0

    # drift of the window's frame: after so much travel or turning it is off by the error of one more match
    renew_m: float = 0.3
    renew_rad: float = 0.5

    # particles
    sample_share: float = 0.1  # of the proposal's standard deviation that is sampled: a window closes no loop
    grown_sample_share: float = 1.0  # on a growing map, where a loop may close
    weight_per_quality: float = (
        10.0  # log weight for the whole step from quality 0 to 1: beams err together, and
    )
    # a sharper weight would leave one line of descent long before a loop closes
    dethrone_ratio: float = 20.0  # another particle becomes the best only when it weighs this many times more
    resample_below: float = 0.5  # effective particles as a share of all

    # what is published
    smooth_m: float = 0.03  # the correction moves at most this far per scan
    smooth_rad: float = 0.0087
    jump_m: float = 0.3  # a larger gap is closed at once and flagged
    jump_rad: float = 0.17

    def __post_init__(self) -> None:
        if self.max_range_m is not None and not 0.0 < self.max_range_m <= self.window_m / 2.0:
            raise BadSetting(
                f"max range {self.max_range_m} m with a window of {self.window_m} m: "
                "the window must be at least twice as wide as the range"
            )
        if self.resolution_m <= 0.0 or self.window_m < 20 * self.resolution_m:
            raise BadSetting(
                f"window {self.window_m} m with cells of {self.resolution_m} m has no room for a map"
            )
        if self.particles < 1:
            raise BadSetting(f"particles {self.particles}: at least 1 is needed")

    @property
    def cells(self) -> int:
        """Return the number of cells along one side of the window."""
        return round(self.window_m / self.resolution_m)

    def usable_range_m(self, sensor_range_m: float) -> float:
        """Return the range up to which a beam is used, never more than half the window."""
        return min(sensor_range_m, self.max_range_m or sensor_range_m, self.window_m / 2.0)
