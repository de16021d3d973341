import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
CODE = """
import hashlib
import numpy as np
from lemtomap.grid import RollingGmapping, SlamConfig
from tests.lemtomap.grid.test_slam import LOOP, ROOM, drive
slam = RollingGmapping(SlamConfig(), 1)
poses = [slam.update(scan, odometry).T_grid_base for _, odometry, scan in drive(LOOP[:200], ROOM, seed=2)]
parts = (np.array(poses), slam.view().occupancy, slam.particles())
print(hashlib.sha256(b"".join(part.tobytes() for part in parts)).hexdigest())
"""


def digest(threads: int) -> str:
    environment = {**os.environ, "NUMBA_NUM_THREADS": str(threads), "PYTHONPATH": str(ROOT)}
    done = subprocess.run(  # noqa: S603
        [sys.executable, "-c", CODE], env=environment, cwd=ROOT, capture_output=True, text=True, check=True
    )
    return done.stdout


@pytest.mark.skipif(os.cpu_count() == 1, reason="this machine can run one thread only")
def test_the_number_of_threads_does_not_change_a_byte():
    assert digest(1) == digest(2)
