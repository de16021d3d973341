"""Thinning by a raster is thinning by sorting, only faster."""

import numpy as np
import pytest

from lemtomap.topo import cells


@pytest.fixture
def points():
    rng = np.random.default_rng(2)
    return rng.uniform(-7.0, 5.0, (2000, 2))


@pytest.mark.parametrize("by_cell", [False, True])
def test_a_raster_finds_the_same_first_points_as_sorting(points, monkeypatch, by_cell):
    at = np.floor(points / 0.5).astype(np.int64)
    by_raster = cells.first_of(at, by_cell=by_cell)
    monkeypatch.setattr(cells, "MOST_CELLS", 0)
    assert by_raster.tolist() == cells.first_of(at, by_cell=by_cell).tolist()


def test_a_raster_averages_to_the_last_bit_like_sorting(points, monkeypatch):
    by_raster = cells.averaged(points, 0.5)
    monkeypatch.setattr(cells, "MOST_CELLS", 0)
    assert np.array_equal(by_raster, cells.averaged(points, 0.5))


def test_no_points_stay_none():
    assert len(cells.averaged(np.zeros((0, 2)), 0.5)) == 0
    assert len(cells.thinned(np.zeros((0, 2)), 0.5)) == 0
