"""Masks as input of all functions: accepted types, refused values, dims and coordinates of the results."""

import inspect

import numpy as np
import pytest
import xarray as xr
from domains.sets import as_mask, level_set

import fractalcontact as fc
from fractalcontact.base.schema import QUANTITIES

FUNCTIONS = {
    name: function
    for name in fc.domains.__all__
    if "mask" in inspect.signature(function := getattr(fc.domains, name)).parameters
}


@pytest.fixture(scope="module")
def mask():
    planes = np.array([level_set(32, 0.7, c, np.random.default_rng(1)) for c in (0.1, 0.3)])
    coords = {
        "step": [0, 1],
        "closure": ("step", [1e-6, 2e-6]),
        "temperature": ("step", [1.0, 2.0]),
        "shear": 1e-3,
    }
    return as_mask(planes, periodic=(True, False)).assign_coords(coords)


def test_all_public_functions_are_tested_here():
    assert set(fc.domains.__all__) == {*FUNCTIONS, "area_dimension", "read_mask"}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_flags_and_booleans_give_the_same(name, mask):
    expected = FUNCTIONS[name](mask).drop_vars("run_time")
    yielded = xr.where(mask, 2, 0).astype(np.int8).assign_coords(mask.coords)
    for other in (mask.astype(np.int8), mask.astype(np.uint8), mask.astype(np.int64), yielded):
        got = FUNCTIONS[name](other).drop_vars("run_time")
        assert expected.identical(got.assign_attrs(expected.attrs))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_plain_boolean_arrays_are_masks_with_lengths_in_cells(name, mask):
    cells = mask.values
    observed = np.random.default_rng(2).random(cells.shape) < 0.9
    expected = FUNCTIONS[name](as_mask(cells, (1.0, 1.0)), valid=as_mask(observed, (1.0, 1.0)))
    result = FUNCTIONS[name](cells, valid=observed)
    for key, variable in result.data_vars.items():
        if key not in ("run_time", "centroid_x", "centroid_y", "x_min", "x_max", "y_min", "y_max"):
            np.testing.assert_array_equal(variable, expected[key])
        if QUANTITIES[key].units in ("m", "m2"):
            assert variable.attrs["units"] == "1"


@pytest.mark.parametrize("name", FUNCTIONS)
def test_results_keep_the_leading_dims_and_known_coordinates(name, mask):
    result = FUNCTIONS[name](mask)
    assert result.closure.values.tolist() == [1e-6, 2e-6]
    assert float(result.shear) == 1e-3
    assert "temperature" not in result.coords
    for variable in result.data_vars.values():
        assert variable.ndim == 0 or variable.dims[0] in ("step", "island", "link")


