"""Model of an anisotropic fractional Brownian surface, fitted to and tested by second differences.

The mean square increment at the lag vector h is proportional to (h' M h)^H. The metric M is the identity
for an isotropic surface, and a symmetric matrix of determinant one for a surface whose correlations are
longer in one direction. Tests: the residual of the logarithms of mean square second differences about a
smooth curve over the length is compared with harmonics of the direction, in level and in slope. All of them
vanish on average if the surface is isotropic.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fractalcontact.dimensions._records import NORMAL
from fractalcontact.dimensions._second_differences import MiddlePairs, SecondDifferences, covariance

Array = np.ndarray[Any, np.dtype[Any]]

LEAST_LAGS = 14  # a curve of four coefficients, eight harmonics, and two to spare
LARGEST_LOG_RATIO = 5.0
UNCORRELATED = "heights without correlation have no anisotropy ratio"
RIDGES = (
    "the anisotropy is stronger than any ratio that the fit can find: ridges continue along the azimuth, or "
    "spikes stand out"
)
SMOOTH = "a surface smoother than a fractal one: the scatter of its second differences is unknown"
_AWAY_FROM_ISOTROPY = 2.447746830680816  # root of the 95 % quantile of chi square, two degrees of freedom
_DEGREE = 3  # of the smooth curve over the length
_LOWEST, _HIGHEST = 0.02, 0.98  # exponents whose covariances are used
_SAME = 0.01  # change of H and of the log ratio that does not need a new covariance
_ROUNDS = 12  # of the fit
_WHITE, _STANDARD_ERRORS = 0.05, 3.0  # exponent above which heights are correlated, also in standard errors
_IMPROBABLE = 1e-3  # p value below which a surface is certainly anisotropic
_UNKNOWN = 50.0  # log ratio at which the interval is unbounded


@dataclass(frozen=True)
class Anisotropy:
    """Tests of isotropy of a surface, and its anisotropy ratio.

    Attributes
    ----------
    isotropy_p_value : float
        Probability that an isotropic surface differs as much between directions.
    anisotropy_ratio, anisotropy_ratio_low, anisotropy_ratio_high : float
        Correlation length along `anisotropy_azimuth` (degree) over that across it, with its 95 % interval.
    anisotropy_p_value : float
        Probability that a surface of that ratio differs as much from the model.
    hurst : float
        One exponent for all directions.
    metric : ndarray, shape (2, 2)
        The matrix M, y first.
    reason : str
        Why there is no ratio; empty if there is one.
    curvature_z : float
        z of the curvature of the power law over the length.
    """

    isotropy_p_value: float
    anisotropy_ratio: float
    anisotropy_ratio_low: float
    anisotropy_ratio_high: float
    anisotropy_azimuth: float
    anisotropy_p_value: float
    hurst: float
    metric: Array
    reason: str
    curvature_z: float = 0.0

    @classmethod
    def of(
        cls,
        isotropy_p_value: float,
        anisotropy_p_value: float,
        hurst: float,
        exponent: tuple[float, float],
        log_ratio: tuple[float, float],
        covariance: Array,
    ) -> Anisotropy:
        """Convert the two components of the log ratio, with their covariance, to ratio and azimuth.

        `exponent` is that of the metric in the law of the heights, and its variance: where it is nearly 0,
        any ratio fits.
        """
        is_white = not exponent[0] > max(_WHITE, _STANDARD_ERRORS * float(np.sqrt(exponent[1])))
        reason = UNCORRELATED if is_white else ""
        size = float(np.hypot(*log_ratio))
        if size > 0.99 * LARGEST_LOG_RATIO and (isotropy_p_value < _IMPROBABLE or not reason):
            reason = RIDGES
        unit = np.array(log_ratio) / size if size > 0 else np.array([1.0, 0.0])
        error = float(np.sqrt(unit @ covariance @ unit))
        return cls(
            isotropy_p_value,
            anisotropy_ratio=float(np.exp(size)),
            anisotropy_ratio_low=float(np.exp(max(size - _AWAY_FROM_ISOTROPY * error, 0.0))),
            anisotropy_ratio_high=float(np.exp(min(size + NORMAL * error, _UNKNOWN))),
            anisotropy_azimuth=float(np.degrees(0.5 * np.arctan2(log_ratio[1], log_ratio[0])) % 180.0),
            anisotropy_p_value=anisotropy_p_value,
            hurst=hurst,
            metric=metric_of(*log_ratio),
            reason=reason,
        )

    def defined(self) -> Anisotropy:
        """Return the record without a ratio that has no meaning; ridges keep their azimuth."""
        if not self.reason:
            return self
        return replace(
            self,
            anisotropy_ratio=np.nan,
            anisotropy_ratio_low=np.nan,
            anisotropy_ratio_high=np.nan,
            anisotropy_azimuth=self.anisotropy_azimuth if self.reason == RIDGES else np.nan,
            anisotropy_p_value=self.anisotropy_p_value if self.reason == SMOOTH else np.nan,
        )


def metric_of(u: float, v: float) -> Array:
    """Return the exponential of -[[-u, v], [v, u]]: lengths at half the angle of (u, v) shrink."""
    size = float(np.hypot(u, v))
    sine = np.sinh(size) / size if size > 0 else 1.0
    return np.asarray(np.cosh(size) * np.eye(2) + sine * np.array([[u, -v], [-v, -u]]))


def squared_length(vectors: Array, metric: Array) -> Array:
    """Return h' M h for vectors h on the last axis, y first."""
    y, x = vectors[..., 0], vectors[..., 1]
    return np.asarray(metric[0, 0] * y * y + 2.0 * metric[0, 1] * y * x + metric[1, 1] * x * x)


