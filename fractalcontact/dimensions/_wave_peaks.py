"""Modes of a tapered surface or profile that stand above those around them: strong single waves.

A mode of a Gaussian surface over the mean of its neighbours is an exponential number; a single wave stands
far above them. This is the test of Fisher (1929) with the mean of the ring of equal wavenumber, corrected by
that of the modes around, in place of the mean of all modes: the spectrum may have any form, and a lay.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from fractalcontact.base import fft

Array = np.ndarray[Any, np.dtype[Any]]

FALSE_ALARM = 1e-3  # probability of a wave in a surface that has none
LONGEST = {1: 12.0, 2: 4.0}  # wavenumber steps: longer waves are not told from the form, by number of axes
# a longer wave of a profile is found if it runs through it so often, and is so many times above the limit
_FEW_WAVES, _STRONG = 7.0, 3.0
# edges of the squares of modes around one: its neighbours, and itself with its taper
NEIGHBOURS, LINE = 13, 5
ALONG = 41  # neighbours of a mode of a profile
BESIDE = np.arange(3, 13)  # modes from one, on the lines through it, that are compared with it on either side
_SIDES = np.arange(-1, 2)  # lines of modes side by side
_ARC = 1.2  # radians on either side: further on is the mirror image of a mode
_DIRECTIONS = np.pi * np.arange(24) / 24
# modes on a line count up to so many times their third decile: there may be other waves, as its multiples
_DECILE, _OUTLYING = 0.3, 8.0
_ABOVE_LINE = 8.0  # least power of a wave, times the mean of the strongest line of a surface without ridges
_LINE, _RIDGE = 1.75, 3.0  # mean of the strongest line: of any surface, and of a ridge
_FREEDOM_OF_LINE = 6.0  # of the mean of its modes
CLIPPED = 8.0  # times the mean: neighbours count up to here, for there may be other waves
ROUNDING = 1e-22  # of the strongest mode
_LEAST_SHARE = 1e-5  # of the mean square increment: less changes no estimate
_FREEDOM = {1: 9.0, 2: 30.0}  # independent neighbours, by the number of axes; fewer than modes, for the taper
_PASSES = 3
_MULTIPLE_WIDTH, _LEAST_RAY = 1.6, 2  # modes beside a multiple that it changes, and modes that must be left


@dataclass(frozen=True)
class Peak:
    """A mode that may be a wave.

    Attributes
    ----------
    ratio : float
        Power over the expected one, or that of the modes around.
    p_value : float
    cycles : (y, x)
        Per point.
    """

    ratio: float
    p_value: float
    cycles: tuple[float, float]


def tapered_peaks(tapered: Array, spacing: tuple[float, float], axes: int, multiples: Array) -> list[Peak]:
    """Return the modes that stand out.

    Those of `multiples` are tested among themselves, and not against the ray through them.
    """
    from scipy.ndimage import uniform_filter

    ny, nx = tapered.shape
    half = fft.rfft2(tapered)
    right = half.real**2
    right += half.imag**2
    # the whole plane of modes, which has period (ny, nx)
    power = np.empty((ny, nx))
    last = nx // 2
    power[:, : last + 1] = right
    power[0, last + 1 :] = right[0, nx - last - 1 : 0 : -1]
    power[1:, last + 1 :] = right[:0:-1, nx - last - 1 : 0 : -1]
    y, x = np.fft.fftfreq(ny), np.fft.fftfreq(nx)
    radius, ring = _plane((ny, nx), spacing, axes)
    # beyond a cut-off there is only rounding, which is no neighbour of a wave
    power[power <= ROUNDING * power.max()] = 0.0
    white = _whitened(power, radius, ring, axes)
    wide, narrow = ((NEIGHBOURS, LINE), (ALONG, LINE))[axes == 1]
    sizes = [(1, edge) if axes == 1 else (edge, edge) for edge in (wide, narrow)]
    clipped = uniform_filter(white, sizes[0], mode="wrap")
    clipped *= CLIPPED
    np.minimum(clipped, white, out=clipped)

    def around(values: Array) -> Array:
        outer, inner = (uniform_filter(values, size, mode="wrap") for size in sizes)
        outer *= float(np.prod(sizes[0]))
        inner *= float(np.prod(sizes[1]))
        return np.asarray(outer - inner)

    total = around(clipped)
    if power.min() > 0.0:
        number = np.array(float(np.prod(sizes[0]) - np.prod(sizes[1])))
    else:
        number = around((power > 0.0).astype(float))
    is_surrounded = (number > 0.1 * np.prod(sizes[0])) & (total > np.finfo(float).tiny)
    ratio = np.divide(white * number, total, out=np.zeros_like(white), where=is_surrounded)
    # a long wave of a profile has its mirror image among the modes around it: the shorter ones are taken,
    # whose power law is not known so well, and only a strong wave is told from it
    for column in (
        np.flatnonzero((radius[0] >= _FEW_WAVES) & (radius[0] < LONGEST[axes])) if axes == 1 else ()
    ):
        shorter = white[0, column + BESIDE[0] : column + ALONG // 2]
        ratio[0, column] = white[0, column] / max(float(shorter.mean()), np.finfo(float).tiny)
    freedom = _FREEDOM[axes]
    counts = 0.5 * power.size, 0.5 * max(1, int(np.count_nonzero(multiples)))
    limits = [freedom * ((count / FALSE_ALARM) ** (1.0 / freedom) - 1.0) for count in counts]
    places = np.argwhere(ratio > limits[int(multiples.any())])
    places = places[places[:, 1] <= last]
    at = tuple(places.T)
    is_long = radius[at] < LONGEST[axes]
    least = np.where(multiples[at], limits[1], limits[0]) * np.where(is_long, _STRONG, 1.0)
    is_allowed = ~is_long | ((radius[at] >= _FEW_WAVES) & (axes == 1))
    places = places[is_allowed & (ratio[at] > least)]
    places = places[[_is_largest(power, place, sizes[1]) for place in places]]
    if not len(places):
        return []
    share = power * (2.0 - np.cos(2.0 * np.pi * y)[:, None] - np.cos(2.0 * np.pi * x))
    places = places[share[tuple(places.T)] > _LEAST_SHARE * share.sum()]
    on_edge = (places[:, 1] == 0) | (2 * places[:, 1] == nx)  # both signs of y are the same wave there
    places = places[~on_edge | (y[places[:, 0]] >= 0.0)]
    extent = np.array([n * d if n > 1 else 0.0 for n, d in zip((ny, nx), spacing, strict=True)])

    def is_above_lines(row: int, column: int) -> bool:
        bound, level = 0.25 * white[row, column], white[row, column] / ratio[row, column]
        mode = np.array([y[row] * ny, x[column] * nx])
        least = least_beside(
            lambda rows, columns: np.minimum(white[rows % ny, columns % nx], bound) / level,
            mode,
            extent,
            len(places),
            anywhere=True,
        )
        return bool(ratio[row, column] > least)

    places = places[[multiples[row, column] or is_above_lines(row, column) for row, column in places]]
    return [
        Peak(
            float(ratio[row, column]),
            float(
                min(
                    1.0,
                    counts[int(multiples[row, column])] * (1.0 + ratio[row, column] / freedom) ** -freedom,
                )
            ),
            (float(y[row]), float(x[column])),
        )
        for row, column in places
    ]


def _is_largest(power: Array, place: Array, size: tuple[int, int]) -> bool:
    """Return whether no mode around one has more power."""
    around = np.ix_(*(at + np.arange(edge) - edge // 2 for at, edge in zip(place, size, strict=True)))
    return bool(
        power[place[0], place[1]]
        == power[tuple(i % n for i, n in zip(around, power.shape, strict=True))].max()
    )


@lru_cache(maxsize=1)
def _plane(shape: tuple[int, int], spacing: tuple[float, float], axes: int) -> tuple[Array, Array]:
    """Return the wavenumber of the modes in steps of the shortest extent, and the number of their ring."""
    y, x = (np.fft.fftfreq(n) / d for n, d in zip(shape, spacing, strict=True))
    extent = min(n * d for n, d in zip(shape[-axes:], spacing[-axes:], strict=True))
    radius = np.hypot(y[:, None], x) * extent
    return radius, np.rint(radius).astype(np.int64).ravel()


def _whitened(power: Array, radius: Array, ring: Array, axes: int) -> Array:
    """Return the modes over the mean of their ring; those of a profile over a power law."""
    if axes == 1:
        return np.asarray(power * (radius / radius.max()) ** 2)
    number = np.maximum(np.bincount(ring, (power > 0.0).ravel()), 1)
    clipped, white = power, power
    for _ in range(_PASSES):  # a wave raises the mean of its ring, unless it is clipped
        level = np.maximum(np.bincount(ring, clipped.ravel()) / number, np.finfo(float).tiny)
        expected = np.exp(np.interp(radius, np.arange(level.size), np.log(level)))
        white = power / expected
        clipped = np.minimum(white, CLIPPED) * expected
    return np.asarray(white)


def least_beside(
    modes_at: Callable[[Array, Array], Array], mode: Array, extent: Array, places: int, *, anywhere: bool
) -> float:
    """Return the power that a wave needs, from the modes on lines through it: ridges and arcs are no waves.

    Parameters
    ----------
    modes_at : callable
        Power of the modes at rows and columns, over the mean of those around the wave.
    mode : ndarray, (row, column)
        Of the wave, with signs.
    extent : ndarray, (y, x)
        Of the surface; 0 along y of a profile.
    places : int
        Among which this is one: all modes of ridges are exponential numbers of the mean of their line.
    anywhere : bool
        Lines in all directions: the ray of a ridge that is drawn with steps is folded at two spacings, and
        no longer runs through the wavenumber zero.
    """
    distance = float(np.hypot(*mode))
    along = mode / distance
    other = np.abs(BESIDE - distance * np.maximum(np.rint(BESIDE / distance), 1.0)) > _MULTIPLE_WIDTH
    other |= np.count_nonzero(other) < _LEAST_RAY
    both = np.concatenate([-BESIDE, BESIDE])
    lines = [-BESIDE[:, None] * along, BESIDE[other, None] * along]
    is_surface = extent[0] > 0.0
    if is_surface:
        turned = mode[::-1] * extent / extent[::-1] * (1.0, -1.0)
        angles = both / np.hypot(*turned)
        angles = angles[np.abs(angles) < _ARC, None]
        if len(angles) > len(BESIDE):  # a shorter arc is that of a long wave
            lines.append(mode * (np.cos(angles) - 1.0) + turned * np.sin(angles))
        if anywhere:
            lines += [both[:, None] * (np.sin(angle), np.cos(angle)) for angle in _DIRECTIONS]
    mean = max(_mean_on_line(modes_at, mode, line, is_surface) for line in lines)
    above_ridge = _FREEDOM_OF_LINE * ((places / FALSE_ALARM) ** (1.0 / _FREEDOM_OF_LINE) - 1.0)
    return mean * float(np.interp(mean, (_LINE, _RIDGE), (_ABOVE_LINE, above_ridge)))


def _mean_on_line(
    modes_at: Callable[[Array, Array], Array], mode: Array, steps: Array, is_surface: bool
) -> float:
    """Return the mean power at some steps from a mode, near ones with more weight; or beside."""
    distance = np.hypot(*steps.T)[:, None]
    across = np.stack([-steps[:, 1], steps[:, 0]], axis=1) / distance * np.sign(steps @ steps[-1])[:, None]
    sides = _SIDES if is_surface else _SIDES[1:2]
    places = np.rint(mode + steps + sides[:, None, None] * across).astype(np.int64)
    power = modes_at(places[..., 0], places[..., 1])
    low = np.quantile(power, _DECILE, axis=1, keepdims=True)
    power = np.minimum(power, np.where(low > 0.0, _OUTLYING * low, np.inf))
    weights = (power > 0.0) / distance[:, 0]
    return float(((power * weights).sum(axis=1) / np.maximum(weights.sum(axis=1), 1e-9)).max())
