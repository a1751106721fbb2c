"""All figures of a study, written as PNG files."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from fractalcontact.base.netcdf import written_whole
from fractalcontact.base.process import calls_in_two_processes
from fractalcontact.base.progress import track
from fractalcontact.base.threads import DRAWING_LOCK
from fractalcontact.base.validation import Problems, writing
from fractalcontact.plotting._area_dimension import area_dimension
from fractalcontact.plotting._box_dimension import box_dimension, local_slopes
from fractalcontact.plotting._closure import closure_laws, contact_area
from fractalcontact.plotting._contact_maps import contact_domains
from fractalcontact.plotting._curves import curves
from fractalcontact.plotting._decorrelation import correlation, delta_dimension
from fractalcontact.plotting._dimensions import curve_of, dimension_curves, dimensions
from fractalcontact.plotting._directional_roughness import directional_roughness
from fractalcontact.plotting._directions import evenly_sampled_reach
from fractalcontact.plotting._ensemble import (
    BAND,
    MEDIAN,
    draw_with_band,
    member_count,
    quantile_over_members,
)
from fractalcontact.plotting._friction import friction
from fractalcontact.plotting._inputs import words
from fractalcontact.plotting._islands import islands
from fractalcontact.plotting._lacunarity import lacunarity
from fractalcontact.plotting._paper import group, has_figure, paper_figure, shown_shear
from fractalcontact.plotting._partial_slip import slip_domains, slip_loops
from fractalcontact.plotting._self_weight import self_weight
from fractalcontact.plotting._shear_curve import shear_curve
from fractalcontact.plotting._strength_envelope import strength_envelope
from fractalcontact.plotting._style import drawn_for_files, figure_of, needs_log_axis
from fractalcontact.plotting._transmissivity import hydraulic_aperture
from fractalcontact.plotting._units import check_units, shown_in
from fractalcontact.plotting._uplift import uplift

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fractalcontact.plotting._units import Units

Drawing = Callable[[], Any]  # returns Axes, or an array of them

WHERE = "fc.plotting.draw"
PAPER = {1: "surface", 2: "sliding_scheme", 3: "closure", 4: "contact_domains", 5: "dilatancy"}
FORMATS = ("png", "svg", "pdf", "csv")
LARGE = 1 << 26  # bytes of a study whose figures are drawn one after the other: two at once take more memory
PAPER_BAND = (2.15, 2.29)  # fractal dimensions that the paper gives for its surface
# names of the same figures in a study that is not compared with the paper
JOINT = {
    1: "surface",
    2: "sliding_scheme",
    3: "joint_closure",
    4: "joint_contact_domains",
    5: "joint_dilatancy",
}


def draw(
    tree: xr.DataTree,
    folder: str | os.PathLike[str],
    *,
    progress: bool = False,
    paper: bool = True,
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
    paper : bool
        Name the figures of a joint after those of the 1998 paper.
    formats : sequence of str
        Any of png, svg, pdf and csv: the numbers of the curves (`curves`), of the figures that have any.
    units : mapping of str to str, optional
        Unit of each variable by name, `{"normal_force": "kN"}`, in all figures. Default: a suitable prefix.

    Returns
    -------
    list of Path
        The files in the order in which they were drawn, the figures of the 1998 paper first.

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
        problems.boolean("paper", paper)
        check_units(problems, "units", units)
        if problems.require(
            isinstance(formats, (list, tuple)) and bool(formats), "formats", "a sequence of words", formats
        ):
            for word in formats:
                problems.choice("formats", word, FORMATS)
    tree = shown_in(tree, units, "draw")
    with writing(WHERE, "folder", folder):
        return _draw_all(tree, Path(folder), progress, paper, formats)


def _draw_all(
    tree: xr.DataTree, folder: Path, progress: bool, paper: bool, formats: Sequence[str]
) -> list[Path]:
    """Draw every figure into a folder and return the files."""
    folder.mkdir(parents=True, exist_ok=True)
    drawings = _all_drawings(tree, paper)
    files = [[folder / f"{name}.{suffix}" for suffix in formats] for name, _ in drawings]

    def draw_one(number: int) -> None:
        with DRAWING_LOCK, drawn_for_files():
            figure = figure_of(drawings[number][1]())
            for file in files[number]:
                _write(figure, file)
            figure.clear()

    small = sum(node.nbytes for node in tree.subtree) < LARGE
    drawn = calls_in_two_processes(draw_one, len(drawings)) if small else map(draw_one, range(len(drawings)))
    for _ in track(drawn, progress, "figures", unit="figure", total=len(drawings)):
        pass
    return [file for each in files for file in each if file.suffix != ".csv" or file.exists()]


def _all_drawings(tree: xr.DataTree, paper: bool) -> list[tuple[str, Drawing]]:
    """Return file name and drawing function of every figure; of an ensemble with a band of the members."""
    members = member_count(tree)
    if not members:
        return list(_drawings(tree, paper))
    trees = [quantile_over_members(tree, share) for share in (MEDIAN, *BAND)]
    figures = zip(*(_drawings(reduced, paper) for reduced in trees), strict=True)
    return [
        (each[0][0], _later(draw_with_band, [drawing for _, drawing in each], members)) for each in figures
    ]


def _drawings(tree: xr.DataTree, paper: bool) -> Iterator[tuple[str, Drawing]]:
    """Yield file name (without suffix) and drawing function of every figure with data."""
    for number, name in PAPER.items():
        if has_figure(tree, number):
            yield f"figure_{number}_{name}" if paper else JOINT[number], _later(paper_figure, tree, number)
    estimates = group(tree, "dimensions")
    if estimates is not None and "method" in estimates.dims:
        band = PAPER_BAND if paper else None
        yield "dimensions", functools.partial(dimensions, estimates, band=band, band_name="1998 paper")
    scaling_curves = _scaling_curves(tree)
    if scaling_curves:
        yield "dimension_curves", _later(dimension_curves, scaling_curves, estimates)
    for path, name, drawing in (
        ("joints/friction", "friction", _friction),
        ("domains/box_dimension", "box_dimension", box_dimension),
        ("domains/minkowski_dimension", "minkowski_dimension", box_dimension),
        ("domains/correlation_dimension", "correlation_dimension", box_dimension),
        ("domains/lacunarity", "lacunarity", _lacunarity),
        ("domains/islands", "islands", islands),
        ("joints/delta_dimension", "delta_dimension", delta_dimension),
        ("joints/area_dimension", "area_dimension", area_dimension),
        ("joints/self_weight", "self_weight", self_weight),
        ("joints/decorrelation_length", "correlation", correlation),
        ("joints/directional_roughness", "directional_roughness", directional_roughness),
        ("joints/transmissivity", "hydraulic_aperture", hydraulic_aperture),
        ("joints/uplift", "uplift", _uplift),
        ("contact", "closure_law", _closure_laws),
        ("contact", "contact_area", _contact_area),
        ("partial_slip", "slip_loops", slip_loops),
        ("joints/partial_slip", "joint_slip_loops", slip_loops),
    ):
        data = group(tree, path)
        if data is not None:
            yield name, _later(drawing, data)
    yield from _strength_drawings(tree)
    counts = group(tree, "domains/box_dimension")
    if counts is not None and "local_slope" in counts:
        yield "local_slopes", _later(_local_slopes, counts)
    contact = group(tree, "contact")
    if contact is not None and "state" in contact:
        yield "contact_domains", _later(contact_domains, contact)
    for path, name in (("partial_slip", "slip_domains"), ("joints/partial_slip", "joint_slip_domains")):
        slipped = group(tree, path)
        if slipped is not None and "slip_state" in slipped:
            yield name, _later(_slip_domains, slipped)


def _strength_drawings(tree: xr.DataTree) -> Iterator[tuple[str, Drawing]]:
    """Yield the figures of the strength: criteria with the tests among them, shear curves of both."""
    envelope, tests, curve = (
        group(tree, f"joints/{name}") for name in ("strength_envelope", "direct_shear", "shear_curve")
    )
    if envelope is not None:
        yield "strength_envelope", lambda: strength_envelope(envelope, tests=tests)
    if tests is not None:
        yield "shear_curve", lambda: shear_curve(tests, beside=curve)
    elif curve is not None:
        yield "shear_curve", _later(shear_curve, curve)


def _later(drawing: Callable[..., Any], *arguments: Any) -> Drawing:
    return lambda: drawing(*arguments)


def _scaling_curves(tree: xr.DataTree) -> dict[str, xr.Dataset]:
    node: Any = tree.children.get("dimensions")
    children = {} if node is None else node.children
    datasets = {name: child.to_dataset(inherit=False) for name, child in children.items()}
    return {name: dataset for name, dataset in datasets.items() if curve_of(dataset)[1]}


def _friction(data: xr.Dataset) -> Any:
    # with forces only one direction fits in a figure: the first one
    several = "step" in data.dims and data.sizes.get("direction", 1) > 1
    direction = words(data["direction"])[0] if several else None
    return friction(data, direction=direction, reach=evenly_sampled_reach(data))


def _closure_laws(data: xr.Dataset) -> Any:
    return closure_laws(data, log=_has_decades_of_load(data))


def _contact_area(data: xr.Dataset) -> Any:
    return contact_area(data, log=_has_decades_of_load(data))


def _has_decades_of_load(data: xr.Dataset) -> bool:
    """Return True where linear axes would hide all loads but the largest."""
    force = np.asarray(data["normal_force"].values, float) if "normal_force" in data else np.empty(0)
    return needs_log_axis(force[force > 0])


def _lacunarity(data: xr.Dataset) -> Any:
    return lacunarity(data, shear=shown_shear(data))


def _slip_domains(data: xr.Dataset) -> Any:
    return slip_domains(data.isel(shear=-1) if "shear" in data.dims else data)  # at the greatest shear


def _uplift(data: xr.Dataset) -> Any:
    """Draw the uplift at the greatest shear, under the greatest load."""
    return uplift(data.isel({dim: -1 for dim in ("shear", "step") if dim in data.dims}))


def _local_slopes(data: xr.Dataset) -> Any:
    return local_slopes(data, shear=shown_shear(data))


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
            canvas.print_png(temporary, pil_kwargs={"compress_level": 4})  # type: ignore[no-untyped-call]
        else:
            date = {".svg": "Date", ".pdf": "CreationDate"}[target.suffix]
            figure.savefig(temporary, format=target.suffix[1:], metadata={date: None})
