"""Spectral density of a self-affine surface on a lattice, whose increments count lengths by a metric.

The mean square increment over the lag r is (r' M r)^H, with a metric M of determinant one: the identity for
an isotropic surface, else one that shortens the lags along the longer correlation. Its spectral density is

    S(q) = c(H) (q' M^-1 q)^(-1 - H),    c(H) = 2^(2 H + 1) pi H Gamma(1 + H) / Gamma(1 - H),

and that of its samples the sum over the images q + 2 pi k. The nearest are summed; the rest, a smooth
function of q, is interpolated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from fractalcontact.base.numbers import Array
from fractalcontact.dimensions._gaussian_mixture import (
    ALIASED,
    FADED,
    FILTERED,
    UNALIASED,
    AxisBlur,
    log_bend,
)
from fractalcontact.dimensions._mode_bins import block_product
from fractalcontact.dimensions._spectral_posterior import CORNER, HURST, NOISE, SPREAD

# of the interpolation, and images each way over those summed one by one: density of a ratio of 4 to .1 %, of
# 8 to 2 %
_NODES, _IMAGES = 8, 4
# t in squares of the longer spacing, times the ratio of the metric, from which on a sum over lags is used:
# both sums are exact to 1e-5
_NARROW = 1.85
_REACH = 2.6  # longest of these lags over the ratio
_LAGS = 1 << 8  # at a time: blocks of `block_product` are then wide
LARGEST_LOG_RATIO = math.log(16.0)  # of a metric that is fitted: lags in the tables grow with its square


def metric_of(u: float, v: float) -> Array:
    """Return the exponential of -[[-u, v], [v, u]]: lengths at half the angle of (u, v) shrink."""
    size = math.hypot(u, v)
    sine = math.sinh(size) / size if size > 0.0 else 1.0
    return np.asarray(math.cosh(size) * np.eye(2) + sine * np.array([[u, -v], [-v, -u]]))


def squared_length(metric: Array, y: Array, x: Array) -> Array:
    """Return the squared length of vectors by a metric, or by some of shape (2, 2, ...)."""
    length = metric[0, 0] * y + (metric[0, 1] + metric[1, 0]) * x
    length *= y
    length += metric[1, 1] * x * x
    return np.asarray(length)


@dataclass(frozen=True)
class MetricSpectrum:
    """Spectrum of a surface of unit increments over a unit lag.

    Attributes
    ----------
    theta : ndarray
        Parameters of the model, `_spectral_posterior`.
    form : int
        Of the sampling and the blur.
    log_ratio : ndarray, shape (2,)
        Components (u, v) of the metric, see `metric_of`.
    dy : float
        Spacing along y; that along x is one.
    decay : float
        Of the logarithm with the wavenumber, `_spectral_posterior.decay`.
    """

    theta: Array
    form: int
    log_ratio: Array
    dy: float
    decay: float = 0.0

    @cached_property
    def metric(self) -> Array:
        """By which increments count lengths, shape (2, 2), y first."""
        return metric_of(*self.log_ratio)

    @cached_property
    def inverse(self) -> Array:
        """Of the metric: wavenumbers count by it."""
        return metric_of(*-self.log_ratio)

    def at(self, y: Array, x: Array, at_once: int = 1 << 13) -> Array:
        """Return the density at wavenumbers, of one shape or as a column and a row.

        `at_once`: wavenumbers of a grid whose images the cache holds.
        """
        hurst, spread, is_grid = float(self.theta[HURST]), float(self.theta[SPREAD]), y.shape != x.shape
        rows = max(1, at_once // x.size) if is_grid else len(y)
        starts = range(0, len(y), rows)
        total = np.concatenate([self._near_images(y[start : start + rows], x) for start in starts])
        if self.form != UNALIASED:
            along_y, along_x = (chebvander(q.ravel() / np.pi, _NODES - 1).T for q in (y * self.dy, x))
            along_y = self._far_images.T @ along_y
            total += block_product(along_y.T, along_x) if is_grid else (along_y * along_x).sum(axis=0)
        if spread > 0.0 and self.form == FILTERED:
            for s, q in ((spread / self.dy, y * self.dy), (spread, x)):
                total *= np.square(AxisBlur(q.ravel()).transfers(s)[1].reshape(q.shape))
        if self.decay:
            total *= np.exp(self.decay * np.hypot(y, x))
        gammas = math.gamma(1.0 + hurst) / math.gamma(1.0 - hurst)
        total *= 2.0 ** (2.0 * hurst + 1.0) * np.pi * hurst * gammas / self.dy
        return np.asarray(np.maximum(total, 1e-300))

    def _near_images(self, y: Array, x: Array) -> Array:
        """Return the sum of the nearest images."""
        near_y, near_x = (0, 0) if self.form == UNALIASED else _nearest(self.dy)
        down, across = (np.arange(-near, near + 1.0).reshape(-1, *[1] * y.ndim) for near in (near_y, near_x))
        qy, qx = (y + 2.0 * np.pi / self.dy * down)[:, None], x + 2.0 * np.pi * across
        density = squared_length(self.inverse, qy, qx)
        np.log(np.maximum(density, 1e-30, out=density), out=density)
        density *= -1.0 - float(self.theta[HURST])
        if self.theta[SPREAD] > 0.0 and self.form != FILTERED:
            density -= self.theta[SPREAD] ** 2 * (qy * qy + qx * qx)
        if self.theta[CORNER] > 0.0:
            density += log_bend(qy * qy + qx * qx, self.theta)
        return np.asarray(np.exp(density, out=density).sum(axis=(0, 1)))

    def with_noise(self, y: Array, x: Array) -> Array:
        """Return `at` with white noise."""
        return np.asarray(self.at(y, x) + self.theta[NOISE] ** 2)

    @cached_property
    def _far_images(self) -> Array:
        """Coefficients of the sum over all images but the nearest, of products of Chebyshev polynomials."""
        hurst = float(self.theta[HURST])
        spread = float(self.theta[SPREAD]) if self.form == ALIASED else 0.0
        (y, x, blur), (sine, cosine, radial), polynomials = _of_any_metric(hurst, spread, self.dy)
        images = squared_length(self.inverse, y, x) ** (-1.0 - hurst) * blur
        by_azimuth = squared_length(self.inverse, sine, cosine) ** (-1.0 - hurst)
        beyond = np.mean(by_azimuth * radial) * (self.dy / (4.0 * np.pi * hurst))
        if self.theta[CORNER] > 0.0:
            images = images * np.exp(log_bend(y * y + x * x, self.theta))
        return np.asarray(polynomials @ (images.sum(axis=2) + beyond) @ polynomials.T)


def _nearest(dy: float) -> tuple[int, int]:
    """Return how many images each way along y and x are summed: they reach equally far."""
    return round(max(1.0, dy)), round(max(1.0, 1.0 / dy))


@lru_cache(maxsize=4)  # a metric is fitted with one exponent and one spread
def _of_any_metric(
    hurst: float, spread: float, dy: float
) -> tuple[tuple[Array, Array, Array], tuple[Array, Array, Array], Array]:
    """Return what the sum over far images takes with any metric.

    Wavenumbers of the images at the nodes of the interpolation and their blur; by azimuth, the sine, the
    cosine, and the integral over those beyond; the polynomials at the nodes.
    """
    from scipy.special import gammaincc

    places = np.cos(np.pi * (np.arange(_NODES) + 0.5) / _NODES)
    near_y, near_x = _nearest(dy)
    last_y, last_x = _IMAGES * near_y, _IMAGES * near_x
    down, across = (k.ravel() for k in np.mgrid[-last_y : last_y + 1, -last_x : last_x + 1])
    far = (abs(down) > near_y) | (abs(across) > near_x)
    y = np.pi / dy * (places[:, None, None] + 2.0 * down[far])
    x = np.pi * (places[:, None] + 2.0 * across[far])
    blur = np.exp(-(spread**2) * (y * y + x * x))
    # those beyond, as an integral over the outside of their rectangle
    azimuth = np.pi / 180.0 * (np.arange(360) + 0.5)
    sine, cosine = np.sin(azimuth), np.cos(azimuth)
    edge = 2.0 * np.pi / np.maximum(np.abs(sine) * dy / (last_y + 0.5), np.abs(cosine) / (last_x + 0.5))
    z = np.square(spread * edge)
    blurred = spread ** (2.0 * hurst) * gammaincc(1.0 - hurst, z) * math.gamma(1.0 - hurst)
    polynomials = chebvander(places, _NODES - 1).T * (2.0 / _NODES)
    polynomials[0] *= 0.5
    return (y, x, blur), (sine, cosine, edge ** (-2.0 * hurst) * np.exp(-z) - blurred), polynomials


def gaussian_tables(
    t: Array, spreads: Array, spectrum: MetricSpectrum, y: Array, x: Array, weight: Array, starts: Array
) -> Array:
    """Return sums of the densities of Gaussians exp(-t r' M r) after a blur: (forms, spreads, sums, t).

    Each sum is over the wavenumbers from one of the `starts` to the next, times their `weight`. The first
    spread is zero.
    """
    metric, dy = spectrum.metric, spectrum.dy
    ratio = float(np.linalg.eigvalsh(metric)[-1])
    images = np.array([0.0, -2.0, 2.0]) * np.pi
    qy, qx = (y[:, None] + images / dy)[:, :, None], (x[:, None] + images)[:, None]
    squares = squared_length(spectrum.inverse, qy, qx).reshape(y.size, 9, 1)
    waves = np.exp(np.maximum(squares * (-0.25 / t), FADED)) * (weight[:, None, None] * np.pi / (dy * t))
    # of narrow Gaussians the sum over lags is the shorter one, of some lags at a time
    wide = max(1.0, dy)
    down, across = math.ceil(_REACH * ratio * wide / dy), math.ceil(_REACH * ratio * wide)
    ry, rx = (r.ravel()[: r.size // 2] for r in np.mgrid[-down : down + 1, -across : across + 1])
    ry = ry * dy
    narrow, near = t > _NARROW / (ratio * wide**2), spreads[spreads < 0.3 * wide]
    once = t[narrow, None, None] * metric
    blurred = np.eye(2) + 4.0 * np.square(near)[:, None, None, None] * once
    forms = np.moveaxis(once @ np.linalg.inv(blurred), (2, 3), (0, 1)).reshape(2, 2, -1, 1)
    sums = np.ones((y.size, forms.shape[2]))
    for start in range(0, ry.size, _LAGS):
        some = slice(start, start + _LAGS)
        cosines = 2.0 * np.cos(np.outer(y, ry[some]) + np.outer(x, rx[some]))
        shares = np.exp(np.maximum(-squared_length(forms, ry[some], rx[some]), FADED))
        sums += block_product(cosines, shares.T)
    scale = weight[:, None, None] / np.sqrt(np.linalg.det(blurred))
    sums = sums.reshape(scale.shape) * scale
    sampled = waves.sum(axis=1)
    sampled[:, narrow] = sums[:, 0]
    lines = (AxisBlur(y * dy), dy), (AxisBlur(x), 1.0)
    along = [[line.transfers(s / d) for s in spreads] for line, d in lines]
    (blur_y, weights_y), (blur_x, weights_x) = (map(np.array, zip(*each, strict=True)) for each in along)
    blur_y, blur_x, filtered = np.square(blur_y), np.square(blur_x), np.square(weights_y * weights_x)
    tables = np.empty((3, spreads.size, starts.size, t.size))
    for m, some in enumerate(map(slice, starts, [*starts[1:], y.size])):
        blur = blur_y[:, :, None, some] * blur_x[:, None, :, some]
        by_wave = np.moveaxis(waves[some], 1, 0)
        tables[ALIASED, :, m] = block_product(blur.reshape(spreads.size, -1), by_wave.reshape(-1, t.size))
        # wider blurs end within the nine images
        tables[ALIASED, : near.size, m, narrow] = sums[some].sum(axis=0).T
        tables[FILTERED, :, m] = block_product(filtered[:, some], sampled[some])
        tables[UNALIASED, :, m] = block_product(blur[:, 0, 0], by_wave[0])
    return np.maximum(tables, 0.0)  # sums of lags end in rounding
