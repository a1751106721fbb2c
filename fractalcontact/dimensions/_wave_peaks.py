"""Modes of a tapered surface or profile that stand above those around them: strong single waves.

A mode of a Gaussian surface over the mean of its neighbours is an exponential number; a single wave stands
far above them. This is the test of Fisher (1929) with the mean of the ring of equal wavenumber, corrected by
that of the modes around, in place of the mean of all modes: the spectrum may have any form, and a lay.
"""

from __future__ import annotations

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
RADIAL = np.arange(3, 13)  # modes from one along the ray through it that are compared with it, on either side
CLIPPED = 8.0  # times the mean: neighbours count up to here, for there may be other waves
ROUNDING = 1e-22  # of the strongest mode
_ABOVE_RAY = 15.0  # times their mean: a step or ridges put much power on a ray, and no wave
_LEAST_SHARE = 1e-5  # of the mean square increment: less changes no estimate
_FREEDOM = {1: 9.0, 2: 30.0}  # independent neighbours, by the number of axes; fewer than modes, for the taper
_PASSES = 3
_MULTIPLE_WIDTH, _LEAST_RAY = 2.0, 5  # modes beside a multiple that it changes, and modes that must be left


def tapered_peaks(
    tapered: Array, spacing: tuple[float, float], axes: int, multiples: Array
) -> list[tuple[tuple[float, float], float]]:
    """Return the cycles per point (y, x) and the p value of the modes that stand out.

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
        shorter = white[0, column + RADIAL[0] : column + ALONG // 2]
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
    rays = np.stack([y[places[:, 0]] * ny, x[places[:, 1]] * nx], axis=1)
    places = places[multiples[tuple(places.T)] | _above_rays(white, places, rays)]
    return [
        (
            (float(y[row]), float(x[column])),
            float(
                min(
                    1.0,
                    counts[int(multiples[row, column])] * (1.0 + ratio[row, column] / freedom) ** -freedom,
                )
            ),
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


def _above_rays(white: Array, places: Array, rays: Array) -> Array:
    """Return which modes stand above both parts of the ray through them; `rays` are their mode numbers.

    The multiples of a mode, as those of cusps, are left out of its ray, unless little of it would be left.
    """
    if not len(places):
        return np.zeros(0, dtype=bool)
    peaks = white[tuple(places.T)]
    distance = np.hypot(*rays.T)[:, None]
    along = rays / distance
    beyond = np.abs(RADIAL - distance * np.maximum(np.rint(RADIAL / distance), 1.0)) > _MULTIPLE_WIDTH
    beyond |= np.count_nonzero(beyond, axis=1, keepdims=True) < _LEAST_RAY
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) * (min(white.shape) > 1)
    means = []
    for side in (-1, 1):
        at = places[:, None, None] + side * RADIAL[:, None, None] * along[:, None, None]
        at = np.rint(at + np.arange(-1, 2)[:, None] * across[:, None, None]).astype(np.int64)
        ray = white[at[..., 0] % white.shape[0], at[..., 1] % white.shape[1]]
        if side > 0:
            ray = ray * beyond[:, :, None]
        number = np.maximum(np.count_nonzero(ray, axis=(1, 2)), 1)
        means.append(np.minimum(ray, 0.25 * peaks[:, None, None]).sum(axis=(1, 2)) / number)
    return np.asarray(peaks > _ABOVE_RAY * np.maximum(*means))
