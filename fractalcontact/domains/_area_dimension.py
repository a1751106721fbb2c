"""Area dimension: how the area of contact shrinks as the surface is resolved, and which content does not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.grid import EXCESS_PER_EDGE, contact_edges
from fractalcontact.base.regression import local_slope
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import NONE, Problems
from fractalcontact.domains import _masks
from fractalcontact.domains._hausdorff_content import SQUARE, shifted_contents
from fractalcontact.domains._masks import Array, Planes
from fractalcontact.domains._scaling_fit import ROUNDING, fit_line, interval_notes

SOURCE = (
    "Borri-Brunetto, Carpinteri and Chiaia, Int. J. Fracture 95:221 (1999); Ciavarella et al., Proc. R. Soc. "
    "A 456:387 (2000); Yastrebov, Anciaux and Molinari, Tribology Int. 114:161 (2017) (correction)"
)
EXPONENTS = np.linspace(0.5, 2.0, 61)  # between which that of the stationary content is interpolated linearly


def _check(problems: Problems) -> None:
    given = problems.given
    is_list = isinstance(given.masks, (list, tuple)) and len(given.masks) > 1
    if not problems.require(is_list, "masks", "a list of two masks or more"):
        return
    are_valid = [
        _masks.check_mask(problems, mask, argument=f"masks[{k}]") for k, mask in enumerate(given.masks)
    ]
    if all(are_valid):
        _check_same_extent(problems, given.masks)


def _check_same_extent(problems: Problems, masks: Sequence[xr.DataArray]) -> None:
    """Check that the masks have one extent, the same leading dims, and each its own spacing."""
    grids = [_masks.mask_grid(mask) for mask in masks]
    first = grids[0]
    leading = masks[0].dims[:-2], masks[0].shape[:-2]
    coarsest = max(max(grid.spacing) for grid in grids)
    for k, (mask, grid) in enumerate(zip(masks, grids, strict=True)):
        name = f"masks[{k}]"
        problems.require(grid.has_coordinates, name, "x and y coordinates", NONE)
        own = mask.dims[:-2], mask.shape[:-2]
        problems.require(own == leading, f"{name}.dims", f"leading dims {leading[0]} {leading[1]}", own)
        difference = max(abs(a - b) for a, b in zip(grid.extent, first.extent, strict=True))
        expected = f"the extent {first.extent} of the first"
        problems.require(difference <= coarsest, name, expected, grid.extent)
    sides = [float(np.sqrt(grid.cell_area)) for grid in grids]
    problems.require(len(set(sides)) == len(sides), "masks", "a spacing of its own for each", sides)


@public_result(title="Area of a contact domain by resolution", references=SOURCE, check=_check)
def area_dimension(masks: Sequence[xr.DataArray], *, corrected: bool = False) -> xr.Dataset:
    """Dimension of a contact domain over refinements of the surface: A ~ s^(2 - D), and Hausdorff content.

    The masks are solutions of the same contact, each on a surface resolved to another spacing s. This is not
    the box dimension of one mask, which has a single resolution. For elastic contact of self-affine surfaces
    theory gives 1 + H, at any load. The exponent at which the Hausdorff content neither falls nor grows with
    the resolution is the other end of a bracket of the dimension, from below.

    Parameters
    ----------
    masks : sequence of DataArray, dims (..., y, x)
        Boolean, or integer flags where contact means value > 0; with coordinates, of the same extent (to one
        cell of the coarsest) and the same leading dims.
    corrected : bool
        Subtract from each area the excess of the pixels on its boundary (Yastrebov et al.). The correction is
        for spots that are smooth at the scale of a cell.

    Returns
    -------
    Dataset
        Over the leading dims: `area_dimension`, with `ci_low` and `ci_high`, two standard deviations of the
        local slopes to either side (NaN for two resolutions). Over `resolution` (m; the side of a square with
        the area of a cell) too: `contact_fraction`, `corrected_contact_fraction`, and `local_slope`,
        2 - d ln A / d ln s; `stationary_exponent`, the largest up to which the content (`hausdorff_content`,
        up to squares of the extent) does not fall with the resolution. NaN where a mask is empty; the
        exponent also where cells are not square or spacings are not in the ratio of powers of 2.

    Raises
    ------
    InvalidInput
        Fewer than two masks, no coordinates, or extents, leading dims or spacings that do not match.

    Examples
    --------
    A Sierpinski carpet, resolved to 27 and to 81 cells a side:

    >>> import numpy as np, xarray as xr, fractalcontact as fc
    >>> generator, cells = [[1, 1, 1], [1, 0, 1], [1, 1, 1]], np.ones((1, 1), int)
    >>> masks = []
    >>> for level in range(1, 5):
    ...     cells = np.kron(generator, cells)
    ...     axis = (np.arange(3**level) + 0.5) / 3**level
    ...     masks.append(xr.DataArray(cells, dims=("y", "x"), coords={"y": axis, "x": axis}))
    >>> result = fc.domains.area_dimension(masks[2:])
    >>> round(float(result.area_dimension), 4)  # ln 8 / ln 3
    1.8928
    """
    stacks = sorted((_masks.read_planes(mask) for mask in masks), key=lambda planes: planes.side)
    fractions = [_contact_fractions(planes) for planes in stacks]
    counted, improved = (np.stack(values, axis=-1) for values in zip(*fractions, strict=True))
    resolution = np.array([planes.side for planes in stacks])
    used = improved if corrected else counted
    with np.errstate(divide="ignore"):
        logs = np.where(used > 0, np.log(np.maximum(used, 0.0)), np.nan)
    slope, spread, _ = fit_line(np.log(resolution / resolution[0]), logs)
    half_width = 2.0 * spread + ROUNDING
    planes = stacks[0]
    variables = {
        "area_dimension": planes.variable(2.0 - slope),
        "ci_low": planes.variable(2.0 - slope - half_width),
        "ci_high": planes.variable(2.0 - slope + half_width),
        "contact_fraction": planes.variable(counted, "resolution"),
        "corrected_contact_fraction": planes.variable(improved, "resolution"),
        "local_slope": planes.variable(2.0 - local_slope(resolution, used), "resolution"),
        "stationary_exponent": planes.variable(stationary_exponents(stacks)),
    }
    coords = {"resolution": ("resolution", resolution)}
    return planes.dataset(variables, coords, notes=_notes(slope))


def _contact_fractions(planes: Planes) -> tuple[Array, Array]:
    """Return the share of cells in contact, as counted and corrected for its boundary."""
    cells = float(np.prod(planes.grid.shape))
    sides = contact_edges(planes.cells, planes.grid.periodic).sum(-1)
    return planes.occupied / cells, (planes.occupied - EXCESS_PER_EDGE * sides) / cells


def stationary_exponents(
    stacks: Sequence[Planes],
    *,
    shifts: int = 4,  # of the grid of squares: exponents are within .008 of those of 16, with one within .020
) -> Array:
    """Return for each plane the largest exponent up to which its content does not fall with the resolution.

    `stacks` are the same domains on finer to coarser grids. At the exponent 2 the content is the area.
    """
    sides = np.array([planes.side for planes in stacks])
    doublings = np.log2(sides / sides[0])
    are_square = all(abs(dy - dx) <= SQUARE * dx for dy, dx in (planes.grid.spacing for planes in stacks))
    if not are_square or np.abs(doublings - np.rint(doublings)).max() > SQUARE:
        return np.full(stacks[0].count, np.nan)
    levels = int(np.ceil(np.log2(max(stacks[0].grid.shape))))
    contents = [
        shifted_contents(planes, EXPONENTS, levels - int(doubling), shifts).mean(1) * planes.side**EXPONENTS
        for planes, doubling in zip(stacks, np.rint(doublings), strict=True)
    ]
    with np.errstate(divide="ignore"):
        logs = np.log(np.stack(contents, axis=-1))
    slopes = fit_line(np.log(sides / sides[0]), np.where(np.isfinite(logs), logs, np.nan))[0]
    return np.array([_last_root(slope) for slope in slopes])


def _last_root(slope: Array) -> float:
    """Return the exponent above which the slope of the content over the spacing is positive."""
    below = np.flatnonzero(slope <= 0.0)
    if np.isnan(slope).any() or not below.size:
        return float("nan")
    k = int(below[-1])
    if k == slope.size - 1:
        return float(EXPONENTS[-1])
    share = -slope[k] / (slope[k + 1] - slope[k])
    return float(EXPONENTS[k] + share * (EXPONENTS[k + 1] - EXPONENTS[k]))


def _notes(slope: Array) -> dict[str, dict[str, Any]]:
    notes = {
        **interval_notes("interval of the dimension by area (two standard deviations of the local slopes)"),
        "local_slope": {"long_name": "local dimension, 2 - d ln(area)/d ln(resolution)"},
    }
    if np.isnan(slope).any():
        notes["area_dimension"] = {"comment": "NaN where the set is empty at some resolution"}
    return notes
