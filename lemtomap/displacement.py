"""How well the robot knows where it is: the pose quality, and the signs that it was carried or pushed away.

Only the robot's own evidence counts: what the wheels and the gyro say against what the laser says, how well
a scan fits its window against how well scans usually fit, whether it shows what the scan before it showed,
and the covariance of the pose.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.kernels.nearness import share_near
from lemtomap.se2 import Pose, between, transform
from lemtomap.settings import within
from lemtomap.types import Odometry, SlamUpdate

RIGHT_M, RIGHT_RAD = 0.10, math.radians(2.0)
"""A pose is right within these: what a quality promises."""
COMPARED = 3  # every so many hits of a scan are looked for in another


@dataclass(frozen=True, slots=True)
class WatchConfig:
    """When a robot has been moved by somebody else, and how its pose is doubted.

    Measured in simulation on a robot left alone: from one scan to the next wheels and laser never differ by
    more than 0.02 m and 0.02 rad, and a scan fits at least 0.8 times as well as usual.
    """

    jump_m: float = within(0.25, 0.05, 5.0)
    """The laser says that far beyond what the wheels say: pushed or carried."""
    jump_rad: float = within(0.25, 0.05, 3.15)
    twitch_m: float = within(0.08, 0.02, 5.0)  # ... so far, and it must fit as well as usual afterwards
    twitch_rad: float = within(0.10, 0.02, 3.15)
    fits_again: float = within(0.9, 0.1, 1.0)  # of the usual quality
    misfit: float = within(0.6, 0.0, 1.0)  # of the usual quality: the scan does not belong here, ...
    misfit_s: float = within(1.0, 0.1, 60.0)  # ... when it lasts; people pass by
    known_share: float = within(0.25, 0.0, 1.0)
    """Of the hits on known ground at least: new ground and open space tell nothing."""
    again_m: float = within(0.1, 0.02, 1.0)
    """A hit this near to one of an earlier scan shows the same thing."""
    again: float = within(0.35, 0.0, 1.0)
    """Share of such hits below which nothing is left of it (robots left alone: 0.98)."""
    again_points: int = within(60, 5, 1000)  # six metres of wall: fewer hits tell nothing
    before_s: float = within(0.35, 0.05, 5.0)  # age of the scan before, at most ...
    matched_s: float = within(1.5, 0.1, 60.0)
    """... and of the last one matched: since then the wheels err by centimetres."""
    memory: float = within(0.05, 1e-3, 1.0)  # share of the newest scan in the usual quality
    carried_s: float = within(1.0, 0.1, 60.0)
    """Wheels in the air for so long: carried; shorter ones are door sills."""

    inflate: float = within(2.0, 1.0, 20.0)
    """Of the standard deviations: errors of one match after another are not independent."""
    floor_m: float = within(0.025, 1e-3, 1.0)
    """... and what stays even then, at a node made in this window,."""
    known_floor_m: float = within(0.05, 1e-3, 1.0)
    """... and at one known before: the map is bent, and walls repeat themselves."""
    floor_rad: float = within(math.radians(0.5), 1e-4, 0.5)
    doubted: float = within(0.6, 0.0, 1.0)  # quality of a pose that the window does not bear out, at most
    good_fit: float = within(0.85, 0.1, 1.0)  # of the usual quality: nothing to doubt
    bad_fit: float = within(0.55, 0.0, 1.0)  # no quality left


@dataclass(frozen=True, slots=True)
class _Seen:
    """One scan and where odometry had the robot."""

    stamp_s: float
    odometry: Odometry
    hits_base: NDArray[np.floating]

    def alike(self, before: "_Seen", within_s: float, config: WatchConfig) -> float:
        """Return the share of hits with one of an earlier scan near by, or the other way round if that is
        more; 1 where there is too little, or too old, to compare with.
        """
        few = min(len(self.hits_base), len(before.hits_base)) < config.again_points
        if few or self.stamp_s - before.stamp_s > within_s:
            return 1.0
        T_here_before = between(self.odometry.T_odom_base, before.odometry.T_odom_base)
        earlier = transform(T_here_before, before.hits_base)
        shares = [
            share_near(here, there, config.again_m, COMPARED)
            for here, there in ((earlier, self.hits_base), (self.hits_base, earlier))
        ]
        return max(shares)


class Watch:
    """Notices that the robot is no longer where it was. One scan at a time."""

    def __init__(self, config: WatchConfig | None = None) -> None:
        self.config = config or WatchConfig()
        self._lifted_since_s: float | None = None
        self.restart()

    def lift(self, stamp_s: float) -> None:
        """Take note that the wheels hang in the air: what odometry says is not true."""
        if self._lifted_since_s is None:
            self._lifted_since_s = stamp_s

    def put_down(self, stamp_s: float) -> str:
        """Take note that the wheels stand; return why the robot must have been carried, empty when not."""
        since_s, self._lifted_since_s = self._lifted_since_s, None
        carried = since_s is not None and stamp_s - since_s >= self.config.carried_s
        return "carried elsewhere, or put back: wheels hung in the air" if carried else ""

    def restart(self) -> None:
        """Begin anew, in a new window."""
        self._usual = 0.0
        self._fit = self._fit_known = 1.0  # of all hits, and of those on known ground alone
        self._misfit_since_s: float | None = None
        self._before: tuple[Pose, Pose] | None = None
        self._last: _Seen | None = None
        self._matched: _Seen | None = None

    @property
    def fit(self) -> float:
        """How well the latest scan fits its window, as a share of what is usual."""
        return self._fit

    def displaced(
        self, slam: SlamUpdate, odometry: Odometry, hits_base: NDArray[np.floating] | None = None
    ) -> str:
        """Take one scan; return why somebody must have moved the robot, empty when nobody has.

        hits_base: the scan's hits, float (N, 2), metres, base frame at its stamp.
        """
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
        vanished = hits_base is not None and self._vanished(slam, _Seen(slam.stamp_s, odometry, hits_base))
        if vanished:
            return "nothing of what was in sight a moment ago is there any more"
        return self._leapt(off, telling=telling) or self._misfits(slam, telling=telling)

    def _vanished(self, slam: SlamUpdate, seen: _Seen) -> bool:
        """Return True if nothing is left of what the scan before showed.

        On ground that the window does not know a scan fits nothing, whether the robot drove there or was put
        there; but who drives still sees a moment later what was in sight before. A scan that was not matched,
        for the robot stands, fits its window as well as it shows what the last one that was matched did.
        """
        config, last, self._last = self.config, self._last, seen
        if slam.matched:
            self._matched = seen
        elif self._matched is not None and self._fit >= config.good_fit:
            self._fit = min(self._fit, seen.alike(self._matched, config.matched_s, config))
        return (
            self._fit < config.good_fit
            and last is not None
            and (seen.alike(last, config.before_s, config) < config.again)
        )

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
    covariance: NDArray[np.float64], fit: float, *, born: bool, measured: bool, config: WatchConfig
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
