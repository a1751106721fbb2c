"""Cosine modes of a fractional Brownian surface with free edges, complete or with gaps.

The modes cos(pi k (i + 1/2) / n) of a surface with free edges are almost uncorrelated for every Hurst
exponent, because reflection leaves no jump at the edges. Only modes that vary along both axes are kept: a
plane, a cylinder, an offset of each row or of each column do not change them. The remaining effect of the
edges, and the aliasing of short waves, is in the expected power, which is summed over the lattice and not
approximated (the principle of Sykulski, Olhede, Guillaumin, Lilly and Early 2019, Biometrika 106, with
cosines).

Gaps are filled by harmonic interpolation after a plane is removed: a linear operation F. The expected power
of the filled surface, diag(C F S F' C') for the covariance S, differs from that of a complete one by an
excess, which is estimated with random signs (Hutchinson 1990) and compared with the same product of the
complete lattice, whose mean is known exactly. So the fit is unbiased for gaps of any shape, and the same
probes give the standard error.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import factorial
from typing import Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.dimensions import _whittle
from fractalcontact.dimensions._harmonic_interpolation import Filling

Array = np.ndarray[Any, np.dtype[Any]]

PROBES = 6
_FEW_POINTS = 1 << 13  # points up to which all probes are taken
_SLIGHT = 0.01  # share of missing points for which one probe is enough
_MODERATE = 0.15  # the same for two, and for the error of a surface of fewer points
_SMALL = 1 << 13  # modes up to which the covariance of the score takes all probes
_SEED = 20260801
_SMOOTH = 1.1  # H above which the expected power is summed from differences: no fractal is so smooth
_ELONGATED = 30.0  # ratio of the spacings beyond which the same is done for any H
_NEAR = 24.0  # spacings up to which second differences are taken directly
_DERIVATIVES = 4  # half the highest order of the derivatives beyond


@dataclass(frozen=True)
class FreeModes:
    """Cosine modes of a surface with free edges under fractional Brownian heights (a `_whittle.Modes`).

    Attributes
    ----------
    lattice : Lattice
    chosen : ndarray of bool, shape (ny - 1, nx - 1)
        The modes that are fitted.
    power, order, sector : ndarray, shape (modes,)
        Squared mode, wavelength, and whether the wave runs steeper along y than along x.
    gapped : GappedModes, optional
        The effect of missing points; None if there are none.
    """

    lattice: Lattice
    chosen: Array
    power: Array
    order: Array
    sector: Array
    gapped: GappedModes | None = None

    @classmethod
    def of(
        cls, heights: Array, lattice: Lattice, chosen: Array, pilot: float, power: Array | None = None
    ) -> FreeModes:
        """Transform a surface; `pilot` is an exponent near its own, `power` its modes if complete."""
        observed = np.isfinite(heights)
        order, sector = wavelengths(lattice)[chosen], _wavenumber_ratio(lattice)[chosen] > 1.0
        if observed.all():
            power = mode_power(heights) if power is None else power
            return cls(lattice, chosen, power[chosen], order, sector)
        gapped = GappedModes(lattice, observed, pilot, _probes(observed))
        return cls(lattice, chosen, gapped.power(heights)[chosen], order, sector, gapped)

    def scatter(self, fit: _whittle.WhittleFit) -> float:
        """Return z of the flatness; 0 with gaps, whose effect on it is only estimated."""
        if self.gapped is not None:
            return 0.0
        return _whittle.flatness(self.power / fit.total, _whittle.CHI_SQUARE)

    def part(self, chosen: Array) -> FreeModes:
        """Return some of the modes; the effect of slight gaps on so few is below their scatter."""
        of_lattice = np.zeros_like(self.chosen)
        of_lattice[self.chosen] = chosen
        is_slight = self.gapped is not None and self.gapped.missing < _SLIGHT
        return replace(
            self,
            chosen=of_lattice,
            power=self.power[chosen],
            order=self.order[chosen],
            sector=self.sector[chosen],
            gapped=None if is_slight else self.gapped,
        )

    def fit(self, start: float, noise: bool) -> _whittle.WhittleFit:
        """Fit from a pilot estimate; with noise from two starts, of which the better end is returned."""

        def model(hurst: float) -> Array:
            return expected_power(self.lattice, hurst)[self.chosen]

        gaps: _whittle.Excess | None = None
        white = None
        if self.gapped is not None:
            gapped = self.gapped
            gaps = lambda hursts: [part[self.chosen] for part in gapped.excess(*hursts)]  # noqa: E731
            white = gapped.white_excess()[self.chosen] if noise else None
        return _whittle.fit_from_starts(self.power, model, start, noise, gaps=gaps, white_excess=white)

    @property
    def count(self) -> None:
        """None: every mode counts once."""

    @property
    def number(self) -> float:
        """Number of modes."""
        return float(self.power.size)

    def is_uneven(self, inside: Array, hurst: float) -> bool:
        """Return whether few waves of some modes carry more than their share."""
        expected = expected_power(self.lattice, hurst)[self.chosen][inside]
        return _whittle.flatness(self.power[inside] / expected, _whittle.CHI_SQUARE) < -_whittle.UNEVEN

    def error(self, fit: _whittle.WhittleFit) -> float:
        """Return the standard error of H, with the correlation of the modes at edges and gaps.

        Without gaps the full covariance of the modes, on lattices of 24 to 64 points, raises that of
        independent modes by 1 to 3 %, nearly independent of the size. Moderate gaps raise it as the lower
        number of points does, to within 3 %, and the probes by up to 3 %. With large gaps it is estimated by
        the sandwich formula: inverse bread, covariance of the score, inverse bread.
        """
        missing = 0.0 if self.gapped is None else self.gapped.missing
        if self.gapped is None or (missing < _MODERATE and self.chosen.size > _SMALL):
            correlation = 1.01 + 0.02 * float(np.clip(fit.hurst, 0.0, 1.0)) + min(0.03, missing)
            return fit.standard_error * correlation / float(np.sqrt(1.0 - missing))
        reference = self.gapped.reference_power()
        rows = np.zeros((len(fit.columns), *reference.shape))
        rows[:, self.chosen] = fit.columns / fit.total * reference[self.chosen]
        meat = 0.25 * self.gapped.score_covariance(rows, fit.hurst, fit.noise / fit.amplitude)
        bread = np.linalg.inv(fit.bread)
        square = float((bread @ meat @ bread.T)[1, 1])
        return float(np.sqrt(square)) if square > 0 else float("nan")


def _probes(observed: Array) -> int:
    """Return how many probes keep the scatter of the estimate within 3 % of that without them."""
    missing = float(np.mean(~observed))
    if observed.size <= _FEW_POINTS:
        return PROBES
    return 1 if missing < _SLIGHT else 2 if missing < _MODERATE else 4


@dataclass(frozen=True)
class Lattice:
    """Squared distances on a lattice in x spacings, and their logarithms for powers of them.

    Attributes
    ----------
    shape : (ny, nx)
    spacing : (dy/dx, 1)
    squares, logs : ndarray, shape (ny, nx)
        Squared distance from the first point over `unit`, and its logarithm (0 at the first point).
    unit : float
        A power of two near a quarter of the squared diagonal, for well-conditioned sums.
    """

    shape: tuple[int, int]
    spacing: tuple[float, float]
    squares: Array
    logs: Array
    unit: float

    @classmethod
    def of(cls, shape: tuple[int, int], spacing: tuple[float, float]) -> Lattice:
        """Tabulate the distances of one lattice."""
        y, x = (np.arange(n) * d for n, d in zip(shape, spacing, strict=True))
        squares = y[:, None] ** 2 + x**2
        unit = 2.0 ** np.frexp(squares[-1, -1] / 8.0)[1]
        squares /= unit
        logs = np.log(squares, out=np.zeros(shape), where=squares > 0)
        return cls(shape, spacing, squares, logs, unit)

    def covariance(self, hurst: float) -> Array:
        """Return the generalised covariance (c r^2 - r^2H) / (1 - H) for 0 < H < 2, r in spacings of x.

        The term in r^2 does not change modes that vary along both axes. It makes the family smooth at H = 1,
        so that a surface smoother than any fractal is recognised.
        """
        excess = hurst - 1.0
        if abs(excess) < 1e-9:
            return np.asarray(self.squares * self.logs * self.unit)
        return np.asarray(self.squares * np.expm1(excess * self.logs) * (self.unit**hurst / excess))


def mode_power(heights: Array) -> Array:
    """Return the squared orthonormal cosine modes that vary along both axes: shape (ny - 1, nx - 1)."""
    ny, nx = heights.shape
    modes = fft.dct(heights - heights.mean(), 2, (-2, -1))[1:, 1:]
    return np.asarray(modes * modes / (4.0 * ny * nx))


def expected_power(lattice: Lattice, hurst: float) -> Array:
    """Return the expectation of `mode_power` under the covariance of `Lattice.covariance`.

    Multiply by half the variance of the increment over one x spacing, times (1 - H), for a surface in
    other units.

    The sums over a covariance cancel beyond double precision where the longest waves of a large and smooth
    surface have 1e16 times the power of the shortest, and where spacings differ a hundredfold. So beyond
    H = `_SMOOTH`, or a ratio of `_ELONGATED`, the cosine modes are written as
    sine modes of the differences over one step along both axes, which is exact:
    sum_i cos(q (i + 1/2)) z_i = -sum_i sin(q i) (z_i - z_(i-1)) / (2 sin(q / 2)).
    """
    is_elongated = max(lattice.spacing) > _ELONGATED * min(lattice.spacing)
    if hurst <= _SMOOTH and not is_elongated:
        return _along(_along(lattice.covariance(hurst), 1), 0)
    if abs(hurst - 1.0) < 1e-6:  # where the differences of r^2H vanish, as does their factor 1 - H
        hurst = 1.0 + 1e-6
    power = _along(_along(_difference_covariance(lattice, hurst), 1, differences=True), 0, differences=True)
    sy, sx = (np.sin(0.5 * np.pi * np.arange(1, n) / n) ** 2 for n in lattice.shape)
    return np.asarray(power / (16.0 * sy[:, None] * sx))


def wavelengths(lattice: Lattice) -> Array:
    """Return the wavelength of every mode, in spacings of x: shape (ny - 1, nx - 1)."""
    ky, kx = (np.arange(1, n) / (2.0 * n * d) for n, d in zip(lattice.shape, lattice.spacing, strict=True))
    return np.asarray(1.0 / np.hypot(ky[:, None], kx))


def _wavenumber_ratio(lattice: Lattice) -> Array:
    """Return the wavenumber along y over that along x of every mode: shape (ny - 1, nx - 1)."""
    ky, kx = (np.arange(1, n) / (n * d) for n, d in zip(lattice.shape, lattice.spacing, strict=True))
    return np.asarray(ky[:, None] / kx)


def _along(covariance: Array, axis: int, *, differences: bool = False) -> Array:
    """Sum covariance(i - j) c_k(i) c_k(j) over i, j along one axis, for modes k = 1 to n - 1.

    The sum over pairs of lag u is (n - u) cos(pi k u / n) - sin(pi k u / n) / sin(pi k / n), over n. For the
    n - 1 differences and sine modes it is (n - u) cos(pi k u / n) + sin(pi k u / n) / tan(pi k / n).
    """
    n = covariance.shape[axis]
    shape = [1, 1]
    shape[axis] = -1
    inner = [slice(None)] * 2
    inner[axis] = slice(1, n)
    tapered = np.zeros([m + (i == axis) for i, m in enumerate(covariance.shape)])
    first = [slice(None)] * 2
    first[axis] = slice(0, n)
    tapered[tuple(first)] = covariance * np.arange(n, 0, -1.0).reshape(shape)
    cosine = fft.dct(tapered, 1, (axis,))[tuple(inner)]
    sine = fft.dst(covariance[tuple(inner)], 1, (axis,))
    angle = (np.pi * np.arange(1, n) / n).reshape(shape)
    if differences:
        return np.asarray((cosine + sine / np.tan(angle)) / n)
    return np.asarray((cosine - sine / np.sin(angle)) / n)


def _difference_covariance(lattice: Lattice, hurst: float) -> Array:
    """Return the covariance of the differences of heights over one step along both axes, at every lag.

    It is the second difference along y and x of -r^2H / (1 - H). At long lags, where the differences of r^2H
    cancel, they are summed from its derivatives: the relative error of the cut is 1e-8 at 24 spacings.
    """
    ny, nx = lattice.shape
    y2, x2 = ((np.arange(n) * d) ** 2 for n, d in zip(lattice.shape, lattice.spacing, strict=True))
    squares = y2[:, None] + x2
    squares[0, 0] = 1.0
    share = y2[:, None] / squares
    covariance, term = np.zeros(lattice.shape), np.empty(lattice.shape)
    for order in range(_DERIVATIVES, 1, -1):
        *lower, highest = _derivative(lattice.spacing, hurst, order)
        term.fill(highest)
        for coefficient in reversed(lower):  # in place: `polyval` takes two more arrays of the plane
            term *= share
            term += coefficient
        covariance += term
        covariance /= squares
    covariance /= squares
    covariance *= np.power(squares, hurst, out=term)
    del share, term
    near = [
        min(n, int(_NEAR * max(lattice.spacing) / d) + 1)
        for n, d in zip((ny, nx), lattice.spacing, strict=True)
    ]
    y, x = (np.abs(np.arange(-1, n + 1)) * d for n, d in zip(near, lattice.spacing, strict=True))
    # less what varies along the longer spacing only, which cancels in differences along the shorter one
    long, short = (y[:, None], x) if lattice.spacing[0] > lattice.spacing[1] else (x, y[:, None])
    unit = np.where(long > 0.0, long, 1.0)
    power = unit ** (2 * hurst) * np.expm1(hurst * np.log1p((short / unit) ** 2))
    power = np.where(long > 0.0, power, short ** (2 * hurst))
    covariance[: near[0], : near[1]] = np.diff(np.diff(power, 2, 0), 2, 1)
    return np.asarray(covariance / (hurst - 1.0))


def _derivative(spacing: tuple[float, float], hurst: float, order: int) -> Array:
    """Return the derivatives of r^2H of one order in the second difference along both axes.

    Coefficients of powers of y^2 / r^2; derivatives of order 2p along y and 2q along x, p + q equal to
    `order`, times r^(2 order - 2H), and weighted as in the Taylor series of a second difference.
    """
    total = np.polynomial.Polynomial([0.0])
    along_y = np.polynomial.Polynomial([0.0, 1.0])
    for p in range(1, order):
        q = order - p
        weight = 4.0 * spacing[0] ** (2 * p) * spacing[1] ** (2 * q)
        for i in range(p + 1):
            for j in range(q + 1):
                falling = float(np.prod(hurst - np.arange(2 * order - i - j)))
                ways = factorial(i) * factorial(2 * p - 2 * i) * factorial(j) * factorial(2 * q - 2 * j)
                factor = weight * falling * 4.0 ** (order - i - j) / ways
                total += factor * along_y ** (p - i) * (1.0 - along_y) ** (q - j)
    return np.asarray(total.coef)


class GappedModes:
    """Cosine modes of a surface with gaps, their expected power, and the covariance of their sums.

    Parameters
    ----------
    lattice : Lattice
    observed : ndarray of bool, shape (ny, nx)
    reference : float
        A Hurst exponent near that of the surface: the probes are white after division by its expected
        power, which keeps their scatter small for any H.
    probes : int
        Number of random sign patterns.
    filling : Filling, optional
        That of `observed`, if it is at hand.
    """

    def __init__(
        self,
        lattice: Lattice,
        observed: Array,
        reference: float,
        probes: int = PROBES,
        filling: Filling | None = None,
    ) -> None:
        self.lattice, self.observed = lattice, observed
        self.missing = float(np.mean(~observed))
        self.filling = Filling(observed, lattice.spacing) if filling is None else filling
        self._root = 1.0 / np.sqrt(expected_power(lattice, reference))
        rng = np.random.default_rng(_SEED)
        self._signs = [rng.integers(0, 2, self._root.shape) * 2.0 - 1.0 for _ in range(probes)]
        self._sources = []
        for sign in self._signs:
            heights = _from_modes(self._root * sign)
            self._sources.append((self.filling.transpose(heights), heights))

    def power(self, heights: Array) -> Array:
        """Return the squared modes of the filled surface."""
        values = heights[self.observed]
        return np.asarray(cosine_modes(self.filling(values - values.mean())) ** 2)

    def excess(self, *hursts: float) -> list[Array]:
        """Return the excess of the expected power over that of the complete surface, at each exponent."""
        symbols = [_symbol(self.lattice.covariance(hurst)) for hurst in hursts]
        excess = [np.zeros(self._root.shape) for _ in hursts]
        for sign, (observed, complete) in zip(self._signs, self._sources, strict=True):
            modes = _padded_modes(complete)  # one transform for all exponents
            whole = [_product(symbol, modes, complete.shape) for symbol in symbols]
            modes = _padded_modes(self._embed(observed))
            for k, symbol in enumerate(symbols):
                filled = self.filling(_product(symbol, modes, complete.shape)[self.observed])
                excess[k] += sign * cosine_modes(filled - whole[k])
        return [part / (len(self._signs) * self._root) for part in excess]

    def white_excess(self) -> Array:
        """Return the excess of the expected power of white noise."""
        pairs = zip(self._signs, self._sources, strict=True)
        excess = sum(
            sign * cosine_modes(self.filling(observed) - complete) for sign, (observed, complete) in pairs
        )
        return np.asarray(excess / (len(self._signs) * self._root))

    def score_covariance(self, weights: Array, hurst: float, noise: float = 0.0) -> Array:
        """Return the covariance of sum(w_k power_k / reference_k) for every row w of `weights`.

        It is 2 tr(w_i K w_j K), with K the covariance of the modes for unit amplitude over the root of
        the reference power.
        """
        symbol = _symbol(self.lattice.covariance(hurst)) + noise
        total = np.zeros((len(weights), len(weights)))
        # one probe is enough here for all but small surfaces: its scatter falls with the number of modes
        signs = self._signs if self._root.size < _SMALL else self._signs[:1]
        for sign in signs:
            product = self._correlate(symbol, sign)
            left = [w * product for w in weights]
            right = [self._correlate(symbol, w * sign) for w in weights]
            total += [[float(np.sum(a * b)) for b in right] for a in left]
        return np.asarray((total + total.T) / len(signs))

    def reference_power(self) -> Array:
        """Return the power by which the modes of `score_covariance` are divided."""
        return np.asarray(self._root**-2)

    def _correlate(self, symbol: Array, modes: Array) -> Array:
        """Apply the covariance of the modes, scaled by the reference power."""
        values = self.filling.transpose(_from_modes(self._root * modes))
        values = _convolved(symbol, self._embed(values))[self.observed]
        return np.asarray(self._root * cosine_modes(self.filling(values)))

    def _embed(self, values: Array) -> Array:
        heights = np.zeros(self.observed.shape)
        heights[self.observed] = values
        return heights


def relative_excess(lattice: Lattice, filling: Filling, hurst: float, probes: int) -> Array:
    """Return what gaps add to the expected power of each mode, over that of the complete surface.

    As `GappedModes.excess` at its reference. Most of the scatter of random signs is that of the points that
    are left out, C M C' for the mask M of missing points: it is replaced by its diagonal, which is known.
    One probe so has the scatter of four to ten.
    """
    observed = filling.observed
    root = 1.0 / np.sqrt(expected_power(lattice, hurst))
    quarter = fft.dct(np.pad(lattice.covariance(hurst), ((0, 1), (0, 1))), 1, (0, 1))
    rng = np.random.default_rng(_SEED)
    total = np.zeros(root.shape)
    ny, nx = lattice.shape
    torus = np.empty((2 * ny, nx + 1), dtype=complex)
    for _ in range(probes):
        sign = rng.integers(0, 2, root.shape, dtype=np.int8) * 2.0 - 1.0
        heights = _from_modes(root * sign)
        seen = np.zeros(observed.shape)
        seen[observed] = filling.transpose(heights)
        change = filling(_quarter_product(quarter, seen, torus)[observed])
        change -= _quarter_product(quarter, heights, torus)
        total += sign * (root * cosine_modes(change) + _left_out(observed, sign))
    return np.asarray(total / probes - _missing_share(observed))


def relative_white_excess(filling: Filling, probes: int) -> Array:
    """Return what gaps add to the expected power of white noise of unit variance, as `relative_excess`."""
    observed = filling.observed
    shape = tuple(n - 1 for n in observed.shape)
    rng, total = np.random.default_rng(_SEED), np.zeros(shape)
    for _ in range(probes):
        sign = rng.integers(0, 2, shape, dtype=np.int8) * 2.0 - 1.0
        heights = _from_modes(sign)
        change = cosine_modes(filling(filling.transpose(heights)) - heights)
        total += sign * (change + _left_out(observed, sign))
    return np.asarray(total / probes - _missing_share(observed))


def _left_out(observed: Array, modes: Array) -> Array:
    """Apply C M C' to modes, M being the mask of missing points."""
    return cosine_modes(np.where(observed, 0.0, _from_modes(modes)))


