"""One valid call of every public function: its arguments, made anew for every call.

Tests of what all functions have in common take it from here: labels, files, coordinates of the user's own,
wrong arguments, missing numbers, threads and processes, damaged arguments. A new function needs one line in
`CALLS`, unless `SAMPLES` has all its arguments without a default, or it is a kind of figure with the name of
a function. A line with further arguments makes the sample as `SAMPLES` does: `{"mask": pressed()["state"],
"size": 3}`.
"""

import functools
import importlib
import inspect
import os
import tempfile
import threading
from pathlib import Path

import numpy as np
import skimage as ski
import xarray as xr

import fractalcontact as fc
from fractalcontact.plotting._draw import KINDS

SPACING = 1e-4
PLACE = Path(tempfile.gettempdir()) / "fractalcontact_calls"
SUBPACKAGES = ("surfaces", "dimensions", "contact", "domains", "joints")


@functools.cache
def rough(n=24):
    return fc.surfaces.fbm((n, n), SPACING, hurst=0.7, rms_increment=5e-6, rng=11)


@functools.cache
def periodic(n=24):
    return fc.surfaces.spectral((n, n), SPACING, hurst=0.8, rms_height=1e-5, rng=12)


@functools.cache
def crack():
    return fc.joints.Crack(rough(), young=30e9, poisson=0.2, block=1.6e-3)


@functools.cache
def pressed():
    maps = ("state", "pressure", "gap")
    return fc.contact.press(periodic(), contact_modulus=1e9, nominal_pressure=[1e6, 1e7], keep=maps)


@functools.cache
def closed():
    loads = [1.0, 3.0, 10.0, 30.0]
    return fc.joints.closure(crack(), shear=[1e-4], normal_force=loads, keep=("state", "gap", "pressure"))


@functools.cache
def slid():
    shears = [0.0, 1e-4, 2e-4, 3e-4]
    return fc.joints.dilatancy(crack(), shear=shears, direction=["E", "W"], normal_force=[1.0, 10.0])


@functools.cache
def study():
    return fc.scenes.run("rigid_sliding", progress=False)


@functools.cache
def laws():
    return fc.joints.closure_laws(closed())


@functools.cache
def distributed():
    return fc.contact.press(
        rough(), contact_modulus=1e9, nominal_pressure=[1e4, 1e5], include=["pressure_distribution"]
    )


@functools.cache
def watered():
    return fc.joints.uplift(pressed()["gap"].isel(step=0), upstream_pressure=1e5)


@functools.cache
def estimates():
    return fc.dimensions.estimate(rough(), ["variogram", "spectrum"])


@functools.cache
def curve():
    return fc.dimensions.variogram(rough())


def overview():
    heights = ("scan", [1e-6, 2e-6, 4e-6], {"units": "m", "long_name": "rms height"})
    return xr.Dataset({"rms_height": heights}, coords={"scan": ["a.sur", "b.sur", "c.sur"]})


@functools.cache
def slipped():
    return fc.contact.partial_slip(**CALLS["contact.partial_slip"]())


@functools.cache
def cloud():
    return np.random.default_rng(13).random((60, 3)) * [1e-2, 1e-2, 1e-3]


@functools.cache
def measured():
    method = fc.accuracy.Method("m", [4, 8], lambda n: n, lambda n: n, lambda n, _: 1.0 / n)
    return fc.accuracy.measure({"surfaces": [fc.accuracy.Benchmark("b", "e", "t", (method,))]}, budget=0.1)


@functools.cache
def estimators():
    return fc.accuracy.estimators(0.5, 16, "fbm", "increments", members=4, rng=1)


@functools.cache
def result_of(name):
    """Return the result of the valid call of a function."""
    return function_of(name)(**CALLS[name]())


@functools.cache
def file(name):
    PLACE.mkdir(exist_ok=True)
    return fc.save(rough(), PLACE / f"{name}.nc")


@functools.cache
def points_file():
    PLACE.mkdir(exist_ok=True)
    np.savetxt(PLACE / "points.xyz", cloud())
    return PLACE / "points.xyz"


