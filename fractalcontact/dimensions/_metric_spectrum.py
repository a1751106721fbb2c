"""Spectral density of a self-affine surface on a lattice, whose increments count lengths by a metric.

The mean square increment over the lag r is (r' M r)^H, with a metric M of determinant one: the identity for
an isotropic surface, else one that shortens the lags along the longer correlation. Its spectral density is

    S(q) = c(H) (q' M^-1 q)^(-1 - H),    c(H) = 2^(2 H + 1) pi H Gamma(1 + H) / Gamma(1 - H),

and that of its samples the sum over the images q + 2 pi k. The nearest are summed; the rest, a smooth
function of q, is interpolated.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from fractalcontact.dimensions._gaussian_mixture import ALIASED, FILTERED, UNALIASED, kernel_transfer
from fractalcontact.dimensions._mode_bins import block_product
from fractalcontact.dimensions._spectral_posterior import CORNER, HURST, LONG_HURST, NOISE, SHARPNESS, SPREAD

Array = np.ndarray[Any, np.dtype[Any]]

# of the interpolation, and images each way over those summed one by one: density of a ratio of 4 to .1 %, of
# 8 to 2 %
_NODES, _IMAGES = 8, 4
# t in squares of the longer spacing, times the ratio of the metric, from which on a sum over lags is used:
# both sums are exact to 1e-5
_NARROW = 1.85
_REACH = 2.6  # longest of these lags over the ratio
_LAGS = 1 << 12  # at a time
LARGEST_LOG_RATIO = math.log(16.0)  # of a metric that is fitted: lags in the tables grow with its square


def metric_of(u: float, v: float) -> Array:
    """Return the exponential of -[[-u, v], [v, u]]: lengths at half the angle of (u, v) shrink."""
    size = math.hypot(u, v)
    sine = math.sinh(size) / size if size > 0.0 else 1.0
    return np.asarray(math.cosh(size) * np.eye(2) + sine * np.array([[u, -v], [-v, -u]]))


def squared_length(metric: Array, y: Array, x: Array) -> Array:
    """Return the squared length of vectors by a metric, or by some of shape (2, 2, ...)."""
    return np.asarray(metric[0, 0] * y * y + (metric[0, 1] + metric[1, 0]) * y * x + metric[1, 1] * x * x)


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
    """

    theta: Array
    form: int
    log_ratio: Array
    dy: float

    @cached_property
    def metric(self) -> Array:
        """By which increments count lengths, shape (2, 2), y first."""
        return metric_of(*self.log_ratio)

    def at(self, y: Array, x: Array) -> Array:
        """Return the density at wavenumbers, of one shape or as a column and a row."""
        hurst, spread = float(self.theta[HURST]), float(self.theta[SPREAD])
        inverse = np.linalg.inv(self.metric)
        total = np.zeros(np.broadcast(y, x).shape)
        near_y, near_x = (0, 0) if self.form == UNALIASED else _nearest(self.dy)
        for down in range(-near_y, near_y + 1):
            for across in range(-near_x, near_x + 1):
                qy, qx = y + 2.0 * np.pi / self.dy * down, x + 2.0 * np.pi * across
                image = np.log(np.maximum(squared_length(inverse, qy, qx), 1e-30))
                image *= -1.0 - hurst
                if spread > 0.0 and self.form != FILTERED:
                    image -= spread**2 * (qy * qy + qx * qx)
                total += np.exp(image)
        if self.form != UNALIASED:
            rows, columns = (
                np.polynomial.chebyshev.chebvander(q.ravel() / np.pi, _NODES - 1) for q in (y * self.dy, x)
            )
            rows = rows @ self._far_images
            total += np.sum(rows * columns, axis=1) if y.shape == x.shape else block_product(rows, columns.T)
        if spread > 0.0 and self.form == FILTERED:
            for s, q in ((spread / self.dy, y * self.dy), (spread, x)):
                total *= np.square(kernel_transfer(s, q.ravel()).reshape(q.shape))
        gammas = math.gamma(1.0 + hurst) / math.gamma(1.0 - hurst)
        total *= 2.0 ** (2.0 * hurst + 1.0) * np.pi * hurst * gammas / self.dy
        if self.theta[CORNER] > 0.0:
            sharpness = self.theta[SHARPNESS]
            corner = sharpness * np.log(self.theta[CORNER] ** 2 / np.maximum(y * y + x * x, 1e-30))
            total *= np.exp((self.theta[LONG_HURST] - hurst) / sharpness * np.logaddexp(0.0, corner))
        return np.maximum(total, 1e-300)

    def with_noise(self, y: Array, x: Array) -> Array:
        """Return `at` with white noise."""
        return np.asarray(self.at(y, x) + self.theta[NOISE] ** 2)

    @cached_property
    def _far_images(self) -> Array:
        """Coefficients of the sum over all images but the nearest, of products of Chebyshev polynomials."""
        hurst = float(self.theta[HURST])
        spread = float(self.theta[SPREAD]) if self.form == ALIASED else 0.0
        inverse = np.linalg.inv(self.metric)
        (y, x, blur), (sine, cosine, radial), polynomials = _of_any_metric(hurst, spread, self.dy)
        images = squared_length(inverse, y, x) ** (-1.0 - hurst) * blur
        by_azimuth = squared_length(inverse, sine, cosine) ** (-1.0 - hurst)
        beyond = np.mean(by_azimuth * radial) * (self.dy / (4.0 * np.pi * hurst))
        return np.asarray(polynomials.T @ (images.sum(axis=2) + beyond) @ polynomials)


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
    polynomials = np.polynomial.chebyshev.chebvander(places, _NODES - 1) * (2.0 / _NODES)
    polynomials[:, 0] *= 0.5
    return (y, x, blur), (sine, cosine, edge ** (-2.0 * hurst) * np.exp(-z) - blurred), polynomials


