"""Hurst exponent octave by octave of wavelength, beside that of the whole surface."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.labelled import leading_coords
from fractalcontact.base.numbers import Array
from fractalcontact.base.resources import has_blocks
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.dimensions._gaussian_mixture import ALIASED, Bins, Lattice, weights
from fractalcontact.dimensions._likelihood import likelihood
from fractalcontact.dimensions._mode_fit import first_fit
from fractalcontact.dimensions._records import NORMAL
from fractalcontact.dimensions._spectral_posterior import HIGHEST, LOWEST, SPREAD
from fractalcontact.dimensions._surface_input import Surface, check_surface, read_surfaces

_MOST_MISSING = 0.5  # share of the heights
_LEAST_MODES, _LEAST_BINS = 12, 2  # of an octave
_EXPONENTS = np.linspace(-2.0, 4.0, 1201)  # that are compared: between them chi square is a parabola
_FIELDS = ("hurst", "ci_low", "ci_high")
_OF_WINDOW = (*(f"window_{name}" for name in _FIELDS), "scale_min", "scale_max")
_NAMES = (*_FIELDS, "mode_count", "in_window", "wavelength", *_OF_WINDOW, "run_time")


def _check(problems: Problems) -> None:
    surface = problems.given.surface
    is_valid = check_surface(problems, smallest=16, reserved=_NAMES)
    if is_valid and not has_blocks(surface):
        most = float(surface.isnull().mean([dim for dim in ("y", "x") if dim in surface.dims]).max())
        problems.require(most <= _MOST_MISSING, "surface", "at least half of the heights", f"{1 - most:.0%}")


@public_result(
    title="Hurst exponent against scale",
    references="Whittle (1957), J. R. Stat. Soc. B 19",
    check=_check,
    memory=195.0,
)
def scaling(surface: xr.DataArray) -> xr.Dataset:
    """Return the Hurst exponent of every octave of wavelength, beside that of the whole surface.

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., y, x), or (..., x) for a profile, at least 16 points along each axis. NaN
        marks missing points, at most half of them.

    Returns
    -------
    Dataset over `wavelength` (m, the middle of an octave)
        `hurst` of the waves of the octave, with its 95 % interval `ci_low`, `ci_high`, and `mode_count`.
        The exponents are not limited: long waves of white noise have -1 (a profile -0.5), waves as short as
        the blur of an instrument more than 1. NaN where an octave has fewer than 12 modes.
        `window_hurst`, `window_ci_low`, `window_ci_high`, `scale_min` and `scale_max` (m) are the exponent of
        `estimate` and the waves that its model describes, with blur and noise; `in_window` marks their
        octaves. The attribute `reason` states why there is no interval.

    Raises
    ------
    InvalidInput
        More heights are missing, an axis is not uniform, or an axis has fewer than 16 points.

    Notes
    -----
    Bins of modes and their expected power are those of `estimate`; the octaves count without blur and noise,
    which they are there to show.

    References
    ----------
    Whittle (1957), J. R. Stat. Soc. B 19.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((128, 128), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1)
    >>> result = fc.dimensions.scaling(surface)
    >>> bool(result.in_window[:4].all()), round(float(result.window_hurst), 1)
    (True, 0.7)
    """
    surfaces = read_surfaces(surface)
    first = surfaces[0]
    octaves = _Octaves.of(first)
    records = [_record(single, octaves) for single in surfaces]
    leading = surface.dims[: surface.ndim - first.axes]
    sizes = [surface.sizes[dim] for dim in leading]

    def stacked(values: Sequence[Any], *dims: str) -> tuple[tuple[Any, ...], Array]:
        array = np.asarray(values)
        return (*leading, *dims), array.reshape((*sizes, *array.shape[1:]))

    data = {
        name: stacked([record.fits[:, k] for record in records], "wavelength")
        for k, name in enumerate(_FIELDS)
    }
    data["mode_count"] = stacked([record.modes for record in records], "wavelength")
    data["in_window"] = stacked([record.in_window for record in records], "wavelength")
    for k, name in enumerate(_OF_WINDOW):
        data[name] = stacked([record.whole[k] for record in records])
    coords = {**leading_coords(surface, leading, _NAMES), "wavelength": octaves.middle * first.spacing[1]}
    result = xr.Dataset(data, coords=coords)
    if reasons := dict.fromkeys(record.reason for record in records if record.reason):
        for name in ("window_ci_low", "window_ci_high"):
            result[name].attrs["reason"] = "; ".join(reasons)
    return result


@dataclass(frozen=True)
class _Octaves:
    """Octaves of wavelength from two spacings on, the first with all shorter waves; lengths in x spacings."""

    shortest: float
    number: int

    @classmethod
    def of(cls, surface: Surface) -> _Octaves:
        """Return the octaves of the modes of a surface."""
        lattice = Lattice(surface.shape, surface.plane_spacing)
        shortest = 2.0 * max(lattice.spacing)
        return cls(shortest, int(math.log2(2.0 * lattice.longest / shortest)) + 1)

    def index(self, lnq: Array) -> Array:
        """Return the octave of waves with a logarithm of the wavenumber."""
        octave = (math.log(2.0 * np.pi / self.shortest) - lnq) / math.log(2.0)
        return np.clip(np.floor(octave + 1e-9), 0, self.number - 1).astype(np.int64)

    @property
    def middle(self) -> Array:
        return np.asarray(self.shortest * 2.0 ** (np.arange(self.number) + 0.5))


@dataclass(frozen=True)
class _Record:
    """Exponents of the octaves of one surface, each with its interval, and `_OF_WINDOW` of the whole."""

    fits: Array
    modes: Array
    in_window: Array
    whole: tuple[float, ...]
    reason: str


def _record(surface: Surface, octaves: _Octaves) -> _Record:
    """Fit the octaves of one surface."""
    none, fits = np.zeros(octaves.number, dtype=np.int64), np.full((octaves.number, 3), np.nan)
    first = None if surface.is_constant or surface.is_plane else first_fit(surface)
    fit = None if first is None else first.modes
    if fit is None or not fit.keep.any():
        return _Record(fits, none, none > 0, (math.nan,) * len(_OF_WINDOW), "")
    bins = fit.bins(fit.keep)
    owner, mode_owner = octaves.index(bins.lnq), octaves.index(np.log(fit.lattice.q[fit.keep]))
    modes = np.bincount(mode_owner, minlength=octaves.number)
    is_there = (modes >= _LEAST_MODES) & (np.bincount(owner, minlength=octaves.number) >= _LEAST_BINS)
    whole = likelihood(surface, None, None).gridded(surface.finest_scale).limited()
    form, theta = fit.form, fit.theta
    if whole.posterior is not None:  # of the fit that `window_hurst` is from
        hypothesis, _, theta = whole.posterior.most_probable
        form = hypothesis.form
    logs = _log_power(bins, form if theta[SPREAD] == 0.0 else ALIASED)
    for k in np.flatnonzero(is_there):
        fits[k] = _fitted(bins, logs, owner == k)
    lengths = octaves.middle * surface.spacing[1]
    in_window = (lengths >= whole.scale_min / 2.0**0.5) & (lengths <= whole.scale_max * 2.0**0.5)
    ends = whole.hurst, whole.ci_low, whole.ci_high, whole.scale_min, whole.scale_max
    return _Record(fits, modes, in_window, ends, whole.reason)


def _log_power(bins: Bins, form: int) -> Array:
    """Return the logarithm of the expected power of the bins for each exponent, shape (exponents, bins).

    Beyond those of fractals it is continued as a power law.
    """
    logs = np.empty((_EXPONENTS.size, bins.level.size))
    for row, hurst in zip(logs, _EXPONENTS, strict=True):
        inside = min(max(float(hurst), LOWEST), HIGHEST)
        weight = weights(inside, bins.t, form, bins.axes)
        row[:] = np.log(bins.tables[form, 0] @ weight) - 2.0 * (hurst - inside) * bins.lnq
    return logs


def _fitted(bins: Bins, logs: Array, chosen: Array) -> tuple[float, float, float]:
    """Return the exponent of some bins and its interval: chi square of each, at its best amplitude."""
    weight = 1.0 / bins.variance[chosen]
    residual = bins.level[chosen] - logs[:, chosen]
    residual -= (residual @ weight / weight.sum())[:, None]
    chi_square = np.square(residual) @ weight
    k = int(np.clip(np.argmin(chi_square), 1, _EXPONENTS.size - 2))
    step = _EXPONENTS[1] - _EXPONENTS[0]
    before, here, after = chi_square[k - 1 : k + 2]
    shift = 0.5 * (before - after) / max(before - 2.0 * here + after, 1e-300)
    limit = here + NORMAL**2
    low = float(np.interp(-limit, -chi_square[: k + 1], _EXPONENTS[: k + 1]))
    high = float(np.interp(limit, chi_square[k:], _EXPONENTS[k:]))
    return float(_EXPONENTS[k] + step * np.clip(shift, -1.0, 1.0)), low, high
