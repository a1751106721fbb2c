"""The summary of a study for the screen: main results, achieved errors, run times."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.results import provenance_of
from fractalcontact.base.schema import QUANTITIES
from fractalcontact.base.tables import Note, Part, Table, text_of
from fractalcontact.base.units import Scale, fixed, number, quantity_text, scale_for
from fractalcontact.base.validation import Problems
from fractalcontact.scenes._caveats import (
    MEMBER,
    aperture_as_placed,
    caveats,
    group_of,
    member_count,
    peak_remarks,
)
from fractalcontact.scenes._contents import reasons, stage_parts
from fractalcontact.scenes._paper import paper_parts

Array = np.ndarray[Any, np.dtype[Any]]

Summary = list[list[Part]]  # sections of tables, remarks and lines

WIDE_COLUMN = 1e3  # greatest ratio of the values of a column with one unit
ROUNDING = 1e-12  # a spread below it is none: the same load for every member
# symbol of ISO 25178 and variable of `surfaces.describe`
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
WATER = 998.2 * 9.81 / 1.002e-3  # 1/(m s): unit weight of water over its viscosity, at 20 °C
OUTSIDE_SCALE = (
    "A coefficient outside 0 to 20, the scale of the standard profiles, is extrapolated: it only says that "
    "the face is smoother, or rougher, than all of them."
)
FRACTIONS = frozenset({"contact_fraction", "corrected_contact_fraction"})


def summary(tree: xr.DataTree) -> str:
    r"""Return the main results of a study with the achieved errors and the run time of every stage.

    Of an ensemble, every number is the mean over the members with its standard deviation. A study whose scene
    says ``paper = true`` is compared with the paper of 1998, an ensemble member by member.

    Parameters
    ----------
    tree : DataTree
        From `fractalcontact.scenes.run` or `fractalcontact.open`.

    Returns
    -------
    str

    Examples
    --------
    >>> import fractalcontact as fc
    >>> result = fc.scenes.run("rigid_sliding", progress=False)
    >>> print("\n".join(fc.scenes.summary(result).splitlines()[2:5]))
    rigid dilatancy    shear    dilatancy    mean slope
    -----------------  -------  -----------  ------------
    E                  10 mm    1.15 mm      +0.0264
    """
    with Problems("fractalcontact.scenes.summary") as problems:
        problems.tree("tree", tree)
    return summary_text(tree, summary_parts(tree))


def summary_text(tree: xr.DataTree, sections: Summary) -> str:
    """Return the sections of the summary as text, below the title of the study."""
    title = str(tree.attrs.get("title", tree.name or "result"))
    return "\n\n".join([title, *map(text_of, sections)])


def summary_parts(tree: xr.DataTree) -> Summary:
    """Return the sections of the summary."""
    sections: Summary = [
        _ensemble(member_count(tree)),
        _selected(tree),
        _dimensions(tree),
        _surface_parameters(tree),
        _joint_roughness(tree),
        _contact(tree),
        _position(tree),
        _closure(tree),
        _elimination(tree),
        _area_by_spacing(tree),
        _partial_slip(tree, "partial_slip"),
        _partial_slip(tree, "joints/partial_slip"),
        _delta_dimension(tree),
        _decorrelation(tree),
        _dilatancy(tree),
        _friction(tree),
        _direct_shear(tree),
        _self_weight(tree),
        _leakage(tree),
        _uplift(tree),
        _contact_set(tree),
        [Note(caveat) for caveat in caveats(tree)],
        paper_parts(tree) if compares_with_paper(tree) else [],
        stage_parts(tree),
    ]
    return [section for section in sections if section]


def compares_with_paper(tree: xr.DataTree) -> bool:
    """Return whether the scene of a study says ``paper = true``."""
    try:
        scene = json.loads(tree.attrs["provenance"])["parameters"]["scene"]
    except (KeyError, TypeError, ValueError):
        return False
    return isinstance(scene, dict) and scene.get("paper") is True


def _ensemble(members: int) -> list[Part]:
    if not members:
        return []
    return [f"ensemble of {members} members: mean ± standard deviation over the members"]


def amount(data: Any, digits: int = 3, scale: Scale | None = None) -> str:
    """Return a value with its unit and SI prefix; of an ensemble mean and standard deviation.

    `scale` is that of a column, see `_column_scale`.
    """
    name = str(data.name)
    if name in FRACTIONS:
        scale = Scale(0.01, "%")
    elif scale is None:
        scale = scale_for(_units_of(data), float(_finite(data).mean()) if _finite(data).size else np.nan)
    unit = f" {scale.unit}".rstrip()
    return _over_members(scale(data.values), lambda value: number(value, digits), _decimals_of, unit)


def _units_of(data: Any) -> str:
    return str(data.attrs.get("units") or QUANTITIES[str(data.name)].units or "")


def _column_scale(data: Any) -> Scale | None:
    """Return one unit for a column of a table; None, each value its own, where they span three decades."""
    sizes = np.abs(_finite(data))
    sizes = sizes[sizes > 0]
    if sizes.size == 0 or sizes.max() >= WIDE_COLUMN * sizes.min():
        return None
    return scale_for(_units_of(data), float(np.median(sizes)))


def plain(data: Any, decimals: int, *, sign: bool = False) -> str:
    """Return a number with so many decimals; of an ensemble mean and standard deviation."""
    return _over_members(
        data.values,
        lambda value: fixed(value, decimals, sign=sign),
        lambda _: decimals,
    )


def _over_members(
    values: Any, text: Callable[[float], str], decimals: Callable[[float], int], unit: str = ""
) -> str:
    """Return the value of all, or mean ± standard deviation with the number of members that have one.

    `text` writes a single value; `decimals` gives those of the mean and of the deviation from the deviation.
    """
    values = np.asarray(values, dtype=float)
    known = values[np.isfinite(values)]
    if known.size == 0:
        return "-"
    share = f" ({known.size} of {values.size})" if known.size < values.size else ""
    if values.ndim == 0 or float(np.ptp(known)) <= ROUNDING * float(np.abs(known).max()):
        return text(float(known[0])) + unit + share
    spread = float(np.std(known, ddof=1))
    digits, sign = decimals(spread), text(float(known.mean())).startswith("+")
    return f"{fixed(float(known.mean()), digits, sign=sign)} ± {fixed(spread, digits)}{unit}{share}"


def _decimals_of(spread: float) -> int:
    """Return the decimals that show a standard deviation with two digits."""
    return max(0, 1 - int(np.floor(np.log10(spread))))


def _finite(data: Any) -> Array:
    values = np.asarray(data.values, dtype=float)
    return np.asarray(values[np.isfinite(values)])


def length(value: Any) -> str:
    """Return a length in metres with the prefix that suits it."""
    return quantity_text(value, "m")


def _selected(tree: xr.DataTree) -> list[Part]:
    return [f"selected: {choice}" for choice in str(tree.attrs.get("selected", "")).split("; ") if choice]


def _dimensions(tree: xr.DataTree) -> list[Part]:
    estimates = group_of(tree, "dimensions")
    if estimates is None or "method" not in estimates.dims:
        return []
    rows = [("fractal dimension", "D", "95 % interval of D", "range of scales", "goodness of fit")]
    largest = estimates["fractal_dimension"] + estimates["hurst"]
    for method in estimates["method"].values:
        estimate, top = (data.sel({"method": method}) for data in (estimates, largest))
        low, high = (top - estimate[end] for end in ("ci_high", "ci_low"))
        misfit = plain(np.abs(estimate["misfit"]), 1)
        rows.append(
            (
                str(method),
                plain(estimate["fractal_dimension"], 3),
                f"{plain(low.mean(), 3)} ... {plain(high.mean(), 3)}" if _finite(low).size else "none",
                f"{amount(estimate['scale_min'].mean(keep_attrs=True))} ... "
                f"{amount(estimate['scale_max'].mean(keep_attrs=True))}",
                "" if misfit == "-" else f"z = {misfit}",
            )
        )
    remarks = reasons(estimates["hurst"].attrs, "comment") | reasons(estimates["ci_low"].attrs, "reason")
    parts: list[Part] = [Table(rows), *(Note(f"{names}: {reason}") for names, reason in remarks.items())]
    if MEMBER in estimates.dims:
        parts.append(Note("The intervals are those of one surface: the means of their ends."))
    return parts


def _surface_parameters(tree: xr.DataTree) -> list[Part]:
    """Return the parameters of ISO 25178 that the description of the surface has."""
    statistics = group_of(tree, "surfaces")
    if statistics is None or "rms_height" not in statistics:
        return []
    if (texture := group_of(tree, "surfaces/texture")) is not None:
        statistics = statistics.assign(texture.data_vars)
    rows: list[tuple[str, ...]] = [("ISO 25178", "parameter", "value")]
    for symbol, name in ISO_25178.items():
        if name in statistics:
            values = statistics[name]
            text = amount(values) if values.attrs.get("units") == "m" else plain(values, 3)
            rows.append((symbol, QUANTITIES[name].long_name, text))
    return [Table(rows), *map(Note, _gridding(statistics))]


def _gridding(statistics: xr.Dataset) -> Iterator[str]:
    """Yield how a cloud of points became a surface: points, cells, and the plane below the heights."""
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


def _joint_roughness(tree: xr.DataTree) -> list[Part]:
    """Return the roughness coefficient and the directional roughness of a joint, by direction."""
    tables: list[Part] = []
    if (jrc := group_of(tree, "joints/roughness_coefficient")) is not None:
        rows: list[tuple[str, ...]] = [
            ("joint roughness coefficient (JRC)", "mean", "scatter of the profiles")
        ]
        for direction, profiles in _at_directions(jrc):
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


def _contact(tree: xr.DataTree) -> list[Part]:
    contact = group_of(tree, "contact")
    if contact is None:
        return []
    rows: list[tuple[str, ...]] = [
        ("step", "nominal pressure", "closure", "contact area", "area, perimeter-corrected")
    ]
    names = ("nominal_pressure", "closure", "contact_fraction", "corrected_contact_fraction")
    scales = {name: _column_scale(contact[name]) for name in names}
    for step in range(contact.sizes["step"]):
        state = contact.isel(step=step)
        rows.append((str(step), *(amount(state[name], scale=scales[name]) for name in names)))
    return [Table(rows)]


def _position(tree: xr.DataTree) -> list[Part]:
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


def _closure(tree: xr.DataTree) -> list[Part]:
    closure = group_of(tree, "joints/closure")
    if closure is None:
        return []
    names = ("normal_force", "closure", "interface_closure", "contact_fraction", "corrected_contact_fraction")
    head = ("closure at shear", "normal force", "closure", "interface closure", "contact area")
    rows: list[tuple[str, ...]] = [(*head, "area, perimeter-corrected")]
    last = closure.isel(step=-1)
    scales = {name: _column_scale(last[name]) for name in names}
    for shear, state in _at_shears(last):
        rows.append((shear, *(amount(state[name], scale=scales[name]) for name in names)))
    return [Table(rows), *map(Note, _last_pressure(last))]


def _last_pressure(last: xr.Dataset) -> Iterator[str]:
    """Yield the nominal pressure of the last step, where it is one for all shears."""
    pressures = _finite(last["nominal_pressure"]) if "nominal_pressure" in last else np.zeros(0)
    if pressures.size and float(np.ptp(pressures)) <= ROUNDING * float(np.abs(pressures).max()):
        pressure = quantity_text(float(pressures[0]), "Pa")
        yield f"at the last step of the load, {pressure} on the area of the block"


def _elimination(tree: xr.DataTree) -> list[Part]:
    part = group_of(tree, "joints/elimination")
    if part is None:
        return []
    rows = [("elimination at shear", "part of the block", "contact area, last step", "rounds")]
    for shear, state in _at_shears(part):
        rounds = _finite(state["iterations"])
        ends = dict.fromkeys(f"{end:.0f}" for end in (rounds.min(), rounds.max()))
        last = state.isel(step=-1)
        rows.append(
            (shear, amount(last["nominal_area"]), amount(last["contact_fraction"]), " to ".join(ends))
        )
    return [Table(rows)]


def _area_by_spacing(tree: xr.DataTree) -> list[Part]:
    areas = group_of(tree, "joints/area_dimension")
    if areas is None:
        return []
    spacings = [f"area at {length(spacing)}" for spacing in areas["resolution"].values]
    rows: list[tuple[str, ...]] = [("spacing, at shear", "normal force", *spacings, "area dimension")]
    for shear, state in _at_shears(areas.isel(step=-1)):
        fractions = state["contact_fraction"]
        every = (amount(fractions.isel(resolution=i)) for i in range(len(spacings)))
        rows.append((shear, amount(state["normal_force"]), *every, plain(state["area_dimension"], 2)))
    return [Table(rows)]


def _delta_dimension(tree: xr.DataTree) -> list[Part]:
    delta = group_of(tree, "joints/delta_dimension")
    if delta is None:
        return []
    names = ("covering_dimension", "variogram_dimension", "spectrum_dimension")
    rows: list[tuple[str, ...]] = [("delta-surface at shear", "D by area", "by variogram", "by spectrum")]
    rows += [(shear, *(plain(state[name], 3) for name in names)) for shear, state in _at_shears(delta)]
    return [Table(rows)]


def _decorrelation(tree: xr.DataTree) -> list[Part]:
    lengths = group_of(tree, "joints/decorrelation_length")
    if lengths is None:
        return []
    names = ("decorrelation_length", "decorrelation_length_low", "decorrelation_length_high")
    rows = [("decorrelation", "length", "95 % interval")]
    for direction, state in _at_directions(lengths):
        value, low, high = (amount(state[name]) for name in names)
        rows.append((direction, value, "none" if low == "-" else f"{low} ... {high}"))
    return [Table(rows)]


def _self_weight(tree: xr.DataTree) -> list[Part]:
    strengths = group_of(tree, "joints/self_weight")
    if strengths is None:
        return []
    sizes = [f"at {length(size)}" for size in strengths["structure_size"].values]
    faces = "" if "converged" in strengths else " (rigid faces)"  # nothing was pressed without a modulus
    title = f"strength under self-weight{faces}"
    rows: list[tuple[str, ...]] = [(title, "over shear", *sizes, "exponent of size")]
    for direction, towards in _at_directions(strengths):
        for shear, state in _at_shears(towards):
            every = [amount(state["shear_strength"].isel(structure_size=i)) for i in range(len(sizes))]
            exponent = plain(state["strength_exponent"], 3)
            rows.append((direction, shear, *every, "the faces lock" if "-" in every else exponent))
    return [Table(rows)]


def _leakage(tree: xr.DataTree) -> list[Part]:
    flow = group_of(tree, "joints/transmissivity")
    if flow is None:
        return []
    axes = [str(axis) for axis in flow["axis"].values]
    heads = [f"hydraulic, along {axis}" for axis in axes]
    rows: list[tuple[str, ...]] = [("aperture at shear", "normal force", "mean", *heads)]
    last = flow.isel(step=-1)
    force, mean, hydraulic = (
        _column_scale(last[name]) for name in ("normal_force", "aperture", "hydraulic_aperture")
    )
    for shear, state in _at_shears(last):
        every = (amount(state["hydraulic_aperture"].sel(axis=axis), scale=hydraulic) for axis in axes)
        load, gap = amount(state["normal_force"], scale=force), amount(state["aperture"], scale=mean)
        rows.append((shear, load, gap, *every))
    return [Table(rows), *map(Note, _transmissivity(last["transmissivity"]))]


def _transmissivity(last: xr.DataArray) -> Iterator[str]:
    """Yield the transmissivity in m3, and for water in the unit of hydrogeology."""
    values = _finite(last)
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


def _uplift(tree: xr.DataTree) -> list[Part]:
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
    for shear, state in _at_shears(water if balanced else water.isel(step=-1)):
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


def _partial_slip(tree: xr.DataTree, path: str) -> list[Part]:
    slipped = group_of(tree, path)
    if slipped is None:
        return []
    head = ("tangential force", "displacement", "sticks", "stiffness", "dissipated energy")
    names = ("tangential_displacement", "tangential_stiffness", "dissipated_energy")
    rows: list[tuple[str, ...]] = [
        ("partial slip at shear" if "shear" in slipped.dims else "partial slip", *head)
    ]
    for shear, path_of_force in _at_shears(slipped):
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


def _at_shears(data: xr.Dataset) -> Iterator[tuple[str, xr.Dataset]]:
    """Yield every shear as text with its results."""
    if "shear" not in data.coords:
        yield "", data
        return
    shears = np.atleast_1d(data["shear"].values)
    scale = scale_for("m", shears)
    for i, shear in enumerate(shears):
        yield scale.text(shear), data.isel(shear=i) if "shear" in data.dims else data


def _at_directions(data: xr.Dataset) -> Iterator[tuple[str, xr.Dataset]]:
    """Yield the name of every direction with its results."""
    for direction in np.atleast_1d(data["direction"].values):
        yield str(direction), data.sel(direction=direction) if "direction" in data.dims else data


def _dilatancy(tree: xr.DataTree) -> list[Part]:
    rigid = group_of(tree, "joints/rigid_dilatancy")
    if rigid is None:
        return []
    rows = [("rigid dilatancy", "shear", "dilatancy", "mean slope")]
    for direction, state in _at_directions(rigid.isel(shear=-1)):
        slope = plain(state["mean_slope"], 4, sign=True) if "mean_slope" in state else ""
        rows.append((direction, amount(state["shear"]), amount(state["rigid_dilatancy"]), slope))
    return [Table(rows)]


def _friction(tree: xr.DataTree) -> list[Part]:
    friction = group_of(tree, "joints/friction")
    if friction is None or "peak_shear_strength" not in friction:
        return []
    column = f"from shear, over {length(friction['peak_distance'].max())}"
    rows = [("peak shear strength", "nominal pressure", "strength", "friction angle", column)]
    names = ("peak_shear_strength", "peak_friction_angle", "peak_shear")
    for direction, towards in _at_directions(friction):
        for step in range(friction.sizes["step"]):
            state = towards.isel(step=step)
            strength = state["peak_shear_strength"]
            state = state.where(np.isfinite(strength))
            values = [amount(state[name]) for name in names] if _finite(strength).size else None
            pressure = amount(towards["nominal_pressure"].isel(step=step))
            rows.append((direction, pressure, *(values or ("none: the faces lock", "", ""))))
    return [Table(rows), *(Note(remark) for remark in peak_remarks(tree, friction))]


def _direct_shear(tree: xr.DataTree) -> list[Part]:
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


def _contact_set(tree: xr.DataTree) -> list[Part]:
    boxes = group_of(tree, "domains/box_dimension")
    if boxes is None:
        return []
    rows = [("contact domain, last step", "box dimension", "95 % interval", "boxes (cells)", "random null")]
    last = boxes.isel(step=-1) if "step" in boxes.dims else boxes
    for shear, state in _at_shears(last):
        low, high = state["ci_low"].mean(), state["ci_high"].mean()
        rows.append(
            (
                f"shear {shear}" if shear else "",
                plain(state["box_dimension"], 2),
                f"{plain(low, 2)} ... {plain(high, 2)}" if np.isfinite(low) else "none",
                _boxes(state),
                plain(state["null_dimension"], 2),
            )
        )
    return [Table(rows), Note(_counts_beside_null(last))]


def _boxes(state: xr.Dataset) -> str:
    """Return the smallest and the largest box of the fit; dimensions over other boxes are not comparable."""
    ends = (_finite(state["scale_min"]), _finite(state["scale_max"]))
    return f"{ends[0].min():g} ... {ends[1].max():g}" if ends[0].size else "-"


def _counts_beside_null(boxes: xr.Dataset) -> str:
    """Return how many sets have box counts that random sets of equal coverage do not have.

    The counts are far more precise than the slope fitted to them: they may differ where the dimensions agree.
    """
    differs = np.asarray(boxes["differs_from_random"].values, dtype=bool)
    few = (
        "The counts of boxes of 2, 3 and 4 cells, not the dimensions, are tested against random sets of equal"
    )
    return f"{few} coverage: {int(differs.sum())} of {differs.size} sets differ."
