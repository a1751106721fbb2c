"""The standard figure of a result, the numbers of its curves, and all figures of a study as files."""

from __future__ import annotations

import functools
import inspect
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.files import written_whole
from fractalcontact.base.process import calls_in_two_processes
from fractalcontact.base.resources import DRAWING_LOCK
from fractalcontact.base.signals import track
from fractalcontact.base.study import group_of, member_count
from fractalcontact.base.validation import Problems, Words, require, word_tuple, writing
from fractalcontact.plotting import (
    _accuracy,
    _closure,
    _contact_curves,
    _dimensions,
    _ensemble,
    _fields,
    _islands,
    _size_curves,
    _strength,
)
from fractalcontact.plotting._contact_curves import path
from fractalcontact.plotting._dimensions import curve_of
from fractalcontact.plotting._ensemble import draw_with_band, reduced_trees
from fractalcontact.plotting._figure import LABELLED, Drawing, StudyFigure
from fractalcontact.plotting._style import Axes, Figure, drawn_for_files, figure_of
from fractalcontact.plotting._units import UNITS_EXPECTED, Units, marked, require_units

WHERE = "fc.plotting.draw"
FORMATS = ("png", "svg", "pdf", "csv")
SOFTWARE = {"Software": "fractalcontact"}  # of a PNG file: a run overwrites no picture of others


# of all modules; of several with one file the first with data is drawn
MODULES = (_ensemble, _closure, _contact_curves, _fields, _strength, _dimensions, _size_curves, _islands)
FIGURES = tuple(row for module in MODULES for row in module.FIGURES)
# of files: what the labels of their axes do not say
CAPTIONS = {
    "alluvial": "how islands grow and merge",
    "contact_domains": "where the surface is in contact, along the path of load",
    "delta_surface": "of the upper face over the lower one",
    "dimension_curves": "the curves that dimensions are fitted to",
    "dimensions": "of each method, with its 95 % interval",
    "directional_roughness": "roughness metric and mean dip over the direction of shear",
    "islands": "map of the islands of contact",
    "joint_closure": "letters mark the states of the maps",
    "joint_contact_domains": "where the faces are in contact, along the path of load",
    "joint_contact_domains_along_shear": "where the faces are in contact, from shear to shear",
    "joint_slip_domains": "where the contact sticks and slips",
    "scans": "a row for each scan",
    "slip_domains": "where the contact sticks and slips",
}
OF_SEVERAL: dict[str, tuple[Drawing, tuple[str, ...]]] = {
    "error_against_time": (_accuracy.error_against_time, ("on_pareto_front",)),
    "dimension_curves": (_dimensions.dimension_curves, tuple(_dimensions.CURVES)),
}
# drawing of each kind, and variables that tell whose standard figure it is: a result has that of the first
KINDS: dict[str, tuple[Drawing, tuple[str, ...]]] = {
    "scans": (_ensemble.scans, ("status",)),
    "estimator_errors": (_accuracy.estimator_errors, ("error_ratio",)),
    "shear_curve": (_strength.shear_curve, ("shear_stress",)),
    "strength_envelope": (_strength.strength_envelope, ("in_range",)),
    "self_weight": (_strength.self_weight, ("strength_exponent",)),
    "friction": (_strength.friction, ("friction_angle",)),
    "area_by_resolution": (_contact_curves.area_by_resolution, ("area_dimension",)),
    "delta_dimension": (_strength.delta_dimension, ("covering_dimension",)),
    "decorrelation_length": (_strength.decorrelation_length, ("decorrelation_length",)),
    "directional_roughness": (_dimensions.directional_roughness, ("roughness_metric",)),
    "uplift": (_closure.uplift, ("uplift_profile",)),
    "hydraulic_aperture": (_closure.hydraulic_aperture, ("hydraulic_aperture",)),
    "slip_loops": (_contact_curves.slip_loops, ("stick_area",)),
    "dilatancy": (_strength.dilatancy, ("dilatancy", "rigid_dilatancy")),
    "closure": (_closure.closure_laws, ("corrected_contact_fraction",)),
    "contact_area": (_contact_curves.contact_area, ()),
    "contact_domains": (_fields.contact_domains, ("state", "slip_state")),
    "first_contact": (_fields.first_contact, ()),
    "pressure_distribution": (_contact_curves.pressure_distribution, ()),
    "alluvial": (_islands.alluvial, ("common_cells",)),
    "evolution": (_islands.evolution, ("births",)),
    "islands": (_islands.islands, ("area",)),
    "lacunarity": (_size_curves.lacunarity, ("null_lacunarity",)),
    "box_dimension": (_size_curves.box_dimension, _size_curves.DIMENSIONS),
    "signature": (_size_curves.signature, ("spot_size", "box_count")),
    "scaling": (_dimensions.scaling, ("window_hurst",)),
    "dimensions": (_dimensions.dimensions, ("window_rule",)),
    **OF_SEVERAL,
    "surface": (_fields.surface, ("height",)),
    "field": (_fields.field, ()),
    "path": (path, ()),
}


