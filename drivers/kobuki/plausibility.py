"""Does this frame fit the one before it? The second line of defence behind an 8-bit XOR.

Two flipped bits in one column of a frame keep its XOR. Many such frames still show: the timestamp leaves the
20 ms grid, an encoder leaps, the heading moves without a rate, the running number of the gyro samples breaks.
A rule that a robot's firmware keeps breaking is silenced (it is then the rule that is wrong), and a frame
that fits the refused one before it instead of the accepted one is accepted: the world really did jump (lifted
robot, reset odometry).
"""

from dataclasses import dataclass

from lemtomap.drivers.kobuki.packets import RAW_GYRO_DPS_PER_DIGIT, Feedback

PERIOD_MS = 20  # protocol.rst
GRID_MS = 1  # published logs show exact multiples of the period


@dataclass(frozen=True, slots=True)
class PlausibilityConfig:
    """Limits between two frames."""

    max_wheel_ticks_per_ms: float = 12.0  # 1 m/s; the robot does 0.7, a lifted wheel a little more
    wheel_slack_ticks: int = 20
    max_wheel_change_ticks: int = 60  # 13 m/s2 from packet to packet; only a wall stops a wheel faster
    max_heading_cdeg: int = 50  # beside what the rates of both packets explain
    max_rate_gap_dps: float = 6.0  # heading rate against the raw gyro, plus half of the rate itself
    max_voltage_step_dv: int = 8  # starting motors pull 0.5 V
    max_spare_step: int = 64  # published logs: 4079, 4079, 4080
    longest_gap_ms: int = 1000  # over a longer one nothing is compared
    silence_after: int = 8
    """A rule that refused this many frames more than it passed (a pass counts 1/50) is silenced."""


