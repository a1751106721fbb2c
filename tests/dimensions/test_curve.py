"""Properties that every curve over scale shares: symmetry, units, stacks, labels, files."""

from functools import partial

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.schema import QUANTITIES
from fractalcontact.base.study import provenance_of


@pytest.fixture(scope="module")
def rough():
    return fc.surfaces.fbm((48, 40), (2e-3, 1e-3), hurst=0.6, rms_increment=1e-4, rng=1)


CURVES = {
    name: getattr(fc.dimensions, name)
    for name in (
        "spectrum",
        "variogram",
        "roughness_length",
        "variation",
        "cube_counts",
        "covering",
        "higuchi",
        "detrended_fluctuation",
        "divider",
        "height_lacunarity",
    )
}
CURVES["madogram"] = partial(fc.dimensions.variogram, increments="absolute")
CURVES["second_variogram"] = partial(fc.dimensions.variogram, increments="second")
NATURAL = ("covering", "divider")  # depend on the unit of height


def test_mirror_changes_no_value(rough):
    for name in ("variogram", "spectrum"):
        first = getattr(fc.dimensions, name)(rough)
        second = getattr(fc.dimensions, name)(rough.copy(data=rough.values[:, ::-1]))
        value = next(iter(first.data_vars))
        np.testing.assert_allclose(second[value], first[value], rtol=1e-9)


@pytest.mark.parametrize("name", [name for name in CURVES if name not in NATURAL])
def test_powers_of_two_change_no_bit(rough, name):
    curve = CURVES[name]
    first, second = curve(rough), curve(rough * 2.0**-30)
    value = next(iter(first.data_vars))
    power = 0 if name in ("cube_counts", "height_lacunarity") else 1
    power = 2 if name in ("spectrum", "variogram", "second_variogram") else power
    np.testing.assert_array_equal(first[value] * 2.0 ** (-30 * power), second[value])
    np.testing.assert_array_equal(first.local_slope.isnull(), second.local_slope.isnull())


@pytest.mark.parametrize("ratio", [1.0, 1.5, 2.5])
@pytest.mark.parametrize("name", CURVES)
def test_no_unit_of_length_moves_a_window(name, ratio):
    """Halves of points, and windows as long as a quarter of the surface, are decided alike in every unit."""
    heights = np.random.default_rng(3).standard_normal((41, 25)).cumsum(axis=0).cumsum(axis=1)
    first = None
    for unit in (1.0, 1e-3, 1e-4, 1.1):
        result = CURVES[name](fc.surfaces.from_array(unit * heights, (ratio * unit, unit)))
        values = next(iter(result.data_vars.values())).values
        first = values if first is None else first
        assert values.shape == first.shape
        if values.size:
            np.testing.assert_allclose(values / values[0], first / first[0], rtol=1e-6)


@pytest.mark.parametrize("name", CURVES)
def test_stack_equals_single_results(name):
    stack = fc.surfaces.fbm((24, 20), 1e-3, hurst=0.5, rms_increment=1e-5, members=3, rng=8)
    curve = CURVES[name]
    complete, first = curve(stack), curve(stack.isel(member=1))
    for key in first.data_vars:
        if key != "run_time":
            assert complete[key].dims[: -1 if first[key].ndim else None] == ("member",)
            np.testing.assert_array_equal(complete[key].isel(member=1), first[key])


@pytest.mark.parametrize("name", CURVES)
def test_units_and_round_trip(rough, name, tmp_path):
    curve = CURVES[name](rough)
    for key, variable in curve.variables.items():
        assert variable.attrs["units"] == QUANTITIES[key].units
    assert provenance_of(curve)["periodic_axes"] == "none"
    xr.testing.assert_identical(fc.open(fc.save(curve, tmp_path / "curve.nc")), curve)