def _missing_share(observed: Array) -> Array:
    """Return the diagonal of C M C' from the cosine modes of twice the wavenumber of the mask M."""
    shape = observed.shape
    doubled = fft.dct((~observed).astype(float), 2, (0, 1)) / 4.0
    share = doubled[0, 0]
    places, signs = [], []
    for n in shape:
        mode = 2 * np.arange(1, n)
        places.append(np.where(mode < n, mode, 2 * n - mode) % n)
        signs.append(np.sign(n - mode).astype(float))
    (y, x), (along_y, along_x) = places, signs
    share = share + along_x * doubled[0, x] + (along_y * doubled[y, 0])[:, None]
    return np.asarray((share + along_y[:, None] * along_x * doubled[np.ix_(y, x)]) / (shape[0] * shape[1]))


def _quarter_product(quarter: Array, heights: Array, torus: Array) -> Array:
    """Multiply heights by a covariance matrix, given a quarter of its spectrum; `torus` is room."""
    ny, nx = heights.shape
    modes = fft.rfft2_padded(heights, (2 * ny, 2 * nx), torus)
    modes[: ny + 1] *= quarter
    modes[ny + 1 :] *= quarter[ny - 1 : 0 : -1]
    return fft.irfft2_cropped(modes, (2 * ny, 2 * nx), (ny, nx))


