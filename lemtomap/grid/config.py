"""Settings of the rolling-window SLAM, each with its unit and where its value comes from."""

from dataclasses import dataclass

from lemtomap.settings import check_order, refuse, within


@dataclass(frozen=True, slots=True)
class SlamConfig:
    """One parameter set for every robot and log. Raises BadSetting.

    Values without another source were measured over the Intel, ACES, Killian and URG-04LX logs together.
    """

    particles: int = within(5, 1, 1000)  # thesis 3-4: "3 to 10 should suffice"
    window_m: float = within(20.0, 4.0, 60.0)  # W of algorithm E-4
    resolution_m: float = within(0.05, 0.02, 0.2)
    max_range_m: float | None = within(None, 0.5, 30.0)
    """Usable range; None: the smaller of the sensor's range and W/2."""

    # when a scan is matched, and when it goes into the window
    match_distance_m: float = within(0.02, 0.0, 0.5)
    match_turn_rad: float = within(0.0175, 0.0, 0.5)
    integrate_distance_m: float = within(0.2, 0.0, 2.0)
    integrate_turn_rad: float = within(0.35, 0.0, 1.6)
    integrate_period_s: float = within(1.0, 0.1, 60.0)  # a standing robot still learns that a door opened

    # evidence of one scan on one cell, and its bounds: a moved chair is learnt within a few integrations,
    # one hit makes a cell occupied even where it was free, one miss takes that back
    evidence_hit: int = within(6, 1, 50)
    evidence_miss: int = within(2, 1, 50)
    evidence_floor: int = within(-12, -100, -1)
    evidence_ceiling: int = within(12, 1, 100)
    hits_averaged: int = within(40, 1, 1000)

    # match: point to line against averaged hits
    match_sigma_m: float = within(0.05, 0.005, 0.5)  # reach of the robust weight
    match_noise_m: float = within(0.04, 0.005, 0.5)  # of one beam, widened because beams err together
    point_weight: float = within(0.8, 0.0, 1.0)  # of a hit that lies on no plane, against one that does
    degenerate_below: float = within(0.08, 0.0, 1.0)
    """Diversity (Appendix D) under which the weak axis follows odometry; from there to twice as much the scan
    gains a say bit by bit.
    """
    min_points: int = within(20, 3, 500)
    min_quality: float = within(0.25, 0.0, 1.0)  # a worse match is refused
    new_ground_below: float = within(0.25, 0.0, 1.0)
    """Share of hits in cells the window knows; below it odometry leads on."""
    climb_below: float = within(0.75, 0.0, 1.0)  # quality under which the hill climb is tried too
    large_turn_rad: float = within(0.3, 0.05, 3.15)
    """Odometry that turns more between two scans is searched all round."""
    search_rad: float = within(1.6, 0.05, 3.15)
    """How far round: the worst of the logs turns 85 degrees between two scans."""
    search_m: float = within(0.3, 0.02, 2.0)
    doubted_share: float = within(0.5, 0.05, 10.0)
    """Of the wheels' way; a match further off is made again without what moves."""
    good_share: float = within(0.9, 0.1, 1.0)
    """Of the usual quality; under it the share of known ground is looked at."""
    collapse_share: float = within(0.7, 0.0, 1.0)
    """Of the usual quality; below it the wheels are taken to have slipped: search."""
    quality_memory: float = within(0.05, 0.001, 1.0)  # share of the newest match in the usual quality
    rival_gain: float = within(0.15, 0.0, 1.0)  # a pose far from odometry must be so much better

    # odometry since the previous match, until matches teach otherwise: floor plus share of the motion
    odometry_floor_m: float = within(0.01, 1e-4, 0.5)
    odometry_floor_rad: float = within(0.001, 1e-4, 0.5)
    odometry_m_per_m: float = within(0.05, 1e-3, 2.0)
    odometry_rad_per_rad: float = within(0.2, 1e-3, 2.0)
    odometry_m_per_rad: float = within(0.02, 0.0, 1.0)
    odometry_rad_per_m: float = within(0.1, 0.0, 2.0)

    # what matches teach about the odometry, as factors on its standard deviations: on the shares of one step,
    trust_memory: float = within(0.01, 1e-4, 1.0)  # share of the newest match
    trust_least: float = within(0.2, 0.01, 10.0)
    trust_most: float = within(4.0, 1.0, 100.0)
    odometry_turns_rad: float = within(0.01, 1e-4, 1.0)
    """Settings' share of a turn, above which a step tells about turning."""

    # ... and on the drift of the heading over a stretch
    heading_stretch_m: float = within(3.6, 0.1, 50.0)
    heading_stretch_rad: float = within(6.0, 0.1, 100.0)
    heading_memory: float = within(0.05, 1e-3, 1.0)  # share of the newest stretch
    heading_least: float = within(0.01, 1e-3, 1.0)  # a good gyro's: 0.5 mrad in a metre
    heading_most: float = within(2.0, 1.0, 100.0)

    # drift of the window's frame: after so much travel or turning it is off by the error of one more match
    renew_m: float = within(0.3, 0.1, 100.0)
    renew_rad: float = within(0.5, 0.1, 100.0)

    # particles
    sample_share: float = within(0.1, 0.0, 2.0)
    """Of the proposal's standard deviation that is sampled: a window closes no loop."""
    grown_sample_share: float = within(1.0, 0.0, 2.0)  # on a growing map, where a loop may close
    weight_per_quality: float = within(10.0, 0.1, 1000.0)
    """Log weight for the whole step from quality 0 to 1: beams err together, and a sharper weight would leave
    one line of descent long before a loop closes.
    """
    dethrone_ratio: float = within(20.0, 1.0, 1e6)
    """Another particle becomes the best only when it weighs this many times more."""
    resample_below: float = within(0.5, 0.0, 1.0)  # effective particles as a share of all

    # what is published
    smooth_m: float = within(0.03, 1e-3, 1.0)  # the correction moves at most this far per scan
    smooth_rad: float = within(0.0087, 1e-3, 1.0)
    jump_m: float = within(0.3, 0.01, 10.0)  # a larger gap is closed at once and flagged
    jump_rad: float = within(0.17, 0.01, 3.15)

    def __post_init__(self) -> None:
        window_m, resolution_m = self.window_m, self.resolution_m
        if self.max_range_m is not None and not 0.0 < self.max_range_m <= window_m / 2.0:
            refuse(
                "the window must be at least twice as wide as the range",
                max_range_m=self.max_range_m,
                window_m=window_m,
            )
        if resolution_m <= 0.0 or window_m < 20 * resolution_m:
            refuse("no room for a map in so few cells", window_m=window_m, resolution_m=resolution_m)
        if self.particles < 1:
            refuse("at least 1 is needed", particles=self.particles)
        check_order(self, "collapse_share", "good_share")
        check_order(self, "heading_least", "heading_most")

    @property
    def cells(self) -> int:
        """Return the number of cells along one side of the window."""
        return round(self.window_m / self.resolution_m)

    def usable_range_m(self, sensor_range_m: float) -> float:
        """Return the range up to which a beam is used, never more than half the window."""
        return min(sensor_range_m, self.max_range_m or sensor_range_m, self.window_m / 2.0)
