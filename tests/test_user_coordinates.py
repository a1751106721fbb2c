"""Inputs with coordinates and attributes of the user's own, through every subpackage."""

import dataclasses
import inspect

import numpy as np
import pytest
import xarray as xr
from calls import CALLS, crack, function_of, labelled_functions, result_of, rough

import fractalcontact as fc
from fractalcontact.base.schema import QUANTITIES

NUMBERS = ("hurst", "rms_height", "contact_area", "closure", "aperture", "local_slope", "run_time")
INTEGERS = ("island", "box_size", "lag", "wavenumber", "axis", "method", "azimuth")
ARGUMENTS = ("surface", "lower", "mask", "masks", "gap", "crack", "closure", "dilatancy", "scans")


def annotated(data):
    """Return labelled data with coordinates of any name and dtype, some of them names of results."""
    own = {"sample": "A1", "when": np.datetime64("2020-01-01", "ns")}
    own |= {f"own_{dim}": (dim, np.arange(count)) for dim, count in data.sizes.items()}
    if isinstance(data, xr.DataArray):  # in a result such names have their meaning
        own |= dict.fromkeys(NUMBERS, 1.0) | dict.fromkeys(INTEGERS, 2)
        own["label"] = (("y", "x"), np.zeros((data.sizes["y"], data.sizes["x"])))
    data = data.assign_coords({name: value for name, value in own.items() if name not in data.coords})
    data.attrs.update(operator={"name": 1}, provenance="scanned by hand", _FillValue=-1.0, scale_factor=2)
    return data


def with_own(value):
    """Return an argument with all labelled data in it annotated."""
    if isinstance(value, fc.joints.Crack):
        return dataclasses.replace(crack(), lower=annotated(crack().lower))
    if isinstance(value, list):
        return [with_own(each) for each in value]
    return annotated(value) if isinstance(value, (xr.DataArray, xr.Dataset)) else value


def takes_labels(name):
    return next(iter(inspect.signature(function_of(name)).parameters)) in ARGUMENTS


@pytest.mark.parametrize("name", list(filter(takes_labels, labelled_functions())))
def test_unknown_coordinates_change_nothing(name, tmp_path):
    arguments = CALLS[name]()
    own = {key: with_own(value) for key, value in arguments.items()}
    assert any(own[key] is not arguments[key] for key in own)
    plain, result = result_of(name), function_of(name)(**own)
    assert set(result.coords) <= set(QUANTITIES)
    assert result.sizes == plain.sizes
    if isinstance(result, xr.Dataset):
        assert set(result.data_vars) == set(plain.data_vars)
        times = [key for key in result.data_vars if "time" in key]
        xr.testing.assert_equal(result.drop_vars(times).reset_coords(drop=True),
                                plain.drop_vars(times).reset_coords(drop=True))  # fmt: skip
    else:
        np.testing.assert_array_equal(result.values, plain.values)
    assert "operator" not in result.attrs
    fc.save(result, tmp_path / "result.nc")


def stack_of(members):
    return fc.surfaces.fbm((24, 24), 1e-4, hurst=0.7, rms_increment=5e-6, rng=11, members=members)


def of_heights(name, surface):
    """Return the result of a function of a surface, or of the gap over it."""
    argument = next(iter(CALLS[name]()))
    given = {"surface": surface, "gap": surface - surface.min()}[argument]
    return function_of(name)(**(CALLS[name]() | {argument: given}))


OF_STACKS = [
    *("surfaces.describe", "surfaces.level", "surfaces.fill", "dimensions.estimate", "dimensions.variogram"),
    *("joints.transmissivity", "joints.uplift"),
]


@pytest.mark.parametrize("name", OF_STACKS)
def test_coordinate_of_a_user_dim_is_kept(name, tmp_path):
    stack = stack_of(2).rename(member="depth").assign_coords(depth=[0.5, 2.0], owner=("depth", ["p", "q"]))
    stack["depth"].attrs.update(units="km", history="somewhere")
    result = of_heights(name, stack)
    assert result.depth.attrs == {"units": "km", "long_name": "depth"}
    assert result.depth.values.tolist() == [0.5, 2.0]
    assert "owner" not in result.coords
    xr.testing.assert_identical(fc.open(fc.save(result, tmp_path / "stack.nc")), result)


@pytest.mark.parametrize("name", OF_STACKS)
def test_multi_index_is_dropped(name):
    stack = stack_of(4).rename(member="case").drop_vars("case")
    stack = stack.assign_coords(a=("case", [0, 0, 1, 1]), b=("case", [0, 1, 0, 1])).set_index(case=["a", "b"])
    result = of_heights(name, stack)
    assert result.sizes["case"] == 4
    assert not {"case", "a", "b"} & set(result.coords)


@pytest.mark.parametrize(
    ("name", "dim"),
    [
        ("surfaces.describe", "rms_height"),
        ("dimensions.estimate", "method"),
        ("dimensions.estimate", "hurst"),
        ("dimensions.directions", "azimuth"),
        ("dimensions.spectrum", "wavenumber"),
        ("dimensions.variogram", "lag"),
        ("dimensions.cube_counts", "vertical_scale"),
        ("joints.transmissivity", "axis"),
        ("joints.uplift", "diagram"),
    ],
)
def test_dim_named_like_a_result_is_refused(name, dim):
    with pytest.raises(
        ValueError, match=rf"dims: expected leading dims not called as the results are, {dim}"
    ):
        of_heights(name, stack_of(2).rename(member=dim))


def test_attributes_that_no_file_holds_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"height.operator: expected text, a number or a list of them"):
        fc.save(annotated(rough()), tmp_path / "face.nc")
    assert list(tmp_path.iterdir()) == []
