"""The grid: cell centres, spacing, periods that end with a crop, edges of a mask."""

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.checks import Problems
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.grid import check_surface, contact_edges, grid_of, plane_coords, resolve_periodic


def plane(shape=(6, 5), spacing=(2e-6, 1e-6), periodic=(True, True), origin=0.0):
    coords = plane_coords(shape, spacing, periodic)
    array = xr.DataArray(np.zeros(shape), dims=("y", "x"), coords=coords, name="height", attrs={"units": "m"})
    return array.assign_coords(x=array.x.copy(data=array.x.values + origin))


def grid(array):
    with Problems("test") as problems:
        return grid_of(array, problems, "surface")


def test_shape_spacing_extent_and_area():
    found = grid(plane())
    assert found.shape == (6, 5)
    np.testing.assert_allclose(found.spacing, (2e-6, 1e-6), rtol=1e-14)
    np.testing.assert_allclose(found.extent, (12e-6, 5e-6), rtol=1e-14)
    np.testing.assert_allclose(found.nominal_area, 60e-12, rtol=1e-14)
    assert found.periodic == (True, True)


def test_a_crop_of_a_periodic_face_is_free():
    assert grid(plane().isel(x=slice(0, 4))).periodic == (True, False)
    assert grid(plane().isel(y=slice(1, None))).periodic == (False, True)
    assert grid(plane().isel(y=slice(None, None, 2), x=slice(0, 5))).periodic == (True, True)


def test_spacing_scales_exactly_with_powers_of_two():
    face = plane()
    scaled = face.assign_coords(x=face.x * 2.0**-20, y=face.y * 2.0**-20)
    assert grid(scaled).spacing == tuple(s * 2.0**-20 for s in grid(face).spacing)


def test_a_large_offset_of_the_coordinates_is_no_fault():
    np.testing.assert_allclose(grid(plane(origin=1e4)).spacing[1], 1e-6, rtol=1e-5)


@pytest.mark.parametrize(
    ("spoil", "word"),
    [
        (lambda a: a.isel(x=[0, 1, 3]), "uniform"),
        (lambda a: a.isel(x=slice(None, None, -1)), "ascending"),
        (lambda a: a.drop_vars("y"), "surface.y"),
        (lambda a: a.transpose("x", "y"), "surface.dims"),
        (lambda a: a.assign_coords(x=a.x.assign_attrs(units="mm")), "'mm'"),
        (lambda a: a.assign_attrs(units="um"), "surface.units"),
        (lambda a: a.where(a.x > 2e-6), "NaN"),
        (lambda a: a.isel(x=slice(0, 2)), "at least 3"),
        (lambda a: a.expand_dims(member=2), "surface.dims"),
        (lambda a: a.values, "from_array"),
        (lambda a: a.astype(complex), "real numbers"),
    ],
)
def test_every_fault_of_a_surface_is_named(spoil, word):
    with pytest.raises(InvalidInput, match=word), Problems("test") as problems:
        check_surface(spoil(plane()), problems)


@pytest.mark.parametrize("dims", [("x", "y"), ("row", "column")])
def test_wrong_dims_are_one_fault(dims):
    """The sizes of other axes are not held against the face."""
    face = xr.DataArray(np.zeros((6, 5)), dims=dims)
    with pytest.raises(InvalidInput) as caught, Problems("test") as problems:
        check_surface(face, problems, smallest=4)
    assert len(caught.value.problems) == 1


def test_periodic_may_be_called_free_but_never_the_reverse():
    face = plane()
    with Problems("test") as problems:
        assert resolve_periodic(False, grid(face), problems, "periodic") == (False, False)
        assert resolve_periodic(None, grid(face), problems, "periodic") == (True, True)
        assert resolve_periodic(True, grid(face), problems, "periodic") == (True, True)
    with pytest.raises(InvalidInput, match="periodic"), Problems("test") as problems:
        resolve_periodic(True, grid(face.isel(x=slice(0, 4))), problems, "periodic")


def test_edges_of_a_mask_counted_by_hand():
    mask = np.array([[1, 0, 0], [1, 1, 0], [0, 0, 0]], bool)
    np.testing.assert_array_equal(contact_edges(mask), [3, 2])
    np.testing.assert_array_equal(contact_edges(mask, (True, True)), [4, 4])
    stack = np.stack([mask, ~mask, np.zeros((3, 3), bool)])
    np.testing.assert_array_equal(contact_edges(stack), [[3, 2], [3, 2], [0, 0]])


@pytest.mark.parametrize("size", [5e-324, 1e-310, 1e-150, 1e150, 1e300])
@pytest.mark.parametrize(
    "use",
    [
        fc.surfaces.describe,
        fc.surfaces.level,
        fc.surfaces.despike,
        fc.joints.roughness_coefficient,
        lambda face: fc.contact.press(face, contact_modulus=1e9, closure=1e-6),
        lambda face: fc.joints.Crack(face, young=1e9, poisson=0.2),
        lambda face: fc.joints.register(face, face),
        fc.joints.transmissivity,
    ],
)
def test_sizes_whose_squares_are_no_numbers_are_refused_in_words(use, size):
    heights = np.random.default_rng(1).random((24, 24))
    with pytest.raises(InvalidInput, match="expected heights of 0 or of 1e-100 to 1e100 m"):
        use(fc.surfaces.from_array(size * heights, 1.0))
    if 1e-300 < size < 1e200:
        with pytest.raises(InvalidInput, match=r"spacing.* 1e\+?100|spacing of 1e-100"):
            use(fc.surfaces.from_array(heights, size))


def test_a_range_that_is_below_all_squares_is_refused_and_a_flat_is_not():
    heights = np.where(np.eye(8) > 0, 1e-120, 0.0)
    with pytest.raises(InvalidInput, match="heights of 0 or"):
        fc.surfaces.describe(fc.surfaces.from_array(heights, 1.0))
    assert fc.surfaces.describe(fc.surfaces.from_array(0.0 * heights, 1.0)).rms_height == 0.0
    assert np.isnan(fc.surfaces.describe(fc.surfaces.from_array(heights + np.nan, 1.0)).rms_height)
