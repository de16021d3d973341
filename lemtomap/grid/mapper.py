"""What both policies share: every scan tracks the pose against the best window; some scans go into the
windows.

The thesis' figure for one scan: predict → match → weigh → integrate → resample → roll (algorithm E-4).
"""

import math
from abc import ABC, abstractmethod
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lemtomap.grid.beams import Beams, ScanPreparer
from lemtomap.grid.config import SlamConfig
from lemtomap.grid.foreground import without_foreground
from lemtomap.grid.kernels import matching as matching_kernels
from lemtomap.grid.matching import Matcher, ScanMatch, refused
from lemtomap.grid.motion import OdometryNoise, Uncertainty
from lemtomap.grid.publish import SmoothCorrection
from lemtomap.grid.window import Scratch, Window, look_up
from lemtomap.se2 import Pose, between, compose, wrap_angle
from lemtomap.types import (
    GridView,
    Odometry,
    Scan,
    SlamUpdate,
)


class GridSlam(Protocol):
    """A mapper of the metric layer."""

    def update(self, scan: Scan, odometry: Odometry) -> SlamUpdate:
        """Use one scan; call it for every scan. odometry: the base at the scan's stamp, and at
        its beams or how fast, which de-skews.
        """
        ...

    def view(self) -> GridView:
        """Return the best map."""
        ...

    def particles(self) -> NDArray[np.float64]:
        """Return float64 (N, 3), T_grid_base of each particle."""
        ...

    def points_base(self) -> NDArray[np.float32]:
        """Return the latest scan's hits, de-skewed, float32 (M, 2), metres, base frame."""
        ...


