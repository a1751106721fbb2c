"""Arrays as surfaces: orientation, units, missing values, leading dims."""

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput

HEIGHTS = np.arange(12.0).reshape(3, 4) * 1e-6


def test_array_becomes_a_surface():
    surface = fc.surfaces.from_array(HEIGHTS, (2e-3, 1e-3), periodic=(True, False))
    assert surface.dims == ("y", "x")
    assert surface.dtype == np.float64
    np.testing.assert_array_equal(surface.values, HEIGHTS)
    np.testing.assert_allclose(surface.y.values, [1e-3, 3e-3, 5e-3])
    np.testing.assert_allclose(surface.x.values, [0.5e-3, 1.5e-3, 2.5e-3, 3.5e-3])
    assert surface.y.attrs["period"] == pytest.approx(6e-3)
    assert "period" not in surface.x.attrs
    assert surface.attrs["units"] == surface.x.attrs["units"] == "m"


@pytest.mark.parametrize(
    ("units", "per_metre"),
    [("m", 1), ("mm", 1e3), ("um", 1e6), ("µm", 1e6), ("μm", 1e6), ("nm", 1e9), ("km", 1e-3)],
)
def test_units_are_converted_to_metres(units, per_metre):
    surface = fc.surfaces.from_array([[1.0, 2.0], [3.0, 5.0]], 1.0, units=units)
    np.testing.assert_allclose(surface.values, np.array([[1.0, 2.0], [3.0, 5.0]]) / per_metre, rtol=1e-15)


def test_missing_values_masks_and_integers():
    masked = np.ma.masked_greater(np.arange(6, dtype=np.int16).reshape(2, 3), 4)
    surface = fc.surfaces.from_array(masked, 1.0)
    assert surface.dtype == np.float64
    assert np.isnan(surface.values[1, 2])
    assert np.isnan(fc.surfaces.from_array([[1.0, np.nan], [0, 1]], 1.0).values[0, 1])


def test_profiles_members_and_labelled_arrays():
    assert fc.surfaces.from_array(np.zeros(5), 1.0).dims == ("x",)
    stack = fc.surfaces.from_array(np.zeros((2, 3, 4)), 1.0)
    assert stack.dims == ("member", "y", "x")
    shear = xr.DataArray(np.zeros((2, 3, 4)), dims=("shear", "y", "x"), coords={"shear": [0.0, 1e-3]})
    surface = fc.surfaces.from_array(shear, 1.0)
    np.testing.assert_array_equal(surface.shear.values, [0.0, 1e-3])
    assert surface.shear.attrs["units"] == "m"
    with pytest.raises(InvalidInput, match="leading dims"):
        fc.surfaces.from_array(shear.rename(shear="weather"), 1.0)


def test_dask_array_stays_lazy():
    dask = pytest.importorskip("dask.array")
    surface = fc.surfaces.from_array(dask.zeros((8, 8), chunks=4), 1.0, units="um")
    assert hasattr(surface.data, "dask")


def test_input_is_not_changed():
    heights = HEIGHTS.copy()
    surface = fc.surfaces.from_array(heights, 1.0)
    surface.values[0, 0] = 99.0
    np.testing.assert_array_equal(heights, HEIGHTS)


@pytest.mark.parametrize(
    ("heights", "options", "problem"),
    [
        (np.full((3, 3), np.inf), {}, "infinite"),
        (np.zeros((3, 3), complex), {}, "real numbers"),
        (np.zeros((3, 3), bool), {}, "real numbers"),
        ("heights", {}, "real numbers"),
        ([[1.0, 2.0], [3.0]], {}, "real numbers"),
        (5.0, {}, "shape"),
        (np.zeros((2, 2, 2, 2)), {}, "shape"),
        (np.zeros((1, 5)), {}, "at least 2"),
        (np.zeros((3, 3)), {"spacing": -1.0}, "spacing"),
        (np.zeros((3, 3)), {"spacing": (1.0, 2.0, 3.0)}, "spacing"),
        (np.zeros((3, 3)), {"units": "furlong"}, "units"),
        (np.zeros((3, 3)), {"periodic": "x"}, "periodic"),
    ],
)
def test_invalid_arguments_are_refused(heights, options, problem):
    with pytest.raises(InvalidInput, match=problem):
        fc.surfaces.from_array(heights, **{"spacing": 1.0, **options})
