"""Results of surfaces, sets and joints that have no answer: every NaN comes with its reason."""

import functools
import warnings

import numpy as np
import pytest
import xarray as xr
from calls import CALLS, function_of, labelled_functions
from fuzz_faults import infinite, unexplained

import fractalcontact as fc
from fractalcontact.base.errors import FractalContactError

STREAM = np.random.default_rng(1)
NOISE = STREAM.normal(size=(24, 24)) * 1e-6
RAMP = np.arange(24.0) * np.ones((24, 1)) * 1e-6
SPIKE = np.where((np.arange(24) == 5) & (np.arange(24) == 5)[:, None], 1e-5, 0.0)

HEIGHTS = {
    "flat": np.zeros((24, 24)),
    "flat, 4 x 4": np.zeros((4, 4)),
    "3 x 3": NOISE[:3, :3],
    "8 x 8": NOISE[:8, :8],
    "3 x 24": NOISE[:3],
    "ramp": RAMP,
    "spike": SPIKE,
    "step": np.where(RAMP < 12e-6, 0.0, 1e-6),
    "grooves": np.sin(9e5 * RAMP) * 1e-6,
    "with gaps": np.where(STREAM.random((24, 24)) < 0.6, np.nan, NOISE),
    "mostly missing": np.where(STREAM.random((24, 24)) < 0.95, np.nan, NOISE),
    "missing": np.full((24, 24), np.nan),
    "profile": NOISE[0],
    "flat profile": np.zeros(24),
    "short profile": NOISE[0, :4],
}
SHAPES = ((1, 1), (2, 2), (3, 3), (1, 50), (7, 11), (24, 24), (40, 40))


@functools.cache
def surfaces():
    found = {name: fc.surfaces.from_array(heights, 1e-4) for name, heights in HEIGHTS.items()}
    flat = found["flat"].copy()
    for dim in flat.dims:
        flat[dim].attrs["period"] = 24e-4
    return found | {"flat and periodic": flat}


@functools.cache
def masks():
    def of(cells):
        return xr.DataArray(cells, dims=("y", "x"))

    found = {"line": of(np.eye(24, dtype=bool)), "noise": of(NOISE > 1e-6)}
    for shape in SHAPES:
        one = np.zeros(shape, bool)
        one[0, 0] = True
        found |= {f"empty {shape}": of(one & False), f"one {shape}": of(one), f"full {shape}": of(one | True)}
    for case in ("one (1, 1)", "one (2, 2)", "full (3, 3)", "one (7, 11)"):
        wrapping = found[case].assign_coords(
            {dim: np.arange(n) + 0.5 for dim, n in found[case].sizes.items()}
        )
        for dim, n in wrapping.sizes.items():
            wrapping[dim].attrs |= {"units": "m", "period": float(n)}
        found[f"{case}, periodic"] = wrapping
    steps = [found[f"{word} (24, 24)"] for word in ("empty", "one", "full")]
    return found | {"steps": xr.concat(steps, "step"), "empty steps": xr.concat([steps[0]] * 3, "step")}


@functools.cache
def cracks():
    names = ("flat", "ramp", "spike", "step", "grooves")
    found = {name: crack_of(HEIGHTS[name]) for name in names}
    return found | {"rigid": crack_of(NOISE, young=None, poisson=None), "small": crack_of(NOISE[:8, :8])}


def crack_of(heights, **options):
    options = {"young": 30e9, "poisson": 0.2} | options
    block = len(heights) * 2 // 3 * 1e-4
    return fc.joints.Crack(fc.surfaces.from_array(heights, 1e-4), block=block, **options)


@functools.cache
def gaps():
    flat = fc.surfaces.from_array(np.zeros((24, 24)), 1e-4)
    wall = (flat + 1e-5).where(flat.x > flat.x[0], 0.0)
    return {"closed": flat, "open": flat + 1e-5, "wall": wall}


@functools.cache
def closures():
    loads = [0.0, 1.0, 10.0, 30.0, 100.0]
    return {
        name: fc.joints.closure(crack, shear=[0.0, 1e-4], normal_force=loads)
        for name, crack in cracks().items()
        if name != "rigid"
    }


