"""What there is to say of many scans: a row for each, the means with their intervals, the outliers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.random_effects import random_effects
from fractalcontact.base.robust import is_far
from fractalcontact.base.study import group_of
from fractalcontact.base.units import jrc_text
from fractalcontact.scenes._result_tables import (
    SCAN,
    Column,
    ResultTable,
    Rows,
    amount,
    column_scale,
    plain,
    table_of,
)
from fractalcontact.scenes._results_folder import REPORT

SCANS = "scans"  # folder and group of the single scans
OVERVIEW = "overview"  # group: a row for every scan
ERROR = "standard_error"  # of the fractal dimension
WORDS = 3  # names of scans in a sentence
# head, variable and decimals of what stands for a study
MAIN_COLUMNS = (
    ("dimension D", "fractal_dimension", 3),
    ("JRC", "roughness_coefficient", 1),
    ("Sq", "rms_height", None),
    ("largest contact area", "contact_fraction", None),
    ("largest closure", "interface_closure", None),
    ("largest dilatancy", "rigid_dilatancy", None),
    ("largest strength", "peak_shear_strength", None),
)
JRC = "roughness_coefficient"
ENDS = ("fractal_dimension_low", "fractal_dimension_high")


def _jrc(scan: xr.Dataset) -> Any:
    """Return the roughness coefficient; words for one below its scale."""
    if JRC not in scan:
        return None
    return jrc_text(float(scan[JRC])) if scan[JRC] < 0 else scan[JRC]


_COLUMNS = [Column(head, _jrc if name == JRC else name, decimals) for head, name, decimals in MAIN_COLUMNS]
_ROWS = Rows(
    "scans", (SCAN,),
    (_COLUMNS[0], Column("95 % interval", ENDS, 3), *_COLUMNS[1:], Column("why it failed", "reason")),
)  # fmt: skip


def pictured(tree: xr.DataTree) -> xr.DataTree:
    """Return the groups of a study that figures show: of many scans the overview alone."""
    if OVERVIEW not in tree.children:
        return tree
    return xr.DataTree.from_dict({"/": xr.Dataset(attrs=tree.attrs), OVERVIEW: tree[OVERVIEW]})


def pooled(overview: xr.Dataset) -> xr.Dataset:
    """Return the mean of every number over the scans, its interval, and the scatter between scans.

    JRC below its scale is extrapolated, to -40 on a smooth face: it is left out.
    """
    means: dict[str, tuple[tuple[()], float, dict[str, str]]] = {}
    for key, values in overview.data_vars.items():
        if values.dtype.kind != "f" or str(key).endswith(("_low", "_high")) or key == ERROR:
            continue
        if key == JRC:
            values = values.where(values >= 0)
        has_errors = key == "fractal_dimension" and ERROR in overview and overview[ERROR].notnull().any()
        errors = overview[ERROR].values if has_errors else 0.0
        found = random_effects(values.values, errors)
        # D lies between two whole numbers; what is negative in no scan is so in no mean
        is_dimension, smallest = key == "fractal_dimension", float(values.min())
        least = float(np.floor(smallest)) if is_dimension else 0.0 if smallest >= 0.0 else -np.inf
        low, high = np.clip((found.low, found.high), least, least + 1.0 if is_dimension else np.inf)
        text = f"{values.attrs['long_name'].partition(':')[0]}: "
        facts = {
            "": (found.mean, f"mean over {found.count} scans (random effects)"),
            "_low": (float(low), "lower end of the 95 % interval of the mean over scans"),
            "_high": (float(high), "upper end of the 95 % interval of the mean over scans"),
            "_scatter": (found.between, "standard deviation between scans, without the error within each"),
            "_scans": (float(found.count), "number of scans that have a value"),
        }
        for ending, (value, words) in facts.items():
            units = "1" if ending == "_scans" else values.attrs["units"]
            means[f"{key}{ending}"] = ((), value, {"units": units, "long_name": text + words})
    return xr.Dataset(means)


def folder_of(name: str) -> str:
    """Return the name of the folder and the group of a scan; those of two scans differ."""
    return name.replace("%", "%25").replace("/", "%2F")


def page_of(name: str) -> str:
    """Return where the report of a scan lies, from that of all."""
    return f"{SCANS}/{folder_of(name)}/{REPORT}"


def scan_tables(tree: xr.DataTree) -> Iterator[ResultTable]:
    """Yield the means over the scans and a row for every scan; nothing for a study of one surface."""
    overview, root = group_of(tree, OVERVIEW), tree.to_dataset(inherit=False)
    if overview is None:
        return
    keys, cells = [], []
    for head, name, decimals in MAIN_COLUMNS:
        if name not in root:
            continue
        scale = column_scale(root[name])
        mean, low, high, scatter = (
            amount(each, scale=scale) if decimals is None else plain(each, decimals)
            for each in (root[f"{name}{end}"].rename(name) for end in ("", "_low", "_high", "_scatter"))
        )
        keys.append((head,))
        count = plain(root[f"{name}_scans"], 0)
        cells.append((mean, "none" if low == "-" else f"{low} to {high}", scatter, count))
    heads = ("mean", "95 % interval", "scatter between scans", "scans")
    yield ResultTable("means over the scans", ("quantity",), tuple(keys), heads, tuple(cells))
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
    found = {head: names[is_far(overview[name].values)] for head, name, _ in MAIN_COLUMNS if name in overview}
    texts = [f"{head} of {_few(far)}" for head, far in found.items() if far.size]
    if texts:
        yield f"outliers: {'; '.join(texts)}"
    caveats = [name for name, text in zip(names, overview["caveats"].values, strict=True) if text]
    if caveats:
        yield f"scans with caveats, which their pages state: {_few(caveats)}"


def _few(names: object) -> str:
    """Return the first names, and how many more there are."""
    words = [str(name) for name in names]  # type: ignore[attr-defined]
    more = f" and {len(words) - WORDS} more" if len(words) > WORDS else ""
    return ", ".join(words[:WORDS]) + more