def plot(result: Any, kind: str | None = None, **options: Any) -> Any:
    """Draw the standard figure of a result, found by its variables, or another kind of figure of it.

    Parameters
    ----------
    result : Dataset, DataArray, or node of a DataTree
        Of fractalcontact, as computed or as read back from a file; also a mapping of scaling curves by name.
    kind : str, optional
        Default: the standard figure of the result. A DataArray without one is drawn as a map, or along its
        path of load or shear; numbers alone have none. The kinds, with their options and the functions whose
        results have them as the standard:

        - closure (`laws`, `shear`, `marked`, `key`, `log`, `against`): load against total (thin) and
          interface closure; with `laws` of `joints.closure_laws` these through its steps. `contact.press`,
          `joints.closure`.
        - contact_area (`against`, `theory`, `log`): share in contact, corrected for the perimeter and as
          counted (dashed), with the curves of `contact.theories`.
        - contact_domains (`shear` or `normal_force`, `panels`, `zoom`): maps of contact, or of stick and
          slip, along a path, with a magnified window `zoom` (m) wide.
        - first_contact (`shear`): map of the load at which each cell first touches.
        - pressure_distribution (`theory`): of `press(include="pressure_distribution")`, and Persson's.
        - slip_loops: force over displacement, and the part that sticks. `partial_slip`.
        - hydraulic_aperture: against load or shear, mean gap pale. `joints.transmissivity`.
        - shear_curve (`beside`, drawn dashed): stress and dilatancy. `joints.shear_curve`, `direct_shear`.
        - self_weight, area_by_resolution (`shear`), delta_dimension: of `joints` functions of that name.
        - alluvial (`shear`): how islands grow and merge. `domains.lineage`.
        - dimension_curves (`estimates`): scaling curves, one or several by name, their local slopes and the
          windows and fits of `dimensions.estimate`. `dimensions.variogram`, `.spectrum` ...
        - scans: dots of the main numbers of many scans. Group `overview` of a study.
        - error_against_time, estimator_errors: `accuracy.measure`, where points on the Pareto front are
          filled, and `accuracy.estimators`.

        Figures with a function of their own, such as `dilatancy`, are kinds too.
    **options
        `units` by name of a variable, `ax` or `axes` to draw into, and those of the kind. `shear` (m) and
        `normal_force` (N) choose the nearest state; `against` is normal_force, nominal_pressure or closure,
        by default the force or pressure that was prescribed; `marked` are steps to mark A, B, C ... at that
        shear; `key` (bool) is the legend of the shears; `log` (bool) shows every decade, of contact_area with
        a line proportional to the load; `panels` is the largest number of maps; `zoom` is 0 for no window,
        and None for one where cells are hard to see; `theory` is from `contact.theories`, `beside` another
        shear curve or test.

    Returns
    -------
    Axes, or array of Axes
        The panel, or the panels where the figure can have several.

    Raises
    ------
    InvalidInput
        The result has no such figure, or several that are to be chosen with `.sel` or `.isel`, or an option
        is not one of the kind.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> pressed = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=[1e6, 1e7])
    >>> print(fc.plotting.plot(pressed).get_ylabel())
    nominal pressure (MPa)
    >>> ax = fc.plotting.plot(pressed, "contact_area", log=True)
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    nominal pressure (MPa) | real / nominal contact area (%)
    >>> print(fc.plotting.plot(pressed["mean_gap"]).get_ylabel())
    mean gap (µm)
    """
    where = "fc.plotting.plot"
    with Problems(where) as problems:
        expected, is_labelled = LABELLED
        problems.require(is_labelled(result), "result", expected, Words(type(result).__name__))
        if kind is not None:
            problems.choice("kind", kind, KINDS)
    with Problems(where) as problems:
        kind = kind or _standard_kind(result)
        draw_kind: Drawing = KINDS[kind][0]
        for name in options:
            problems.choice(f"options of {kind}", name, list(inspect.signature(draw_kind).parameters)[1:])
    with Problems(where):
        return draw_kind(result, **options)


