"""Rolling-window GMapping (thesis 3-4, algorithm E-4; Grisetti, Stachniss, Burgard 2007).

Each particle is a pose, a weight and a window. Between integrations the best particle's window tracks
every scan; at an integration each particle follows the tracked motion, matches against its own window, and
samples its pose from the Gaussian around that match, the motion prior included.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lemtomap.grid import particles
from lemtomap.grid.beams import Beams
from lemtomap.grid.config import SlamConfig
from lemtomap.grid.mapper import Tracker, roll_and_integrate
from lemtomap.grid.matching import ScanMatch, refused
from lemtomap.grid.motion import odometry_drift
from lemtomap.grid.window import Window
from lemtomap.se2 import Pose, between, compose


@dataclass(frozen=True, slots=True)
class Visit:
    """One pose of a particle's past; particles of one descent share it."""

    T_grid_base: Pose
    before: "Visit | None"


@dataclass(slots=True)
class Particle:
    """One hypothesis; the window may be shared with its siblings until it is written."""

    T_grid_base: Pose
    log_weight: float
    window: Window
    past: Visit | None = None
    """Kept only with a map that grows anyway."""


class RollingGmapping(Tracker):
    """N particles with copy-on-write windows; memory is all taken at the start."""

    def __init__(self, config: SlamConfig, seed: int = 0) -> None:
        super().__init__(config, seed)
        self._rng = np.random.default_rng(seed)
        self._windows = [self._new_window() for _ in range(config.particles)]
        self._particles = [Particle(np.zeros(3), 0.0, self._windows[0]) for _ in range(config.particles)]
        self._best = 0
        self._sample_share = config.sample_share

    def particles(self) -> NDArray[np.float64]:
        """Return float64 (N, 3), T_grid_base of each particle now."""
        if self._T_grid_base is None:
            return np.zeros((0, 3))
        since = between(self._particles[self._best].T_grid_base, self._T_grid_base)
        return np.stack([compose(particle.T_grid_base, since) for particle in self._particles])

    @property
    def nbytes(self) -> int:
        """Return the memory of all windows."""
        return sum(window.nbytes for window in self._windows)

    def _new_window(self) -> Window:
        return Window(self.config, self._tables, self._scratch)

    def _window(self) -> Window:
        return self._particles[self._best].window

    def _integrate(self, beams: Beams, match: ScanMatch | None) -> Pose:
        assert self._T_grid_base is not None  # noqa: S101
        if match is None:
            for particle in self._particles:
                particle.T_grid_base = self._T_grid_base
        else:
            self._move_and_weigh(beams, match)
        for particle in self._particles:
            self._own_window(particle)
            roll_and_integrate(particle.window, beams, particle.T_grid_base)
        self._choose_and_resample()
        return self._particles[self._best].T_grid_base

    def _follow(self, beams: Beams) -> None:
        for particle in self._particles:
            self._own_window(particle)
            roll_and_integrate(particle.window, beams, compose(particle.T_grid_base, self._pending))

    def _move_and_weigh(self, beams: Beams, tracked: ScanMatch) -> None:
        """Draw each pose from its proposal and weigh it by how well the scan fits its window (lines 7-16).

        A scan that fits nowhere says nothing: then a particle moves as odometry may have it, and where even
        the best finds no fit none is weighed, else the luckiest of many chance fits would win.
        """
        step = between(self._particles[self._best].T_grid_base, tracked.T_grid_base)
        uncertainty, drift = self._noise.prior(step), odometry_drift(step, self.config)
        for index, particle in enumerate(self._particles):
            if index == self._best:
                particle.T_grid_base = tracked.T_grid_base  # the best stays at the mode of its proposal
                continue
            prior = compose(particle.T_grid_base, step)
            match = refused(prior, drift)
            if tracked.accepted:
                found = self._match(beams, prior, uncertainty, particle.window)
                match = found if found.accepted else match
                gain = match.diversity * (match.quality - tracked.quality)
                particle.log_weight += self.config.weight_per_quality * gain
            particle.T_grid_base = self._draw(match)

    def _draw(self, match: ScanMatch) -> Pose:
        """Return a pose from the Gaussian around the match, fused with the motion prior."""
        noise = np.linalg.cholesky(match.covariance) @ self._rng.standard_normal(3)
        return np.asarray(match.T_grid_base + self._sample_share * noise)

    def _own_window(self, particle: Particle) -> None:
        """Give the particle a window of its own before it is written (copy on write)."""
        if sum(other.window is particle.window for other in self._particles) == 1:
            return
        used = {id(other.window) for other in self._particles}
        free = next(window for window in self._windows if id(window) not in used)
        free.copy_from(particle.window)
        particle.window = free

    def _choose_and_resample(self) -> None:
        weights = particles.normalised(np.array([particle.log_weight for particle in self._particles]))
        if weights.max() > self.config.dethrone_ratio * weights[self._best]:
            self._best = int(np.argmax(weights))
        if particles.effective_number(weights) >= self.config.resample_below * len(weights):
            return
        parents = particles.resample(weights, self._rng)
        survivors = np.flatnonzero(parents == self._best)
        if not len(survivors):
            survivors = np.flatnonzero(parents == np.argmax(weights))
        self._particles = [replace(self._particles[parent], log_weight=0.0) for parent in parents]
        self._best = int(survivors[0])
