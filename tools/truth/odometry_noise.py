"""How wrong is wheel and gyro odometry? Random drives of many simulated robots, no two alike.

    python -m tools.truth.odometry_noise [--robots 24] [--seconds 150]

Every robot stands for 10 s, then drives arcs at random on an open floor. The squared errors of windows of
2 to 30 s are fitted by the terms of `MotionNoise` (non-negative least squares). Consistency is the mean of
error' * inverse covariance * error over 3, which is 1 for an honest covariance.
"""

import argparse
import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from lemtomap import se2
from lemtomap.drivers.kobuki.events import KobukiSample
from lemtomap.drivers.kobuki.session import KobukiSession
from lemtomap.odometry import OdometryBuffer, WheelGyroOdometry
from lemtomap.sim import worlds
from lemtomap.sim.simulator import Simulator
from lemtomap.types import Odometry

STEP_S = 0.005
PACKET_S = 0.02
GYRO_WANDER = 0.0005  # rad per root s, data sheet: hidden under the gyro's scale whenever the robot turns
WINDOWS_S = (2.0, 5.0, 12.0, 30.0)


@dataclass(frozen=True, slots=True)
class MotionNoise:
    """How fast odometry's covariance grows. Defaults: measured over 12 simulated robots."""

    along_m_per_m: float = 0.007
    """Standard deviation along the path for each metre: a wheel's radius is wrong everywhere alike."""
    along_m_per_sqrt_m: float = 0.0065
    """The same of slip, which forgets itself: grows with the square root of the distance."""
    across_m_per_sqrt_m: float = 0.004
    yaw_rad_per_rad: float = 0.007
    """The gyro's scale."""
    yaw_rad_per_sqrt_s: float = 0.0005
    """The gyro's wander, standing or not: 0.03 deg/s per root Hz (data sheet)."""

    def covariance(self, distance_m: float, turn_rad: float, elapsed_s: float) -> NDArray[np.float64]:
        """Return float64 (3, 3) of a nearly straight motion: along and across it in m, yaw in rad."""
        d = abs(distance_m)
        yaw = (self.yaw_rad_per_rad * turn_rad) ** 2 + self.yaw_rad_per_sqrt_s**2 * max(0.0, elapsed_s)
        along = (self.along_m_per_m * d) ** 2 + self.along_m_per_sqrt_m**2 * d
        across = self.across_m_per_sqrt_m**2 * d + yaw * d * d / 3.0  # heading wanders while driving
        return np.array([[along, 0.0, 0.0], [0.0, across, yaw * d / 2.0], [0.0, yaw * d / 2.0, yaw]])