def log_squares(vectors: Array, metric: Array) -> Array:
    """Return the logarithm of h' M h."""
    return np.asarray(np.log(squared_length(vectors, metric)))


def log_square_derivatives(vectors: Array, u: float, v: float, step: float = 1e-4) -> list[Array]:
    """Return the derivatives of `log_squares` with respect to u and v."""
    square = squared_length(vectors, metric_of(u, v))
    return [
        squared_length(vectors, (metric_of(u + a, v + b) - metric_of(u - a, v - b)) / (2 * step)) / square
        for a, b in ((step, 0.0), (0.0, step))
    ]


def harmonics(logs: Array, angle: Array) -> Array:
    """Return the second and fourth harmonics of an angle, and the same times a centred logarithm: (k, 8)."""
    waves = [trig(order * angle) for order in (2, 4) for trig in (np.cos, np.sin)]
    centred = logs - logs.mean()
    return np.stack([*waves, *(centred * wave for wave in waves)], axis=1)


def directional_fit(
    differences: SecondDifferences, pairs: MiddlePairs, weights: Array, hurst: float | None, metric: Array
) -> tuple[float, float, float]:
    """Return exponent, standard error and the mean square second difference over one x spacing.

    The lag vectors lie along one direction; `weights` (t, k) interpolate their logarithms. The scatter is
    that of a surface of exponent `hurst`; None uses the fitted one.
    """
    logs = weights @ np.log(np.hypot(*differences.lags.T))
    design = np.stack([np.ones(logs.size), 2.0 * logs], axis=1)
    exponent = 0.5 if hurst is None else hurst
    for _ in range(1 if hurst is not None else 3):
        scatter = covariance(differences.vectors, pairs, _limited(exponent), metric, differences.spacing)
        values = weights @ _unbiased_logs(differences, scatter)
        (level, exponent), errors = _least_squares(design, values, weights @ scatter @ weights.T)
    return float(exponent), float(np.sqrt(errors[1, 1])), float(np.exp(level))


def fit_anisotropy(differences: SecondDifferences, pairs: MiddlePairs) -> Anisotropy:
    """Fit an anisotropic fractional Brownian surface, and test it and the isotropic one."""
    scatters = _Scatter(differences, pairs)
    lags = differences.lags
    logs = np.log(np.hypot(*lags.T))
    design = np.stack([np.ones(logs.size), 2.0 * logs], axis=1)
    first = float(np.linalg.lstsq(design, np.log(differences.means))[0][1])
    hurst = _limited(first)
    for _ in range(3):
        scatter = scatters.near(hurst, 0.0, 0.0)
        (_, slope), errors = _least_squares(design, _unbiased_logs(differences, scatter), scatter)
        hurst = _limited(slope)
    is_smooth = first > 1.0 + _STANDARD_ERRORS * np.sqrt(errors[1, 1])
    isotropy_p_value = _wald_test(differences, np.eye(2), scatters.near(hurst, 0.0, 0.0), ratio_free=False)
    u = v = 0.0
    for _ in range(_ROUNDS):  # Gauss-Newton
        scatter = scatters.near(hurst, u, v)
        derivatives = log_square_derivatives(lags, u, v)
        columns = [np.ones(logs.size), log_squares(lags, metric_of(u, v))]
        design = np.stack([*columns, *(hurst * derivative for derivative in derivatives)], axis=1)
        coefficients, errors = _least_squares(design, _unbiased_logs(differences, scatter), scatter)
        hurst = _limited(coefficients[1])
        u, v = u + coefficients[2], v + coefficients[3]
        size = float(np.hypot(u, v))
        if size > LARGEST_LOG_RATIO:
            u, v = u * LARGEST_LOG_RATIO / size, v * LARGEST_LOG_RATIO / size
        if np.hypot(*coefficients[2:]) < 1e-4 or size > LARGEST_LOG_RATIO:
            break
    scatter = scatters.near(hurst, u, v)
    anisotropy_p_value = _wald_test(differences, metric_of(u, v), scatter, ratio_free=True)
    exponent = float(coefficients[1]), float(errors[1, 1])
    result = Anisotropy.of(isotropy_p_value, anisotropy_p_value, hurst, exponent, (u, v), errors[2:, 2:])
    result = replace(result, curvature_z=_curvature_z(differences, metric_of(u, v), scatter))
    if not is_smooth:
        return result
    return replace(result, isotropy_p_value=np.nan, anisotropy_p_value=np.nan, reason=SMOOTH)


