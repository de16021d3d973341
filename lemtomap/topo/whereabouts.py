"""How well the robot knows where it is: the pose quality, and the signs that it was carried or pushed away.

Only the robot's own evidence counts: what the wheels and the gyro say against what the laser says, how well
a scan fits its window against how well scans usually fit, and the covariance of the pose.
"""

import math
from dataclasses import dataclass

import numpy as np

from lemtomap.se2 import Pose, between
from lemtomap.topo.graph import Covariance
from lemtomap.types import Odometry, SlamUpdate

RIGHT_M, RIGHT_RAD = 0.10, math.radians(2.0)
"""A pose is right within these: what a quality promises."""


@dataclass(frozen=True, slots=True)
class WatchConfig:
    """When a robot has been moved by somebody else, and how its pose is doubted.

    Measured in simulation on a robot left alone: from one scan to the next wheels and laser never differ by
    more than 0.02 m and 0.02 rad, and a scan fits at least 0.8 times as well as usual.
    """

    jump_m: float = 0.25  # the laser says that far beyond what the wheels say: pushed or carried
    jump_rad: float = 0.25
    twitch_m: float = 0.08  # ... so far, and it must fit as well as usual afterwards
    twitch_rad: float = 0.10
    fits_again: float = 0.9  # of the usual quality
    misfit: float = 0.6  # of the usual quality: the scan does not belong here, ...
    misfit_s: float = 1.0  # ... when it lasts; people pass by
    known_share: float = 0.25  # of the hits on known ground at least: new ground and open space tell nothing
    memory: float = 0.05  # share of the newest scan in the usual quality
    carried_s: float = 1.0  # wheels in the air for so long: carried; shorter ones are door sills

    inflate: float = 2.0  # of the standard deviations: errors of one match after another are not independent
    floor_m: float = 0.025  # ... and what stays even then, at a node made in this window,
    known_floor_m: float = 0.05  # ... and at one known before: the map is bent, and walls repeat themselves
    floor_rad: float = math.radians(0.5)
    doubted: float = 0.6  # quality of a pose that the window does not bear out, at most
    good_fit: float = 0.85  # of the usual quality: nothing to doubt
    bad_fit: float = 0.55  # no quality left


class Watch:
    """Notices that the robot is no longer where it was. One scan at a time."""

    def __init__(self, config: WatchConfig | None = None) -> None:
        self.config = config or WatchConfig()
        self.restart()

    def restart(self) -> None:
        """Begin anew, in a new window."""
        self._usual = 0.0
        self._fit = self._fit_known = 1.0  # of all hits, and of those on known ground alone
        self._misfit_since_s: float | None = None
        self._before: tuple[Pose, Pose] | None = None

    @property
    def fit(self) -> float:
        """How well the latest scan fits its window, as a share of what is usual."""
        return self._fit

    def displaced(self, slam: SlamUpdate, odometry: Odometry) -> str:
        """Take one scan; return why somebody must have moved the robot, empty when nobody has."""
        telling = slam.known >= self.config.known_share
        # after a blind stretch the laser makes good the wheels' drift: nothing to compare it with
        before, self._before = self._before, None
        self._fit = slam.quality / self._usual if self._usual > 0.0 else 1.0
        if telling:
            self._before = slam.T_grid_base, odometry.T_odom_base
            self._fit_known = self._fit / slam.known
        off = np.zeros(3)
        if before is not None:
            said = between(before[1], odometry.T_odom_base)
            off = between(said, between(before[0], slam.T_grid_base))
        return self._leapt(off, telling=telling) or self._misfits(slam, telling=telling)

    def _leapt(self, off: Pose, *, telling: bool) -> str:
        """Judge how far the laser's way since the last scan is off the wheels'."""
        config = self.config
        way_m, turn_rad = math.hypot(off[0], off[1]), abs(float(off[2]))
        if way_m > config.jump_m or turn_rad > config.jump_rad:
            return "the laser sees another place than the wheels can have brought it to"
        twitched = way_m > config.twitch_m or turn_rad > config.twitch_rad
        if twitched and telling and self._fit_known < config.fits_again:
            return "pushed, and what the laser sees does not fit"
        return ""

    def _misfits(self, slam: SlamUpdate, *, telling: bool) -> str:
        """Judge how long the scans have not fitted; learn from one that fits how well they usually do."""
        config = self.config
        if not telling or self._fit_known >= config.misfit:
            self._misfit_since_s = None
            if telling and slam.quality > 0.0:
                share = config.memory if self._usual > 0.0 else 1.0
                self._usual += share * (slam.quality / slam.known - self._usual)
            return ""
        if self._misfit_since_s is None:
            self._misfit_since_s = slam.stamp_s
        lasts_s = slam.stamp_s - self._misfit_since_s
        return "what the laser sees does not fit any more" if lasts_s >= config.misfit_s else ""


def pose_quality(
    covariance: Covariance, fit: float, *, born: bool, measured: bool, config: WatchConfig
) -> float:
    """Return how likely a pose is right within 10 cm and 2 degrees, 0 to 1.

    covariance: float64 (3, 3) of the pose relative to its node, m, m, rad; fit: of the latest scan, as a
    share of the usual; born: the node was made in this window; measured: the window bears its place out.
    """
    floor_m = config.floor_m if born else config.known_floor_m
    variance_m2 = config.inflate**2 * float(np.linalg.eigvalsh(covariance[:2, :2])[-1]) + floor_m**2
    variance_rad2 = config.inflate**2 * float(covariance[2, 2]) + config.floor_rad**2
    near = 1.0 - math.exp(-(RIGHT_M**2) / (2.0 * variance_m2))
    straight = math.erf(RIGHT_RAD / math.sqrt(2.0 * variance_rad2))
    trust = min(1.0, max(0.0, (fit - config.bad_fit) / (config.good_fit - config.bad_fit)))
    return near * straight * trust * (1.0 if measured else config.doubted)
