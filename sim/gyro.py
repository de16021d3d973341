"""The L3G4200D on Kobuki's board: raw samples at about 104 Hz, and the heading the firmware integrates."""

import math
from dataclasses import dataclass

import numpy as np

from lemtomap.sim.body import BodyState

DPS_PER_DIGIT = 0.00875  # +-250 deg/s range (section 3.7)
SAMPLE_HZ = 104.0  # measured on a real robot (section 16, #367)


@dataclass(frozen=True, slots=True)
class GyroConfig:
    """How imperfect this one gyro is; sigmas are drawn once per seed."""

    scale_sigma: float = 0.006
    """Relative error of the rate: about 2 degrees per turn."""
    bias_sigma_dps: float = 0.008
    """What the firmware's calibration leaves: half a degree a minute; a couple at worst (section 16)."""
    noise_dps: float = 0.15
    """Rate noise of one sample: 0.03 dps per root Hz (data sheet) over about 25 Hz."""
    raw_offset_sigma_dps: float = 0.6
    """Zero-rate level of the raw samples, which nothing compensates."""


class Gyro:
    """Collects turning between packets."""

    def __init__(self, config: GyroConfig, rng: np.random.Generator) -> None:
        self._rng = rng
        self._noise_dps = config.noise_dps
        draw = rng.standard_normal(6)
        self._scale = 1.0 + config.scale_sigma * float(draw[0])
        self._bias_dps = config.bias_sigma_dps * float(draw[1])
        self._offset_dps = [config.raw_offset_sigma_dps * float(value) for value in draw[2:5]]
        self._heading_deg = 40.0 * float(draw[5])
        self._due = 0.0
        self._rates_dps: list[tuple[float, float, float]] = []
        self.frame = 0
        """Number of the next packet's first sample."""
        self.rate_dps = 0.0

    def tick(self, before: BodyState, after: BodyState, dt_s: float) -> None:
        """Feel the turning of one physics step."""
        to_dps = 180.0 / math.pi / dt_s
        self._rates_dps.append(
            (
                (after.roll - before.roll) * to_dps,
                (before.pitch - after.pitch) * to_dps,
                (after.yaw - before.yaw) * to_dps,
            )
        )

    def sample(self, period_s: float) -> tuple[tuple[int, int, int], ...]:
        """Return the raw samples x, y, z of one packet (two, now and then three) and turn the heading on."""
        self._due += SAMPLE_HZ * period_s
        count = int(self._due)
        self._due -= count
        rates = self._rates_dps or [(0.0, 0.0, 0.0)]
        noise = self._rng.standard_normal((count, 3)) * self._noise_dps
        samples = []
        total_dps = 0.0
        for index in range(count):
            wx, wy, wz = rates[index * len(rates) // count]
            z_noise = float(noise[index, 2])
            total_dps += wz * self._scale + self._bias_dps + z_noise
            samples.append(
                (
                    round((wy + self._offset_dps[1] + float(noise[index, 1])) / DPS_PER_DIGIT),
                    round(-(wx + self._offset_dps[0] + float(noise[index, 0])) / DPS_PER_DIGIT),
                    round((wz * self._scale + self._offset_dps[2] + z_noise) / DPS_PER_DIGIT),
                )
            )
        self.rate_dps = total_dps / max(count, 1)
        mean_dps = sum(rate[2] for rate in rates) / len(rates)
        noise_dps = float(noise[:, 2].mean()) if count else 0.0
        self._heading_deg += (mean_dps * self._scale + self._bias_dps + noise_dps) * period_s
        self._rates_dps.clear()
        return tuple(samples)

    @property
    def heading_cdeg(self) -> int:
        """Heading as sent: -18000..18000 hundredths of a degree."""
        wrapped = (self._heading_deg + 180.0) % 360.0 - 180.0
        return round(wrapped * 100.0)
