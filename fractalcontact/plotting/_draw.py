"""All figures of a study, written as PNG files."""

from __future__ import annotations

import functools
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import xarray as xr

from fractalcontact.base.files import written_whole
from fractalcontact.base.process import calls_in_two_processes
from fractalcontact.base.resources import DRAWING_LOCK
from fractalcontact.base.signals import track
from fractalcontact.base.study import group_of, member_count
from fractalcontact.base.validation import Problems, writing
from fractalcontact.plotting import (
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
from fractalcontact.plotting._curves import curves
from fractalcontact.plotting._dimensions import curve_of
from fractalcontact.plotting._ensemble import draw_with_band, reduced_trees
from fractalcontact.plotting._figure import StudyFigure
from fractalcontact.plotting._style import Figure, drawn_for_files, figure_of
from fractalcontact.plotting._units import UNITS_EXPECTED, Units, marked, require_units

WHERE = "fc.plotting.draw"
FORMATS = ("png", "svg", "pdf", "csv")
SOFTWARE = {"Software": "fractalcontact"}  # of a PNG file: a run overwrites no picture of others


# of all modules; of several with one file the first with data is drawn
FIGURES = (
    *_ensemble.FIGURES,
    *_closure.FIGURES,
    *_contact_curves.FIGURES,
    *_fields.FIGURES,
    *_strength.FIGURES,
    *_dimensions.FIGURES,
    *_size_curves.FIGURES,
    *_islands.FIGURES,
)


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
        if problems.require(
            isinstance(formats, (list, tuple)) and bool(formats), "formats", "a sequence of words", formats
        ):
            for word in formats:
                problems.choice("formats", word, FORMATS)
    if units is not None:
        with Problems(WHERE):
            require_units([node.to_dataset() for node in tree.subtree], units)
        tree = tree.map_over_datasets(lambda dataset: marked(dataset, units))
    with writing(WHERE, "folder", folder):
        return _draw_all(tree, Path(folder), (*FIGURES, *_path_figures(tree)), progress, formats)


def _path_figures(tree: xr.DataTree) -> Iterator[StudyFigure]:
    """Yield the figures along the path of load or shear that the results state in an attribute."""
    for node in tree.descendants:
        names = str(node.attrs.get("path_figure", "")).split()
        if names and not {"step", "shear"}.isdisjoint(node.dims):
            group = node.path.strip("/")
            draw_path = functools.partial(path, variable=names)
            yield StudyFigure(group.replace("/", "_"), group, names[0], draw_path)


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
        with DRAWING_LOCK, drawn_for_files():
            figure = figure_of(draw_with_band(drawings, members) if members else drawings[0]())
            for file in files[number]:
                _write(figure, file)
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


def _write(figure: Figure, target: Path) -> None:
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
            canvas.print_png(temporary, metadata=SOFTWARE, pil_kwargs={"compress_level": 2})  # type: ignore[no-untyped-call]
        else:
            date = {".svg": "Date", ".pdf": "CreationDate"}[target.suffix]
            figure.savefig(temporary, format=target.suffix[1:], metadata={date: None})
