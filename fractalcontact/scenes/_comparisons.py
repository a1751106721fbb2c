"""What a run compares its results with, once: those without spikes of scans, and another form of friction.

What it finds stands in words in attributes of the root of its results, which summary and report read.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from fractalcontact.base.compass import direction_text
from fractalcontact.base.study import group_of, provenance_of
from fractalcontact.base.units import fixed, jrc_text
from fractalcontact.scenes._result_tables import finite, length
from fractalcontact.scenes._stage_type import public_function
from fractalcontact.scenes._summary import aperture_as_placed, scene_table


def comparisons(tree: xr.DataTree) -> dict[str, str]:
    """Return what there is to say of the `spikes` of the scans, and of the `energy_form` of friction."""
    words = {"spikes": _spikes(tree), "energy_form": _energy_form(tree)}
    return {name: text for name, text in words.items() if text}


def _spikes(tree: xr.DataTree) -> str:
    """Return how many points of the scans stand out from all around them, and what they do to the results."""
    clean: dict[str, xr.DataArray] = {}
    for name, path in (("surface", "surfaces"), ("upper", "joints/faces")):
        data, table = group_of(tree, path), scene_table(tree, name)
        height = None if data is None else data.get("height")
        is_scan = bool({"read", "sample"} & table.keys()) and not table.get("despike")
        # the square whose median is taken has five points along an edge
        if is_scan and height is not None and height.ndim == 2 and min(height.shape) >= 5:
            clean[name] = public_function("surfaces.despike")(height)
    counts = {name: int(each["removed_points"]) for name, each in clean.items() if each["removed_points"]}
    effects = list(_without_spikes(tree, clean["surface"])) if "surface" in counts else []
    effects += _lift_of_spikes(tree, clean) if counts else []
    if not effects:
        return ""
    points = " and ".join(f"{count} of [{name}]" for name, count in counts.items())
    without = ", ".join(effects)
    return f"points that stand out as spikes of a scan: {points}; without them {without} (--despike)."


def _without_spikes(tree: xr.DataTree, clean: xr.DataArray) -> Iterator[str]:
    """Yield the fractal dimension and the roughness coefficient without spikes, where they are others."""
    estimates, jrc = group_of(tree, "dimensions"), group_of(tree, "joints/roughness_coefficient")
    if estimates is not None and "default" in estimates["method"].values:
        before = float(estimates["fractal_dimension"].sel({"method": "default"}))
        estimate = public_function("dimensions.estimate")
        after = float(estimate(clean, **scene_table(tree, "dimensions"))["fractal_dimension"][0])
        # half of the usual interval, also where there is no D with them, or without
        if not abs(after - before) <= 0.01:
            yield f"D is {fixed(after, 2)}, not {fixed(before, 2)}"
    if jrc is not None:
        stated = provenance_of(jrc)["parameters"]
        settings = {key: stated[key] for key in ("direction", "regression", "lag", "length") if key in stated}
        measured = public_function("joints.roughness_coefficient")(clean, **settings)
        new, old = (np.atleast_1d(each["roughness_coefficient"].values) for each in (measured, jrc))
        texts = ([jrc_text(value, 0) for value in values] for values in (new, old))
        rows = zip(*texts, map(direction_text, np.atleast_1d(jrc["direction"].values)), strict=True)
        words = [f"{one}, not {other}, toward {name}" for one, other, name in rows if one != other]
        if words and np.max(np.abs(new - old)) > 0.5:  # a fortieth of the scale
            yield f"JRC is {', '.join(words)}"


def _lift_of_spikes(tree: xr.DataTree, clean: dict[str, xr.DataArray]) -> Iterator[str]:
    """Yield the mean aperture of two faces at first touch without spikes, where it is another."""
    aperture = aperture_as_placed(tree)
    if aperture is None or set(clean) != {"surface", "upper"}:
        return
    without = clean["upper"].drop_vars("removed_points") - clean["surface"].drop_vars("removed_points")
    before, after = (float(opening.mean() - opening.min()) for opening in (aperture, without))
    after = after if after > 1e-9 * before else 0.0  # the rest of mated faces is rounding
    if before - after > 0.1 * before:  # a tenth of the opening is worth a sentence
        yield f"the faces first touch at a mean aperture of {length(after)}, not {length(before)}"


def _energy_form(tree: xr.DataTree) -> str:
    """Return what the form of friction with the elastic energy does to the peaks of the kinematic one."""
    friction, elastic = (group_of(tree, f"joints/{name}") for name in ("friction", "elastic_dilatancy"))
    if friction is None or "peak_friction_angle" not in friction or elastic is None:
        return ""
    form = provenance_of(friction).get("parameters", {}).get("form")
    if form != "kinematic" or "elastic_energy" not in elastic or "plastic_work" in elastic:
        return ""
    has_peak = friction["peak_friction_angle"].notnull()
    angle = public_function("joints.friction")(  # over the same distance, of every member
        elastic,
        basic_friction_angle=float(friction["basic_friction_angle"].mean()),
        form="energy",
        distance=float(friction["peak_distance"].max()),
    )["peak_friction_angle"]
    more, locked = finite(angle - friction["peak_friction_angle"]), int((has_peak & angle.isnull()).sum())
    effects = [f"gives {more.min():+.1f} to {more.max():+.1f} degree"] if more.size else []
    effects += [f"locks the faces in {locked} of {int(has_peak.sum())} cases"] if locked else []
    return " and ".join(effects)
