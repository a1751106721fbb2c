"""All figures of a study, written as PNG files."""

from __future__ import annotations

import functools
import inspect
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from fractalcontact.base.files import written_whole
from fractalcontact.base.process import calls_in_two_processes
from fractalcontact.base.resources import DRAWING_LOCK
from fractalcontact.base.signals import track
from fractalcontact.base.study import group_of, member_count
from fractalcontact.base.validation import Problems, writing
from fractalcontact.plotting._closure import closure_laws, hydraulic_aperture, uplift
from fractalcontact.plotting._contact_curves import area_dimension, contact_area, slip_loops
from fractalcontact.plotting._curves import curves
from fractalcontact.plotting._dimensions import curve_of, dimension_curves, dimensions, directional_roughness
from fractalcontact.plotting._ensemble import draw_with_band, reduced_trees, scans
from fractalcontact.plotting._fields import contact_domains, first_contact, surface
from fractalcontact.plotting._inputs import words
from fractalcontact.plotting._islands import alluvial, islands, lineage
from fractalcontact.plotting._paths import at_shear, evenly_sampled_reach, loaded_steps, shear_text
from fractalcontact.plotting._size_curves import box_dimension, lacunarity, signature
from fractalcontact.plotting._strength import (
    correlation,
    delta_dimension,
    dilatancy,
    friction,
    self_weight,
    shear_curve,
    strength_envelope,
)
from fractalcontact.plotting._style import Figure, drawn_for_files, figure_of, needs_log_axis
from fractalcontact.plotting._units import UNITS_EXPECTED, Units, marked, require_units

Drawing = Callable[..., Any]  # of the data and of what stands beside them; returns Axes, or an array of them

WHERE = "fc.plotting.draw"
FORMATS = ("png", "svg", "pdf", "csv")
SOFTWARE = {"Software": "fractalcontact"}  # of a PNG file: a run overwrites no picture of others


def _surface(data: xr.Dataset, delta: xr.Dataset | None = None) -> Any:
    return surface(data, block=None if delta is None or "height" not in delta else delta["height"])


def _delta_surface(data: xr.Dataset) -> Any:
    last = data.isel(shear=-1) if "shear" in data.dims else data
    return surface(last, title=f"delta-surface, {shear_text(last)}".rstrip(", "))


def _joint_closure(data: xr.Dataset) -> Any:
    """Draw the closure laws, with the steps marked whose maps `joint_contact_domains` shows."""
    every = data.expand_dims([dim for dim in ("shear", "step") if dim not in data.dims])
    shear = _middle_shear(data)
    maps = inspect.signature(contact_domains).parameters["panels"].default
    steps = loaded_steps(at_shear(every, shear), maps) if "state" in data else ()
    return closure_laws(data, shear=shear, marked=steps)


def _domains_along_load(data: xr.Dataset) -> Any:
    return contact_domains(data, shear=_middle_shear(data))


def _domains_along_shear(data: xr.Dataset) -> Any:
    return contact_domains(data, normal_force=float(np.nanmax(data["normal_force"].values)))


