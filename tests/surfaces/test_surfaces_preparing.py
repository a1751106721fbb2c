"""Levelling and filling: planes are exact, gaps are borne, units and offsets do not matter."""

import json

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
    seen = np.isfinite(surface.values)
    matrix = np.stack([term[seen] for term in terms], axis=1)
    matrix = matrix / np.abs(matrix).max(axis=0)
    fitted = matrix @ np.linalg.lstsq(matrix, surface.values[seen], rcond=None)[0]
    result = np.full(surface.shape, np.nan)
    result[seen] = surface.values[seen] - fitted
    return result


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("gaps", [0.0, 0.3])
def test_level_is_least_squares(order, gaps):
    surface = with_gaps(rough(), gaps)
    np.testing.assert_allclose(
        fc.surfaces.level(surface, order).values, polynomial(surface, order), atol=1e-18
    )


def test_level_of_a_profile():
    profile = rough().isel(y=3, drop=True)
    x = np.arange(profile.size)
    fitted = np.polynomial.Polynomial.fit(x, profile.values, 1)(x)
    np.testing.assert_allclose(fc.surfaces.level(profile).values, profile.values - fitted, atol=1e-18)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_what_is_removed_once_is_gone(order):
    levelled = fc.surfaces.level(with_gaps(rough()), order)
    again = fc.surfaces.level(levelled, order)
    np.testing.assert_allclose(again.values, levelled.values, atol=1e-20)
    assert abs(float(levelled.mean())) < 1e-20


def test_a_plane_or_quadric_leaves_nothing():
    zero = rough() * 0.0
    tilted = zero + 3.0 * zero.x - 7.0 * zero.y + 2.0
    assert np.abs(fc.surfaces.level(_metres(tilted), 1).values).max() < 1e-15
    curved = tilted + 4.0 * zero.x**2 - zero.x * zero.y
    assert np.abs(fc.surfaces.level(_metres(curved), 2).values).max() < 1e-15


def _metres(array):
    array.attrs = {"units": "m"}
    return array


def test_offsets_of_a_billion_lose_no_more_than_the_numbers_have_lost():
    base = rough()
    lifted = base.copy(data=base.values + 1e9)
    kept = lifted.values - 1e9  # what the rounding of the input leaves
    exact = fc.surfaces.level(base.copy(data=kept)).values
    np.testing.assert_allclose(fc.surfaces.level(lifted).values, exact, atol=1e-20)
    far = base.assign_coords(x=base.x.values + 1e9 * 2e-3)
    np.testing.assert_allclose(fc.surfaces.level(far).values, fc.surfaces.level(base).values, atol=1e-19)


def test_units_by_powers_of_two_change_no_bit():
    surface = with_gaps(rough())
    scaled = surface.copy(data=surface.values * 2.0**60).assign_coords(
        x=surface.x.values * 2.0**-20, y=surface.y.values * 2.0**-20
    )
    for function in (fc.surfaces.level, fc.surfaces.fill):
        np.testing.assert_array_equal(function(scaled).values, function(surface).values * 2.0**60)


def test_a_levelled_surface_is_free_and_one_without_its_mean_still_periodic():
    surface = fc.surfaces.spectral((8, 8), 1.0, hurst=0.5, rms_height=1.0, rng=1)
    assert "period" in fc.surfaces.level(surface, 0).x.attrs
    assert "period" not in fc.surfaces.level(surface, 1).x.attrs
    assert "period" in surface.x.attrs


def test_members_are_levelled_each_for_itself():
    stack = rough(members=3)
    levelled = fc.surfaces.level(stack)
    np.testing.assert_array_equal(
        levelled.values[1], fc.surfaces.level(stack.isel(member=1, drop=True)).values
    )
    assert levelled.dims == stack.dims


@pytest.mark.parametrize(("rows", "order"), [(0, 0), (1, 1), (2, 2)])
def test_points_that_do_not_fix_the_polynomial_are_refused(rows, order):
    heights = np.full((6, 10), np.nan)
    heights[:rows] = np.random.default_rng(0).random((rows, 10))
    surface = fc.surfaces.from_array(heights, 1.0)
    with pytest.raises(InvalidInput, match="too few"):
        fc.surfaces.level(surface, order)
    if order:
        assert fc.surfaces.level(surface, order - 1).notnull().sum() == 10 * rows


def test_level_tells_every_problem():
    with pytest.raises(InvalidInput) as caught:
        fc.surfaces.level(np.zeros((3, 3)), 4)
    assert len(caught.value.problems) == 2


