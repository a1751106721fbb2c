"""What there is to say of many scans: a row for each, the means with their intervals, the outliers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from fractalcontact.base.regression import is_far, random_effects
from fractalcontact.base.study import MEMBER, group_of
from fractalcontact.scenes import _joint_rows
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
    Main(_joint_rows.roughness_coefficient.columns[0], JRC, ("joints/roughness_coefficient",)),
    _main("Sq", "rms_height", None, "surfaces/description"),
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

    Of an ensemble they are means over the members.
    """
    main: dict[str, xr.DataArray] = {}
    for entry in MAIN:
        for group in (group for group in entry.groups if group in results):
            result = results[group]
            for name in (name for name in (entry.name, *entry.beside) if name in result):
                values = result[name].isel(method=0, drop=True) if "method" in result.dims else result[name]
                others = [dim for dim in values.dims if dim != MEMBER]
                number = values.max(others).mean() if others else values.mean()
                over = f": the largest over {', '.join(map(str, others))}" if others else ""
                label = f"{values.attrs.get('long_name', name)}{over}, of the group {group}"
                main[name] = number.drop_vars(number.coords).assign_attrs(values.attrs, long_name=label)
    return xr.Dataset(main)


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
        has_errors = key == DIMENSION and ERROR in overview and overview[ERROR].notnull().any()
        errors = overview[ERROR].values if has_errors else 0.0
        found = random_effects(values.values, errors)
        # D lies between two whole numbers; what is negative in no scan is so in no mean
        is_dimension, smallest = key == DIMENSION, float(values.min())
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
    for entry in MAIN:
        head, decimals, name = entry.column.head, entry.column.decimals, entry.name
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
    found = {each.column.head: is_far(overview[each.name].values) for each in MAIN if each.name in overview}
    texts = [f"{head} of {_few(names[is_one])}" for head, is_one in found.items() if is_one.any()]
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
