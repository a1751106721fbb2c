"""The functions of every subpackage, run on one extreme case and compared with what is expected."""

from __future__ import annotations

import re
import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np
import xarray as xr
from extreme_cases import NOT_DEFINED, REFUSED, Case, Expectation
from scipy import ndimage

from fractalcontact import contact, dimensions, domains, joints, surfaces
from fractalcontact.base.errors import FractalContactWarning, InvalidInput

Array = np.ndarray[Any, np.dtype[Any]]
Probe = Callable[[Any, Case], xr.Dataset]

TOLERANCE = 1e-6
INDEPENDENT_ERROR = "independent_error"  # of a result, against what this package did not compute
LENGTHS, MODULI = 7, 13  # powers of two by which units are changed
LONGEST = 120.0  # seconds: a longer call fails


@dataclass(frozen=True)
class Result:
    """What one function gave for one case.

    `name` is `subpackage.function.variable`, or `subpackage.function` for a refusal and for the call itself;
    `got` is the first value, or the text of the refusal; `expected` is None where only a finite number is
    expected; `run_time` in seconds; `error` is the distance from what is expected over its size (or that of
    the case, for zero), NaN where only a finite number is expected.
    """

    name: str
    expected: Expectation | None
    got: float | str
    passed: bool
    run_time: float
    error: float = np.nan


def examine(case: Case, only: str = "") -> list[Result]:
    """Run the functions that take the input of a case, or one, and compare with what is expected.

    There is one result for each expected quantity, and one for each function. A function passes if it
    returns finite numbers, or NaN with a reason, or refuses the input with an `InvalidInput`.
    Any other exception, and an infinite or unexplained value, fails.
    """
    case = replace(case, make=cache(case.make))  # one input or one call serves all quantities
    if case.input_type == "call":
        functions = dict.fromkeys(_function_of(quantity) for quantity in case.expected)
        return [result for name in functions for result in _run(case, name, lambda *_: case.make())]
    probes = SURFACE_PROBES if case.input_type == "surface" else MASK_PROBES
    results = [result for name, probe in probes.items() if only in name for result in _run(case, name, probe)]
    unknown = [quantity for quantity in case.expected if _function_of(quantity) not in probes]
    return results + [Result(name, case.expected[name], "no such function", False, 0.0) for name in unknown]


def _function_of(quantity: str) -> str:
    return quantity.rpartition(".")[0]


def _run(case: Case, name: str, probe: Probe) -> list[Result]:
    """Run one function on a case."""
    expected = {key: value for key, value in case.expected.items() if _function_of(key) == name}
    start = time.perf_counter()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            warnings.simplefilter("ignore", FractalContactWarning)
            dataset = probe(None if case.input_type == "call" else case.make(), case)
    except InvalidInput as refusal:
        seconds = time.perf_counter() - start
        message = "; ".join(refusal.problems)
        if expected:
            return [Result(key, value, message, value == REFUSED, seconds) for key, value in expected.items()]
        return [Result(name, None, f"refused: {message}", bool(message), seconds)]
    except Exception as error:  # whatever else is raised is a failure of this case, not the end of the run
        message = f"{type(error).__name__}: {error}"
        return [Result(name, None, message, False, time.perf_counter() - start)]
    seconds = time.perf_counter() - start
    results = [_compare(key, value, dataset, seconds) for key, value in expected.items()]
    results.append(_check_finite(name, dataset, seconds))
    if INDEPENDENT_ERROR in dataset:
        error_size = float(dataset[INDEPENDENT_ERROR])
        passed = error_size <= TOLERANCE
        results.append(Result(f"{name}.{INDEPENDENT_ERROR}", 0.0, error_size, passed, seconds, error_size))
    if case.input_type == "surface":
        results.append(_in_other_units(name, probe, case, dataset))
    in_time = case.large or seconds < LONGEST
    return [replace(result, passed=result.passed and in_time) for result in results]


