"""Weights, effective number and resampling of particles (algorithm E-4, lines 32 to 36)."""

import numpy as np
from numpy.typing import NDArray


def normalised(log_weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return weights that sum to 1, float64 (N,)."""
    weights = np.exp(log_weights - log_weights.max())
    return np.asarray(weights / weights.sum())


def effective_number(weights: NDArray[np.float64]) -> float:
    """Return N_eff of normalised weights: N when all are equal, 1 when one has all."""
    return float(1.0 / np.sum(weights**2))


def resample(weights: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.int64]:
    """Return the index of the parent of each new particle, sorted, low variance: one draw for all."""
    count = len(weights)
    pointers = (rng.random() + np.arange(count)) / count
    edges = np.cumsum(weights)
    edges[-1] = 1.0
    return np.searchsorted(edges, pointers, side="right").astype(np.int64)
