"""Every room's functions run on one extreme case, and what came held against what is expected."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.accuracy import independent
from fractalcontact.accuracy.catalogue import NOT_DEFINED, REFUSED, Case, Expectation
from fractalcontact.base.errors import FractalContactWarning, InvalidInput

if TYPE_CHECKING:
    import xarray as xr

CLOSE = 1e-6
ERROR = "independent_error"  # of a result, against what no room computed
LENGTHS, MODULI = 7, 13  # powers of two by which units are changed
Probe = Callable[[Any, Case], "xr.Dataset"]
LONGEST = 120.0  # seconds: a case that takes longer hangs


@dataclass(frozen=True)
class Finding:
    """What one function said of one case.

    Attributes
    ----------
    name : str
        `room.function.quantity`, or `room.function` for a refusal and for the run itself.
    expected : float, pair, str or None
        None where nothing is expected but a finite number.
    got : float or str
        The value (extreme over steps, least where a stack), or the text of the refusal.
    ok : bool
    run_time : float
        Seconds of the whole call.
    error : float
        Distance from what is expected, over its size (or that of the case, for zero); NaN where nothing is
        expected but a finite number.
    """

    name: str
    expected: Expectation | None
    got: float | str
    ok: bool
    run_time: float
    error: float = np.nan


def examine(case: Case) -> list[Finding]:
    """Run every function that takes this kind of input on a case.

    Parameters
    ----------
    case : Case
        From `cases`.

    Returns
    -------
    list of Finding
        One for each quantity of the case's `expected`, and one for each function. A function passes if
        it returns with finite numbers, or NaN with a reason, or refuses with an `InvalidInput`; anything
        else that it raises, and an infinite or unexplained value, fails.
    """
    if case.kind == "call":
        return _called(case)
    probes = _SURFACE_PROBES if case.kind == "surface" else _MASK_PROBES
    findings: list[Finding] = []
    for name, probe in probes.items():
        findings += _run(case, name, probe)
    unasked = [key for key in case.expected if key.rpartition(".")[0] not in probes]
    findings += [Finding(key, case.expected[key], "no such function", False, 0.0) for key in unasked]
    return findings


def _called(case: Case) -> list[Finding]:
    """Return the findings of a call: what its result says under each key."""
    functions = dict.fromkeys(key.rpartition(".")[0] for key in case.expected)
    whole = cache(case.make)  # one call serves all keys
    return [one for name in functions for one in _run(case, name, lambda *_: whole())]


def _run(case: Case, name: str, probe: Probe) -> list[Finding]:
    wanted = {key: value for key, value in case.expected.items() if key.rpartition(".")[0] == name}
    start = time.perf_counter()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            warnings.simplefilter("ignore", FractalContactWarning)
            result = probe(None if case.kind == "call" else case.make(), case)
    except InvalidInput as refusal:
        seconds = time.perf_counter() - start
        text = "; ".join(refusal.problems)
        if wanted:
            return [Finding(key, value, text, value == REFUSED, seconds) for key, value in wanted.items()]
        return [Finding(name, None, f"refused: {text}", bool(text), seconds)]
    except Exception as error:  # whatever else is raised is a finding, not an end
        text = f"{type(error).__name__}: {error}"
        return [Finding(name, None, text, False, time.perf_counter() - start)]
    seconds = time.perf_counter() - start
    findings = [_held(key, value, result, seconds) for key, value in wanted.items()]
    findings.append(_sane(name, result, seconds))
    if ERROR in result:
        away = float(result[ERROR])
        findings.append(Finding(f"{name}.{ERROR}", 0.0, away, away <= CLOSE, seconds, away))
    if case.kind == "surface":
        findings.append(_in_units(name, probe, case, result))
    return [replace(one, ok=one.ok and (case.large or seconds < LONGEST)) for one in findings]


def _in_units(name: str, probe: Probe, case: Case, result: xr.Dataset) -> Finding:
    """Hold that a change of units by powers of two changes no bit of a result but the exponents."""
    start = time.perf_counter()
    face = independent.in_other_units(case.make(), LENGTHS)
    stiffer = replace(case, modulus=case.modulus * 2.0**MODULI)
    error = independent.unit_error(result, probe(face, stiffer), LENGTHS, MODULI)
    return Finding(f"{name}.dependence_on_units", 0.0, error, error == 0, time.perf_counter() - start, error)


def _held(key: str, expected: Expectation, result: xr.Dataset, seconds: float) -> Finding:
    quantity = key.rpartition(".")[2]
    if quantity not in result:
        return Finding(key, expected, "not in the result", False, seconds)
    values = np.asarray(result[quantity].values, dtype=float).ravel()
    got = float(values[0]) if values.size else np.nan
    if expected == NOT_DEFINED:
        return Finding(key, expected, got, bool(np.isnan(got)) and _explained(result, quantity), seconds)
    if isinstance(expected, str):
        return Finding(key, expected, got, False, seconds)
    if isinstance(expected, tuple):
        outside = max(expected[0] - got, got - expected[1], 0.0)
        error = outside / max(abs(expected[0]), _scale(result))
        return Finding(key, expected, got, bool(expected[0] <= got <= expected[1]), seconds, error)
    error = abs(got - expected) / max(abs(expected), _scale(result))
    return Finding(key, expected, got, bool(error <= CLOSE), seconds, error)


def _scale(result: xr.Dataset) -> float:
    """Return the size against which a zero is judged: 1 for pure numbers, that of the case for lengths."""
    return float(result.attrs.get("examination_scale", 1.0))


def _sane(name: str, result: xr.Dataset, seconds: float) -> Finding:
    """Hold every number of a result: finite, or NaN with a reason."""
    for quantity, variable in result.data_vars.items():
        if variable.dtype.kind != "f":
            continue
        if np.isinf(variable.values).any():
            return Finding(name, None, f"{quantity} is infinite", False, seconds)
        # one reason serves all that is missing with it: no exponent, no interval either
        told = any(_tells(one.attrs) for one in result.variables.values()) or _tells(result.attrs)
        if np.isnan(variable.values).any() and not told:
            return Finding(name, None, f"{quantity} is NaN without a reason", False, seconds)
    return Finding(name, None, "finite or explained", True, seconds)


def _explained(result: xr.Dataset, quantity: str) -> bool:
    """Whether the number itself, or the result as a whole, says why it is missing."""
    return _tells(result.attrs) or _tells(result[quantity].attrs)


def _tells(attributes: Mapping[Any, Any]) -> bool:
    """Whether attributes hold a reason for missing numbers."""
    return any(
        str(key) in ("reason", "missing_reason", "not_given", "note")
        or (key == "comment" and "NaN" in str(value))
        for key, value in attributes.items()
    )


def _described(surface: xr.DataArray, _: Case) -> xr.Dataset:
    from fractalcontact import surfaces

    result = surfaces.describe(surface)
    if np.isfinite(surface.values).any():
        result[ERROR] = independent.spread_error(surface, result)
    return result


def _levelled(surface: xr.DataArray, _: Case) -> xr.Dataset:
    from fractalcontact import surfaces

    result = surfaces.describe(surfaces.level(surface))
    result.attrs["examination_scale"] = float(np.ptp(surface.values)) or 1.0
    return result


def _estimated(surface: xr.DataArray, _: Case) -> xr.Dataset:
    from fractalcontact import dimensions

    return dimensions.estimate(surface)


def _curve(name: str) -> Probe:
    def probe(surface: xr.DataArray, _: Case) -> xr.Dataset:
        from fractalcontact import dimensions

        curve: xr.Dataset = getattr(dimensions, name)(surface)
        return curve

    return probe


def _reach(surface: xr.DataArray) -> tuple[float, float]:
    """Return a slope typical of the face (1e-3 if it is flat) and its area."""
    heights = surface.values
    spacing = float(surface.x[1] - surface.x[0]), float(surface.y[1] - surface.y[0])
    slope = float(np.nanstd(np.diff(heights, axis=-1))) / spacing[0] if np.isfinite(heights).any() else 0.0
    return slope or 1e-3, heights.size * spacing[0] * spacing[1]


def _pressed(surface: xr.DataArray, case: Case) -> xr.Dataset:
    from fractalcontact import contact

    modulus = case.modulus
    slope, area = _reach(surface)
    force = np.array([0.01, 0.1]) * modulus * slope * area
    result = contact.press(
        surface,
        contact_modulus=modulus,
        normal_force=force,
        influence="square",
        boundary="free",
        keep=("gap", "pressure"),
    )
    error = independent.halfspace_error(surface, _checked_balance(result, force), modulus)
    return result.drop_vars(["gap", "pressure"]).assign({ERROR: error})


def _checked_balance(result: xr.Dataset, force: np.ndarray) -> xr.Dataset:
    """Raise unless the pressures carry the force and no gap is closed below zero beyond the tolerance."""
    cell = float(result["nominal_area"]) / (result.sizes["y"] * result.sizes["x"])
    carried = result["pressure"].sum(("y", "x")).values * cell
    if not np.allclose(carried, force, rtol=1e-6):
        raise ArithmeticError(f"pressures carry {carried} N of {force} N")
    if not bool(result["converged"].all()):
        raise ArithmeticError(f"not converged: {result['residual'].values}")
    return result


def _slid(surface: xr.DataArray, case: Case) -> xr.Dataset:
    from fractalcontact import joints

    step = float(surface.x[1] - surface.x[0])
    crack = _crack(surface, case)
    result = joints.dilatancy(crack, shear=[step], direction=["E"]).assign_attrs(examination_scale=step)
    return result.assign({ERROR: independent.sliding_error(surface, result, crack.layout.cells)})


def _closed(surface: xr.DataArray, case: Case) -> xr.Dataset:
    from fractalcontact import joints

    crack = _crack(surface, case)
    slope, _ = _reach(surface)
    force = 0.01 * crack.contact_modulus * slope * crack.nominal_area
    step = float(surface.x[1] - surface.x[0])
    return joints.closure(crack, shear=[step], normal_force=[force]).assign_attrs(
        examination_scale=step * slope
    )


def _crack(surface: xr.DataArray, case: Case) -> Any:
    from fractalcontact import joints

    ny, nx = surface.shape
    spacing = float(surface.y[1] - surface.y[0]), float(surface.x[1] - surface.x[0])
    edges = max(3, ny - 2) * spacing[0], max(3, nx - 2) * spacing[1]
    return joints.Crack(surface, young=case.modulus, poisson=0.2, block=edges)


def _mask_function(name: str) -> Probe:
    def probe(mask: xr.DataArray, _: Case) -> xr.Dataset:
        from fractalcontact import domains

        options = {"q": [0.0, 1.0, 2.0]} if name == "generalised_dimensions" else {}
        result: xr.Dataset = getattr(domains, name)(mask, **options)
        against = {"islands": independent.island_error, "lacunarity": independent.single_cell_error}
        return result.assign({ERROR: against[name](mask, result)}) if name in against else result

    return probe


_SURFACE_PROBES: dict[str, Probe] = {
    "surfaces.describe": _described,
    "surfaces.level": _levelled,
    "dimensions.estimate": _estimated,
    "dimensions.spectrum": _curve("spectrum"),
    "dimensions.variogram": _curve("variogram"),
    "dimensions.cube_counts": _curve("cube_counts"),
    "contact.press": _pressed,
    "joints.dilatancy": _slid,
    "joints.closure": _closed,
}
_MASK_PROBES: dict[str, Probe] = {
    f"domains.{name}": _mask_function(name)
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
