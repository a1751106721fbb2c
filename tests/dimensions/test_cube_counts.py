"""Cube counts against closed forms and against placed grids."""

import numpy as np
import pytest

import fractalcontact as fc


def surface_of(heights, spacing=1e-3, periodic=False):
    return fc.surfaces.from_array(np.asarray(heights, float), spacing, periodic=periodic)


@pytest.fixture(scope="module")
def rough():
    return fc.surfaces.fbm((48, 40), (2e-3, 1e-3), hurst=0.6, rms_increment=1e-4, rng=1)


def test_flat_surface_counts_as_plane():
    result = fc.dimensions.cube_counts(surface_of(np.full((33, 33), 7.0), 1.0))
    np.testing.assert_allclose(result.cube_count, (32.0 / result.cube_size) ** 2, rtol=1e-12)
    np.testing.assert_allclose(result.local_slope, -2.0, rtol=1e-12)


def test_counts_equal_mean_over_grid_positions():
    """The mean over positions is the limit of counting cubes of grids at many positions."""
    rng = np.random.default_rng(7)
    heights = rng.standard_normal((13, 13))
    result = fc.dimensions.cube_counts(surface_of(heights, 1.0), vertical_scale=1.0)
    edge, shifts = 2, np.linspace(0, 2, 400, endpoint=False) + 1e-3
    counts = []
    for j in range(11):
        for i in range(11):
            window = heights[j : j + 3, i : i + 3]
            counts.append(
                [
                    np.floor((window.max() + s) / edge) - np.floor((window.min() + s) / edge) + 1
                    for s in shifts
                ]
            )
    at = float(result.cube_count.sel(cube_size=2.0))
    assert at == pytest.approx(np.mean(counts) * 144 / edge**2, rel=5e-3)


def test_vertical_scale_changes_counts(rough):
    natural = fc.dimensions.cube_counts(rough, vertical_scale=1.0)
    grown = fc.dimensions.cube_counts(rough, vertical_scale=1000.0)
    assert float(natural.local_slope[-2]) == pytest.approx(-2.0, abs=0.06)
    assert float(grown.local_slope[-2]) < -2.25
    ranged = fc.dimensions.cube_counts(rough)
    span = float(np.ptp(rough.values))
    extent = np.sqrt(47 * 2e-3 * 39 * 1e-3)
    assert float(ranged.vertical_scale) == pytest.approx(extent / span, rel=1e-12)
    np.testing.assert_array_equal(ranged.cube_count, fc.dimensions.cube_counts(rough * 4.0).cube_count)
