"""Levelling: least squares with gaps, exact planes, offsets and units."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput


def rough(shape=(40, 50), spacing=(1e-3, 2e-3), seed=3, **options):
    return fc.surfaces.fbm(shape, spacing, hurst=0.7, rms_increment=1e-5, rng=seed, **options)


def with_gaps(surface, fraction=0.1, seed=0):
    missing = np.random.default_rng(seed).random(surface.shape) < fraction
    return surface.where(~missing)


def polynomial(surface, order):
    """Fit by plain least squares in centred metres, over the observed points."""
    x, y = np.meshgrid(surface.x.values, surface.y.values)
    x, y = x - x.mean(), y - y.mean()
    terms = [x**i * y**j for i in range(order + 1) for j in range(order + 1 - i)]
    observed = np.isfinite(surface.values)
    matrix = np.stack([term[observed] for term in terms], axis=1)
    matrix = matrix / np.abs(matrix).max(axis=0)
    fitted = matrix @ np.linalg.lstsq(matrix, surface.values[observed], rcond=None)[0]
    result = np.full(surface.shape, np.nan)
    result[observed] = surface.values[observed] - fitted
    return result


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("gaps", [0.0, 0.3])
def test_level_is_least_squares(order, gaps):
    surface = with_gaps(rough(), gaps)
    np.testing.assert_allclose(
        fc.surfaces.level(surface, order).values, polynomial(surface, order), atol=1e-18
    )


def test_profile():
    profile = rough().isel(y=3, drop=True)
    x = np.arange(profile.size)
    fitted = np.polynomial.Polynomial.fit(x, profile.values, 1)(x)
    np.testing.assert_allclose(fc.surfaces.level(profile).values, profile.values - fitted, atol=1e-18)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_levelling_twice_changes_nothing(order):
    levelled = fc.surfaces.level(with_gaps(rough()), order)
    again = fc.surfaces.level(levelled, order)
    np.testing.assert_allclose(again.values, levelled.values, atol=1e-20)
    assert abs(float(levelled.mean())) < 1e-20


def test_plane_and_quadric_leave_nothing():
    """No rounded numbers either, of which a fractal dimension was found with an interval."""
    zero = rough() * 0.0
    tilted = zero + 3.0 * zero.x - 7.0 * zero.y + 2.0
    assert np.abs(fc.surfaces.level(_metres(tilted), 1).values).max() == 0.0
    curved = tilted + 4.0 * zero.x**2 - zero.x * zero.y
    assert np.abs(fc.surfaces.level(_metres(curved), 2).values).max() == 0.0


def _metres(array):
    array.attrs = {"units": "m"}
    return array


def test_large_offsets_lose_no_digits():
    base = rough()
    lifted = base.copy(data=base.values + 1e9)
    rounded = lifted.values - 1e9  # the heights that remain after rounding of the input
    exact = fc.surfaces.level(base.copy(data=rounded)).values
    np.testing.assert_allclose(fc.surfaces.level(lifted).values, exact, atol=1e-20)
    far = base.assign_coords(x=base.x.values + 1e9 * 2e-3)
    np.testing.assert_allclose(fc.surfaces.level(far).values, fc.surfaces.level(base).values, atol=1e-19)


def test_units_by_powers_of_two_change_no_bit():
    surface = with_gaps(rough())
    scaled = surface.copy(data=surface.values * 2.0**60).assign_coords(
        x=surface.x.values * 2.0**-20, y=surface.y.values * 2.0**-20
    )
    np.testing.assert_array_equal(
        fc.surfaces.level(scaled).values, fc.surfaces.level(surface).values * 2.0**60
    )


def test_periodicity_ends_with_order_one():
    surface = fc.surfaces.spectral((8, 8), 1.0, hurst=0.5, rms_height=1.0, rng=1)
    assert "period" in fc.surfaces.level(surface, 0).x.attrs
    assert "period" not in fc.surfaces.level(surface, 1).x.attrs
    assert "period" in surface.x.attrs


def test_members_are_levelled_separately():
    stack = rough(members=3)
    levelled = fc.surfaces.level(stack)
    np.testing.assert_array_equal(
        levelled.values[1], fc.surfaces.level(stack.isel(member=1, drop=True)).values
    )
    assert levelled.dims == stack.dims


@pytest.mark.parametrize(("rows", "order"), [(0, 0), (1, 1), (2, 2)])
def test_undetermined_polynomial_is_refused(rows, order):
    heights = np.full((6, 10), np.nan)
    heights[:rows] = np.random.default_rng(0).random((rows, 10))
    surface = fc.surfaces.from_array(heights, 1.0)
    with pytest.raises(InvalidInput, match="too few"):
        fc.surfaces.level(surface, order)
    if order:
        assert fc.surfaces.level(surface, order - 1).notnull().sum() == 10 * rows


def test_all_problems_are_reported_together():
    with pytest.raises(InvalidInput) as caught:
        fc.surfaces.level(np.zeros((3, 3)), 4)
    assert len(caught.value.problems) == 2
