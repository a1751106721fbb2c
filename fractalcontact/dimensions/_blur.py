"""Likelihood of a fractional Brownian surface that an instrument has blurred, with white noise on top.

The expected power of a mode is

    amplitude * (E(H) T^2(q, spread) + noise),

E being that of the surface and T the transfer function of a Gaussian point spread function in one of four
forms. Noise is added after the blur. Which form, and whether there is noise, is chosen by the likelihood
with Akaike's penalty; the interval holds every exponent at which one of the models has a deviance within
the limit of the best, so that it accounts for the choice.

The slope of blurred heights jumps at the edges of the surface, where the cosines continue it by reflection.
The power of that jump falls as a power of the wavenumber and exceeds the blurred signal at short waves:
modes where it matters are left out. The window is the largest with which a model agrees.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from fractalcontact.dimensions import _blur_fit
from fractalcontact.dimensions._blur_fit import NARROW, Fit
from fractalcontact.dimensions._mode_blocks import LOWEST, Frame
from fractalcontact.dimensions._records import ASKED, Estimate
from fractalcontact.dimensions._surface_input import Scales, Surface, between
from fractalcontact.dimensions._transfer_functions import (
    BAND,
    BEFORE,
    FILTER,
    NONE,
    TRANSFER,
    Edges,
    Window,
    edge_power,
    in_model,
    plain_power,
)
from fractalcontact.dimensions._whittle import QUANTILE

Array = np.ndarray[Any, np.dtype[Any]]

POOR = 3.5  # z of the scatter of the blocks beyond which a model does not fit
LEAST_AGREEMENT = 1e-4  # probability of the levels of the octaves below which a model does not fit
_UNEVEN = 4.0  # -z of the mean logarithm beyond which few waves dominate
_FIRST, _GROWTH = 14.0, 1.5  # first window in numbers of the longest wave, and ratio of successive ones
_LEAST = 60  # modes of a window
_WIDE = 1.1  # squared spread beyond which the forms do not differ
_EDGE = 0.07  # share of the power of the edges beyond which a mode is left out
_OCTAVES, _WEAK = 5, 3.0  # longest octaves compared with a fit, and -z beyond which they are too weak
_WHITE = 0.5  # share of the waves below the noise that the edges must not disturb
# deviance that noise must bring beside Akaike's penalty, to have half the weight in the mean of the models;
# that of weak noise, up to a rms height over the rms increment, is not penalised, and below the least is none
_AGAINST_NOISE = 6.0
_WEAK_NOISE, _LEAST_NOISE = 0.06, 0.005
_LEAST_DISTANCE = 0.06  # of an exponent to 1, where the rms increment of the model has no limit
_SIDE_LOBES = 2.0  # excess of power just beyond a blur that a Gaussian does not leave
_FALL = 5.0  # logarithm of the squared transfer function at the end of a window without noise
CLEAR = {1: 9.0, 2: 4.0}  # decrease of the penalised deviance from which blur or noise is seen, by axes
_VAGUE = 1.0  # width of an interval that says nothing
BLUR_WINDOW = "the modes that a model of blur and noise fits"
_CORNER = 0.75  # of the Nyquist wavenumber: waves beyond it along every axis give a first guess of noise


@dataclass(frozen=True)
class BlurredFit:
    """Hurst exponent of a blurred surface.

    Attributes
    ----------
    hurst, low, high : float
        Mean of the models, weighted by their likelihood, with its interval, within the range of the table.
    standard_error : float
        That of the likeliest model.
    amplitude : float
        Factor on the expected power of the surface.
    spread : float
        Standard deviation of the point spread function, in spacings of x.
    noise : float
        Power of white noise, in the unit of the data; NaN where none is fitted.
    form : str
        A key of `FORMS`.
    shortest : float
        Shortest wavelength used, in spacings of x.
    scatter : float
        z of the scatter of the modes about the model.
    agreement : float
        Probability that the levels of octaves differ from the model by chance as much as they do.
    flatness : float
        z of the mean logarithm of the modes of each block, or -z of the difference of both axes: negative
        where few waves, or those along one axis, hold most of the power.
    gain : float
        Decrease of the deviance, less the penalty, against the surface without blur, and without noise
        unless it was asked for.
    penalised : float
        Deviance with the penalty of the parameters.
    inside : ndarray of bool, shape (blocks,)
        Blocks of modes used.
    other_form : float
        Chi square, of three parameters, of a transfer function of another form, from all modes that the edges
        do not disturb.
    """

    hurst: float
    standard_error: float
    low: float
    high: float
    amplitude: float
    spread: float
    noise: float
    form: str
    shortest: float
    scatter: float
    agreement: float
    flatness: float
    gain: float
    penalised: float
    inside: Array
    other_form: float = 0.0

    @property
    def is_good(self) -> bool:
        """Whether the model agrees with the modes."""
        return self.is_close and self.agreement > LEAST_AGREEMENT and self.is_even

    @property
    def is_close(self) -> bool:
        """Whether single blocks of modes scatter about the model by chance."""
        return self.scatter < POOR

    @property
    def is_even(self) -> bool:
        """Whether no few waves, nor those along one axis, hold more than their share."""
        return self.flatness > -_UNEVEN


def fit_blurred(
    power: Array,
    frame: Frame,
    *,
    noise: bool = False,
    spread: float | None = None,
    chosen: Array | None = None,
    first: Fit | None = None,
) -> BlurredFit | None:
    """Fit H, the amplitude, the blur and noise; None if too few modes are chosen.

    Parameters
    ----------
    power : ndarray
        Squared modes of `frame`.
    frame : Frame
    noise : bool
        Fit noise in every model.
    spread : float, optional
        Spread of the point spread function in spacings of x, if it is known.
    chosen : ndarray of bool, shape (blocks,), optional
        Blocks that may be used. Default: all.
    first : Fit, optional
        A fit to all modes, which is tried before the search for a window.
    """
    search = _Search(frame.mean(power), frame, noise, None if spread is None else spread**2, chosen)
    if frame.count[search.allowed].sum() < _LEAST:
        return None
    window, start = search.window(first)
    if (longest := search.weak_waves(window, start)) > 0.0:
        # a roll-off: the longest waves do not belong to the power law
        search.allowed = search.allowed & (frame.squares > longest)
        window, start = search.window(start)
    if window.number < _LEAST:
        return None
    forms = [NONE, BEFORE, BAND, FILTER, TRANSFER] if spread is None else [BEFORE, FILTER, TRANSFER]
    if spread == 0.0:
        forms = [NONE]
    if spread is None and start.square > _WIDE:
        forms = [NONE, BEFORE, TRANSFER]
    fits = [
        _blur_fit.fit(window, start.with_noise(has_noise, window), form)
        for form in forms
        for has_noise in ((True,) if noise else (False, True))
    ]
    best = min(fits, key=lambda fit: fit.penalised)
    scatter = _blur_fit.scatter(window, best)
    # noise is unknown whatever is chosen, and so not penalised alone
    least, limit = min(fit.deviance for fit in fits), QUANTILE * best.correlation
    low, high = best.hurst, best.hurst
    for fit in fits:
        excess = min(fit.deviance - least, fit.penalised - best.penalised)
        if fit.has_noise and excess < limit:
            ends = _blur_fit.interval(window, fit, limit - excess)
            low, high = min(low, ends[0]), max(high, ends[1])
    hurst = _mean(window, fits)
    at_mean = _blur_fit.fit(window, best, hurst=hurst)
    plain = [fit.penalised for fit in fits if fit.form == NONE and fit.has_noise == noise]
    return BlurredFit(
        hurst=hurst,
        standard_error=_blur_fit.error(window, best),
        low=min(low, hurst),
        high=max(high, hurst),
        amplitude=at_mean.amplitude,
        spread=float(np.sqrt(at_mean.square)),
        noise=at_mean.noise * at_mean.amplitude if best.has_noise else np.nan,
        form=best.form,
        shortest=float(2.0 * np.pi / np.sqrt(frame.squares[window.inside].max())),
        scatter=scatter,
        agreement=_blur_fit.agreement(window, best),
        flatness=min(
            _flatness(power, window, _blur_fit.spread_in_blocks(window, best)),
            -abs(_asymmetry(power, window)),
        ),
        gain=plain[0] - best.penalised if plain else np.inf,
        penalised=best.penalised,
        inside=window.inside,
        other_form=search.other_form(window, best) if spread is None and frame.axes == 2 else 0.0,
    )


def _mean(window: Window, fits: Sequence[Fit]) -> float:
    """Return the mean exponent of some models, weighted by their likelihood.

    Noise is penalised more than by Akaike: fitted where there is none, it doubles the error. Weak noise does
    less harm, left out or put in, and few instruments have none: it is in the mean without a penalty.
    """
    quiet = {fit.form: fit for fit in fits if not fit.has_noise}
    hursts = [fit.hurst for fit in fits]
    costs = [fit.penalised + _AGAINST_NOISE * fit.has_noise for fit in fits]
    for noisy in fits:
        if noisy.has_noise and noisy.form in quiet:
            weak = _with_weak_noise(window, noisy, quiet[noisy.form])
            hursts.append(weak.hurst)
            costs.append(weak.deviance + quiet[noisy.form].penalised - quiet[noisy.form].deviance)
    weights = np.exp(-0.5 * (np.array(costs) - min(costs)))
    return float(np.average(hursts, weights=weights))


def _with_weak_noise(window: Window, noisy: Fit, quiet: Fit) -> Fit:
    """Return the fit of at most weak noise; that without noise where none is found."""
    unit = 2.0 / max(1.0 - noisy.hurst, _LEAST_DISTANCE)  # power of noise of one rms increment
    if noisy.noise < unit * _LEAST_NOISE**2:
        return quiet
    most = unit * _WEAK_NOISE**2
    if noisy.noise <= most:
        return noisy
    return _blur_fit.fit(window, replace(noisy, noise=most, most_noise=most))


def chosen_blocks(frame: Frame, surface: Surface, scales: Scales) -> Array:
    """Return the blocks of modes inside the window."""
    return between(2.0 * np.pi / np.sqrt(frame.squares) * surface.spacing[1], scales)


def is_seen(fit: BlurredFit, axes: int, spread: float | None) -> bool:
    """Return whether blur or noise explains the modes better than the surface alone, or is given."""
    if spread is not None:
        return True
    return fit.is_close and fit.is_even and fit.gain > CLEAR[axes] and fit.high - fit.low < _VAGUE


def blurred_estimate(
    fit: BlurredFit, surface: Surface, scales: Scales, amplitude: float, longest: float
) -> Estimate:
    """Return the estimate of a fit of blur and noise.

    `amplitude` is half the mean square increment over one spacing, times 1 - H; `longest` is the longest wave
    in m.
    """
    has_noise = np.isfinite(fit.noise)
    half_square = amplitude / max(1.0 - fit.hurst, 1e-9)
    return Estimate(
        fit.hurst,
        fit.standard_error,
        fit.low if fit.low > LOWEST else 0.0,
        fit.high,
        scale_min=fit.shortest * surface.spacing[1],
        scale_max=longest,
        rms_increment=float(np.sqrt(2.0 * half_square)) * surface.unit if fit.hurst < 1.0 else np.nan,
        noise_height=float(np.sqrt(fit.noise)) * surface.unit if has_noise else np.nan,
        blur_spread=fit.spread * surface.spacing[1] if fit.form != NONE else np.nan,
        window=BLUR_WINDOW if scales is None else ASKED,
        note=in_model(fit.form, fit.spread, bool(has_noise)),
    )


class _Search:
    """Search for the window and the parameters."""

    def __init__(
        self, power: Array, frame: Frame, noise: bool, square: float | None, chosen: Array | None
    ) -> None:
        self.power, self.frame, self.noise, self.square = power, frame, noise, square
        self.allowed: Array = np.ones(power.size, dtype=bool) if chosen is None else chosen

    def window(self, first: Fit | None) -> tuple[Window, Fit]:
        """Return the largest window that a model fits, and that model; that around `first` if it fits there.

        Without noise windows grow from the longest waves on; with noise all modes are used at once, apart
        from those that the edges disturb.
        """
        if first is not None and (around := self._around(first)) is not None:
            return around
        quiet_window, quiet, quiet_scatter = self._growing()
        level = self._corner_level
        if level is None:
            return quiet_window, quiet
        noisy = replace(quiet, noise=max(level / quiet.amplitude, 1e-280), has_noise=True)
        for _ in range(3):
            window = self._window(noisy, np.inf)
            if window.number < _LEAST:
                return quiet_window, quiet
            noisy = _blur_fit.fit(window, noisy)
        noisy = self._best_form(window, noisy)
        most = max(POOR, min(quiet_scatter, 1e3))
        if self._is_white(window, noisy) and _blur_fit.scatter(window, noisy) < most:
            return window, noisy
        return quiet_window, quiet

    @cached_property
    def _corner_level(self) -> float | None:
        """Mean power of the waves that are shortest along every axis; None if they may not be used."""
        limits = [_CORNER * np.pi / d for d in self.frame.spacing]
        corner = np.logical_and.reduce([w > limit for w, limit in zip(self.frame.waves, limits, strict=True)])
        corner &= self.allowed
        if not corner.any():
            return None
        return float(np.average(self.power[corner], weights=self.frame.count[corner]))

    def _around(self, first: Fit) -> tuple[Window, Fit] | None:
        """Return the window of a fit to all modes, and the best model there; None if it does not fit."""
        fit = replace(first, has_noise=first.has_noise or self.noise, known=self.square)
        for _ in range(3):
            window = self._window(fit, np.inf)
            if window.number < _LEAST:
                return None
            fit = _blur_fit.fit(window, fit)
        fit = self._best_form(window, fit)
        is_good = _blur_fit.scatter(window, fit) < POOR
        return (window, fit) if is_good and (not fit.has_noise or self._is_white(window, fit)) else None

    def _growing(self) -> tuple[Window, Fit, float]:
        """Return the largest window without noise, its fit, and the z of its scatter."""
        squares = self.frame.squares
        end = np.sqrt(squares[self.allowed].max())
        reach = _FIRST * np.pi / min(n * d for n, d in zip(self.frame.shape, self.frame.spacing, strict=True))
        while self.frame.count[self.allowed & (squares < reach**2)].sum() < 2 * _LEAST and reach < end:
            reach *= _GROWTH
        start = Fit(
            TRANSFER,
            0.5,
            0.5 if self.square is None else self.square,
            has_noise=self.noise,
            known=self.square,
        )
        best, failures = None, 0
        while True:
            window = Window(self.frame, self.allowed & (squares <= reach**2), self.power)
            first = start.with_noise(self.noise, window)
            forms = (TRANSFER,) if reach < 1.2 else (TRANSFER, BEFORE, BAND, FILTER)
            fit = _blur_fit.fit(window, first)
            for _ in range(2):
                narrowed = self._window(fit, reach)
                if narrowed.count.sum() < _LEAST:
                    break
                window, fit = narrowed, _blur_fit.fit(narrowed, fit)
            scatter = _blur_fit.scatter(window, fit)
            for form in forms[1:]:
                if scatter < POOR or fit.square > _WIDE:
                    break
                other = _blur_fit.fit(window, fit, form)
                if other.deviance < fit.deviance:
                    fit, scatter = other, _blur_fit.scatter(window, other)
            is_good = scatter < POOR
            failures = 0 if is_good else failures + 1
            if is_good or best is None:
                best, start = (window, fit, scatter), fit
            if (failures > 1 and best[2] < POOR) or reach >= end or fit.square * reach**2 > 20.0:
                return best
            reach = min(reach * _GROWTH, end)

    def _window(self, fit: Fit, reach: float) -> Window:
        """Return the window of a fit: waves that edges disturb little, not fallen too far without noise."""
        if fit.square < NARROW:
            return Window(self.frame, self.allowed & (self.frame.squares <= reach**2), self.power)
        inside, edges = self._undisturbed(fit, reach)
        # the edges fall less than the surface; without noise the window ends where they matter
        jump = Edges.of(self.frame, fit.hurst, fit.square) if fit.has_noise else edges
        # the blur may have been reflected at the edges, as by most filters, or go on beyond them
        plain, with_edges = (
            Window(self.frame, inside, self.power),
            Window(self.frame, inside, self.power, jump),
        )
        if plain.count.sum() < _LEAST:
            return plain
        reflected, free = (_blur_fit.fit(window, fit) for window in (plain, with_edges))
        return plain if reflected.deviance <= free.deviance else with_edges

    def _undisturbed(self, fit: Fit, reach: float) -> tuple[Array, Array]:
        """Return the blocks that edges disturb little, and the power of the edges over that of the signal."""
        squares = self.frame.squares
        inside = self.allowed & (squares <= reach**2)
        edges = edge_power(self.frame, fit.hurst, fit.square)
        signal = plain_power(self.frame, fit.hurst) * np.exp(-np.minimum(fit.square * squares, 600.0))
        noise = fit.noise if fit.has_noise else 0.0
        inside &= edges * signal < _EDGE * (signal + noise)
        if not fit.has_noise:
            inside &= fit.square * squares < _FALL
        return inside, edges

    def other_form(self, window: Window, fit: Fit) -> float:
        """Return `_blur_fit.other_form` of a fit to the modes of a window, and to others where it may hold.

        Infinite where shorter waves, which a Gaussian has removed, have more power than the edges and noise.
        """
        if fit.square >= NARROW and not (fit.has_noise and not self._is_white(window, fit)):
            inside, edges = self._undisturbed(fit, np.inf)
            if not fit.has_noise and self._excess(fit, edges) > _SIDE_LOBES:
                return np.inf
            if np.count_nonzero(inside & ~window.inside) > 0.02 * np.count_nonzero(inside):
                ratio = None if window.edges is None and window.ratio is None else edges
                window = Window(self.frame, inside, self.power, ratio)
                fit = _blur_fit.fit(window, fit)
        return _blur_fit.other_form(window, fit)

    def _excess(self, fit: Fit, edges: Array) -> float:
        """Return the power of waves just beyond a blur over that expected with the edges and white noise."""
        falls = fit.square * self.frame.squares
        beyond = self.allowed & (falls > _FALL) & (falls < 2.0 * _FALL)
        count = self.frame.count[beyond]
        if count.sum() < _LEAST or self._corner_level is None:
            return 0.0
        signal = plain_power(self.frame, fit.hurst) * np.exp(-np.minimum(falls, 600.0)) * (1.0 + edges)
        expected = fit.amplitude * signal[beyond] + self._corner_level
        return float(np.average(self.power[beyond] / expected, weights=count))

    def weak_waves(self, window: Window, fit: Fit) -> float:
        """Return the largest squared wavenumber of long waves that are too weak for a fit; 0 if none are."""
        residual = _blur_fit.residuals(window, fit)[1]
        result, first = 0.0, float(window.squares.min())
        for octave in range(1, _OCTAVES + 1):
            inside = window.squares <= first * 4.0**octave
            count = window.count[inside]
            if count.sum() < 0.5 * window.number:
                ratio = max(1.0 + float(np.average(residual[inside], weights=count)), 1e-9)
                gain = float(count.sum()) * (ratio - 1.0 - np.log(ratio))
                result = first * 4.0**octave if ratio < 1.0 and gain > _WEAK**2 else result
        return result

    def _is_white(self, window: Window, fit: Fit) -> bool:
        """Return whether noise, and not the power of the edges, dominates the short waves."""
        signal = plain_power(self.frame, fit.hurst) * np.exp(-fit.square * self.frame.squares)
        quiet = self.allowed & (signal < fit.noise)
        count = self.frame.count
        return bool(count[quiet & window.inside].sum() >= _WHITE * count[quiet].sum())

    def _best_form(self, window: Window, start: Fit) -> Fit:
        """Fit the forms that may differ, and return the best."""
        if start.square > _WIDE or _blur_fit.scatter(window, start) < POOR:
            return start
        forms = TRANSFER, BEFORE, BAND, FILTER
        return min((_blur_fit.fit(window, start, form) for form in forms), key=lambda fit: fit.deviance)


def _flatness(power: Array, window: Window, spread: Array) -> float:
    """Return z of the mean logarithm of the squared modes about the logarithm of the mean of their block.

    `spread` is the variance of the logarithm of their expected power, which lowers it by half as much.
    """
    from scipy.special import polygamma, psi

    count = window.frame.modes[window.inside]
    with np.errstate(divide="ignore"):
        logs = window.frame.mean(np.log(np.maximum(power, 1e-12 * power.mean())))[window.inside]
        means = np.log(window.power)
    expected = psi(0.5) - psi(0.5 * count) + np.log(count)  # of logarithms of chi square
    variance = np.sum(count * polygamma(1, 0.5) - count**2 * polygamma(1, 0.5 * count))
    excess = float(np.sum(count * (logs - means - expected + 0.5 * spread)))
    return excess / float(np.sqrt(variance)) if variance > 0.0 else 0.0


def _asymmetry(power: Array, window: Window) -> float:
    """Return z of the difference between waves steeper along y and along x; 0 if they are not paired."""
    frame, inside = window.frame, window.inside
    if not frame.is_mirrored:
        return 0.0
    pairs = (frame.index[0][inside] != frame.index[1][inside]) & (window.power > 0.0)
    part = frame.mean(np.tril(power, -1))[inside][pairs] / window.power[pairs]
    weights = 0.5 * window.count[pairs] + 1.0
    return float(np.sum(weights * (2.0 * part - 1.0)) / np.sqrt(max(np.sum(weights), 1.0)))
