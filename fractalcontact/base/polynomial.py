"""Least-squares polynomials of heights with gaps: levelling and mean slopes, on plain arrays."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]
# smallest singular value over the largest for which the points fix the polynomial: it is 6e-17 of a plane
# through one line, 2e-6 through two neighbouring rows of 512 points, 6e-8 of 4096
RANK = 1e-10
ROUNDING = 64.0 * np.finfo(np.float64).eps  # of the greatest height: smaller residuals of planes are rounding


def shifted(heights: Array) -> tuple[Array, float, float]:
    """Return (heights - reference) / scale, the reference (an observed height), and the scale (a power of 2).

    Subtracting an observed height loses no digits of heights that are close to each other. Scaled values are
    within -1 and 1; NaN stays. At least one height is observed.
    """
    low, high = float(heights.min()), float(heights.max())
    if np.isfinite(low) and np.isfinite(high):
        reference = float(heights.flat[heights.size // 2])
    else:
        observed = heights[np.isfinite(heights)]
        reference = float(observed[observed.size // 2])
        low, high = float(np.nanmin(heights)), float(np.nanmax(heights))
    offset = heights - reference
    largest = max(high - reference, reference - low)
    scale = math.ldexp(1.0, math.frexp(largest)[1]) if largest > 0 else 1.0
    offset /= scale
    return offset, reference, scale


def rounding_of(heights: Array) -> float:
    """Return up to which residual the heights, NaN where missing, may be those of a plane."""
    return float(ROUNDING * np.nanmax(np.abs(heights)))


def detrended(heights: Array, order: int) -> tuple[Array, bool]:
    """Return the heights minus their least-squares polynomial, and whether the points determine it.

    Parameters
    ----------
    heights : ndarray, shape (ny, nx) or (nx,)
        NaN where missing; at least one value is finite.
    order : int
        Total degree of the polynomial.
    """
    values, _, scale = shifted(heights)
    observed = np.isfinite(values)
    is_complete = bool(observed.all())
    if not is_complete:
        values[~observed] = 0.0
    basis = _basis(heights.shape, order)
    gram = _gram(basis, observed)
    singular = np.linalg.svd(gram, compute_uv=False)
    if singular[-1] < RANK * singular[0]:
        return heights, False
    for _ in range(2):  # the second pass removes the rounding error of the first
        right = np.array([_project(values, functions) for functions in basis])
        _subtract(values, basis, np.linalg.solve(gram, right))
        if not is_complete:
            values[~observed] = 0.0
    values *= scale
    if not is_complete:
        values[~observed] = np.nan
    return values, True


def slopes(heights: Array, spacing: Sequence[float]) -> tuple[float, ...]:
    """Return the slope of the mean plane along each axis, y first; NaN if it is undetermined."""
    values, _, scale = shifted(heights)
    return tuple(scale * slope for slope in scaled_slopes(values, spacing))


def scaled_slopes(values: Array, spacing: Sequence[float]) -> tuple[float, ...]:
    """Return the slopes of heights that `shifted` has scaled; they are not changed."""
    observed = np.isfinite(values)
    if not observed.all():
        values = np.where(observed, values, 0.0)
    basis = _basis(values.shape, 1)
    gram = _gram(basis, observed)
    singular = np.linalg.svd(gram, compute_uv=False)
    if singular[-1] < RANK * singular[0]:
        return (math.nan,) * values.ndim
    weights = np.linalg.solve(gram, np.array([_project(values, functions) for functions in basis]))
    # the basis is 1, then each axis in half-extents, x before y
    halves = [0.5 * (n - 1) * step for n, step in zip(values.shape, spacing, strict=True)]
    return tuple(float(w) / half for w, half in zip(weights[:0:-1], halves, strict=True))


def _basis(shape: tuple[int, ...], order: int) -> list[tuple[Array, ...]]:
    """Return products of Legendre polynomials on -1 ... 1 for each axis, ordered by degree, then y power."""
    axes = [np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, n), order).T for n in shape]
    powers = itertools.product(range(order + 1), repeat=len(shape))
    chosen = sorted((p for p in powers if sum(p) <= order), key=lambda p: (sum(p), p))
    return [tuple(axis[power] for axis, power in zip(axes, p, strict=True)) for p in chosen]


def _gram(basis: list[tuple[Array, ...]], observed: Array) -> Array:
    """Return the sums of products of the basis over the observed points."""
    complete = bool(observed.all())
    weight = np.ones(1) if complete else observed.astype(np.float64)
    gram = np.empty((len(basis), len(basis)))
    for (i, first), (j, second) in itertools.combinations_with_replacement(enumerate(basis), 2):
        functions = tuple(a * b for a, b in zip(first, second, strict=True))
        total = math.prod(float(f.sum()) for f in functions) if complete else _project(weight, functions)
        gram[i, j] = gram[j, i] = total
    return gram


def _project(values: Array, functions: tuple[Array, ...]) -> float:
    """Return the sum of values times the product of one function for each axis."""
    lines = np.einsum("...j,j->...", values, functions[-1])
    return float(lines if len(functions) == 1 else np.einsum("i,i->", lines, functions[0]))


def _subtract(values: Array, basis: list[tuple[Array, ...]], weights: Array) -> None:
    """Subtract the weighted sum of the basis, row by row: a second array of that size would be slower."""
    lines = values.reshape(-1, values.shape[-1])
    across = np.array(
        [w * np.ones(1) if len(f) == 1 else w * f[0] for w, f in zip(weights, basis, strict=True)]
    )
    along = np.array([f[-1] for f in basis])
    for line, factors in zip(lines, across.T, strict=True):
        line -= np.einsum("k,kx->x", factors, along)
