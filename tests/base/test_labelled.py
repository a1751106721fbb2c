"""Arrays as users have them: plain, masked, in a Dataset, in millimetres, descending or transposed."""

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput, ScaleWarning

SURFACE = fc.surfaces.fbm((24, 32), (2e-4, 1e-4), hurst=0.6, rms_increment=1e-5, rng=1)
EXPECTED = fc.surfaces.describe(SURFACE)

FORMS = {
    "Dataset with one height": (SURFACE.to_dataset(name="height"), "'height' taken"),
    "Dataset with one map": (SURFACE.to_dataset(name="z").assign(count=3), "'z' taken"),
    "transposed": (SURFACE.transpose("x", "y"), "transposed to (y, x)"),
    "y descending": (SURFACE.isel(y=slice(None, None, -1)), "y reversed"),
    "both descending": (SURFACE[::-1, ::-1], "y reversed, x reversed"),
    "heights in millimetres": ((SURFACE * 1e3).assign_attrs(units="mm"), "heights converted from mm"),
    "lengths in micrometres": (
        SURFACE.assign_coords({d: (d, SURFACE[d].values * 1e6, {"units": "um"}) for d in "yx"}),
        "y converted from um, x converted from um",
    ),
}


@pytest.mark.parametrize("form", FORMS)
def test_labelled_forms_give_the_same_result(form):
    """The result is that of the surface itself, and the history says what was done."""
    given, note = FORMS[form]
    result = fc.surfaces.describe(given)
    for name in ("rms_height", "rms_slope_x", "rms_slope_y", "mean_slope_x", "mean_slope_y", "peak_height"):
        np.testing.assert_allclose(result[name], EXPECTED[name], rtol=1e-9, err_msg=name)
    assert note in result.attrs["history"]
    assert "surface:" not in EXPECTED.attrs["history"]


@pytest.mark.parametrize("wrap", [np.asarray, np.ndarray.tolist, np.ma.asarray, np.float32])
def test_plain_array_with_its_spacing(wrap):
    result = fc.surfaces.describe(wrap(SURFACE.values), spacing=(2e-4, 1e-4))
    np.testing.assert_allclose(result.rms_slope, EXPECTED.rms_slope, rtol=1e-5)
    fc.surfaces.describe.validate(SURFACE.values, spacing=1e-4)
    profile = fc.dimensions.estimate(SURFACE.values[0], spacing=1e-4)
    np.testing.assert_allclose(
        profile.hurst, fc.dimensions.estimate(SURFACE[0].drop_vars("y")).hurst, rtol=1e-6
    )


def test_masked_points_are_missing():
    masked = np.ma.masked_greater(SURFACE.values, float(SURFACE.quantile(0.9)))
    result = fc.surfaces.describe(masked, spacing=(2e-4, 1e-4))
    assert int(result.missing_points) == int(masked.mask.sum())
    filled = fc.surfaces.from_array(masked, (2e-4, 1e-4))
    assert int(filled.isnull().sum()) == int(masked.mask.sum())


def test_periodic_axis_in_other_units_stays_periodic():
    surface = fc.surfaces.spectral((16, 16), 1e-4, hurst=0.6, rms_height=1e-6, rng=2)
    coords = {
        d: (d, surface[d].values * 1e3, {"units": "mm", "period": surface[d].attrs["period"] * 1e3})
        for d in "yx"
    }
    result = fc.dimensions.estimate(surface.assign_coords(coords))
    expected = fc.dimensions.estimate(surface)
    free = surface.assign_coords({d: (d, surface[d].values, {"units": "m"}) for d in "yx"})
    assert np.abs(fc.dimensions.estimate(free).hurst.values - expected.hurst.values).min() > 1e-3
    np.testing.assert_allclose(result.hurst, expected.hurst, rtol=1e-6)
    np.testing.assert_allclose(result.scale_min, expected.scale_min, rtol=1e-9)


@pytest.mark.parametrize(
    ("surface", "options", "problem"),
    [
        (SURFACE, {"spacing": 1e-4}, "spacing: expected none"),
        (SURFACE.values, {"spacing": -1.0}, "spacing"),
        (SURFACE.values, {"spacing": [1.0, 2.0, 3.0]}, "one length"),
        (SURFACE.values, {}, "from_array"),
        ([["a"]], {"spacing": 1.0}, "real numbers"),
        (xr.Dataset({"a": SURFACE, "b": SURFACE}), {}, "DataArray"),
        (SURFACE.assign_attrs(units="kg"), {}, "units"),
    ],
)
def test_what_cannot_be_a_surface(surface, options, problem):
    with pytest.raises(InvalidInput, match=problem):
        fc.surfaces.describe(surface, **options)


def test_coordinates_without_a_unit_that_look_like_millimetres():
    heights = 1e-2 * np.random.default_rng(3).normal(size=(40, 60))
    coords = {"y": np.arange(40.0), "x": np.arange(60.0)}
    plain = xr.DataArray(heights, coords, ("y", "x"))
    with pytest.warns(ScaleWarning, match="y extends over 39 and states no unit"):
        fc.surfaces.describe(plain)
    for unit in ("mm", "m"):
        labelled = plain.assign_coords({dim: (dim, coords[dim], {"units": unit}) for dim in coords})
        fc.surfaces.describe(labelled)  # a warning is an error here
    fc.surfaces.describe(plain.assign_coords(y=1e-3 * coords["y"], x=1e-3 * coords["x"]))