def test_fill_keeps_what_was_observed_and_tells_how_much_was_not():
    surface = with_gaps(rough())
    filled = fc.surfaces.fill(surface)
    seen = surface.notnull().values
    np.testing.assert_array_equal(filled.values[seen], surface.values[seen])
    assert not filled.isnull().any()
    assert int(filled.filled_points) == np.count_nonzero(~seen)
    assert json.loads(filled.attrs["provenance"])["filled_points"] == np.count_nonzero(~seen)
    assert filled.filled_points.attrs["units"] == "1"


def test_fill_continues_a_plane_exactly():
    zero = rough() * 0.0
    plane = _metres(zero + 3.0 * zero.x - 7.0 * zero.y)
    holed = plane.copy(deep=True)
    holed.values[10:22, 5:20] = np.nan
    holed.values[0, :3] = np.nan
    holed.values[-1, -1] = np.nan
    np.testing.assert_allclose(fc.surfaces.fill(holed).values, plane.values, atol=1e-13)


def test_a_large_gap_in_a_plane_is_filled_to_rounding():
    zero = fc.surfaces.from_array(np.zeros((170, 170)), 1.0)
    plane = _metres(zero + 3.0 * zero.x - 7.0 * zero.y)
    holed = plane.copy(deep=True)
    holed.values[10:160, 10:160] = np.nan
    np.testing.assert_allclose(fc.surfaces.fill(holed, at_most=0.8).values, plane.values, atol=1e-10)


def test_fill_minimises_the_bending_energy():
    # dense least squares over the filled points, with every second difference written out
    surface = with_gaps(rough((7, 8), (1.0, 0.5)), 0.2, seed=2)
    filled = fc.surfaces.fill(surface).values
    missing = np.argwhere(np.isnan(surface.values))

    def energy(heights):
        along = np.diff(heights, 2, axis=1) / 0.25
        across = np.diff(heights, 2, axis=0)
        mixed = np.diff(np.diff(heights, axis=0), axis=1) / 0.5
        return np.sum(along**2) + np.sum(across**2) + 2 * np.sum(mixed**2)

    least = energy(filled)
    for place in missing:
        for shift in (-1e-7, 1e-7):
            moved = filled.copy()
            moved[tuple(place)] += shift
            assert energy(moved) > least


def test_fill_of_a_periodic_surface_continues_across_the_edge():
    surface = fc.surfaces.spectral((32, 32), 1.0, hurst=0.8, rms_height=1.0, short_cutoff=8.0, rng=2)
    holed = surface.copy(deep=True)
    holed.values[12:16, :2] = np.nan
    holed.values[12:16, -2:] = np.nan
    rolled = holed.roll(x=16, roll_coords=False)
    np.testing.assert_allclose(
        fc.surfaces.fill(holed).roll(x=16, roll_coords=False).values,
        fc.surfaces.fill(rolled).values,
        atol=1e-12,
    )
    assert np.abs(fc.surfaces.fill(holed).values - surface.values).max() < 0.15


def test_fill_is_better_than_the_mean():
    surface = fc.surfaces.level(rough((64, 64), 1e-3))
    filled = fc.surfaces.fill(with_gaps(surface))
    wrong = filled.values - surface.values
    wrong = wrong[wrong != 0]
    assert np.sqrt(np.mean(wrong**2)) < 1e-5  # less than one increment
    assert float(surface.std()) > 3e-5


def test_fill_of_a_complete_surface_changes_nothing():
    surface = rough()
    filled = fc.surfaces.fill(surface)
    np.testing.assert_array_equal(filled.values, surface.values)
    assert int(filled.filled_points) == 0


def test_fill_of_members_and_of_a_profile():
    stack = with_gaps(rough(members=2))
    filled = fc.surfaces.fill(stack)
    assert filled.filled_points.dims == ("member",)
    np.testing.assert_array_equal(filled.values[1], fc.surfaces.fill(stack.isel(member=1, drop=True)).values)
    profile = fc.surfaces.from_array([0.0, 1.0, np.nan, 3.0, np.nan], 1.0)
    np.testing.assert_allclose(fc.surfaces.fill(profile, at_most=0.5).values, np.arange(5.0), atol=1e-14)


@pytest.mark.parametrize(
    ("heights", "at_most", "word"),
    [
        (np.full((4, 4), np.nan), 1.0, "span a plane"),
        (np.where(np.arange(16).reshape(4, 4) < 8, np.nan, 1.0), 0.25, "at most 25 %"),
        (np.where(np.arange(16).reshape(4, 4) < 12, np.nan, 1.0), 1.0, "span a plane"),
        (np.array([[0.0, np.nan, np.inf]] * 3), 1.0, "infinite"),
    ],
)
def test_what_cannot_be_filled_is_refused(heights, at_most, word):
    surface = fc.surfaces.from_array(np.zeros(heights.shape), 1.0).copy(data=heights)
    with pytest.raises(InvalidInput, match=word):
        fc.surfaces.fill(surface, at_most=at_most)