def cosine_modes(heights: Array) -> Array:
    """Return the orthonormal cosine modes that vary along both axes."""
    ny, nx = heights.shape
    return np.asarray(fft.dct(heights, 2, (0, 1))[1:, 1:] / (2.0 * np.sqrt(ny * nx)))


def _from_modes(modes: Array) -> Array:
    """Apply the transpose of `cosine_modes`."""
    ny, nx = (n + 1 for n in modes.shape)
    heights = np.zeros((ny, nx))
    heights[1:, 1:] = modes
    return np.asarray(fft.dct(heights, 3, (0, 1)) / (2.0 * np.sqrt(ny * nx)))


def _symbol(covariance: Array) -> Array:
    """Return the spectrum of a covariance on the torus of twice the size."""
    ny, nx = covariance.shape
    quarter = fft.dct(np.pad(covariance, ((0, 1), (0, 1))), 1, (0, 1))
    index = np.arange(2 * ny)
    return np.asarray(quarter[np.minimum(index, 2 * ny - index)][:, : nx + 1])


def _convolved(symbol: Array, heights: Array) -> Array:
    """Multiply heights by the covariance matrix, by transforms on the torus."""
    return _product(symbol, _padded_modes(heights), heights.shape)


def _padded_modes(heights: Array) -> Array:
    """Transform heights on the torus of twice the size."""
    ny, nx = heights.shape
    return fft.rfft2_padded(heights, (2 * ny, 2 * nx))


def _product(symbol: Array, modes: Array, shape: tuple[int, ...]) -> Array:
    """Multiply transformed heights by the covariance matrix."""
    ny, nx = shape
    return fft.irfft2_cropped(symbol * modes, (2 * ny, 2 * nx), (ny, nx))
