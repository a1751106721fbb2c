"""What a study says on each claim of the 1998 paper: one function per claim, with its tolerances.

Every function takes the results of a study and returns a `Finding`, or None where the study lacks the
results, the shears or the loads that the claim is about.
"""

from __future__ import annotations

import json

import numpy as np
import xarray as xr

from fractalcontact.base.units import quantity_text
from fractalcontact.scenes._caveats import group_of
from fractalcontact.scenes._paper_study import (
    BY_CONSTRUCTION,
    COEFFICIENTS,
    DIMENSION,
    FAR,
    FLAT_DIRECTIONS,
    MIDDLE,
    PLATEAU,
    PLATEAU_DILATANCY,
    RISING_DIRECTIONS,
    SAME_POINT,
    Array,
    Closure,
    Finding,
    Rigid,
    finding,
    listed,
    named,
    nearest,
    quantities,
    read_closure,
    read_greatest_load,
    read_rigid,
    read_whole_block,
    span,
    towards_west,
    trend,
)

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
LOCKED = 90.0  # degree: a friction angle that has no strength
ANISOTROPIC = 0.25  # least to greatest dilatancy of four directions, as a share of the greatest
STRONG_FLOW = 10.0
UNCORRELATED = float(np.exp(-1.0))  # the correlation that defines the decorrelation length
FEW_ROUNDS = 6
SAME_CLOSURE = 0.1
MIN_CELLS = 30  # fewer cells in contact give no area to fit


def face_dimension(tree: xr.DataTree) -> Finding | None:
    estimates = group_of(tree, "dimensions")
    if estimates is None or "method" not in estimates.dims:
        return None
    dimension = np.asarray(estimates["fractal_dimension"].values, dtype=float)
    low, high = DIMENSION[0] - DIMENSION_TOLERANCE, DIMENSION[1] + DIMENSION_TOLERANCE
    inside = bool(((dimension >= low) & (dimension <= high)).all())  # NaN is not inside
    methods = f"{dimension.size} methods" if dimension.size > 1 else "one method"
    return finding(f"{span(dimension)} by {methods}, tolerance {DIMENSION_TOLERANCE:g}", inside)


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
    return finding(f"{last:.3f} at {quantity_text(curve[0][-1], 'm')}", last > 2.0 + ROUNDING_DIMENSION)


def delta_grows(tree: xr.DataTree) -> Finding | None:
    curve = _delta_dimension(tree)
    if curve is None or curve[0].size < 2:
        return None
    return finding(listed(curve[1], ".3f"), bool((np.diff(curve[1]) > 0).all()))


def longer_closing(tree: xr.DataTree) -> Finding | None:
    closure = read_closure(tree, "joints/closure", "interface_closure")
    steps = None if closure is None else closure.steps()
    if closure is None or steps is None:
        return None
    lengths = closure.values["interface_closure"][:, steps]
    return trend(f"{quantities(lengths[:, -1], 'm')} at 75 MPa", lengths, +1)


def compliance(tree: xr.DataTree) -> Finding | None:
    closure = read_closure(tree, "joints/closure", "interface_closure", "normal_force")
    steps = None if closure is None else closure.steps()
    if closure is None or steps is None:
        return None
    # secants, exact at any spacing of the loads; from no force, which has no closure
    closed, force = (closure.values[name][:, steps] for name in ("interface_closure", "normal_force"))
    compliance = 1e9 * np.diff(closed, axis=1, prepend=0.0) / np.diff(force, axis=1, prepend=0.0)  # µm/kN
    pairs = zip(compliance[0], compliance[-1], strict=True)
    ends = ", ".join(f"{first:.3g} to {last:.3g}" for first, last in pairs)
    return trend(f"{ends} µm/kN", compliance, +1)


def _areas(tree: xr.DataTree) -> tuple[Closure, Array] | None:
    """Return the closure laws, and the contact area (%) over shear at the three pressures."""
    closure = read_closure(tree, "joints/closure", "contact_fraction")
    steps = None if closure is None else closure.steps()
    if closure is None or steps is None:
        return None
    return closure, 100 * closure.values["contact_fraction"][:, steps]


