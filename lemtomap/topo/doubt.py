"""How surely the window knows where the robot is."""

import numpy as np

from lemtomap.se2 import adjoint
from lemtomap.topo.graph import Covariance
from lemtomap.types import SlamUpdate

COVARIANCE_FLOOR = np.diag([0.002**2, 0.002**2, np.deg2rad(0.1) ** 2])
"""No relation between two places is known better: a tenth of a grid cell's quantisation noise."""
NOWHERE = np.diag([1e6, 1e6, 1e3])
"""Of the first scan's place against the scan before: none, or one from where the robot was carried away."""


def relative_to_window(slam: SlamUpdate) -> Covariance:
    """Return the covariance of T_grid_base relative to the window, axes of base."""
    turn = adjoint(np.array([0.0, 0.0, -float(slam.T_grid_base[2])]))
    return np.asarray(turn @ slam.covariance @ turn.T) + COVARIANCE_FLOOR
