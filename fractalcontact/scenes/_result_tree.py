"""The results of a study as a tree: the groups, and in its root main numbers, sources and what is missing.

Of many scans there is a row for each, the means with their intervals, and the outliers.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base import provenance, schema
from fractalcontact.base.regression import is_far, random_effects
from fractalcontact.base.study import MEMBER, NO_REFERENCES, group_of, joined_references, provenance_of
from fractalcontact.base.units import span
from fractalcontact.scenes._joint_stages import JRC_COLUMN
from fractalcontact.scenes._result_tables import (
    FRACTIONS,
    SCAN,
    Column,
    ResultTable,
    Rows,
    cell,
    column_scale,
    finite,
    table_of,
)
from fractalcontact.scenes._scene import Scene
from fractalcontact.scenes._study import StudyResults, stacked, total_seconds

Numbers = dict[str, xr.Dataset]
PARTIAL = "partial: "  # start of the attribute `completeness`


def result_tree(scene: Scene, study: StudyResults, main: xr.Dataset | None = None) -> xr.DataTree:
    """Return the finished results as a tree that states what is missing; in its root the `main` ones."""
    own = main_results(study.groups) if main is None else main
    groups = {"/": own} | {f"/{name}": result for name, result in study.groups.items()}
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
        references=joined_references(
            *(str(data.attrs.get("references", NO_REFERENCES)) for data in study.groups.values())
        ),
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
    for name, table in ((name, plain.get(name, {})) for name in ("surface", "upper")):
        if isinstance(read := table.get("read"), list):
            plain[name] = {**table, "read": list(map(_name_outside, read))}
        elif read is not None:
            plain[name] = {**table, "read": _name_outside(read)}
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
    of_all = {"residual": xr.DataArray.max, "converged": xr.DataArray.all, "iterations": xr.DataArray.sum}
    facts = {name: reduce(result[name]).item() for name, reduce in of_all.items() if name in result}
    if "standard_error" in result:
        facts["standard error of H"] = ", ".join(_errors_by_method(result)) or "none"
    if "interpolation_error" in result and np.isfinite(result["interpolation_error"]).all():
        facts["interpolation error (m)"] = float(result["interpolation_error"].max())
    words = provenance_of(result).get("achieved_error")
    return facts if facts or words is None else {"error": words}


def _errors_by_method(estimates: xr.Dataset) -> Iterator[str]:
    """Yield each method with its standard error; with the ends over the members of an ensemble."""
    for name in estimates["method"].values:
        errors = finite(estimates["standard_error"].sel({"method": name}))
        if errors.size:
            yield f"{name} {span(errors, '{:.4f}'.format)}"


OVERVIEW = "overview"  # group: a row for every scan
ERROR = "standard_error"  # of the fractal dimension
JRC, DIMENSION = "roughness_coefficient", "fractal_dimension"


@dataclass(frozen=True)
class Main:
    """A number that stands for a study: the column of a table of scans, and the groups that have it.

    The last of the groups counts. `beside` are further variables of the group that go with it.
    """

    column: Column
    name: str
    groups: tuple[str, ...]
    beside: tuple[str, ...] = ()


def _main(head: str, name: str, decimals: int | None, *groups: str, beside: tuple[str, ...] = ()) -> Main:
    return Main(Column(head, name, decimals), name, groups, beside)


ENDS = (f"{DIMENSION}_low", f"{DIMENSION}_high")
MAIN = (
    _main("dimension D", DIMENSION, 3, "dimensions", beside=(*ENDS, ERROR)),
    Main(JRC_COLUMN, JRC, ("joints/roughness_coefficient",)),
    _main("Sq", "rms_height", None, "surfaces", "surfaces/description"),  # in a file they are one group
    _main("largest contact area", "contact_fraction", None, "contact", "joints/closure"),
    _main("largest closure", "interface_closure", None, "joints/closure"),
    _main("largest dilatancy", "rigid_dilatancy", None, "joints/rigid_dilatancy"),
    _main("largest strength", "peak_shear_strength", None, "joints/friction", "joints/direct_shear"),
)
_COLUMNS = [entry.column for entry in MAIN]
_ROWS = Rows(
    "scans", (SCAN,),
    (_COLUMNS[0], Column("95 % interval", ENDS, 3), *_COLUMNS[1:], Column("why it failed", "reason")),
)  # fmt: skip


def main_results(results: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return the numbers that stand for a study: dimensions of the first method, else the largest values.

    Of an ensemble they are means over the members, without JRC below its scale, of many scans values along
    `scan`. Their names say over which dims they are the largest, and of which group.
    """
    main: dict[str, xr.DataArray] = {}
    for entry in MAIN:
        for group in (group for group in entry.groups if group in results):
            result = results[group]
            for name in (name for name in (entry.name, *entry.beside) if name in result):
                values = result[name].isel(method=0, drop=True) if "method" in result.dims else result[name]
                others = [str(dim) for dim in values.dims if dim not in (MEMBER, SCAN)]
                number = values.max(others) if others else values
                largest = f": the largest over {', '.join(others)}" if others else ""
                words = f"{values.attrs.get('long_name', name)}{largest}, of the group {group}"
                if MEMBER in number.dims:
                    number = on_scale(name, number).mean(MEMBER)
                    words += ", mean over the members"
                main[name] = number.reset_coords(drop=True).assign_attrs(values.attrs, long_name=words)
    return xr.Dataset(main)


