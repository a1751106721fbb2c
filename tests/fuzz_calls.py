"""Public functions with one valid call each, and calls with some of their arguments damaged."""

import functools
import importlib
import inspect
import signal
import tempfile
import warnings
from pathlib import Path

import numpy as np
import xarray as xr
from fuzz_values import damaged, wrong_value

import fractalcontact as fc
from fractalcontact.base.errors import FractalContactError, FractalContactWarning, InvalidInput

SPACING = 1e-4
PLACE = Path(tempfile.gettempdir()) / "fractalcontact_fuzz"


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
def rubbed():
    return fc.joints.friction(slid())


@functools.cache
def islands():
    return fc.domains.islands(pressed()["state"])


@functools.cache
def lacunarity():
    return fc.domains.lacunarity(pressed()["state"])


@functools.cache
def boxes():
    return fc.domains.box_dimension(pressed()["state"])


@functools.cache
def flow():
    return fc.joints.transmissivity(pressed()["gap"])


@functools.cache
def laws():
    return fc.joints.closure_laws(closed())


@functools.cache
def distributed():
    return fc.contact.press(
        rough(), contact_modulus=1e9, nominal_pressure=[1e4, 1e5], also=["pressure_distribution"]
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


@functools.cache
def roses():
    return fc.joints.directional_roughness(rough())


@functools.cache
def envelope():
    loads = {"nominal_pressure": [1e5, 1e6], "wall_strength": 1e8, "basic_friction_angle": 30}
    return fc.joints.strength_envelope(rough(), **loads)


@functools.cache
def memory():
    return fc.joints.decorrelation_length(crack())


@functools.cache
def delta():
    return fc.joints.delta_dimension(crack(), shear=[1e-4, 2e-4])


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
def extremes():
    """Return what `accuracy.extremes` tells of one case, without the process that it starts."""
    return fc.accuracy.extremes("one cell")


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
    "surfaces.level": lambda: {"surface": rough()},
    "surfaces.gaussian_filter": lambda: {"surface": rough(), "cutoff": 4.0 * SPACING},
    "surfaces.texture": lambda: {"surface": rough()},
    "surfaces.fill": lambda: {"surface": rough().where(rough().x > 2e-4)},
    "surfaces.despike": lambda: {"surface": rough()},
    "surfaces.describe": lambda: {"surface": rough()},
    **{
        f"dimensions.{name}": lambda: {"surface": rough()}
        for name in (
            "covering",
            "cube_counts",
            "detrended_fluctuation",
            "directions",
            "divider",
            "height_lacunarity",
            "higuchi",
            "madogram",
            "roughness_length",
            "variation",
        )
    },
    "dimensions.estimate": lambda: {"surface": rough(), "methods": ["variogram", "likelihood"]},
    "dimensions.hurst_map": lambda: {"surface": rough(), "window": 1.6e-3},
    "dimensions.scaling": lambda: {"surface": rough(48)},
    "dimensions.waves": lambda: {"surface": rough()},
    "dimensions.second_variogram": lambda: {"surface": rough()},
    "dimensions.spectrum": lambda: {"surface": periodic()},
    "dimensions.variogram": lambda: {"surface": rough()},
    "contact.ContactOptions": dict,
    "contact.LoadPath": lambda: {"control": "closure", "values": (1e-6,)},
    "contact.effective_modulus": lambda: {"young": 1e9, "poisson": 0.2, "young2": 1e9, "poisson2": 0.2},
    "contact.effective_poisson": lambda: {"young": 1e9, "poisson": 0.2, "young2": 1e9, "poisson2": 0.2},
    "contact.theories": lambda: {"surface": rough(), "contact_modulus": 1e9, "nominal_pressure": [1e4, 1e5]},
    "contact.flat_stiffness": lambda: {"shape": (8, 8), "spacing": SPACING, "contact_modulus": 1e9},
    "contact.press": lambda: PRESS | {"surface": periodic()},
    "contact.partial_slip": lambda: PRESS
    | {"surface": periodic(), "poisson": 0.2, "friction_coefficient": 0.5, "tangential_force": 0.01},
    "joints.Crack": lambda: {"lower": rough(), "upper": rough() + 1e-5, "young": 1e10, "poisson": 0.2},
    "joints.area_dimension": lambda: {
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
    "joints.bandis_aperture": lambda: {
        "roughness": 10, "wall_strength": 5e7, "compressive_strength": 1e8,
    },
    "joints.hydraulic_aperture": lambda: {"aperture": 1e-4, "roughness": 10},
    "joints.bandis_closure": lambda: {
        "nominal_pressure": 1e6, "initial_stiffness": 1e9, "greatest_closure": 1e-4,
    },
    "joints.bandis_constants": lambda: {"roughness": 10, "wall_strength": 1e8, "aperture": 1e-4},
    "joints.barton_bandis_scaled": lambda: {"roughness": 10, "wall_strength": 1e8, "length": 1.0},
    "joints.barton_choubey_strength": lambda: {
        "nominal_pressure": 1e6, "roughness": 10, "wall_strength": 1e8, "residual_angle": 30,
    },
    "joints.closure": lambda: {"crack": crack(), "shear": [1e-4], "normal_force": [1.0, 10.0]},
    "joints.closure_laws": lambda: {"closure": closed()},
    "joints.cyclic_shear": lambda: {"dilatancy": slid(), "path": [0.0, 3e-4, -3e-4, 0.0]},
    "joints.decorrelation_length": lambda: {"crack": crack()},
    "joints.delta_dimension": lambda: {"crack": crack(), "shear": [1e-4]},
    "joints.delta_surface": lambda: {"crack": crack(), "shear": [1e-4], "direction": "W"},
    "joints.dilatancy": lambda: {"crack": crack(), "shear": [0.0, 1e-4]},
    "joints.directional_roughness": lambda: {"surface": rough()},
    "joints.friction": lambda: {"dilatancy": slid()},
    "joints.register": lambda: {"lower": rough(), "upper": rough() + 1e-5},
    "joints.roughness_coefficient": lambda: {"surface": rough(), "lag": 4e-4},
    "joints.self_weight_strength": lambda: {"length": 1.0, "unit_weight": 1e4, "friction_angle": 30},
    "joints.size_effect": lambda: {"scale": 2.0, "contact_dimension": 1.5},
    "joints.strength_envelope": lambda: {
        "surface": rough(), "nominal_pressure": [1e5, 1e6], "wall_strength": 1e8, "basic_friction_angle": 30,
    },
    "joints.transmissivity": lambda: {"gap": pressed()["gap"]},
    "joints.uplift": lambda: {"gap": pressed()["gap"], "upstream_pressure": 1e5, "drains": [(8e-4, 8e-4)]},
    **{
        f"domains.{name}": lambda: {"mask": pressed()["state"]}
        for name in (
            "boundary_dimension", "box_counts", "box_dimension", "correlation_dimension", "describe",
            "evolution", "generalised_dimensions", "islands", "lacunarity", "lineage", "minkowski_dimension",
            "percolation",
        )
    },
    "domains.area_dimension": lambda: {"masks": [pressed()["state"], pressed()["state"][..., ::2, ::2]]},
    "domains.read_mask": lambda: {"path": "nowhere.png", "spacing": SPACING},
    "save": lambda: {"result": rough(), "path": PLACE / "saved.nc"},
    "open": lambda: {"path": file("opened")},
    "scenes.load": lambda: {"path": "pressed_surface"},
    "scenes.plan": lambda: {"scene": fc.scenes.load("rigid_sliding")},
    "scenes.validate": lambda: {"scene": "rigid_sliding"},
    "scenes.contents": lambda: {"path": file("contents")},
    "scenes.summary": lambda: {"tree": study()},
    "scenes.paper_table": lambda: {"tree": study()},
    "scenes.reproduce": lambda: {"result": rough()},
    "scenes.report": lambda: {"result": study(), "path": PLACE / "report.html"},
    "scenes.tables": lambda: {"result": study()},
    "scenes.template": lambda: {"question": "roughness", "scan": file("scan"), "folder": PLACE},
    "plotting.surface": lambda: {"surface": rough(), "block": rough()[:8, :8]},
    "plotting.field": lambda: {"data": pressed()["gap"].isel(step=0)},
    "plotting.contact_domains": lambda: {"result": pressed()},
    "plotting.contact_area": lambda: {"result": closed()},
    "plotting.curves": lambda: {"axes": fc.plotting.contact_area(closed())},
    "plotting.closure_fits": lambda: {"closure": closed(), "laws": laws()},
    "plotting.mean_gap": lambda: {"result": closed()},
    "plotting.stiffness": lambda: {"result": laws()},
    "plotting.pressure_distribution": lambda: {"result": distributed()},
    "plotting.closure_laws": lambda: {"closure": closed()},
    "plotting.rigid_dilatancy": lambda: {"dilatancy": slid()},
    "plotting.elastic_dilatancy": lambda: {"dilatancy": slid(), "direction": "E"},
    "plotting.friction": lambda: {"result": rubbed(), "direction": "E"},
    "plotting.islands": lambda: {"result": islands()},
    "plotting.island_map": lambda: {"result": islands().isel(step=0)},
    "plotting.lacunarity": lambda: {"result": lacunarity()},
    "plotting.box_dimension": lambda: {"result": boxes()},
    "plotting.local_slopes": lambda: {"result": boxes()},
    "plotting.hydraulic_aperture": lambda: {"result": flow()},
    "plotting.uplift": lambda: {"result": watered()},
    "plotting.dimensions": lambda: {"estimates": estimates()},
    "plotting.dimension_curves": lambda: {"curves": curve(), "estimates": estimates()},
    "plotting.directional_roughness": lambda: {"result": roses()},
    "plotting.strength_envelope": lambda: {"result": envelope()},
    "plotting.correlation": lambda: {"memory": memory()},
    "plotting.delta_dimension": lambda: {"dimension": delta()},
    "plotting.slip_domains": lambda: {"result": slipped()},
    "plotting.sliding_scheme": lambda: {
        "surface": rough(), "delta": fc.joints.delta_surface(crack(), [1e-4], "W"),
    },
    "plotting.paper_figure": lambda: {"tree": study(), "number": 5},
    "plotting.area_dimension": lambda: {"result": result_of("joints.area_dimension")},
    "plotting.datasheet": lambda: {
        "tree": xr.DataTree.from_dict({"/joints/closure_laws": laws()}), "notes": ["a note"],
    },
    "plotting.error_against_time": lambda: {"measured": measured()},
    "plotting.estimator_errors": lambda: {"bench": estimators()},
    "plotting.scaling": lambda: {"result": result_of("dimensions.scaling")},
    "plotting.self_weight": lambda: {"result": result_of("joints.self_weight")},
    "plotting.shear_curve": lambda: {"result": result_of("joints.direct_shear")},
    "plotting.slip_loops": lambda: {"result": result_of("joints.partial_slip")},
    "plotting.draw": lambda: {"tree": study(), "folder": PLACE / "figures"},
    "accuracy.benchmarks": lambda: {"subpackage": "surfaces"},
    "accuracy.summary": lambda: {"results": estimators()},
    "accuracy.worst_results": lambda: {"results": extremes()},
    "accuracy.estimators": lambda: {"hurst": 0.5, "sizes": 8, "families": "nothing", "members": 2},
}  # fmt: skip

# these are refused as they stand, because they would take long or need a file
REFUSED = ("accuracy.estimators", "domains.read_mask")
# not called: `scenes.run` takes damaged scenes (`fuzz_scenes`), the next take as long as they are told to,
# others have no arguments, and the rest are no functions
LEFT_OUT = {
    "scenes.run", "accuracy.examine", "accuracy.extremes", "accuracy.measure",
    "dimensions.methods", "scenes.json_schema", "scenes.paper_criteria",
    "accuracy.Benchmark", "accuracy.Case", "accuracy.Method", "accuracy.Result", "accuracy.cases",
    "joints.PARK_PAULAY", "scenes.Scene",
}  # fmt: skip
# a damaged argument of this kind is never accepted where it lies on a grid
LABELLED = ("surface", "mask", "lower", "upper", "gap")


def function_of(name):
    """Return a public function by its name, as `surfaces.fbm`."""
    *subpackage, word = name.split(".")
    module = importlib.import_module(".".join(["fractalcontact", *subpackage])) if subpackage else fc
    return getattr(module, word)


def damaged_call(pick, names=None):
    """Return the name of a function, its arguments, and what was done to each damaged one."""
    name = pick(sorted(names or CALLS))
    arguments = dict(CALLS[name]())
    signature = inspect.signature(function_of(name))
    parameters = [word for word, each in signature.parameters.items() if each.kind != each.VAR_KEYWORD]
    done = {}
    for _ in range(pick([1, 1, 1, 1, 2, 3])):
        argument = pick(parameters)
        if argument in done:
            continue
        value = arguments.get(argument)
        if isinstance(value, (xr.DataArray, xr.Dataset)) and pick([True, True, False]):
            done[argument], arguments[argument] = damaged(value, pick)
        elif isinstance(value, list) and value and pick([True, False]):
            what, entry = wrong_value(pick)
            done[argument] = f"a list with {what}"
            arguments[argument] = [*value, entry]
        else:
            done[argument], arguments[argument] = wrong_value(pick)
    return name, arguments, done


class TooSlow(BaseException):
    """A call that takes longer than its limit."""


def _stop(*_):
    raise TooSlow


def fault_of(call, *, seconds=20, names=(), refused=True):
    """Return what is wrong with a call: None for a clear error or a result without infinite numbers.

    With `refused=False` a clear error is wrong, too.

    `seconds` are those of the processors, because others may use the machine; a call that waits, for a pipe
    for example, is stopped after ten times as long.
    """
    alarms = {signal.SIGPROF: signal.ITIMER_PROF, signal.SIGALRM: signal.ITIMER_REAL}
    before = {number: signal.signal(number, _stop) for number in alarms}
    signal.setitimer(signal.ITIMER_PROF, seconds)
    signal.setitimer(signal.ITIMER_REAL, 10 * seconds)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", FractalContactWarning)
            warnings.filterwarnings("ignore", message=".*linear elasticity is an approximation")
            result = call()
    except FractalContactError as error:
        if not refused:
            return f"refused: {error}"
        return _unnamed(error, names) if isinstance(error, InvalidInput) else None
    except TooSlow:
        return f"longer than {seconds} s"
    except Exception as error:
        return f"{type(error).__name__}: {str(error)[:200]}"
    finally:
        for number, timer in alarms.items():
            signal.setitimer(timer, 0)
            signal.signal(number, before[number])
    return _infinite(result)


def _unnamed(error, names):
    """Return a complaint unless the error names one of the arguments (a value may be refused for another)."""
    text = str(error)
    if names and not any(name in text for name in names):
        return f"the error names none of {', '.join(names)}: {text[:200]}"
    return None


def _infinite(result):
    if isinstance(result, xr.Dataset):
        numbers = {
            str(name): np.isinf(variable.values).any()
            for name, variable in result.variables.items()
            if variable.dtype.kind == "f"
        }
        wrong = [name for name, is_infinite in numbers.items() if is_infinite]
        if wrong:
            return f"infinite {', '.join(wrong)}"
    if isinstance(result, float) and np.isinf(result):
        return "infinite"
    return None


def unexplained(result):
    """Return the names of the variables that have NaN and no reason; missing heights have none."""
    if not isinstance(result, (xr.Dataset, xr.DataArray)):
        return set()
    dataset = result.to_dataset(name=result.name or "values") if isinstance(result, xr.DataArray) else result
    return {
        str(name)
        for name, variable in dataset.variables.items()
        if variable.dtype.kind == "f"
        and name != "height"
        and np.isnan(variable.values).any()
        and not ("reason" in variable.attrs or "NaN" in variable.attrs.get("comment", ""))
    }


def silently_accepted(done, arguments):
    """Return what must have been refused: coordinates or heights that are no numbers, for example."""
    for argument, what in done.items():
        if argument in LABELLED and what.isupper():
            return f"{argument}: {what.lower()} accepted"
    return None
