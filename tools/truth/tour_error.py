"""How far an estimate is from the truth of a simulated tour, beside plain odometry.

python -m lemtomap.sim.carmen loop tour.log 240 1
lemtomap map tour.log --out out/tour
python -m tools.truth.tour_error tour.log out/tour/trajectory.tum
"""

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def truth_and_odometry(log: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the true and the dead-reckoned places of a log's TRUEPOS lines, float64 (N, 2) each."""
    fields = [line.split() for line in log.read_text().splitlines() if line.startswith("TRUEPOS")]
    numbers = np.array([row[1:7] for row in fields], dtype=np.float64)
    return numbers[:, 0:2], numbers[:, 3:5]


def error_m(estimate: NDArray[np.float64], truth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distances left when the estimate is turned and moved onto the truth, float64 (N,)."""
    middle, true_middle = estimate.mean(axis=0), truth.mean(axis=0)
    u, _, v = np.linalg.svd((estimate - middle).T @ (truth - true_middle))
    turn = (u @ np.diag([1.0, np.linalg.det(u @ v)]) @ v).T
    return np.asarray(np.hypot(*((estimate - middle) @ turn.T + true_middle - truth).T))


def main(arguments: list[str]) -> int:
    """Print both errors."""
    if len(arguments) != 2:
        print(__doc__)
        return 2
    truth, odometry = truth_and_odometry(Path(arguments[0]))
    estimate = np.loadtxt(arguments[1])[:, 1:3]
    if len(estimate) != len(truth):
        print(f"{arguments[1]}: {len(estimate)} poses, the log has {len(truth)} scans")
        return 2
    for name, track in (("estimate", estimate), ("odometry", odometry)):
        error = error_m(track, truth)
        print(f"{name}: root mean square {np.sqrt((error**2).mean()):.3f} m, largest {error.max():.3f} m")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
