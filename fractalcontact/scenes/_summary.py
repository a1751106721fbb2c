"""The summary of a study for the screen: main results, achieved errors, run times."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.results import provenance_of
from fractalcontact.base.schema import QUANTITIES
from fractalcontact.base.tables import Note, Part, Table, text_of
from fractalcontact.base.validation import Problems
from fractalcontact.scenes import _joint_tables
from fractalcontact.scenes._caveats import MEMBER, caveats, group_of, member_count
from fractalcontact.scenes._contents import reasons, stage_parts
from fractalcontact.scenes._paper import paper_parts
from fractalcontact.scenes._summary_numbers import amount, at_shears, column_scale, finite, length, plain

Summary = list[list[Part]]  # sections of tables, remarks and lines

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
        _joint_tables.joint_roughness(tree),
        _contact(tree),
        _joint_tables.position(tree),
        _joint_tables.closure(tree),
        _joint_tables.elimination(tree),
        _joint_tables.area_by_spacing(tree),
        _joint_tables.partial_slip(tree, "partial_slip"),
        _joint_tables.partial_slip(tree, "joints/partial_slip"),
        _joint_tables.delta_dimension(tree),
        _joint_tables.decorrelation(tree),
        _joint_tables.dilatancy(tree),
        _joint_tables.friction(tree),
        _joint_tables.direct_shear(tree),
        _joint_tables.self_weight(tree),
        _joint_tables.leakage(tree),
        _joint_tables.uplift(tree),
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
                f"{plain(low.mean(), 3)} ... {plain(high.mean(), 3)}" if finite(low).size else "none",
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


def _contact(tree: xr.DataTree) -> list[Part]:
    contact = group_of(tree, "contact")
    if contact is None:
        return []
    rows: list[tuple[str, ...]] = [
        ("step", "nominal pressure", "closure", "contact area", "area, perimeter-corrected")
    ]
    names = ("nominal_pressure", "closure", "contact_fraction", "corrected_contact_fraction")
    scales = {name: column_scale(contact[name]) for name in names}
    for step in range(contact.sizes["step"]):
        state = contact.isel(step=step)
        rows.append((str(step), *(amount(state[name], scale=scales[name]) for name in names)))
    return [Table(rows)]


def _contact_set(tree: xr.DataTree) -> list[Part]:
    boxes = group_of(tree, "domains/box_dimension")
    if boxes is None:
        return []
    rows = [("contact domain, last step", "box dimension", "95 % interval", "boxes (cells)", "random null")]
    last = boxes.isel(step=-1) if "step" in boxes.dims else boxes
    for shear, state in at_shears(last):
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
    ends = (finite(state["scale_min"]), finite(state["scale_max"]))
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
