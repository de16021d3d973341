"""What a URG-04LX's electronics make of the light that comes back.

The range error follows the data sheet (+-30 mm to 1 m, +-3 % above, taken as three standard deviations) and
is split: what is new every time is as small as on the walls of a real log (exp1.dat: 3.5 mm at 0.75 m, 6.5 mm
at 2 m), the rest stays with the surface (its colour shifts the phase measurement) and varies smoothly.
What returns nothing is decided by light: albedo, angle of incidence and distance.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.sim.world import ALBEDO, Surface

NOTHING, WEAK, OTHER, NEIGHBOUR, TWO_WAVES = 0, 1, 6, 7, 8
"""Error codes (hokuyo-scip, section 7.1)."""
MIN_MM = 20


@dataclass(frozen=True, slots=True)
class OpticsConfig:
    """How good the sensor is."""

    max_m: float = 5.6
    """DMAX of the sensor."""
    reach_m: float = 5.2
    """How far a white wall, square to the beam, still gives an answer. Light falls with the fourth power: in
    exp1.dat the farthest answers shrink only from 4.6 m (square) to 3.5 m (75 degrees off)."""
    near_sigma_m: float = 0.010
    """A third of +-30 mm."""
    far_sigma: float = 0.010
    """A third of +-3 %."""
    repeat_m: float = 0.0025
    repeat_share: float = 0.002
    """Standard deviation of what is new every time: repeat_m + repeat_share * range (fitted to exp1.dat)."""
    colour_m: float = 1.0
    """Length over which a surface's own error changes."""
    patch_m: float = 0.25
    albedo_spread: float = 0.6
    """Paint differs: a patch gives back between (1 - spread) and 1 of its surface's albedo."""
    footprint_m: float = 0.15
    """A jump in range between two neighbours beyond this is an edge, where one beam meets two surfaces."""
    edge_mixed: float = 0.15
    """Chance that an edge beam gives a value in between."""
    edge_error: float = 0.15
    """Chance that an edge beam and its neighbour give an error code."""


@dataclass(frozen=True, slots=True)
class BeamHits:
    """What N beams met."""

    range_m: NDArray[np.float64]
    """float64 (N,), +inf nothing within reach."""
    cos: NDArray[np.float64]
    """float64 (N,), cosine of the angle of incidence."""
    albedo: NDArray[np.float64]
    points: NDArray[np.float64]
    """float64 (N, 2), metres, where each beam ends, world frame."""


def measure(light: BeamHits, config: OpticsConfig, rng: np.random.Generator) -> NDArray[np.int64]:
    """Return int64 (N,), mm or error codes."""
    hit = np.isfinite(light.range_m)
    distance = np.where(hit, light.range_m, config.max_m)
    total = np.maximum(config.near_sigma_m, config.far_sigma * distance)
    fresh = config.repeat_m + config.repeat_share * distance
    lasting = np.sqrt(np.maximum(total**2 - fresh**2, 0.0))
    colour = _smooth_normal(light.points / config.colour_m)
    error = lasting * colour + fresh * rng.standard_normal(len(distance))
    values = np.rint((distance + error) * 1000.0).astype(np.int64)
    _spoil_edges(values, distance, config, rng)
    paint = 1.0 - config.albedo_spread * _uniform(np.floor(light.points / config.patch_m).astype(np.int64))
    needed = ALBEDO[Surface.WALL] * (distance / config.reach_m) ** 4
    weak = light.albedo * paint * light.cos < needed * (0.9 + 0.2 * rng.random(len(distance)))
    values[values < MIN_MM] = np.maximum(values[values < MIN_MM], WEAK)
    values[values > round(config.max_m * 1000)] = NOTHING
    lost = ~hit | weak
    values[lost] = _codes(int(lost.sum()), rng)
    return values


def _spoil_edges(
    values: NDArray[np.int64], distance: NDArray[np.float64], config: OpticsConfig, rng: np.random.Generator
) -> None:
    jump = np.flatnonzero(np.abs(np.diff(distance)) > config.footprint_m)
    chance, share = rng.random(len(jump)), rng.random(len(jump))
    is_mixed = chance < config.edge_mixed
    mixed = jump[is_mixed]
    between = distance[mixed] + share[is_mixed] * (distance[mixed + 1] - distance[mixed])
    values[mixed] = np.rint(between * 1000.0)
    failed = jump[chance > 1.0 - config.edge_error]
    code = rng.choice([NEIGHBOUR, OTHER, TWO_WAVES], size=len(failed), p=[0.6, 0.35, 0.05])
    values[failed] = values[failed + 1] = code


def _codes(count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Return error codes in the shares of exp1.dat: nearly all 0."""
    table = np.array([NOTHING, OTHER, NEIGHBOUR, WEAK])
    return np.asarray(table[np.searchsorted([0.955, 0.97, 0.995], rng.random(count))])


def _smooth_normal(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return fixed noise of unit variance, float64 (N,) from (N, 2), smooth between whole numbers."""
    corner = np.floor(places).astype(np.int64)
    u, v = (places - corner).T
    low = (1 - u) * _uniform(corner) + u * _uniform(corner + np.array([1, 0]))
    high = (1 - u) * _uniform(corner + np.array([0, 1])) + u * _uniform(corner + np.array([1, 1]))
    # uniform noise has variance 1/12, mixing four corners leaves 4/9 of it on average
    return np.asarray(((1 - v) * low + v * high - 0.5) * np.sqrt(12.0 * 9.0 / 4.0))


def _uniform(cells: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return a fixed pseudo-random number in [0, 1) for each cell, float64 (N,) from int64 (N, 2)."""
    mixed = (cells[:, 0] * 73_856_093) ^ (cells[:, 1] * 19_349_663)
    mixed = (mixed & 0x7FFFFFFF) * 48_271 % 2_147_483_647
    mixed = (mixed ^ (mixed >> 15)) * 48_271 % 2_147_483_647
    return np.asarray(mixed / 2_147_483_647.0)
