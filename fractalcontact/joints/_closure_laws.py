"""Closure laws: exponential and hyperbolic fits to the closure of a joint, and its normal stiffness."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.coords import leading_coords
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems

Array = np.ndarray[Any, np.dtype[Any]]

REFERENCES = (
    "Persson, B. N. J., Relation between interfacial separation and load, Phys. Rev. Lett. 99 (2007); "
    "Bandis, S. C., Lumsden, A. C. and Barton, N. R., Fundamentals of rock joint deformation, Int. J. Rock "
    "Mech. Min. Sci. 20 (1983)"
)
NO_FIT = "NaN where fewer than three loading steps have a force, or the interface does not close"
NO_STIFFNESS = "NaN where there is no force, where a branch of the path has one step only, or nothing closes"
FITS = ("closure_length", "reference_pressure", "exponential_misfit", "initial_stiffness",
        "greatest_closure", "hyperbolic_misfit")  # fmt: skip
FEWEST_STEPS = 3  # to fit a law of two parameters
STEEPEST = 40.0  # greatest exponent of a local power law, per length of its three points in log pressure
GREATEST_CORRECTION = 0.2  # of the logarithm of a stiffness: beyond, the closure is too uneven for a law


def _check(problems: Problems, *, closure: Any, **_: Any) -> None:
    expected = "the Dataset of fractalcontact.joints.closure"
    if not isinstance(closure, xr.Dataset):
        problems.add("closure", expected, f"an object of type {type(closure).__name__}")
        return
    if not problems.result("closure", closure):
        return
    names = ("interface_closure", "nominal_pressure")
    absent = [name for name in names if name not in closure.variables or "step" not in closure[name].dims]
    problems.require(not absent, "closure", expected, f"no {', '.join(absent)} over step")


@public_result(title="laws of closure", references=REFERENCES, check=_check)
def closure_laws(closure: xr.Dataset) -> xr.Dataset:
    """Fit the exponential and the hyperbolic closure law to a joint, and return its normal stiffness.

    The exponential law p = p0 exp(w_int / l) holds for self-affine elastic surfaces under moderate pressure;
    the stiffness is then p / l. The hyperbola w_int = p Vm / (Kni Vm + p) was found on rock joints, which
    yield. Fitted to elastic faces it is a description only: compare the two misfits.

    Parameters
    ----------
    closure : Dataset
        From `fractalcontact.joints.closure`: interface_closure (m) and nominal_pressure (Pa) over (...,
        step).

    Returns
    -------
    Dataset
        Over (...): closure_length l (m) and reference_pressure p0 (Pa) of the exponential law;
        initial_stiffness Kni (Pa/m) and greatest_closure Vm (m, infinite for a straight line) of the
        hyperbola; exponential_misfit and hyperbolic_misfit (m, rms difference of the closures).
        Over (..., step): stiffness dp/dw_int (Pa/m). NaN with the `reason` where nothing can be fitted.

    Raises
    ------
    InvalidInput
        `closure` is not the Dataset of `closure`.

    Notes
    -----
    Both laws are fitted by least squares of the closure to the first loading, up to the greatest force. The
    stiffness is that of a power law through three neighbouring steps on the same branch of the path,
    corrected for the change of its exponent: exact for straight lines, power laws and the exponential law,
    and of third order at the ends of a branch. Rough faces touch at single cells, one after the other: on the
    shipped cracks, with loads a factor of 2 apart, it was within 3 % where 90 cells or more touched, 11 % at
    25 to 75, and 35 % off at 3; with loads a factor of 3 apart it was up to 75 % off at the ends.

    References
    ----------
    Persson (2007), Phys. Rev. Lett. 99:125502; Bandis, Lumsden and Barton (1983), Int. J. Rock Mech. Min.
    Sci. 20:249.

    Examples
    --------
    >>> import numpy as np, xarray as xr
    >>> import fractalcontact as fc
    >>> pressure = np.geomspace(1e5, 1e7, 8)
    >>> closure = fc.joints.bandis_closure(pressure, initial_stiffness=2e10, greatest_closure=1e-4)
    >>> joint = xr.Dataset({"interface_closure": ("step", closure), "nominal_pressure": ("step", pressure)})
    >>> laws = fc.joints.closure_laws(joint)
    >>> round(float(laws.greatest_closure) * 1e6, 2)
    100.0
    >>> bool(laws.hyperbolic_misfit < laws.exponential_misfit)
    True
    """
    interface = closure["interface_closure"].transpose(..., "step")
    pressure = closure["nominal_pressure"].broadcast_like(interface).transpose(*interface.dims)
    steps = interface.shape[-1]
    fits, stiffnesses = [], []
    for w, p in zip(interface.values.reshape(-1, steps), pressure.values.reshape(-1, steps), strict=True):
        fits.append(fit_exponential(p, w) + fit_hyperbola(p, w))
        stiffnesses.append(stiffness(p, w))
    columns = np.reshape(fits, (*interface.shape[:-1], len(FITS)))
    variables: dict[str, Any] = {name: (interface.dims[:-1], columns[..., i]) for i, name in enumerate(FITS)}
    variables["stiffness"] = interface.dims, np.reshape(stiffnesses, interface.shape)
    result = xr.Dataset(variables, leading_coords(closure, interface.dims, taken=(*variables, "run_time")))
    for name, variable in result.data_vars.items():
        if np.isnan(variable.values).any():
            result[name].attrs["reason"] = NO_STIFFNESS if name == "stiffness" else NO_FIT
    return result


def first_loading(pressure: Array, closure: Array) -> Array:
    """Return the steps at which the force reaches a new maximum, up to the greatest one."""
    finite = np.isfinite(pressure) & np.isfinite(closure)
    highest = np.maximum.accumulate(np.where(finite, pressure, 0.0))
    new = highest > np.concatenate([[0.0], highest[:-1]])
    return np.flatnonzero(new & finite)


def fit_exponential(pressure: Array, closure: Array) -> tuple[float, float, float]:
    """Return l, p0 and the rms misfit of w = l ln(p / p0); NaN where nothing can be fitted."""
    steps = first_loading(pressure, closure)
    if steps.size < FEWEST_STEPS or not np.ptp(closure[steps]) > 0:
        return (math.nan,) * 3
    log_pressure, w = np.log(pressure[steps]), closure[steps]
    length, offset = np.polyfit(log_pressure, w, 1)
    misfit = math.sqrt(np.mean((w - length * log_pressure - offset) ** 2))
    with np.errstate(over="ignore"):  # faces that are mated again close by rounding only
        return float(length), float(np.exp(-offset / length)), misfit


def fit_hyperbola(pressure: Array, closure: Array) -> tuple[float, float, float]:
    """Return Kni, Vm and the rms misfit of w = p Vm / (Kni Vm + p); NaN where nothing can be fitted.

    For a given half pressure Kni Vm, at which half of Vm is reached, the best Vm follows from one linear
    least-squares step. The half pressure itself is searched on a logarithmic axis.
    """
    from scipy.optimize import minimize_scalar

    steps = first_loading(pressure, closure)
    if steps.size < FEWEST_STEPS or not np.ptp(closure[steps]) > 0:
        return (math.nan,) * 3
    p, w = pressure[steps] / pressure[steps].max(), closure[steps]

    def best_curve(half_pressure: float) -> tuple[float, Array]:
        shape = p / (half_pressure + p)
        greatest = float(shape @ w / (shape @ shape))
        return greatest, w - greatest * shape

    def squared_misfit(log_half: float) -> float:
        return float(np.sum(best_curve(math.exp(log_half))[1] ** 2))

    grid = np.linspace(math.log(p.min()) - 7.0, 14.0, 85)
    best = int(np.argmin([squared_misfit(log_half) for log_half in grid]))
    bounds = grid[max(best - 1, 0)], grid[min(best + 1, grid.size - 1)]
    minimum = minimize_scalar(squared_misfit, bounds=bounds, method="bounded", options={"xatol": 1e-10})
    half_pressure = math.exp(minimum.x)
    greatest, residual = best_curve(half_pressure)
    initial_stiffness = half_pressure * float(pressure[steps].max()) / greatest
    is_straight = best == grid.size - 1  # no curvature within the forces
    return initial_stiffness, math.inf if is_straight else greatest, math.sqrt(np.mean(residual**2))


def stiffness(pressure: Array, closure: Array) -> Array:
    """Return dp/dw at every step, along its branch of the path; NaN where it has no neighbour there."""
    values = np.full(pressure.size, math.nan)
    for branch in branches(pressure):
        steps = branch[(pressure[branch] > 0) & np.isfinite(closure[branch])]
        if steps.size < 2:
            continue
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = log_slopes(np.log(pressure[steps]), closure[steps])
            on_branch = np.where((slope > 0) & np.isfinite(slope), pressure[steps] / slope, math.nan)
        values[steps] = np.where(np.isnan(values[steps]), on_branch, values[steps])
    return values


def log_slopes(log_pressure: Array, closure: Array) -> Array:
    """Return dw/d(ln p) at every step of one branch, by local power laws.

    Through three neighbouring steps passes w = a + b p^m, exactly one where the closure grows: m = 1 is a
    straight line, and m = 0 the exponential law. If the exponent m changes with ln p at the rate k, the
    logarithm of dw/d(ln p) of that law is too small by k/6 times the product of the distances in ln p to the
    other two steps, signed: the remainder of interpolation, as for a polynomial. The rate comes from the
    laws beside it. Where the closure does not grow, a parabola in ln p takes the place of the power law.
    """
    order = np.argsort(log_pressure, kind="stable")
    x, w = log_pressure[order], closure[order]
    if x.size == 2:
        return np.gradient(w, x)
    triples = [slice(start, start + 3) for start in range(x.size - 2)]
    exponents = np.array([_local_exponent(x[three], w[three]) for three in triples])
    rates = np.zeros(exponents.size)
    if exponents.size > 1:
        rates = np.nan_to_num(np.gradient(exponents, [x[three].mean() for three in triples]))
    slopes = np.empty(x.size)
    for i, start in enumerate(np.clip(np.arange(x.size) - 1, 0, x.size - 3)):
        slope, product = _local_slope(x[triples[start]], w[triples[start]], exponents[start], i - start)
        correction = np.clip(rates[start] * product / 6.0, -GREATEST_CORRECTION, GREATEST_CORRECTION)
        slopes[order[i]] = slope * math.exp(correction)
    return slopes


def _local_exponent(x: Array, w: Array) -> float:
    """Return m of w = a + b exp(m x) through three points; NaN where w does not grow."""
    from scipy.optimize import brentq

    near, far = x[1] - x[0], x[2] - x[0]
    if not (w[1] > w[0] and w[2] > w[1]):
        return math.nan
    ratio = (w[2] - w[0]) / (w[1] - w[0])

    def excess(m: float) -> float:
        return float(np.expm1(m * far) / np.expm1(m * near) - ratio if m else far / near - ratio)

    ends = -STEEPEST / far, STEEPEST / far
    if excess(ends[0]) >= 0 or excess(ends[1]) <= 0:
        return math.nan
    return float(brentq(excess, *ends, xtol=1e-14))


def _local_slope(x: Array, w: Array, exponent: float, place: int) -> tuple[float, float]:
    """Return dw/dx at one of three points, and the product of its signed distances to the other two."""
    others = np.delete(np.arange(3), place)
    product = float(np.prod(x[place] - x[others]))
    if math.isnan(exponent):
        parabola = np.polyfit(x - x[place], w, 2)
        return float(parabola[1]), product
    far = x[2] - x[0]
    length = math.expm1(exponent * far) / exponent if exponent else far
    return float((w[2] - w[0]) / length * math.exp(exponent * (x[place] - x[0]))), product


def branches(pressure: Array) -> list[Array]:
    """Return the steps of each rise and fall of the force, with the turning points at both ends."""
    reversals = np.flatnonzero(np.diff(np.sign(np.diff(pressure)))) + 1
    ends = [0, *reversals.tolist(), pressure.size - 1]
    return [np.arange(first, last + 1) for first, last in itertools.pairwise(ends)]