class Tracker(ABC):
    """Follows every scan; leaves the windows to its subclasses."""

    def __init__(self, config: SlamConfig, seed: int = 0) -> None:
        self.config = config
        self.seed = seed
        self._tables = look_up(config.resolution_m)
        self._scratch = Scratch(config.cells)
        self._match = Matcher(config, self._tables)
        self._prepare = ScanPreparer()
        self._noise = OdometryNoise(config)
        self._correction = SmoothCorrection(config)
        self._T_grid_base: Pose | None = None
        self._beams: Beams | None = None
        self._pending = np.zeros(3)  # odometry since the last match
        self._T_odom_base = np.zeros(3)
        self._moves = False
        self._stamp_s = 0.0
        self._T_grid_integrated = np.zeros(3)
        self._integrated_s = -math.inf
        self._diversity = 0.0
        self._quality, self._known = 0.0, 1.0
        self._usual_quality = 0.0
        self._covariance = self._information = np.zeros((3, 3))
        self._reported: Pose | None = None
        self._rates = np.array(
            [
                config.renew_m,
                config.renew_rad,
                config.odometry_m_per_m**2,
                config.odometry_m_per_rad**2,
                config.odometry_rad_per_m**2,
                config.odometry_rad_per_rad**2,
            ]
        )

    # -- what subclasses say
    # ---------------------------------------------------------------------------------------

    @abstractmethod
    def _window(self) -> Window:
        """Return the window that scans are tracked against."""

    @abstractmethod
    def _integrate(self, beams: Beams, match: ScanMatch | None) -> Pose:
        """Put the scan into the window(s); return the best pose now."""

    @abstractmethod
    def _follow(self, beams: Beams) -> None:
        """Put a scan without hits into the window(s) where odometry has taken them since the last match."""

    # -- GridSlam
    # --------------------------------------------------------------------------------------------------

    def update(self, scan: Scan, odometry: Odometry) -> SlamUpdate:
        """Use one scan; see GridSlam.update."""
        beams = self._prepare(scan, odometry, self.config.usable_range_m(scan.range_max_m))
        self._beams, self._stamp_s = beams, scan.stamp_s
        if self._T_grid_base is None:
            return self._begin(beams, odometry)
        step = between(self._T_odom_base, odometry.T_odom_base)
        self._T_odom_base = odometry.T_odom_base
        self._pending = compose(self._pending, step)
        predicted = compose(self._T_grid_base, self._pending)
        # wheels whose stamps jitter may say that a robot in motion stood for a moment
        due = self._moves or self._is_due_to_match(scan.stamp_s)
        self._moves = self._is_motion(step)
        if not due:
            return self._report(predicted, matched=False, integrated=False)
        match = self._track(beams, predicted, abs(float(step[2])))
        self._quality, self._diversity, self._covariance = match.quality, match.diversity, match.covariance
        if len(beams.hits) == 0:
            drift = self._noise.drift(self._pending)
            self._covariance = refused(predicted, drift).covariance
            return self._report(predicted, matched=False, integrated=self._see_floor(beams, predicted))
        if not match.accepted:
            if self._known > self.config.new_ground_below:
                return self._report(predicted, matched=False, integrated=False)
            match = refused(predicted, self._noise.prior(self._pending))
        self._moves = self._is_motion(between(self._T_grid_base, match.T_grid_base))
        self._T_grid_base, self._information = match.T_grid_base, match.information
        self._pending = np.zeros(3)
        integrated = self._is_due_to_integrate(self._T_grid_base, scan.stamp_s)
        if integrated:
            self._T_grid_base = self._integrate(beams, match)
            self._T_grid_integrated, self._integrated_s = self._T_grid_base, scan.stamp_s
        return self._report(self._T_grid_base, matched=match.accepted, integrated=integrated)

    def view(self) -> GridView:
        """Return the best particle's window."""
        return self._window().view(self._stamp_s)

    def occupied_points(self) -> NDArray[np.float32]:
        """Return the occupied points of the best window, float32 (M, 2), metres, grid frame."""
        return self._window().occupied_points()

    def points_base(self) -> NDArray[np.float32]:
        """Return the latest scan's hits, de-skewed, float32 (M, 2), metres, base frame."""
        return self._beams.hits if self._beams is not None else np.empty((0, 2), dtype=np.float32)

    # -- one scan
    # --------------------------------------------------------------------------------------------------

    def _begin(self, beams: Beams, odometry: Odometry) -> SlamUpdate:
        self._T_odom_base = odometry.T_odom_base
        self._T_grid_base = self._T_grid_integrated = odometry.T_odom_base
        self._integrated_s = odometry.stamp_s
        self._T_grid_base = self._integrate(beams, None)
        return self._report(self._T_grid_base, matched=False, integrated=True)

    def _is_due_to_match(self, stamp_s: float) -> bool:
        waited_s = abs(stamp_s - self._integrated_s)
        return self._is_motion(self._pending) or waited_s >= self.config.integrate_period_s

    def _is_motion(self, step: Pose) -> bool:
        x, y, yaw = step.tolist()
        return math.hypot(x, y) >= self.config.match_distance_m or abs(yaw) >= self.config.match_turn_rad

    def _see_floor(self, beams: Beams, predicted: Pose) -> bool:
        """Let the window go along where the laser meets nothing; tell whether it did now.

        What odometry adds up to until walls are met again stays pending: the first match looks that far.
        """
        if not self._is_due_to_integrate(predicted, self._stamp_s):
            return False
        self._follow(beams)
        self._T_grid_integrated, self._integrated_s = predicted, self._stamp_s
        return True

    def _is_due_to_integrate(self, T_grid_base: Pose, stamp_s: float) -> bool:
        way = T_grid_base - self._T_grid_integrated
        return (
            math.hypot(way[0], way[1]) >= self.config.integrate_distance_m
            or abs(float(wrap_angle(way[2]))) >= self.config.integrate_turn_rad
            or abs(stamp_s - self._integrated_s) >= self.config.integrate_period_s
        )

    def _track(self, beams: Beams, predicted: Pose, turn_rad: float) -> ScanMatch:
        """Match against the best window; look all round where odometry leapt or the scan suddenly fits
        nowhere.
        """
        config, window = self.config, self._window()
        expected = self._noise.prior(self._pending)
        # wheels that have proven good turn fast without leaping
        leapt = min(turn_rad, expected.sigma_rad / config.odometry_rad_per_rad) > config.large_turn_rad
        match = self._match(beams, predicted, expected, window, config.search_rad if leapt else 0.0)
        if not leapt and self._contradicts_wheels(match, predicted):
            match = self._hear_wheels(beams, match, predicted, expected)
        poor = match.quality < max(config.good_share * self._usual_quality, config.min_quality)
        self._known = window.known_share(beams, predicted) if poor else 1.0
        # after a leap, what ground lies under the hits is chance; else new ground speaks against no pose
        way_m = math.hypot(self._pending[0], self._pending[1])
        chance = leapt or way_m > config.search_m
        wanted = self._usual_quality * (1.0 if chance else self._known)
        if match.quality < config.collapse_share * wanted:
            match = self._look_round(beams, match, predicted, config.collapse_share * wanted, leapt=leapt)
        elif match.accepted and way_m > config.match_distance_m:
            change = match.T_grid_base - predicted
            change[2] = wrap_angle(change[2])
            self._noise.learn(change, float(predicted[2]), self._pending, match.information)
        if match.accepted or not self._usual_quality:
            share = config.quality_memory if self._usual_quality else 1.0
            self._usual_quality += share * (match.quality - self._usual_quality)
        return match

    def _contradicts_wheels(self, match: ScanMatch, predicted: Pose) -> bool:
        """Return True if a match takes back, or doubles, a good part of the way the wheels have gone."""
        way_m = math.hypot(self._pending[0], self._pending[1])
        return match.accepted and _off_m(match, predicted) > self.config.doubted_share * way_m > 0.0

    def _hear_wheels(
        self, beams: Beams, match: ScanMatch, predicted: Pose, expected: Uncertainty
    ) -> ScanMatch:
        """Return the match without what stands in front, if it bears the wheels out; else the one given.

        A person who walks along is all that contradicts them then. Wheels that are late or slip are
        contradicted by everything.
        """
        behind = without_foreground(beams)
        if len(behind.hits) == len(beams.hits):
            return match
        steady = self._match(behind, predicted, expected, self._window())
        bears_out = _off_m(steady, predicted) < self.config.doubted_share * _off_m(match, predicted)
        return steady if steady.accepted and bears_out else match

    def _look_round(
        self, beams: Beams, match: ScanMatch, predicted: Pose, wanted: float, *, leapt: bool
    ) -> ScanMatch:
        """Return a clearly better match than one that fits badly, of at least the wanted quality: the wheels
        slipped, or odometry leapt and the robot stayed.
        """
        assert self._T_grid_base is not None  # noqa: S101
        config = self.config
        slipped = Uncertainty(config.search_m, config.search_rad)
        starts = [] if leapt else [predicted]
        if math.hypot(self._pending[0], self._pending[1]) > config.search_m:
            starts.append(self._T_grid_base)
        rivals = [self._match(beams, start, slipped, self._window(), config.search_rad) for start in starts]
        # a lone wall fits any other
        sharp = [rival for rival in rivals if rival.diversity >= config.degenerate_below]
        best = max(sharp, key=lambda rival: rival.quality, default=match)
        # a hit by chance is likelier where most beams see nothing
        sees = len(beams.hits) / (len(beams.hits) + len(beams.cuts))
        gain = sees * (best.quality - match.quality)
        return best if best.quality > wanted and gain > config.rival_gain else match

    def _step_covariance(self, T_grid_base: Pose) -> NDArray[np.float64]:
        """Return how far the motion since the previous report may be wrong.

        The windows follow the robot, so what was seen stays right for some metres and then drifts by the
        error of one match; what the scan cannot see drifts as odometry does.
        """
        covariance = np.zeros((3, 3))
        before = self._reported
        if before is not None:
            step = between(before, T_grid_base)
            matching_kernels.drift(step, float(before[2]), self._information, self._rates, covariance)
        self._reported = T_grid_base
        return covariance

    def _report(self, T_grid_base: Pose, *, matched: bool, integrated: bool) -> SlamUpdate:
        T_grid_odom, jumped = self._correction.follow(T_grid_base, self._T_odom_base)
        enough = len(self.points_base()) >= self.config.min_points
        return SlamUpdate(
            stamp_s=self._stamp_s,
            T_grid_base=T_grid_base,
            T_grid_odom=T_grid_odom,
            covariance=self._covariance,
            step_covariance=self._step_covariance(T_grid_base),
            quality=self._quality,
            diversity=self._diversity,
            known=self._known if enough else 0.0,
            matched=matched,
            integrated=integrated,
            jumped=jumped,
        )


