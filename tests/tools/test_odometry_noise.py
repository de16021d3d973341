"""The fit of the odometry's noise."""

import numpy as np

from tools.truth.odometry_noise import MotionNoise


def test_covariance_grows_with_every_kind_of_motion_and_stays_a_covariance():
    noise = MotionNoise()
    for motion in [(1.0, 0.0, 3.0), (0.0, 2.0, 4.0), (0.0, 0.0, 60.0), (3.0, 1.0, 9.0)]:
        small, large = noise.covariance(*motion), noise.covariance(*(2 * part for part in motion))
        assert np.all(np.linalg.eigvalsh(small) >= 0)
        assert np.trace(large) > np.trace(small)