def tree_of_scans(scene: Scene, reasons: Mapping[str, str], numbers: Mapping[str, Numbers]) -> xr.DataTree:
    """Return the numbers of all scans along `scan`, their means, and a row for each in the overview.

    A row has what stands for the study of the scan, NaN where there is none, and of `reasons` why it or some
    of its stages failed, "" where it is finished. Of the `numbers` of a scan, its groups, "" is the root.
    """
    groups: dict[str, xr.Dataset] = {OVERVIEW: xr.Dataset(coords={SCAN: list(reasons)})}
    for path in dict.fromkeys(path for each in numbers.values() for path in each if path):
        having = {name: each[path] for name, each in numbers.items() if path in each}
        if any(data.data_vars for data in having.values()):
            groups[path] = stacked(having, SCAN)
    overview = groups[OVERVIEW].merge(main_results(groups), join="left")
    means = pooled(overview)
    done = {name: "incomplete" if reasons[name] else "done" for name in numbers}
    caveats = {name: str(each[""].attrs.get("caveats", "none")) for name, each in numbers.items()}
    texts = [caveats.get(name, "none") for name in reasons]
    overview["status"] = (SCAN, [done.get(name, "failed") for name in reasons])
    overview["reason"] = (SCAN, list(reasons.values()), {"long_name": "why it failed"})
    overview["caveats"] = (SCAN, ["" if text == "none" else text for text in texts])
    groups[OVERVIEW] = schema.label(overview)
    stages = (provenance_of(each[""]).get("stages", {}).items() for each in numbers.values())
    seconds = total_seconds({name: facts["run_time"] for name, facts in each} for each in stages)
    tree = result_tree(scene, StudyResults(groups, seconds), means)
    tree.attrs["caveats"] = "none"  # the overview has those of each
    return tree


def pictured(tree: xr.DataTree) -> xr.DataTree:
    """Return the groups of a study that figures show: of many scans the overview alone."""
    if OVERVIEW not in tree.children:
        return tree
    return xr.DataTree.from_dict({"/": xr.Dataset(attrs=tree.attrs), OVERVIEW: tree[OVERVIEW]})


def on_scale(name: str, values: xr.DataArray) -> xr.DataArray:
    """Return values without JRC below its scale: it is extrapolated, to -40 on a smooth face."""
    return values.where(values >= 0) if name == JRC else values


