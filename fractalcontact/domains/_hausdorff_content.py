"""Hausdorff content, the cheapest cover of a set by dyadic squares at the price side^s; area by resolution.

The content H^s of a contact domain is the measure in m^s that remains as the surface is resolved more finely
and its area in m^2 shrinks (Carpinteri's renormalised area). A square is covered as cheaply as possible
either by itself or by the cheapest covers of its four quarters. So the minimum over all covers follows from
the cells upwards, exactly, in one pass over N cells and N/3 squares.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.grid import DECADES, EXCESS_PER_EDGE, UNIFORM, contact_edges
from fractalcontact.base.numbers import ROUNDED, float_array
from fractalcontact.base.regression import local_slope
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import NONE, Problems
from fractalcontact.domains import _masks
from fractalcontact.domains._aligned_boxes import coarsened
from fractalcontact.domains._masks import Array, Planes
from fractalcontact.domains._scaling_fit import ROUNDING, fit_line, interval_notes

SOURCE = (
    "Mattila, Geometry of Sets and Measures in Euclidean Spaces (1995), ch. 4 and 8 (content, Frostman's "
    "lemma); Carpinteri, Mech. Mater. 18:89 (1994) (renormalised measure)"
)


def _check(problems: Problems) -> None:
    given = problems.given
    problems.numbers("s", at_least=0.0, at_most=2.0)
    problems.integer("shifts", at_least=1)
    is_length = problems.number("coarsest", above=0.0, at_most=10.0**DECADES, optional=True)
    if _masks.check_mask(problems):
        grid = _masks.mask_grid(given.mask)
        dy, dx = grid.spacing
        is_square = abs(dy - dx) <= UNIFORM * dx
        problems.require(is_square, "mask", "square cells", f"spacings {dy:g} and {dx:g} m")
        finest = min(dy, dx)
        if is_length and given.coarsest is not None:
            expected = f"at least the spacing, {finest:g} {grid.length_unit}"
            problems.require(given.coarsest * ROUNDED >= finest, "coarsest", expected)


@public_result(
    title="Hausdorff content",
    references=SOURCE,
    achieved_error="exact",
    check=_check,
)
def hausdorff_content(
    mask: xr.DataArray,
    s: Any = (1.0, 1.5),
    *,
    coarsest: float | None = None,
    shifts: int = 1,
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Dyadic Hausdorff content of a set, the least sum of side^s over all covers by dyadic squares.

    Parameters
    ----------
    mask : DataArray, dims (..., y, x)
        Boolean, or integer flags where contact means value > 0; of square cells.
    s : number or sequence, 0 to 2
        Exponents. At 2 the content is the area; at 1, times 1.1523 E*, it bounds the contact stiffness; near
        the dimension of the domain, 1.4 to 1.6 for Hurst exponents of .5 to .8, it does not depend on the
        resolution (see `area_dimension`).
    coarsest : float, optional
        Side of the largest square in metres, rounded down to a power of two of the spacing; by default the
        smallest that covers the mask.
    shifts : int
        Positions of the grid of squares over which the content is averaged: the first begins at the first
        cell, the others are spread evenly over the largest square.
    periodic : bool, optional
        Whether squares wrap around the edges; by default along periodic axes. True needs periodic axes.
    valid : DataArray of bool, dims (y, x) or those of the mask, optional
        Observed cells; the others are not in the set.

    Returns
    -------
    Dataset
        Over the leading dims and `exponent`: `hausdorff_content` (m^s), the mean over the shifts;
        `hausdorff_content_min`, the least; `relative_content`, the mean over L^s, where L^2 is the area of
        the extent. `coarsest_side` (m).

    Raises
    ------
    InvalidInput
        The mask, its cells, `s`, `coarsest`, `shifts`, `periodic` or `valid` is not as described.

    Notes
    -----
    The content is also the largest mass on the set of which no dyadic square holds more than side^s
    (Frostman's lemma; the tree makes it exact), so it has no statistical error. Covers by squares at any
    place cost between 1 / min(9, 4 2^s) of it and all of it. A content is a measure, not a dimension: the
    dimension of a single mask is not determined by it. Theory: see the documentation, "Theory: contact
    domains".

    Examples
    --------
    A row of 16 cells has the content 16^s, of one square, up to s = 1, and 16 beyond, of its cells:

    >>> import numpy as np, fractalcontact as fc
    >>> row = np.arange(16)[:, None] == np.full(16, 3)
    >>> fc.domains.hausdorff_content(row, [0.5, 1, 1.5]).hausdorff_content.values.tolist()
    [4.0, 16.0, 16.0]
    """
    planes = _masks.read_planes(mask, valid=valid, periodic=periodic)
    exponents, spacing = np.atleast_1d(float_array(s)), planes.side
    levels = cover_levels(planes, coarsest)
    contents = shifted_contents(planes, exponents, levels, shifts)
    unit = spacing**exponents
    extent = float(np.sqrt(planes.grid.nominal_area))
    mean = contents.mean(1) * unit
    variables = {
        "hausdorff_content": planes.variable(mean, "exponent"),
        "hausdorff_content_min": planes.variable(contents.min(1) * unit, "exponent"),
        "relative_content": planes.variable(mean / extent**exponents, "exponent"),
        "coarsest_side": ((), spacing * 2.0**levels),
    }
    comment = {"comment": f"in {planes.grid.length_unit}^s"}
    notes = dict.fromkeys(("hausdorff_content", "hausdorff_content_min"), comment)
    dataset = planes.dataset(variables, {"exponent": ("exponent", exponents)}, notes=notes)
    return dataset if np.ndim(s) else dataset.isel(exponent=0)


