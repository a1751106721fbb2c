"""Second differences along many directions of a free face: exponent, level, and tests of isotropy.

For fractional Brownian heights the mean square second difference at the lag vector h is proportional to
(h' M h)^H, M being the identity for an isotropic surface and a symmetric matrix of determinant one for a
stretched one. What is left of the logarithms of these means after a smooth curve over the length is set
against harmonics of the direction, in level and in slope: none may be there if the surface is isotropic.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fractalcontact.dimensions import _lags
from fractalcontact.dimensions._estimates import NORMAL
from fractalcontact.dimensions._faces import Face
from fractalcontact.dimensions._scatter import Pairs, covariance

Array = np.ndarray[Any, np.dtype[Any]]

FROM_ROUND = 2.447746830680816  # root of 95 % of chi square with two degrees of freedom
MULTIPLES = (1, 2, 4)
DIRECTIONS = 8
LEAST_LAGS = 14  # a curve of four numbers, eight harmonics, and two to spare
_DEGREE = 3  # of the smooth curve over the length
_REACH = 8  # components of a direction that was asked for
_NEAR = 2.5  # degrees within which the shorter of two lattice directions is better
_LOWEST, _HIGHEST = 0.02, 0.98  # exponents whose covariances are taken
_SAME = 0.01  # change of H and of the logarithm of a stretch that leaves a covariance as it is
_ROUNDS, STEEPEST = 12, 5.0  # of the fit of a stretch; its largest logarithm
_WHITE, _SURELY = 0.05, 3.0  # a power above which heights are correlated, also in standard errors
_STRANGE = 1e-3  # chance below which a face is not isotropic beyond doubt
UNCORRELATED = "heights without correlation have no stretch"
RIDGES = "no stretch that is tried is long enough: ridges run on along the azimuth, or spikes stand out"
SMOOTH = "a face smoother than a fractal one: nothing tells how its second differences scatter"
_OPEN = 50.0  # logarithm of a stretch beyond which nothing is known


@dataclass(frozen=True)
class Ray:
    """A direction of the lattice: steps in y (not negative) and x without common divisor."""

    dy: int
    dx: int
    azimuth: float
    length: float


@dataclass(frozen=True)
class Means:
    """Mean square second differences at lag vectors.

    `vectors` (k, 2) are steps in y and x, `numbers` (k,) tells how many differences each mean has, `steps`
    are the spacings over that of x.
    """

    vectors: Array
    means: Array
    numbers: Array
    steps: tuple[float, float]

    @classmethod
    def of(cls, face: Face, rays: Sequence[Ray], scales: tuple[float, float] | None) -> tuple[Means, Array]:
        """Measure the lags of some directions; return them with the place of the direction of each.

        Lags are 1, 2 and 4 times the step of the lattice, or of the least multiple of it inside `scales` (m),
        as far as the two of them that make a difference fit into the face.
        """
        low, high = (0.0, np.inf) if scales is None else scales
        found, owners = [], []
        for place, ray in enumerate(rays):
            step = ray.length * face.spacing[1]
            least = max(1, int(np.ceil(low / step * (1 - 1e-9))))
            for multiple in MULTIPLES:
                lag = least * multiple
                if lag * step <= high * (1 + 1e-9):
                    found.append((lag * ray.dy, lag * ray.dx))
                    owners.append(place)
        vectors = np.array(found, dtype=np.int64).reshape(-1, 2)
        inside = (2 * np.abs(vectors) < np.array(face.shape)).all(axis=1)
        vectors, owner = vectors[inside], np.array(owners, dtype=np.int64)[inside]
        slabs = iter([(np.ascontiguousarray(face.heights), face.shape[0])])
        means, counts = _lags.direct(slabs, (0, face.shape[1]), vectors, _lags.SECOND)
        kept = counts > 0
        return cls(vectors[kept], means[kept], counts[kept].astype(float), face.plane_steps), owner[kept]

    def part(self, kept: Array) -> Means:
        """Keep some of the lag vectors."""
        return Means(self.vectors[kept], self.means[kept], self.numbers[kept], self.steps)

    def spread(self, pairs: Pairs, hurst: float, form: Array) -> Array:
        """Return the covariance of the logarithms of the means, for a surface of matrix `form`."""
        return covariance(self.vectors, pairs, hurst, form, self.steps)

    @property
    def places(self) -> Array:
        """Lag vectors in spacings of x, shape (k, 2)."""
        return np.asarray(self.vectors * np.array(self.steps))


@dataclass(frozen=True)
class Isotropy:
    """What tells a face from an isotropic one.

    Attributes
    ----------
    p_value : float
        Of an isotropic surface showing as much of a difference between directions.
    stretch, low, high : float
        How many times as long correlations are along `azimuth` (degree) as across it, with its 95 % interval.
    stretched_p_value : float
        Of a stretched surface showing as much that no stretch explains.
    hurst : float
        One exponent for all directions, of the stretched surface.
    form : ndarray, shape (2, 2)
        The matrix M of that surface, y first.
    note : str
        Why there is no stretch; empty if there is one.
    bend : float
        Curvature of the power law over the length, in standard errors.
    """

    p_value: float
    stretch: float
    low: float
    high: float
    azimuth: float
    stretched_p_value: float
    hurst: float
    form: Array
    note: str
    bend: float = 0.0

    @classmethod
    def of(
        cls,
        p_value: float,
        stretched: float,
        hurst: float,
        power: tuple[float, float],
        parts: tuple[float, float],
        errors: Array,
    ) -> Isotropy:
        """Turn the two parts of the logarithm of a stretch, with their covariance, into size and azimuth.

        `power` is the exponent of the matrix in the law of the heights, and its variance: where it is next to
        nothing, any stretch fits.
        """
        note = "" if power[0] > max(_WHITE, _SURELY * float(np.sqrt(power[1]))) else UNCORRELATED
        size = float(np.hypot(*parts))
        if size > 0.99 * STEEPEST and (p_value < _STRANGE or not note):
            note = RIDGES
        toward = np.array(parts) / size if size > 0 else np.array([1.0, 0.0])
        error = float(np.sqrt(toward @ errors @ toward))
        return cls(
            p_value,
            stretch=float(np.exp(size)),
            low=float(np.exp(max(size - FROM_ROUND * error, 0.0))),
            high=float(np.exp(min(size + NORMAL * error, _OPEN))),
            azimuth=float(np.degrees(0.5 * np.arctan2(parts[1], parts[0])) % 180.0),
            stretched_p_value=stretched,
            hurst=hurst,
            form=matrix(*parts),
            note=note,
        )


def rays(azimuths: Array | None, steps: tuple[float, float]) -> list[Ray]:
    """Return the directions of the lattice nearest to those asked for, or eight over the half-circle."""
    targets = np.arange(DIRECTIONS) * 180.0 / DIRECTIONS if azimuths is None else np.mod(azimuths, 180.0)
    near = 90.0 / DIRECTIONS if azimuths is None else _NEAR
    ratio = max(steps) / min(steps)
    limits = [int(np.ceil(_REACH * min(max(steps) / step, ratio))) for step in steps]
    y, x = np.meshgrid(np.arange(limits[0] + 1), np.arange(-limits[1], limits[1] + 1), indexing="ij")
    kept = (np.gcd(y, x) == 1) & ((y > 0) | (x > 0))
    y, x = y[kept], x[kept]
    length = np.hypot(y * steps[0], x * steps[1])
    azimuth = np.degrees(np.arctan2(y * steps[0], x * steps[1]))
    found = []
    for target in targets:
        away = np.abs((azimuth - target + 90.0) % 180.0 - 90.0)
        close = away <= max(near, away.min()) * (1 + 1e-9)
        best = np.flatnonzero(close)[np.lexsort((np.round(away[close], 6), np.round(length[close], 6)))[0]]
        found.append(Ray(int(y[best]), int(x[best]), float(azimuth[best]), float(length[best])))
    return found


def slope(means: Means, pairs: Pairs, hurst: float | None, form: Array) -> tuple[float, float, float]:
    """Return exponent, standard error and the mean square second difference over one x spacing.

    The lag vectors lie along one direction. The scatter is that of a surface of exponent `hurst`; None takes
    the one found.
    """
    logs = np.log(np.hypot(*means.places.T))
    design = np.stack([np.ones(logs.size), 2.0 * logs], axis=1)
    exponent = 0.5 if hurst is None else hurst
    for _ in range(1 if hurst is not None else 3):
        spread = means.spread(pairs, _inside(exponent), form)
        (level, exponent), errors = _least_squares(design, _logarithms(means, spread), spread)
    return float(exponent), float(np.sqrt(errors[1, 1])), float(np.exp(level))


def _logarithms(means: Means, spread: Array) -> Array:
    """Return the logarithms of the means, and what they fall short of on average for their scatter."""
    return np.asarray(np.log(means.means) + 0.5 * np.diag(spread))


def isotropy(means: Means, pairs: Pairs) -> Isotropy:
    """Fit a stretched fractional Brownian surface, and test it and the isotropic one."""
    spreads = _Spreads(means, pairs)
    logs = np.log(np.hypot(*means.places.T))
    design = np.stack([np.ones(logs.size), 2.0 * logs], axis=1)
    first = float(np.linalg.lstsq(design, np.log(means.means))[0][1])
    hurst = _inside(first)
    for _ in range(3):
        spread = spreads.near(hurst, 0.0, 0.0)
        (_, slope), errors = _least_squares(design, _logarithms(means, spread), spread)
        hurst = _inside(slope)
    smooth = first > 1.0 + _SURELY * np.sqrt(errors[1, 1])
    p_value = _wald(means, np.eye(2), spreads.near(hurst, 0.0, 0.0), freely=True)
    u = v = 0.0
    for _ in range(_ROUNDS):
        spread = spreads.near(hurst, u, v)
        slopes = log_square_slopes(means.places, u, v)
        columns = [np.ones(logs.size), log_squares(means.places, matrix(u, v))]
        design = np.stack([*columns, *(hurst * slope for slope in slopes)], axis=1)
        coefficients, errors = _least_squares(design, _logarithms(means, spread), spread)
        hurst = _inside(coefficients[1])
        u, v = u + coefficients[2], v + coefficients[3]
        size = float(np.hypot(u, v))
        if size > STEEPEST:
            u, v = u * STEEPEST / size, v * STEEPEST / size
        if np.hypot(*coefficients[2:]) < 1e-4 or size > STEEPEST:
            break
    spread = spreads.near(hurst, u, v)
    stretched = _wald(means, matrix(u, v), spread, freely=False)
    power = float(coefficients[1]), float(errors[1, 1])
    found = Isotropy.of(p_value, stretched, hurst, power, (u, v), errors[2:, 2:])
    found = replace(found, bend=_bend(means, matrix(u, v), spread))
    if not smooth:
        return found
    return replace(found, p_value=np.nan, stretched_p_value=np.nan, note=SMOOTH)


def _bend(means: Means, form: Array, spread: Array) -> float:
    """Return the curvature of the means over the length, in standard errors."""
    smooth = _columns(means.places, form)[0][:, :3]
    coefficients, errors = _least_squares(smooth, _logarithms(means, spread), spread)
    return float(coefficients[2] / np.sqrt(errors[2, 2]))


class _Spreads:
    """Covariances of means; one is taken again until the surface differs enough to change it."""

    def __init__(self, means: Means, pairs: Pairs) -> None:
        self.means, self.pairs = means, pairs
        self.at = np.full(3, np.inf)
        self.spread = np.zeros((0, 0))

    def near(self, hurst: float, u: float, v: float) -> Array:
        """Return the covariance for an exponent and the parts of the logarithm of a stretch."""
        asked = np.array([hurst, u, v])
        if np.abs(asked - self.at).max() > _SAME:
            self.at, self.spread = asked, self.means.spread(self.pairs, hurst, matrix(u, v))
        return self.spread


def _wald(means: Means, form: Array, spread: Array, *, freely: bool) -> float:
    """Return how likely harmonics as large are by chance; the level of the second is free in a stretch."""
    from scipy.stats import chi2

    smooth, waves = _columns(means.places, form)
    if not freely:
        smooth, waves = np.concatenate([smooth, waves[:, :2]], axis=1), waves[:, 2:]
    root = np.linalg.cholesky(spread)
    values = _logarithms(means, spread)[:, None]
    smooth, waves, values = (np.linalg.solve(root, part) for part in (smooth, waves, values))
    basis = np.linalg.qr(smooth)[0]
    waves, values = (part - basis @ (basis.T @ part) for part in (waves, values))
    left, singular, _ = np.linalg.svd(waves, full_matrices=False)
    kept = singular > 1e-6 * singular.max(initial=0.0)
    if not kept.any():
        return float("nan")
    return float(chi2.sf(np.sum((left[:, kept].T @ values) ** 2), np.count_nonzero(kept)))


def _columns(places: Array, form: Array) -> tuple[Array, Array]:
    """Return the columns of a smooth curve over the length, and those of the harmonics of the direction."""
    y, x = (places @ np.linalg.cholesky(form)).T
    logs, angle = np.log(np.hypot(y, x)), np.arctan2(y, x)
    bends = [(logs - logs.mean()) ** power for power in range(2, _DEGREE + 1)]
    smooth = np.stack([np.ones(logs.size), 2.0 * logs, *bends], axis=1)
    return smooth, harmonics(logs, angle)


def harmonics(logs: Array, angle: Array) -> Array:
    """Return the second and fourth harmonics of an angle, and the same times a centred logarithm: (k, 8)."""
    waves = [trig(order * angle) for order in (2, 4) for trig in (np.cos, np.sin)]
    centred = logs - logs.mean()
    return np.stack([*waves, *(centred * wave for wave in waves)], axis=1)


def matrix(u: float, v: float) -> Array:
    """Return the exponential of -[[-u, v], [v, u]]: lengths along half the angle of (u, v) shrink."""
    size = float(np.hypot(u, v))
    sine = np.sinh(size) / size if size > 0 else 1.0
    return np.asarray(np.cosh(size) * np.eye(2) + sine * np.array([[u, -v], [-v, -u]]))


def log_squares(places: Array, form: Array) -> Array:
    """Return the logarithm of h' M h."""
    return np.asarray(np.log(quadratic(places, form)))


def log_square_slopes(places: Array, u: float, v: float, step: float = 1e-4) -> list[Array]:
    """Return the change of `log_squares` with u and with v."""
    square = quadratic(places, matrix(u, v))
    return [
        quadratic(places, (matrix(u + a, v + b) - matrix(u - a, v - b)) / (2 * step)) / square
        for a, b in ((step, 0.0), (0.0, step))
    ]


def quadratic(places: Array, form: Array) -> Array:
    """Return h' M h for vectors h on the last axis."""
    y, x = places[..., 0], places[..., 1]
    return np.asarray(form[0, 0] * y * y + 2.0 * form[0, 1] * y * x + form[1, 1] * x * x)


def _least_squares(design: Array, values: Array, spread: Array) -> tuple[Array, Array]:
    """Return generalised least squares and its covariance."""
    weighted = np.linalg.solve(spread, design)
    errors = np.linalg.inv(design.T @ weighted)
    return errors @ (weighted.T @ values), errors


def _inside(hurst: float) -> float:
    return float(np.clip(hurst, _LOWEST, _HIGHEST))
