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

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fractalcontact.dimensions._mode_blocks import HIGHEST, LOWEST, Frame, node_weights
from fractalcontact.dimensions._transfer_functions import (
    BAND,
    BEFORE,
    FILTER,
    NONE,
    TRANSFER,
    Window,
    edge_power,
)

Array = np.ndarray[Any, np.dtype[Any]]

QUANTILE = 3.841458820694124  # 95 % quantile of chi square with one degree of freedom
_PENALTY = 2.0  # Akaike: deviance that a parameter must bring
_CORRELATION = 1.05  # of the squared standard error, for the modes are slightly correlated
_MORE_CORRELATION = 1.25  # the same where the jump of the slope at the edges matters
_POOR = 3.5  # z of the scatter of the blocks beyond which a model does not fit
_UNEVEN = 4.0  # -z of the mean logarithm beyond which few waves dominate
_FIRST, _GROWTH = 14.0, 1.5  # first window in numbers of the longest wave, and ratio of successive ones
_LEAST = 60  # modes of a window
_NARROW = 0.3  # squared spread below which edges do not matter
_WIDE = 1.1  # squared spread beyond which the forms do not differ
_EDGE = 0.07  # share of the power of the edges beyond which a mode is left out
_OCTAVES, _WEAK = 5, 3.0  # longest octaves compared with a fit, and -z beyond which they are too weak
_WHITE = 0.5  # share of the waves below the noise that the edges must not disturb
_FALL = 5.0  # logarithm of the squared transfer function at the end of a window without noise
_CORNER = 0.75  # of the Nyquist wavenumber: waves beyond it along every axis give a first guess of noise
_LARGEST = 200.0  # squared spread
_NO_NOISE = 1e-4  # share of every mode below which noise is as good as none
_STEPS, _TRIES, _DAMPING = 25, 8, 1e-3


@dataclass(frozen=True)
class BlurredFit:
    """Hurst exponent of a blurred surface.

    Attributes
    ----------
    hurst, standard_error, low, high : float
        Estimate with its interval, within the range of the table.
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
    flatness: float
    gain: float
    penalised: float
    inside: Array

    @property
    def is_good(self) -> bool:
        """Whether the model agrees with the modes."""
        return self.scatter < _POOR and self.is_even

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
    """
    search = _Search(frame.mean(power), frame, noise, None if spread is None else spread**2)
    if chosen is not None:
        search.allowed = chosen
    if frame.count[search.allowed].sum() < _LEAST:
        return None
    window, start = search.window()
    if (longest := search.weak_waves(window, start)) > 0.0:
        # a roll-off: the longest waves do not belong to the power law
        search.allowed = search.allowed & (frame.squares > longest)
        window, start = search.window()
    if window.count.sum() < _LEAST:
        return None
    forms = [NONE, BEFORE, BAND, FILTER, TRANSFER] if spread is None else [BEFORE, FILTER, TRANSFER]
    if spread == 0.0:
        forms = [NONE]
    if spread is None and start.square > _WIDE:
        forms = [NONE, BEFORE, TRANSFER]
    fits = [
        search.fit(window, start.with_noise(has_noise, window), form)
        for form in forms
        for has_noise in ((True,) if noise else (False, True))
    ]
    best = min(fits, key=lambda fit: fit.penalised)
    scatter = search.scatter(window, best)
    limit = QUANTILE * (_CORRELATION if best.square < _NARROW else _MORE_CORRELATION)
    low, high = best.hurst, best.hurst
    for fit in fits:
        if (excess := fit.penalised - best.penalised) < limit:
            ends = search.interval(window, fit, limit - excess)
            low, high = min(low, ends[0]), max(high, ends[1])
    plain = [fit.penalised for fit in fits if fit.form == NONE and fit.has_noise == noise]
    return BlurredFit(
        hurst=best.hurst,
        standard_error=search.error(window, best),
        low=low,
        high=high,
        amplitude=best.amplitude,
        spread=float(np.sqrt(best.square)),
        noise=best.noise * best.amplitude if best.has_noise else np.nan,
        form=best.form,
        shortest=float(2.0 * np.pi / np.sqrt(frame.squares[window.inside].max())),
        scatter=scatter,
        flatness=min(
            _flatness(power, frame, window.inside, search.spread_in_blocks(window, best)),
            -abs(_asymmetry(power, frame, window.inside)),
        ),
        gain=plain[0] - best.penalised if plain else np.inf,
        penalised=best.penalised,
        inside=window.inside,
    )


