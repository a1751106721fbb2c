"""Tables of the summary on joints: faces, closure, dilatancy, strength, leakage, uplift and slip.

Each function returns the parts of one section, none where the study has no such results.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from fractalcontact.base.tables import Note, Part, Table
from fractalcontact.base.units import number, quantity_text
from fractalcontact.scenes._caveats import MEMBER, aperture_as_placed, group_of, peak_remarks
from fractalcontact.scenes._summary_numbers import (
    ROUNDING,
    amount,
    at_directions,
    at_shears,
    column_scale,
    finite,
    length,
    plain,
)

WATER = 998.2 * 9.81 / 1.002e-3  # 1/(m s): unit weight of water over its viscosity, at 20 °C
OUTSIDE_SCALE = (
    "A coefficient outside 0 to 20, the scale of the standard profiles, is extrapolated: it only says that "
    "the face is smoother, or rougher, than all of them."
)


def joint_roughness(tree: xr.DataTree) -> list[Part]:
    """Return the roughness coefficient and the directional roughness of a joint, by direction."""
    tables: list[Part] = []
    if (jrc := group_of(tree, "joints/roughness_coefficient")) is not None:
        rows: list[tuple[str, ...]] = [
            ("joint roughness coefficient (JRC)", "mean", "scatter of the profiles")
        ]
        for direction, profiles in at_directions(jrc):
            low, high = (plain(profiles[f"roughness_coefficient_{end}"], 1) for end in ("low", "high"))
            rows.append((direction, plain(profiles["roughness_coefficient"], 1), f"{low} ... {high}"))
        tables.append(Table(rows))
        if (jrc["scale_position"] != 0).any():
            tables.append(Note(OUTSIDE_SCALE))
    if (polar := group_of(tree, "joints/directional_roughness")) is not None:
        metric = polar["roughness_metric"].mean(MEMBER) if MEMBER in polar.dims else polar["roughness_metric"]
        if metric.notnull().any():
            rows = [("directional roughness (Grasselli)", "azimuth", "theta_max / (C + 1)")]
            for word, place in (("largest", np.nanargmax), ("smallest", np.nanargmin)):
                at = metric.isel(azimuth=int(place(metric.values)))
                rows.append((word, f"{float(at['azimuth']):g}°", f"{float(at):.2f}°"))
            tables.append(Table(rows))
            tables.append(
                Note("Azimuths are from E (+x) anticlockwise; a compass bearing is 90° minus the azimuth.")
            )
    return tables


def position(tree: xr.DataTree) -> list[Part]:
    """Return how two measured faces lie: mated or as scanned."""
    upper = group_of(tree, "joints/faces")
    if upper is None:
        return []
    lines: list[Part] = []
    if "mismatch" in upper:
        lines = [
            f"mated position: shift {amount(upper['shift_x'])} along x and {amount(upper['shift_y'])} "
            f"along y, rotation {amount(upper['rotation'])}",
            f"mismatch {amount(upper['mismatch'])} rms, correlation {plain(upper['correlation'], 3)}",
        ]
    aperture = aperture_as_placed(tree)
    return lines if aperture is None else [*lines, *_openings(aperture)]


def _openings(aperture: xr.DataArray) -> Iterator[Part]:
    """Yield the opening of the faces where they lie, and at first touch."""
    mean, smallest = float(aperture.mean()), float(aperture.min())
    yield f"aperture: mean {length(mean)}, smallest {length(smallest)}"
    if smallest < 0.0:
        yield Note(
            f"negative: the faces overlap. Rigid, they first touch with the upper one lifted by "
            f"{length(-smallest)}, at a mean aperture of {length(mean - smallest)}"
        )


def closure(tree: xr.DataTree) -> list[Part]:
    closure = group_of(tree, "joints/closure")
    if closure is None:
        return []
    names = ("normal_force", "closure", "interface_closure", "contact_fraction", "corrected_contact_fraction")
    head = ("closure at shear", "normal force", "closure", "interface closure", "contact area")
    rows: list[tuple[str, ...]] = [(*head, "area, perimeter-corrected")]
    last = closure.isel(step=-1)
    scales = {name: column_scale(last[name]) for name in names}
    for shear, state in at_shears(last):
        rows.append((shear, *(amount(state[name], scale=scales[name]) for name in names)))
    return [Table(rows), *map(Note, _last_pressure(last))]


def _last_pressure(last: xr.Dataset) -> Iterator[str]:
    """Yield the nominal pressure of the last step, where it is one for all shears."""
    pressures = finite(last["nominal_pressure"]) if "nominal_pressure" in last else np.zeros(0)
    if pressures.size and float(np.ptp(pressures)) <= ROUNDING * float(np.abs(pressures).max()):
        pressure = quantity_text(float(pressures[0]), "Pa")
        yield f"at the last step of the load, {pressure} on the area of the block"


def elimination(tree: xr.DataTree) -> list[Part]:
    part = group_of(tree, "joints/elimination")
    if part is None:
        return []
    rows = [("elimination at shear", "part of the block", "contact area, last step", "rounds")]
    for shear, state in at_shears(part):
        rounds = finite(state["iterations"])
        ends = dict.fromkeys(f"{end:.0f}" for end in (rounds.min(), rounds.max()))
        last = state.isel(step=-1)
        rows.append(
            (shear, amount(last["nominal_area"]), amount(last["contact_fraction"]), " to ".join(ends))
        )
    return [Table(rows)]


def area_by_spacing(tree: xr.DataTree) -> list[Part]:
    areas = group_of(tree, "joints/area_dimension")
    if areas is None:
        return []
    spacings = [f"area at {length(spacing)}" for spacing in areas["resolution"].values]
    rows: list[tuple[str, ...]] = [("spacing, at shear", "normal force", *spacings, "area dimension")]
    for shear, state in at_shears(areas.isel(step=-1)):
        fractions = state["contact_fraction"]
        every = (amount(fractions.isel(resolution=i)) for i in range(len(spacings)))
        rows.append((shear, amount(state["normal_force"]), *every, plain(state["area_dimension"], 2)))
    return [Table(rows)]


def partial_slip(tree: xr.DataTree, path: str) -> list[Part]:
    slipped = group_of(tree, path)
    if slipped is None:
        return []
    head = ("tangential force", "displacement", "sticks", "stiffness", "dissipated energy")
    names = ("tangential_displacement", "tangential_stiffness", "dissipated_energy")
    rows: list[tuple[str, ...]] = [
        ("partial slip at shear" if "shear" in slipped.dims else "partial slip", *head)
    ]
    for shear, path_of_force in at_shears(slipped):
        for step in range(path_of_force.sizes["step"]):
            state = path_of_force.isel(step=step)
            displacement, stiffness, energy = (amount(state[name]) for name in names)
            share = 100 * state["stick_area"] / state["contact_area"].where(state["contact_area"] > 0)
            force = amount(state["tangential_force"])
            rows.append((shear or str(step), force, displacement, f"{plain(share, 1)} %", stiffness, energy))
    parts: list[Part] = [Table(rows)]
    limit = slipped["friction_coefficient"] * slipped["normal_force"].max()
    parts.append(Note(f"all slides at {quantity_text(float(limit.mean()), 'N')}"))
    if "stuck_ratio" in slipped:
        first = slipped["stiffness_ratio"].isel(step=0)
        ratios = (
            f"{plain(first, 3)} at the first step; {plain(slipped['stuck_ratio'], 3)} where nothing slips"
        )
        parts.append(Note(f"shear over normal stiffness of the joint: {ratios} (theory)"))
    return parts


def delta_dimension(tree: xr.DataTree) -> list[Part]:
    delta = group_of(tree, "joints/delta_dimension")
    if delta is None:
        return []
    names = ("covering_dimension", "variogram_dimension", "spectrum_dimension")
    rows: list[tuple[str, ...]] = [("delta-surface at shear", "D by area", "by variogram", "by spectrum")]
    rows += [(shear, *(plain(state[name], 3) for name in names)) for shear, state in at_shears(delta)]
    return [Table(rows)]


def decorrelation(tree: xr.DataTree) -> list[Part]:
    lengths = group_of(tree, "joints/decorrelation_length")
    if lengths is None:
        return []
    names = ("decorrelation_length", "decorrelation_length_low", "decorrelation_length_high")
    rows = [("decorrelation", "length", "95 % interval")]
    for direction, state in at_directions(lengths):
        value, low, high = (amount(state[name]) for name in names)
        rows.append((direction, value, "none" if low == "-" else f"{low} ... {high}"))
    return [Table(rows)]


def dilatancy(tree: xr.DataTree) -> list[Part]:
    rigid = group_of(tree, "joints/rigid_dilatancy")
    if rigid is None:
        return []
    rows = [("rigid dilatancy", "shear", "dilatancy", "mean slope")]
    for direction, state in at_directions(rigid.isel(shear=-1)):
        slope = plain(state["mean_slope"], 4, sign=True) if "mean_slope" in state else ""
        rows.append((direction, amount(state["shear"]), amount(state["rigid_dilatancy"]), slope))
    return [Table(rows)]


def friction(tree: xr.DataTree) -> list[Part]:
    friction = group_of(tree, "joints/friction")
    if friction is None or "peak_shear_strength" not in friction:
        return []
    column = f"from shear, over {length(friction['peak_distance'].max())}"
    rows = [("peak shear strength", "nominal pressure", "strength", "friction angle", column)]
    names = ("peak_shear_strength", "peak_friction_angle", "peak_shear")
    for direction, towards in at_directions(friction):
        for step in range(friction.sizes["step"]):
            state = towards.isel(step=step)
            strength = state["peak_shear_strength"]
            state = state.where(np.isfinite(strength))
            values = [amount(state[name]) for name in names] if finite(strength).size else None
            pressure = amount(towards["nominal_pressure"].isel(step=step))
            rows.append((direction, pressure, *(values or ("none: the faces lock", "", ""))))
    return [Table(rows), *(Note(remark) for remark in peak_remarks(tree, friction))]


def direct_shear(tree: xr.DataTree) -> list[Part]:
    test = group_of(tree, "joints/direct_shear")
    if test is None:
        return []
    rows = [("direct shear", "peak strength", "friction angle", "residual strength", "worn depth")]
    names = ("peak_shear_strength", "peak_friction_angle", "residual_shear_strength")
    for i in range(test.sizes["nominal_pressure"]):
        state = test.isel(nominal_pressure=i)
        worn = state["wear_depth"].max("point", keep_attrs=True)
        strength, angle, residual = (amount(state[name]) for name in names)
        rows.append((amount(state["nominal_pressure"]), strength, angle, residual, amount(worn)))
    return [Table(rows)]


def self_weight(tree: xr.DataTree) -> list[Part]:
    strengths = group_of(tree, "joints/self_weight")
    if strengths is None:
        return []
    sizes = [f"at {length(size)}" for size in strengths["structure_size"].values]
    faces = "" if "converged" in strengths else " (rigid faces)"  # nothing was pressed without a modulus
    title = f"strength under self-weight{faces}"
    rows: list[tuple[str, ...]] = [(title, "over shear", *sizes, "exponent of size")]
    for direction, towards in at_directions(strengths):
        for shear, state in at_shears(towards):
            every = [amount(state["shear_strength"].isel(structure_size=i)) for i in range(len(sizes))]
            exponent = plain(state["strength_exponent"], 3)
            rows.append((direction, shear, *every, "the faces lock" if "-" in every else exponent))
    return [Table(rows)]


def leakage(tree: xr.DataTree) -> list[Part]:
    flow = group_of(tree, "joints/transmissivity")
    if flow is None:
        return []
    axes = [str(axis) for axis in flow["axis"].values]
    heads = [f"hydraulic, along {axis}" for axis in axes]
    rows: list[tuple[str, ...]] = [("aperture at shear", "normal force", "mean", *heads)]
    last = flow.isel(step=-1)
    force, mean, hydraulic = (
        column_scale(last[name]) for name in ("normal_force", "aperture", "hydraulic_aperture")
    )
    for shear, state in at_shears(last):
        every = (amount(state["hydraulic_aperture"].sel(axis=axis), scale=hydraulic) for axis in axes)
        load, gap = amount(state["normal_force"], scale=force), amount(state["aperture"], scale=mean)
        rows.append((shear, load, gap, *every))
    return [Table(rows), *map(Note, _transmissivity(last["transmissivity"]))]


def _transmissivity(last: xr.DataArray) -> Iterator[str]:
    """Yield the transmissivity in m3, and for water in the unit of hydrogeology."""
    values = finite(last)
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


def uplift(tree: xr.DataTree) -> list[Part]:
    """Return force and arm of the uplift, how they compare with the diagrams, and the stress that remains."""
    water = group_of(tree, "joints/uplift")
    if water is None:
        return []
    balanced = "effective_stress" in water
    diagrams = [str(name) for name in water["diagram"].values]
    load = "effective_stress" if balanced else "nominal_pressure"
    head = ("effective stress" if balanced else "normal stress", *(f"uplift, {name}" for name in diagrams))
    rows: list[tuple[str, ...]] = [("uplift at shear", *head, "arm, joint")]
    remarks: list[str] = []
    for shear, state in at_shears(water if balanced else water.isel(step=-1)):
        forces = state["uplift_force"].transpose("diagram", ...)
        arm = amount(state["uplift_arm"].sel(diagram="joint"))
        rows.append((shear, amount(state[load]), *map(amount, forces), arm))
        remarks += _uplift_remarks(shear, state, diagrams)
    return [Table(rows), *map(Note, remarks)]


def _uplift_remarks(shear: str, state: xr.Dataset, diagrams: list[str]) -> Iterator[str]:
    """Yield whether the joint has more or less uplift than the guidelines assume."""
    joint, arm = (state[name].sel(diagram="joint") for name in ("uplift_force", "uplift_arm"))
    place = f"at shear {shear}: " if shear else ""
    if not np.isfinite(joint.values).all():
        yield f"{place}no effective stress on the path of the closure balances the total stress"
        return
    for name in diagrams[1:]:
        more = float((joint / state["uplift_force"].sel(diagram=name)).mean()) - 1.0
        farther = float((arm - state["uplift_arm"].sel(diagram=name)).mean())
        way, safe = ("less", "on the safe side") if more < 0 else ("more", "NOT on the safe side")
        where = "upstream" if farther < 0 else "downstream"
        yield (
            f"{place}the {name} diagram is {safe}: the joint has {abs(100 * more):.1f} % {way} uplift, which "
            f"acts {length(abs(farther))} farther {where}"
        )
