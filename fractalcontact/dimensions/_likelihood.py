"""The default estimator: maximum likelihood for the family that the face belongs to."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fractalcontact.dimensions import _exact, _increments, _modes, _periodic, _whittle
from fractalcontact.dimensions._estimates import CONSTANT, Estimate, normal_interval, plane, undefined
from fractalcontact.dimensions._faces import Face

Array = np.ndarray[Any, np.dtype[Any]]
Scales = tuple[float, float] | None

LEAST_MODES = 12
_ROUNDING = 1e-26  # share of the mean square that transforms lose
_STRANGE = 3.3  # departure from the model, in standard deviations, beyond which the interval is widened
_FEW_PROBES, _MANY_POINTS = 3, 1 << 18
_PERIODIC = "all modes of the band: cut-offs and plateau found from the spectrum"
_FREE = "all modes that vary along both axes"
_ASKED = "asked for"


def likelihood(face: Face, scales: Scales, noise: bool) -> Estimate:
    """Fit the periodic family where every axis is periodic, else fractional Brownian heights."""
    if face.is_constant:
        return undefined(CONSTANT)
    if face.is_plane:
        return plane()
    if all(face.grid.periodic) and face.complete:
        return _periodic_face(face, scales, noise)
    return _profile(face, scales, noise) if face.axes == 1 else _free_face(face, scales, noise)


def _free_face(face: Face, scales: Scales, noise: bool) -> Estimate:
    """Fit the cosine modes of a face with free edges."""
    heights = _cropped(face.heights)
    dx = face.spacing[1]
    lattice = _modes.Lattice.of(heights.shape, (face.spacing[0] / dx, 1.0))
    lengths = _modes.wavelengths(lattice) * dx
    chosen = _between(lengths, scales)
    if np.count_nonzero(chosen) < LEAST_MODES:
        return undefined(
            f"{np.count_nonzero(chosen)} modes between the scales, at least {LEAST_MODES} are needed"
        )
    pilot = _pilot(heights, lattice.steps)
    observed = np.isfinite(heights)
    if observed.all():
        modes: _Complete | _Gapped = _Complete(heights, lattice, chosen)
    else:
        modes = _Gapped(heights, observed, lattice, chosen, pilot)
    centred = heights[observed] - heights[observed].mean()
    if float(modes.power.sum()) <= _ROUNDING * float(np.sum(centred * centred)):
        return undefined(
            "the heights vary along one axis only, or are a sum f(x) + g(y): estimate a profile instead"
        )
    fit = modes.fit(pilot, noise)
    error = modes.error(fit)
    low, high = normal_interval(fit.hurst, error)
    estimate = Estimate(
        fit.hurst, error, low, high,
        scale_min=float(lengths[chosen].min()),
        scale_max=float(lengths[chosen].max()),
        increment=_increment(fit) * face.unit,
        noise=_noise_height(fit, noise) * face.unit,
        misfit=fit.misfit,
        window=_FREE if scales is None else _ASKED,
        note="" if fit.converged else "the fit stopped at the limit of its range",
    )  # fmt: skip
    return _widened(estimate, modes, noise) if abs(fit.misfit) > _STRANGE else estimate


class _Complete:
    """Modes of a face without gaps."""

    def __init__(self, heights: Array, lattice: _modes.Lattice, chosen: Array) -> None:
        self.lattice, self.chosen = lattice, chosen
        self.power = _modes.power(heights)[chosen]
        self.order = _modes.wavelengths(lattice)[chosen]

    def model(self, hurst: float) -> Array:
        """Return the expected power of the chosen modes."""
        return _modes.expected_power(self.lattice, hurst)[self.chosen]

    def fit(self, start: float, noise: bool) -> _whittle.WhittleFit:
        """Fit the chosen modes."""
        return _with_starts(self.power, self.model, start, noise)

    def part(self, kept: Array) -> _Complete:
        """Keep some of the chosen modes."""
        part = object.__new__(_Complete)
        part.lattice = self.lattice
        part.chosen = np.zeros_like(self.chosen)
        part.chosen[self.chosen] = kept
        part.power, part.order = self.power[kept], self.order[kept]
        return part

    def error(self, fit: _whittle.WhittleFit) -> float:
        """Return the standard error of H, with what the modes share at the edges."""
        return fit.standard_error * _edge_factor(fit.hurst)


class _Gapped:
    """Modes of a face with missing points."""

    def __init__(
        self, heights: Array, observed: Array, lattice: _modes.Lattice, chosen: Array, reference: float
    ) -> None:
        from fractalcontact.dimensions._gaps import PROBES, GappedModes

        probes = _FEW_PROBES if heights.size > _MANY_POINTS else PROBES
        self.modes = GappedModes(lattice, observed, reference, probes)
        self.chosen = chosen
        self.power = self.modes.power(heights)[chosen]
        self.order = _modes.wavelengths(lattice)[chosen]

    def model(self, hurst: float) -> Array:
        """Return the expected power of the chosen modes of the complete face."""
        return _modes.expected_power(self.modes.lattice, hurst)[self.chosen]

    def gaps(self, hurst: float) -> Array:
        """Return what the gaps add to it."""
        return self.modes.excess(hurst)[self.chosen]

    def fit(self, start: float, noise: bool) -> _whittle.WhittleFit:
        """Fit the chosen modes."""
        white = self.modes.white_excess()[self.chosen] if noise else None
        return _with_starts(self.power, self.model, start, noise, self.gaps, white)

    def part(self, kept: Array) -> _Gapped:
        """Keep some of the chosen modes."""
        part = object.__new__(_Gapped)
        part.modes = self.modes
        part.chosen = np.zeros_like(self.chosen)
        part.chosen[self.chosen] = kept
        part.power, part.order = self.power[kept], self.order[kept]
        return part

    def error(self, fit: _whittle.WhittleFit) -> float:
        """Return the standard error of H: bread, covariance of the score, bread."""
        reference = self.modes.reference_power()
        rows = np.zeros((len(fit.columns), *reference.shape))
        rows[:, self.chosen] = fit.columns / fit.total * reference[self.chosen]
        noise = fit.noise / fit.amplitude
        meat = 0.25 * self.modes.score_covariance(rows, fit.hurst, noise)
        bread = np.linalg.inv(fit.bread)
        return float(np.sqrt((bread @ meat @ bread.T)[1, 1]))


def _with_starts(
    power: Array,
    model: Any,
    start: float,
    noise: bool,
    gaps: Any = None,
    white: Array | None = None,
) -> _whittle.WhittleFit:
    """Fit from a pilot estimate; with noise from several starts, taking the best."""
    if not noise:
        return _whittle.fit(power, model, start, gaps=gaps)
    # noise roughens the pilot, so that the search must come from both sides
    fits = [
        _whittle.fit(power, model, h, noise=level, gaps=gaps, white_excess=white)
        for h, level in ((0.7, 0.05), (0.3, 0.02))
    ]
    settled = [fit for fit in fits if fit.converged] or fits
    return min(settled, key=lambda fit: float(np.sum(np.log(fit.amplitude * fit.total))))


def _edge_factor(hurst: float) -> float:
    """Return by how much the modes' correlation raises the standard error.

    From the full covariance of the modes on lattices of 24 to 64 points; it hardly depends on the size.
    """
    return 1.01 + 0.02 * float(np.clip(hurst, 0.0, 1.0))


def _widened(estimate: Estimate, modes: Any, noise: bool) -> Estimate:
    """Let the interval hold the exponents of the long and of the short modes, each fitted alone."""
    middle = float(np.median(modes.order))
    ends = []
    for kept in (modes.order > middle, modes.order <= middle):
        if np.count_nonzero(kept) >= LEAST_MODES:
            part = modes.part(kept)
            fit = part.fit(estimate.hurst, noise)
            ends += list(normal_interval(fit.hurst, part.error(fit)))
    return replace(
        estimate,
        low=min([estimate.low, *ends]),
        high=max([estimate.high, *ends]),
        note=f"the exponent changes with scale ({estimate.misfit:+.1f} standard deviations): "
        "the interval holds that of the longer and of the shorter half of the modes",
    )


def _periodic_face(face: Face, scales: Scales, noise: bool) -> Estimate:
    """Fit a power law to the modes of a periodic face."""
    heights = face.heights if face.axes == 2 else face.heights[0]
    modes = _periodic.modes(heights, face.steps)
    unit = max(face.grid.extent)
    limits = (
        _periodic.band(modes)
        if scales is None
        else (unit / scales[1] * (1 - 1e-9), unit / scales[0] * (1 + 1e-9))
    )
    modes = modes.inside(*limits)
    if modes.weights.sum() < LEAST_MODES:
        return undefined(f"{modes.weights.sum():.0f} modes in the band, at least {LEAST_MODES} are needed")
    level = 0.01 * float(np.min(modes.wavenumber ** (-modes.axes - 1.0))) if noise else None
    fit = _whittle.fit(
        modes.power, lambda hurst: _periodic.power_law(modes, hurst), 0.5, noise=level, weights=modes.weights
    )
    low, high = normal_interval(fit.hurst, fit.standard_error)
    step = np.diff(heights, append=heights[..., :1], axis=-1)
    cell = float(np.prod(face.steps))
    return Estimate(
        fit.hurst, fit.standard_error, low, high,
        scale_min=unit / float(modes.wavenumber.max()),
        scale_max=unit / float(modes.wavenumber.min()),
        increment=float(np.sqrt(np.mean(step * step))) * face.unit,
        noise=float(np.sqrt(max(fit.noise / cell, 0.0))) * face.unit if noise else np.nan,
        misfit=fit.misfit,
        window=_PERIODIC if scales is None else _ASKED,
        note="periodic family: power law between cut-offs"
        + ("" if fit.converged else "; the fit stopped at the limit of its range"),
    )  # fmt: skip


def _profile(face: Face, scales: Scales, noise: bool) -> Estimate:
    """Fit a profile with its exact likelihood."""
    heights, dx = face.heights[0], face.spacing[1]
    every = 1 if scales is None else max(1, int(np.ceil(scales[0] / dx * (1 - 1e-9))))
    heights = heights[::every]
    longest = _exact.CHUNK if scales is None else int(scales[1] / (dx * every) * (1 + 1e-9)) + 1
    chunk = min(longest, _exact.CHUNK, int(np.isfinite(heights).sum()))
    if chunk < _exact.SMALLEST:
        return undefined(f"{chunk} points, at least {_exact.SMALLEST} are needed")
    fit = _exact.fit_profile(heights, noise=noise, chunk=chunk)
    return Estimate(
        fit.hurst, fit.standard_error, fit.low, fit.high,
        scale_min=every * dx,
        scale_max=(chunk - 1) * every * dx,
        increment=fit.increment * float(every) ** -fit.hurst * face.unit,
        noise=float(np.sqrt(fit.noise)) * face.unit if noise else np.nan,
        window="exact likelihood of all increments" if scales is None else _ASKED,
    )  # fmt: skip


def _pilot(heights: Array, steps: tuple[float, float]) -> float:
    """Return a quick estimate to start from."""
    moments = _increments.moments([(heights, heights.shape[0])], heights.shape)
    hurst = _increments.closed_form(moments, steps, error=False).hurst
    return float(np.clip(hurst, 0.03, 0.98)) if np.isfinite(hurst) else 0.5


def _increment(fit: _whittle.WhittleFit) -> float:
    """Return the rms increment over one x spacing that goes with the amplitude."""
    return float(np.sqrt(2.0 * fit.amplitude / (1.0 - fit.hurst))) if fit.hurst < 1.0 else float("nan")


def _noise_height(fit: _whittle.WhittleFit, noise: bool) -> float:
    return float(np.sqrt(max(fit.noise, 0.0))) if noise else float("nan")


def _between(lengths: Array, scales: Scales) -> Array:
    if scales is None:
        return np.ones(lengths.shape, dtype=bool)
    return np.asarray((lengths >= scales[0] * (1 - 1e-9)) & (lengths <= scales[1] * (1 + 1e-9)))


def _cropped(heights: Array) -> Array:
    """Cut off the rows and columns at the border where nothing was observed."""
    seen = np.isfinite(heights)
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    return heights[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
