"""Squared cosine modes of the complete surface, from those of one with gaps that were filled.

Filling takes power from some modes and adds to others, by an amount that depends on the gaps and on the
spectrum. A surface with the same spectrum and random phases, of which the same points are left out and
filled, shows how much. Its spectrum is that of the surface itself, ring by ring of equal wavenumber, which is
corrected and used again. No family is assumed: the modes can be compared with any, as those of a complete
surface.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.dimensions._cosine_modes import Lattice, expected_power, wavelengths
from fractalcontact.dimensions._harmonic_interpolation import Filling
from fractalcontact.dimensions._mode_blocks import block_starts

Array = np.ndarray[Any, np.dtype[Any]]

MOST_MISSING = 0.5  # share of the points
_PER_OCTAVE = 6  # rings
_FEW_POINTS = 1 << 17  # of a surface, below which the modes are so few that their ratio scatters
_PER_SHARE, _SMALL, _MOST = 30.0, 1 << 14, 16  # surfaces with random phases: over the share of missing points
_ROUNDS = 4, 2  # of the correction, of a surface of few points and of a larger one
_LEAST = 0.01  # of the power of the complete surface over that of the filled one
_DOUBT = 3  # power of the filled over the restored power by which a mode counts less (2: its scatter alone)
_FEW_MODES = 80.0  # of a block, times the surfaces, below which the ratio is rather that of the ring
_SEED = 20261122


def restored_power(
    heights: Array, lattice: Lattice, pilot: float, filling: Filling | None = None
) -> tuple[Array, Array]:
    """Return the squared modes that vary along both axes, and how much a mode counts.

    Parameters
    ----------
    heights : ndarray, shape (ny, nx)
        NaN where they are missing.
    lattice : Lattice
    pilot : float
        A Hurst exponent whose spectrum is the first guess.
    filling : Filling, optional
        That of the gaps, if it is at hand.

    Returns
    -------
    power : ndarray, shape (ny - 1, nx - 1)
    share : ndarray, shape (ny - 1, nx - 1)
        Information of a mode over that of one of a complete surface: the share of observed points, and less
        where most of the power is that of the filling.
    """
    observed = np.isfinite(heights)
    filling = Filling(observed, lattice.spacing) if filling is None else filling
    filled = _modes(filling(heights - heights[observed].mean())) ** 2
    order = -np.log(wavelengths(lattice))
    ring = np.floor(_PER_OCTAVE / np.log(2.0) * (order - order.min()) + 1e-9).astype(int)
    ring = (np.cumsum(np.bincount(ring.ravel()) > 0) - 1)[ring.ravel()]  # without empty ones
    count = np.bincount(ring)
    centres = np.bincount(ring, order.ravel()) / count

    def mean(power: Array) -> Array:
        return np.asarray(np.bincount(ring, power[1:, 1:].ravel()) / count)

    kept = float(np.mean(observed))
    is_large = heights.size >= _FEW_POINTS
    number = (
        1 if is_large else min(1 + round(_PER_SHARE * (1.0 - kept) * max(1.0, _SMALL / heights.size)), _MOST)
    )
    rng = np.random.default_rng(_SEED)
    signs = [rng.integers(0, 2, heights.shape, dtype=np.int8) * 2 - 1 for _ in range(number)]
    power = filled.copy()  # offsets of rows and columns leak through the gaps
    first, again = np.maximum(expected_power(lattice, pilot), 0.0), power
    of_filled = mean(filled)
    level = of_filled / np.bincount(ring, first.ravel()) * count
    for _ in range(_ROUNDS[is_large]):
        power[1:, 1:] = first * np.exp(np.interp(order, centres, np.log(level)))
        root = np.sqrt(power)
        again = np.mean([_modes(filling(_heights(root * sign))) ** 2 for sign in signs], axis=0)
        of_power = mean(power)
        leak = mean(again) - kept * of_power  # from other rings: it hardly depends on this one
        level *= np.maximum((of_filled - leak) / kept, _LEAST * of_filled) / of_power
    # that of a block of modes, where these are many, and else of the ring
    of_ring = np.exp(np.interp(order, centres, np.log(mean(again) / of_power)))
    of_block, modes = _of_blocks(again[1:, 1:] / power[1:, 1:], lattice.shape)
    ratio = of_ring + (of_block - of_ring) * modes / (modes + _FEW_MODES / number)
    return filled[1:, 1:] / ratio, kept**2 / np.maximum(ratio, 1.0) ** _DOUBT


def _of_blocks(values: Array, shape: tuple[int, int]) -> tuple[Array, Array]:
    """Return the mean of the modes in each block of neighbouring ones, and their number."""
    number = np.ones((1, 1))
    for axis, starts in enumerate(block_starts(n, 1) for n in shape):
        width = np.expand_dims(np.diff(starts), 1 - axis)
        mean = np.add.reduceat(values, starts[:-1] - 1, axis=axis) / width
        values = np.repeat(mean, width.ravel(), axis=axis)
        number = number * np.repeat(width, width.ravel(), axis=axis)
    return values, number


def _modes(heights: Array) -> Array:
    """Return the cosine modes, orthonormal but for those without waves along an axis."""
    return np.asarray(fft.dct(heights, 2, (0, 1)) / (2.0 * np.sqrt(heights.size)))


def _heights(modes: Array) -> Array:
    """Return the heights with given `_modes`."""
    return np.asarray(fft.dct(modes, 3, (0, 1)) / (2.0 * np.sqrt(modes.size)))