def gaussian_tables(
    t: Array,
    spreads: Array,
    metric: Array,
    wavenumbers: tuple[Array, Array],
    dy: float,
    mean: Callable[[Array], Array],
) -> Array:
    """Return means of the densities of Gaussians exp(-t r' M r) after a blur: (forms, spreads, means, t).

    `mean` maps values at the wavenumbers, along the last axis, to means.
    """
    (y, x), inverse = wavenumbers, np.linalg.inv(metric)
    ratio = float(np.linalg.eigvalsh(metric)[-1])
    down, across = (k.ravel() for k in np.mgrid[-1:2, -1:2])
    qy, qx = y[:, None] + 2.0 * np.pi / dy * down, x[:, None] + 2.0 * np.pi * across
    square = qy * qy + qx * qx
    waves = np.pi / (dy * t) * np.exp(squared_length(inverse, qy, qx)[..., None] * (-0.25 / t))
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
        sums += block_product(cosines, np.exp(-squared_length(forms, ry[some], rx[some])).T)
    sums = sums.reshape(y.size, *blurred.shape[:2]) / np.sqrt(np.linalg.det(blurred))
    tables: list[list[Array]] = []
    for k, spread in enumerate(spreads):
        blur = np.exp(-(spread**2) * square)
        aliased = np.matmul(blur[:, None], waves)[:, 0]
        if k < near.size:  # wider blurs end within the nine images
            aliased[:, narrow] = sums[:, k]
        if not tables:
            sampled = aliased
        transfer = np.square(kernel_transfer(spread / dy, y * dy) * kernel_transfer(spread, x))
        unaliased = blur[:, 4, None] * waves[:, 4]
        tables.append([mean(each.T).T for each in (aliased, transfer[:, None] * sampled, unaliased)])
    return np.maximum(np.moveaxis(np.array(tables), 1, 0), 0.0)  # sums of lags end in rounding
