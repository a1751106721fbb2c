"""The table of every stage, as `_stages` names it: columns, and remarks for a reader of the whole table."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import starmap
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.file_contents import remarks
from fractalcontact.base.references import provenance_of
from fractalcontact.base.study import MEMBER, group_of
from fractalcontact.base.units import jrc_text, number, quantity_text
from fractalcontact.scenes._result_tables import (
    ROUNDING,
    Column,
    Remarks,
    Rows,
    amount,
    finite,
    in_turn,
    length,
    no_remarks,
    plain,
    rows,
)

WATER = 998.2 * 9.81 / 1.002e-3  # 1/(m s): unit weight of water over its viscosity, at 20 °C
OUTSIDE_SCALE = (
    "A coefficient outside 0 to 20, the scale of the standard profiles, is extrapolated: it only says that "
    "the face is smoother, or rougher, than all of them."
)
# symbol of ISO 25178 and variable of `surfaces.describe` and `surfaces.texture`
ISO_25178 = {
    "Sq": "rms_height",
    "Sa": "mean_absolute_height",
    "Sp": "peak_height",
    "Sv": "valley_depth",
    "Sz": "peak_to_valley",
    "Ssk": "skewness",
    "Sku": "kurtosis",
    "Sdq": "rms_slope",
    "Sdr": "developed_area_excess",
    "Sal": "autocorrelation_length",
    "Str": "texture_aspect_ratio",
    "Sk": "core_height",
    "Spk": "reduced_peak_height",
    "Svk": "reduced_valley_depth",
}
DIMENSIONLESS = ("skewness", "kurtosis", "rms_slope", "developed_area_excess", "texture_aspect_ratio")
ON_SCREEN = ("Sq", "Sdq", "Sal", "Str")


def _along(name: str, dim: str, value: Any) -> Any:
    """Return a function that takes a variable at one value of a dim; None where there is none."""

    def take(state: xr.Dataset) -> Any:
        if name not in state or dim not in state.coords or value not in state[dim].values:
            return None
        return state[name].sel({dim: value})

    return take


def _of_method(_: xr.DataTree, data: xr.Dataset) -> Iterator[str]:
    """Yield notes and reasons, those of several methods once."""
    methods = [str(name) for name in data["method"].values]
    for key in (key for key in ("note", "reason") if key in data):
        texts = data[key].transpose(..., "method").values
        yield from (f"{names}: {text}" for names, text in remarks(methods, texts).items())
    if MEMBER in data.dims:
        yield "The intervals are those of one surface: the means of their ends."


def _misfit(state: xr.Dataset) -> str | None:
    if "misfit" not in state:
        return None
    text = plain(np.abs(state["misfit"]), 1)
    return "" if text == "-" else f"z = {text}"


dimensions = rows(
    "fractal dimension", ("method",),
    Column("dimension D", "fractal_dimension", 3),
    Column("95 % interval", ("fractal_dimension_low", "fractal_dimension_high"), 3),
    Column("range of scales", ("scale_min", "scale_max")),
    Column("goodness of fit", _misfit, screen=False),
    remarks=_of_method,
)  # fmt: skip


def _iso_column(symbol: str, name: str) -> Column:
    return Column(symbol, name, 3 if name in DIMENSIONLESS else None, screen=symbol in ON_SCREEN)


def _gridding(tree: xr.DataTree, data: xr.Dataset) -> Iterator[str]:
    """Yield how a cloud of points became a surface: points, cells, and the plane below the heights."""
    surface = group_of(tree, "surfaces")
    statistics = data if surface is None else surface
    record: Any = provenance_of(statistics)
    while isinstance(record, dict) and "point_distance" not in record:  # what was done to the surface later
        record = record.get("parameters", {}).get("surface", {})
        record = record.get("provenance") if isinstance(record, dict) else None
    if not isinstance(record, dict) or not {"y", "x"} <= set(statistics.sizes):
        return
    spacing = length(float(statistics["x"][1] - statistics["x"][0]))
    cells = " x ".join(str(statistics.sizes[dim]) for dim in ("y", "x"))
    distance = length(record["point_distance"])
    text = f"gridded from {record['points']} points, about {distance} apart, on {cells} cells of {spacing}"
    if record.get("plane") == "best fit":
        tilt = float(np.degrees(np.arccos(min(1.0, abs(record["rotation_matrix"][2][2])))))
        text += f"; heights are above the best-fit plane of the points, tilted by {tilt:.3g}°"
    yield text


surfaces = rows("ISO 25178", (), *starmap(_iso_column, ISO_25178.items()), remarks=_gridding)
texture = rows("texture", (), *surfaces.columns)

AREAS = (
    Column("contact area", "contact_fraction"),
    Column("area, perimeter-corrected", "corrected_contact_fraction", screen=False),
)
contact = rows("contact", ("step",), Column("closure", "closure"), *AREAS)


def _outside_scale(_: xr.DataTree, data: xr.Dataset) -> Iterator[str]:
    if (data["scale_position"] != 0).any():
        yield OUTSIDE_SCALE


def _jrc(state: xr.Dataset) -> Any:
    """Return the roughness coefficient; words for one below the scale."""
    value = state.get("roughness_coefficient")
    return jrc_text(float(value)) if value is not None and value.ndim == 0 and value < 0 else value


def _jrc_scatter(state: xr.Dataset) -> str | None:
    """Return the ends of the scatter of the profiles; words for those below the scale."""
    names = ("roughness_coefficient_low", "roughness_coefficient_high")
    if not set(names) <= set(state.variables):
        return None
    low, high = (float(state[name].mean()) for name in names)
    if not np.isfinite(low + high):
        return "none"
    return " to ".join(dict.fromkeys((jrc_text(low), jrc_text(high))))


roughness_coefficient = rows(
    "joint roughness coefficient (JRC)", ("direction",),
    Column("JRC", _jrc, 1),
    Column("slope Z2", "profile_slope", 3),
    Column("scatter of the profiles", _jrc_scatter),
    remarks=_outside_scale,
)  # fmt: skip


def _extreme(choose: Any) -> Any:
    """Return a function that names the azimuth of the largest or smallest roughness."""

    def describe(data: xr.Dataset) -> str | None:
        metric = data["roughness_metric"]
        metric = metric.mean(MEMBER) if MEMBER in metric.dims else metric
        if not metric.notnull().any():
            return None
        at = metric.isel(azimuth=int(choose(metric.values)))
        return f"{float(at):.2f}° toward {float(at['azimuth']):g}°"

    return describe


def _azimuths(*_: object) -> Iterator[str]:
    yield "Azimuths are from E (+x) anticlockwise; a compass bearing is 90° minus the azimuth."


directional_roughness = rows(
    "directional roughness (Grasselli), theta_max / (C + 1)", (),
    Column("largest roughness metric", _extreme(np.nanargmax)),
    Column("smallest roughness metric", _extreme(np.nanargmin)),
    remarks=_azimuths,
)  # fmt: skip


def aperture_as_placed(tree: xr.DataTree) -> xr.DataArray | None:
    """Return the upper less the lower of two measured faces, where they lie; None where they are not kept."""
    upper, lower = group_of(tree, "joints/faces"), group_of(tree, "surfaces")
    if upper is None or lower is None or "height" not in upper or "height" not in lower:
        return None
    return upper["height"] - lower["height"]


faces = rows(
    "mated position of the upper face", (),
    Column("shift along x", "shift_x"),
    Column("shift along y", "shift_y"),
    Column("rotation", "rotation"),
    Column("mismatch, rms", "mismatch"),
    Column("correlation", "correlation", 3),
)  # fmt: skip


def _last_pressure(_: xr.DataTree, last: xr.Dataset) -> Iterator[str]:
    """Yield the pressure on the block at the last step, where it is the same for all shears."""
    pressures = finite(last["nominal_pressure"])
    if pressures.size and float(np.ptp(pressures)) <= ROUNDING * float(pressures.max()):
        yield f"at the last step of the load, {amount(last['nominal_pressure'])} on the area of the block"


closure = rows(
    "closure", ("shear",),
    Column("normal force", "normal_force", screen=False),
    Column("closure", "closure", screen=False),
    Column("interface closure", "interface_closure"),
    *AREAS,
    remarks=_last_pressure,
)  # fmt: skip
closure_laws = rows(
    "laws of closure", ("shear",),
    Column("initial stiffness", "initial_stiffness", screen=False),
    Column("greatest closure", "greatest_closure", screen=False),
    Column("closure length", "closure_length", screen=False),
    Column("stiffness", "stiffness", screen=False),
)  # fmt: skip
elimination = rows(
    "elimination on a part of the block", ("shear",),
    Column("part of the block", "nominal_area", screen=False),
    Column("contact area", "contact_fraction", screen=False),
    Column("rounds", "iterations", 0, screen=False),
)  # fmt: skip
area_dimension = rows(
    "contact area against the spacing", ("shear", "resolution"),
    Column("normal force", "normal_force", screen=False),
    Column("contact area", "contact_fraction"),
    Column("area dimension", "area_dimension", 2),
)  # fmt: skip


def _sticks(state: xr.Dataset) -> str:
    share = 100 * state["stick_area"] / state["contact_area"].where(state["contact_area"] > 0)
    return f"{plain(share, 1)} %"


def _slip_limits(_: xr.DataTree, data: xr.Dataset) -> Iterator[str]:
    limit = data["friction_coefficient"] * data["normal_force"].max()
    yield f"all slides at {quantity_text(float(limit.mean()), 'N')}"
    if "stuck_ratio" in data:
        first = data["stiffness_ratio"].isel(step=0)
        ratios = f"{plain(first, 3)} at the first step; {plain(data['stuck_ratio'], 3)} where nothing slips"
        yield f"shear over normal stiffness of the joint: {ratios} (theory)"


partial_slip = rows(
    "partial slip", ("shear", "step"),
    Column("displacement", "tangential_displacement"),
    Column("sticks", _sticks),
    Column("stiffness", "tangential_stiffness"),
    Column("dissipated energy", "dissipated_energy"),
    remarks=_slip_limits,
    load="tangential_force",
)  # fmt: skip
delta_dimension = rows(
    "dimension of the delta-surface", ("shear",),
    Column("D of the delta-surface, by area", "covering_dimension", 3),
    Column("by variogram", "variogram_dimension", 3, screen=False),
    Column("by spectrum", "spectrum_dimension", 3, screen=False),
)  # fmt: skip
decorrelation_length = rows(
    "decorrelation", ("direction",),
    Column("decorrelation length", "decorrelation_length"),
    Column("95 % interval", ("decorrelation_length_low", "decorrelation_length_high"), screen=False),
)  # fmt: skip


def _greatest_shear(state: xr.Dataset) -> Any:
    return state["shear"] if "shear" in state.coords else None


def _mean_slope(state: xr.Dataset) -> str | None:
    """Return the slope of the mean plane; None of a face that is level to the digits shown."""
    is_shown = "mean_slope" in state and float(abs(state["mean_slope"]).max()) >= 0.5e-4
    return plain(state["mean_slope"], 4, sign=True) if is_shown else None


rigid_dilatancy = rows(
    "rigid dilatancy", ("direction",),
    Column("shear", _greatest_shear),
    Column("rigid dilatancy", "rigid_dilatancy"),
    Column("slope of face", _mean_slope),
)  # fmt: skip
elastic_dilatancy = rows(
    "elastic dilatancy", ("direction", "step"),
    Column("shear", _greatest_shear, screen=False),
    Column("dilatancy", "dilatancy", screen=False),
    Column("rigid dilatancy", "rigid_dilatancy", screen=False),
)  # fmt: skip


def _strength(name: str) -> Any:
    """Return a function that takes a variable of the peak where the faces do not lock."""

    def take(state: xr.Dataset) -> Any:
        if "peak_shear_strength" not in state:
            return None
        strength = state["peak_shear_strength"]
        if not finite(strength).size:
            return "none: the faces lock" if name == strength.name else ""
        return state[name].where(np.isfinite(strength))

    return take


def _peak_remarks(tree: xr.DataTree, data: xr.Dataset) -> Iterator[str]:
    """Yield how the peaks depend on their distance, and what the kinematic form leaves out of them."""
    if "peak_shear_strength" not in data:
        return
    known = data["peak_friction_angle"].notnull()
    if not known.any():
        return
    if comment := data["peak_friction_angle"].attrs.get("comment"):
        change = _strength_over_half(data)
        strength = f" The strength changes by up to {100 * change:.0f} %." if change else ""
        yield f"The peak friction angle {comment}.{strength}"
    elastic = group_of(tree, "joints/elastic_dilatancy")
    form = provenance_of(data).get("parameters", {}).get("form")
    if elastic is None or "elastic_energy" not in elastic or form != "kinematic" or "plastic_work" in elastic:
        return
    angle = _energy_peak(elastic, data)
    more, locked = (angle - data["peak_friction_angle"]).values, int((known & angle.isnull()).sum())
    more = more[np.isfinite(more)]
    found = [f"gives {more.min():+.1f} to {more.max():+.1f} degree"] if more.size else []
    found += [f"locks the faces in {locked} of {int(known.sum())} cases"] if locked else []
    yield (
        "It is that of the kinematic form, which leaves out the elastic energy that the faces store while "
        f'they slide: form = "energy" {" and ".join(found)}.'
    )


def _strength_over_half(friction: xr.Dataset) -> float | None:
    """Return the greatest relative change of the strength between the two shortest distances."""
    strengths = friction["secant_shear_strength"].sortby("distance").transpose("distance", ...).values
    if len(strengths) < 2:
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.abs(strengths[0] / strengths[1] - 1.0)
    return float(change[np.isfinite(change)].max()) if np.isfinite(change).any() else None


def _energy_peak(elastic: xr.Dataset, friction: xr.Dataset) -> xr.DataArray:
    """Return the peak friction angle of the energy form over the same distance, of every member."""
    from fractalcontact import joints

    distance = float(friction["peak_distance"].max())
    members = range(elastic.sizes[MEMBER]) if MEMBER in elastic.dims else [None]
    peaks = [
        joints.friction(
            elastic if number_of_member is None else elastic.isel({MEMBER: number_of_member}),
            basic_friction_angle=float(friction["basic_friction_angle"].mean()),
            form="energy",
            distance=distance,
        )["peak_friction_angle"]
        for number_of_member in members
    ]
    return peaks[0] if members == [None] else xr.concat(peaks, MEMBER)


def _peak_distance(state: xr.Dataset) -> str | None:
    return length(state["peak_distance"].max()) if "peak_distance" in state else None


friction = rows(
    "peak shear strength", ("direction", "step"),
    Column("peak shear strength", _strength("peak_shear_strength")),
    Column("peak friction angle", _strength("peak_friction_angle")),
    Column("from shear", _strength("peak_shear"), screen=False),
    Column("over", _peak_distance),
    remarks=_peak_remarks,
)  # fmt: skip


def _worn_depth(state: xr.Dataset) -> Any:
    return state["wear_depth"].max("point", keep_attrs=True) if "wear_depth" in state else None


direct_shear = rows(
    "direct shear", ("nominal_pressure",),
    Column("peak strength", "peak_shear_strength"),
    Column("friction angle", "peak_friction_angle"),
    Column("residual strength", "residual_shear_strength"),
    Column("worn depth", _worn_depth),
)  # fmt: skip
shear_curve = rows(
    "shear curve", ("nominal_pressure",),
    Column("peak strength (shear curve)", "peak_shear_strength"),
    Column("at displacement", "peak_displacement"),
)  # fmt: skip


def _at_pressures(_: xr.DataTree, data: xr.Dataset) -> Iterator[str]:
    """Yield what the criteria assume, and where they are used outside their range."""
    if "assumption" in data:
        names = [str(name) for name in data["criterion"].values]
        texts = np.atleast_2d(data["assumption"].transpose(..., "criterion").values)  # of every member
        lines = (f"{name}: {text}" for row in texts for name, text in zip(names, row, strict=True) if text)
        yield from dict.fromkeys(lines)


strength_envelope = rows(
    "strength by criterion", ("criterion",),
    Column("shear strength", "shear_strength"),
    Column("friction angle", "friction_angle", screen=False),
    Column("in its range", "in_range", screen=False),
    remarks=_at_pressures,
)  # fmt: skip


def _rigid_faces(_: xr.DataTree, data: xr.Dataset) -> Iterator[str]:
    if "converged" not in data:  # nothing was pressed without a modulus
        yield "of rigid faces"


def _weight_strength(state: xr.Dataset) -> Any:
    strength = state["shear_strength"]
    return strength if finite(strength).size else "the faces lock"


self_weight = rows(
    "strength under self-weight", ("direction", "shear", "structure_size"),
    Column("shear strength", _weight_strength),
    Column("exponent of size", "strength_exponent", 3, screen=False),
    remarks=_rigid_faces,
)  # fmt: skip


def _transmissivity(_: xr.DataTree, last: xr.Dataset) -> Iterator[str]:
    """Yield the transmissivity in m3, and for water in the unit of hydrogeology."""
    values = finite(last["transmissivity"])
    values = values[values > 0]
    if values.size:
        ends = (float(values.min()), float(values.max()))
        cubes, water = (
            " to ".join(dict.fromkeys(number(factor * end, 3) for end in ends)) for factor in (1.0, WATER)
        )
        yield (
            f"transmissivity, the hydraulic aperture cubed over 12: {cubes} m³; times unit weight over "
            f"viscosity, for water at 20 °C, {water} m²/s"
        )


transmissivity = rows(
    "aperture", ("shear",),
    Column("normal force", "normal_force", screen=False),
    Column("mean aperture", "aperture"),
    Column("hydraulic (x)", _along("hydraulic_aperture", "axis", "x")),
    Column("hydraulic (y)", _along("hydraulic_aperture", "axis", "y"), screen=False),
    remarks=_transmissivity,
)  # fmt: skip


def _uplift_remarks(_: xr.DataTree, data: xr.Dataset) -> Iterator[str]:
    """Yield whether the joint has more or less uplift than the guidelines assume."""
    for shear, state in in_turn(data, "shear"):
        joint, arm = (state[name].sel(diagram="joint") for name in ("uplift_force", "uplift_arm"))
        place = f"at shear {shear}: " if shear else ""
        if not np.isfinite(joint.values).all():
            yield f"{place}no effective stress on the path of the closure balances the total stress"
            continue
        for name in map(str, state["diagram"].values[1:]):
            more = float((joint / state["uplift_force"].sel(diagram=name)).mean()) - 1.0
            farther = float((arm - state["uplift_arm"].sel(diagram=name)).mean())
            way, safe = ("less", "on the safe side") if more < 0 else ("more", "NOT on the safe side")
            where = "upstream" if farther < 0 else "downstream"
            yield (
                f"{place}the {name} diagram is {safe}: the joint has {abs(100 * more):.1f} % {way} uplift, "
                f"which acts {length(abs(farther))} farther {where}"
            )


def _normal_stress(state: xr.Dataset) -> Any:
    return None if "effective_stress" in state else state["nominal_pressure"]


uplift = rows(
    "uplift", ("shear",),
    Column("effective stress", "effective_stress"),
    Column("normal stress", _normal_stress),
    Column("uplift", _along("uplift_force", "diagram", "joint")),
    Column("of the drained diagram", _along("uplift_force", "diagram", "drained"), screen=False),
    Column("of the linear diagram", _along("uplift_force", "diagram", "linear"), screen=False),
    Column("arm, joint", _along("uplift_arm", "diagram", "joint")),
    remarks=_uplift_remarks,
)  # fmt: skip


def _set(title: str, *columns: Column, remarks: Remarks = no_remarks) -> Rows:
    """Return the table of an analysis of contact sets: over the shears, or over the load."""
    return rows(title, ("shear", "step"), *columns, remarks=remarks, first_dim=True)


def _window(state: xr.Dataset) -> str | None:
    """Return the lengths over which the dimension was fitted; those over others are not comparable."""
    names = ("window_low", "window_high") if "window_low" in state else ("scale_min", "scale_max")
    if not set(names) <= set(state.variables) or not finite(state[names[0]]).size:
        return None
    low, high = (finite(state[name]) for name in names)
    if state[names[0]].attrs.get("units") == "m":
        text = f"{length(low.min())} to {length(high.max())}"
    else:
        text = f"{low.min():g} to {high.max():g} cells"
    return text.replace(" ", "\N{NO-BREAK SPACE}")


def _beside_random(_: xr.DataTree, data: xr.Dataset) -> Iterator[str]:
    """Yield how many sets have box counts that random sets of equal coverage do not have."""
    if "differs_from_random" in data:
        differs = np.asarray(data["differs_from_random"].values, dtype=bool)
        yield (
            "The counts of boxes of 2, 3 and 4 cells, not the dimensions, are tested against random sets of "
            f"equal coverage: {int(differs.sum())} of {differs.size} sets differ."
        )


def _beside_null(name: str, null: str) -> Any:
    """Return a function that writes a variable and, in brackets, that of random cells of equal coverage.

    Over several box sizes both are those of the middle one.
    """

    def write(state: xr.Dataset) -> str | None:
        if name not in state:
            return None
        state = state.isel(box_size=state.sizes.get("box_size", 0) // 2, missing_dims="ignore")
        return plain(state[name], 2) + (f" ({plain(state[null], 2)})" if null in state else "")

    return write


def _set_dimension(name: str, words: str) -> Rows:
    return _set(
        words,
        Column(f"{words} D (random)", _beside_null(name, "null_dimension")),
        Column("over", _window),
        Column("95 % interval", ("ci_low", "ci_high"), 2, screen=False),
        remarks=_beside_random,
    )


def _middle_box(state: xr.Dataset) -> str | None:
    if "box_size" not in state.dims:
        return None
    if "box_length" in state:
        return length(float(state["box_length"][state.sizes["box_size"] // 2]))
    return f"{int(state['box_size'][state.sizes['box_size'] // 2])} cells"


def _crosses(state: xr.Dataset) -> str | None:
    """Return the axes along which the set of contacts crosses the body."""
    if "percolates" not in state or "axis" not in state.coords:
        return None
    axes = [str(axis) for axis in state["axis"].values if bool(state["percolates"].sel(axis=axis).all())]
    return f"along {' and '.join(axes)}" if axes else "no"


islands = _set(
    "islands",
    Column("islands", "n_islands", 0),
    Column("largest island", "largest_island"),
    Column("mean area", "mean_island_area", screen=False),
)
box_dimension = _set_dimension("box_dimension", "box")
minkowski_dimension = _set_dimension("minkowski_dimension", "Minkowski")
correlation_dimension = _set_dimension("correlation_dimension", "correlation")
boundary_dimension = _set_dimension("boundary_dimension", "boundary")
generalised_dimensions = _set(
    "generalised dimensions",
    *(Column(f"D_{order}", _along("generalised_dimension", "moment_order", order), 2) for order in (0, 1, 2)),
)
lacunarity = _set(
    "lacunarity",
    Column("lacunarity (random)", _beside_null("lacunarity", "null_lacunarity")),
    Column("boxes", _middle_box),
)
percolation = _set(
    "percolation",
    Column("contacts cross", _crosses),
    Column("largest share", "largest_share"),
)


def _window_dimension(state: xr.Dataset) -> str | None:
    """Return the dimension over the window and that of random spots, or why there is none."""
    if "domain_dimension" not in state:
        return None
    if finite(state["domain_dimension"]).size:
        return f"{plain(state['domain_dimension'], 2)} ({plain(state['spots_dimension'], 2)})"
    flag = state["signature_flag"]
    names = flag.attrs["flag_meanings"].split()
    words = [names[value].replace("_", " ") for value in np.unique(flag.values)]
    return ", ".join(words)


def _longest_scale(name: str) -> Any:
    """Return a function that takes a variable at the longest of the three scales of the window."""
    return lambda state: state[name].isel(scale=-1) if name in state else None


def _signature_window(_: xr.DataTree, data: xr.Dataset) -> Iterator[str]:
    """Yield the windows (each member has its own), and why some states have no dimension."""
    ends = zip(*(data[name].values.ravel() for name in ("window_low", "window_high")), strict=True)
    for low, high in dict.fromkeys((length(low), length(high)) for low, high in ends if np.isfinite(low)):
        yield f"D is over {low} to {high}, beside that of random spots; clustering and patches at {high}."
    reasons = sorted({str(reason) for reason in data["reason"].values.ravel() if reason})
    if reasons:
        count = int((data["signature_flag"] > 0).sum())
        yield f"{count} of {data['signature_flag'].size} states have no dimension, as {reasons[0]}."


signature = _set(
    "signature of the contact set",
    Column("spot", "spot_size"),
    Column("gap", "gap_size"),
    Column("D (random spots)", _window_dimension),
    Column("clustering", _longest_scale("clustering"), 2),
    Column("patch", _longest_scale("integral_range")),
    Column("lacunarity x : y", _longest_scale("lacunarity_ratio"), 2, screen=False),
    remarks=_signature_window,
)
describe = _set(
    "contact set",
    Column("islands", "n_islands", 0),
    Column("box D (random)", _beside_null("box_dimension", "null_dimension")),
    Column("D over the window", _window_dimension),
    Column("clustering", _longest_scale("clustering"), 2),
    Column("contacts cross", _crosses, screen=False),
)
evolution = _set(
    "evolution",
    Column("births", "births", 0),
    Column("deaths", "deaths", 0),
    Column("merges", "merges", 0),
    Column("splits", "splits", 0),
    Column("D (random spots)", _window_dimension, screen=False),
    remarks=_signature_window,
)
