"""A surface with free edges as it is estimated: its heights, their cosine modes, and what is asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.dimensions import _cosine_modes
from fractalcontact.dimensions._block_modes import BlockModes
from fractalcontact.dimensions._harmonic_interpolation import Filling
from fractalcontact.dimensions._increment_moments import Moments
from fractalcontact.dimensions._increments import closed_form
from fractalcontact.dimensions._surface_input import Scales, Surface, between

Array = np.ndarray[Any, np.dtype[Any]]
SurfaceModes = _cosine_modes.FreeModes | BlockModes

LARGE = 1 << 20  # points of a surface beyond which modes are taken in blocks
_LARGE_GAPPED = 1 << 17  # the same of a surface with gaps
_ROUNDING = 1e-26  # relative rounding of the mean square in transforms
_SMALL_GAPS = 0.05  # share of the cells of a gridded surface


@dataclass(frozen=True)
class FreeEdges:
    """Heights with free edges, and what is asked for.

    Attributes
    ----------
    surface : Surface
    heights : ndarray, shape (ny, nx)
        Without the rows and columns at the border where nothing was observed.
    power : ndarray, optional
        Squared cosine modes; None with gaps.
    scales, noise
        As in `fractalcontact.dimensions.estimate`.
    spread : float, optional
        That of a known blur, in spacings of x.
    pilot : float
        First estimate of H.
    """

    surface: Surface
    heights: Array
    power: Array | None
    scales: Scales
    noise: bool
    spread: float | None
    pilot: float

    @property
    def is_default(self) -> bool:
        """Whether nothing is known of the window, the instrument, or the points that were gridded."""
        is_asked = self.scales is not None or self.spread is not None or self.noise
        return not (is_asked or self.surface.finest_scale)

    def modes(self) -> SurfaceModes:
        """Return the modes of the window; those of a large surface in blocks."""
        heights, power, spacing = self.heights, self.power, self.surface.plane_spacing
        dx = self.surface.spacing[1]
        window = None if self.scales is None else (self.scales[0] / dx, self.scales[1] / dx)
        if power is not None and heights.size > LARGE:
            return BlockModes.of(power, spacing, window)
        if power is None and heights.size >= _LARGE_GAPPED:
            return BlockModes.of_gapped(heights, spacing, window, self.pilot)
        lattice = _cosine_modes.Lattice.of((heights.shape[0], heights.shape[1]), spacing)
        chosen = between(_cosine_modes.wavelengths(lattice), window)
        return _cosine_modes.FreeModes.of(heights, lattice, chosen, self.pilot, power)


def is_separable(power: Array, heights: Array) -> bool:
    """Return whether no mode that varies along both axes is above rounding."""
    centred = heights - heights.mean()
    return float(power.sum()) <= _ROUNDING * float(np.sum(centred * centred))


def without_offsets(heights: Array) -> Array:
    """Subtract an offset of each row and each column, which the modes are insensitive to."""
    if np.isnan(heights).any():
        return heights
    return np.asarray(heights - heights.mean(axis=0) - heights.mean(axis=1, keepdims=True) + heights.mean())


def first_exponent(moments: Moments, spacing: tuple[float, float]) -> float:
    """Return a first estimate of H."""
    hurst = closed_form(moments, spacing, error=False).hurst
    return float(np.clip(hurst, 0.03, 0.98)) if np.isfinite(hurst) else 0.5


def without_small_gaps(heights: Array, spacing: tuple[float, float], most: float = _SMALL_GAPS) -> Array:
    """Fill the gaps of a gridded surface by harmonic interpolation, unless they are many.

    The model of the gaps has the short waves that gridding has removed; with it one fit in six of surfaces
    of H 0.9 did not converge. Only waves longer than most gaps are used. Nearest heights would meet in steps
    inside a larger hole, whose power falls as that of H = 0.5: with a hole of 3 % of the area they lowered H
    from 0.9 to 0.84.
    """
    observed = np.isfinite(heights)
    if not 0 < np.count_nonzero(~observed) <= most * heights.size:
        return heights
    values = heights[observed]
    return Filling(observed, spacing)(values - values.mean())


def cropped(heights: Array) -> Array:
    """Remove the rows and columns at the border where nothing was observed."""
    observed = np.isfinite(heights)
    rows, columns = np.flatnonzero(observed.any(axis=1)), np.flatnonzero(observed.any(axis=0))
    return heights[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