class _Scatter:
    """Covariance of the logarithms; computed again only where the parameters differ enough to change it."""

    def __init__(self, differences: SecondDifferences, pairs: MiddlePairs) -> None:
        self.differences, self.pairs = differences, pairs
        self.parameters = np.full(3, np.inf)
        self.covariance = np.zeros((0, 0))

    def near(self, hurst: float, u: float, v: float) -> Array:
        """Return the covariance for an exponent and the components of the log ratio."""
        parameters = np.array([hurst, u, v])
        if np.abs(parameters - self.parameters).max() > _SAME:
            self.parameters = parameters
            self.covariance = covariance(
                self.differences.vectors, self.pairs, hurst, metric_of(u, v), self.differences.spacing
            )
        return self.covariance


def _unbiased_logs(differences: SecondDifferences, scatter: Array) -> Array:
    """Return the logarithms of the means, corrected for the bias of a logarithm by its scatter."""
    return np.asarray(np.log(differences.means) + 0.5 * np.diag(scatter))


def _curvature_z(differences: SecondDifferences, metric: Array, scatter: Array) -> float:
    """Return z of the curvature of the means over the length."""
    smooth = _columns(differences.lags, metric)[0][:, :3]
    coefficients, errors = _least_squares(smooth, _unbiased_logs(differences, scatter), scatter)
    return float(coefficients[2] / np.sqrt(errors[2, 2]))


def _wald_test(differences: SecondDifferences, metric: Array, scatter: Array, *, ratio_free: bool) -> float:
    """Return the p value of the harmonics; with `ratio_free` the level of the second is not tested."""
    from scipy.special import chdtrc

    smooth, waves = _columns(differences.lags, metric)
    if ratio_free:
        smooth, waves = np.concatenate([smooth, waves[:, :2]], axis=1), waves[:, 2:]
    root = np.linalg.cholesky(scatter)
    values = _unbiased_logs(differences, scatter)[:, None]
    smooth, waves, values = (np.linalg.solve(root, part) for part in (smooth, waves, values))
    basis = np.linalg.qr(smooth)[0]
    waves, values = (part - basis @ (basis.T @ part) for part in (waves, values))
    left, singular, _ = np.linalg.svd(waves, full_matrices=False)
    independent = singular > 1e-6 * singular.max(initial=0.0)
    if not independent.any():
        return float("nan")
    chi_square = np.sum((left[:, independent].T @ values) ** 2)
    return float(chdtrc(np.count_nonzero(independent), chi_square))


def _columns(lags: Array, metric: Array) -> tuple[Array, Array]:
    """Return the columns of a smooth curve over the length, and those of the harmonics of the direction."""
    y, x = (lags @ np.linalg.cholesky(metric)).T
    logs, angle = np.log(np.hypot(y, x)), np.arctan2(y, x)
    powers = [(logs - logs.mean()) ** power for power in range(2, _DEGREE + 1)]
    smooth = np.stack([np.ones(logs.size), 2.0 * logs, *powers], axis=1)
    return smooth, harmonics(logs, angle)


def _least_squares(design: Array, values: Array, scatter: Array) -> tuple[Array, Array]:
    """Return the coefficients of generalised least squares and their covariance.

    Values that were interpolated from fewer lags have a singular scatter.
    """
    weighted = np.linalg.pinv(scatter, rcond=1e-12, hermitian=True) @ design
    errors = np.linalg.inv(design.T @ weighted)
    return errors @ (weighted.T @ values), errors


def _limited(hurst: float) -> float:
    return float(np.clip(hurst, _LOWEST, _HIGHEST))
