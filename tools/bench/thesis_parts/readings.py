"""Readings of the subsystems over a drive: CPU time, CPU load, memory, each part alone and all together."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

LOAD_S = 15.0  # of the drive, over which a load is averaged
SECONDS, CPU, MEMORY = 0, 1, 2


@dataclass(frozen=True, slots=True)
class Curve:
    """One subsystem or one system over the drive, float64 (N,) each, on common times."""

    drive_s: NDArray[np.float64]
    cpu_s: NDArray[np.float64]
    memory_mb: NDArray[np.float64]
    """Resident, beyond what the process held before it began to work."""
    start_mb: float
    """What the processes held then: interpreter, libraries, compiled kernels."""

    @property
    def load_percent(self) -> NDArray[np.float64]:
        """CPU load at real-time speed, percent of one core."""
        window = LOAD_S / 2.0
        ahead, behind = (np.interp(self.drive_s + by, self.drive_s, self.cpu_s) for by in (window, -window))
        lengths = np.minimum(self.drive_s + window, self.drive_s[-1]) - np.maximum(self.drive_s - window, 0.0)
        return np.asarray(100.0 * (ahead - behind) / np.maximum(lengths, 1e-9))

    def last_third(self) -> NDArray[np.bool_]:
        """Return which readings belong to the end of the drive."""
        return np.asarray(self.drive_s >= self.drive_s[-1] * 2.0 / 3.0)

    def memory_slope_mb_per_h(self) -> float:
        """Return how memory grows at the end of the drive."""
        late = self.last_third()
        return float(np.polyfit(self.drive_s[late] / 3600.0, self.memory_mb[late], 1)[0])

    def load_growth(self) -> float:
        """Return the mean load of the drive's last third over that of its middle third."""
        thirds = np.interp(np.array([1, 2, 3]) / 3.0 * self.drive_s[-1], self.drive_s, self.cpu_s)
        return float((thirds[2] - thirds[1]) / max(thirds[1] - thirds[0], 1e-9))


def curve_of(told: dict[str, Any]) -> Curve:
    """Return the readings of one part of one run."""
    rows = np.array(told["rows"], dtype=np.float64)
    return Curve(rows[:, SECONDS], rows[:, CPU], rows[:, MEMORY] - told["start_mb"], float(told["start_mb"]))


def mean_of(curves: Sequence[Curve]) -> Curve:
    """Return the mean over repetitions."""
    return _joined(curves, 1.0 / len(curves))


def sum_of(curves: Sequence[Curve]) -> Curve:
    """Return the sum over subsystems."""
    return _joined(curves, 1.0)


def _joined(curves: Sequence[Curve], weight: float) -> Curve:
    at = curves[0].drive_s
    cpu_s = weight * sum(np.interp(at, each.drive_s, each.cpu_s) for each in curves)
    memory_mb = weight * sum(np.interp(at, each.drive_s, each.memory_mb) for each in curves)
    return Curve(at, np.asarray(cpu_s), np.asarray(memory_mb), weight * sum(each.start_mb for each in curves))


def _closures(run: dict[str, Any]) -> int:
    return sum(told["edges"]["loop_closing"] for told in run["parts"].values() if "edges" in told)


@dataclass(frozen=True, slots=True)
class SystemReadings:
    """What one system took on one drive, the mean of its repetitions."""

    parts: dict[str, Curve]
    total: Curve
    cpu_s: list[float]
    """Total CPU of each repetition."""
    disk_kb: float
    local_m: float
    whole_m: float
    """Error of its track against the truth (drives.local_and_whole_error_m)."""
    closures: int
    wrong_closures: int
    """Over all repetitions; the baseline has none."""

    @classmethod
    def of(cls, runs: Sequence[dict[str, Any]]) -> "SystemReadings":
        """Average runs as `chain.map_drive` tells them, with their track errors added."""
        names = list(runs[0]["parts"])
        parts = {name: mean_of([curve_of(run["parts"][name]) for run in runs]) for name in names}
        cpu_s = [sum(curve_of(told).cpu_s[-1] for told in run["parts"].values()) for run in runs]
        return cls(
            parts,
            sum_of(list(parts.values())),
            [float(value) for value in cpu_s],
            float(np.mean([run["map_bytes"] for run in runs])) / 1000.0,
            float(np.mean([run["local_m"] for run in runs])),
            float(np.mean([run["whole_m"] for run in runs])),
            sum(_closures(run) for run in runs),
            sum(run["wrong_closures"] for run in runs),
        )