def _compare(key: str, expected: Expectation, dataset: xr.Dataset, seconds: float) -> Result:
    """Compare one quantity with what is expected of it."""
    quantity = key.rpartition(".")[2]
    if quantity not in dataset:
        return Result(key, expected, "not in the result", False, seconds)
    values = np.asarray(dataset[quantity].values, dtype=float).ravel()
    got = float(values[0]) if values.size else np.nan
    if expected == NOT_DEFINED:
        explained = _has_reason(dataset.attrs) or _has_reason(dataset[quantity].attrs)
        return Result(key, expected, got, bool(np.isnan(got)) and explained, seconds)
    if isinstance(expected, str):
        return Result(key, expected, got, False, seconds)
    # a zero is compared with 1 for pure numbers, with the scale of the case for lengths
    scale = float(dataset.attrs.get("scale_of_zero", 1.0))
    if isinstance(expected, tuple):
        outside = max(expected[0] - got, got - expected[1], 0.0)
        error = outside / max(abs(expected[0]), scale)
        return Result(key, expected, got, bool(expected[0] <= got <= expected[1]), seconds, error)
    error = abs(got - expected) / max(abs(expected), scale)
    return Result(key, expected, got, bool(error <= TOLERANCE), seconds, error)


def _check_finite(name: str, dataset: xr.Dataset, seconds: float) -> Result:
    """Check that every number of a result is finite, or NaN with a reason."""
    for quantity, variable in dataset.data_vars.items():
        if variable.dtype.kind != "f":
            continue
        if np.isinf(variable.values).any():
            return Result(name, None, f"{quantity} is infinite", False, seconds)
        # one reason explains all that is missing with it: no exponent, no interval either
        reasons = any(_has_reason(item.attrs) for item in dataset.variables.values())
        if np.isnan(variable.values).any() and not (reasons or _has_reason(dataset.attrs)):
            return Result(name, None, f"{quantity} is NaN without a reason", False, seconds)
    return Result(name, None, "finite or explained", True, seconds)


def _has_reason(attributes: Mapping[Any, Any]) -> bool:
    """Whether attributes hold a reason for missing numbers."""
    return any(
        str(key) in ("reason", "missing_reason", "not_given", "note")
        or (key == "comment" and "NaN" in str(value))
        for key, value in attributes.items()
    )


# ---------------------------------------------------------------------------------------------------------
# The functions, and independent checks of their results: an error of 0 is right to the last digit


def _describe(surface: xr.DataArray, _: Case) -> xr.Dataset:
    dataset = surfaces.describe(surface)
    if np.isfinite(surface.values).any():
        dataset[INDEPENDENT_ERROR] = _rms_height_error(surface, dataset)
    return dataset


def _rms_height_error(surface: xr.DataArray, described: xr.Dataset) -> float:
    """Return the relative error of the rms height, against a sum of more digits."""
    heights = surface.values[np.isfinite(surface.values)]
    heights = (heights - heights.min()).astype(np.longdouble)
    exact = float(np.sqrt(np.mean((heights - heights.mean()) ** 2)))
    return abs(float(described["rms_height"]) - exact) / (exact or 1.0)


def _level(surface: xr.DataArray, _: Case) -> xr.Dataset:
    scale = float(np.ptp(surface.values)) or 1.0
    return surfaces.describe(surfaces.level(surface)).assign_attrs(scale_of_zero=scale)


def _estimate(function: str, surface: xr.DataArray, _: Case) -> xr.Dataset:
    dataset: xr.Dataset = getattr(dimensions, function)(surface)
    return dataset


def _spacing(surface: xr.DataArray) -> tuple[float, float]:
    return float(surface.y[1] - surface.y[0]), float(surface.x[1] - surface.x[0])


def _typical_slope(surface: xr.DataArray) -> float:
    """Return a slope typical of the surface, 1e-3 if it is flat."""
    if not np.isfinite(surface.values).any():
        return 1e-3
    return float(np.nanstd(np.diff(surface.values, axis=-1))) / _spacing(surface)[1] or 1e-3


def _press(surface: xr.DataArray, case: Case) -> xr.Dataset:
    dy, dx = _spacing(surface)
    force = np.array([0.01, 0.1]) * case.modulus * _typical_slope(surface) * (surface.size * dx * dy)
    pressed = contact.press(
        surface,
        contact_modulus=case.modulus,
        normal_force=force,
        influence="square",
        boundary="free",
        keep=("gap", "pressure"),
    )
    cell = float(pressed["nominal_area"]) / (pressed.sizes["y"] * pressed.sizes["x"])
    carried = pressed["pressure"].sum(("y", "x")).values * cell
    if not np.allclose(carried, force, rtol=1e-6):
        raise ArithmeticError(f"pressures carry {carried} N of {force} N")
    if not bool(pressed["converged"].all()):
        raise ArithmeticError(f"not converged: {pressed['residual'].values}")
    error = _half_space_error(surface, pressed, case.modulus)
    return pressed.drop_vars(["gap", "pressure"]).assign({INDEPENDENT_ERROR: error})


