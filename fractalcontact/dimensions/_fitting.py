"""Maximum likelihood from squared modes: of a free face, complete or not, and of a periodic one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from fractalcontact.dimensions import _modes, _periodic, _whittle
from fractalcontact.dimensions._estimates import STRANGE, Estimate, normal_interval

Array = np.ndarray[Any, np.dtype[Any]]

LEAST_MODES = 12
_UNEVEN = 4.0  # the same for the scatter of the modes about their expected power
_FEW_PROBES, _MANY_POINTS = 3, 1 << 18
_FEW_POINTS = 1 << 14
_SLIGHT = 0.01  # share of missing points that one probe is enough for


class Modes(Protocol):
    """What the fit needs of a set of modes."""

    @property
    def order(self) -> Array:
        """A length for each mode: long waves and short waves are told apart by it."""

    @property
    def sector(self) -> Array:
        """A number for each mode: those of neighbouring azimuths have the same."""

    def scatter(self, fit: _whittle.WhittleFit) -> float:
        """Return how much less flat the modes are than Gaussian ones, in standard deviations."""

    def part(self, kept: Array) -> Modes:
        """Keep some of the modes."""

    def fit(self, start: float, noise: bool) -> _whittle.WhittleFit:
        """Fit the family of the face."""

    def error(self, fit: _whittle.WhittleFit) -> float:
        """Return the standard error of H."""


@dataclass(frozen=True)
class FreeModes:
    """Cosine modes of a face with free edges under fractional Brownian heights.

    `chosen` picks the modes out of all; `gapped` is what missing points do to them, None if there are none.
    """

    lattice: _modes.Lattice
    chosen: Array
    power: Array
    order: Array
    sector: Array
    gapped: Any = None

    @classmethod
    def of(cls, heights: Array, lattice: _modes.Lattice, chosen: Array, reference: float) -> FreeModes:
        """Transform a face; `reference` is a Hurst exponent near its own."""
        observed = np.isfinite(heights)
        order, sector = _modes.wavelengths(lattice)[chosen], _modes.steepness(lattice)[chosen] > 1.0
        if observed.all():
            return cls(lattice, chosen, _modes.power(heights)[chosen], order, sector)
        from fractalcontact.dimensions._gaps import PROBES, GappedModes

        probes = _FEW_PROBES if heights.size > _MANY_POINTS else PROBES
        if np.count_nonzero(~observed) < _SLIGHT * heights.size and heights.size > _FEW_POINTS:
            probes = 1
        gapped = GappedModes(lattice, observed, reference, probes)
        return cls(lattice, chosen, gapped.power(heights)[chosen], order, sector, gapped)

    def scatter(self, fit: _whittle.WhittleFit) -> float:
        """Compare the mean logarithm with that of chi square; not with gaps, whose part is only estimated."""
        if self.gapped is not None:
            return 0.0
        return _flatness(self.power / fit.total, _CHI_SQUARE)

    def part(self, kept: Array) -> FreeModes:
        """Keep some of the chosen modes; what slight gaps do to so few is less than their scatter."""
        chosen = np.zeros_like(self.chosen)
        chosen[self.chosen] = kept
        slight = self.gapped is not None and self.gapped.missing < _SLIGHT
        return replace(
            self,
            chosen=chosen,
            power=self.power[kept],
            order=self.order[kept],
            sector=self.sector[kept],
            gapped=None if slight else self.gapped,
        )

    def fit(self, start: float, noise: bool) -> _whittle.WhittleFit:
        """Fit from a pilot estimate; with noise from two starts, taking the better end."""

        def model(hurst: float) -> Array:
            return _modes.expected_power(self.lattice, hurst)[self.chosen]

        gaps: Callable[[float], Array] | None = None
        white = None
        if self.gapped is not None:
            gaps = lambda hurst: self.gapped.excess(hurst)[self.chosen]  # noqa: E731
            white = self.gapped.white_excess()[self.chosen] if noise else None
        if not noise:
            return _whittle.fit(self.power, model, start, gaps=gaps)
        # noise roughens the pilot, so that the search must come from both sides
        fits = [
            _whittle.fit(self.power, model, hurst, noise=level, gaps=gaps, white_excess=white)
            for hurst, level in ((0.7, 0.05), (0.3, 0.02))
        ]
        # a search that ended outside its range may have left powers below zero
        settled = [fit for fit in fits if fit.converged and fit.total.min() > 0.0]
        if not settled:
            return fits[0]
        return min(settled, key=lambda fit: float(np.sum(np.log(fit.amplitude * fit.total))))

    def error(self, fit: _whittle.WhittleFit) -> float:
        """Return the standard error of H, with what the modes share at edges and gaps.

        Without gaps the full covariance of the modes, on lattices of 24 to 64 points, raises that of
        independent modes by 1 to 3 %, hardly depending on the size. With gaps it is measured: bread,
        covariance of the score, bread.
        """
        if self.gapped is None:
            return fit.standard_error * (1.01 + 0.02 * float(np.clip(fit.hurst, 0.0, 1.0)))
        reference = self.gapped.reference_power()
        rows = np.zeros((len(fit.columns), *reference.shape))
        rows[:, self.chosen] = fit.columns / fit.total * reference[self.chosen]
        meat = 0.25 * self.gapped.score_covariance(rows, fit.hurst, fit.noise / fit.amplitude)
        bread = np.linalg.inv(fit.bread)
        square = float((bread @ meat @ bread.T)[1, 1])
        return float(np.sqrt(square)) if square > 0 else float("nan")


@dataclass(frozen=True)
class PeriodicModes:
    """Modes of a periodic face under a power law."""

    modes: _periodic.Modes

    @property
    def order(self) -> Array:
        """Wavelengths over the largest extent."""
        return np.asarray(1.0 / self.modes.wavenumber)

    @property
    def sector(self) -> Array:
        """Eighths of a turn, by the azimuth of the waves."""
        azimuth = self.modes.azimuth
        if azimuth is None:
            return np.zeros(self.modes.power.shape, dtype=int)
        return np.asarray(np.floor(azimuth * (4.0 / np.pi)).astype(int) % 4)

    def scatter(self, fit: _whittle.WhittleFit) -> float:
        """Compare the mean logarithm with that of an exponential distribution, over the complex modes."""
        whole = self.modes.weights == 2.0
        return _flatness((self.modes.power / fit.total)[whole], _EXPONENTIAL)

    def part(self, kept: Array) -> PeriodicModes:
        """Keep some of the modes."""
        return PeriodicModes(self.modes.part(kept))

    def fit(self, start: float, noise: bool) -> _whittle.WhittleFit:
        """Fit the power law, and white noise under it."""
        least = self.modes.wavenumber.max() ** (-self.modes.axes - 1.0)
        return _whittle.fit(
            self.modes.power,
            lambda hurst: _periodic.power_law(self.modes, hurst),
            start,
            noise=0.01 * float(least) if noise else None,
            weights=self.modes.weights,
        )

    def error(self, fit: _whittle.WhittleFit) -> float:
        """Return the standard error of H; the modes are independent."""
        return fit.standard_error


# mean logarithm of a mode over its expected power, and the variance of what is left when its mean is known
_CHI_SQUARE = (-np.euler_gamma - np.log(2.0), 0.5 * np.pi**2 - 2.0)
_EXPONENTIAL = (-np.euler_gamma, np.pi**2 / 6.0 - 1.0)


def _flatness(ratio: Array, expected: tuple[float, float]) -> float:
    """Return the mean logarithm over its scatter: negative where a few modes hold more than their share."""
    if ratio.size < LEAST_MODES:
        return 0.0
    logs = np.log(np.maximum(ratio / ratio.mean(), 1e-12))
    return float((logs.mean() - expected[0]) * np.sqrt(ratio.size / expected[1]))


def fitted(modes: Modes, start: float, noise: bool) -> tuple[_whittle.WhittleFit, Estimate]:
    """Fit, and return the estimate with its interval.

    Where the exponent changes with scale more than chance allows, the interval also holds the exponents
    of the longer and of the shorter half of the modes, each fitted alone; where the modes scatter more than
    those of Gaussian heights, those of sectors of azimuth.
    """
    fit = modes.fit(start, noise)
    error = modes.error(fit)
    interval = normal_interval(fit.hurst, error)
    notes = [] if fit.converged else ["the fit stopped at the limit of its range"]
    if abs(fit.misfit) > STRANGE:
        middle = float(np.median(modes.order))
        interval = _holding(interval, modes, modes.order > middle, fit.hurst, noise)
        told = ""
        if not noise and (loud := modes.fit(start, True)).converged:
            interval = _widened(interval, modes, loud)
            told = ", and that of a fit with white noise"
        notes.append(
            f"the exponent changes with scale ({fit.misfit:+.1f} standard deviations): "
            f"the interval holds that of the longer and of the shorter half of the modes{told}"
        )
    scatter = modes.scatter(fit)
    if scatter < -_UNEVEN:
        interval = _holding(interval, modes, modes.sector, fit.hurst, noise)
        notes.append(
            f"a few waves hold more than their share ({-scatter:.1f} standard deviations): a lay, a step or "
            "a pattern; the interval holds the exponents of sectors of azimuth, each fitted alone"
        )
    low, high = interval
    return fit, Estimate(fit.hurst, error, low, high, misfit=fit.misfit, note="; ".join(notes))


def _holding(
    interval: tuple[float, float], modes: Modes, groups: Array, start: float, noise: bool
) -> tuple[float, float]:
    """Widen an interval until it holds those of groups of modes, each fitted alone."""
    for group in np.unique(groups):
        kept = groups == group
        if np.count_nonzero(kept) >= LEAST_MODES:
            part = modes.part(kept)
            interval = _widened(interval, part, part.fit(start, noise))
    return interval


def _widened(interval: tuple[float, float], modes: Modes, fit: _whittle.WhittleFit) -> tuple[float, float]:
    """Widen an interval until it holds that of another fit."""
    low, high = normal_interval(fit.hurst, modes.error(fit))
    return min(interval[0], low), max(interval[1], high)
