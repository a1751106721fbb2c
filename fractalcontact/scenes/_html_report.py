"""The report of a study: one HTML file with summary, surface, maps, figures, tables and provenance."""

from __future__ import annotations

import base64
import io
import json
import math
import os
import re
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.files import written_whole
from fractalcontact.base.grid import read_grid
from fractalcontact.base.netcdf import open as open_result
from fractalcontact.base.numbers import Array, spread_indices
from fractalcontact.base.regression import local_slope
from fractalcontact.base.resources import thread_count
from fractalcontact.base.schema import CORE_DIMS
from fractalcontact.base.study import (
    NO_REFERENCES,
    entries_in,
    group_of,
    member_count,
    of_member,
    provenance_of,
    scene_of,
    stated_argument,
)
from fractalcontact.base.units import quantity_text, raise_exponents, scale_for, without_rounding
from fractalcontact.base.validation import Problems, reading, writing
from fractalcontact.scenes._domain_stages import SIGNATURE
from fractalcontact.scenes._export import tables
from fractalcontact.scenes._result_tables import SCAN, table_of
from fractalcontact.scenes._result_tree import OVERVIEW, pictured
from fractalcontact.scenes._results_folder import REPORT, SCANS, is_report, page_of
from fractalcontact.scenes._stages import STAGES
from fractalcontact.scenes._summary import Summary, summary_of, written_rows
from fractalcontact.scenes._template import packaged_template

WHERE = "fractalcontact.scenes.report"
FLAG_COLOURS = {
    "open": "#f1f1ee",
    "contact": "#0b5394",
    "yielded": "#d55e00",
    "stick": "#0b5394",
    "slip": "#e69f00",
}
OTHER_COLOURS = ("#009e73", "#cc79a7", "#56b4e9", "#f0e442")
LOADS = {"normal_force": "F", "nominal_pressure": "p", "closure": "w", "tangential_force": "Q"}
PLAIN_LIST = re.compile(r"\[[^\[\]{}\"]*\]")  # in JSON: of numbers, without words, lists or objects
HIDDEN = ("run_time", "iterations", "stop_reason")  # from the tables on the page


def report(
    result: xr.DataTree | str | os.PathLike[str],
    path: str | os.PathLike[str] | None = None,
    *,
    figures: Sequence[str | os.PathLike[str]] | None = None,
) -> Path:
    """Write the report of a study: one HTML file that opens in any browser and needs no network.

    It holds the summary, the surface, which can be turned, the contact maps with sliders for load and shear,
    the figures, every curve as a table with a CSV file to download, the scene and the provenance.
    `fractalcontact.scenes.run` writes it for every study.

    Parameters
    ----------
    result : DataTree or path-like
        From `fractalcontact.scenes.run`, or a file that it wrote.
    path : path-like, optional
        The file to write. Without it, `report.html` beside the file `result`.
    figures : sequence of path-like, optional
        PNG files to embed. Without it the figures are drawn.

    Returns
    -------
    Path
        The file that was written.

    Raises
    ------
    InvalidInput
        `result` is no study, `path` is missing and `result` no file, or `path` cannot be written or is a file
        of another kind.
    UnreadableFile
        There is no such file, or it is not complete.

    Notes
    -----
    The surface is shown by block means of at most 128 points along its longer side, a map by at most 400
    cells (a block has the highest flag among its cells). At most 120 maps are shown, evenly spread over loads
    and shears. Of an ensemble, surface and maps are those of member 0.

    Examples
    --------
    >>> import tempfile
    >>> import fractalcontact as fc
    >>> result = fc.scenes.run("rigid_sliding", progress=False)
    >>> path = fc.scenes.report(result, tempfile.mkdtemp() + "/report.html")
    >>> path.name, path.stat().st_size < 2e6
    ('report.html', True)
    """
    is_tree = isinstance(result, xr.DataTree)
    with Problems(WHERE) as problems:
        if not is_tree:
            problems.path("result", result, what="a DataTree or a file")
        if path is not None or is_tree:
            problems.path("path", path, what="the file to write")
        if figures is not None and problems.require(
            isinstance(figures, (list, tuple)), "figures", "a sequence of PNG files", figures
        ):
            for figure in figures:
                problems.file("figures", figure)
    tree = result if isinstance(result, xr.DataTree) else open_result(result)
    target = Path(path) if path is not None else Path(str(result)).with_name(REPORT)
    with Problems(WHERE) as problems:
        got = f"a {type(tree).__name__}"
        problems.require(isinstance(tree, xr.DataTree), "result", "the file of a study", got)
        is_free = not target.is_file() or is_report(target)
        problems.require(is_free, "path", "a new file, or a report of this package", target.name)
    tree = tree.filter(lambda node: not node.path.startswith(f"/{SCANS}/"))  # each has a page of its own
    with writing(WHERE, "path", target), tempfile.TemporaryDirectory() as folder:
        if figures is None:
            from fractalcontact import plotting  # only here: `run` has drawn them

            figures = plotting.draw(pictured(tree), folder)
        return write_report(tree, target, figures, summary_of(tree))


