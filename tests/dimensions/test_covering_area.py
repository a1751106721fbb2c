"""Area of the triangulated surface against closed forms."""

import numpy as np
import pytest

import fractalcontact as fc


def surface_of(heights, spacing=1e-3, periodic=False):
    return fc.surfaces.from_array(np.asarray(heights, float), spacing, periodic=periodic)


def test_planes_are_exact():
    flat = fc.dimensions.covering(surface_of(np.full((20, 20), 3.0)))
    assert (flat.covering_area == 400e-6).all()
    assert (flat.local_slope == 0.0).all()
    y = np.arange(20) * 1e-3
    tilted = fc.dimensions.covering(surface_of(np.add.outer(0.75 * y, y)))
    np.testing.assert_allclose(tilted.covering_area, 400e-6 * np.sqrt(1 + 0.75**2 + 1), rtol=1e-12)


def test_ridges_one_spacing_wide():
    """Ridges one spacing wide: all area at that edge, none at twice the edge."""
    roof = np.tile(np.where(np.arange(33) % 2, 1.0, 0.0), (33, 1))
    result = fc.dimensions.covering(surface_of(roof, 1.0), vertical_scale=2.0)
    # two triangles carry the slope 2; the apex splits the other two
    expected = 0.5 * np.sqrt(1 + 4) + 0.5 * np.sqrt(1 + 4)
    assert float(result.covering_area[0]) == pytest.approx(33**2 * expected, rel=1e-12)
    assert float(result.covering_area[1]) == pytest.approx(33**2, rel=1e-12)


def test_profile_gives_length():
    zigzag = fc.surfaces.from_array(np.where(np.arange(65) % 2, 1.0, 0.0), 1.0)
    result = fc.dimensions.covering(zigzag)
    np.testing.assert_allclose(result.covering_length[:2], [65 * np.sqrt(2.0), 65.0], rtol=1e-12)
