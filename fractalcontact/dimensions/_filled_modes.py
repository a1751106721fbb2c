"""Modes of a surface with gaps: the gaps are filled, and what that does to the power is measured.

The filling is linear in the observed heights, but it lowers the power of short waves. Surfaces of Gaussian
modes with the expected power of a pilot get the same gaps and the same filling; the ratio of their power
after and before, in rings of wavenumber, corrects that of the surface. One treatment serves points, blocks,
rims and lines of gaps.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.dimensions._gaussian_mixture import Lattice

Array = np.ndarray[Any, np.dtype[Any]]

_SWEEPS = 12  # over missing points, after the pyramid: the fill of single points is then harmonic to 1 %
_SIMULATED = 1 << 18  # modes that are simulated: the correction scatters by a fifth of the error of H
_MOST = 8  # surfaces
_RINGS = 4  # per octave
_AZIMUTHS = 4  # from an axis to the diagonal: single points are filled from their neighbours along the axes


def fill(heights: Array) -> Array:
    """Return heights whose missing points have the mean of their surroundings, of the pyramid of 2 x 2 means.

    Some sweeps then move each missing point to the mean of its four neighbours.
    """
    observed = np.isfinite(heights)
    if observed.all():
        return heights
    if heights.shape[0] == 1:
        places = np.arange(heights.size)
        return np.asarray(np.interp(places, places[observed[0]], heights[observed])[None])
    filled = np.where(observed, heights, _coarse(np.where(observed, heights, 0.0), observed.astype(float)))
    rows, columns = np.nonzero(~observed)
    above, below = np.maximum(rows - 1, 0), np.minimum(rows + 1, heights.shape[0] - 1)
    left, right = np.maximum(columns - 1, 0), np.minimum(columns + 1, heights.shape[1] - 1)
    for _ in range(_SWEEPS):
        across = filled[above, columns] + filled[below, columns]
        filled[rows, columns] = 0.25 * (across + filled[rows, left] + filled[rows, right])
    return filled


def _coarse(values: Array, weights: Array) -> Array:
    """Return weighted means of 2 x 2 points where there are any, those of coarser levels elsewhere."""
    known = weights > 0.0
    if known.all() or max(values.shape) == 1:
        return np.asarray(np.divide(values, weights, out=np.zeros_like(values), where=known))
    padding = [(0, n % 2) for n in values.shape]
    coarse = []
    for each in (values, weights):
        padded = np.pad(each, padding)
        coarse.append(padded.reshape(padded.shape[0] // 2, 2, -1, 2).sum(axis=(1, 3)))
    mean = np.repeat(np.repeat(_coarse(*coarse), 2, axis=0), 2, axis=1)[: values.shape[0], : values.shape[1]]
    return np.asarray(np.divide(values, weights, out=mean.copy(), where=known))


def filling_ratio(lattice: Lattice, pilot: Array, observed: Array) -> Array:
    """Return the power of modes after filling over that before, for Gaussian modes of the pilot."""
    stream = np.random.default_rng(1)
    number = max(1, min(_MOST, math.ceil(_SIMULATED / pilot.size)))
    before, after = np.zeros_like(pilot), np.zeros_like(pilot)
    inner = (slice(None), slice(1, None)) if lattice.axes == 1 else (slice(1, None), slice(1, None))
    axes = (1,) if lattice.axes == 1 else (0, 1)
    size = math.prod(lattice.shape[-lattice.axes :])
    for _ in range(number):
        modes = np.zeros(lattice.shape)
        modes[inner] = np.sqrt(pilot) * stream.standard_normal(pilot.shape)
        heights = fft.dct(modes, 3, axes) / math.sqrt(2.0**lattice.axes * size)
        before += modes[inner] ** 2
        after += lattice.power(fill(np.where(observed, heights, np.nan)))
    ring = (_RINGS / math.log(2.0) * np.log(lattice.q / lattice.q.min()) + 1e-9).astype(np.int64)
    y, x = (np.abs(q) * d for q, d in zip(lattice.wavenumbers, lattice.spacing, strict=True))
    azimuth = np.arctan2(np.minimum(y[:, None], x), np.maximum(y[:, None], x))  # from the nearer axis
    ring = (
        _AZIMUTHS * ring + np.minimum(azimuth / (0.25 * math.pi) * _AZIMUTHS, _AZIMUTHS - 1).astype(int)
    ).ravel()
    filled, complete = (np.bincount(ring, (power / pilot).ravel()) for power in (after, before))
    ratio = np.divide(filled, complete, out=np.ones_like(filled), where=complete > 0.0)
    return np.asarray(np.maximum(ratio, 1e-12)[ring].reshape(pilot.shape))