def write_report(
    tree: xr.DataTree,
    target: Path,
    figures: Sequence[str | os.PathLike[str]],
    summary: Summary,
    contents: Mapping[str, Any] | None = None,
) -> Path:
    """Write the report with these figures, this summary and the `page_contents`, computed if not given."""
    with ThreadPoolExecutor(thread_count()) as pool:  # the encoder releases the interpreter lock
        pictures = pool.map(_picture_file, map(Path, figures))
        text = _page(tree, pictures, summary, contents or page_contents(tree), target)
    target.parent.mkdir(parents=True, exist_ok=True)
    with written_whole(target) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return target


def page_contents(tree: xr.DataTree) -> dict[str, Any]:
    """Return what the page shows beside the figures and the summary: the surface, the maps and the curves."""
    single = of_member(tree, 0)
    frames = {name: frame for name, frame in tables(tree).items() if {*frame.columns} != {"run_time (s)"}}
    return {
        "surface": _surface(single),
        "maps": list(_maps(single)),
        "curves": [_curve_table(name, frame) for name, frame in frames.items()],
    }


def _page(
    tree: xr.DataTree,
    figures: Iterable[tuple[str, str, bytes]],
    summary: Summary,
    contents: Mapping[str, Any],
    target: Path,
) -> str:
    """Return the text of the page."""
    overview, scene = group_of(tree, OVERVIEW), scene_of(tree)
    scans = [] if overview is None else map(str, overview[SCAN].values)
    pages = {name: page for name in scans if (target.parent / (page := page_of(name))).is_file()}
    written = str(tree.attrs.get("history", "")).split(" ")[0]
    subtitle = (tree.attrs.get("source", ""), written, tree.attrs.get("completeness", ""))
    return packaged_template("report_template.html", autoescape=True).render(
        title=summary.title,
        subtitle=" · ".join(str(part) for part in subtitle if part),
        generator=str(tree.attrs.get("source", "fractalcontact")),
        of_member="Member 0 of the ensemble." if member_count(tree) else "",
        figures=[
            (name.replace("_", " ").capitalize(), caption, base64.b64encode(content).decode())
            for name, caption, content in figures
        ],
        summary=summary,
        written_rows=written_rows,
        pages=pages,
        scene=_as_json(scene) if scene else "",
        provenance=_as_json(provenance_of(tree)),
        input_files=sorted({pair for node in tree.subtree for pair in _input_files(provenance_of(node))}),
        references=[
            text for text in str(tree.attrs.get("references", "")).split("; ") if text != NO_REFERENCES
        ],
        **contents,
    )


