"""Exponents and amplitudes of a surface by azimuth, its metric, and tests of isotropy.

1. The Laplacian of the heights is stationary, with a nearly even spectrum. Its Fourier modes know the sign of
   the azimuth. For any metric, blur and noise their expected power is the transform of the autocovariance
   times the autocorrelation of the taper (Sykulski et al. 2019, Biometrika 106, 251-266): within .1 % of the
   sum over all pairs of points, but for the longest wave (5 %). Periodic surfaces have the modes of their
   heights.
2. The power over that expected is averaged in classes: rings, and sectors of azimuth. Fisher scoring of the
   classes over the mean of their ring gives the metric; the posterior of the rings exponent and nuisances.
3. The probability of each hypothesis is multiplied by that of the azimuths, with the metric of its own.
4. The exponent along an azimuth is that of the posterior plus the difference of a fit to the classes,
   weighted by their azimuth, from one to all of them. Blur, noise and bend are alike in all azimuths.
5. Harmonics of the azimuth, in level and in slope, vanish except for chance (score test).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fractalcontact.base import fft
from fractalcontact.base.numbers import Array
from fractalcontact.base.spectra import half_wavenumbers
from fractalcontact.dimensions._gaussian_mixture import ALIASED, Bins, alias_logs, mixture, spread_nodes
from fractalcontact.dimensions._metric_spectrum import LARGEST_LOG_RATIO, MetricSpectrum, gaussian_tables
from fractalcontact.dimensions._mode_bins import (
    LEAST,
    LEAST_BINS,
    PER_OCTAVE,
    SETTLED,
    Filling,
    clear_modes,
    joined_classes,
    log_means,
)
from fractalcontact.dimensions._mode_fit import FirstFit
from fractalcontact.dimensions._spectral_posterior import (
    DEPARTURE,
    HURST,
    NOISE,
    RATIO_DEVIATION,
    SPREAD,
    Known,
    Posterior,
    decay,
    posterior,
)
from fractalcontact.dimensions._surface_input import Scales, between, middle_slices

LARGEST = 2048  # points along each axis: 5 s of processor time and .8 GB
LARGEST_SPACINGS = 32.0  # ratio of the spacings: images are summed as far along both axes
SECTORS = 16  # of the half-circle
# cos^16 of the angle to an azimuth weights the modes, as many as a sector of 25 degrees either side. Of
# exponents .4 and .8 that were built in it finds .90 and .45; cos^8 .85 and .79, cos^24 .92 and .29
_SHARPNESS = 16
_SAMPLE = 4  # modes of a class in which a change of the expected power is followed
_TAPERED = 0.05  # share of an edge over which the taper rises
_LEAK = 0.25  # power of the edges over that of a mode, either way, from which on neighbours are correlated
_EMPTY = 1e-14  # of the largest level: rounding
_CUT_OFF = 1e-4  # power of a ring over that an octave before; a blur of a spacing has 4e-5
_POSSIBLE = 1e-3  # probability of a hypothesis whose azimuths are looked at
_ROUNDS = 12  # of a fit; 6 changed exponents of azimuths of 32 x 32 points
IMPROBABLE = 1e-3  # p value below which no anisotropy ratio describes the surface
NO_METRIC = "the surface does not fit the model, anisotropic fractional Brownian: the scatter is unknown"
_EXPONENTS, _STEP = np.linspace(0.02, 0.98, 13, retstep=True)  # between which logarithms are linear to 1 %
_SAME = 0.03  # change of the log ratio that needs no other expected power


class PlaneModes:
    """Fourier modes of a surface, of its Laplacian where its edges are free.

    Parameters
    ----------
    shape : (ny, nx)
        Of the heights.
    dy : float
        Spacing along y; that along x is one.
    is_periodic : bool
    """

    def __init__(self, shape: tuple[int, int], dy: float, is_periodic: bool) -> None:
        self.dy, self.is_periodic = dy, is_periodic
        self.shape = shape if is_periodic else (shape[0] - 2, shape[1] - 2)
        tapers = [_taper(n, 0.0 if is_periodic else _TAPERED) for n in self.shape]
        self.taper = np.outer(*tapers)
        self.information = math.prod(1.0 / (w.size * np.sum(w**4)) for w in tapers)
        padded = [np.pad(w, (0, w.size)) for w in tapers]
        self.overlaps = [fft.irfft(np.square(np.abs(fft.rfft(w))) + 0j, w.size) for w in padded]
        self.y, self.x = self._wavenumbers(1)
        # one of each pair of conjugates, without those of two spacings, of which some are real
        self.half = (np.abs(self.y) * dy < np.pi - 1e-9) & (self.x < np.pi - 1e-9)
        self.half[self.y[:, 0] <= 0.0, 0] = False

    def _wavenumbers(self, factor: int) -> tuple[Array, Array]:
        y, x = half_wavenumbers((factor * self.shape[0], factor * self.shape[1]), (self.dy, 1.0))
        return y[:, None], x

    def power(self, heights: Array) -> Array:
        """Return the squared modes of complete heights."""
        z = heights
        if not self.is_periodic:
            twice = 2.0 * z[1:-1, 1:-1]
            down = (z[2:, 1:-1] + z[:-2, 1:-1] - twice) / self.dy**2
            z = down + z[1:-1, 2:] + z[1:-1, :-2] - twice
        modes = fft.rfft2(z * self.taper)
        return np.asarray(np.square(modes.real) + np.square(modes.imag))

    def filtered(self, density: Array | float, y: Array, x: Array) -> Array:
        """Return the density of what is transformed: of the heights, or of their Laplacian."""
        if self.is_periodic:
            return density * np.ones(np.broadcast(y, x).shape)
        return density * np.square((2.0 - 2.0 * np.cos(y * self.dy)) / self.dy**2 + 2.0 - 2.0 * np.cos(x))

    def expected(self, spectrum: MetricSpectrum) -> tuple[Array, Array, Array]:
        """Return the expected power of each mode, the density, and that of the fractal without a blur."""
        factor = 1 if self.is_periodic else 2
        y, x = self._wavenumbers(factor)
        density = self.filtered(spectrum.with_noise(y, x), y, x)
        density[0, 0] = 0.0
        expected, clean = np.maximum(density, 1e-300), density[::factor, ::factor]
        if not self.is_periodic:
            (ny, nx), (along_y, along_x) = self.shape, self.overlaps
            lags = fft.irfft2(density.astype(complex), (2 * ny, 2 * nx), overwrite=True)
            lags *= along_y[:, None]
            # every second mode is one of the sum over periods
            lags = (lags[:ny] + lags[ny:]) * along_x
            expected = np.maximum(fft.rfft2(lags[:, :nx] + lags[:, nx:]).real, 1e-300)
        if spectrum.theta[SPREAD] == 0.0:
            return expected, clean, clean
        sharp = np.where(np.arange(spectrum.theta.size) == SPREAD, 0.0, spectrum.theta)
        unblurred = replace(spectrum, theta=sharp).at(self.y, self.x)
        return expected, clean, self.filtered(unblurred, self.y, self.x)


def _taper(n: int, share: float) -> Array:
    """Return a taper that rises as a sine over a share of both ends; its squares sum to one."""
    number = round(share * n)
    taper = np.ones(n)
    taper[:number] = np.sin(0.5 * np.pi * (np.arange(number) + 0.5) / max(number, 1))
    taper = np.minimum(taper, taper[::-1])
    return np.asarray(taper / math.sqrt(taper @ taper))


def _rings(lnq: Array) -> Array:
    """Return the ring of each mode."""
    return np.asarray((lnq - lnq.min(initial=np.inf)) * (PER_OCTAVE / math.log(2.0)) + 1e-9).astype(int)


def _numbered(values: Array) -> tuple[Array, Array]:
    """Return the whole numbers that are there, and the place of each value: `numpy.unique` without a sort."""
    is_there = np.bincount(values) > 0
    return np.flatnonzero(is_there), np.cumsum(is_there)[values] - 1


def _shortest(modes: PlaneModes, power: Array) -> float:
    """Return the shortest wavelength before a cut-off, beyond which there is only leakage; 0 without one."""
    q = np.hypot(modes.y, modes.x)[modes.half]
    ring = _numbered(_rings(np.log(q)))[1]
    density = power[modes.half] / np.maximum(modes.filtered(1.0, modes.y, modes.x)[modes.half], 1e-300)
    mean = np.bincount(ring, density) / np.bincount(ring)
    falls = np.flatnonzero(mean[PER_OCTAVE:] < _CUT_OFF * mean[:-PER_OCTAVE])
    return 2.0 * np.pi / float(q[ring < falls[0] + PER_OCTAVE - 1].max()) if falls.size else 0.0


class Classes:
    """Classes of modes: rings of a third of an octave by sectors of azimuth.

    Parameters
    ----------
    modes : PlaneModes
    power : ndarray
        Of each mode.
    spectrum : MetricSpectrum
        By which the power is divided.
    scales : (low, high), optional
        Wavelengths that count, in x spacings.
    """

    def __init__(self, modes: PlaneModes, power: Array, spectrum: MetricSpectrum, scales: Scales) -> None:
        self.modes, self.spectrum = modes, spectrum
        expected, clean, unblurred = modes.expected(spectrum)
        q = np.hypot(modes.y, modes.x)
        keep = modes.half & clear_modes(expected, clean, unblurred, leak=_LEAK / (1.0 + _LEAK))
        keep &= expected >= (1.0 - _LEAK) * clean
        keep &= between(2.0 * np.pi / np.maximum(q, 1e-300), scales)
        lnq = np.log(q[keep])
        ring = _rings(lnq)
        ring = joined_classes(np.bincount(ring))[ring].astype(int)
        self.places, self.expected = np.flatnonzero(keep), expected[keep]
        self.rings = int(ring.max(initial=0)) + 1
        y, x = (np.broadcast_to(q, keep.shape)[keep] for q in (modes.y, modes.x))
        sector = np.rint(np.arctan2(y, x) * (SECTORS / np.pi)).astype(int) % SECTORS
        present, self.number = _numbered(ring * SECTORS + sector)
        self.ring, self.sector = np.divmod(present, SECTORS)
        self.count = np.bincount(self.number).astype(float)
        self.information = np.full(self.count.shape, modes.information)
        self.correction = np.ones(self.count.shape)
        self.level = self.means(power)
        self.lnq = np.bincount(self.number, lnq) / self.count
        # some modes of each class, evenly by their wavenumber
        order, ends = np.argsort(lnq, kind="stable"), np.cumsum(self.count).astype(int)
        order = order[np.argsort(self.number[order].astype(np.int16), kind="stable")]  # by class: few digits
        size = np.minimum(self.count, _SAMPLE).astype(int)
        self.first = np.cumsum(size) - size
        within = (np.arange(size.sum()) - np.repeat(self.first, size) + 0.5) / np.repeat(size, size)
        starts = np.repeat(ends - self.count, size)
        place = order[(starts + within * np.repeat(self.count, size)).astype(int)]
        self.size, self.sample = size, (y[place], x[place])

    def means(self, power: Array) -> Array:
        """Return the mean of a power over that expected, for each class."""
        return np.asarray(np.bincount(self.number, power.ravel()[self.places] / self.expected) / self.count)

    def corrected(self, before: Array, after: Array) -> None:
        """Correct for gaps, by the levels of Gaussian surfaces before and after filling: (surfaces, classes).

        The scatter of those after filling gives the information of each ring.
        """
        mean, freedom = after.mean(axis=0), len(after) / (len(after) - 1.0)
        scatter = freedom * self.count * np.mean(np.square(after / mean - 1.0), axis=0)
        self.correction = mean / before.mean(axis=0)
        self.level /= self.correction
        self.information /= np.maximum(1.0, self.by_ring(scatter, np.ones(mean.size)))[self.ring]

    @cached_property
    def _before(self) -> Array:
        return self.spectrum.with_noise(*self.sample)

    def _of_sample(self, values: Array) -> Array:
        return np.asarray(np.add.reduceat(values, self.first) / self.size)

    def relative(self, spectrum: MetricSpectrum) -> Array:
        """Return the power of a spectrum over that by which the power was divided."""
        return self._of_sample(spectrum.with_noise(*self.sample) / self._before)

    def by_ring(self, values: Array, weight: Array) -> Array:
        """Return the weighted mean in each ring; 0 without a weight."""
        total = np.maximum(np.bincount(self.ring, weight), 1e-300)
        return np.asarray(np.bincount(self.ring, weight * values) / total)

    def excess(self, relative: Array) -> Array:
        """Return the level over a power, `relative` to that expected, over the mean of the ring, less one."""
        ratio = self.level / np.maximum(relative, 1e-300)
        return np.asarray(ratio / self.by_ring(ratio, self.count)[self.ring] - 1.0)

    def centred(self, columns: list[Array]) -> Array:
        """Return columns less the mean of their ring, shape (classes, columns)."""
        return np.stack([c - self.by_ring(c, self.count)[self.ring] for c in columns], axis=1)

    def metric_columns(self, spectrum: MetricSpectrum, relative: Array, step: float = 1e-4) -> list[Array]:
        """Return the derivatives of the logarithms with respect to the components of the log ratio.

        `relative`: power of the spectrum.
        """
        moved = [replace(spectrum, log_ratio=spectrum.log_ratio + move) for move in np.eye(2) * step]
        powers = relative, *(self.relative(each) for each in moved)
        here, *there = (np.log(np.maximum(power, 1e-300)) for power in powers)
        return [(each - here) / step for each in there]

    def fit_metric(self, spectrum: MetricSpectrum) -> tuple[MetricSpectrum, Array, float]:
        """Return the spectrum with the log ratio by Fisher scoring, its covariance, and -2 log evidence.

        The evidence is that of the classes about the mean of their ring, over the prior of the log ratio. A
        lay is there with the probability of a departure: u and v are normal. Without one they are zero. With
        no prior the azimuths of a few long waves of white noise make a blurred lay as probable as noise.
        """
        weight = self.count * self.information
        for _ in range(_ROUNDS):
            relative = self.relative(spectrum)
            columns = self.centred(self.metric_columns(spectrum, relative))
            information = (weight[:, None] * columns).T @ columns
            covariance = np.linalg.pinv(information)
            step = covariance @ (columns.T @ (weight * self.excess(relative)))
            uv = spectrum.log_ratio + step / max(1.0, math.hypot(*step))
            uv /= max(1.0, math.hypot(*uv) / LARGEST_LOG_RATIO)
            moved = math.hypot(*(uv - spectrum.log_ratio))  # by nothing at the largest log ratio
            spectrum = replace(spectrum, log_ratio=uv)
            if moved < 0.01:
                break
        excess = self.excess(self.relative(spectrum))
        deviance = 2.0 * weight @ (excess - np.log(np.maximum(1.0 + excess, _EMPTY)))
        over = np.eye(2) + RATIO_DEVIATION**2 * information
        turned = uv @ information @ np.linalg.solve(over, uv) + np.linalg.slogdet(over)[1]
        isotropic = uv @ information @ uv  # by so much the deviance is higher without a lay
        logs = math.log(DEPARTURE) - 0.5 * turned, math.log(1.0 - DEPARTURE) - 0.5 * isotropic
        return spectrum, covariance, float(deviance - 2.0 * np.logaddexp(*logs))

    @property
    def _logs(self) -> tuple[Array, Array]:
        """Logarithms of the levels, unbiased, and their variances."""
        floor = _EMPTY * float(self.level.max())
        return log_means(np.maximum(self.level, floor), np.maximum(self.count * self.information, 1e-3))

    def bins(self, spectrum: MetricSpectrum, covariance: Array) -> Bins:
        """Return the bins of the posterior: the rings, with the mean logarithms of their classes.

        Where the exponent differs with the azimuth the mean of the logarithms has the mean exponent. All
        rings share the error of the log ratio, whose `covariance` is given.
        """
        modes = self.modes
        edges = modes.shape[0] * modes.dy, float(modes.shape[1])
        t, extent = mixture(max(edges)), max(edges)
        spreads, nodes = spread_nodes(min(edges), is_pilot=False)
        logs, variance = self._logs
        total = np.bincount(self.ring, 1.0 / variance)
        share = 1.0 / (variance * total[self.ring])
        even = np.repeat(share / self.size, self.size)
        weight = even / self._before
        starts = self.first[np.flatnonzero(np.diff(self.ring, prepend=-1))]
        tables = gaussian_tables(t, spreads, spectrum, *self.sample, weight, starts)
        lnq = self.by_ring(self.lnq, self.count)
        level, white = self.by_ring(logs, share), np.add.reduceat(weight, starts)
        ln_alias = np.add.reduceat(even * alias_logs(*self.sample, modes.dy, 2), starts)
        columns = self.metric_columns(spectrum, self.relative(spectrum))
        slopes = np.stack([self.by_ring(column, share) for column in columns], axis=1)
        bins = Bins(level, 1.0 / total, tables, nodes, t, white, lnq, ln_alias, extent, min(1.0, modes.dy), 2)
        with_prior = np.linalg.solve(np.eye(2) + covariance / RATIO_DEVIATION**2, covariance)
        return replace(bins, shared=slopes @ with_prior @ slopes.T)

    def along(self, spectrum: MetricSpectrum, azimuths: Array) -> Array:
        """Fit amplitude and exponent to all waves, and to those about azimuths (degree).

        Returns
        -------
        ndarray, shape (1 + azimuths, 3)
            Logarithm of the amplitude, exponent, and its variance, multiplied by chi square per degree of
            freedom where that is above one.
        """
        theta = spectrum.theta
        spectra = [replace(spectrum, theta=np.r_[hurst, theta[1:]]) for hurst in _EXPONENTS]
        powers = np.log([self._of_sample(each.at(*self.sample) / self._before) for each in spectra])
        noise = self._of_sample(theta[NOISE] ** 2 / self._before)
        logs, variance = self._logs
        angles = np.pi / SECTORS * self.sector - np.radians(azimuths)[:, None]
        found = []
        for weight in (np.ones(logs.size), *np.abs(np.cos(angles)) ** _SHARPNESS):
            share = weight / variance
            a, hurst = 0.0, float(theta[HURST])
            for _ in range(_ROUNDS):  # Gauss-Newton
                k = min(max(int((hurst - _EXPONENTS[0]) / _STEP), 0), _EXPONENTS.size - 2)
                slope = (powers[k + 1] - powers[k]) / _STEP
                power = np.exp(a + powers[k] + (hurst - _EXPONENTS[k]) * slope)
                part = power / (power + noise)
                design = np.stack([part, part * slope], axis=1)
                residual = logs - np.log(power + noise)
                inverse = np.linalg.pinv((share[:, None] * design).T @ design)
                step = np.clip(inverse @ (design.T @ (share * residual)), -0.5, 0.5)
                a, hurst = a + float(step[0]), min(max(hurst + float(step[1]), -0.5), 1.5)
                if np.abs(step).max() < 1e-6:
                    break
            scatter = inverse @ ((share * share * variance)[:, None] * design).T @ design @ inverse
            square = float(share @ np.square(residual)) / weight.sum()
            found.append((a, hurst, scatter[1, 1] * max(1.0, square)))
        return np.array(found)

    def test(self, spectrum: MetricSpectrum, *, is_fitted: bool, shortest: float = 3.0) -> float:
        """Return the p value of harmonics of the azimuth of waves longer than the `shortest`, in spacings.

        `is_fitted`: the log ratio of the spectrum was fitted.
        """
        from scipy.special import chdtrc

        lower = np.linalg.cholesky(spectrum.inverse)
        azimuth = np.pi / SECTORS * self.sector
        across = lower[0, 0] * np.sin(azimuth) + lower[1, 0] * np.cos(azimuth)
        azimuth = np.arctan2(across, lower[1, 1] * np.cos(azimuth))
        waves = [wave(order * azimuth) for order in (2, 4) for wave in (np.cos, np.sin)]
        columns = [*waves, *(self.lnq * wave for wave in waves)]
        relative = self.relative(spectrum)
        if is_fitted:
            columns[:2] = self.metric_columns(spectrum, relative)
        length = 2.0 * np.pi / np.exp(self.by_ring(self.lnq, self.count)) / max(1.0, self.modes.dy)
        weight = self.count * self.information * (length > shortest)[self.ring]
        centred = self.centred(columns)
        score = centred.T @ (weight * self.excess(relative))
        covariance = (weight[:, None] * centred).T @ centred
        if is_fitted:
            projection = covariance[2:, :2] @ np.linalg.pinv(covariance[:2, :2])
            score = score[2:] - projection @ score[:2]
            covariance = covariance[2:, 2:] - projection @ covariance[:2, 2:]
        return float(chdtrc(score.size, score @ np.linalg.pinv(covariance) @ score))


@dataclass(frozen=True)
class AzimuthFit:
    """Classes of a surface, their most probable spectrum, its metric, and the posterior of the exponent.

    Attributes
    ----------
    classes : Classes
    spectrum : MetricSpectrum
        Isotropic where no metric describes the surface.
    uv : ndarray, shape (2,)
        Components of the log ratio.
    covariance : ndarray, shape (2, 2)
        Of these.
    bins : Bins
        Its rings.
    found : Posterior
    p_values : tuple of float
        That an isotropic surface, and one of this metric, differs as much between azimuths; NaN where
        the filling of gaps has made the short waves.
    """

    classes: Classes
    spectrum: MetricSpectrum
    uv: Array
    covariance: Array
    bins: Bins
    found: Posterior
    p_values: tuple[float, float]


def fit_azimuths(
    first: FirstFit, scales: Scales, known: Known, *, least_log_ratio: float = 0.0
) -> AzimuthFit | None:
    """Fit the waves of a surface, or of its middle, by azimuth.

    None if they are too few, if their lengths differ by less than `least_log_ratio`, or the spacings by more
    than `LARGEST_SPACINGS`. `scales`: wavelengths that count, in x spacings.
    """
    middle = middle_slices(first.heights.shape, LARGEST)
    observed, heights = np.isfinite(first.heights[middle]), first.filled[middle]
    dy = first.lattice.spacing[0]
    if max(dy, 1.0 / dy) > LARGEST_SPACINGS:
        return None
    is_periodic = first.lattice.periodic and heights.shape == first.heights.shape
    modes = PlaneModes((heights.shape[0], heights.shape[1]), dy, is_periodic)
    power = modes.power(heights)
    low, high = (0.0, np.inf) if scales is None else scales
    band = max(low, _shortest(modes, power)), high

    def classes_of(spectrum: MetricSpectrum) -> Classes | None:
        classes = Classes(modes, power, spectrum, band)
        if classes.places.size < LEAST * LEAST_BINS or classes.rings < LEAST_BINS:
            return None
        if first.filling is not None:
            classes.corrected(*_filled_levels(classes, observed))
        return classes

    def most_probable(
        classes: Classes, spectrum: MetricSpectrum, covariance: Array
    ) -> tuple[Bins, Posterior, MetricSpectrum, Array]:
        """Return bins, posterior, spectrum, and the covariance of its log ratio.

        The probability of a hypothesis is multiplied by that of the azimuths, with a metric of its own.
        """
        bins = replace(classes.bins(spectrum, covariance), noise=known.total_noise)
        found = posterior(bins, known, pilot_spread=float(spectrum.theta[SPREAD]))
        fits, share = [], np.zeros_like(found.share)
        for m in np.flatnonzero(found.share.sum(axis=1) > _POSSIBLE).tolist():
            hypothesis, _, theta = peak = found.peak(m)
            each = replace(spectrum, theta=theta, form=hypothesis.form, decay=decay(bins, *peak))
            fits.append((*classes.fit_metric(each), m))
        least = min(fit[2] for fit in fits)
        for *_, deviance, m in fits:
            share[m] = found.share[m] * math.exp(0.5 * (least - deviance))
        found = replace(found, share=share / share.sum())
        return bins, found, *max(fits, key=lambda fit: float(found.share[fit[3]].sum()))[:2]

    # what filling does to short waves looks like a blur until it is corrected
    theta, form = (first.theta, first.form) if first.filling is None else (first.exact, ALIASED)
    spectrum = MetricSpectrum(theta, form, first.log_ratio, dy)
    nearest = math.inf
    # of 200 surfaces under a lay 199 settled in 1 to 4, one not in 12; beside gaps it may take longer
    for _ in range(_ROUNDS if first.filling is not None else _ROUNDS // 3):
        classes = classes_of(spectrum)
        if classes is None:
            return None
        spectrum, covariance, _ = classes.fit_metric(spectrum)
        if math.hypot(*spectrum.log_ratio) < least_log_ratio:
            return None
        bins, found, spectrum, covariance = most_probable(classes, spectrum, covariance)
        moved = math.hypot(*(spectrum.log_ratio - classes.spectrum.log_ratio))
        change = classes.by_ring(np.log(classes.relative(spectrum)), classes.count)
        effect = np.log(classes.by_ring(classes.correction, classes.count)) * (change - change.mean())
        has_settled = moved < _SAME and np.ptp(change) < 0.7 and np.abs(effect).max() < SETTLED
        if has_settled or not moved >= nearest:  # the first one in any case
            nearest, result = moved, (classes, bins, found, spectrum, covariance)
        if has_settled:
            break
    # if none settles, as of white noise, the one whose metric ends nearest to its start
    classes, bins, found, spectrum, covariance = result
    isotropic, uv = replace(spectrum, log_ratio=np.zeros(2)), spectrum.log_ratio
    p_values = classes.test(isotropic, is_fitted=False), classes.test(spectrum, is_fitted=True)
    if first.filling is not None and not found.most_probable[1].inside.all():
        # beyond a cut the waves are those of the filling, which know the axes
        p_values = math.nan, math.nan
    if p_values[1] < IMPROBABLE:  # each azimuth is compared with all of them
        bins, found, spectrum, _ = most_probable(classes, isotropic, np.zeros((2, 2)))
        spectrum = replace(spectrum, log_ratio=np.zeros(2))
    return AzimuthFit(classes, spectrum, uv, covariance, bins, found, p_values)


def _filled_levels(classes: Classes, observed: Array) -> tuple[Array, Array]:
    """Return the levels of Gaussian surfaces with the spectrum of the classes before and after filling."""
    stream, modes, filling = np.random.default_rng(1), classes.modes, Filling(observed)
    ny, nx = observed.shape
    y, x = half_wavenumbers((2 * ny, 2 * nx), (modes.dy, 1.0))
    root = np.sqrt(classes.spectrum.with_noise(y[:, None], x))
    root[0, 0] = 0.0
    levels: list[list[Array]] = []
    # of four surfaces each: with eight in place of four errors of 512 x 512 points are no smaller
    for _ in range(1 if ny * nx > 1 << 17 else 2):
        white = fft.rfft2(stream.standard_normal((2 * ny, 2 * nx)))
        heights = fft.irfft2(white * root, (2 * ny, 2 * nx), overwrite=True)
        parts = heights[:ny, :nx], heights[ny:, nx:], heights[:ny, nx:], heights[ny:, :nx]
        levels += [[classes.means(modes.power(z)) for z in (part, filling(part))] for part in parts]
    before, after = np.maximum(np.moveaxis(np.array(levels), 1, 0), 1e-300)
    return before, after