def area_falls(tree: xr.DataTree) -> Finding | None:
    areas = _areas(tree)
    if areas is None:
        return None
    area = areas[1][areas[0].up_to(MIDDLE)]
    return trend(f"{listed(area[:, -1], '.2f')} % at 75 MPa", area, -1)


def area_constant(tree: xr.DataTree) -> Finding | None:
    areas = _areas(tree)
    rows = None if areas is None else [areas[0].at_shear(shear) for shear in (MIDDLE, PLATEAU)]
    if areas is None or rows is None or None in rows:
        return None
    before, after = areas[1][rows]  # type: ignore[index]
    change = after / before - 1.0
    values = f"{before[-1]:.2f} and {after[-1]:.2f} % at 75 MPa; {listed(100 * change, '+.0f')} %"
    return finding(values, bool((np.abs(change) <= SAME_AREA).all()))


def area_proportional(tree: xr.DataTree) -> Finding | None:
    closure = read_closure(tree, "joints/closure", "contact_fraction", "normal_force")
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
    return finding(f"A ~ F^{min(exponents):.2f} to F^{max(exponents):.2f}", bool(near.all()))


def _cells(closure: xr.Dataset) -> float:
    """Return the number of cells of the block."""
    crack = json.loads(closure.attrs["provenance"])["parameters"]["crack"]
    return float(np.prod(crack["block_cells"]))


def _domain(tree: xr.DataTree) -> Closure | None:
    names = ("box_dimension", "ci_high", "null_dimension", "differs_from_random")
    return read_closure(tree, "domains/box_dimension", *names)


def domain_lacunar(tree: xr.DataTree) -> Finding | None:
    domain = _domain(tree)
    if domain is None:
        return None
    largest = float(np.nanmax(domain.values["box_dimension"]))
    ends = domain.values["ci_high"][:, -1]
    if not np.isfinite(ends).any():
        return finding(f"at most {largest:.2f}", largest < 2.0 - SMALLEST_GAP)
    end = float(np.nanmax(ends))
    values = f"at most {largest:.2f}; at the greatest force the intervals reach {end:.2f}"
    return finding(values, max(largest, end) < 2.0 - SMALLEST_GAP)


def domain_pointwise(tree: xr.DataTree) -> Finding | None:
    domain = _domain(tree)
    if domain is None:
        return None
    first = domain.values["box_dimension"][:, 0]
    values = f"{span(first)} at {domain.pressure[0] / 1e6:.3g} MPa"
    return finding(values, bool((first <= POINTWISE).all()))


def domain_grows(tree: xr.DataTree) -> Finding | None:
    domain = _domain(tree)
    if domain is None or len(domain.pressure) < 2:
        return None
    return _growth(domain.values["box_dimension"], domain.values["null_dimension"])


def domain_grows_whole(tree: xr.DataTree) -> Finding | None:
    pair = read_whole_block(tree)
    if pair is None or pair[0].shape[1] < 2:
        return None
    return _growth(*pair)


def _growth(dimension: Array, null: Array) -> Finding:
    """Return whether a dimension over (shear, step) grows with the force at every shear."""
    steps = np.diff(dimension, axis=1)
    grows = (steps >= -NO_FALL).all(axis=1) & (dimension[:, -1] > dimension[:, 0] + NO_FALL)
    values = (
        f"at {int(grows.sum())} of {grows.size} shears, from {span(dimension[:, 0])} to "
        f"{span(dimension[:, -1])}; null {span(null[:, 0])} to {span(null[:, -1])}"
    )
    return finding(values, bool(grows.all()))


def domain_structured(tree: xr.DataTree) -> Finding | None:
    domain = _domain(tree)
    if domain is None:
        return None
    dimension, null = domain.values["box_dimension"][:, -1], domain.values["null_dimension"][:, -1]
    clustered = (dimension > null) & (domain.values["differs_from_random"][:, -1] > 0)
    values = f"{listed(dimension, '.2f')}; null {listed(null, '.2f')}"
    return finding(values, bool(clustered.all()))