def drive(seed: int, seconds: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return odometry and truth at the time of every packet, float64 (N, 3) each."""
    world = dataclasses.replace(worlds.load("office"), boxes=(), movers=(), dock=None, spawn=(0.0, 0.0, 0.0))
    simulator, session, odometry = Simulator(world, seed=seed), KobukiSession(), WheelGyroOdometry()
    rng = np.random.default_rng(seed)
    estimates: list[Odometry] = []
    truths = OdometryBuffer(round(seconds / STEP_S) + 1)
    v_mps = w_radps = 0.0
    for step in range(round(seconds / STEP_S)):
        now_s = (step + 1) * STEP_S
        simulator.advance(now_s)
        truths.add(Odometry(now_s, simulator.truth().T_world_base))
        if now_s > 10.0 and step % round(3.0 / STEP_S) == 0:
            v_mps = float(rng.choice([0.0, 0.2, 0.3, 0.5]))
            w_radps = float(rng.choice([0.0, 0.0, rng.uniform(-1.2, 1.2)]))
        for event in session.receive(simulator.kobuki.read(), now_s):
            if isinstance(event, KobukiSample):
                ticks = (event.left_ticks, event.right_ticks)
                estimates.append(
                    odometry.update(event.stamp_s, *ticks, event.gyro_yaw_rad, event.gyro_rate_radps)
                )
        simulator.kobuki.write(session.tick(now_s) + session.drive(v_mps, w_radps))
    simulator.close()
    poses = np.array([estimate.T_odom_base for estimate in estimates])[5:-5]
    stamps = np.array([estimate.stamp_s for estimate in estimates])[5:-5]
    return poses, truths.at(stamps - _lag_s(stamps, poses, truths))


def _lag_s(stamps: NDArray[np.float64], poses: NDArray[np.float64], truths: OdometryBuffer) -> float:
    """Return the constant error of the stamps (steps of 5 ms hide up to one): no matter of odometry."""
    turned = np.diff(poses[:, 2])

    def mismatch(lag_s: float) -> float:
        return float(np.square(se2.wrap_angle(turned - np.diff(truths.at(stamps - lag_s)[:, 2]))).sum())

    return min(np.arange(-0.02, 0.02, 0.001), key=mismatch)


def windows(estimate: NDArray[np.float64], truth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return rows of distance m, turn rad, time s, error along m, across m, yaw rad of disjoint windows."""
    rows = []
    for window_s in WINDOWS_S:
        size = round(window_s / PACKET_S)
        for start in range(600, len(estimate) - size, size):
            end = start + size
            motion = np.diff(truth[start : end + 1], axis=0)
            distance_m = float(np.hypot(motion[:, 0], motion[:, 1]).sum())
            turn_rad = float(se2.wrap_angle(motion[:, 2]).sum())
            error = se2.between(
                se2.between(truth[start], truth[end]), se2.between(estimate[start], estimate[end])
            )
            chord = se2.between(truth[start], truth[end])
            heading = math.atan2(chord[1], chord[0]) - chord[2]  # errors along and across the way gone
            along = error[0] * math.cos(heading) + error[1] * math.sin(heading)
            across = -error[0] * math.sin(heading) + error[1] * math.cos(heading)
            rows.append((distance_m, turn_rad, window_s, along, across, float(error[2])))
    return np.array(rows)


def fit(rows: NDArray[np.float64]) -> MotionNoise:
    """Return the noise whose variances come nearest to the squared errors."""
    d, turn, t, along, across, yaw = rows.T
    straight = np.abs(turn) < 0.5
    weight = 1.0 / (0.05 + d[straight])
    line, _ = nnls(np.stack([d**2, d], 1)[straight] * weight[:, None], along[straight] ** 2 * weight)
    weight = 1.0 / (0.5 + np.abs(turn) + 0.1 * t)
    spin, _ = nnls(np.stack([turn**2, t], 1) * weight[:, None], yaw**2 * weight)
    spin[1] = max(spin[1], GYRO_WANDER**2)
    yaw_part = (spin[0] * turn**2 + spin[1] * t) * d**2 / 3.0
    rest = np.maximum(0.0, across**2 - yaw_part)[straight]
    side, _ = nnls(d[straight, None], rest)
    return MotionNoise(*np.sqrt([line[0], line[1], side[0], spin[0], spin[1]]).tolist())


def consistency(rows: NDArray[np.float64], noise: MotionNoise) -> float:
    """Return the mean normalised squared error of nearly straight windows; 1 is honest."""
    straight = (np.abs(rows[:, 1]) < 0.5) & (rows[:, 0] > 0.2)
    total = [
        row[3:] @ np.linalg.solve(noise.covariance(row[0], row[1], row[2]), row[3:]) / 3.0
        for row in rows[straight]
    ]
    return float(np.mean(total))


def main() -> None:
    """Drive, fit, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robots", type=int, default=24)
    parser.add_argument("--seconds", type=float, default=150.0)
    options = parser.parse_args()
    rows = np.concatenate([windows(*drive(seed, options.seconds)) for seed in range(options.robots)])
    noise = fit(rows)
    for name, value in dataclasses.asdict(noise).items():
        print(f"{name} = {value:.5f}")
    honest = (consistency(rows, noise), consistency(rows, MotionNoise()))
    print(f"consistency: this fit {honest[0]:.2f}, the defaults {honest[1]:.2f}")
    for window_s in WINDOWS_S:
        part = rows[rows[:, 2] == window_s]
        spread = np.sqrt((part[:, 3:] ** 2).mean(axis=0))
        print(
            f"{window_s:4.0f} s, {part[:, 0].mean():5.2f} m, {np.abs(part[:, 1]).mean():5.2f} rad: "
            f"{1000 * spread[0]:.0f} mm along, {1000 * spread[1]:.0f} across, {np.degrees(spread[2]):.2f} deg"
        )


if __name__ == "__main__":
    main()