@dataclass(frozen=True)
class _Fit:
    """Parameters of one model: `square` is the squared spread, `noise` that over the amplitude."""

    form: str
    hurst: float
    square: float
    noise: float
    has_noise: bool
    parameters: int = 0
    deviance: float = np.inf
    amplitude: float = np.nan

    @property
    def penalised(self) -> float:
        """Deviance with the penalty of the parameters."""
        return self.deviance + _PENALTY * self.parameters

    def with_noise(self, has_noise: bool, window: Window) -> _Fit:
        """Return a start with noise or without."""
        if not has_noise:
            return replace(self, noise=0.0, has_noise=False)
        least = 1e-3 * float(window.signal(self.form, self.hurst, self.square)[0].min())
        return replace(self, noise=max(self.noise, least, 1e-280), has_noise=True)


class _Search:
    """Search for the window and the parameters."""

    def __init__(self, power: Array, frame: Frame, noise: bool, square: float | None) -> None:
        self.power, self.frame, self.noise, self.square = power, frame, noise, square
        self.allowed: Array = np.ones(power.size, dtype=bool)

    def window(self) -> tuple[Window, _Fit]:
        """Return the largest window that a model fits, and that model.

        Without noise windows grow from the longest waves on; with noise all modes are used at once, apart
        from those that the edges disturb.
        """
        quiet = self._growing()
        limits = [_CORNER * np.pi / d for d in self.frame.spacing]
        corner = np.logical_and.reduce([w > limit for w, limit in zip(self.frame.waves, limits, strict=True)])
        corner &= self.allowed
        if not corner.any():
            return quiet[0], quiet[1]
        level = float(np.average(self.power[corner], weights=self.frame.count[corner]))
        noisy = replace(quiet[1], noise=max(level / quiet[1].amplitude, 1e-280), has_noise=True)
        for _ in range(3):
            window = self._window(noisy, np.inf)
            if window.count.sum() < _LEAST:
                return quiet[0], quiet[1]
            noisy = self.fit(window, noisy)
        noisy = self._best_form(window, noisy)
        if self._is_white(window, noisy) and self.scatter(window, noisy) < max(_POOR, min(quiet[2], 1e3)):
            return window, noisy
        return quiet[0], quiet[1]

    def _growing(self) -> tuple[Window, _Fit, float]:
        """Return the largest window without noise, its fit, and the z of its scatter."""
        squares = self.frame.squares
        end = np.sqrt(squares[self.allowed].max())
        reach = _FIRST * np.pi / min(n * d for n, d in zip(self.frame.shape, self.frame.spacing, strict=True))
        while self.frame.count[self.allowed & (squares < reach**2)].sum() < 2 * _LEAST and reach < end:
            reach *= _GROWTH
        start = _Fit(TRANSFER, 0.5, 0.5 if self.square is None else self.square, 0.0, self.noise)
        best, failures = None, 0
        while True:
            window = Window(self.frame, self.allowed & (squares <= reach**2), self.power)
            first = start.with_noise(self.noise, window)
            forms = (TRANSFER,) if reach < 1.2 else (TRANSFER, BEFORE, BAND, FILTER)
            fit = self.fit(window, first)
            for _ in range(2):
                narrowed = self._window(fit, reach)
                if narrowed.count.sum() < _LEAST:
                    break
                window, fit = narrowed, self.fit(narrowed, fit)
            scatter = self.scatter(window, fit)
            for form in forms[1:]:
                if scatter < _POOR or fit.square > _WIDE:
                    break
                other = self.fit(window, fit, form)
                if other.deviance < fit.deviance:
                    fit, scatter = other, self.scatter(window, other)
            is_good = scatter < _POOR
            failures = 0 if is_good else failures + 1
            if is_good or best is None:
                best, start = (window, fit, scatter), fit
            if (failures > 1 and best[2] < _POOR) or reach >= end or fit.square * reach**2 > 20.0:
                return best
            reach = min(reach * _GROWTH, end)

    def _window(self, fit: _Fit, reach: float) -> Window:
        """Return the window of a fit: waves that edges disturb little, not fallen too far without noise."""
        squares = self.frame.squares
        inside = self.allowed & (squares <= reach**2)
        if fit.square < _NARROW:
            return Window(self.frame, inside, self.power)
        edges = edge_power(self.frame, fit.hurst, fit.square)
        signal = np.exp(
            node_weights(fit.hurst)[0] @ self.frame.logs - np.minimum(fit.square * squares, 600.0)
        )
        noise = fit.noise if fit.has_noise else 0.0
        inside &= edges * signal < _EDGE * (signal + noise)
        if not fit.has_noise:
            inside &= fit.square * squares < _FALL
        # the blur may have been reflected at the edges, as by most filters, or go on beyond them
        plain, with_edges = (
            Window(self.frame, inside, self.power),
            Window(self.frame, inside, self.power, edges),
        )
        if plain.count.sum() < _LEAST:
            return plain
        reflected, free = (self.fit(window, fit) for window in (plain, with_edges))
        return plain if reflected.deviance <= free.deviance else with_edges

    def weak_waves(self, window: Window, fit: _Fit) -> float:
        """Return the largest squared wavenumber of long waves that are too weak for a fit; 0 if none are."""
        residual = self._evaluate(window, fit)[2]
        result, first = 0.0, float(window.squares.min())
        for octave in range(1, _OCTAVES + 1):
            inside = window.squares <= first * 4.0**octave
            count = window.count[inside]
            if count.sum() < 0.5 * window.count.sum():
                ratio = max(1.0 + float(np.average(residual[inside], weights=count)), 1e-9)
                gain = float(count.sum()) * (ratio - 1.0 - np.log(ratio))
                result = first * 4.0**octave if ratio < 1.0 and gain > _WEAK**2 else result
        return result

    def _is_white(self, window: Window, fit: _Fit) -> bool:
        """Return whether noise, and not the power of the edges, dominates the short waves."""
        signal = np.exp(node_weights(fit.hurst)[0] @ self.frame.logs - fit.square * self.frame.squares)
        quiet = self.allowed & (signal < fit.noise)
        count = self.frame.count
        return bool(count[quiet & window.inside].sum() >= _WHITE * count[quiet].sum())

    def _best_form(self, window: Window, start: _Fit) -> _Fit:
        """Fit the forms that may differ, and return the best."""
        if start.square > _WIDE or self.scatter(window, start) < _POOR:
            return start
        forms = TRANSFER, BEFORE, BAND, FILTER
        return min((self.fit(window, start, form) for form in forms), key=lambda fit: fit.deviance)

    def fit(self, window: Window, start: _Fit, form: str = "", hurst: float | None = None) -> _Fit:
        """Fit one model by damped scoring steps; at a given exponent, if there is one."""
        form = form or start.form
        fit = replace(start, form=form, hurst=start.hurst if hurst is None else hurst)
        if form == NONE:
            fit = replace(fit, square=0.0)
        elif self.square is not None:
            fit = replace(fit, square=self.square)
        names = ["hurst"] * (hurst is None) + ["square"] * (form != NONE and self.square is None)
        names += ["noise"] * fit.has_noise
        fit = replace(fit, parameters=len(names))
        current = self._evaluate(window, fit)
        damping = _DAMPING
        for _ in range(_STEPS):
            fit, columns, residual = current
            score = 0.5 * (window.count * columns) @ residual
            free = [i for i, name in enumerate(names) if not _is_held(name, fit, score[i], columns[i])]
            if not free:
                break
            columns = columns[free] - np.average(columns[free], axis=1, weights=window.count)[:, None]
            information = 0.5 * (window.count * columns) @ columns.T
            diagonal = np.diag(np.maximum(np.diag(information), 1e-280))
            for _ in range(_TRIES):
                step = np.linalg.solve(information + damping * diagonal, score[free])
                moved = _moved(fit, {names[i]: float(value) for i, value in zip(free, step, strict=True)})
                trial = self._evaluate(window, moved)
                if trial[0].deviance <= fit.deviance + 1e-9:
                    break
                damping *= 6.0
            else:
                break
            gain = fit.deviance - trial[0].deviance
            current, damping = trial, max(damping / 10.0, 1e-7)
            if gain < 1e-3:
                break
        return current[0]

    def _evaluate(self, window: Window, fit: _Fit) -> tuple[_Fit, Array, Array]:
        """Return the fit with its deviance, the columns of its parameters, and the relative residuals."""
        signal, by_hurst, by_square = window.signal(fit.form, fit.hurst, fit.square)
        total = signal + fit.noise
        ratio = window.power / total
        modes = window.count.sum()
        amplitude = float(np.sum(window.count * ratio) / modes)
        deviance = float(np.sum(window.count * np.log(total)) + modes * np.log(amplitude))
        share = signal / total
        columns = (
            [by_hurst * share]
            if fit.parameters - fit.has_noise > (fit.form != NONE and self.square is None)
            else []
        )
        if fit.form != NONE and self.square is None:
            columns.append(by_square * share)
        if fit.has_noise:
            columns.append(fit.noise / total)
        stacked = np.stack(columns) if columns else np.empty((0, ratio.size))
        return replace(fit, deviance=deviance, amplitude=amplitude), stacked, ratio / amplitude - 1.0

    def scatter(self, window: Window, fit: _Fit) -> float:
        """Return z of the squared residuals of the blocks about a fit."""
        residual = self._evaluate(window, fit)[2]
        square = 0.5 * window.count * residual**2
        deviation = np.sqrt((2.0 + 12.0 * np.mean(1.0 / window.count)) / square.size)
        return float((square.mean() - 1.0) / deviation)

    def spread_in_blocks(self, window: Window, fit: _Fit) -> Array:
        """Return the variance of the logarithm of the expected power within each block."""
        frame = self.frame
        signal = window.signal(fit.form, fit.hurst, fit.square)[0]
        share = signal / (signal + fit.noise)
        fall = (2.0 * fit.hurst + frame.axes) / window.squares + 2.0 * fit.square
        return np.asarray(share**2 * fall**2 * frame.variances[1][window.inside])

    def error(self, window: Window, fit: _Fit) -> float:
        """Return the standard error of H."""
        columns = self._evaluate(window, fit)[1]
        columns = columns - np.average(columns, axis=1, weights=window.count)[:, None]
        information = 0.5 * (window.count * columns) @ columns.T
        scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-280))
        inverse = np.linalg.pinv(information * np.outer(scale, scale)) * np.outer(scale, scale)
        correlation = _CORRELATION if fit.square < _NARROW else _MORE_CORRELATION
        return float(np.sqrt(correlation * inverse[0, 0]))

    def interval(self, window: Window, fit: _Fit, rise: float) -> tuple[float, float]:
        """Return where the deviance, at the best other parameters, has risen by `rise`."""
        step = max(0.5 * self.error(window, fit), 1e-5)
        return self._end(window, fit, rise, -step), self._end(window, fit, rise, step)

    def _end(self, window: Window, best: _Fit, rise: float, step: float) -> float:
        limit = LOWEST if step < 0.0 else HIGHEST
        inside, below = best, 0.0
        while True:
            hurst = inside.hurst + step
            if (hurst - limit) * step >= 0.0:
                hurst = limit
            outside = self.fit(window, inside, hurst=hurst)
            above = outside.deviance - best.deviance
            if above >= rise:
                break
            if hurst == limit:
                return limit
            inside, below, step = outside, max(above, 0.0), 1.5 * step
        left, right, start = inside.hurst, outside.hurst, inside
        hurst = right
        for _ in range(6):  # the root of the deviance is nearly straight
            if not above > below:
                break
            share = (np.sqrt(rise) - np.sqrt(below)) / (np.sqrt(above) - np.sqrt(below))
            hurst = left + share * (right - left)
            trial = self.fit(window, start, hurst=hurst)
            value = trial.deviance - best.deviance
            if abs(value - rise) < 0.01 * rise:
                break
            if value < rise:
                left, below, start = hurst, max(value, 0.0), trial
            else:
                right, above = hurst, value
        return float(hurst)