@pytest.mark.parametrize("name", FUNCTIONS)
def test_invalid_masks_are_refused(name, mask):
    numbers = mask * 1.5
    wrong = [
        (np.ones((4, 4)), "mask: expected a boolean DataArray"),
        (mask.transpose("step", "x", "y"), r"dims \(..., y, x\)"),
        (mask.isel(x=slice(0, 0)), "none of them empty"),
        (mask.astype("U1"), "mask: expected"),
    ]
    if name not in ("generalised_dimensions", "lacunarity"):  # which take fields
        wrong += [(numbers, "compare numbers first"), (numbers.where(False), "compare numbers first")]
    for invalid, words in wrong:
        with pytest.raises(ValueError, match=words):
            FUNCTIONS[name](invalid)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_unobserved_cells_make_no_difference(name, mask):
    valid = as_mask(np.random.default_rng(2).random((32, 32)) < 0.9, periodic=(True, False))
    first = FUNCTIONS[name](mask & valid, valid=valid).drop_vars("run_time")
    other = FUNCTIONS[name](mask | ~valid, valid=valid).drop_vars("run_time")
    assert first.identical(other.assign_attrs(first.attrs))
    each = FUNCTIONS[name](mask, valid=valid.expand_dims(step=mask.step)).drop_vars("run_time")
    assert first.identical(each.assign_attrs(first.attrs))


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("share", [0.0, 0.1])
def test_few_observed_cells_give_no_infinity_and_reasons(name, share):
    cells = np.zeros((2, 12, 12), bool)
    cells[1, 4, 4] = True
    valid = as_mask((np.random.default_rng(3).random((12, 12)) < share) | (share > 0) * cells[1])
    result = FUNCTIONS[name](as_mask(cells, dims=("step", "y", "x")), valid=valid)
    for variable in result.data_vars.values():
        if variable.dtype.kind == "f" and not np.isfinite(variable.values).all():
            assert not np.isinf(variable.values).any()
            assert "reason" in variable.attrs or "NaN" in variable.attrs["comment"]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_valid_must_match_the_mask(name, mask):
    for invalid in (mask.isel(step=0).astype(int), mask.isel(step=0, x=slice(3)), np.ones((32, 32))):
        with pytest.raises(ValueError, match="valid: expected"):
            FUNCTIONS[name](mask, valid=invalid)
    with pytest.raises(ValueError, match="got type int64"):
        FUNCTIONS[name](mask, valid=mask.isel(step=0).astype(np.int64))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_validate_checks_and_computes_nothing(name, mask):
    empty = mask & False
    assert FUNCTIONS[name].validate(empty) is None
    assert FUNCTIONS[name].validate(empty, valid=xr.ones_like(mask)) is None
    with pytest.raises(ValueError, match="valid: expected"):
        FUNCTIONS[name].validate(empty, valid=mask.isel(step=0, x=slice(3)))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_input_is_unchanged(name, mask):
    before = mask.copy(deep=True)
    FUNCTIONS[name](mask)
    assert before.identical(mask)
    assert mask.x.attrs == before.x.attrs


def test_coordinates_of_one_axis_are_refused():
    mask = xr.DataArray(np.ones((4, 4), bool), dims=("y", "x"), coords={"x": np.arange(4.0)})
    with pytest.raises(ValueError, match="mask.y: expected a coordinate"):
        fc.domains.islands(mask)


def test_leading_dims_with_names_of_results_are_refused():
    mask = xr.DataArray(np.ones((2, 4, 4), bool), dims=("box_size", "y", "x"))
    with pytest.raises(ValueError, match="mask.dims"):
        fc.domains.box_dimension(mask)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_valid_must_have_the_coordinates_of_the_mask(name, mask):
    valid = xr.ones_like(mask.isel(step=0, drop=True))
    FUNCTIONS[name](mask, valid=valid.assign_coords(x=valid.x * (1 + 1e-12)))
    with pytest.raises(ValueError, match=r"valid\.y: expected that of the mask"):
        FUNCTIONS[name](mask, valid=valid.isel(y=slice(None, None, -1)))
    with pytest.raises(ValueError, match=r"valid\.step: expected that of the mask, \[0 1\], got \[1 0\]"):
        FUNCTIONS[name](mask, valid=xr.ones_like(mask).isel(step=[1, 0]))


def test_coordinates_of_any_leading_dim_are_kept(mask, tmp_path):
    stack = mask.rename(step="batch").drop_vars("closure").assign_coords(batch=["rough", "ground"])
    result = fc.domains.percolation(stack)
    assert result.batch.values.tolist() == ["rough", "ground"]
    hours = mask.rename(step="time").drop_vars("closure").assign_coords(time=[0.5, 2.0])
    hours["time"].attrs.update(units="h", history="somewhere")
    result = fc.domains.describe(hours)
    assert result.time.attrs == {"units": "h", "long_name": "time"}
    fc.save(result, tmp_path / "hours.nc")
    assert fc.open(tmp_path / "hours.nc").coverage.sel(time=2.0) == result.coverage[1]


def test_reasons_of_nan_and_of_refusals():
    strip = as_mask(np.arange(40).reshape(2, 20) % 3 == 0)
    assert "two steps" in fc.domains.boundary_dimension(strip).boundary_dimension.comment
    single_size = fc.domains.box_dimension(as_mask(np.eye(30, dtype=bool)), box_sizes=4).box_dimension
    assert single_size.comment == "NaN: one size of box gives no slope"
    with pytest.raises(ValueError, match="keep: expected a sequence of any of 'label'"):
        fc.domains.islands(strip, keep=None)