@functools.cache
def image_file():
    PLACE.mkdir(exist_ok=True)
    ski.io.imsave(PLACE / "mask.png", np.uint8(255 * np.eye(9)), check_contrast=False)
    return PLACE / "mask.png"


def place():
    """Return a folder of this thread, for the files that a call writes."""
    folder = PLACE / f"{os.getpid()}-{threading.get_ident()}"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


GENERATOR = {"shape": (8, 8), "spacing": SPACING, "hurst": 0.5, "rng": 1}
PRESS = {"contact_modulus": 1e9, "nominal_pressure": 1e4}

CALLS = {
    "surfaces.SelfAffine": lambda: {"hurst": 0.8, "long_cutoff": 1e-3, "rolloff": 1e-4, "short_cutoff": 1e-5},
    "surfaces.fbm": lambda: GENERATOR | {"rms_increment": 1e-6},
    "surfaces.spectral": lambda: GENERATOR | {"rms_height": 1e-6},
    "surfaces.midpoint": lambda: GENERATOR | {"rms_increment": 1e-6},
    "surfaces.weierstrass": lambda: GENERATOR | {"rms_height": 1e-6},
    "surfaces.from_array": lambda: {"heights": rough().values, "spacing": SPACING},
    "surfaces.read": lambda: {"path": file("surface")},
    "surfaces.sample": lambda: {"name": "concrete_crack"},
    "surfaces.read_points": lambda: {"path": points_file()},
    "surfaces.fit_plane": lambda: {"points": cloud()},
    "surfaces.from_points": lambda: {"points": cloud(), "spacing": 1e-3},
    "surfaces.gaussian_filter": lambda: {"surface": rough(), "cutoff": 4.0 * SPACING},
    "surfaces.fill": lambda: {"surface": rough().where(rough().x > 2e-4)},
    "dimensions.estimate": lambda: {"surface": rough(), "methods": ["variogram", "likelihood"]},
    "dimensions.hurst_map": lambda: {"surface": rough(), "window": 1.6e-3},
    "dimensions.scaling": lambda: {"surface": rough(48)},
    "dimensions.pool": lambda: {"scans": estimates()},
    "dimensions.spectrum": lambda: {"surface": periodic()},
    "contact.effective_modulus": lambda: {"young": 1e9, "poisson": 0.2, "young2": 1e9, "poisson2": 0.2},
    "contact.effective_poisson": lambda: {"young": 1e9, "poisson": 0.2, "young2": 1e9, "poisson2": 0.2},
    "contact.theories": lambda: {"surface": rough(), "contact_modulus": 1e9, "nominal_pressure": [1e4, 1e5]},
    "contact.flat_stiffness": lambda: {"shape": (8, 8), "spacing": SPACING, "contact_modulus": 1e9},
    "contact.press": lambda: PRESS | {"surface": periodic()},
    "contact.partial_slip": lambda: PRESS
    | {"surface": periodic(), "poisson": 0.2, "friction_coefficient": 0.5, "tangential_force": 0.01},
    "joints.Crack": lambda: {"lower": rough(), "upper": rough() + 1e-5, "young": 1e10, "poisson": 0.2},
    "joints.area_by_resolution": lambda: {
        "crack": crack(), "shear": [1e-4], "factors": [1, 2], "normal_force": [1.0, 10.0],
    },
    "joints.direct_shear": lambda: {
        "crack": crack(), "path": 2e-4, "nominal_pressure": [1e6], "hardness": 1e9,
    },
    "joints.partial_slip": lambda: {
        "crack": crack(), "shear": [1e-4], "normal_force": 10.0, "tangential_force": [1.0, -1.0],
    },
    "joints.self_weight": lambda: {
        "crack": crack(), "structure_size": [1.0, 10.0], "unit_weight": 24e3, "shear": [1e-4],
    },
    "joints.shear_curve": lambda: {
        "surface": rough(), "displacement": [0.0, 1e-3], "nominal_pressure": [1e5, 1e6],
        "wall_strength": 1e8, "residual_friction_angle": 30,
    },
    "joints.bandis_closure": lambda: {
        "nominal_pressure": [1e6, 1e7], "roughness_coefficient": 10, "wall_strength": 5e7,
        "compressive_strength": 1e8,
    },
    "joints.hydraulic_aperture": lambda: {"aperture": 1e-4, "roughness_coefficient": 10},
    "joints.closure": lambda: {"crack": crack(), "shear": [1e-4], "normal_force": [1.0, 10.0]},
    "joints.delta_dimension": lambda: {"crack": crack(), "shear": [1e-4]},
    "joints.delta_surface": lambda: {"crack": crack(), "shear": [1e-4], "direction": "W"},
    "joints.dilatancy": lambda: {"crack": crack(), "shear": [0.0, 1e-4]},
    "joints.register": lambda: {"lower": rough(), "upper": rough() + 1e-5},
    "joints.roughness_coefficient": lambda: {"surface": rough(), "lag": 4e-4},
    "joints.size_effect": lambda: {"size_ratio": [2.0, 4.0], "contact_dimension": 1.5},
    "joints.strength_envelope": lambda: {
        "surface": rough(), "nominal_pressure": [1e5, 1e6], "wall_strength": 1e8, "basic_friction_angle": 30,
    },
    "joints.uplift": lambda: {"gap": pressed()["gap"], "upstream_pressure": 1e5, "drains": [(8e-4, 8e-4)]},
    "domains.area_dimension": lambda: {"masks": [pressed()["state"], pressed()["state"][..., ::2, ::2]]},
    "domains.read_mask": lambda: {"path": image_file(), "spacing": SPACING},
    "save": lambda: {"result": rough(), "path": place() / "saved.nc"},
    "open": lambda: {"path": file("opened")},
    "scenes.load": lambda: {"path": "pressed_surface"},
    "scenes.plan": lambda: {"scene": fc.scenes.load("rigid_sliding")},
    "scenes.validate": lambda: {"scene": "rigid_sliding"},
    "scenes.summary": lambda: {"tree": study()},
    "scenes.datasheet": lambda: {"tree": xr.DataTree.from_dict({"/joints/closure_laws": laws()})},
    "scenes.reproduce": lambda: {"result": rough()},
    "scenes.report": lambda: {"result": study(), "path": place() / "report.html"},
    "scenes.tables": lambda: {"result": study()},
    "scenes.export": lambda: {"result": rough(), "folder": place() / "maps", "to": "tiff", "force": True},
    "scenes.template": lambda: {"question": "roughness", "scan": file("scan"), "folder": place()},
    "plotting.surface": lambda: {"surface": rough(), "block": rough()[:8, :8]},
    "plotting.field": lambda: {"data": pressed()["gap"].isel(step=0)},
    "plotting.plot contact_domains": lambda: {"result": pressed()},
    "plotting.plot contact_area": lambda: {"result": closed()},
    "plotting.curves": lambda: {"axes": fc.plotting.plot(closed(), "contact_area")},
    "plotting.plot": lambda: {"result": closed()},
    "plotting.path": lambda: {
        "result": closed(), "variable": ["mean_gap", "closure"], "against": "normal_force",
    },
    "plotting.plot pressure_distribution": lambda: {"result": distributed()},
    "plotting.plot closure": lambda: {"result": closed(), "laws": laws()},
    "plotting.dilatancy": lambda: {"result": slid(), "direction": "E"},
    "plotting.friction": lambda: {"result": result_of("joints.friction"), "direction": "E"},
    "plotting.plot first_contact": lambda: {"result": pressed()},
    "plotting.plot alluvial": lambda: {"result": result_of("domains.lineage")},
    "plotting.plot hydraulic_aperture": lambda: {"result": result_of("joints.transmissivity")},
    "plotting.uplift": lambda: {"result": watered()},
    "plotting.dimensions": lambda: {"result": estimates()},
    "plotting.plot dimension_curves": lambda: {"result": curve(), "estimates": estimates()},
    "plotting.plot scans": lambda: {"result": overview()},
    "plotting.plot error_against_time": lambda: {"result": measured()},
    "plotting.plot estimator_errors": lambda: {"result": estimators()},
    "plotting.plot slip_loops": lambda: {"result": result_of("joints.partial_slip")},
    "plotting.draw": lambda: {"tree": study(), "folder": place() / "figures"},
    "accuracy.benchmarks": lambda: {"subpackage": "surfaces"},
    "accuracy.summary": lambda: {"results": estimators()},
    "accuracy.estimators": lambda: {"hurst": 0.5, "sizes": 8, "families": "nothing", "members": 2},
}  # fmt: skip