def pooled(main: xr.Dataset) -> xr.Dataset:
    """Return the mean of every main result over the scans, its interval, and the scatter between scans."""
    means: dict[str, tuple[tuple[()], float, dict[str, str]]] = {}
    for key, values in main.data_vars.items():
        if str(key).endswith(("_low", "_high")) or key == ERROR:
            continue
        values = on_scale(str(key), values)
        has_errors = key == DIMENSION and ERROR in main and main[ERROR].notnull().any()
        errors = main[ERROR].values if has_errors else 0.0
        estimate = random_effects(values.values, errors)
        # D lies between two whole numbers, a share of an area is no more than all of it; what is negative in
        # no scan is so in no mean
        is_dimension = key == DIMENSION
        ends = main.get(ENDS[0], values) if is_dimension else values  # D of white noise is a whole number
        smallest = float(np.fmin(values.min(), ends.min()))
        least = float(np.floor(smallest)) if is_dimension else 0.0 if smallest >= 0.0 else -np.inf
        most = least + 1.0 if is_dimension else 1.0 if key in FRACTIONS else np.inf
        low, high = np.clip((estimate.low, estimate.high), least, most)
        text = f"{values.attrs['long_name']}: "
        facts = {
            "": (estimate.mean, f"mean over {estimate.count} scans (random effects)"),
            "_low": (float(low), "lower end of the 95 % interval of the mean over scans"),
            "_high": (float(high), "upper end of the 95 % interval of the mean over scans"),
            "_scatter": (estimate.between, "standard deviation between scans, without the error within each"),
            "_scans": (float(estimate.count), "number of scans that have a value"),
        }
        for ending, (value, words) in facts.items():
            units = "1" if ending == "_scans" else values.attrs["units"]
            means[f"{key}{ending}"] = ((), value, {"units": units, "long_name": text + words})
    return xr.Dataset(means)


def scan_tables(tree: xr.DataTree) -> Iterator[ResultTable]:
    """Yield the means over the scans and a row for every scan; nothing for a study of one surface."""
    overview, root = group_of(tree, OVERVIEW), tree.to_dataset(inherit=False)
    if overview is None:
        return
    keys, cells = [], []
    for entry in MAIN:
        head, decimals, name = entry.column.head, entry.column.decimals, entry.name
        if name not in root:
            continue
        scale = column_scale(root[name])
        mean, low, high, scatter = (
            cell(each, decimals, scale)
            for each in (root[f"{name}{end}"].rename(name) for end in ("", "_low", "_high", "_scatter"))
        )
        keys.append((head,))
        count = cell(root[f"{name}_scans"], 0)
        cells.append((mean, "none" if low == "-" else f"{low} to {high}", scatter, count))
    heads = ("mean", "95 % interval", "scatter between scans", "scans")
    yield ResultTable("means over the scans", ("quantity",), tuple(keys), heads, tuple(cells), heads)
    has_failed = bool((overview["status"] != "done").any())
    rows = _ROWS if has_failed else replace(_ROWS, columns=_ROWS.columns[:-1])
    table = table_of(rows, tree, overview)
    if table is not None:
        yield table


def scan_facts(tree: xr.DataTree) -> Iterator[str]:
    """Yield how many scans there are and which failed, are outliers, or have caveats."""
    overview = group_of(tree, OVERVIEW)
    if overview is None:
        return
    names = overview[SCAN].values.astype(str)
    counts = [f"{names.size} scans"]
    for status in ("failed", "incomplete"):
        chosen = names[overview["status"].values == status]
        counts += [f"{chosen.size} {status}: {_few(chosen)}"] if chosen.size else []
    yield "; ".join(counts)
    if JRC in overview and (overview[JRC] < 0).any():
        chosen = names[overview[JRC].values < 0]
        yield f"JRC is below 0, beyond its scale, and left out of the mean: {_few(chosen)}"
    columns = {
        each.column.head: on_scale(each.name, overview[each.name]) for each in MAIN if each.name in overview
    }
    outliers = {head: is_far(values.values) for head, values in columns.items()}
    texts = [f"{head} of {_few(names[is_one])}" for head, is_one in outliers.items() if is_one.any()]
    if texts:
        yield f"outliers: {'; '.join(texts)}"
    caveats = [name for name, text in zip(names, overview["caveats"].values, strict=True) if text]
    if caveats:
        yield f"scans with caveats, which their pages state: {_few(caveats)}"


def _few(names: object, most: int = 3) -> str:
    """Return the first names, at most `most`, and how many more there are."""
    words = [str(name) for name in names]  # type: ignore[attr-defined]
    more = f" and {len(words) - most} more" if len(words) > most else ""
    return ", ".join(words[:most]) + more
