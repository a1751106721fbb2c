"""Lacunarity: how unevenly a set fills the plane, by the size of the box through which it is seen."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.provenance import stamp
from fractalcontact.domains import _gliding
from fractalcontact.domains._masks import Array, Planes, assemble, box_sizes, read_mask

if TYPE_CHECKING:
    import xarray as xr

SOURCE = (
    "Allain and Cloitre, Phys. Rev. A 44:3552 (1991); Plotnick et al., Phys. Rev. E 53:5461 (1996) "
    "(gliding box); Borri-Brunetto, Carpinteri and Chiaia, FRAMCOS-3 (1998) (of contact domains)"
)


def lacunarity(
    mask: xr.DataArray,
    box_sizes: Any = None,
    *,
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Gliding-box lacunarity, with that of a random dust of equal coverage beside it.

    A box of r x r cells glides over the plane cell by cell; M is the number of cells of the set in it, and
    the lacunarity is <M^2> / <M>^2 over all positions: 1 for an even set, and the larger the more the set
    leaves gaps at the size of the box.

    Parameters
    ----------
    mask : DataArray, dims (..., y, x)
        Boolean, or integer flags where contact means value > 0.
    box_sizes : sequence of int, optional
        Edges of the box in cells; by default the powers of two up to half the shorter side.
    periodic : bool, optional
        Whether the box goes round over the edges; by default what the axes say. True is refused on a free
        axis, where only positions wholly inside count.
    valid : DataArray of bool, dims (y, x) or those of the mask, optional
        Cells that were observed: only boxes of observed cells count.

    Returns
    -------
    Dataset
        Over the leading dims of the mask: `coverage`, and over `box_size` (cells; `box_length` in m, the
        side of a square as large as the box) too: `lacunarity`; `dust_lacunarity`, 1 + (1 - p) / (p r^2)
        for cells set independently with the coverage p as probability.

    Raises
    ------
    InvalidInput
        The mask is not boolean or integer, a size is not a whole number of cells between 1 and the shorter
        side, or `periodic` is True on a free axis.

    Notes
    -----
    NaN where the set is empty or no box was wholly observed, with the reason in the attributes. At one cell
    the lacunarity is 1 / coverage whatever the set.
    """
    begin = time.perf_counter()
    with Problems("fractalcontact.domains.lacunarity") as problems:
        planes = read_mask(mask, problems, valid=valid, periodic=periodic)
        sizes = _sizes(box_sizes, planes, problems)
    values = _gliding.lacunarity(planes, sizes)
    variables = {
        "coverage": planes.variable(planes.coverage),
        "lacunarity": planes.variable(values, "box_size"),
        "dust_lacunarity": planes.variable(_gliding.dust(planes.coverage, sizes), "box_size"),
        "run_time": ((), time.perf_counter() - begin),
    }
    coords = {"box_size": ("box_size", sizes), "box_length": ("box_size", sizes * planes.side)}
    dataset = assemble(planes, variables, coords, notes=_notes(planes, values))
    parameters = {"mask": mask, "box_sizes": box_sizes, "periodic": periodic, "valid": valid}
    return stamp(
        dataset,
        "fractalcontact.domains.lacunarity",
        parameters,
        title="Gliding-box lacunarity",
        references=SOURCE,
    )


def _sizes(given: Any, planes: Planes, problems: Problems) -> Array:
    shorter = min(planes.grid.shape)
    default = 2 ** np.arange(max(1, (max(1, shorter // 2)).bit_length()), dtype=np.int64)
    return box_sizes(given, default, problems, "box_sizes", longest=shorter)


def _notes(planes: Planes, values: Array) -> dict[str, dict[str, str]]:
    empty = planes.occupied == 0
    reasons = []
    if empty.any():
        reasons.append(f"the set is empty ({int(empty.sum())} planes)")
    if np.isnan(values[~empty]).any():
        reasons.append("no box was wholly observed, or none of those holds a cell")
    return {"lacunarity": {"comment": "NaN where " + " or where ".join(reasons)}} if reasons else {}