# of functions that need nothing else, and are not in `CALLS`
SAMPLES = {
    "surface": rough,
    "crack": crack,
    "mask": lambda: pressed()["state"],
    "gap": lambda: pressed()["gap"],
    "closure": closed,
    "dilatancy": slid,
}


def _called_with_samples():
    """Yield the call of every function that needs samples alone, and has none of its own."""
    for subpackage in SUBPACKAGES:
        module = importlib.import_module(f"fractalcontact.{subpackage}")
        for name in module.__all__:
            parameters = inspect.signature(getattr(module, name)).parameters.values()
            required = [each.name for each in parameters if each.default is each.empty]
            if required and set(required) <= SAMPLES.keys() and f"{subpackage}.{name}" not in CALLS:
                yield f"{subpackage}.{name}", functools.partial(_samples, required)


def _samples(names):
    return {name: SAMPLES[name]() for name in names}


def function_of(name):
    """Return a public function by its name, as `surfaces.fbm`, or of a kind, as `plotting.plot scans`."""
    name, _, kind = name.partition(" ")
    *subpackage, word = name.split(".")
    module = importlib.import_module(".".join(["fractalcontact", *subpackage])) if subpackage else fc
    return functools.partial(getattr(module, word), kind=kind) if kind else getattr(module, word)


