"""Gaps that depend on the height: valleys too deep, or peaks too high, for an instrument.

Where heights beyond a limit are missing, the heights beside gaps lie beyond those around them. Of the others
near the limit only those are left that deviate to one side, so that neighbours differ less than they did.
Whether a height is kept must not depend on its own deviation: where the mean of the surroundings is near the
limit, all heights are left out.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.dimensions._surface_input import Surface

Array = np.ndarray[Any, np.dtype[Any]]

_CLEAR = 4.5  # z of the heights beside gaps beyond which the gaps depend on the height
_AROUND = 4  # points to each side of a height with which it is compared
_LEAST, _MOST = 25, 0.6  # points beside gaps, and share of the points that may be missing afterwards
_SPREAD = 3.0  # points: standard deviation of the weights of the mean of the surroundings
_LEAST_WEIGHT = 1e-3  # of that mean
_DISTANCE = 1.7  # rms increments from the limit to the nearest mean that is kept
_LIMIT = 0.25  # quantile of the heights beside gaps, near the limit


def without_height_gaps(surface: Surface) -> tuple[Surface, str]:
    """Return a surface without the heights near the limit beyond which they are missing, and a note.

    Itself if the gaps do not depend on the height, of a profile, and of one gridded from points.
    """
    if surface.axes == 1 or surface.is_lazy or surface.finest_scale or surface.is_complete:
        return surface, ""
    heights = surface.heights
    observed = np.isfinite(heights)
    beside = beside_gaps(observed)
    if beside.sum() < _LEAST or min(heights.shape) <= 2 * _AROUND + 1:
        return surface, ""
    z = beyond_z(heights, beside)
    if abs(z) < _CLEAR:
        return surface, ""
    sign = -np.sign(z)  # valleys are missing: below the limit
    values = sign * (heights - heights[observed].mean())
    mean = _surroundings(values, observed)
    increment = float(np.sqrt(np.nanmean(np.diff(heights, axis=1) ** 2)))
    limit = float(np.quantile(values[beside], _LIMIT)) + _DISTANCE * increment
    missing = ~observed | (mean < min(limit, float(np.quantile(mean, _MOST))))
    word, side = ("low", "below") if sign > 0 else ("high", "above")
    note = (
        f"{word} heights are missing: those beside gaps lie {abs(z):.1f} standard "
        f"deviations {side} the ones around them; where the surroundings are near "
        f"the limit, {100.0 * float(np.mean(missing & observed)):.2g} % more are left out, for only one side "
        "of their scatter is left"
    )
    cut = np.where(missing, np.nan, heights)
    return surface.with_heights(cut), note


def beside_gaps(observed: Array) -> Array:
    """Return the observed points beside gaps; not those that reach the border, which has its own reasons."""
    from scipy.ndimage import binary_dilation, label

    gaps = label(~observed)[0]
    border = np.concatenate([gaps[0], gaps[-1], gaps[:, 0], gaps[:, -1]])
    inside = ~observed & np.isin(gaps, np.unique(border), invert=True)
    return np.asarray(observed & binary_dilation(inside, np.ones((3, 3))))


def beyond_z(heights: Array, beside: Array) -> float:
    """Return z of the mean of the heights beside gaps over those around each of them.

    Its deviation is that of the same sum elsewhere: over all places of the gaps in the surface, which is
    continued by reflection, so that it holds for any spectrum.
    """
    observed = np.isfinite(heights)
    level = _without_form(heights, observed)
    density = np.maximum(_mean(observed.astype(float), _AROUND), 1e-9)
    weights = beside - observed * _mean(beside / density, _AROUND)
    filled = np.where(observed, level, _surroundings(level, observed))
    shape = 2 * heights.shape[0], 2 * heights.shape[1]
    reflected = np.concatenate([filled, filled[:, ::-1]], axis=1)
    reflected = np.concatenate([reflected, reflected[::-1]])
    product = np.conj(fft.rfft2_padded(weights, shape)) * fft.rfft2_padded(reflected, shape)
    sums = fft.irfft2_cropped(product, shape, shape)
    square = float(np.mean(sums * sums))
    return float(sums[0, 0] / np.sqrt(square)) if square > 0.0 else 0.0


def _without_form(heights: Array, observed: Array) -> Array:
    """Subtract the polynomial of order 2 that fits the observed heights best; 0 where they are missing."""
    y, x = np.meshgrid(*(np.linspace(-1.0, 1.0, n) for n in heights.shape), indexing="ij")
    columns = np.stack([np.ones(y.shape), y, x, y * y, y * x, x * x])
    known = columns[:, observed]
    factors = np.linalg.lstsq(known @ known.T, known @ heights[observed], rcond=None)[0]
    return np.where(observed, heights - np.tensordot(factors, columns, 1), 0.0)


def _surroundings(values: Array, observed: Array) -> Array:
    """Return the weighted mean of the observed points around each; far from all of them it falls to 0."""
    from scipy.ndimage import gaussian_filter

    weight = np.maximum(gaussian_filter(observed.astype(float), _SPREAD), _LEAST_WEIGHT)
    return np.asarray(gaussian_filter(np.where(observed, values, 0.0), _SPREAD) / weight)


def _mean(values: Array, reach: int) -> Array:
    """Return the mean of the points up to `reach` to each side, the border reflected."""
    from scipy.ndimage import uniform_filter

    return np.asarray(uniform_filter(values, 2 * reach + 1))
