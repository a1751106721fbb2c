"""How the area of contact shrinks as the surface is resolved more finely."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.grid import contact_edges
from fractalcontact.base.provenance import stamp
from fractalcontact.base.scaling import local_slope
from fractalcontact.domains import _covers
from fractalcontact.domains._masks import Array, Planes, assemble, read_mask

if TYPE_CHECKING:
    import xarray as xr

EDGE = (np.pi - 1.0 + np.log(2.0)) / 24.0  # share of a cell by which each side on the boundary is too much
ROUNDING = 1e-14  # no interval is narrower
SOURCE = (
    "Borri-Brunetto, Carpinteri and Chiaia, Int. J. Fracture 95:221 (1999); Ciavarella et al., Proc. R. Soc. "
    "A 456:387 (2000); Yastrebov, Anciaux and Molinari, Tribology Int. 114:161 (2017) (correction)"
)


def area_dimension(masks: Sequence[xr.DataArray], *, corrected: bool = False) -> xr.Dataset:
    """Dimension of a contact domain from its area at several resolutions, A ~ s^(2 - D).

    The masks are solutions of the same contact, each on a surface resolved to another spacing s. This is
    another quantity than the box dimension of one mask, which looks at a single resolution; for elastic
    contact of self-affine surfaces theory gives 1 + H, whatever the load.

    Parameters
    ----------
    masks : sequence of DataArray, dims (..., y, x)
        Boolean, or integer flags where contact means value > 0; with coordinates, of the same extent (to one
        cell of the coarsest) and the same leading dims.
    corrected : bool
        Take from each area the part of the cells on its boundary that pixels give it in excess (Yastrebov
        et al.), which is for spots that are smooth at the scale of a cell.

    Returns
    -------
    Dataset
        Over the leading dims: `area_dimension`, with `ci_low` and `ci_high`, two standard deviations of the
        local slopes to either side (NaN for two resolutions). Over `resolution` (m; the side of a square as
        large as a cell) too: `contact_fraction`, `corrected_contact_fraction`, and `local_slope`,
        2 - d ln A / d ln s.

    Raises
    ------
    InvalidInput
        Fewer than two masks, no coordinates, or extents, leading dims or spacings that do not go together.

    Notes
    -----
    NaN where a mask is empty.
    """
    begin = time.perf_counter()
    with Problems("fractalcontact.domains.area_dimension") as problems:
        given = list(masks) if isinstance(masks, (list, tuple)) else []
        problems.require(len(given) > 1, "masks", "a list of two masks or more", masks)
        problems.require(isinstance(corrected, (bool, np.bool_)), "corrected", "True or False", corrected)
        found = [read_mask(mask, problems, argument=f"masks[{k}]") for k, mask in enumerate(given)]
        if not problems.found:
            _go_together(found, problems)
    found.sort(key=lambda planes: planes.side)
    raw, better = (np.stack(each, axis=-1) for each in zip(*map(_fractions, found), strict=True))
    resolution = np.array([planes.side for planes in found])
    used = better if corrected else raw
    with np.errstate(divide="ignore"):
        logs = np.where(used > 0, np.log(np.maximum(used, 0.0)), np.nan)
    slope, spread, _ = _covers.line(np.log(resolution / resolution[0]), logs)
    half = 2.0 * spread + ROUNDING
    planes = found[0]
    variables = {
        "area_dimension": planes.variable(2.0 - slope),
        "ci_low": planes.variable(2.0 - slope - half),
        "ci_high": planes.variable(2.0 - slope + half),
        "contact_fraction": planes.variable(raw, "resolution"),
        "corrected_contact_fraction": planes.variable(better, "resolution"),
        "local_slope": planes.variable(2.0 - local_slope(resolution, used), "resolution"),
        "run_time": ((), time.perf_counter() - begin),
    }
    dataset = assemble(planes, variables, {"resolution": ("resolution", resolution)}, notes=_notes(slope))
    return stamp(
        dataset,
        "fractalcontact.domains.area_dimension",
        {"masks": given, "corrected": corrected},
        title="Area of a contact domain by resolution",
        references=SOURCE,
    )


def _go_together(found: Sequence[Planes], problems: Problems) -> None:
    first = found[0]
    coarsest = max(max(planes.grid.spacing) for planes in found)
    for k, planes in enumerate(found):
        name = f"masks[{k}]"
        problems.require(planes.grid.known, name, "x and y coordinates", "none")
        same = (planes.dims, planes.shape) == (first.dims, first.shape)
        problems.require(
            same, f"{name}.dims", f"leading dims {first.dims} {first.shape}", (planes.dims, planes.shape)
        )
        off = max(abs(a - b) for a, b in zip(planes.grid.extent, first.grid.extent, strict=True))
        problems.require(
            off <= coarsest, name, f"the extent {first.grid.extent} of the first", planes.grid.extent
        )
    sides = [planes.side for planes in found]
    problems.require(len(set(sides)) == len(sides), "masks", "a spacing of its own for each", sides)


def _fractions(planes: Planes) -> tuple[Array, Array]:
    """Return the share of cells in contact, as counted and corrected for its boundary."""
    cells = float(np.prod(planes.grid.shape))
    sides = contact_edges(planes.cells, planes.grid.periodic).sum(-1)
    return planes.occupied / cells, (planes.occupied - EDGE * sides) / cells


def _notes(slope: Array) -> dict[str, dict[str, Any]]:
    interval = "dimension by area (two standard deviations of the local slopes)"
    notes = {
        "ci_low": {"long_name": f"lower end of the interval of the {interval}"},
        "ci_high": {"long_name": f"upper end of the interval of the {interval}"},
        "local_slope": {"long_name": "local dimension, 2 - d ln(area)/d ln(resolution)"},
    }
    if np.isnan(slope).any():
        notes["area_dimension"] = {"comment": "NaN where the set is empty at some resolution"}
    return notes