def _standard_kind(result: Any) -> str:
    """Return the kind of the first of `KINDS` that tells a result by its variables."""
    is_one = isinstance(result, xr.Dataset | xr.DataArray) or getattr(result, "has_data", False)
    kinds, parts = (KINDS, [result]) if is_one else (OF_SEVERAL, list(result.values()))
    if isinstance(result, xr.DataArray):
        names = {"height" if result.name is None else str(result.name)}
    else:
        names = {str(name) for part in parts for name in getattr(part, "data_vars", ())}
    for kind, (_, variables) in kinds.items():
        if not names.isdisjoint(variables):
            return kind
    expected = "one result, scaling curves by name, or all of accuracy.measure; `draw` draws a study"
    require(is_one, "result", expected)
    return "field" if isinstance(result, xr.DataArray) and {"y", "x"} <= set(result.dims) else "path"


def draw(
    tree: xr.DataTree,
    folder: str | os.PathLike[str],
    *,
    progress: bool = False,
    formats: Sequence[str] = ("png",),
    units: Units | None = None,
) -> list[Path]:
    """Draw every figure that a study has data for and write each one as a file.

    Parameters
    ----------
    tree : DataTree
        From `fractalcontact.scenes.run` or `fractalcontact.open`. Of an ensemble the curves are the median
        over the members with the band of their central 68 %; the maps are those of member 0, and say so.
    folder : path-like
        Created if it does not exist. An existing figure of the same name is replaced once the new one is
        complete.
    progress : bool
        Show a progress bar.
    formats : sequence of str
        Any of png, svg, pdf and csv: the numbers of the curves (`curves`), of the figures that have any.
    units : mapping of str to str, optional
        Unit of each variable by name, `{"normal_force": "kN"}`, in all figures. Default: a suitable prefix.

    Returns
    -------
    list of Path
        The files in the order in which they were drawn.

    Raises
    ------
    InvalidInput
        An argument is not as described, or `folder` cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> import fractalcontact as fc
    >>> import xarray as xr
    >>> surface = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> tree = xr.DataTree.from_dict({"/dimensions": fc.dimensions.estimate(surface, ["default"])})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     print([path.name for path in fc.plotting.draw(tree, folder)])
    ['dimensions.png']
    """
    with Problems(WHERE) as problems:
        problems.tree("tree", tree)
        problems.path("folder", folder, what="the path of a folder")
        problems.boolean("progress", progress)
        expected, are_units = UNITS_EXPECTED
        problems.require(units is None or are_units(units), "units", expected, units)
        if problems.choices("formats", formats, FORMATS):
            problems.require(len(formats) > 0, "formats", "at least one of them", formats)
    if units is not None:
        with Problems(WHERE):
            require_units([node.to_dataset() for node in tree.subtree], units)
        tree = tree.map_over_datasets(lambda dataset: marked(dataset, units))
    with writing(WHERE, "folder", folder):
        return _draw_all(tree, Path(folder), (*FIGURES, *_path_figures(tree)), progress, word_tuple(formats))


def _path_figures(tree: xr.DataTree) -> Iterator[StudyFigure]:
    """Yield the figures along the path of load or shear that the results state in an attribute."""
    for node in tree.descendants:
        names = str(node.attrs.get("path_figure", "")).split()
        if names and not {"step", "shear"}.isdisjoint(node.dims):
            group = node.path.strip("/")
            yield StudyFigure(group.replace("/", "_"), group, names[0], path)