def _input_files(provenance: Any) -> Iterator[tuple[str, str]]:
    """Yield the name and the SHA-256 of every file that a provenance states, in it and in its arguments."""
    for each in entries_in(provenance):
        checksum, call = each.get("file_sha256"), each.get("parameters")
        if isinstance(checksum, str) and isinstance(call, dict):
            yield str(call.get("path", call.get("name", ""))), checksum


def _surface(tree: xr.DataTree, most: int = 128) -> dict[str, Any] | None:
    """Return what the page draws of the first surface: 16-bit levels, lengths in metres, and words.

    It has at most `most` points along its longer side: 44 kB in the page.
    """
    heights = (node["height"] for node in tree.subtree if "height" in node.data_vars)
    height = next((height for height in heights if height.dims == CORE_DIMS), None)
    if height is None:
        return None
    block = math.ceil(max(height.shape) / most)
    coarse = height.coarsen(y=block, x=block, boundary="trim").mean() if block > 1 else height
    values = np.asarray(coarse.values, dtype=float)
    is_finite = np.isfinite(values)
    if min(values.shape) < 2 or not is_finite.any():
        return None
    lowest, highest = float(values[is_finite].min()), float(values[is_finite].max())
    extent = read_grid(coarse).extent
    scaled = np.where(is_finite, (values - lowest) / ((highest - lowest) or 1.0), 0.0)
    missing = np.iinfo("<u2").max  # the level of a point without height
    levels = np.where(is_finite, np.rint(scaled * (missing - 1)), missing).astype("<u2")
    return {
        "heights": base64.b64encode(levels.tobytes()).decode(),
        "shape": list(coarse.shape),
        "extent": extent,
        "lowest": lowest,
        "highest": highest,
        # drawn a quarter as high as it is wide
        "exaggeration": 0.25 * max(extent) / (highest - lowest) if highest > lowest else 1.0,
        # dark blue, grey, yellow: equally spaced in lightness, told apart by colour-blind readers
        "colours": ((0, 34, 78), (124, 123, 120), (254, 232, 56)),
        "labels": [f"{dim}, {quantity_text(length, 'm')}" for dim, length in zip("yx", extent, strict=True)],
        "block": block,
        "ends": [quantity_text(end, "m") for end in (lowest, highest)],
    }


def _maps(tree: xr.DataTree) -> Iterator[dict[str, Any]]:
    """Yield every set of maps of flags that the study stores."""
    for node in tree.subtree:
        for name, variable in node.data_vars.items():
            if variable.dims[-2:] == CORE_DIMS and "flag_meanings" in variable.attrs and variable.size:
                yield _map_set(tree, node.path.strip("/"), node.to_dataset(), str(name))


def _map_set(tree: xr.DataTree, path: str, dataset: xr.Dataset, name: str, most: int = 120) -> dict[str, Any]:
    """Return at most `most` maps of a variable: at 2 bits for each cell no more than 7 MB in the page.

    A set has a title, a key of colours by meaning, what the page needs to show it, and the signature of the
    states on its maps, where the study has it.
    """
    state = dataset[name]
    dims = [str(dim) for dim in state.dims[:-2]]
    limit = most if len(dims) < 2 else math.isqrt(most)
    shown = {dim: spread_indices(state.sizes[dim], limit) for dim in dims}
    dataset = dataset.isel(shown)
    state = dataset[name]
    meanings, spare = str(state.attrs["flag_meanings"]).split(), cycle(OTHER_COLOURS)
    key = {meaning: FLAG_COLOURS.get(meaning) or next(spare) for meaning in meanings}
    block = math.ceil(max(state.shape[-2:]) / 400)  # the page shows a map 512 pixels wide
    palette = list(key.values())
    pictures, alternatives = [], []
    for place in np.ndindex(*state.shape[:-2]):
        here = dataset.isel(dict(zip(dims, place, strict=True)))
        flags = np.searchsorted(np.asarray(state.attrs["flag_values"]), here[name].values)
        pictures.append(_picture(flags, palette, block))
        alternatives.append(_caption(here, flags, list(key)))
    axes = [
        {"name": dim, "labels": [_label(dataset, dim, i) for i in range(state.sizes[dim])]} for dim in dims
    ]
    long_name = str(state.attrs.get("long_name", name))
    data = {"axes": axes, "pictures": pictures, "alternatives": alternatives}
    signature = group_of(tree, SIGNATURE)
    own = None
    if name == "state" and signature is not None and set(signature["gap_size"].dims) == set(dims):
        own = _signature_view(tree, signature.isel(shown).transpose(*dims, ...))
        data |= {key: own.pop(key) for key in ("curves", "spots", "marks", "rows")}
    title = f"{long_name}: {path.replace('/', ', ').replace('_', ' ')}"
    return {"title": title, "key": key, "block": block, "data": data, "signature": own}