def _middle_shear(data: xr.Dataset) -> float | None:
    shears = np.atleast_1d(data["shear"].values) if "shear" in data.coords else np.empty(0)
    return float(shears[shears.size // 2]) if shears.size else None


def _evenly_sampled(figure: Callable[..., Any]) -> Drawing:
    """Return a drawing of the evenly sampled shears; under forces of one direction, which fits a figure."""

    def draw(data: xr.Dataset) -> Any:
        several = "step" in data.dims and data.sizes.get("direction", 1) > 1
        direction = words(data["direction"])[0] if several else None
        return figure(data, direction=direction, reach=evenly_sampled_reach(data))

    return draw


def _by_decades(figure: Callable[..., Any]) -> Drawing:
    """Return a drawing with logarithmic axes where linear ones would hide all loads but the largest."""

    def draw(data: xr.Dataset) -> Any:
        force = np.asarray(data["normal_force"].values, float) if "normal_force" in data else np.empty(0)
        return figure(data, log=needs_log_axis(force[force > 0]))

    return draw


def _at_end(figure: Callable[..., Any], *dims: str) -> Drawing:
    """Return a drawing at the greatest shear, or under the greatest load."""
    return lambda data: figure(data.isel({dim: -1 for dim in dims if dim in data.dims}))


class Row(NamedTuple):
    """A figure: its file, the group and the variable it is drawn from, the drawing and what it needs.

    Without a variable it is drawn from any Dataset. The `dims` are longer than one; options of the drawing
    take the groups that `beside` names.
    """

    file: str
    group: str
    variable: str
    draw: Drawing
    dims: tuple[str, ...] = ()
    beside: Mapping[str, str] = {}


BOTH = ("shear", "step")
STRENGTH, TESTS = "joints/shear_curve", "joints/direct_shear"
# every figure of a study but those that `draw` is given; of several rows with one file the first with data is
# drawn
FIGURES = (
    Row("scans", "overview", "status", scans),
    Row("surface", "surfaces", "height", _surface, beside={"delta": "joints/delta_surface"}),
    Row("delta_surface", "joints/delta_surface", "height", _delta_surface),
    Row("joint_closure", "joints/closure", "interface_closure", _joint_closure),
    Row("joint_contact_area", "joints/closure", "contact_fraction", contact_area),
    Row("joint_contact_domains", "joints/closure", "state", _domains_along_load),
    Row("joint_contact_domains_along_shear", "joints/closure", "state", _domains_along_shear, BOTH),
    Row("joint_first_contact", "joints/closure", "state", first_contact, ("step",)),
    Row("rigid_dilatancy", "joints/rigid_dilatancy", "rigid_dilatancy", dilatancy),
    Row("joint_dilatancy", "joints/elastic_dilatancy", "dilatancy", _evenly_sampled(dilatancy)),
    Row("dimensions", "dimensions", "hurst", dimensions),
    Row("dimension_curves", "dimensions/*", "a scaling curve", dimension_curves),
    Row("friction", "joints/friction", "friction_angle", _evenly_sampled(friction)),
    Row("box_dimension", "domains/box_dimension", "box_dimension", box_dimension),
    Row("signature", "domains/signature", "local_slope", signature),
    Row("local_slopes", "domains/box_dimension", "local_slope", signature),
    Row("minkowski_dimension", "domains/minkowski_dimension", "minkowski_dimension", box_dimension),
    Row("correlation_dimension", "domains/correlation_dimension", "correlation_dimension", box_dimension),
    Row("lacunarity", "domains/lacunarity", "lacunarity", lacunarity),
    Row("lacunarity_maps", "domains/lacunarity", "lacunarity", functools.partial(lacunarity, maps=True),
        ("step", "box_size")),
    Row("lineage", "domains/evolution", "births", lineage),
    Row("alluvial", "domains/lineage", "common_cells", alluvial),
    Row("islands", "domains/islands", "label", islands),
    Row("delta_dimension", "joints/delta_dimension", "variogram_dimension", delta_dimension),
    Row("area_dimension", "joints/area_dimension", "resolution", area_dimension),
    Row("self_weight", "joints/self_weight", "structure_size", self_weight),
    Row("correlation", "joints/decorrelation_length", "correlation", correlation),
    Row("directional_roughness", "joints/directional_roughness", "roughness_metric", directional_roughness),
    Row("hydraulic_aperture", "joints/transmissivity", "hydraulic_aperture", hydraulic_aperture),
    Row("uplift", "joints/uplift", "uplift_profile", _at_end(uplift, *BOTH)),
    Row("closure_law", "contact", "closure", _by_decades(closure_laws)),
    Row("contact_area", "contact", "contact_fraction", _by_decades(contact_area)),
    Row("contact_domains", "contact", "state", contact_domains),
    Row("first_contact", "contact", "state", first_contact, ("step",)),
    Row("slip_loops", "partial_slip", "stick_area", slip_loops),
    Row("slip_domains", "partial_slip", "slip_state", _at_end(contact_domains, "shear")),
    Row("joint_slip_loops", "joints/partial_slip", "stick_area", slip_loops),
    Row("joint_slip_domains", "joints/partial_slip", "slip_state", _at_end(contact_domains, "shear")),
    Row("strength_envelope", "joints/strength_envelope", "shear_strength", strength_envelope,
        beside={"tests": TESTS}),
    Row("shear_curve", TESTS, "shear_stress", shear_curve, beside={"beside": STRENGTH}),
    Row("shear_curve", STRENGTH, "shear_stress", shear_curve),
)  # fmt: skip


def draw(
    tree: xr.DataTree,
    folder: str | os.PathLike[str],
    *,
    progress: bool = False,
    formats: Sequence[str] = ("png",),
    units: Units | None = None,
    figures: Mapping[str, Drawing] | None = None,
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
    figures : mapping of str to function, optional
        Further figures by the path of their group, `{"domains/percolation": draw_shares}`: functions of its
        Dataset that return Axes. The file is called as the path, `domains_percolation.png`.

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
        expected = "a mapping of paths of groups to functions, or None"
        problems.require(figures is None or _are_drawings(figures), "figures", expected, figures)
    if units is not None:
        with Problems(WHERE):
            require_units([node.to_dataset() for node in tree.subtree], units)
        tree = tree.map_over_datasets(lambda dataset: marked(dataset, units))
    with writing(WHERE, "folder", folder):
        further = [Row(path.replace("/", "_"), path, "", each) for path, each in (figures or {}).items()]
        return _draw_all(tree, Path(folder), (*FIGURES, *further), progress, formats)


def _are_drawings(value: Any) -> bool:
    return isinstance(value, Mapping) and all(map(callable, value.values()))


def _draw_all(
    tree: xr.DataTree, folder: Path, table: Sequence[Row], progress: bool, formats: Sequence[str]
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


def _draw_row(row: Row, tree: xr.DataTree) -> Any:
    return row.draw(_data_of(tree, row), **{name: group_of(tree, path) for name, path in row.beside.items()})


def _data_of(tree: xr.DataTree, row: Row) -> Any:
    """Return the Dataset with the variable of a row; for `dimensions/*` the node if a child has a curve."""
    if row.group.endswith("/*"):
        node: Any = tree.children.get(row.group.removesuffix("/*"), xr.DataTree())
        has_curve = any(curve_of(child.to_dataset(inherit=False))[1] for child in node.children.values())
        return node if has_curve else None
    data = group_of(tree, row.group)
    return data if data is not None and (not row.variable or row.variable in data.variables) else None


def _rows_with_data(tree: xr.DataTree, table: Sequence[Row]) -> dict[str, Row]:
    """Return by file the rows of a table that a study has data for."""
    by_file: dict[str, Row] = {}
    for row in table:
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
