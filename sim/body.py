"""The Kobuki's body: motors with lag, wheels that slip, a cylinder that cannot pass through things.

Planar differential drive stepped at a fixed rate; pybullet says what the body touches and where the floor is.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from lemtomap.sim.scene import Scene, Touch
from lemtomap.sim.world import Pose2

HALF_TRACK_M = 0.115  # wheels at y = +-0.115 m
MAX_WHEEL_MPS = 0.70
CLIFF_SENSORS = ((0.085, -0.13601), (0.156, 0.0), (0.08734, 0.13601))
"""Right, centre, left, metres in base (kobuki_description)."""
CASTERS = ((0.115, 0.0), (-0.135, 0.0))
CLIFF_DROP_M = 0.04  # simulation threshold; the robot feels cliffs deeper than 5 cm (section 3.4)
LEAN_M = 0.05  # between the wheels' floors: more, and the lower wheel hangs
WHEEL_TRAVEL_M = 0.02  # suspension travel before the switch says dropped


@dataclass(frozen=True, slots=True)
class SimulatedBody:
    """How imperfect this one robot is; sigmas are drawn once per seed."""

    motor_lag_s: float = 0.09
    """Time constant of the speed loop (guess from the response of a loaded 24:1 gear motor with PID)."""
    max_accel_mps2: float = 1.8
    """What the motors can do with 6 kg on top."""
    wheel_radius_sigma: float = 0.008
    """Relative error common to both wheels' radius: wear and compression of the tyres."""
    wheel_difference_sigma: float = 0.0015
    """Relative error of one wheel's radius against the other's."""
    track_sigma: float = 0.006
    """Relative error of the distance between the wheels' contact points."""
    slip_sigma: float = 0.006
    """Standard deviation of the slowly varying relative slip of each wheel."""
    slip_length_m: float = 1.0
    """Distance over which the slip forgets itself (floor joints, dust, carpet)."""
    stuck_left: tuple[float, float] | None = None
    """Seconds (from, to) during which the left encoder does not count."""
    stuck_right: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class BodyState:
    """Where the body truly is, and what its wheels have done."""

    x: float
    y: float
    yaw: float
    """Not wrapped."""
    height_m: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    left_m: float = 0.0
    """Travel the encoder has counted."""
    right_m: float = 0.0
    left_mps: float = 0.0
    """Speed of the wheel's rim."""
    right_mps: float = 0.0

    @property
    def pose(self) -> Pose2:
        """x, y, yaw."""
        return self.x, self.y, self.yaw

    def towards(self, other: "BodyState", share: float) -> "BodyState":
        """Return the state at a share of the way to another one."""

        def mix(a: float, b: float) -> float:
            return a + (b - a) * share

        return BodyState(
            mix(self.x, other.x),
            mix(self.y, other.y),
            mix(self.yaw, other.yaw),
            mix(self.height_m, other.height_m),
            mix(self.pitch, other.pitch),
            mix(self.roll, other.roll),
            mix(self.left_m, other.left_m),
            mix(self.right_m, other.right_m),
            mix(self.left_mps, other.left_mps),
            mix(self.right_mps, other.right_mps),
        )