def _half_space_error(surface: xr.DataArray, pressed: xr.Dataset, modulus: float) -> float:
    """Return the largest violation of the contact conditions by gap, closure and pressure.

    At every node gap = top - height - closure + u, u the displacement by the pressures on all cells (Love,
    1929, Phil. Trans. A 228:377, summed directly); gap and pressure are never negative, and one is zero.
    """
    from scipy.signal import fftconvolve  # here, because it takes half of the start of a child process

    ny, nx = surface.shape
    dy, dx = _spacing(surface)
    y, x = np.arange(1 - ny, ny)[:, None] * dy, np.arange(1 - nx, nx) * dx
    influence = _love(y, x, dy, dx) / (np.pi * modulus)
    below = float(surface.max()) - surface.values
    worst = 0.0
    for step in range(pressed.sizes["step"]):
        state = pressed.isel(step=step)
        pressure, gap, closure = (np.asarray(state[name].values) for name in ("pressure", "gap", "closure"))
        displacement = fftconvolve(influence, pressure, mode="valid")
        scale = max(float(np.abs(displacement).max()), float(np.abs(closure)))
        law = float(np.abs(below - closure + displacement - gap).max() / scale)
        both = float(np.max(np.minimum(gap / scale, pressure / pressure.max())))
        worst = max(worst, law, both, -float(gap.min()) / scale, -float(pressure.min()))
    return worst


def _love(y: Array, x: Array, dy: float, dx: float) -> Array:
    """Return pi E* times the displacement at (y, x) by unit pressure on a cell (dy, dx) at the origin."""
    total = np.zeros(np.broadcast_shapes(y.shape, x.shape))
    for sign_y in (1, -1):
        for sign_x in (1, -1):
            b, a = y + sign_y * dy / 2, x + sign_x * dx / 2
            total += sign_y * sign_x * (a * np.arcsinh(b / np.abs(a)) + b * np.arcsinh(a / np.abs(b)))
    return np.asarray(total)


def _crack(surface: xr.DataArray, case: Case) -> joints.Crack:
    ny, nx = surface.shape
    dy, dx = _spacing(surface)
    block = max(3, ny - 2) * dy, max(3, nx - 2) * dx
    return joints.Crack(surface, young=case.modulus, poisson=0.2, block=block)


def _dilatancy(surface: xr.DataArray, case: Case) -> xr.Dataset:
    step = _spacing(surface)[1]
    crack = _crack(surface, case)
    dataset = joints.dilatancy(crack, shear=[step], direction=["E"]).assign_attrs(scale_of_zero=step)
    return dataset.assign({INDEPENDENT_ERROR: _dilatancy_error(surface, dataset, crack.layout.cells)})


