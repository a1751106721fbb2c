"""Heights that were filled in between others: not measured, and smoother than those around them.

Filled points minimise the bending energy of a thin plate (`fractalcontact.surfaces.fill`) or the mean square
slope (a harmonic function): the derivative of that energy by their height vanishes, to rounding. That of a
measured height does not.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.dimensions._quantisation import quantisation
from fractalcontact.dimensions._surface_input import Surface

Array = np.ndarray[Any, np.dtype[Any]]

_ROUNDING = 2e-13  # of the largest height, over the sum of the weights of its neighbours
_CLEAR = 1e-5  # largest rounding over the rms derivative where the two can be told apart
_LEAST, _MOST = 0.002, 0.5  # share of the heights
_LARGE = 1 << 16  # points of a surface of which bands of rows are looked at first
_SAMPLE, _DISTINCT = 4096, 0.9  # values that are compared, and the least share of distinct ones
_BAND, _APART = 8, 64  # rows of a band, and from one to the next


def filled_points(surface: Surface) -> Array | None:
    """Return which heights were filled in, shape (ny, nx); None where there are none, or hardly any.

    Those of a periodic surface, and of one gridded from points, are not looked for.
    """
    if surface.is_lazy or surface.finest_scale or any(surface.grid.periodic) or surface.is_constant:
        return None
    heights, spacing = surface.heights, surface.plane_spacing
    bands = [heights[y : y + _BAND] for y in range(0, len(heights), _APART)]
    rounding = 4.0 * float(np.spacing(np.nanmax(np.abs(surface.raw)))) / surface.unit
    if heights.size > _LARGE and not _is_found(bands, spacing, rounding):
        return None
    derivatives = _derivatives(heights, spacing)
    mask = np.logical_or.reduce([_stationary(d, rounding) for d in derivatives])
    # where heights were rounded, their derivative has few values, of which zero is one
    others = derivatives[0][~mask & np.isfinite(derivatives[0])][:_SAMPLE]
    is_rounded = (
        np.unique(np.rint(others * 1e13)).size < _DISTINCT * others.size or quantisation(heights)[0] > 0.0
    )
    return mask if _LEAST < np.mean(mask) < _MOST and not is_rounded else None


def with_gaps(surface: Surface, mask: Array | None) -> tuple[Surface, str]:
    """Return a surface without its filled heights, and a note; itself if there are none."""
    if mask is None:
        return surface, ""
    heights = np.where(mask, np.nan, surface.heights)
    note = (
        f"{100.0 * float(np.mean(mask)):.2g} % of the heights were filled in, as by `fill`: they were not "
        "measured, and count as missing"
    )
    return surface.with_heights(heights), note


def _is_found(blocks: list[Array], spacing: tuple[float, float], rounding: float) -> bool:
    parts = (d for block in blocks for d in _derivatives(block, spacing))
    return any(bool(_stationary(d, rounding).any()) for d in parts)


def _derivatives(heights: Array, spacing: tuple[float, float]) -> list[Array]:
    """Return half the derivative of the bending energy and of the mean square slope by each height.

    Both over the sum of the sizes of their weights.
    """
    unit = min(d for n, d in zip(heights.shape, spacing, strict=True) if n > 1)
    axes = [(axis, unit / d) for axis, d in enumerate(spacing) if heights.shape[axis] > 2]
    bending, slope = np.zeros(heights.shape), np.zeros(heights.shape)
    for axis, inverse in axes:
        bending += inverse**4 * _transposed(np.diff(heights, 2, axis), 2, axis)
        slope += inverse**2 * _transposed(np.diff(heights, 1, axis), 1, axis)
    weight = sum(16.0 * inverse**4 for _, inverse in axes)
    if len(axes) == 2:
        mixed = np.diff(np.diff(heights, 1, 0), 1, 1)
        factor = 2.0 * (axes[0][1] * axes[1][1]) ** 2
        bending += factor * _transposed(_transposed(mixed, 1, 0), 1, 1)
        weight += 16.0 * factor
    return [bending / weight, slope / sum(4.0 * inverse**2 for _, inverse in axes)]


def _transposed(differences: Array, order: int, axis: int) -> Array:
    """Apply the transpose of `np.diff`."""
    for _ in range(order):
        ends = [(0, 0), (0, 0)]
        ends[axis] = (1, 1)
        differences = -np.diff(np.pad(differences, ends), 1, axis)
    return differences


def _stationary(derivative: Array, rounding: float) -> Array:
    """Return where a derivative vanishes; nowhere if that may be rounding."""
    limit, known = max(_ROUNDING, rounding), derivative[np.isfinite(derivative)]
    is_clear = known.size > 0 and limit < _CLEAR * float(np.sqrt(np.mean(known**2)))
    return np.asarray((np.abs(derivative) <= limit) & is_clear)