class Body:
    """One robot in one scene."""

    def __init__(
        self, scene: Scene, spawn: Pose2, config: SimulatedBody, rng: np.random.Generator, *, flat: bool
    ) -> None:
        self._scene = scene
        self._config = config
        self._rng = rng
        self._flat = flat
        draw = rng.standard_normal(3)
        common = 1.0 + config.wheel_radius_sigma * float(draw[0])
        self._left_scale = common - config.wheel_difference_sigma * float(draw[1]) / 2
        self._right_scale = common + config.wheel_difference_sigma * float(draw[1]) / 2
        self._track_m = 2 * HALF_TRACK_M * (1.0 + config.track_sigma * float(draw[2]))
        self._slip = [0.0, 0.0]
        self.state = BodyState(*spawn)
        self.contacts: list[Touch] = []
        """What the body touches now."""
        self.contact_count = 0
        """How often a touch began."""
        self.contact_s = 0.0
        """How long it has touched anything."""
        self.floor_drops: tuple[float, float, float] = (0.0, 0.0, 0.0)
        """Metres from right, centre and left cliff sensor's normal floor level down to the floor."""
        self.wheels_hang: tuple[bool, bool] = (False, False)
        """Left, right."""

    def step(self, now_s: float, dt_s: float, targets_mps: tuple[float, float]) -> None:
        """Move on by dt_s with the wheels' speed loops aiming at targets (left, right)."""
        before = self.state
        left = self._motor(before.left_mps, targets_mps[0], dt_s)
        right = self._motor(before.right_mps, targets_mps[1], dt_s)
        left_travel = (before.left_mps + left) / 2 * dt_s
        right_travel = (before.right_mps + right) / 2 * dt_s
        if left_travel or right_travel or self.contacts or self._scene.alive:
            x, y, yaw = self._roll(before, left_travel, right_travel)
            x, y = self._push_out(x, y, yaw, before, dt_s)
        else:
            x, y, yaw = before.pose
        self.state = replace(
            before,
            x=x,
            y=y,
            yaw=yaw,
            left_m=before.left_m + (0.0 if _within(now_s, self._config.stuck_left) else left_travel),
            right_m=before.right_m + (0.0 if _within(now_s, self._config.stuck_right) else right_travel),
            left_mps=left,
            right_mps=right,
        )
        if not self._flat:
            self._feel_floor()

    def _motor(self, speed: float, target: float, dt_s: float) -> float:
        target = max(-MAX_WHEEL_MPS, min(MAX_WHEEL_MPS, target))
        change = (target - speed) * (1.0 - math.exp(-dt_s / self._config.motor_lag_s))
        limit = self._config.max_accel_mps2 * dt_s
        speed += max(-limit, min(limit, change))
        return target if abs(speed - target) < 1e-4 else speed

    def _roll(self, before: BodyState, left_travel: float, right_travel: float) -> Pose2:
        left = left_travel * self._left_scale * (1.0 - self._slipping(0, abs(left_travel)))
        right = right_travel * self._right_scale * (1.0 - self._slipping(1, abs(right_travel)))
        forward, turn = (left + right) / 2, (right - left) / self._track_m
        middle = before.yaw + turn / 2
        level = math.cos(before.pitch)
        return (
            before.x + forward * level * math.cos(middle),
            before.y + forward * level * math.sin(middle),
            before.yaw + turn,
        )

    def _slipping(self, wheel: int, travel_m: float) -> float:
        """Return the wheel's relative slip, an Ornstein-Uhlenbeck process over distance."""
        config = self._config
        keep = math.exp(-travel_m / config.slip_length_m)
        noise = config.slip_sigma * math.sqrt(1.0 - keep * keep) * float(self._rng.standard_normal())
        self._slip[wheel] = self._slip[wheel] * keep + noise
        return self._slip[wheel]

    def _push_out(
        self, x: float, y: float, yaw: float, before: BodyState, dt_s: float
    ) -> tuple[float, float]:
        """Slide along what is touched; stay when there is no way out."""
        touched = bool(self.contacts)
        for _ in range(3):
            self.contacts = self._scene.contacts((x, y, yaw), before.height_m)
            deepest = max(self.contacts, key=lambda contact: contact.depth_m, default=None)
            if deepest is None or deepest.depth_m <= 1e-5:
                break
            x += deepest.normal[0] * deepest.depth_m
            y += deepest.normal[1] * deepest.depth_m
        else:
            x, y = before.x, before.y  # wedged: the wheels spin
            self.contacts = self._scene.contacts((x, y, yaw), before.height_m)
        self.contact_count += bool(self.contacts) and not touched
        self.contact_s += dt_s if self.contacts else 0.0
        return x, y

    def _feel_floor(self) -> None:
        """Let height, pitch and roll follow the floor; feel cliffs and hanging wheels."""
        state = self.state
        cos, sin = math.cos(state.yaw), math.sin(state.yaw)
        places = (*CLIFF_SENSORS, (0.0, HALF_TRACK_M), (0.0, -HALF_TRACK_M), *CASTERS)
        start = state.height_m + 0.06  # above a step that a wheel could still climb
        points = [(state.x + cos * u - sin * v, state.y + sin * u + cos * v, start) for u, v in places]
        levels = [start - drop for drop in self._scene.floor_below(points)]
        left, right, front, back = levels[3:]
        tan_pitch = math.tan(state.pitch)
        expected = [state.height_m + tan_pitch * u for u, _ in CLIFF_SENSORS]
        drops = [level - floor for level, floor in zip(expected, levels[:3], strict=True)]
        self.floor_drops = (drops[0], drops[1], drops[2])
        leans = abs(left - right) < LEAN_M  # the body leans onto both wheels
        lowest = [
            state.height_m - (abs(left - right) / 2 if leans else 0.0) - level for level in (left, right)
        ]
        self.wheels_hang = (lowest[0] > WHEEL_TRAVEL_M, lowest[1] > WHEEL_TRAVEL_M)
        support = max((left + right) / 2 if leans else max(left, right), min(front, back))
        fall = max(support, state.height_m - 0.02)  # at most 2 m/s down at 100 steps a second
        pitch = 0.0
        if abs(front - back) < 0.25 * (CASTERS[0][0] - CASTERS[1][0]):
            pitch = math.atan2(front - back, CASTERS[0][0] - CASTERS[1][0])
        roll = math.atan2(left - right, 2 * HALF_TRACK_M) if leans else state.roll
        self.state = replace(state, height_m=fall, pitch=pitch, roll=roll)


def _within(now_s: float, window: tuple[float, float] | None) -> bool:
    return window is not None and window[0] <= now_s < window[1]
