"""Random midpoint displacement: fast, widely used, and not a fractional Brownian surface."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.numbers import Array
from fractalcontact.base.results import public_result
from fractalcontact.base.rng import RNGLike
from fractalcontact.base.schema import HURST_RANGE
from fractalcontact.base.validation import Problems
from fractalcontact.surfaces import _from_array

FOURNIER = (
    "Fournier, Fussell and Carpenter, Computer rendering of stochastic models, Communications of the ACM 25 "
    "(1982) 371-384; Saupe, Algorithms for random fractals, The Science of Fractal Images (Springer, 1988)"
)


Points = Sequence[tuple[float, float]]


def _check(problems: Problems) -> None:
    _from_array.check_axes(problems, profile=False)
    problems.number("hurst", **HURST_RANGE)
    _from_array.check_length(problems, "rms_increment")
    problems.boolean("additions")
    _from_array.check_ensemble(problems)


@public_result(
    title="Surface by random midpoint displacement", references=FOURNIER, check=_check, memory=17.0
)
def midpoint(
    shape: Sequence[int],
    spacing: float | Sequence[float],
    *,
    hurst: float,
    rms_increment: float,
    additions: bool = False,
    members: int | None = None,
    rng: RNGLike = None,
) -> xr.DataArray:
    """Return a surface by random midpoint displacement.

    Many published surfaces were made this way; use it to reproduce them and to measure how estimators
    respond. Its increments are neither stationary nor isotropic: use `fbm` where the exponent matters.

    Parameters
    ----------
    shape : (ny, nx)
        Points along each axis, at least 3: a corner of the square of 2^k + 1 points that contains them.
    spacing : float, or (y, x)
        Distance between points in metres.
    hurst : float
        Hurst exponent, 0.01 to 0.99.
    rms_increment : float
        Intended root mean square height difference (m) of points one x spacing apart.
    additions : bool
        Displace the existing points too at every stage (successive random additions).
    members : int, optional
        Number of independent surfaces, along a dim `member`. Member i is the same for any number of them.
    rng : None, int, SeedSequence, BitGenerator or Generator
        Random stream (SPEC 7), or `json.loads(surface.attrs["provenance"])["random"]` of an earlier surface.

    Returns
    -------
    DataArray
        `height` with dims ([member,] y, x) in metres; without additions the first point has height 0.

    Raises
    ------
    InvalidInput
        An argument is out of range.

    Notes
    -----
    The mean square increments over 1 to 64 equal spacings along x are too great by up to a factor of 3.4
    (hurst = 0.01; 2.2 at 0.1), or too small by up to 38 % (hurst = 0.7; with additions 44 %, at 0.9). Their
    errors are tabulated in the documentation, "Theory: surfaces". `fbm` has no such error.

    References
    ----------
    Fournier, Fussell and Carpenter (1982), Communications of the ACM 25, 371-384; with additions: Saupe
    (1988), in The Science of Fractal Images (Springer).

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.midpoint((65, 65), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1)
    >>> dict(surface.sizes), float(surface[0, 0])
    ({'y': 65, 'x': 65}, 0.0)
    """
    (ny, nx), (dy, dx) = _from_array.sizes_and_steps(shape, spacing)
    levels = (max(ny, nx) - 2).bit_length()
    # measured at these exponents: see "Theory: surfaces"
    error = float(np.interp(float(hurst), (0.01, 0.1, 0.3, 0.5, 0.7, 0.9), (2.4, 1.2, 0.1, 0.27, 0.38, 0.39)))
    entries = {"achieved_error": f"about {error:.1g} of the mean square increments over 64 points"}

    def draw_heights(stream: np.random.Generator) -> tuple[Array, dict[str, Any]]:
        heights = _displaced(levels, (dy / dx, 1.0), Displacement(float(hurst), bool(additions), stream))
        return float(rms_increment) * heights[:ny, :nx], entries

    return _from_array.draw_ensemble(draw_heights, (dy, dx), members=members, rng=rng)


@dataclass(frozen=True)
class Displacement:
    """Normal displacements of points about the mean of their neighbours.

    With `additions` all points are displaced at each stage (Saupe 1988).
    """

    hurst: float
    additions: bool
    rng: np.random.Generator

    def draw(self, deviation: float | Array, shape: tuple[int, ...]) -> Array:
        """Return normal numbers of a standard deviation."""
        return np.asarray(deviation * self.rng.standard_normal(shape))

    def variograms(self, places: Points) -> tuple[Array, Array]:
        """Return the mean square increments between the origin and each place, and between all of these."""
        points, power = np.array(places), 2 * self.hurst
        return np.hypot(*points.T) ** power, np.hypot(*(points[:, None] - points).transpose(2, 0, 1)) ** power

    def deviation(self, neighbours: Points) -> float:
        """Return the standard deviation of the displacement of a point at the origin.

        Without additions it is that of a fractional Brownian surface about the mean of these neighbours. With
        additions the nearest neighbour is displaced too, and both displacements together give the variogram
        between it and the point.
        """
        away, apart = self.variograms(neighbours)
        if not self.additions:
            return math.sqrt(away.mean() - 0.5 * apart.mean())
        nearest = int(np.argmin(away))
        variance_of_mean = float(apart[nearest].mean() - 0.5 * apart.mean())
        return math.sqrt(max(0.0, 0.5 * (float(away[nearest]) - variance_of_mean)))


def _displaced(levels: int, spacing: tuple[float, float], displacement: Displacement) -> Array:
    """Return heights aimed at E[(z(a) - z(b))^2] = r^(2H), shape (2^levels + 1,) * 2.

    Each point is the mean of its neighbours of the coarser grid plus a normal number. Its variance is that
    of a fractional Brownian surface about that mean, conditioned on these neighbours alone: leaving out all
    others is the error of the method.
    """
    n = (1 << levels) + 1
    heights = np.zeros((n, n))
    step = n - 1
    heights[::step, ::step] = _corners((step * spacing[0], step * spacing[1]), displacement)
    while step > 1:
        half = step // 2
        reach = (half * spacing[0], half * spacing[1])
        _centres(heights, step, reach, displacement)
        _edges(heights, step, reach, displacement)
        step = half
    return heights


def _corners(edges: tuple[float, float], displacement: Displacement) -> Array:
    """Draw four exact corners; the first is at height 0."""
    far, apart = displacement.variograms([(0.0, edges[1]), (edges[0], 0.0), edges])
    factor = np.linalg.cholesky(0.5 * (far[:, None] + far - apart))
    drawn = (factor * displacement.rng.standard_normal(3)).sum(axis=1)
    return np.array([0.0, *drawn]).reshape(2, 2)


def _centres(heights: Array, step: int, reach: tuple[float, float], displacement: Displacement) -> None:
    """Give the centre of each square the mean of its corners, displaced."""
    corners = heights[::step, ::step]
    mean = 0.25 * (corners[:-1, :-1] + corners[:-1, 1:] + corners[1:, :-1] + corners[1:, 1:])
    y, x = reach
    deviation = displacement.deviation([(-y, -x), (-y, x), (y, -x), (y, x)])
    heights[step // 2 :: step, step // 2 :: step] = mean + displacement.draw(deviation, mean.shape)
    if displacement.additions:
        corners += displacement.draw(deviation, corners.shape)


def _edges(heights: Array, step: int, reach: tuple[float, float], displacement: Displacement) -> None:
    """Give the middle of each edge the mean of its two ends and of the centres beside it, displaced."""
    half = step // 2
    y, x = reach
    corners, centres = heights[::step, ::step], heights[half::step, half::step]
    four = [(0.0, -x), (0.0, x), (-y, 0.0), (y, 0.0)]
    inside = displacement.deviation(four)
    for axis in (0, 1):
        ends = np.moveaxis(corners, axis, 0)  # edges run along `axis`
        beside = np.moveaxis(centres, axis, 0)
        total = ends[:-1] + ends[1:]
        total[:, :-1] += beside
        total[:, 1:] += beside
        total[:, 1:-1] *= 0.25
        total[:, [0, -1]] /= 3.0
        deviation = np.full(total.shape[1], inside)
        along = [(-y, 0.0), (y, 0.0)] if axis == 0 else [(0.0, -x), (0.0, x)]
        deviation[[0, -1]] = displacement.deviation([*along, (0.0, x) if axis == 0 else (y, 0.0)])
        total += displacement.draw(deviation, total.shape)
        rows, columns = (slice(half, None, step), slice(None, None, step))
        np.moveaxis(heights, axis, 0)[rows, columns] = total
    if displacement.additions:
        corners += displacement.draw(inside, corners.shape)
        centres += displacement.draw(inside, centres.shape)