class FrameGate:
    """Remembers the last accepted frame of one robot."""

    def __init__(self, config: PlausibilityConfig) -> None:
        self._config = config
        self._accepted: Feedback | None = None
        self._wheels: tuple[int, int, int] | None = None  # ticks left and right, ms, from frame to frame
        self._refused: Feedback | None = None
        self._strikes: dict[str, float] = {}
        self._rules = {
            "composition": _composition_differs,
            "timestamp": self._off_grid,
            "encoder": self._encoder_leaps,
            "heading": self._heading_leaps,
            "heading rate": self._rate_disagrees,
            "gyro count": self._gyro_count_breaks,
            "supply": self._voltage_leaps,
            "spare bytes": self._spare_bytes_change,
        }

    def restart(self) -> None:
        """Forget the last frame: the next one is compared with nothing."""
        self._accepted = self._refused = self._wheels = None

    def check(self, frame: Feedback) -> str | None:
        """Return why the frame cannot follow the last accepted one, or None and remember it."""
        before = self._accepted
        broken = self._broken_rule(before, frame, count=True)
        if broken is not None and self._refused is not None and not self._broken_rule(self._refused, frame):
            before, broken = self._refused, None
        if broken is None:
            self._wheels = None if before is None else _wheel_motion(before, frame)
            self._accepted, self._refused = frame, None
            return None
        self._refused = frame
        return f"{broken} does not fit the frame before"

    def _broken_rule(self, before: Feedback | None, frame: Feedback, *, count: bool = False) -> str | None:
        if before is None:
            return None
        elapsed_ms = (frame.basic.timestamp_ms - before.basic.timestamp_ms) & 0xFFFF
        if elapsed_ms > self._config.longest_gap_ms:
            return None  # the clock mapping judges the timestamp itself
        broken = None
        for name, rule in self._rules.items():
            strikes = self._strikes.get(name, 0.0)
            if strikes >= self._config.silence_after:
                continue
            breaks = rule(before, frame, elapsed_ms)
            if count:
                self._strikes[name] = strikes + 1.0 if breaks else max(0.0, strikes - 0.02)
            if breaks:
                broken = broken or name
        return broken

    def _off_grid(self, _before: Feedback, _frame: Feedback, elapsed_ms: int) -> bool:
        period, grid = PERIOD_MS, GRID_MS
        return elapsed_ms < period - grid or (elapsed_ms + grid) % period > 2 * grid

    def _encoder_leaps(self, before: Feedback, frame: Feedback, elapsed_ms: int) -> bool:
        left, right, _ = _wheel_motion(before, frame)
        limit = self._config.max_wheel_ticks_per_ms * elapsed_ms + self._config.wheel_slack_ticks
        if abs(left) > limit or abs(right) > limit:
            return True
        if self._wheels is None or before is not self._accepted or frame.basic.bumper:
            return False
        was_left, was_right, was_ms = self._wheels
        share = elapsed_ms / max(was_ms, 1)
        change = max(abs(left - share * was_left), abs(right - share * was_right))
        return change > self._config.max_wheel_change_ticks * max(1.0, elapsed_ms / PERIOD_MS)

    def _heading_leaps(self, before: Feedback, frame: Feedback, elapsed_ms: int) -> bool:
        a, b = before.inertial, frame.inertial
        if a is None or b is None:
            return False
        turn = (b.angle_cdeg - a.angle_cdeg + 18000) % 36000 - 18000
        fastest = max(abs(a.rate_cdegps), abs(b.rate_cdegps))
        periods = elapsed_ms / PERIOD_MS
        explained = 0.5 * (a.rate_cdegps + b.rate_cdegps) * elapsed_ms * 1e-3
        slack = self._config.max_heading_cdeg * periods + 0.5 * fastest * elapsed_ms * 1e-3
        return abs(turn - explained) > slack

    def _rate_disagrees(self, _before: Feedback, frame: Feedback, _elapsed_ms: int) -> bool:
        if frame.inertial is None or frame.raw_gyro is None or not frame.raw_gyro.samples:
            return False
        rate = 0.01 * frame.inertial.rate_cdegps
        limit = self._config.max_rate_gap_dps + 0.5 * abs(rate)
        return all(abs(RAW_GYRO_DPS_PER_DIGIT * z - rate) > limit for _, _, z in frame.raw_gyro.samples)

    def _gyro_count_breaks(self, before: Feedback, frame: Feedback, elapsed_ms: int) -> bool:
        if before.raw_gyro is None or frame.raw_gyro is None or elapsed_ms > PERIOD_MS + GRID_MS:
            return False
        expected = before.raw_gyro.frame_id + len(before.raw_gyro.samples)
        return (frame.raw_gyro.frame_id - expected) & 0xFF != 0

    def _voltage_leaps(self, before: Feedback, frame: Feedback, _elapsed_ms: int) -> bool:
        return abs(frame.basic.battery_dv - before.basic.battery_dv) > self._config.max_voltage_step_dv

    def _spare_bytes_change(self, before: Feedback, frame: Feedback, _elapsed_ms: int) -> bool:
        """Bytes without meaning stay as they are."""
        if before.inertial and frame.inertial and before.inertial.unused != frame.inertial.unused:
            return True
        if before.inputs is None or frame.inputs is None:
            return False
        (was, *others), (now, *now_others) = before.inputs.spare, frame.inputs.spare
        return others != now_others or abs(now - was) > self._config.max_spare_step


_STREAMED = ("docking_ir", "inertial", "cliff_adc", "current", "raw_gyro", "inputs")


def _composition_differs(before: Feedback, frame: Feedback, _elapsed_ms: int) -> bool:
    """Parts that stream always are there or not, from frame to frame alike; ids nobody knows do not come and
    go.
    """
    if any((getattr(before, name) is None) != (getattr(frame, name) is None) for name in _STREAMED):
        return True
    return [number for number, _ in before.unknown] != [number for number, _ in frame.unknown]


def _wheel_motion(before: Feedback, frame: Feedback) -> tuple[int, int, int]:
    """Return ticks left and right and ms between two frames, all unwrapped."""
    a, b = before.basic, frame.basic
    left = (b.left_ticks - a.left_ticks + 0x8000) % 0x10000 - 0x8000
    right = (b.right_ticks - a.right_ticks + 0x8000) % 0x10000 - 0x8000
    return left, right, (b.timestamp_ms - a.timestamp_ms) & 0xFFFF