def _signature_view(tree: xr.DataTree, signature: xr.Dataset) -> dict[str, Any]:
    """Return what the page draws of the signature beside each map: d(s) in a square from 0 to 1, and a table.

    `curves` and `spots` are polylines of the contact domain and of random spots, `marks` the points of spot
    and gap; `window` is that of the dimensions, and `sizes` the lengths written on the axis.
    """
    side = signature["side"].values
    scale = scale_for("m", side)
    ends = np.log(side[[0, -1]])

    def across(lengths: Any) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):
            # one length alone has no range
            return np.asarray((np.log(lengths) - ends[0]) / max(ends[1] - ends[0], 1e-9))

    def polylines(slopes: Array) -> list[str]:
        """Return the points of each curve; of a dimension from 0 to 2, upwards."""
        rows = slopes.reshape(-1, side.size)
        return [
            " ".join(f"{x:.3f},{1 - d / 2:.3f}" for x, d in zip(across(side), row, strict=True) if d == d)
            for row in np.clip(rows, 0.0, 2.0)
        ]

    local = signature["local_slope"].values
    lengths = np.stack([signature[name].values.ravel() for name in ("spot_size", "gap_size")], -1)
    marks = [
        [
            [round(float(x), 3), round(1 - float(np.interp(x, across(side), row)) / 2, 3)]
            if 0 <= x <= 1 and np.isfinite(row).all() else None
            for x in across(both)
        ]
        for both, row in zip(lengths, local.reshape(-1, side.size), strict=True)
    ]  # fmt: skip
    window = across(np.array([signature[name].values for name in ("window_low", "window_high")]))
    decades = 10.0 ** np.arange(-3, 6)[:, None] * (1.0, 2.0, 5.0)
    written = [value for value in decades.ravel() if side[0] <= value * scale.factor <= side[-1]]
    table = STAGES[SIGNATURE].rows
    rows = table and table_of(replace(table, first_dim=False), tree, signature)
    cells = [list(zip(rows.heads, row, strict=True)) for row in rows.cells] if rows else []
    return {
        "curves": polylines(local),
        "spots": polylines(2.0 - local_slope(side, signature["spots_fraction"].values)),
        "marks": marks,
        "rows": cells,
        "window": window.tolist() if np.isfinite(window).all() else None,
        "sizes": [(float(across(value * scale.factor)), f"{value:g}") for value in written],
        "unit": scale.unit,
    }


def _picture(flags: Array, palette: Sequence[str], block: int) -> str:
    """Return a map as PNG in base64, y upwards; a block has the highest flag among its cells."""
    from PIL import Image

    if block > 1:
        from skimage.measure import block_reduce

        flags = block_reduce(flags, (block, block), np.max)
    picture = Image.fromarray(np.ascontiguousarray(flags[::-1]).astype(np.uint8), mode="P")
    picture.putpalette([int(colour[i : i + 2], 16) for colour in palette for i in (1, 3, 5)])
    content = io.BytesIO()
    # a higher level saves a fifth of some kilobytes, in ten times the time
    picture.save(content, "PNG", compress_level=4)
    return base64.b64encode(content.getvalue()).decode()