def _flatness(power: Array, frame: Frame, inside: Array, spread: Array) -> float:
    """Return z of the mean logarithm of the squared modes about the logarithm of the mean of their block.

    `spread` is the variance of the logarithm of their expected power, which lowers it by half as much.
    """
    from scipy.special import polygamma, psi

    count = frame.count[inside]
    with np.errstate(divide="ignore"):
        logs = frame.mean(np.log(np.maximum(power, 1e-12 * power.mean())))[inside]
        means = np.log(frame.mean(power)[inside])
    expected = psi(0.5) - psi(0.5 * count) + np.log(count)  # of logarithms of chi square
    variance = np.sum(count * polygamma(1, 0.5) - count**2 * polygamma(1, 0.5 * count))
    excess = float(np.sum(count * (logs - means - expected + 0.5 * spread)))
    return excess / float(np.sqrt(variance)) if variance > 0.0 else 0.0


def _asymmetry(power: Array, frame: Frame, inside: Array) -> float:
    """Return z of the difference between waves steeper along y and along x; 0 if they are not paired."""
    if not frame.is_mirrored:
        return 0.0
    part = frame.mean(np.tril(power, -1))[inside] / frame.mean(power)[inside]
    pairs = frame.index[0][inside] != frame.index[1][inside]
    weights = 0.5 * frame.count[inside][pairs] + 1.0
    return float(np.sum(weights * (2.0 * part[pairs] - 1.0)) / np.sqrt(np.sum(weights)))


def _is_held(name: str, fit: _Fit, score: float, column: Array) -> bool:
    """Return whether a parameter is at an end of its range that its score would leave."""
    if name == "hurst":
        return (fit.hurst <= LOWEST and score < 0.0) or (fit.hurst >= HIGHEST and score > 0.0)
    if name == "noise":
        return bool(column.max() < _NO_NOISE) and score < 0.0
    return fit.square <= 0.0 and score < 0.0


def _moved(fit: _Fit, steps: dict[str, float]) -> _Fit:
    """Take steps of limited length; that of the noise is in its logarithm."""
    hurst = float(np.clip(fit.hurst + np.clip(steps.get("hurst", 0.0), -0.3, 0.3), LOWEST, HIGHEST))
    square = fit.square
    if "square" in steps:
        change = np.clip(steps["square"], -max(0.5 * square, 0.05), max(square, 0.1))
        square = float(np.clip(square + change, 0.0, _LARGEST))
    noise = fit.noise * float(np.exp(np.clip(steps.get("noise", 0.0), -2.0, 2.0)))
    return replace(fit, hurst=hurst, square=square, noise=noise)
