"""Monte Carlo localisation on a saved grid map, with as many particles as the spread asks for (Fox, 2003).

This is the localisation of the metric baseline (thesis, 5-2-2); LEMTOMap itself does not use it.
"""

import numpy as np
from numpy.typing import NDArray

from lemtomap import se2
from lemtomap.baseline.config import AmclConfig
from lemtomap.baseline.kernels import amcl as kernels
from lemtomap.nav.kernels import fields as costmap_kernels
from lemtomap.nav.types import Points
from lemtomap.se2 import Pose
from lemtomap.types import GridView


class Amcl:
    """Keeps the particles. Same seed and inputs: same poses."""

    def __init__(
        self, grid: GridView, T_grid_base: Pose, config: AmclConfig | None = None, seed: int = 0
    ) -> None:
        self.config = config or AmclConfig()
        self._grid = grid
        self._rng = np.random.default_rng(seed)
        state = np.empty(grid.occupancy.shape, dtype=np.uint8)
        costmap_kernels.classify(grid.occupancy, 50, state)
        self._away = costmap_kernels.clearance_transform(state, self.config.reach_m / grid.resolution_m)
        spread = self._rng.standard_normal((500, 3)) * np.array([0.25, 0.25, 0.13])
        self.particles: NDArray[np.float64] = np.asarray(T_grid_base) + spread
        self._weights = np.full(500, 1.0 / 500)
        self._T_odom_last: Pose | None = None
        self.T_grid_base: Pose = np.array(T_grid_base)

    def update(self, points_base: Points, T_odom_base: Pose) -> Pose:
        """Take a scan's hits (N, 2) in the base frame of T_odom_base; return T_grid_odom."""
        if self._T_odom_last is None:
            self._T_odom_last = np.array(T_odom_base)
            self._weigh(points_base)
        step = se2.between(self._T_odom_last, T_odom_base)
        if np.hypot(step[0], step[1]) >= self.config.update_m or abs(step[2]) >= self.config.update_rad:
            self._move(step)
            self._weigh(points_base)
            self._T_odom_last = np.array(T_odom_base)
            step = se2.pose(0.0, 0.0, 0.0)
        self.T_grid_base = se2.compose(self._mean(), step)
        return se2.compose(self.T_grid_base, se2.inverse(T_odom_base))

    def _move(self, step: Pose) -> None:
        """Sample the odometry motion model: turn, way, turn (Thrun et al., 2005, table 5.6)."""
        config, rng, n = self.config, self._rng, len(self.particles)
        way = float(np.hypot(step[0], step[1]))
        turn1 = float(np.arctan2(step[1], step[0])) if way > 0.01 else 0.0
        turn2 = float(se2.wrap_angle(step[2] - turn1))

        def turn_noise(turn: float) -> NDArray[np.float64]:
            small = min(abs(turn), abs(float(se2.wrap_angle(turn - np.pi))))  # driving back is no turn
            sigma = np.sqrt(config.turn_from_turn * small**2 + config.turn_from_way * way**2)
            return np.asarray(rng.standard_normal(n) * sigma)

        turned = min(turn1**2, float(se2.wrap_angle(turn1 - np.pi)) ** 2) + turn2**2
        first = turn1 + turn_noise(turn1)
        sigma_way = np.sqrt(config.way_from_way * way**2 + config.way_from_turn * turned)
        ways = way + rng.standard_normal(n) * sigma_way
        last = turn2 + turn_noise(turn2)
        heading = self.particles[:, 2] + first
        self.particles[:, 0] += ways * np.cos(heading)
        self.particles[:, 1] += ways * np.sin(heading)
        self.particles[:, 2] = se2.wrap_angle(heading + last)

    def _weigh(self, points_base: Points) -> None:
        config, grid = self.config, self._grid
        if len(points_base) == 0:
            return
        some = np.linspace(0, len(points_base) - 1, min(config.beams, len(points_base))).astype(int)
        log = np.empty(len(self.particles))
        kernels.beam_log_likelihood(
            self.particles, np.ascontiguousarray(points_base[some]), self._away, *grid.origin_m,
            grid.resolution_m, config.sigma_hit_m, config.random_share, log,
        )  # fmt: skip
        # Beams of one scan err together; ROS tempers them by summing cubes, here by a share of the log.
        self._weights *= np.exp(0.3 * (log - log.max()))
        self._weights /= self._weights.sum()
        if 1.0 / (self._weights**2).sum() < config.resample_below * len(self.particles):
            self._resample()

    def _resample(self) -> None:
        config = self.config
        chosen = np.empty(config.most, dtype=np.int64)
        count = kernels.kld_resample(
            self.particles, self._weights, self._rng.random(config.most), config.least, config.most,
            config.kld_error, config.kld_quantile, chosen,
        )  # fmt: skip
        self.particles = self.particles[chosen[:count]]
        self._weights = np.full(count, 1.0 / count)

    def _mean(self) -> Pose:
        """Return the mean of the particles around the best one."""
        best = self.particles[np.argmax(self._weights)]
        near = np.hypot(*(self.particles[:, :2] - best[:2]).T) < 0.5
        share = self._weights[near] / self._weights[near].sum()
        x, y = share @ self.particles[near, :2]
        turn = se2.wrap_angle(self.particles[near, 2] - best[2])
        return se2.pose(float(x), float(y), float(se2.wrap_angle(best[2] + share @ turn)))
