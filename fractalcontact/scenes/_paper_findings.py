"""What a study says on each claim of the 1998 paper: one function per claim, with its tolerances.

Every function takes the results of a study and returns a `Finding`, or None where the study lacks the
results, the shears or the loads that the claim is about.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from fractalcontact.scenes._caveats import group_of

Array = np.ndarray[Any, np.dtype[Any]]

# what the paper states
DIMENSION = (2.15, 2.29)  # of the scanned face
PRESSURES = (2.5e6, 25e6, 75e6)  # Pa: 1, 10 and 30 kN on 2 x 2 cm
MIDDLE, PLATEAU, FAR = 4e-4, 8e-4, 8e-3  # m: the shears that it compares
PLATEAU_DILATANCY = 2e-3  # m
COEFFICIENTS = (1.0, 1.4)  # of friction, from Park and Paulay (1975)
FLAT_DIRECTIONS, RISING_DIRECTIONS = ("W", "N"), ("E", "S")

# how near to it a study has to be
DIMENSION_TOLERANCE = 0.05
ROUNDING_DIMENSION = 0.005  # of a delta-surface: no more than rounding above 2
EXPONENT_TOLERANCE = 0.1
SAME_AREA = 0.1
POINTWISE = 0.2  # largest dimension of a few separate points
SMALLEST_GAP = 0.05  # to 2, below which a domain is not lacunar
NO_FALL = 0.02  # of a dimension that grows
DIFFERENT = 0.1  # dimension of a domain that differs from others
SAME_HEIGHT = 0.25
SAME_SLOPE = 0.5
SAME_COEFFICIENT = 0.2
STRONG_FLOW = 10.0
SAME_POINT = 0.01  # relative difference of a load or a shear from that of the paper
MIN_CELLS = 30  # fewer cells in contact give no area to fit

YES, NO, NOT_TESTED, BY_CONSTRUCTION = "yes", "no", "not tested", "by construction"


class Finding(NamedTuple):
    """The result of a study for one claim, and the verdict."""

    result: str
    verdict: str


def face_dimension(tree: xr.DataTree) -> Finding | None:
    estimates = group_of(tree, "dimensions")
    if estimates is None or "method" not in estimates.dims:
        return None
    dimension = np.asarray(estimates["fractal_dimension"].values, dtype=float)
    low, high = DIMENSION[0] - DIMENSION_TOLERANCE, DIMENSION[1] + DIMENSION_TOLERANCE
    inside = bool(((dimension >= low) & (dimension <= high)).all())  # NaN is not inside
    return _finding(f"{_span(dimension)} by {dimension.size} methods", inside)


def _delta_dimension(tree: xr.DataTree) -> tuple[Array, Array] | None:
    """Return the shears above zero and the dimension of the delta-surface by its area."""
    delta = group_of(tree, "joints/delta_dimension")
    if delta is None:
        return None
    shear, dimension = (np.asarray(delta[name].values) for name in ("shear", "covering_dimension"))
    return shear[shear > 0], dimension[shear > 0]


def delta_above_two(tree: xr.DataTree) -> Finding | None:
    curve = _delta_dimension(tree)
    if curve is None or not curve[0].size:
        return None
    last = curve[1][-1]
    return _finding(f"{last:.3f} at {_mm(curve[0][-1])}", last > 2.0 + ROUNDING_DIMENSION)


def delta_grows(tree: xr.DataTree) -> Finding | None:
    curve = _delta_dimension(tree)
    if curve is None or curve[0].size < 2:
        return None
    return _finding(_list(curve[1], ".3f"), bool((np.diff(curve[1]) > 0).all()))


class Closure(NamedTuple):
    """Closure laws towards W, or in the only direction: shear > 0, and values over (shear, step)."""

    shear: Array
    pressure: Array
    values: dict[str, Array]

    def up_to(self, greatest: float) -> Array:
        """Return which shears are at most this one."""
        return np.asarray(self.shear <= greatest * (1 + SAME_POINT))

    def at_shear(self, shear: float) -> int | None:
        """Return the index of a shear of the paper."""
        return _nearest(self.shear, shear)

    def steps(self) -> list[int] | None:
        """Return the steps of the three pressures of the paper."""
        steps = [_nearest(self.pressure, pressure) for pressure in PRESSURES]
        return None if None in steps else steps  # type: ignore[return-value]


def _closure(tree: xr.DataTree, path: str, *names: str) -> Closure | None:
    """Return a result over shear and step; None where it has fewer than two shears."""
    data = group_of(tree, path)
    if data is None or "step" not in data.dims or data.sizes.get("shear", 1) < 2:
        return None
    data = _towards_west(data)
    data = data.isel(shear=np.flatnonzero(np.asarray(data["shear"].values) > 0))
    values = {
        name: np.asarray(data[name].transpose("shear", "step", ...).values, dtype=float) for name in names
    }
    pressure = np.asarray(data["nominal_pressure"].values, dtype=float)
    pressure = pressure.reshape(-1, pressure.shape[-1])[-1]
    return Closure(np.asarray(data["shear"].values, dtype=float), pressure, values)


def _towards_west(data: xr.Dataset) -> xr.Dataset:
    """Return the results of sliding W; of the first direction where W is not among them."""
    if "direction" not in data.dims:
        return data
    names = [str(name) for name in data["direction"].values]
    return data.isel(direction=names.index("W") if "W" in names else 0)


def longer_closing(tree: xr.DataTree) -> Finding | None:
    closure = _closure(tree, "joints/closure", "interface_closure")
    steps = None if closure is None else closure.steps()
    if closure is None or steps is None:
        return None
    lengths = closure.values["interface_closure"][:, steps]
    return _trend(f"{_list(lengths[:, -1] * 1e6)} um at 75 MPa", lengths, +1)


def compliance(tree: xr.DataTree) -> Finding | None:
    closure = _closure(tree, "joints/closure", "interface_closure")
    steps = None if closure is None else closure.steps()
    if closure is None or steps is None:
        return None
    from fractalcontact import joints

    data = _towards_west(tree["joints/closure"].to_dataset())
    stiffness = joints.closure_laws(data)["stiffness"].transpose("shear", "step").values
    stiffness = stiffness[np.asarray(data["shear"].values) > 0][:, steps]
    with np.errstate(divide="ignore"):
        compliance = 1e9 / (stiffness * float(data["nominal_area"]))  # um/kN
    pairs = zip(compliance[0], compliance[-1], strict=True)
    ends = ", ".join(f"{first:.3g} to {last:.3g}" for first, last in pairs)
    return _trend(f"{ends} um/kN", compliance, +1)


def _areas(tree: xr.DataTree) -> tuple[Closure, Array] | None:
    """Return the closure laws, and the contact area (%) over shear at the three pressures."""
    closure = _closure(tree, "joints/closure", "contact_fraction")
    steps = None if closure is None else closure.steps()
    if closure is None or steps is None:
        return None
    return closure, 100 * closure.values["contact_fraction"][:, steps]


def area_falls(tree: xr.DataTree) -> Finding | None:
    areas = _areas(tree)
    if areas is None:
        return None
    area = areas[1][areas[0].up_to(MIDDLE)]
    return _trend(f"{_list(area[:, -1], '.2f')} % at 75 MPa", area, -1)


def area_constant(tree: xr.DataTree) -> Finding | None:
    areas = _areas(tree)
    rows = None if areas is None else [areas[0].at_shear(shear) for shear in (MIDDLE, PLATEAU)]
    if areas is None or rows is None or None in rows:
        return None
    before, after = areas[1][rows]  # type: ignore[index]
    change = after / before - 1.0
    values = f"{before[-1]:.2f} and {after[-1]:.2f} % at 75 MPa; {_list(100 * change, '+.0f')} %"
    return _finding(values, bool((np.abs(change) <= SAME_AREA).all()))


def area_proportional(tree: xr.DataTree) -> Finding | None:
    closure = _closure(tree, "joints/closure", "contact_fraction", "normal_force")
    if closure is None:
        return None
    area, force = closure.values["contact_fraction"], closure.values["normal_force"]
    resolved = (force > 0) & (area * _cells(tree["joints/closure"].to_dataset()) >= MIN_CELLS)
    exponents = [
        float(np.polyfit(np.log(force[i, rows]), np.log(area[i, rows]), 1)[0])
        for i, rows in enumerate(resolved)
        if rows.sum() > 2
    ]
    if not exponents:
        return None
    near = np.abs(np.array(exponents) - 1.0) <= EXPONENT_TOLERANCE
    return _finding(f"A ~ F^{min(exponents):.2f} to F^{max(exponents):.2f}", bool(near.all()))


def _cells(closure: xr.Dataset) -> float:
    """Return the number of cells of the block."""
    crack = json.loads(closure.attrs["provenance"])["parameters"]["crack"]
    return float(np.prod(crack["block_cells"]))


def _domain(tree: xr.DataTree) -> Closure | None:
    return _closure(tree, "domains/box_dimension", "box_dimension", "null_dimension", "differs_from_random")


def domain_lacunar(tree: xr.DataTree) -> Finding | None:
    domain = _domain(tree)
    if domain is None:
        return None
    largest = float(np.nanmax(domain.values["box_dimension"]))
    return _finding(f"at most {largest:.2f}", largest < 2.0 - SMALLEST_GAP)


def domain_pointwise(tree: xr.DataTree) -> Finding | None:
    domain = _domain(tree)
    if domain is None:
        return None
    first = domain.values["box_dimension"][:, 0]
    values = f"{_span(first)} at {domain.pressure[0] / 1e6:.3g} MPa"
    return _finding(values, bool((first <= POINTWISE).all()))


def domain_grows(tree: xr.DataTree) -> Finding | None:
    domain = _domain(tree)
    if domain is None or len(domain.pressure) < 2:
        return None
    dimension, null = domain.values["box_dimension"], domain.values["null_dimension"]
    steps = np.diff(dimension, axis=1)
    grows = (steps >= -NO_FALL).all(axis=1) & (dimension[:, -1] > dimension[:, 0] + NO_FALL)
    values = (
        f"at {int(grows.sum())} of {grows.size} shears, to {_span(dimension[:, -1])}; "
        f"null {_span(null[:, 0])} to {_span(null[:, -1])}"
    )
    return _finding(values, bool(grows.all()))


def domain_structured(tree: xr.DataTree) -> Finding | None:
    domain = _domain(tree)
    if domain is None:
        return None
    dimension, null = domain.values["box_dimension"][:, -1], domain.values["null_dimension"][:, -1]
    clustered = (dimension > null) & (domain.values["differs_from_random"][:, -1] > 0)
    values = f"{_list(dimension, '.2f')}; null {_list(null, '.2f')}"
    return _finding(values, bool(clustered.all()))


def domain_above_one(tree: xr.DataTree) -> Finding | None:
    domain = _domain(tree)
    if domain is None:
        return None
    largest = np.nanmax(domain.values["box_dimension"], axis=1)
    return _finding(f"at {int((largest > 1).sum())} of {largest.size} shears", bool((largest > 1).all()))


def domain_falls(tree: xr.DataTree) -> Finding | None:
    domain = _domain(tree)
    steps = None if domain is None else domain.steps()
    if domain is None or steps is None:
        return None
    rows = domain.up_to(PLATEAU)
    dimension, null = (domain.values[name][rows, steps[-1]] for name in ("box_dimension", "null_dimension"))
    return _trend(f"{_list(dimension, '.2f')}; null {_list(null, '.2f')}", dimension[:, None], -1)


def _whole_block(tree: xr.DataTree) -> tuple[Array, Array] | None:
    """Return the dimension counted over the whole block and that of its null, at the shears up to .80 mm."""
    closure = _closure(tree, "joints/closure", "contact_fraction")
    steps = None if closure is None else closure.steps()
    if closure is None or steps is None or "state" not in tree["joints/closure"].data_vars:
        return None
    from fractalcontact import domains

    data = _towards_west(tree["joints/closure"].to_dataset())
    mask = data["state"].isel(step=steps[-1])
    shear = np.asarray(mask["shear"].values)
    mask = mask.isel(shear=np.flatnonzero((shear > 0) & (shear <= PLATEAU * (1 + SAME_POINT))))
    edge = min(mask.sizes["y"], mask.sizes["x"])
    boxes = domains.box_dimension(mask, scales=[size for size in range(1, edge + 1) if edge % size == 0])
    return np.asarray(boxes["box_dimension"].values), np.asarray(boxes["null_dimension"].values)


def domain_falls_whole(tree: xr.DataTree) -> Finding | None:
    pair = _whole_block(tree)
    if pair is None:
        return None
    return _trend(f"{_list(pair[0], '.2f')}; null {_list(pair[1], '.2f')}", pair[0][:, None], -1)


def domain_falls_beyond_null(tree: xr.DataTree) -> Finding | None:
    pair = _whole_block(tree)
    if pair is None or pair[0].size < 2:
        return None
    fall, null = (float(values[0] - values[-1]) for values in pair)
    return _finding(f"falls by {fall:.2f}, the null by {null:.2f}", fall > 0 and null < fall / 2)


def far_domain(tree: xr.DataTree) -> Finding | None:
    domain = _domain(tree)
    steps = None if domain is None else domain.steps()
    far = None if domain is None else domain.at_shear(FAR)
    if domain is None or steps is None or far is None:
        return None
    dimension = domain.values["box_dimension"][:, steps[-1]]
    near, last = dimension[domain.up_to(PLATEAU)], dimension[far]
    outside = last < np.nanmin(near) - DIFFERENT or last > np.nanmax(near) + DIFFERENT
    return _finding(f"{last:.2f} beside {_span(near)}", bool(outside))


def decorrelation(tree: xr.DataTree) -> Finding | None:
    result = group_of(tree, "joints/decorrelation_length")
    if result is None:
        return None
    length = float(np.ravel(_towards_west(result)["decorrelation_length"].values)[0])
    return _finding(_mm(length) if np.isfinite(length) else "none", bool(length < FAR))


class Rigid(NamedTuple):
    """Rigid dilatancy of two directions of the paper."""

    names: tuple[str, ...]
    shear: Array
    dilatancy: Array  # direction, shear
    plateau: int  # index of .80 mm
    mean_slope: Array


def _rigid(tree: xr.DataTree, names: tuple[str, ...]) -> Rigid | None:
    data = group_of(tree, "joints/rigid_dilatancy")
    if data is None or "direction" not in data.dims or "shear" not in data.dims:
        return None
    present = [str(name) for name in data["direction"].values]
    shear = np.asarray(data["shear"].values, dtype=float)
    plateau = _nearest(shear, PLATEAU)
    if plateau is None or not set(names) <= set(present):
        return None
    data = data.isel(direction=[present.index(name) for name in names])
    dilatancy = np.asarray(data["rigid_dilatancy"].transpose("direction", "shear").values)
    return Rigid(names, shear, dilatancy, plateau, np.asarray(data["mean_slope"].values))


def steep_rise(tree: xr.DataTree) -> Finding | None:
    rigid = _rigid(tree, FLAT_DIRECTIONS)
    if rigid is None:
        return None
    reached = rigid.dilatancy[:, rigid.plateau]
    near = np.abs(reached / PLATEAU_DILATANCY - 1.0) <= SAME_HEIGHT
    return _finding(_named(rigid.names, reached * 1e3, ".2f") + " mm", bool(near.all()))


def plateau(tree: xr.DataTree) -> Finding | None:
    rigid = _rigid(tree, FLAT_DIRECTIONS)
    if rigid is None or rigid.shear[-1] < FAR * (1 - SAME_POINT):
        return None
    reached, later = rigid.dilatancy[:, rigid.plateau], rigid.dilatancy[:, rigid.plateau :]
    if not (reached > 0).all():
        return _finding(_named(rigid.names, reached * 1e3, ".2f") + " mm at .8 mm", False)
    low, high = later.min(axis=1) / reached - 1, later.max(axis=1) / reached - 1
    ranges = zip(rigid.names, 100 * low, 100 * high, strict=True)
    values = ", ".join(f"{name} {least:+.0f} to {most:+.0f} %" for name, least, most in ranges)
    flat = (low >= -SAME_HEIGHT) & (high <= SAME_HEIGHT)
    return _finding(f"{values} after .8 mm", bool(flat.all()))


def _asymptote(rigid: Rigid) -> Array:
    """Return the slopes of straight lines through the second half of the path."""
    half = rigid.shear >= rigid.shear[-1] / 2
    return np.asarray(np.polyfit(rigid.shear[half], rigid.dilatancy[:, half].T, 1)[0])


def keeps_rising(tree: xr.DataTree) -> Finding | None:
    rigid = _rigid(tree, RISING_DIRECTIONS)
    if rigid is None or rigid.shear[-1] < FAR * (1 - SAME_POINT):
        return None
    first, last = rigid.dilatancy[:, rigid.plateau], rigid.dilatancy[:, -1]
    rises = (last >= (1 + SAME_HEIGHT) * first) & (last > first) & (_asymptote(rigid) > 0)
    values = f"{_named(rigid.names, first * 1e3, '.2f')}; {_named(rigid.names, last * 1e3, '.2f')} mm"
    return _finding(f"{values} at {_mm(rigid.shear[-1])}", bool(rises.all()))


def by_mean_slope(tree: xr.DataTree) -> Finding | None:
    rigid = _rigid(tree, RISING_DIRECTIONS)
    if rigid is None or rigid.shear[-1] < FAR * (1 - SAME_POINT):
        return None
    slope = _asymptote(rigid)
    near = (rigid.mean_slope > 0) & (np.abs(slope - rigid.mean_slope) <= SAME_SLOPE * rigid.mean_slope)
    values = f"{_named(rigid.names, slope, '+.3f')}; mean {_named(rigid.names, rigid.mean_slope, '+.3f')}"
    return _finding(values, bool(near.all()))


def _elastic(tree: xr.DataTree) -> tuple[Array, Array] | None:
    """Return shear, and elastic dilatancy over (shear, step)."""
    data = group_of(tree, "joints/elastic_dilatancy")
    if data is None or "shear" not in data.dims:
        return None
    dilatancy = _towards_west(data)["dilatancy"].transpose("shear", "step").values
    return np.asarray(data["shear"].values, dtype=float), np.asarray(dilatancy)


def less_under_force(tree: xr.DataTree) -> Finding | None:
    curve = _elastic(tree)
    if curve is None:
        return None
    return Finding(f"{_list(curve[1][-1] * 1e6)} um at {_mm(curve[0][-1])}", BY_CONSTRUCTION)


def friction_angle(tree: xr.DataTree) -> Finding | None:
    friction = group_of(tree, "joints/friction")
    if friction is None:
        return None
    return Finding(f"basic angle {float(friction['basic_friction_angle']):g} degree", BY_CONSTRUCTION)


def coefficient(tree: xr.DataTree) -> Finding | None:
    curve, elastic = _elastic(tree), group_of(tree, "joints/elastic_dilatancy")
    ends = None if curve is None else [_nearest(curve[0], PLATEAU), _nearest(curve[0], 0.0)]
    if curve is None or elastic is None or ends is None or None in ends:
        return None
    last, first = curve[1][ends]  # type: ignore[index]
    basic = float(elastic["basic_friction_angle"])
    angle = basic + np.degrees(np.arctan2(last - first, PLATEAU))
    if (angle >= 90).any():
        return _finding(f"up to {angle.max():.0f} degree: the faces lock", False)
    coefficient = np.tan(np.radians(angle))
    low, high = COEFFICIENTS[0] - SAME_COEFFICIENT, COEFFICIENTS[1] + SAME_COEFFICIENT
    return _finding(_list(coefficient, ".2f"), bool(((coefficient >= low) & (coefficient <= high)).all()))


def leakage(tree: xr.DataTree) -> Finding | None:
    flow = _closure(tree, "joints/transmissivity", "transmissivity")
    plateau = None if flow is None else flow.at_shear(PLATEAU)
    if flow is None or plateau is None:
        return None
    values = flow.values["transmissivity"][:, -1]  # shear, axis
    first, last = values[0].min(), values[plateau].min()
    text = f"{first:.2g} to {last:.2g} m3 from {_mm(flow.shear[0])} to .8 mm"
    return _finding(text, bool(last > 0 and last >= STRONG_FLOW * first))


def self_weight(_: xr.DataTree) -> Finding:
    return Finding("see joints.self_weight_strength", BY_CONSTRUCTION)


def resolution(_: xr.DataTree) -> Finding:
    return Finding("needs studies at two spacings", NOT_TESTED)


def elimination(_: xr.DataTree) -> Finding:
    return Finding("see the elimination method of contact.press", NOT_TESTED)


def _finding(result: str, is_true: bool) -> Finding:
    return Finding(result, YES if is_true else NO)


def _trend(result: str, values: Array, sign: int) -> Finding | None:
    """Return whether all columns of values over shear grow (+1) or fall (-1); None for a single shear."""
    if len(values) < 2:
        return None
    holds = sign * np.diff(values, axis=0) > 0
    return _finding(f"{result}: {int(holds.sum())} of {holds.size} steps", bool(holds.all()))


def _nearest(values: Array, wanted: float) -> int | None:
    """Return the index of a value, None where no value is the wanted one."""
    if not np.size(values):
        return None
    index = int(np.argmin(np.abs(values - wanted)))
    return index if abs(values[index] - wanted) <= SAME_POINT * wanted else None


def _list(values: Iterable[float], form: str = ".3g") -> str:
    return ", ".join(f"{value:{form}}" for value in values)


def _named(names: Iterable[str], values: Iterable[float], form: str) -> str:
    return ", ".join(f"{name} {value:{form}}" for name, value in zip(names, values, strict=True))


def _span(values: Array) -> str:
    return f"{np.nanmin(values):.2f} to {np.nanmax(values):.2f}"


def _mm(metres: float) -> str:
    return f"{metres * 1e3:.3g} mm"