def _caption(here: xr.Dataset, flags: Array, meanings: Sequence[str]) -> str:
    """Return the load, the shear and the shares of the flags of one map."""
    places = [
        f"{symbol} = {_value(here[name])}"
        for name, symbol in LOADS.items()
        if name in here and not here[name].ndim
    ]
    if "shear" in here.coords:
        places.append(f"shear {_value(here['shear'])}")
    shares = np.bincount(flags.ravel(), minlength=len(meanings)) / flags.size
    parts = [
        f"{meaning} {100 * share:.3g} %" for meaning, share in zip(meanings, shares, strict=True) if share
    ]
    return ", ".join(places) + (": " if places else "") + ", ".join(parts)


def _label(dataset: xr.Dataset, dim: str, place: int) -> str:
    """Return where on one of its axes a map lies: the load of a step, or the value of the coordinate."""
    if dim == "step":
        prescribed = stated_argument(provenance_of(dataset), ("normal_force", "nominal_pressure"))
        for name in filter(None, dict.fromkeys([prescribed, *LOADS])):
            if name in dataset.variables and "step" in dataset[name].dims:
                values = dataset[name].isel(step=place)
                # one load, in the digits that are shown
                if float(values.max() - values.min()) <= 1e-3 * abs(float(values.max())):
                    return f"{LOADS[name]} = {_value(values.max(keep_attrs=True))}"
        return str(place)
    return _value(dataset[dim][place]) if dim in dataset.coords else str(place)


def _value(scalar: xr.DataArray) -> str:
    if scalar.dtype.kind not in "fiu":
        return str(scalar.values)
    return quantity_text(float(scalar), str(scalar.attrs.get("units", "")), 4)


def _picture_file(path: Path) -> tuple[str, str, bytes]:
    """Return the name of a picture, what it shows, and its content as WebP, which is smaller than PNG."""
    from PIL import Image, WebPImagePlugin  # noqa: F401  for a format it does not know Pillow loads all

    content = io.BytesIO()
    with reading(WHERE, path), Image.open(path) as picture:
        # a greater effort (method) saves a tenth, in three times the time
        picture.convert("RGB").save(content, "WEBP", quality=85, method=0)
        caption = str(picture.info.get("Description", ""))
    return path.stem, caption, content.getvalue()


def _curve_table(
    name: str,
    frame: Any,
    most: int = 100,
    largest: int = 1 << 19,  # bytes: 51 000 islands of 24 scans have 4 MB
) -> dict[str, Any]:
    """Return the first rows of a table as text, at most `most`, and all of it as CSV unless that is large."""
    shown = frame[[column for column in frame.columns if column.split(" (")[0] not in HIDDEN]].head(most)
    heads, columns = zip(*(_column(head, shown[head]) for head in shown.columns), strict=True)
    csv = frame.to_csv(index=False, float_format="%.9g").encode()
    return {
        "name": name,
        "title": name.replace("_", " "),
        "left_out": len(frame) - len(shown),
        "heads": heads,
        "rows": list(zip(*columns, strict=True)),
        "csv": base64.b64encode(csv).decode() if len(csv) <= largest else "",
    }


def _column(head: str, values: Any) -> tuple[str, list[str]]:
    """Return head and cells of a column, numbers in the unit with the prefix that suits them."""
    name, _, units = head.partition(" (")
    name, units = name.replace("_", " "), units.rstrip(")")
    if values.dtype.kind != "f":
        return (f"{name} ({raise_exponents(units)})" if units else name), [str(value) for value in values]
    numbers = without_rounding(values, units) + 0.0  # no zero keeps a sign
    scale = scale_for(units, numbers)
    cells = ["-" if not np.isfinite(value) else f"{value:.4g}" for value in scale(numbers)]
    return scale.label(name), cells


def _as_json(entry: Any) -> str:
    """Return JSON with a line for each key; a list of plain values stays on one line."""
    return PLAIN_LIST.sub(lambda match: " ".join(match.group().split()), json.dumps(entry, indent=1))