def options_of(kind):
    """Return the names of the options of a kind of figure."""
    return list(inspect.signature(KINDS[kind][0]).parameters)[1:]


def figure_name(kind):
    """Return the name of the function that draws a kind of figure, or that of `plot` with the kind."""
    return f"plotting.{kind}" if kind in fc.plotting.__all__ else f"plotting.plot {kind}"


def _named_alike():
    """Yield the call of every figure with the name of a function, if it has none: with its result."""
    for kind in KINDS:
        source = next((f"{each}.{kind}" for each in SUBPACKAGES if f"{each}.{kind}" in CALLS), None)
        name = figure_name(kind)
        if source is not None and name not in CALLS:
            argument = next(iter(inspect.signature(function_of(name)).parameters))
            yield name, functools.partial(_result_as, argument, source)


def _result_as(argument, source):
    return {argument: result_of(source)}


CALLS |= dict(_called_with_samples())
CALLS |= dict(_named_alike())

# this is refused as it stands, because it would take long
REFUSED = ("accuracy.estimators",)
# not called: `scenes.run` takes damaged scenes (`fuzz_scenes`), the next take as long as they are told to,
# others have no arguments, and the rest are no functions
LEFT_OUT = {
    "scenes.run", "accuracy.measure",
    "dimensions.methods", "scenes.json_schema",
    "accuracy.Benchmark", "accuracy.Method",
    "scenes.Scene",
}  # fmt: skip


# these return an object, a number or a table of words, not labelled data
UNLABELLED = {
    "joints.Crack",
    "contact.effective_modulus",
    "contact.effective_poisson",
    "contact.flat_stiffness",
    "dimensions.methods",
    "surfaces.SelfAffine",
}


def labelled_functions():
    """Return the names of the public functions that return labelled data."""
    return [
        f"{subpackage}.{name}"
        for subpackage in SUBPACKAGES
        for name in importlib.import_module(f"fractalcontact.{subpackage}").__all__
        if f"{subpackage}.{name}" not in UNLABELLED
    ]