def domain_above_one(tree: xr.DataTree) -> Finding | None:
    domain = _domain(tree)
    if domain is None:
        return None
    largest = np.nanmax(domain.values["box_dimension"], axis=1)
    return finding(f"at {int((largest > 1).sum())} of {largest.size} shears", bool((largest > 1).all()))


def domain_falls(tree: xr.DataTree) -> Finding | None:
    domain = _domain(tree)
    steps = None if domain is None else domain.steps()
    if domain is None or steps is None:
        return None
    rows = domain.up_to(PLATEAU)
    dimension, null = (domain.values[name][rows, steps[-1]] for name in ("box_dimension", "null_dimension"))
    return trend(f"{listed(dimension, '.2f')}; null {listed(null, '.2f')}", dimension[:, None], -1)


def domain_falls_whole(tree: xr.DataTree) -> Finding | None:
    pair = read_greatest_load(tree)
    if pair is None:
        return None
    return trend(f"{listed(pair[0], '.2f')}; null {listed(pair[1], '.2f')}", pair[0][:, None], -1)


def domain_falls_beyond_null(tree: xr.DataTree) -> Finding | None:
    pair = read_greatest_load(tree)
    if pair is None or pair[0].size < 2:
        return None
    fall, null = (float(values[0] - values[-1]) for values in pair)
    return finding(f"falls by {fall:.2f}, the null by {null:.2f}", fall > 0 and null < fall / 2)


def far_domain(tree: xr.DataTree) -> Finding | None:
    domain = _domain(tree)
    steps = None if domain is None else domain.steps()
    far = None if domain is None else domain.at_shear(FAR)
    if domain is None or steps is None or far is None:
        return None
    dimension = domain.values["box_dimension"][:, steps[-1]]
    near, last = dimension[domain.up_to(PLATEAU)], dimension[far]
    outside = last < np.nanmin(near) - DIFFERENT or last > np.nanmax(near) + DIFFERENT
    return finding(f"{last:.2f} beside {span(near)}", bool(outside))


def decorrelation(tree: xr.DataTree) -> Finding | None:
    result = group_of(tree, "joints/decorrelation_length")
    if result is None:
        return None
    result = towards_west(result)
    length = float(np.ravel(result["decorrelation_length"].values)[0])
    shear, correlation = (np.ravel(result[name].values) for name in ("shear", "correlation"))
    if not np.isfinite(length) or shear[-1] < FAR * (1 - SAME_POINT):
        return finding("none", False) if shear[-1] >= FAR * (1 - SAME_POINT) else None
    left = float(np.interp(FAR, shear, correlation / correlation[0]))
    text = f"length {quantity_text(length, 'm')}; correlation {left:.2f} at {quantity_text(FAR, 'm')}"
    return finding(text, length < FAR and left < UNCORRELATED)


def steep_rise(tree: xr.DataTree) -> Finding | None:
    rigid = read_rigid(tree, FLAT_DIRECTIONS)
    if rigid is None:
        return None
    reached = rigid.dilatancy[:, rigid.plateau]
    near = np.abs(reached / PLATEAU_DILATANCY - 1.0) <= SAME_HEIGHT
    return finding(named(rigid.names, reached * 1e3, ".2f") + " mm", bool(near.all()))


def plateau(tree: xr.DataTree) -> Finding | None:
    rigid = read_rigid(tree, FLAT_DIRECTIONS)
    if rigid is None or rigid.shear[-1] < FAR * (1 - SAME_POINT):
        return None
    reached, later = rigid.dilatancy[:, rigid.plateau], rigid.dilatancy[:, rigid.plateau :]
    if not (reached > 0).all():
        return finding(named(rigid.names, reached * 1e3, ".2f") + " mm at .8 mm", False)
    low, high = later.min(axis=1) / reached - 1, later.max(axis=1) / reached - 1
    ranges = zip(rigid.names, 100 * low, 100 * high, strict=True)
    values = ", ".join(f"{name} {least:+.0f} to {most:+.0f} %" for name, least, most in ranges)
    flat = (low >= -SAME_HEIGHT) & (high <= SAME_HEIGHT)
    return finding(f"{values} after .8 mm", bool(flat.all()))


