"""From the scan a sensor sent to ranges in metres."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.drivers.hokuyo.commands import ScanRequest
from lemtomap.drivers.hokuyo.events import LaserScan
from lemtomap.drivers.hokuyo.packets import ScanFrame, SensorParameters

_FAR_SENSOR_MM = 20000  # UTM-30LX and its kin: code 1 = nothing (hokuyo_node); URG-04LX: code 0


@dataclass(frozen=True, slots=True)
class View:
    """The part of the turn that is wanted."""

    angle_min_rad: float | None = None
    """None: as far as the sensor sees."""
    angle_max_rad: float | None = None
    cluster: int = 1
    """Beams joined to one, the nearest."""
    skip: int = 0
    """Scans left out between two."""
    count: int = 0
    """Scans in a run, 1 to 99, after which a new one is started; 0 = one endless run."""

    def __post_init__(self) -> None:
        limits = (("cluster", 1, 99), ("skip", 0, 9), ("count", 0, 99))
        for name, low, high in limits:
            if not low <= getattr(self, name) <= high:
                raise ValueError(f"{name} is {getattr(self, name)}, must lie between {low} and {high}")
        low_rad, high_rad = self.angle_min_rad, self.angle_max_rad
        if low_rad is not None and high_rad is not None and not low_rad < high_rad:
            raise ValueError(f"angle_min {low_rad} rad must lie below angle_max {high_rad} rad")

    def request(self, sensor: SensorParameters) -> ScanRequest:
        """Return the steps to ask for. Raises ValueError when the sensor sees nothing of the wanted part."""
        start, end = sensor.first_step, sensor.last_step
        if self.angle_min_rad is not None:
            start = max(start, math.ceil(self.angle_min_rad / sensor.step_rad + sensor.front_step - 1e-9))
        if self.angle_max_rad is not None:
            end = min(end, math.floor(self.angle_max_rad / sensor.step_rad + sensor.front_step + 1e-9))
        if end < start:
            raise ValueError(f"the sensor sees nothing of {self.angle_min_rad} to {self.angle_max_rad} rad")
        return ScanRequest(start, end, self.cluster, self.skip, self.count)


class ScanMaker:
    """Turns the frames of one request to one sensor into scans."""

    def __init__(self, sensor: SensorParameters, request: ScanRequest) -> None:
        self.sensor = sensor
        self.request = request
        first_beam = request.start + 0.5 * (request.cluster - 1)  # the middle of a cluster stands for it
        step_s = sensor.period_s / sensor.steps_per_turn
        self._first_beam_s = first_beam * step_s
        self._time_step_s = request.cluster * step_s
        self._angle_min_rad = (first_beam - sensor.front_step) * sensor.step_rad
        self._angle_step_rad = request.cluster * sensor.step_rad
        self._nothing_code = 1 if sensor.max_mm > _FAR_SENSOR_MM else 0
        self.period_s = sensor.period_s * (request.skip + 1)

    def answers_request(self, frame: ScanFrame) -> bool:
        """Return True if the frame is what was asked for."""
        r = self.request
        asked = (f"M{r.encoding}", r.start, r.end, r.cluster, r.skip)
        return (frame.command[:2], frame.start, frame.end, frame.cluster, frame.interval) == asked

    def make(self, frame: ScanFrame, step0_s: float, arrival_s: float, missed: int) -> LaserScan:
        """Return the scan whose step 0 was passed at `step0_s`."""
        return LaserScan(
            stamp_s=step0_s + self._first_beam_s,
            arrival_s=arrival_s,
            device_ms=frame.stamp_ms,
            ranges_m=self._ranges(frame),
            raw_mm=frame.raw_mm,
            angle_min_rad=self._angle_min_rad,
            angle_step_rad=self._angle_step_rad,
            time_step_s=self._time_step_s,
            range_min_m=self.sensor.min_mm / 1000.0,
            range_max_m=self.sensor.max_mm / 1000.0,
            complete=frame.intact,
            missed=missed,
        )

    def _ranges(self, frame: ScanFrame) -> NDArray[np.float32]:
        raw = frame.raw_mm
        ranges = raw.astype(np.float32)
        ranges *= np.float32(1e-3)
        ranges[(raw < self.sensor.min_mm) | (raw > self.sensor.max_mm)] = np.nan
        ranges[raw == self._nothing_code] = np.inf
        if frame.valid is not None:
            ranges[~frame.valid] = np.nan
        ranges.setflags(write=False)
        return ranges