@functools.cache
def dilatancies():
    shear = {"shear": [0.0, 0.5e-4, 1e-4], "direction": ["E", "W"]}
    found = {name: fc.joints.dilatancy(crack, **shear) for name, crack in cracks().items()}
    return found | {"spike under force": fc.joints.dilatancy(cracks()["spike"], normal_force=[1.0], **shear)}


INPUTS = {
    "surface": surfaces,
    "lower": surfaces,
    "mask": masks,
    "masks": lambda: {name: [mask, mask] for name, mask in masks().items()},
    "crack": cracks,
    "gap": gaps,
    "closure": closures,
    "dilatancy": dilatancies,
}


@pytest.mark.parametrize("name", sorted(set(labelled_functions()) & set(CALLS)))
def test_every_missing_number_has_a_reason(name):
    arguments, faults = CALLS[name](), {}
    argument = next((word for word in INPUTS if word in arguments), None)
    for case, value in INPUTS[argument]().items() if argument else [("as it stands", None)]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                result = function_of(name)(**(arguments | ({argument: value} if argument else {})))
            except FractalContactError:
                continue
        # some intervals of joints have no bound, and say so
        if found := unexplained(result) or ("mask" in (argument or "") and infinite(result)):
            faults[case] = found
    assert faults == {}


@pytest.mark.parametrize("method", fc.dimensions.methods())
def test_every_method_gives_its_reasons(method):
    for case, surface in surfaces().items():
        try:
            result = fc.dimensions.estimate(surface, method)
        except FractalContactError:
            continue
        assert unexplained(result) == set(), case


def test_sizes_of_boxes_that_only_other_measures_have_are_named():
    mask = masks()["noise"].isel(x=[*range(24)] * 2, y=[*range(24)] * 2)
    found = fc.domains.evolution(
        xr.concat([mask, mask], "step"), include=["box_dimension", "lacunarity", "correlation_dimension"]
    )
    missing = np.isnan(found["box_count"]).all("step")
    assert missing.any()
    assert found["box_count"].attrs["reason"] == "NaN at sizes of boxes that only the other measures have"
    measured = fc.domains.box_dimension(mask)["box_size"]
    assert not missing.sel(box_size=measured).any()
    assert missing.drop_sel(box_size=measured).all()


def test_reason_of_an_interpolation_error_that_cannot_be_measured():
    delta = fc.joints.delta_surface(cracks()["small"], shear=[0.0, 0.5e-4], direction=30)
    assert np.isnan(delta["interpolation_error"][1])
    assert "no line without gaps" in delta["interpolation_error"].attrs["reason"]
    whole = fc.joints.delta_surface(cracks()["small"], shear=[1e-4], direction="E")
    assert "reason" not in whole["interpolation_error"].attrs


def test_reason_of_a_roughness_coefficient_below_its_scale():
    surface = surfaces()["ramp"] * 1e-3
    found = fc.joints.roughness_coefficient(surface, length=0.5)
    assert np.isnan(found["scaled_roughness_coefficient"]).any()
    assert "negative or missing" in found["scaled_roughness_coefficient"].attrs["reason"]


def test_reason_of_the_decorrelation_length_is_that_of_its_direction():
    result = fc.joints.decorrelation_length(cracks()["ramp"], direction=["E", "N"])
    for end in ("", "_low", "_high"):
        reason = result[f"decorrelation_length{end}"].attrs["reason"]
        assert reason == "NaN: E: the faces are planes; N: the faces are planes"


def test_reasons_come_back_from_a_file(tmp_path):
    result = fc.domains.describe(masks()["empty (24, 24)"])
    assert "set is empty" in result["largest_island"].attrs["reason"]
    xr.testing.assert_identical(fc.open(fc.save(result, tmp_path / "empty.nc")), result)


def test_number_that_is_there_has_no_reason():
    mask = masks()["noise"].assign_coords(x=np.arange(24) * 1e-4, y=np.arange(24) * 1e-4)
    assert "reason" not in fc.domains.describe(mask)["largest_island"].attrs
