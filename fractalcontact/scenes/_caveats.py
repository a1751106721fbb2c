"""What limits the results of a study, and what each limit does to the numbers; the most important first."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.grid import EXCESS_PER_EDGE
from fractalcontact.base.schema import STEEP
from fractalcontact.base.study import group_of, scene_of
from fractalcontact.base.units import fixed, jrc_text, number, quantity_text
from fractalcontact.scenes._result_tables import length
from fractalcontact.scenes._result_tree import OVERVIEW
from fractalcontact.scenes._stages import STAGES

Array = np.ndarray[Any, np.dtype[Any]]

Rule = Callable[[xr.DataTree], Iterator[str]]
PRESSED = {"contact": "the surface", "joints/closure": "the delta-surface"}


def caveats(tree: xr.DataTree) -> list[str]:
    """Return what limits the results of a study, and what it does to the numbers.

    Parameters
    ----------
    tree : DataTree
        From `fractalcontact.scenes.run` or `fractalcontact.open`; nothing else is read.

    Returns
    -------
    list of str
        One sentence each, the most important first: a dimension without an interval, spikes of a scan, a
        tilted surface below a flat, islands of too few cells, pressures and strengths beyond those of the
        material, slopes beyond small strains, uplift that did not come to balance. Empty where the results
        have no such limit.
    """
    if group_of(tree, OVERVIEW) is not None:  # of many scans: it has the caveats of each
        return []
    sentences = [sentence for rule in RULES for sentence in rule(tree)]
    for name, stage in STAGES.items():
        if (data := group_of(tree, name)) is not None:
            sentences += (f"{name}: {text}" for text in stage.caveats(tree, data))
    return sentences


def _of_contacts(rule: Callable[[xr.DataTree, str, xr.Dataset], Iterator[str]]) -> Rule:
    """Return the rule for every contact of a study, from that for one group of results."""

    def of_all(tree: xr.DataTree) -> Iterator[str]:
        for path in PRESSED:
            data = group_of(tree, path)
            if data is not None and "contact_fraction" in data:
                yield from rule(tree, path, data)

    return of_all


def _no_interval(tree: xr.DataTree) -> Iterator[str]:
    """Yield why the fractal dimension has no interval, each reason once."""
    estimates = group_of(tree, "dimensions")
    if estimates is None or "default" not in estimates["method"].values:
        return
    reasons = estimates["reason"].sel({"method": "default"}).values
    for reason in dict.fromkeys(str(text) for text in np.atleast_1d(reasons) if text):
        yield f"D has no interval: {reason}."


def _spikes(tree: xr.DataTree) -> Iterator[str]:
    """Yield how many points of the scans stand out from all around them, and what they do to the results."""
    counts: dict[str, int] = {}
    heights: dict[str, xr.DataArray] = {}
    clean: dict[str, xr.DataArray] = {}
    for name, path in (("surface", "surfaces"), ("upper", "joints/faces")):
        data, table = group_of(tree, path), _table(tree, name)
        is_scan = "read" in table or "sample" in table
        if data is None or "height" not in data or data["height"].ndim != 2 or not is_scan:
            continue
        if table.get("despike") or min(data["height"].shape) < 3:
            continue
        from fractalcontact import surfaces  # only for scans that were not despiked

        heights[name] = data["height"]
        clean[name] = surfaces.despike(heights[name])
        counts[name] = int(clean[name]["removed_points"])
    if not sum(counts.values()):
        return
    effects: list[str] = []
    if counts.get("surface"):
        effects += _without_spikes(tree, clean["surface"])
    effects += _lift_of_spikes(tree, clean)
    if effects:
        points = " and ".join(f"{count} of [{name}]" for name, count in counts.items() if count)
        without = ", ".join(effects)
        yield f"points that stand out as spikes of a scan: {points}; without them {without} (--despike)."


def _without_spikes(tree: xr.DataTree, clean: xr.DataArray) -> Iterator[str]:
    """Yield the fractal dimension and the roughness coefficient without spikes, where they are others."""
    estimates, jrc = group_of(tree, "dimensions"), group_of(tree, "joints/roughness_coefficient")
    if estimates is not None and "default" in estimates["method"].values:
        from fractalcontact import dimensions

        before = float(estimates["fractal_dimension"].sel({"method": "default"}))
        after = float(dimensions.estimate(clean, **_table(tree, "dimensions"))["fractal_dimension"][0])
        # half of the usual interval, also where there is no D with them, or without
        if not abs(after - before) <= 0.01:
            yield f"D is {fixed(after, 2)}, not {fixed(before, 2)}"
    if jrc is not None:
        from fractalcontact import joints

        direction = [str(name) for name in np.atleast_1d(jrc["direction"].values)]
        values = joints.roughness_coefficient(clean, direction=direction)["roughness_coefficient"].values
        pairs = list(zip(direction, values, np.atleast_1d(jrc["roughness_coefficient"].values), strict=True))
        if max(abs(after - before) for _, after, before in pairs) > 0.5:  # a fortieth of the scale
            words = [(name, jrc_text(after, 0), jrc_text(before, 0)) for name, after, before in pairs]
            text = [
                f"{after}, not {before}, toward {name}" for name, after, before in words if after != before
            ]
            if text:
                yield f"JRC is {', '.join(text)}"


def aperture_as_placed(tree: xr.DataTree) -> xr.DataArray | None:
    """Return the upper less the lower of two measured faces, where they lie; None where they are not kept."""
    upper, lower = group_of(tree, "joints/faces"), group_of(tree, "surfaces")
    if upper is None or lower is None or "height" not in upper or "height" not in lower:
        return None
    return upper["height"] - lower["height"]


def _lift_of_spikes(tree: xr.DataTree, clean: dict[str, xr.DataArray]) -> Iterator[str]:
    """Yield the mean aperture of two faces at first touch without spikes, where it is another."""
    aperture = aperture_as_placed(tree)
    if aperture is None or set(clean) != {"surface", "upper"}:
        return
    without = clean["upper"].drop_vars("removed_points") - clean["surface"].drop_vars("removed_points")
    before, after = (float(opening.mean() - opening.min()) for opening in (aperture, without))
    if before - after > 0.1 * before:  # a tenth of the opening is worth a sentence
        yield f"the faces first touch at a mean aperture of {length(after)}, not {length(before)}"


def _tilt(tree: xr.DataTree) -> Iterator[str]:
    """Yield that a flat presses a tilted surface at one edge."""
    share = float(tree.attrs.get("plane_share", 0.0))
    if share > 0.5 and group_of(tree, "contact") is not None:  # the flat touches one edge
        yield (
            f"the surface is tilted: its mean plane carries {100 * share:.0f} % of Sq², so that the flat "
            "touches one edge first, and area and closure are those of a wedge. Remedy: level = 1."
        )


def _cells_per_island(pressed: xr.Dataset) -> xr.DataArray:
    """Return the median number of cells of the islands of contact, over the dims of the contact area.

    Where no map of the contact is stored, it is the number of cells of square islands with the same ratio of
    perimeter to area. NaN where nothing touches.
    """
    fraction = pressed["contact_fraction"]
    if "state" in pressed:
        planes = pressed["state"].transpose(*fraction.dims, "y", "x")
        masks = np.asarray(planes.values).reshape(-1, *planes.shape[-2:]) > 0
        medians = np.array([_median_cells(mask) for mask in masks])
        return fraction.copy(data=medians.reshape(fraction.shape))
    edges = (fraction - pressed["corrected_contact_fraction"]) / (EXCESS_PER_EDGE * fraction)
    return (4.0 / edges.where(edges > 0)) ** 2


def _median_cells(mask: Array) -> float:
    from scipy import ndimage  # only for this caveat: other summaries need no scipy

    labels, count = ndimage.label(mask)
    return float(np.median(np.bincount(labels.ravel())[1:])) if count else float("nan")


@_of_contacts
def _resolution(_: xr.DataTree, path: str, pressed: xr.Dataset, least: int = 30) -> Iterator[str]:
    """Yield at how many loads the contacts have too few cells, and what the grid does to their areas.

    An island of fewer than `least` cells has the area and the shape of the grid: a disc of 30
    cells is counted a tenth too large, by `EXCESS_PER_EDGE`.
    """
    cells = _cells_per_island(pressed)
    others = [dim for dim in cells.dims if dim != "step"]
    low, high = (np.atleast_1d(getattr(cells, end)(others).values) for end in ("min", "max"))
    touching = np.isfinite(low)
    unresolved = touching & (low < least)
    if not unresolved.any():
        return
    greatest = int(np.flatnonzero(unresolved)[-1])
    ends = dict.fromkeys(number(float(end[greatest]), 2) for end in (low, high))
    of_loads = f"{int(unresolved.sum())} of {int(touching.sum())} loads"
    source = "" if "state" in pressed else ", from their perimeter"
    where = "every load" if unresolved.sum() == touching.sum() else of_loads
    ratio = pressed["contact_fraction"] / pressed["corrected_contact_fraction"].where(cells < least) - 1.0
    excess = float(ratio.where(np.isfinite(ratio)).max())
    counted = (
        f"counted areas are up to {100 * excess:.2g} % above the corrected ones, and " if excess > 0 else ""
    )
    yield (
        f"{path}: contacts are not resolved at {where} (median island {' to '.join(ends)} cells, {least} "
        f"needed{source}): {counted}the shapes and the dimension of islands are those of the grid."
    )


@_of_contacts
def _true_pressure(tree: xr.DataTree, path: str, pressed: xr.Dataset) -> Iterator[str]:
    """Yield that true pressures are beyond the one at which the material yields."""
    if "plastic_work" in pressed:  # a hardness limits the pressure
        return
    true = pressed["nominal_pressure"] / pressed["contact_fraction"].where(pressed["contact_fraction"] > 0)
    low, high = (f"{float(end) / 1e9:.2g}" for end in (true.min(), true.max()))
    limits = _table(tree, "material").get("yield_pressure")
    if limits is not None and float(true.max()) > np.min(limits):
        span = " to ".join(f"{float(limit) / 1e9:.2g}" for limit in np.atleast_1d(limits))
        factor = float(true.max()) / float(np.max(limits))
        times = f", by a factor of up to {factor:.2g}" if factor > 1 else ""
        yield (
            f"{path}: the true mean pressure is {low} to {high} GPa, and the material yields at {span} GPa: "
            f"elastic contact areas are too small{times}; a hardness limits the pressure."
        )


@_of_contacts
def _slopes(_: xr.DataTree, path: str, pressed: xr.Dataset) -> Iterator[str]:
    """Yield that slopes are beyond small strains."""
    if "rms_slope" not in pressed:
        return
    slope = float(pressed["rms_slope"].max())
    if slope > STEEP:
        yield (
            f"{path}: {PRESSED[path]} has an rms slope of up to {slope:.2g}; beyond {STEEP:g} strains are "
            "not small, and the closures and areas of linear elasticity are approximations."
        )


def _strength(tree: xr.DataTree) -> Iterator[str]:
    """Yield that the peak strength is beyond the pressure at which the material yields."""
    friction = group_of(tree, "joints/friction")
    limits = _table(tree, "material").get("yield_pressure")
    if friction is None or limits is None or "peak_shear_strength" not in friction:
        return
    strengths = np.ravel(friction["peak_shear_strength"].values)
    strengths = strengths[np.isfinite(strengths)]
    if strengths.size and strengths.max() > np.min(limits):
        strength, limit = (quantity_text(value, "Pa") for value in (strengths.max(), np.min(limits)))
        yield (
            f"joints/friction: the peak shear strength is up to {strength}, and the material yields at "
            f"{limit}: asperities break before the faces climb over them, and the joint is weaker."
        )


def _table(tree: xr.DataTree, name: str) -> dict[str, Any]:
    """Return a table of the scene of a study, empty where there is none."""
    table = scene_of(tree).get(name)
    return table if isinstance(table, dict) else {}


# the most important first; behind them come those that the entry of a stage names
RULES: tuple[Rule, ...] = (_no_interval, _spikes, _tilt, _resolution, _true_pressure, _strength, _slopes)
