"""Public calls with damaged arguments: a clear error that names the argument, or a right answer.

Keep what fails, the smallest call, in KEPT.
"""

import importlib
import inspect

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from calls import (
    CALLS,
    LEFT_OUT,
    REFUSED,
    closed,
    estimates,
    estimators,
    file,
    function_of,
    overview,
    periodic,
    pressed,
    rough,
    slid,
)
from fuzz_faults import damaged_call, fault_of, silently_accepted, unexplained
from fuzz_values import VALUES

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput, TooLittleMemory

# errors of these name what the argument stands for, the file, or the first argument, refused as it stands
UNNAMED = (*REFUSED, "scenes.load", "scenes.template")
# these return what a file or an argument holds
AS_GIVEN = ("open", "scenes.reproduce")


def check(pick):
    name, arguments, done = damaged_call(pick)
    answers = []
    named = () if name in UNNAMED else tuple(inspect.signature(function_of(name)).parameters)

    def call():
        answers.append(function_of(name)(**arguments))
        return answers[0]

    fault = fault_of(call, names=named)
    plt.close("all")
    if answers and fault is None:
        fault = silently_accepted(done, arguments)
        if fault is None and name not in AS_GIVEN and (missing := unexplained(answers[0])):
            fault = f"NaN without a reason in {', '.join(sorted(missing))}"
    assert fault is None, f"{name}({done}): {fault}"


def test_damaged_calls(draw):
    draw(check, times=200)


def with_coordinate(array, dim, values):
    return array.assign_coords({dim: values})


def with_attribute(array, dim, key, value):
    result = array.copy()
    (result if dim is None else result[dim]).attrs[key] = value
    return result


NUMBERS = np.arange(24)
# found by fuzzing: name, argument, value, and what the error names
KEPT = {
    "stress too small to divide by": ("joints.uplift", "total_stress", lambda: 5e-324, "total_stress"),
    "words as coordinates": ("surfaces.describe", "surface", lambda: with_coordinate(
        rough(), "x", [f"c{k}" for k in NUMBERS]), "surface.x"),
    "dates as coordinates": ("dimensions.variogram", "surface", lambda: with_coordinate(
        rough(), "y", np.datetime64("2026-01-01", "ns") + NUMBERS), "surface.y"),
    "time differences as coordinates": ("contact.press", "surface", lambda: with_coordinate(
        periodic(), "x", NUMBERS.astype("timedelta64[ns]")), "surface.x"),
    "complex coordinates": ("domains.box_counts", "mask", lambda: with_coordinate(
        pressed()["state"], "y", NUMBERS * 1j), "mask.y"),
    "period 0": ("surfaces.level", "surface", lambda: with_attribute(rough(), "x", "period", 0.0),
                 "surface.x.period"),
    "a word as period": ("surfaces.fill", "surface", lambda: with_attribute(rough(), "x", "period", "x"),
                         "surface.x.period"),
    "units in a list": ("joints.Crack", "lower", lambda: with_attribute(
        rough(), None, "units", np.array(["m", "mm"])), "lower.units"),
    "millimetres": ("joints.transmissivity", "gap", lambda: with_attribute(
        pressed()["gap"], "x", "units", "mm"), "gap.x.units"),
    "heights in time": ("surfaces.despike", "surface", lambda: rough().astype("timedelta64[ns]"), "surface"),
    "infinite heights": ("joints.register", "lower", lambda: rough().where(rough() > 0, np.inf), "lower"),
    "no planes": ("surfaces.describe", "surface", lambda: rough().expand_dims(member=[]), "surface.member"),
    "a Dataset as a number": ("contact.effective_modulus", "poisson", xr.Dataset, "poisson"),
    "a date as a number": ("surfaces.fbm", "lag", lambda: np.datetime64("2026-01-01"), "lag"),
    "words that are numbers": ("joints.dilatancy", "shear", lambda: ["1e-4"], "shear"),
    "a list in itself": ("joints.size_effect", "size_ratio", VALUES["itself"], "size_ratio"),
    "ragged loads": ("joints.bandis_closure", "nominal_pressure", VALUES["ragged"], "nominal_pressure"),
    "masked loads": ("contact.press", "nominal_pressure", VALUES["masked array"], "nominal_pressure"),
    "members beyond memory": ("surfaces.midpoint", "members", lambda: 10**12, "memory"),
    "a surface beyond memory": ("surfaces.spectral", "shape", lambda: (10**7, 10**7), "memory"),
    "an array beyond memory": ("surfaces.from_array", "heights", lambda: np.broadcast_to(1.0, (10**6, 10**6)),
                               "memory"),
    "a mask with a number as units": ("domains.islands", "mask", lambda: with_attribute(
        pressed()["state"], None, "units", 3), "mask.units"),
    "a word as a flag": ("contact.press", "progress", lambda: "no", "progress"),
    "a number as a path": ("open", "path", lambda: 3, "path"),
    "a long name": ("save", "path", lambda: "x" * 300 + ".nc", "path"),
    "a number as a scene": ("scenes.plan", "scene", lambda: 3, "scene"),
    "a word as units of figures": ("plotting.draw", "units", lambda: "no", "units"),
    "an object that is no array as axes": ("plotting.curves", "axes", VALUES["class without array"], "axes"),
    "a list as axes": ("plotting.plot contact_area", "ax", list, "ax"),
    "another unit in a figure": ("plotting.dilatancy", "result", lambda: slid().assign(
        shear=slid()["shear"].assign_attrs(units="mm")), "result.shear.units"),
    "descending in a figure": ("plotting.surface", "surface", lambda: rough()[:, ::-1], "surface.x"),
    "no steps in a figure": ("plotting.plot closure", "result", lambda: closed().isel(step=slice(0)),
                             "result.step"),
    "bytes as a model": ("joints.hydraulic_aperture", "model", lambda: np.void(b"abc"), "model"),
    "a wall without strength": ("joints.bandis_closure", "wall_strength", lambda: 5e-324, "wall_strength"),
    "a number as the file of a report": ("scenes.report", "path", lambda: 3, "path"),
    "a list as a study": ("scenes.report", "result", list, "result"),
    "a file that is missing among figures": ("scenes.report", "figures", lambda: ["nowhere.png"], "figures"),
    "a file as the folder of a report": ("scenes.report", "path", lambda: file("surface") / "a.html", "path"),
    "a file as the folder of maps": ("scenes.export", "folder", lambda: file("surface"), "folder"),
    "a file as the folder of tables": ("scenes.tables", "folder", lambda: file("surface"), "folder"),
    "a file as the folder of figures": ("plotting.draw", "folder", lambda: file("surface"), "folder"),
    "a number as the folder of a scene": ("scenes.template", "folder", lambda: 3, "folder"),
    "two fields in a map": ("plotting.field", "data", lambda: pressed()[["gap", "pressure"]], "data"),
    "two fields as heights": ("plotting.surface", "surface", lambda: pressed()[["gap", "pressure"]],
                              "surface"),
    "a blur of a million kilometres": ("dimensions.estimate", "psf", lambda: 1e9, "psf"),
    "results without the truth": ("accuracy.summary", "results", lambda: estimators().drop_vars("bias"),
                                  "results.bias"),
    "triangles nested too deeply": ("surfaces.from_points", "triangles", VALUES["deep"], "triangles"),
    "no array as points": ("surfaces.fit_plane", "points", VALUES["class without array"], "points"),
    "no wavelengths in a figure": ("plotting.scaling", "result", lambda: fc.dimensions.scaling(
        rough(48)).isel(wavelength=slice(0)), "result.wavelength"),
    "no sizes in a figure": ("plotting.plot estimator_errors", "result", lambda: estimators().isel(
        size=slice(0)), "result.size"),
    "words as coordinates of maps": ("scenes.export", "result", lambda: with_coordinate(
        rough(), "y", [f"c{k}" for k in NUMBERS]), "result.y"),
    "words as numbers of scans": ("plotting.plot scans", "result", lambda: overview().assign(
        rms_height=("scan", ["a", "b", "c"])), "result.rms_height"),
    "surfaces over steps": ("contact.press", "surface", lambda: periodic().expand_dims(step=[1]),
                            "surface.dims"),
    "one number as those marked": ("plotting.dilatancy", "marked", lambda: np.array(1.0), "marked"),
    "words as errors of scans": ("dimensions.pool", "scans", lambda: estimates().assign(
        standard_error=("method", ["a", "b"])), "scans.standard_error"),
    "azimuth in time": ("joints.direct_shear", "direction", lambda: np.timedelta64(1, "s"), "direction"),
}  # fmt: skip