def _draw_all(
    tree: xr.DataTree, folder: Path, table: Sequence[StudyFigure], progress: bool, formats: Sequence[str]
) -> list[Path]:
    """Draw every figure of a table into a folder and return the files."""
    folder.mkdir(parents=True, exist_ok=True)
    members = member_count(tree)
    trees = reduced_trees(tree) if members else [tree]
    rows = list(_rows_with_data(trees[0], table).values())
    files = [[folder / f"{row.file}.{suffix}" for suffix in formats] for row in rows]

    def draw_one(number: int) -> None:
        row = rows[number]
        drawings = [functools.partial(_draw_row, row, each) for each in trees]
        with DRAWING_LOCK, drawn_for_files(), Problems(WHERE):
            figure = figure_of(draw_with_band(drawings, members) if members else drawings[0]())
            for file in files[number]:
                _write(figure, file, _caption(figure, CAPTIONS.get(row.file, "")))
            if not small:  # the next one may come before the garbage of this one is collected
                figure.clear()

    import matplotlib.backends.backend_agg  # before the process is copied  # noqa: F401

    # in bytes: of a larger study one after the other, since two figures at once take more memory
    small = sum(node.nbytes for node in tree.subtree) < 1 << 26
    drawn = calls_in_two_processes(draw_one, len(rows)) if small else map(draw_one, range(len(rows)))
    for _ in track(drawn, progress, "figures", unit="figure", total=len(rows)):
        pass
    return [file for each in files for file in each if file.suffix != ".csv" or file.exists()]


def _draw_row(row: StudyFigure, tree: xr.DataTree) -> Any:
    return row.draw(_data_of(tree, row), **{name: group_of(tree, path) for name, path in row.beside.items()})


def _data_of(tree: xr.DataTree, row: StudyFigure) -> Any:
    """Return the Dataset with the variable of a row; for `dimensions/*` the node if a child has a curve."""
    if row.group.endswith("/*"):
        node: Any = tree.children.get(row.group.removesuffix("/*"), xr.DataTree())
        has_curve = any(curve_of(child.to_dataset(inherit=False))[1] for child in node.children.values())
        return node if has_curve else None
    data = group_of(tree, row.group)
    return data if data is not None and (not row.variable or row.variable in data.variables) else None


def _rows_with_data(tree: xr.DataTree, table: Sequence[StudyFigure]) -> dict[str, StudyFigure]:
    """Return by file the rows of a table that a study has data for, in the order of its groups."""
    places = {node.path.strip("/"): place for place, node in enumerate(tree.subtree)}
    by_file: dict[str, StudyFigure] = {}
    for row in sorted(table, key=lambda row: places.get(row.group.removesuffix("/*"), 0)):
        data = _data_of(tree, row)
        if data is not None and all(data.sizes.get(dim, 0) > 1 for dim in row.dims):
            by_file.setdefault(row.file, row)
    return by_file


def _caption(figure: Figure, more: str) -> str:
    """Return what a figure shows: the labels of its axes without their units, and `more`."""
    return "; ".join(dict.fromkeys(filter(None, [*map(_shown_on, figure.axes), more])))


def _shown_on(ax: Axes) -> str:
    """Return what axes show, `normal force F against closure w`; of a map the name beside its colours."""
    x, y = (re.sub(r" \([^()]*\)$", "", _plain(text)) for text in (ax.get_xlabel(), ax.get_ylabel()))
    if (x, y) == ("x", "y"):
        return ""
    if hasattr(ax, "_colorbar"):
        return f"map of the {y}"
    return " against ".join(filter(None, (y, x)))


def _write(figure: Figure, target: Path, caption: str) -> None:
    """Write a figure, or its curves if it has any, under a temporary name, then rename it."""
    if target.suffix == ".csv":
        numbers = curves(figure.axes)
        if numbers.empty:
            target.unlink(missing_ok=True)  # of an earlier study
            return
        with written_whole(target) as temporary:
            numbers.to_csv(temporary, index=False)
        return
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    # `savefig` would lay out and draw every figure twice
    layout = figure.get_layout_engine()
    if layout is not None:
        layout.execute(figure)
        figure.set_layout_engine("none")
    with written_whole(target) as temporary:
        if target.suffix == ".png":
            canvas.print_png(
                temporary, metadata={**SOFTWARE, "Description": caption}, pil_kwargs={"compress_level": 2}
            )  # type: ignore[no-untyped-call]
        else:
            date = {".svg": "Date", ".pdf": "CreationDate"}[target.suffix]
            figure.savefig(temporary, format=target.suffix[1:], metadata={date: None})


COLUMNS = ("panel", "curve", "x", "y", "x_axis", "y_axis")
SYMBOLS = {
    "delta": "δ", "Delta": "Δ", "Lambda": "Λ", "sigma": "σ", "tau": "τ", "theta": "θ", "mathrm": "", "bf": ""
}  # fmt: skip