def anisotropy(tree: xr.DataTree) -> Finding | None:
    rigid = read_rigid(tree, FLAT_DIRECTIONS + RISING_DIRECTIONS)
    if rigid is None or rigid.shear[-1] < FAR * (1 - SAME_POINT):
        return None
    last = rigid.dilatancy[:, -1]
    values = f"{named(rigid.names, last * 1e3, '.2f')} mm at {quantity_text(rigid.shear[-1], 'm')}"
    return finding(values, bool(np.ptp(last) > ANISOTROPIC * rigid.dilatancy.max()))


def _asymptote(rigid: Rigid) -> Array:
    """Return the slopes of straight lines through the second half of the path."""
    half = rigid.shear >= rigid.shear[-1] / 2
    return np.asarray(np.polyfit(rigid.shear[half], rigid.dilatancy[:, half].T, 1)[0])


def keeps_rising(tree: xr.DataTree) -> Finding | None:
    rigid = read_rigid(tree, RISING_DIRECTIONS)
    if rigid is None or rigid.shear[-1] < FAR * (1 - SAME_POINT):
        return None
    first, last = rigid.dilatancy[:, rigid.plateau], rigid.dilatancy[:, -1]
    rises = (last >= (1 + SAME_HEIGHT) * first) & (last > first) & (_asymptote(rigid) > 0)
    values = f"{named(rigid.names, first * 1e3, '.2f')}; {named(rigid.names, last * 1e3, '.2f')} mm"
    return finding(f"{values} at {quantity_text(rigid.shear[-1], 'm')}", bool(rises.all()))


def by_mean_slope(tree: xr.DataTree) -> Finding | None:
    rigid = read_rigid(tree, RISING_DIRECTIONS)
    if rigid is None or rigid.shear[-1] < FAR * (1 - SAME_POINT):
        return None
    slope = _asymptote(rigid)
    near = (rigid.mean_slope > 0) & (np.abs(slope - rigid.mean_slope) <= SAME_SLOPE * rigid.mean_slope)
    values = f"{named(rigid.names, slope, '+.3f')}; mean {named(rigid.names, rigid.mean_slope, '+.3f')}"
    return finding(values, bool(near.all()))


def _elastic(tree: xr.DataTree) -> tuple[Array, Array] | None:
    """Return shear, and elastic dilatancy over (shear, step)."""
    data = group_of(tree, "joints/elastic_dilatancy")
    if data is None or "shear" not in data.dims:
        return None
    dilatancy = towards_west(data)["dilatancy"].transpose("shear", "step").values
    return np.asarray(data["shear"].values, dtype=float), np.asarray(dilatancy)


def less_under_force(tree: xr.DataTree) -> Finding | None:
    curve = _elastic(tree)
    if curve is None:
        return None
    opening = quantities(curve[1][-1], "m")
    return Finding(f"{opening} at {quantity_text(curve[0][-1], 'm')}", BY_CONSTRUCTION)


def friction_angle(tree: xr.DataTree) -> Finding | None:
    friction = group_of(tree, "joints/friction")
    if friction is None:
        return None
    return Finding(f"basic angle {float(friction['basic_friction_angle']):g} degree", BY_CONSTRUCTION)


def coefficient(tree: xr.DataTree) -> Finding | None:
    curve, elastic = _elastic(tree), group_of(tree, "joints/elastic_dilatancy")
    ends = None if curve is None else [nearest(curve[0], PLATEAU), nearest(curve[0], 0.0)]
    if curve is None or elastic is None or ends is None or None in ends:
        return None
    last, first = curve[1][ends]  # type: ignore[index]
    basic = float(elastic["basic_friction_angle"])
    angle = basic + np.degrees(np.arctan2(last - first, PLATEAU))
    locked = int((angle >= LOCKED).sum())
    if locked:
        return finding(f"none: the faces lock at {locked} of {angle.size} forces", False)
    coefficient = np.tan(np.radians(angle))
    low, high = COEFFICIENTS[0] - SAME_COEFFICIENT, COEFFICIENTS[1] + SAME_COEFFICIENT
    values = f"{listed(coefficient, '.2f')}, tolerance {SAME_COEFFICIENT:g}"
    return finding(values, bool(((coefficient >= low) & (coefficient <= high)).all()))