def cover_levels(planes: Planes, coarsest: float | None) -> int:
    """Return how often the cell is doubled up to the largest square."""
    if coarsest is None:
        return int(np.ceil(np.log2(max(planes.grid.shape))))
    return int(np.floor(np.log2(coarsest / planes.side * ROUNDED)))


def shifted_contents(planes: Planes, exponents: Array, levels: int, shifts: int) -> Array:
    """Return the contents in cells^s for each shift of the grid of squares, (planes, shifts, exponents)."""
    # powers of the plastic number, the root of x^3 = x + 1, fill a square evenly (Roberts 2018)
    steps = 1.32471795724474602596 ** -np.array([1.0, 2.0])
    offsets = np.floor(2**levels * (np.arange(shifts)[:, None] * steps % 1.0)).astype(np.int64)
    periodic = planes.grid.periodic
    contents = planes.map(
        lambda cells, _: [_contents(cells, exponents, levels, offset, periodic) for offset in offsets],
        passes=shifts,
    )
    return np.array(contents).reshape(planes.count, shifts, exponents.size)


def _contents(
    cells: Array, exponents: Array, levels: int, offset: Array, periodic: Sequence[bool]
) -> list[float]:
    """Return the cheapest cover by squares of 1 to 2^levels cells, from a grid shifted by `offset`."""
    if levels == 0:
        return [float(np.count_nonzero(cells))] * exponents.size
    # a free plane is moved away from the first square, a periodic one is rolled
    for axis, (shift, wraps) in enumerate(zip(offset.tolist(), periodic, strict=True)):
        before = [(shift if axis == own else 0, 0) for own in (0, 1)]
        cells = np.roll(cells, shift, axis) if wraps else np.pad(cells, before)
    counts = coarsened(cells, 2, np.add)
    contents = []
    for s in exponents.tolist():
        cost = np.minimum(counts, np.where(counts > 0, 2.0**s, 0.0))
        for level in range(2, levels + 1):
            cost = np.minimum(coarsened(cost, 2, np.add), 2.0 ** (level * s))
        contents.append(float(cost.sum()))
    return contents


AREA_SOURCE = (
    "Borri-Brunetto, Carpinteri and Chiaia, Int. J. Fracture 95:221 (1999); Ciavarella et al., Proc. R. Soc. "
    "A 456:387 (2000); Yastrebov, Anciaux and Molinari, Tribology Int. 114:161 (2017) (correction)"
)
EXPONENTS = np.linspace(0.5, 2.0, 61)  # between which that of the stationary content is interpolated linearly


def _check_masks(problems: Problems) -> None:
    given = problems.given
    problems.boolean("corrected")
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


@public_result(title="Area of a contact domain by resolution", references=AREA_SOURCE, check=_check_masks)
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
    slope, spread = fit_line(np.log(resolution / resolution[0]), logs)
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
    return planes.dataset(variables, coords, notes=_area_notes(slope))


def _contact_fractions(planes: Planes) -> tuple[Array, Array]:
    """Return the share of cells in contact, as counted and corrected for its boundary."""
    cells = float(np.prod(planes.grid.shape))
    sides = contact_edges(planes.cells, planes.grid.periodic).sum(-1)
    return planes.occupied / cells, (planes.occupied - EXCESS_PER_EDGE * sides) / cells


def stationary_exponents(stacks: Sequence[Planes]) -> Array:
    """Return for each plane the largest exponent up to which its content does not fall with the resolution.

    `stacks` are the same domains on finer to coarser grids. At the exponent 2 the content is the area.
    """
    sides = np.array([planes.side for planes in stacks])
    doublings = np.log2(sides / sides[0])
    are_square = all(abs(dy - dx) <= UNIFORM * dx for dy, dx in (planes.grid.spacing for planes in stacks))
    if not are_square or np.abs(doublings - np.rint(doublings)).max() > UNIFORM:
        return np.full(stacks[0].count, np.nan)
    levels = int(np.ceil(np.log2(max(stacks[0].grid.shape))))
    shifts = 4  # of the grid of squares: exponents are within .008 of those of 16, with one within .020
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


def _area_notes(slope: Array) -> dict[str, dict[str, Any]]:
    notes = {
        **interval_notes("interval of the dimension by area (two standard deviations of the local slopes)"),
        "local_slope": {"long_name": "local dimension, 2 - d ln(area)/d ln(resolution)"},
    }
    if np.isnan(slope).any():
        notes["area_dimension"] = {"comment": "NaN where the set is empty at some resolution"}
    return notes