def curves(axes: Any) -> Any:
    """Return the numbers of the curves drawn in a figure, as a table that can be written as CSV.

    Parameters
    ----------
    axes : Axes, or array, sequence or mapping of Axes
        As any function of `fractalcontact.plotting` returns them.

    Returns
    -------
    pandas.DataFrame
        One row for each point. The columns are the `panel` (its title, or its number), the `curve`, `x`
        and `y` as drawn, and the labels of both axes with their units. Azimuths are in degrees. A band is
        given by its outline, an interval by its ends. Maps are left out: their numbers are in the result.

    Raises
    ------
    InvalidInput
        `axes` are no Axes.

    See Also
    --------
    fractalcontact.scenes.tables : Every number of a result, not only those of one figure, in SI units.
    fractalcontact.plotting.draw : The figures of a study, with `formats=["png", "csv"]` also these tables.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> pressed = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=[1e6, 1e7])
    >>> numbers = fc.plotting.curves(fc.plotting.path(pressed, "mean_gap", against="nominal_pressure"))
    >>> numbers.to_csv(index=False).splitlines()[0]
    'panel,curve,x,y,x_axis,y_axis'
    >>> numbers[["curve", "x", "x_axis"]]
          curve     x                  x_axis
    0  mean gap   1.0  nominal pressure (MPa)
    1  mean gap  10.0  nominal pressure (MPa)
    """
    from matplotlib.axes import Axes

    panels: Mapping[Any, Any] = axes if isinstance(axes, Mapping) else {1: axes}
    if isinstance(axes, (list, tuple, np.ndarray)):
        panels = dict(enumerate(np.ravel(np.asarray(axes, dtype=object)), 1))
    with Problems("fc.plotting.curves") as problems:
        are_axes = bool(panels) and all(isinstance(ax, Axes) for ax in panels.values())
        expected = "Axes, or an array, sequence or mapping of them"
        problems.require(are_axes, "axes", expected, type(axes).__name__)
    rows = [row for name, ax in panels.items() for row in _of_panel(name, ax)]
    columns = {name: ("point", [row[i] for row in rows]) for i, name in enumerate(COLUMNS)}
    return xr.Dataset(columns).to_dataframe().reset_index(drop=True)


def _of_panel(name: Any, ax: Axes) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of one panel."""
    titles = (ax.get_title(loc=place) for place in ("left", "center", "right"))
    panel = name if isinstance(name, str) else next(filter(None, map(_plain, titles)), name)
    is_polar = ax.name == "polar"
    labels = "azimuth (°)" if is_polar else _plain(ax.get_xlabel()), _plain(ax.get_ylabel())
    rows = _names_of_rows(ax)
    for curve, vertices in _labelled_points(ax):
        if curve.startswith("_"):
            continue
        x, y = np.asarray(vertices, dtype=np.float64).reshape(-1, 2).T
        points = np.stack([np.degrees(x) if is_polar else x, y], axis=1)
        for across, up in points[np.isfinite(points).all(axis=1)].tolist():
            yield panel, _plain(curve), across, rows.get(up, up), *labels


def _labelled_points(ax: Axes) -> Iterator[tuple[str, Any]]:
    """Yield the name and the points of every curve, interval and band that has a name."""
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.patches import Polygon

    for line in ax.lines:
        yield str(line.get_label()), line.get_xydata()
    for collection in ax.collections:
        if isinstance(collection, LineCollection):
            segments = [points for points in collection.get_segments() if len(points)]  # none of a NaN
            yield str(collection.get_label()), np.concatenate(segments or [np.empty((0, 2))])
        elif isinstance(collection, PolyCollection):
            for path in collection.get_paths():
                yield str(collection.get_label()), path.vertices
    for patch in ax.patches:
        if isinstance(patch, Polygon):
            yield str(patch.get_label()), patch.get_xy()


def _names_of_rows(ax: Axes) -> dict[float, str]:
    """Return what `set_yticks` was told to write at the ticks of the vertical axis, by the place."""
    from matplotlib.ticker import FixedLocator, FuncFormatter

    is_written = isinstance(ax.yaxis.get_major_formatter(), FuncFormatter)
    if not (isinstance(ax.yaxis.get_major_locator(), FixedLocator) and is_written):
        return {}
    texts = [label.get_text() for label in ax.get_yticklabels()]
    return dict(zip(map(float, ax.get_yticks()), texts, strict=False))


def _plain(text: str) -> str:
    """Return the text of a label without the signs of mathematical typesetting, on one line."""
    text = re.sub(r"\\([A-Za-z]+)", lambda match: SYMBOLS.get(match[1], match[1]), text)
    return " ".join(re.sub(r"[${}]", "", text).split())
