"""What limits the results of a study: resolution of the spots, slopes, true pressures."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.results import provenance_of
from fractalcontact.base.schema import STEEP
from fractalcontact.base.units import number, quantity_text

Array = np.ndarray[Any, np.dtype[Any]]

MEMBER = "member"
ISOLATED = 0.05  # of the area: less is lost in the pressure beside it
MIN_CELLS = 30  # an island of fewer cells has the area and the shape of the grid
PERIMETER_TO_CELLS = 0.118114160  # of the corrected contact area, see `contact.press`
RARE = 1e-3  # fraction of the openings beyond the quantile that a spike is compared with
SPIKE = 2.0  # distances from the mean to that quantile; a Gaussian opening of 1e6 points has 1.6
STEEP_SPIKE = 5.0  # rms increments of the lower face: one is the error of a filled point
LEAST_OPENINGS = 2000
PRESSED = {"contact": "the surface", "joints/closure": "the delta-surface"}


def caveats(tree: xr.DataTree) -> list[str]:
    """Return what limits the results of a study, for every group that was pressed.

    Parameters
    ----------
    tree : DataTree
        From `fractalcontact.scenes.run` or `fractalcontact.open`; nothing else is read.

    Returns
    -------
    list of str
        One sentence each: a spike that holds two faces apart; islands of too few cells, at which loads;
        slopes beyond small strains; the true pressure where no hardness limits it; strengths beyond that of
        the material; uplift that did not come to balance. Empty where the results have no such limit.
    """
    lines: list[str] = [*_spike(tree)]
    for path, surface in PRESSED.items():
        pressed = group_of(tree, path)
        if pressed is not None and "contact_fraction" in pressed:
            lines += [*_resolution(path, pressed), *_slopes(path, pressed, surface)]
            lines += _true_pressure(path, pressed, _material(tree))
    return [*lines, *_strength(tree), *_uplift(tree)]


def _spike(tree: xr.DataTree) -> Iterator[str]:
    """Yield that the faces touch first at points far below the other openings: spikes of a scan."""
    aperture = aperture_as_placed(tree)
    if aperture is None:
        return
    openings = aperture.values[np.isfinite(aperture.values)]
    if openings.size < LEAST_OPENINGS:
        return
    low, mean = np.quantile(openings, RARE), openings.mean()
    increment = np.sqrt(np.nanmean(np.diff(np.asarray(tree["surfaces/height"]), axis=-1) ** 2))
    if mean - openings.min() > max(SPIKE * (mean - low), STEEP_SPIKE * increment):
        ends = [quantity_text(float(end), "m") for end in (openings.min(), low)]
        yield (
            f"joints/faces: the smallest opening, {ends[0]}, is far below the others, of which "
            f"{100 * (1 - RARE):g} % are above {ends[1]}: probably a spike of a scan, which then carries the "
            "load and holds the faces apart. To remove spikes: despike = true and fill = true in [surface] "
            "and [upper], or --despike."
        )


def aperture_as_placed(tree: xr.DataTree) -> xr.DataArray | None:
    """Return the upper less the lower of two measured faces, where they lie; None where they are not kept."""
    upper, lower = group_of(tree, "joints/faces"), group_of(tree, "surfaces")
    if upper is None or lower is None or "height" not in upper or "height" not in lower:
        return None
    return upper["height"] - lower["height"]


def group_of(tree: xr.DataTree, path: str) -> xr.Dataset | None:
    """Return the Dataset of a group, None where the study has none."""
    node = tree
    for name in path.split("/"):
        if name not in node.children:
            return None
        node = node.children[name]
    return node.to_dataset() if node.has_data else None


def member_count(tree: xr.DataTree) -> int:
    """Return the number of members of an ensemble; 0 for a single study."""
    return max((node.sizes[MEMBER] for node in tree.subtree if MEMBER in node.sizes), default=0)


def of_member(tree: xr.DataTree, number: int) -> xr.DataTree:
    """Return the results of one member of an ensemble."""
    one: xr.DataTree = tree.map_over_datasets(lambda data: data.isel({MEMBER: number}, missing_dims="ignore"))
    one.attrs = dict(tree.attrs)
    return one


def cells_per_island(pressed: xr.Dataset) -> xr.DataArray:
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
    edges = (fraction - pressed["corrected_contact_fraction"]) / (PERIMETER_TO_CELLS * fraction)
    return (4.0 / edges.where(edges > 0)) ** 2


def _median_cells(mask: Array) -> float:
    from scipy import ndimage  # only for this caveat: other summaries need no scipy

    labels, count = ndimage.label(mask)
    return float(np.median(np.bincount(labels.ravel())[1:])) if count else float("nan")


def _resolution(path: str, pressed: xr.Dataset) -> Iterator[str]:
    cells = cells_per_island(pressed)
    others = [dim for dim in cells.dims if dim != "step"]
    low, high = (np.atleast_1d(getattr(cells, end)(others).values) for end in ("min", "max"))
    touching = np.isfinite(low)
    unresolved = touching & (low < MIN_CELLS)
    if not unresolved.any():
        return
    greatest = int(np.flatnonzero(unresolved)[-1])
    ends = dict.fromkeys(number(float(end[greatest]), 2) for end in (low, high))
    where = (
        "at every load"
        if unresolved.sum() == touching.sum()
        else (f"at {int(unresolved.sum())} of {int(touching.sum())} loads")
    )
    source = "" if "state" in pressed else ", from their perimeter"
    yield (
        f"{path}: the spots of contact are not resolved {where}: at the last of them the median of the cells "
        f"per island is {' to '.join(ends)}{source}; {MIN_CELLS} are needed. Areas of single islands and "
        "their shape are those of the grid."
    )


def _slopes(path: str, pressed: xr.Dataset, surface: str) -> Iterator[str]:
    if "rms_slope" not in pressed:
        return
    slope = float(pressed["rms_slope"].max())
    if slope > STEEP:
        yield (
            f"{path}: {surface} has an rms slope of up to {slope:.2g}; beyond {STEEP:g} strains are not "
            "small, and linear elasticity is an approximation."
        )


def _true_pressure(path: str, pressed: xr.Dataset, material: dict[str, Any]) -> Iterator[str]:
    if "plastic_work" in pressed:  # a hardness limits the pressure
        return
    true = pressed["nominal_pressure"] / pressed["contact_fraction"].where(pressed["contact_fraction"] > 0)
    low, high = (f"{float(end) / 1e9:.2g}" for end in (true.min(), true.max()))
    limits = material.get("yield_pressure")
    if limits is not None and float(true.max()) > np.min(limits):
        span = " to ".join(f"{float(limit) / 1e9:.2g}" for limit in np.atleast_1d(limits))
        yield (
            f"{path}: the true mean pressure is {low} to {high} GPa, and the material yields at {span} GPa: "
            "elastic contact areas are too small; a hardness limits the pressure."
        )


def _strength(tree: xr.DataTree) -> Iterator[str]:
    friction, limits = group_of(tree, "joints/friction"), _material(tree).get("yield_pressure")
    if friction is None or limits is None or "peak_shear_strength" not in friction:
        return
    strengths = np.ravel(friction["peak_shear_strength"].values)
    strengths = strengths[np.isfinite(strengths)]
    if strengths.size and strengths.max() > np.min(limits):
        strength, limit = (quantity_text(value, "Pa") for value in (strengths.max(), np.min(limits)))
        yield (
            f"joints/friction: the peak shear strength is up to {strength}, and the material yields at "
            f"{limit}: asperities break before the faces climb over them."
        )


def _uplift(tree: xr.DataTree) -> Iterator[str]:
    water = group_of(tree, "joints/uplift")
    if water is None:
        return
    isolated = float(water["isolated_fraction"].max())
    if isolated > ISOLATED:
        yield (
            f"joints/uplift: up to {100 * isolated:.0f} % of the area is open but closed off from the water; "
            "over time it may come there too, and the uplift grow."
        )
    failed = ~water["converged"] if "converged" in water else np.zeros(1, bool)
    if not bool(failed.any()):
        return
    count = f"{int(failed.sum())} of {failed.size}"
    if "balance_error" not in water:
        yield f"joints/uplift: opening and flow did not come to balance in {count} cases."
        return
    errors = water["balance_error"].where(failed)
    if float(errors.min()) < 0:
        yield (
            f"joints/uplift: in {int((errors < 0).sum())} of {failed.size} cases the load path of the "
            "closure ends before the effective stress; give it greater loads."
        )
    if float(errors.max()) > 0:
        yield (
            f"joints/uplift: in {int((errors > 0).sum())} of {failed.size} cases the water carries more "
            "than the total stress less the lowest load of the closure: it lifts the joint, or the path "
            "starts too late."
        )


def peak_remarks(tree: xr.DataTree, friction: xr.Dataset) -> Iterator[str]:
    """Yield how the peaks depend on their distance, and what the kinematic form leaves out of them."""
    known = friction["peak_friction_angle"].notnull()
    if not known.any():
        return
    comment = friction["peak_friction_angle"].attrs.get("comment")
    if comment:
        change = _strength_over_half(friction)
        strength = f" The strength changes by up to {100 * change:.0f} %." if change else ""
        yield f"The peak friction angle {comment}.{strength}"
    elastic = group_of(tree, "joints/elastic_dilatancy")
    form = provenance_of(friction).get("parameters", {}).get("form")
    if elastic is None or "elastic_energy" not in elastic or form != "kinematic":
        return
    angle = _energy_peak(elastic, friction)
    more, locked = (angle - friction["peak_friction_angle"]).values, int((known & angle.isnull()).sum())
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
            elastic if number is None else elastic.isel({MEMBER: number}),
            basic_friction_angle=float(friction["basic_friction_angle"].mean()),
            form="energy",
            distance=distance,
        )["peak_friction_angle"]
        for number in members
    ]
    return peaks[0] if members == [None] else xr.concat(peaks, MEMBER)


def _material(tree: xr.DataTree) -> dict[str, Any]:
    """Return the table of the material in the scene of a study, empty where there is none."""
    try:
        scene = json.loads(tree.attrs["provenance"])["parameters"]["scene"]
        material = scene.get("material", {})
    except (AttributeError, KeyError, TypeError, ValueError):
        return {}
    return material if isinstance(material, dict) else {}
