"""The stages of a joint: its faces, closure, dilatancy, strength, and flow."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.study import MEMBER, end_of_first_leg
from fractalcontact.base.units import STIFFNESSES, Scale, jrc_text, number, quantity_text, scale_for, span
from fractalcontact.scenes._result_tables import Column, amount, are_one, at_value, finite, length, plain
from fractalcontact.scenes._scene import LOADS
from fractalcontact.scenes._stage_type import CONTACT_MAPS, PARTIAL_SLIP, SLIP_MAPS, StageType, stage_type
from fractalcontact.scenes._surface_stages import AREAS, SLIP_TABLE, SURFACE

OUTSIDE_SCALE = (
    "JRC outside 0 to 20, the scale of the standard profiles, is extrapolated: it only says that "
    "the face is smoother, or rougher, than all of them."
)


def _outside_scale(_: xr.DataTree, data: xr.Dataset) -> Iterator[str]:
    if (data["scale_position"] != 0).any():
        yield OUTSIDE_SCALE


def _jrc(state: xr.Dataset) -> Any:
    """Return the roughness coefficient, of members those on the scale; words for one below it."""
    value = state.get("roughness_coefficient")
    if value is None or not (value < 0).any():
        return value
    return value.where(value >= 0) if (value >= 0).any() else jrc_text(float(value.max()))


def _jrc_scatter(state: xr.Dataset) -> str:
    """Return the ends of the scatter of the profiles; words for those below the scale."""
    ends = [float(state[f"roughness_coefficient_{end}"].mean()) for end in ("low", "high")]
    return span(ends, jrc_text) if np.isfinite(ends).all() else "none"


def _extreme(choose: Any, fewest: int) -> Any:
    """Return a function that names the azimuth of the largest or smallest roughness of so many at least."""

    def describe(data: xr.Dataset) -> str | None:
        metric = data["roughness_metric"]
        mean = metric.mean(MEMBER) if MEMBER in metric.dims else metric
        if mean.count() < fewest:
            return None
        at = metric.isel(azimuth=int(choose(mean.values)))
        return f"{plain(at, 2)}° toward {float(at['azimuth']):g}°"

    return describe


def _only_azimuth(data: xr.Dataset) -> str | None:
    """Return the roughness of a single azimuth, which is neither the largest nor the smallest."""
    is_one = data["roughness_metric"].sizes.get("azimuth", 1) == 1
    return _extreme(np.nanargmax, 1)(data) if is_one else None


def _azimuths(*_: object) -> Iterator[str]:
    yield "Azimuths are from E (+x) anticlockwise; a compass bearing is 90° minus the azimuth."


def _last_pressure(_: xr.DataTree, last: xr.Dataset) -> Iterator[str]:
    """Yield the pressure on the block at the last step, where it is the same for all shears."""
    if are_one(finite(last["nominal_pressure"])):
        yield f"at the last step of the load, {amount(last['nominal_pressure'])} on the area of the block"


def _pressure_of_a_spring(_: xr.DataTree, test: xr.Dataset) -> Iterator[str]:
    """Yield the range of the pressure where it is that of a spring, which the dilatancy loads."""
    stress = test["normal_stress"]
    if float((stress.min("point") / stress.max("point")).min()) < 0.995:  # seen with three digits
        ends = span(finite(stress), lambda end: quantity_text(end, "Pa"))
        yield f"The nominal pressure is that at the start; the spring makes it {ends} on the path."


def _mean_slope(state: xr.Dataset) -> str | None:
    """Return the slope of the mean plane; None of a face that is level to the digits shown."""
    is_shown = "mean_slope" in state and float(abs(state["mean_slope"]).max()) >= 0.5e-4  # four decimals
    return plain(state["mean_slope"], 4, sign=True) if is_shown else None


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
    has_peak = data["peak_friction_angle"].notnull()
    if not has_peak.any():
        return
    if comment := data["peak_friction_angle"].attrs.get("comment"):
        change = _strength_over_half(data) if comment.startswith("changes") else None
        strength = f" The strength changes by up to {100 * change:.0f} %." if change else ""
        yield f"The peak friction angle {comment}.{strength}"
    if form := tree.attrs.get("energy_form"):
        yield (
            "It is that of the kinematic form, which leaves out the elastic energy that the faces store "
            f'while they slide: form = "energy" {form}.'
        )


def _strength_over_half(friction: xr.Dataset) -> float | None:
    """Return the greatest relative change of the strength between the two shortest distances."""
    strengths = friction["secant_shear_strength"].sortby("distance")
    if strengths.sizes["distance"] < 2:
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        change = finite(
            abs(strengths.isel(distance=0, drop=True) / strengths.isel(distance=1, drop=True) - 1.0)
        )
    return float(change.max()) if change.size else None


def _peak_distance(state: xr.Dataset) -> str | None:
    return length(state["peak_distance"].max()) if "peak_distance" in state else None


def _criteria(tree: xr.DataTree, _: xr.Dataset) -> Iterator[str]:
    """Yield what each criterion assumes, and at which of the pressures it is in its range."""
    data = tree["joints/strength_envelope"].to_dataset()
    if "asperity_angle" in data:
        yield f"asperity angle of the face: {amount(data['asperity_angle'])}"
    pressure = data["nominal_pressure"]
    for name in data["criterion"].values:
        row = data.sel(criterion=name)
        in_range = row["in_range"].any(set(row["in_range"].dims) - set(pressure.dims))  # of some member
        inside = finite(pressure.where(in_range))
        where = "out of its range at every pressure"
        if inside.size:
            where = f"in its range from {span(inside, lambda end: quantity_text(end, 'Pa'))}"
        for text in dict.fromkeys(map(str, np.ravel(row["assumption"].values))):
            yield f"{name}: {text}; {where}" if text else f"{name}: {where}"


def _preferred_law(state: xr.Dataset) -> str:
    """Return the law that the closures prefer, with its constants; of an ensemble the laws of its members."""
    words = str(state["preferred_law"].attrs["flag_meanings"]).split()
    names = [words[int(flag)] for flag in np.ravel(state["preferred_law"].values)]
    if len(names) > 1:
        return ", ".join(f"{name} {names.count(name)}" for name in dict.fromkeys(names))
    state = state.squeeze()
    if not np.isfinite(state["closure_length"]):
        return "none"
    if names[0] == "hyperbolic":
        closure = scale_for("m", state["greatest_closure_low"])
        greatest, stiffness = (
            _with_ends(state, "greatest_closure", closure),
            _with_ends(state, "initial_stiffness", STIFFNESSES["Pa m-1"]),
        )
        return f"hyperbolic, Vm {greatest}, Kni {stiffness}"
    if names[0] == "exponential":
        return (
            f"exponential, l {_with_ends(state, 'closure_length', scale_for('m', state['closure_length']))}"
        )
    misfits = (f"{word} {length(state[f'{word}_misfit'])}" for word in ("exponential", "hyperbolic"))
    return f"{names[0]}, misfits: {', '.join(misfits)}"


def _with_ends(state: xr.Dataset, name: str, scale: Scale) -> str:
    """Return a constant of a law with its interval."""
    ends = [float(scale(state[word])) for word in (name, f"{name}_low", f"{name}_high")]
    value, low, high = (number(end) if np.isfinite(end) else "no bound" for end in ends)
    return f"{value} ({low} to {high}) {scale.unit}"


def _outside_criterion(_: xr.DataTree, data: xr.Dataset) -> Iterator[str]:
    """Yield under which pressures a shear curve is outside the range of its criterion."""
    is_outside = ~data["in_range"].astype(bool)
    dims = [dim for dim in is_outside.dims if dim != "nominal_pressure"]
    outside = finite(data["nominal_pressure"].where(is_outside.any(dims)))
    pressures = [quantity_text(value, "Pa") for value in outside]
    if pressures:
        yield f"shear curve: outside the range of its criterion at {', '.join(pressures)}"


def _rigid_faces(_: xr.DataTree, data: xr.Dataset) -> Iterator[str]:
    if "converged" not in data:  # nothing was pressed without a modulus
        yield "of rigid faces"


def _weight_strength(state: xr.Dataset) -> Any:
    strength = state["shear_strength"]
    return strength if finite(strength).size else "the faces lock"


def _transmissivity(_: xr.DataTree, last: xr.Dataset) -> Iterator[str]:
    """Yield the transmissivity in m3, and for water in the unit of hydrogeology."""
    values = finite(last["transmissivity"])
    if values.any():
        of_water = 998.2 * 9.81 / 1.002e-3  # 1/(m s): unit weight over viscosity, at 20 °C
        cubes, water = (span(factor * values, number) for factor in (1.0, of_water))
        yield (
            f"transmissivity, the hydraulic aperture cubed over 12: {cubes} m³; times unit weight over "
            f"viscosity, for water at 20 °C, {water} m²/s"
        )


def _uplift_remarks(_: xr.DataTree, data: xr.Dataset) -> Iterator[str]:
    """Yield whether the joint has more or less uplift than the guidelines assume."""
    for index in range(data.sizes.get("shear", 1)):
        state, place = data.isel(shear=index, missing_dims="ignore"), ""
        if "shear" in state.coords:
            place = f"at shear {scale_for('m', data['shear'].values).text(state['shear'])}: "
        joint, arm = (state[name].sel(diagram="joint") for name in ("uplift_force", "uplift_arm"))
        if not np.isfinite(joint.values).all():
            yield f"{place}no effective stress on the path of the closure balances the total stress"
            continue
        for name in map(str, state["diagram"].values[1:]):
            more = float((joint / state["uplift_force"].sel(diagram=name)).mean()) - 1.0
            farther = float((arm - state["uplift_arm"].sel(diagram=name)).mean())
            way, safe = ("less", "on the safe side") if more < 0 else ("more", "NOT on the safe side")
            where = f"{length(abs(farther))} farther {'upstream' if farther < 0 else 'downstream'}"
            acts = f", which acts {where}" if np.isfinite(farther) else ""  # no uplift acts nowhere
            yield (
                f"{place}the {name} diagram is {safe}: the joint has {abs(100 * more):.1f} % {way} "
                f"uplift{acts}"
            )


def _limits_of_uplift(_: xr.DataTree, water: xr.Dataset) -> Iterator[str]:
    """Yield where diagrams are unsafe, water is closed off, or no balance was found."""
    forces = water["uplift_force"]
    with np.errstate(divide="ignore", invalid="ignore"):
        more = forces.sel(diagram="joint") / forces.drop_sel(diagram="joint") - 1.0
    largest = finite(more).max(initial=0.0)
    if largest > 0:
        yield (
            f"the diagrams are NOT on the safe side: the joint has up to {100 * largest:.1f} % more uplift."
        )
    isolated = float(water["isolated_fraction"].max())
    if isolated > 0.05:  # less is lost in the pressure beside it
        yield (
            f"up to {100 * isolated:.0f} % of the area is open but closed off from the water; over time it "
            "may come there too, and the uplift grow."
        )
    failed = ~water["converged"]
    if not bool(failed.any()):
        return
    if "balance_error" not in water:
        yield f"{water['converged'].attrs['reason']} in {int(failed.sum())} of {failed.size} cases."
        return
    errors = water["balance_error"].where(failed)
    reasons = (
        "the load path of the closure ends before the effective stress; give it greater loads.",
        "the water carries more than the total stress less the lowest load of the closure: it lifts the "
        "joint, or the path starts too late.",
    )
    for cases, reason in zip((errors < 0, errors > 0), reasons, strict=True):
        if cases.any():
            yield f"in {int(cases.sum())} of {failed.size} cases {reason}"


def _normal_stress(state: xr.Dataset) -> Any:
    return None if "effective_stress" in state else state["nominal_pressure"]


FACES = ("surfaces", "joints/faces")
JRC_COLUMN = Column("JRC", _jrc, 1)


def _joint(
    name: str, *table: Any, needs: tuple[str, ...] = FACES, function: str = "", **more: Any
) -> StageType:
    own, options = f"joint.{name}", {"takes": "crack", "wanted": f"joints.{name}"} | more
    return stage_type(f"joints/{name}", needs, f"joints.{function or name}", *table, table=own, **options)


def _of_surface(name: str, *table: Any, **more: Any) -> StageType:
    return _joint(name, *table, needs=SURFACE, takes="surface", **more)


def _of_gap(name: str, *table: Any, **more: Any) -> StageType:
    return _joint(name, *table, needs=("joints/closure",), takes="map", reads="gap", **more)


STAGES = (
    stage_type(
        "joints/faces",
        SURFACE,
        "joints.register",
        "mated position of the upper face",
        (),
        Column("shift along x", "shift_x"),
        Column("shift along y", "shift_y"),
        Column("rotation", "rotation"),
        Column("mismatch, rms", "mismatch"),
        Column("correlation", "correlation", 3),
        table="upper",
        takes="file",
    ),
    _joint("delta_surface"),
    _joint(
        "delta_dimension",
        "dimension of the delta-surface",
        ("shear",),
        Column("D of the delta-surface, by area", "covering_dimension", 3),
        Column("by variogram", "variogram_dimension", 3, screen=False),
        Column("by spectrum", "spectrum_dimension", 3, screen=False),
    ),
    _joint(
        "rigid_dilatancy",
        "rigid dilatancy",
        ("direction",),
        Column("shear", "shear"),
        Column("rigid dilatancy", "rigid_dilatancy"),
        Column("slope of face", _mean_slope),
        function="dilatancy",
        keys=("shear", "direction"),
    ),
    _joint(
        "closure",
        "closure",
        ("shear",),
        Column("normal force", "normal_force", screen=False),
        Column("closure", "closure", screen=False),
        Column("interface closure", "interface_closure"),
        *AREAS,
        remarks=_last_pressure,
        keeps=CONTACT_MAPS,
        splits=("shear", "step"),
        presses=True,
    ),
    _joint(
        "closure_laws",
        "laws of closure",
        ("shear",),
        Column("initial stiffness", "initial_stiffness", screen=False),
        Column("greatest closure", "greatest_closure", screen=False),
        Column("closure length", "closure_length", screen=False),
        Column("stiffness", "stiffness", screen=False),
        Column("preferred law", _preferred_law, screen=False),
        Column("seating pressure", "seating_pressure", screen=False),
        needs=("joints/closure",),
        takes="result",
        keys=("seating_pressure",),  # its closure is the result of another stage, not a load
    ),
    _joint(
        "elimination",
        "elimination on a part of the block",
        ("shear",),
        Column("part of the block", "nominal_area", screen=False),
        Column("contact area", "contact_fraction", screen=False),
        Column("rounds", "iterations", 0, screen=False),
        function="closure",
        splits=("shear", "step"),
        presses=True,
        # of a part of the block, and elastic
        keys=("block", "shear", "direction", *LOADS, "bulk", "influence", "disc_radius", "tolerance"),
        required=("block",),
        fixed={"method": "elimination"},
    ),
    _joint(
        "area_by_resolution",
        "contact area against the spacing",
        ("shear", "resolution"),
        Column("normal force", "normal_force", screen=False),
        Column("contact area", "contact_fraction"),
        Column("area dimension", "area_dimension", 2),
        splits=("shear",),
        presses=True,
    ),
    _joint(
        PARTIAL_SLIP,
        rows=SLIP_TABLE,
        keeps=SLIP_MAPS,
        splits=("shear",),
        presses=True,
        refuses_hardness=True,
    ),
    _joint(
        "elastic_dilatancy",
        "elastic dilatancy",
        ("direction", "step"),
        Column("shear", "shear", screen=False),
        Column("dilatancy", "dilatancy", screen=False),
        Column("rigid dilatancy", "rigid_dilatancy", screen=False),
        needs=(*FACES, "joints/closure"),
        function="dilatancy",
        splits=("direction", "shear"),
        required=("normal_force",),
        presses=True,
    ),
    _joint(
        "friction",
        "peak shear strength",
        ("direction", "step"),
        Column("peak shear strength", _strength("peak_shear_strength")),
        Column("peak friction angle", _strength("peak_friction_angle")),
        Column("from shear", _strength("peak_shear"), screen=False),
        Column("slope over", _peak_distance),
        remarks=_peak_remarks,
        needs=("joints/elastic_dilatancy or joints/rigid_dilatancy",),
        takes="result",
        own=("nominal_pressure",),  # in [joint] it is the load of the closure
    ),
    _of_surface(
        "roughness_coefficient",
        "joint roughness coefficient (JRC)",
        ("direction",),
        JRC_COLUMN,
        Column("slope Z2", "profile_slope", 3),
        Column("scatter of the profiles", _jrc_scatter),
        Column("read every", "lag", screen=False),
        Column("regression over", "regression_interval", screen=False),
        caveats=_outside_scale,
    ),
    _of_surface(
        "directional_roughness",
        "directional roughness (Grasselli), theta_max / (C + 1)",
        (),
        Column("roughness metric", _only_azimuth),
        Column("largest roughness metric", _extreme(np.nanargmax, 2)),
        Column("smallest roughness metric", _extreme(np.nanargmin, 2)),
        remarks=_azimuths,
    ),
    _joint(
        "direct_shear",
        "direct shear",
        ("nominal_pressure",),
        Column("peak strength", "peak_shear_strength"),
        Column("friction angle", "peak_friction_angle"),
        Column("strength at the end", "residual_shear_strength"),
        Column("end at shear", end_of_first_leg, screen=False),
        Column("worn depth", lambda state: state["wear_depth"].max("point", keep_attrs=True)),
        remarks=_pressure_of_a_spring,
        splits=("nominal_pressure",),
        presses=True,
    ),
    _of_surface(
        "shear_curve",
        "shear curve",
        ("nominal_pressure",),
        Column("peak strength (shear curve)", "peak_shear_strength"),
        Column("at displacement", "peak_displacement"),
        remarks=_outside_criterion,
    ),
    _of_surface(
        "strength_envelope",
        "strength by criterion",
        ("criterion",),
        Column("shear strength", "shear_strength"),
        Column("friction angle", "friction_angle", screen=False),
        Column("in its range", "in_range", screen=False),
        remarks=_criteria,
    ),
    _joint(
        "self_weight",
        "strength under self-weight",
        ("direction", "shear", "structure_size"),
        Column("shear strength", _weight_strength),
        Column("exponent of size", "strength_exponent", 3, screen=False),
        remarks=_rigid_faces,
        presses=True,
        may_be_rigid=True,
    ),
    _joint(
        "decorrelation_length",
        "decorrelation",
        ("direction",),
        Column("decorrelation length", "decorrelation_length"),
        Column("95 % interval", ("decorrelation_length_low", "decorrelation_length_high"), screen=False),
    ),
    _of_gap(
        "transmissivity",
        "aperture",
        ("shear",),
        Column("normal force", "normal_force", screen=False),
        Column("mean aperture", "aperture"),
        Column("hydraulic (x)", at_value("hydraulic_aperture", "axis", "x")),
        Column("hydraulic (y)", at_value("hydraulic_aperture", "axis", "y"), screen=False),
        remarks=_transmissivity,
    ),
    _of_gap(
        "uplift",
        "uplift",
        ("shear",),
        Column("effective stress", "effective_stress"),
        Column("normal stress", _normal_stress),
        Column("uplift", at_value("uplift_force", "diagram", "joint")),
        Column("of the bilinear diagram", at_value("uplift_force", "diagram", "bilinear"), screen=False),
        Column("of the linear diagram", at_value("uplift_force", "diagram", "linear"), screen=False),
        Column("arm, joint", at_value("uplift_arm", "diagram", "joint")),
        remarks=_uplift_remarks,
        caveats=_limits_of_uplift,
    ),
)