@pytest.mark.parametrize("case", KEPT)
def test_kept_case_gives_a_clear_error(case):
    name, argument, make, named = KEPT[case]
    with pytest.raises(InvalidInput) as caught:
        function_of(name)(**{**CALLS[name](), argument: make()})
    assert any(line.startswith(f"{named}:") for line in caught.value.problems), caught.value


def test_every_public_function_is_called():
    names = {"save", "open"}
    for subpackage in set(fc.__all__) - names:
        module = importlib.import_module(f"fractalcontact.{subpackage}")
        names |= {f"{subpackage}.{name}" for name in module.__all__}
    assert {name.partition(" ")[0] for name in CALLS} | LEFT_OUT == names
    assert not set(CALLS) & LEFT_OUT


@pytest.mark.parametrize("name", sorted(set(CALLS) - set(REFUSED)))
def test_call_succeeds_as_it_stands(name):
    assert fault_of(lambda: function_of(name)(**CALLS[name]()), refused=False) is None
    plt.close("all")


def test_transposed_field_is_drawn_like_the_field():
    gap = pressed()["gap"].isel(step=0)
    images = [fc.plotting.field(plane).images[0].get_array() for plane in (gap, gap.transpose())]
    assert np.array_equal(*images)


def test_small_numpy_types_do_not_overflow():
    surface = rough().where(rough().x > 2e-4)
    assert np.array_equal(fc.surfaces.fill(surface, at_most=np.int8(1)), fc.surfaces.fill(surface, at_most=1))


@pytest.mark.parametrize("generator", ["fbm", "spectral", "midpoint", "weierstrass"])
def test_surface_beyond_memory_does_not_hide_other_problems(generator):
    call = CALLS[f"surfaces.{generator}"]() | {"shape": (10**6, 10**6)}
    with pytest.raises(TooLittleMemory, match=r"memory: .* a shape of (1000000|1e\+06) x "):
        function_of(f"surfaces.{generator}")(**call)
    with pytest.raises(InvalidInput, match="hurst") as caught:
        function_of(f"surfaces.{generator}")(**call | {"hurst": 10**400})
    assert "memory" not in str(caught.value)


def test_several_wrong_arguments_are_all_listed():
    with pytest.raises(InvalidInput) as caught:
        fc.domains.box_counts(rough().values, "x", periodic="no", valid=3, cover="y")
    named = {line.partition(":")[0] for line in caught.value.problems}
    assert named == {"mask", "box_sizes", "periodic", "valid", "cover"}
