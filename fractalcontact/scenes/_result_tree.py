"""The results of a study as a tree: the groups, and in its root what it is from and what is missing."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base import provenance, schema
from fractalcontact.base.study import joined_references, provenance_of
from fractalcontact.scenes._overview import main_results
from fractalcontact.scenes._scene import Scene
from fractalcontact.scenes._study import StudyResults

OWN_REFERENCES = "see the references of each group"
PARTIAL = "partial: "  # start of the attribute `completeness`


def result_tree(scene: Scene, study: StudyResults, main: xr.Dataset | None = None) -> xr.DataTree:
    """Return the finished results as a tree that states what is missing; in its root the `main` ones."""
    groups = {"/": main_results(study.groups) if main is None else main} | {
        f"/{name}": result for name, result in study.groups.items()
    }
    description = groups.pop("/surfaces/description", None)
    if description is not None:
        heights = groups.get("/surfaces", xr.Dataset())
        groups["/surfaces"] = _merged(heights, description) if heights else description
    tree = xr.DataTree.from_dict(
        {path: schema.encoded(dataset) for path, dataset in groups.items()}, name=scene.name
    )
    root = xr.Dataset()
    provenance.stamp(
        root,
        "fractalcontact.scenes.run",
        {"scene": _without_folders(scene.tables)},
        title=str(scene.tables.get("title", scene.name)),
        references=OWN_REFERENCES,
        stages={
            name: {
                "run_time": second,
                "origin": "computed" if second else "kept from an earlier run",
                **(_achieved(study.groups[name]) if name in study.groups else {}),
            }
            for name, second in study.seconds.items()
        },
    )
    named = ", ".join(node.path.strip("/") for node in tree.subtree if node is not tree and node.has_data)
    tree.attrs = root.attrs | {"comment": f"{root.attrs['comment']}; results by group: {named}"}
    if study.missing:
        tree.attrs["completeness"] = f"{PARTIAL}the run was stopped; missing: {', '.join(study.missing)}"
    elif study.failures:
        tree.attrs["completeness"] = PARTIAL + "; ".join(study.reasons)
    tree.attrs |= study.preparation
    return tree


def _without_folders(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of a scene; of a file outside its folder the name alone."""
    plain = dict(tables)
    for name in ("surface", "upper"):
        read = plain.get(name, {}).get("read")
        if isinstance(read, list):
            plain[name] = {**plain[name], "read": [_name_outside(each) for each in read]}
        elif read is not None:
            plain[name] = {**plain[name], "read": _name_outside(read)}
    return plain


def _name_outside(read: Any) -> Any:
    """Return the name alone of a file with an absolute path."""
    is_outside = isinstance(read, str) and (Path(read).is_absolute() or read.startswith("~"))
    return Path(read).name if is_outside else read


def _merged(heights: xr.Dataset, description: xr.Dataset) -> xr.Dataset:
    """Return the heights of a surface with its description; the provenance states both calls."""
    merged = heights.assign(description.data_vars)
    entry = provenance_of(heights) | {"merged": [provenance_of(description)]}
    sources = (dataset.attrs["references"] for dataset in (heights, description))
    references = joined_references(*sources)
    return merged.assign_attrs(provenance=json.dumps(entry), references=references)


def note_run_time(tree: xr.DataTree, start: float) -> None:
    """Note the time since the call of `run`: stages, validation, starting of workers, waiting."""
    entry = provenance_of(tree)
    tree.attrs["provenance"] = json.dumps(entry | {"run_time": time.perf_counter() - start})


def _achieved(result: xr.Dataset) -> dict[str, Any]:
    """Return the accuracy that a result reports: numbers, or words where it has none."""
    facts: dict[str, Any] = {}
    if "residual" in result:
        facts["residual"] = float(result["residual"].max())
    if "converged" in result:
        facts["converged"] = bool(result["converged"].all())
    if "iterations" in result:
        facts["iterations"] = int(result["iterations"].sum())
    if "standard_error" in result:
        by_method = np.atleast_1d(result["standard_error"].values)
        by_method = by_method.reshape(-1, by_method.shape[-1]).T  # the members of an ensemble come first
        known = [errors[np.isfinite(errors)] for errors in by_method]
        ends = [dict.fromkeys(f"{end:.4f}" for end in (e.min(), e.max())) for e in known if e.size]
        facts["standard error of H"] = " ".join(" to ".join(pair) for pair in ends) or "none"
    if "interpolation_error" in result and np.isfinite(result["interpolation_error"]).all():
        facts["interpolation error (m)"] = float(result["interpolation_error"].max())
    words = provenance_of(result).get("achieved_error")
    return facts if facts or words is None else {"error": words}