def _off_m(match: ScanMatch, predicted: Pose) -> float:
    """Return how far from its prediction a match lies."""
    off_x, off_y, _ = (match.T_grid_base - predicted).tolist()
    return math.hypot(off_x, off_y)


class WindowMatcher(Tracker):
    """A single hypothesis: one window, one pose, no sampling. The leaner alternative that T7-1-3 asks for."""

    def __init__(self, config: SlamConfig, seed: int = 0) -> None:
        super().__init__(config, seed)
        self._only = Window(config, self._tables, self._scratch)

    def particles(self) -> NDArray[np.float64]:
        """Return float64 (1, 3), the pose."""
        return np.zeros((0, 3)) if self._T_grid_base is None else self._T_grid_base[None, :].copy()

    def _window(self) -> Window:
        return self._only

    def _integrate(self, beams: Beams, match: ScanMatch | None) -> Pose:
        del match
        assert self._T_grid_base is not None  # noqa: S101
        roll_and_integrate(self._only, beams, self._T_grid_base)
        return self._T_grid_base

    def _follow(self, beams: Beams) -> None:
        assert self._T_grid_base is not None  # noqa: S101
        roll_and_integrate(self._only, beams, compose(self._T_grid_base, self._pending))


def roll_and_integrate(window: Window, beams: Beams, T_grid_base: Pose) -> None:
    """Shift only when the scan falls outside (thesis 3-4), then integrate."""
    if not window.holds(beams, T_grid_base):
        window.shift_to(window.centred_origin(T_grid_base))
    window.integrate(beams, T_grid_base)
