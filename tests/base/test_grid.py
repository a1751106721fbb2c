"""Grids: spacing, periodicity, crops, faults of surfaces, edges of a mask."""

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.grid import contact_edges, periodic_axes, plane_coords, read_grid
from fractalcontact.base.validation import Problems


def plane(shape=(6, 5), spacing=(2e-6, 1e-6), periodic=(True, True), origin=0.0):
    coords = plane_coords(shape, spacing, periodic)
    array = xr.DataArray(np.zeros(shape), dims=("y", "x"), coords=coords, name="height", attrs={"units": "m"})
    return array.assign_coords(x=array.x.copy(data=array.x.values + origin))


def grid(array):
    with Problems("test") as problems:
        assert problems.grid("surface", array)
    return read_grid(array)


def test_shape_spacing_extent_and_area():
    result = grid(plane())
    assert result.shape == (6, 5)
    np.testing.assert_allclose(result.spacing, (2e-6, 1e-6), rtol=1e-14)
    np.testing.assert_allclose(result.extent, (12e-6, 5e-6), rtol=1e-14)
    np.testing.assert_allclose(result.nominal_area, 60e-12, rtol=1e-14)
    assert result.periodic == (True, True)


def test_crop_of_a_periodic_surface_is_not_periodic():
    assert grid(plane().isel(x=slice(0, 4))).periodic == (True, False)
    assert grid(plane().isel(y=slice(1, None))).periodic == (False, True)
    assert grid(plane().isel(y=slice(None, None, 2), x=slice(0, 5))).periodic == (True, True)


def test_spacing_scales_exactly_with_powers_of_two():
    surface = plane()
    scaled = surface.assign_coords(x=surface.x * 2.0**-20, y=surface.y * 2.0**-20)
    assert grid(scaled).spacing == tuple(s * 2.0**-20 for s in grid(surface).spacing)


def test_large_offset_of_the_coordinates_is_valid():
    np.testing.assert_allclose(grid(plane(origin=1e4)).spacing[1], 1e-6, rtol=1e-5)


@pytest.mark.parametrize(
    ("spoil", "word"),
    [
        (lambda a: a.isel(x=[0, 1, 3]), "uniform spacing .see fractalcontact.surfaces.from_points"),
        (lambda a: a.isel(x=slice(None, None, -1)), "ascending"),
        (lambda a: a.drop_vars("y"), "surface.y"),
        (lambda a: a.transpose("x", "y"), "surface.dims"),
        (lambda a: a.assign_coords(x=a.x.assign_attrs(units="mm")), "'mm'"),
        (lambda a: a.assign_attrs(units="um"), "surface.units"),
        (lambda a: a.where(a.x > 2e-6), "NaN"),
        (lambda a: a.isel(x=slice(0, 2)), "at least 3"),
        (lambda a: a.expand_dims(member=2), "surface.dims"),
        (lambda a: a.values, "from_array., or give spacing= .m."),
        (lambda a: a.astype(complex), "real numbers"),
    ],
)
def test_faults_of_a_surface_are_named(spoil, word):
    with pytest.raises(InvalidInput, match=word), Problems("test") as problems:
        problems.surface("surface", spoil(plane()))


@pytest.mark.parametrize("dims", [("x", "y"), ("row", "column")])
def test_wrong_dims_are_one_fault(dims):
    """The sizes of other axes are no further fault."""
    surface = xr.DataArray(np.zeros((6, 5)), dims=dims)
    with pytest.raises(InvalidInput) as caught, Problems("test") as problems:
        problems.surface("surface", surface, smallest=4)
    assert len(caught.value.problems) == 1


def test_periodic_axes_may_be_declared_free_but_not_the_reverse():
    surface = plane()
    for choice, axes in ((False, (False, False)), (None, (True, True)), (True, (True, True))):
        with Problems("test") as problems:
            assert problems.periodic(grid(surface), choice)
        assert periodic_axes(choice, grid(surface)) == axes
    with pytest.raises(InvalidInput, match="periodic"), Problems("test") as problems:
        assert not problems.periodic(grid(surface.isel(x=slice(0, 4))), True)


def test_edges_of_a_small_mask():
    mask = np.array([[1, 0, 0], [1, 1, 0], [0, 0, 0]], bool)
    np.testing.assert_array_equal(contact_edges(mask), [3, 2])
    np.testing.assert_array_equal(contact_edges(mask, (True, True)), [4, 4])
    stack = np.stack([mask, ~mask, np.zeros((3, 3), bool)])
    np.testing.assert_array_equal(contact_edges(stack), [[3, 2], [3, 2], [0, 0]])
    two = np.array([[True, False]])  # neighbours on both sides of each, across the edge too
    np.testing.assert_array_equal(contact_edges(two, (True, True)), [0, 2])
    np.testing.assert_array_equal(contact_edges(two[:, :1], (True, True)), [0, 0])


@pytest.mark.parametrize("size", [5e-324, 1e-310, 1e-150, 1e150, 1e300])
@pytest.mark.parametrize(
    "use",
    [
        fc.surfaces.describe,
        fc.surfaces.level,
        fc.surfaces.despike,
        fc.joints.roughness_coefficient,
        fc.joints.directional_roughness,
        lambda surface: fc.contact.press(surface, contact_modulus=1e9, closure=1e-6),
        lambda surface: fc.joints.Crack(surface, young=1e9, poisson=0.2),
        lambda surface: fc.joints.register(surface, surface),
        fc.joints.transmissivity,
    ],
)
def test_sizes_without_representable_squares_are_refused(use, size):
    heights = np.random.default_rng(1).random((24, 24))
    with pytest.raises(InvalidInput, match="expected heights of 0 or of 1e-100 to 1e100 m"):
        use(fc.surfaces.from_array(size * heights, 1.0))
    if 1e-300 < size < 1e200:
        with pytest.raises(InvalidInput, match=r"spacing.* 1e\+?100|spacing of 1e-100"):
            use(fc.surfaces.from_array(heights, size))


@pytest.mark.parametrize("size", [1e-100, 1e100])
def test_the_limits_of_a_spacing_belong_to_it(size):
    surface = fc.surfaces.from_array(np.random.default_rng(1).random((24, 24)), size)
    assert fc.surfaces.describe(surface).rms_height > 0
    for beyond in (size**1.2, [1.0, size**1.2]):
        with pytest.raises(InvalidInput, match=r"spacing: expected a finite number >= 1e-100 and <= 1e\+100"):
            fc.surfaces.from_array(surface.values, beyond)


def test_too_small_range_is_refused_and_a_constant_surface_is_not():
    heights = np.where(np.eye(8) > 0, 1e-120, 0.0)
    with pytest.raises(InvalidInput, match="heights of 0 or"):
        fc.surfaces.describe(fc.surfaces.from_array(heights, 1.0))
    assert fc.surfaces.describe(fc.surfaces.from_array(0.0 * heights, 1.0)).rms_height == 0.0
    assert np.isnan(fc.surfaces.describe(fc.surfaces.from_array(heights + np.nan, 1.0)).rms_height)
