"""Every figure that a study has data for, as files."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fractalcontact.base.netcdf import unfinished
from fractalcontact.base.progress import track
from fractalcontact.plotting import closing, domain_maps, forgetting, lacunar, leakage, roughness, sliding
from fractalcontact.plotting._reading import words
from fractalcontact.plotting.paper import group, has_figure, paper_figure, shown_shear

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

PAPER = {1: "face", 2: "sliding_scheme", 3: "closure", 4: "contact_domains", 5: "dilatancy"}


def draw(tree: xr.DataTree, folder: str | os.PathLike[str], *, progress: bool = False) -> list[Path]:
    """Draw every figure that a study has data for and write each as PNG.

    Parameters
    ----------
    tree : DataTree
        From `fractalcontact.scenes.run` or `fractalcontact.open`.
    folder : path-like
        Made if need be. Figures of the same name are replaced, each only when the new one is complete.
    progress : bool
        Show a bar.

    Returns
    -------
    list of Path
        The files, in the order in which they were drawn: the paper's figures first.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, drawing in track(list(drawings(tree)), progress, "figures", unit="figure"):
        figure = drawing()
        written.append(_write(figure, folder / f"{name}.png"))
        figure.clear()
    return written


def drawings(tree: xr.DataTree) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Yield a file name, without its ending, and what draws it, for every figure there are data for."""
    for number, name in PAPER.items():
        if has_figure(tree, number):
            yield f"figure_{number}_{name}", _later(paper_figure, tree, number)
    estimates = group(tree, "dimensions")
    if estimates is not None and "method" in estimates.dims:
        yield "dimensions", _later(roughness.dimensions, estimates)
    curves = _curves(tree)
    if curves:
        yield "dimension_curves", _later(roughness.dimension_curves, curves, estimates)
    for path, name, drawing in (
        ("joints/friction", "friction", _friction),
        ("domains/box_dimension", "box_dimension", lacunar.box_dimension),
        ("domains/minkowski_dimension", "minkowski_dimension", lacunar.box_dimension),
        ("domains/correlation_dimension", "correlation_dimension", lacunar.box_dimension),
        ("domains/lacunarity", "lacunarity", _lacunarity),
        ("domains/islands", "islands", domain_maps.islands),
        ("joints/decorrelation_length", "correlation", forgetting.correlation),
        ("joints/transmissivity", "hydraulic_aperture", leakage.hydraulic_aperture),
        ("contact", "closure_law", closing.closure_laws),
        ("contact", "contact_area", closing.contact_area),
    ):
        data = group(tree, path)
        if data is not None:
            yield name, _later(drawing, data)
    counted = group(tree, "domains/box_dimension")
    if counted is not None and "local_slope" in counted:
        yield "local_slopes", _later(_local_slopes, counted)
    pressed = group(tree, "contact")
    if pressed is not None and "state" in pressed:
        yield "contact_domains", _later(domain_maps.contact_domains, pressed)


def _later(drawing: Callable[..., Figure], *arguments: Any) -> Callable[[], Figure]:
    return lambda: drawing(*arguments)


def _curves(tree: xr.DataTree) -> dict[str, xr.Dataset]:
    node: Any = tree.children.get("dimensions")
    children = {} if node is None else node.children
    found = {name: child.to_dataset(inherit=False) for name, child in children.items()}
    return {name: curve for name, curve in found.items() if roughness.curve_of(curve)[1]}


def _friction(data: xr.Dataset) -> Figure:
    # of several directions the first is drawn where forces make a family of curves of their own
    several = "step" in data.dims and data.sizes.get("direction", 1) > 1
    direction = words(data["direction"])[0] if several else None
    return sliding.friction(data, direction=direction, reach=sliding.first_part(data))


def _lacunarity(data: xr.Dataset) -> Figure:
    return lacunar.lacunarity(data, shear=shown_shear(data))


def _local_slopes(data: xr.Dataset) -> Figure:
    return lacunar.local_slopes(data, shear=shown_shear(data))


def _write(figure: Figure, target: Path) -> Path:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    # `savefig` would lay out and draw every figure twice
    layout = figure.get_layout_engine()
    if layout is not None:
        layout.execute(figure)
        figure.set_layout_engine("none")
    temporary = unfinished(target)
    try:
        canvas.print_png(temporary)  # type: ignore[no-untyped-call]
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)
    return target
