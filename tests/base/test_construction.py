"""Datasets and DataArrays that are made directly are those of the constructors of xarray."""

import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.base import construction
from fractalcontact.base.construction import joined_along, make_array, make_dataset

X = xr.IndexVariable("x", [0.5, 1.5, 2.5], {"units": "m", "period": 3.0})
CASES = {
    "numbers": ({"a": 1, "b": 2.5, "c": np.float32(3)}, {}),
    "path": ({"a": ("step", np.arange(3.0)), "n": ("step", [1, 2, 3])}, {"step": np.arange(3)}),
    "plane": ({"p": (("y", "x"), np.ones((2, 3)), {"units": "Pa"})}, {"x": X, "y": ("y", [1.0, 2.0])}),
    "no coordinate": ({"a": (("member",), np.zeros(2, bool))}, {}),
    "words": ({"a": ("method", [0.1, 0.2])}, {"method": np.array(["one", "two"]), "lag": 0.5}),
    "variable": ({"a": xr.Variable("x", [1, 2, 3], {"comment": "own"})}, {"x": X, "z": ("x", [3.0, 2.0, 1])}),
    "labelled": ({"a": xr.DataArray([1.0, 2.0], {"k": [0, 1]}, "k")}, {}),
    "objects": ({"a": ("k", np.array([None, "b"], dtype=object))}, {}),
    "dates": ({"a": ("k", np.array(["2026-01-01"], dtype="datetime64[ns]"))}, {}),
}  # fmt: skip


def assert_same(made, usual):
    xr.testing.assert_identical(made, usual)
    assert list(made.variables) == list(usual.variables)
    assert list(made.coords) == list(usual.coords)
    assert set(made.xindexes) == set(usual.xindexes)
    for name, variable in usual.variables.items():
        assert type(made.variables[name]) is type(variable)
        assert made.variables[name].dtype == variable.dtype
    for name, index in usual.xindexes.items():
        assert made.xindexes[name].equals(index)
    assert str(made) == str(usual)


@pytest.mark.parametrize("case", list(CASES))
def test_dataset_is_that_of_xarray(case):
    variables, coords = CASES[case]
    assert_same(
        make_dataset(variables, coords, {"title": "t"}), xr.Dataset(variables, coords, {"title": "t"})
    )


def test_dataset_is_selected_and_aligned_as_any_other():
    variables, coords = CASES["plane"]
    made = make_dataset(variables, coords)
    assert float(made["p"].sel(x=1.5, y=2.0)) == 1.0
    assert (made + made.isel(x=[1, 2])).sizes == {"y": 2, "x": 2}
    assert made.drop_vars("x").x.values.tolist() == [0, 1, 2]


def test_array_is_that_of_xarray():
    heights, coords = np.arange(6.0).reshape(2, 3), {"y": ("y", [1.0, 2.0]), "x": X}
    made, usual = (
        make_array(heights, ("y", "x"), coords, "height"),
        xr.DataArray(heights, coords, ("y", "x"), "height"),
    )
    assert made.name == "height"
    assert_same(made.to_dataset(), usual.to_dataset())


def test_parts_are_not_shared_with_what_was_given():
    made = make_dataset({}, {"x": X})
    made["x"].attrs["units"] = "mm"
    assert X.attrs["units"] == "m"


@pytest.mark.parametrize(
    ("variables", "coords"),
    [
        ({"a": ("k", [1, 2]), "b": ("k", [1, 2, 3])}, {}),
        ({"a": ("k", [1, 2])}, {"k": [0, 1, 2]}),
        ({"a": (("k", "l"), [1, 2])}, {}),
    ],
)
def test_parts_that_do_not_fit_are_refused(variables, coords):
    with pytest.raises(ValueError, match="dim"):
        make_dataset(variables, coords)


def test_array_of_other_length_than_its_coordinate_is_refused():
    with pytest.raises(ValueError, match="'x'"):
        make_array(np.zeros(2), ("x",), {"x": X}, "height")


@pytest.mark.parametrize("case", list(CASES))
def test_version_of_xarray_without_the_direct_way(monkeypatch, case):
    monkeypatch.setattr(construction, "DIRECT", None)
    variables, coords = CASES[case]
    assert_same(make_dataset(variables, coords), xr.Dataset(variables, coords))


def test_results_are_the_same_without_the_direct_way(monkeypatch):
    surface = fc.surfaces.fbm((16, 16), 1e-3, hurst=0.5, rms_increment=1e-6, rng=1)
    made = fc.contact.press(surface, contact_modulus=1e9, closure=1e-6)
    monkeypatch.setattr(construction, "DIRECT", None)
    usual = fc.contact.press(surface, contact_modulus=1e9, closure=1e-6)
    made, usual = (result.drop_vars("run_time").drop_attrs(deep=False) for result in (made, usual))
    xr.testing.assert_identical(made, usual)
    assert list(made.data_vars) == list(usual.data_vars)
    assert made.encoding == usual.encoding


def test_dask_stays_out_of_a_script_without_dask_arrays():
    pytest.importorskip("dask")
    code = (
        "import sys, numpy as np, fractalcontact as fc\n"
        "surface = fc.surfaces.from_array(np.add.outer(np.arange(8.0), np.arange(8.0) ** 2) * 1e-9, 1e-6)\n"
        "fc.surfaces.describe(surface)\n"
        "fc.dimensions.variogram(surface)\n"
        "print('dask' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def member(number, **changes):
    variables = {
        "force": (("member", "step"), [[1.0, 2.0 + number]], {"units": "N"}),
        "count": ("member", [number]),
        "area": 3.0,
    } | changes
    coords = {"member": [number], "step": [0, 1], "closure": (("member", "step"), [[0.5, 0.1 * number]])}
    return xr.Dataset(variables, coords, {"title": f"member {number}"})


def joined_by_xarray(results, dim):
    how = {"data_vars": "minimal", "coords": "minimal", "compat": "override", "join": "override"}
    return xr.concat(results, dim=dim, combine_attrs="override", **how)


@pytest.mark.parametrize("dim", ["member", "step"])
def test_results_are_joined_as_by_xarray(dim):
    results = [member(number) for number in range(3)]
    if dim == "step":
        results = [result.assign_coords(step=[2 * k, 2 * k + 1]) for k, result in enumerate(results)]
    joined = joined_along(dim, results)
    assert_same(joined, joined_by_xarray(results, dim))
    assert float(joined["force"].isel(member=-1).sel(step=joined["step"][-1])) == 4.0


@pytest.mark.parametrize(
    "other",
    [
        member(1, count=("member", [1.0])),
        member(1, force=(("step", "member"), [[1.0], [2.0]])),
        member(1, area=("member", [3.0])),
        member(1, more=1.0),
        member(1).drop_vars("area"),
        member(1).drop_vars("member"),
        member(1, count=("member", np.array(["one"]))),
    ],
)
def test_results_that_are_not_alike_are_left_to_xarray(other):
    assert joined_along("member", [member(0), other]) is None
    assert joined_along("member", [other, member(0)]) is None
