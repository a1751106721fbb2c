"""Lacunarity: how unevenly a set fills the plane, by the size of the box through which it is seen."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.provenance import accounted, stamp
from fractalcontact.domains import _gliding
from fractalcontact.domains._masks import Array, Planes, assemble, box_sizes, read_mask

if TYPE_CHECKING:
    import xarray as xr

SOURCE = (
    "Allain and Cloitre, Phys. Rev. A 44:3552 (1991); Plotnick et al., Phys. Rev. E 53:5461 (1996) "
    "(gliding box); Borri-Brunetto, Carpinteri and Chiaia, FRAMCOS-3 (1998) (of contact domains)"
)


@accounted("rounding: a mean over all boxes")
def lacunarity(
    mask: xr.DataArray,
    box_sizes: Any = None,
    *,
    boxes: str = "gliding",
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Lacunarity by gliding boxes or on one grid, with that of a random dust of equal coverage beside it.

    A box of r x r cells glides over the plane cell by cell; M is the number of cells of the set in it, and
    the lacunarity is <M^2> / <M>^2 over all positions: 1 for an even set, and the larger the more the set
    leaves gaps at the size of the box.

    Parameters
    ----------
    mask : DataArray, dims (..., y, x)
        Boolean, or integer flags where contact means value > 0.
    box_sizes : sequence of int, optional
        Edges of the box in cells; by default the powers of two up to half the shorter side.
    boxes : {"gliding", "fixed"}
        All positions of the box, or those of the one grid that starts at the first cell. On their own grid
        sets made by a fixed rule have the lacunarity (L/r)^(2 - D) exactly, gliding boxes tell the gaps
        wherever they lie.
    periodic : bool, optional
        Whether the box goes round over the edges; by default what the axes say. True is refused on a free
        axis, where only positions wholly inside count.
    valid : DataArray of bool, dims (y, x) or those of the mask, optional
        Cells that were observed: only boxes of observed cells count.

    Returns
    -------
    Dataset
        Over the leading dims of the mask and `box_size` (cells; `box_length` in m, the side of a square as
        large as the box): `lacunarity`; `null_lacunarity`, 1 + (1 - p) / (p r^2) for cells set independently
        with the coverage p as probability; `relative_lacunarity`, over that of the dust;
        `normalised_lacunarity`, (lacunarity - 1) p / (1 - p), which is 1 at one cell whatever the coverage.
        Over the leading dims: `coverage`, and the whole curve as one number: `lacunarity_slope`, the
        least-squares slope of ln lacunarity over ln r (D - 2 for a power law), `lacunarity_area`, the
        integral of ln lacunarity over ln r (0 for an even set), with `null_lacunarity_slope` and
        `null_lacunarity_area`.

    Raises
    ------
    InvalidInput
        The mask is not boolean or integer, a size is not a whole number of cells between 1 and the shorter
        side, or `periodic` is True on a free axis.

    Notes
    -----
    NaN where the set is empty or no box was wholly observed, with the reason in the attributes; the
    normalised one also where the set is full, and the numbers where some size has none. At one cell the
    lacunarity is 1 / coverage whatever the set.
    """
    begin = time.perf_counter()
    with Problems("fractalcontact.domains.lacunarity") as problems:
        problems.choice("boxes", boxes, ("gliding", "fixed"))
        planes = read_mask(mask, problems, valid=valid, periodic=periodic)
        sizes = _sizes(box_sizes, planes, problems)
    values = _gliding.lacunarity(planes, sizes) if boxes == "gliding" else _gliding.on_grid(planes, sizes)
    dust = _gliding.dust(planes.coverage, sizes)
    numbers = zip(("slope", "area"), _gliding.numbers(sizes, values), strict=True)
    null = zip(("slope", "area"), _gliding.numbers(sizes, dust), strict=True)
    variables = {
        "coverage": planes.variable(planes.coverage),
        "lacunarity": planes.variable(values, "box_size"),
        "null_lacunarity": planes.variable(dust, "box_size"),
        "relative_lacunarity": planes.variable(values / dust, "box_size"),
        "normalised_lacunarity": planes.variable(_gliding.normalised(planes.coverage, values), "box_size"),
        **{f"lacunarity_{name}": planes.variable(one) for name, one in numbers},
        **{f"null_lacunarity_{name}": planes.variable(one) for name, one in null},
        "run_time": ((), time.perf_counter() - begin),
    }
    coords = {"box_size": ("box_size", sizes), "box_length": ("box_size", sizes * planes.side)}
    dataset = assemble(planes, variables, coords, notes=_notes(planes, values, boxes))
    parameters = {"mask": mask, "box_sizes": box_sizes, "boxes": boxes, "periodic": periodic, "valid": valid}
    return stamp(
        dataset,
        "fractalcontact.domains.lacunarity",
        parameters,
        title="Lacunarity",
        references=SOURCE,
    )


def _sizes(given: Any, planes: Planes, problems: Problems) -> Array:
    shorter = min(planes.grid.shape)
    default = 2 ** np.arange(max(1, (max(1, shorter // 2)).bit_length()), dtype=np.int64)
    return box_sizes(given, default, problems, "box_sizes", longest=shorter)


def _notes(planes: Planes, values: Array, boxes: str) -> dict[str, dict[str, str]]:
    empty = planes.occupied == 0
    reasons = []
    if empty.any():
        reasons.append(f"the set is empty ({int(empty.sum())} planes)")
    if np.isnan(values[~empty]).any():
        reasons.append("no box was wholly observed, or none of those holds a cell")
    attributes = {"long_name": "lacunarity (fixed grid of boxes)"} if boxes == "fixed" else {}
    if reasons:
        attributes["comment"] = "NaN where " + " or where ".join(reasons)
    notes = {"lacunarity": attributes}
    if (planes.coverage == 1).any():
        notes["normalised_lacunarity"] = {"comment": "NaN where the set is full or empty: it has no odds"}
    if values.shape[-1] < 2:
        single = {"comment": "NaN: one size of box gives no curve"}
        notes |= {f"{kind}lacunarity_{name}": single for kind in ("", "null_") for name in ("slope", "area")}
    return notes