def _dilatancy_error(surface: xr.DataArray, dataset: xr.Dataset, block: tuple[int, int]) -> float:
    """Return the error of the rigid dilatancy of a mated block, one cell to the east, by its definition."""
    heights = surface.values
    y, x = ((n - b) // 2 for n, b in zip(heights.shape, block, strict=True))
    upper = heights[y : y + block[0], x : x + block[1]]
    # both are differences of the same heights: equal to the last bit of the largest of them
    exact = float(np.max(heights[y : y + block[0], x + 1 : x + 1 + block[1]] - upper))
    scale = max(abs(exact), float(np.ptp(heights)) or 1.0)
    return abs(float(dataset["rigid_dilatancy"].item()) - exact) / scale


def _closure(surface: xr.DataArray, case: Case) -> xr.Dataset:
    crack = _crack(surface, case)
    slope, step = _typical_slope(surface), _spacing(surface)[1]
    force = 0.01 * crack.contact_modulus * slope * crack.nominal_area
    laws = joints.closure(crack, shear=[step], normal_force=[force])
    return laws.assign_attrs(scale_of_zero=step * slope)


def _mask_function(name: str, mask: xr.DataArray, _: Case) -> xr.Dataset:
    options = {"q": [0.0, 1.0, 2.0]} if name == "generalised_dimensions" else {}
    dataset: xr.Dataset = getattr(domains, name)(mask, **options)
    errors = {"islands": _island_error, "lacunarity": _single_cell_error}
    return dataset.assign({INDEPENDENT_ERROR: errors[name](mask, dataset)}) if name in errors else dataset


def _island_error(mask: xr.DataArray, islands: xr.Dataset) -> float:
    """Return the error of the number of islands of a free mask; 0 for one that wraps: not checked."""
    if "period" in mask["x"].attrs:
        return 0.0
    return abs(int(islands["n_islands"]) - int(ndimage.label(mask.values)[1]))


def _single_cell_error(mask: xr.DataArray, lacunarity: xr.Dataset) -> float:
    """Return the error of the lacunarity of single cells, which is one over the coverage."""
    value = float(lacunarity["lacunarity"].sel(box_size=1))
    count = int(np.count_nonzero(mask.values))
    return abs(value * count / mask.size - 1.0) if count else float(not np.isnan(value))


SURFACE_PROBES: dict[str, Probe] = {
    "surfaces.describe": _describe,
    "surfaces.level": _level,
    "dimensions.estimate": partial(_estimate, "estimate"),
    "dimensions.spectrum": partial(_estimate, "spectrum"),
    "dimensions.variogram": partial(_estimate, "variogram"),
    "dimensions.cube_counts": partial(_estimate, "cube_counts"),
    "contact.press": _press,
    "joints.dilatancy": _dilatancy,
    "joints.closure": _closure,
}
MASK_PROBES: dict[str, Probe] = {
    f"domains.{name}": partial(_mask_function, name)
    for name in (
        "islands",
        "box_dimension",
        "lacunarity",
        "generalised_dimensions",
        "boundary_dimension",
        "percolation",
        "describe",
    )
}


# ---------------------------------------------------------------------------------------------------------
# Units: a change by powers of two changes the exponents of a result, and no other bit

# powers of (length, modulus) in the units of results
UNIT_POWERS = {"m": (1, 0), "Pa": (0, 1), "N": (2, 1), "J": (3, 1)}
NOT_COMPARED = ("run_time", "iterations", "transforms", "residual")  # a residual is rounding over a tolerance
# relative: last bits differ between processes (4e-14 of the closure of a strip of 1 : 1000, in one of three)
LAST_BITS = 1e-12


def _in_other_units(name: str, probe: Probe, case: Case, dataset: xr.Dataset) -> Result:
    """Call the function again in other units and compare."""
    start = time.perf_counter()
    surface = _scaled_surface(case.make(), LENGTHS)
    other = probe(surface, replace(case, modulus=case.modulus * 2.0**MODULI))
    error = _unit_error(dataset, other)
    seconds = time.perf_counter() - start
    return Result(f"{name}.dependence_on_units", 0.0, error, error <= LAST_BITS, seconds, error)


def _scaled_surface(surface: xr.DataArray, power: int) -> xr.DataArray:
    """Return a surface with all its lengths times a power of two."""
    axes = {}
    for dim in ("y", "x"):
        attributes = dict(surface[dim].attrs)
        if "period" in attributes:
            attributes["period"] = np.ldexp(attributes["period"], power)
        axes[dim] = (dim, np.ldexp(surface[dim].values, power), attributes)
    return surface.assign_coords(axes).copy(data=np.ldexp(surface.values, power))


def _unit_error(dataset: xr.Dataset, other: xr.Dataset) -> float:
    """Return the largest relative difference of two results of which the second is in other units."""
    worst = 0.0
    for name, variable in dataset.variables.items():
        if variable.dtype.kind not in "fiub" or name in NOT_COMPARED:
            continue
        length, modulus = _powers(str(variable.attrs.get("units", "1")))
        values = np.ldexp(variable.values.astype(float), length * LENGTHS + modulus * MODULI)
        others = other[name].values.astype(float)
        if values.shape != others.shape or (np.isnan(values) != np.isnan(others)).any():
            return np.inf
        size = float(np.max(np.abs(others), initial=0.0, where=~np.isnan(others)))
        difference = float(np.max(np.abs(others - values), initial=0.0, where=~np.isnan(others)))
        worst = max(worst, difference / size if size else difference)
    return worst


def _powers(units: str) -> tuple[int, int]:
    """Return the powers of length and of modulus in a unit."""
    length = modulus = 0
    for word, power in re.findall(r"([A-Za-z]+)(-?\d*)", units):
        base = UNIT_POWERS.get(word, (0, 0))
        length, modulus = length + base[0] * int(power or 1), modulus + base[1] * int(power or 1)
    return length, modulus