def leakage(tree: xr.DataTree) -> Finding | None:
    flow = read_closure(tree, "joints/transmissivity", "transmissivity")
    plateau = None if flow is None else flow.at_shear(PLATEAU)
    if flow is None or plateau is None:
        return None
    values = flow.values["transmissivity"][:, -1]  # shear, axis
    first, last = values[0].min(), values[plateau].min()
    text = f"{first:.2g} to {last:.2g} m3 from {quantity_text(flow.shear[0], 'm')} to .8 mm"
    return finding(text, bool(last > 0 and last >= STRONG_FLOW * first))


def self_weight(tree: xr.DataTree) -> Finding | None:
    result = group_of(tree, "joints/self_weight")
    if result is None or result.sizes["structure_size"] < 2:
        return None
    exponents = np.ravel(result["strength_exponent"].values)
    locked = int(np.isnan(exponents).sum())
    text = f"the faces lock in {locked} of {exponents.size} directions and shears" if locked else ""
    if locked < exponents.size:
        grows = f"tau ~ L^{np.nanmin(exponents):.2f} to L^{np.nanmax(exponents):.2f}"
        text = f"{grows}; {text}" if locked else grows
    near = np.abs(exponents - 1.0) <= EXPONENT_TOLERANCE  # NaN is not near
    return finding(text, bool(near.all()))


def _by_spacing(tree: xr.DataTree, name: str) -> tuple[Closure, Array, Array] | None:
    """Return the shears, the spacings from the finest, and values over (shear, pressure, spacing)."""
    study = read_closure(tree, "joints/area_dimension", name, fewest=1)
    steps = None if study is None else study.steps()
    if study is None or steps is None:
        return None
    spacing = np.asarray(tree["joints/area_dimension"]["resolution"].values)
    return study, spacing, study.values[name][:, steps]


def resolution(tree: xr.DataTree) -> Finding | None:
    areas = _by_spacing(tree, "contact_fraction")
    if areas is None:
        return None
    _, spacing, area = areas
    with np.errstate(divide="ignore", invalid="ignore"):
        falls = area[..., 0] <= (1 - SAME_AREA) * area[..., -1]
    text = f"{listed(100 * area[0, -1], '.2f')} % at {quantities(spacing, 'm')} and 75 MPa"
    return finding(f"{text}: {int(falls.sum())} of {falls.size} areas", bool(falls.all()))


def refinement(tree: xr.DataTree) -> Finding | None:
    closures = _by_spacing(tree, "interface_closure")
    if closures is None:
        return None
    _, spacing, closure = closures
    with np.errstate(divide="ignore", invalid="ignore"):
        change = closure[..., 0] / closure[..., 1] - 1.0
    text = f"{100 * np.nanmin(change):+.0f} ... {100 * np.nanmax(change):+.0f} %"
    ends = f"from {quantity_text(spacing[1], 'm')} to {quantity_text(spacing[0], 'm')}"
    return finding(f"w_int {text} {ends}", bool((np.abs(change) <= SAME_CLOSURE).all()))


def elimination(tree: xr.DataTree) -> Finding | None:
    result = group_of(tree, "joints/elimination")
    if result is None:
        return None
    rounds, cells = np.asarray(result["iterations"].values), int(_cells(result))
    converged = bool(result["converged"].all())
    text = f"{rounds.min()} to {rounds.max()} on {cells} points" + ("" if converged else "; not converged")
    return finding(text, converged and bool((rounds <= FEW_ROUNDS).all()))
