"""A spectrum that bends slowly into a plateau of long waves, as (q^2 + q_0^2)^(-1 - H) (K-correlation).

It is that of the Matern covariance. No octave has the exponent of the short waves, but all waves together
have it. Palasantzas (1993), Phys. Rev. B 48, 14472. Also a spectrum whose long waves a Gaussian high-pass
filter has taken (ISO 16610-61), as instrument software does: (1 - 2^(-(q / q_0)^2))^2 q^(-2 - 2 H).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.dimensions._blur import BlurredFit
from fractalcontact.dimensions._exponent_by_scale import Blocks, PowerLaw
from fractalcontact.dimensions._mode_blocks import (
    HIGH_PASS,
    HIGHEST,
    LARGEST,
    LEAKY,
    LOWEST,
    SLOW,
    SUDDEN,
    Frame,
    lattice_power,
    node_weights,
)
from fractalcontact.dimensions._records import NORMAL, Estimate
from fractalcontact.dimensions._scored_fit import Scored, best_scored
from fractalcontact.dimensions._surface_input import Surface
from fractalcontact.dimensions._transfer_functions import BEFORE, FILTER, NONE, TRANSFER, Window

Array = np.ndarray[Any, np.dtype[Any]]

LEAST_EXPONENT = 0.02  # of the rougher of two surfaces; noise has 0
ALIKE = 4.0  # its increase up to which two exponents may be there, beside blur and noise
_LEFT = 45.0  # deviance that the edges change less where no waves are left out
_AGAINST_NOISE = 6.0  # decrease by which noise must lower the penalised deviance of a roll-off
_AGAINST_FILTER = 4.0  # the same of a high-pass filter in place of a roll-off
_WEAK_NOISE = 0.1  # of the rms increment: noise beside a roll-off that the interval allows for
_PRESENT, _ROLLED = 0.25, 0.6  # exponent of the longest waves that are not filtered; the same of a roll-off
_NO_BLUR, _FIRST_SPREAD = (NONE, 0.0), 0.7  # the latter of a filter of short waves
_LEAST_LENGTH = 2.5  # spacings: a shorter corner leaves no waves beyond it
_STARTS = 0.3, 0.8  # first guesses of H
_LARGEST_SQUARE = 200.0  # spread of a blur
_FAR = 60.0  # deviance that the edges do not change
_LEAST_JUMP = 1e-20  # power of the jump of the slope over that of the heights
_CORRELATED = 1.15  # times the error beside a blur: the jump at the edges correlates modes
_SHORTER = 1.2  # cut-offs of a high-pass filter: longer waves are in its fit, but not in its exponent
_HOPELESS = 200.0  # deviance that another start does not change
_WINDOW = "the waves shorter than the corner of the roll-off"


@dataclass(frozen=True)
class RollOff:
    """A roll-off, perhaps with blur and noise.

    Attributes
    ----------
    law : PowerLaw
        Exponent of the short waves.
    length, spread : float
        Wavelength of the corner, and spread of the blur, in spacings.
    penalised : float
        Deviance with Akaike's penalty.
    noise : bool
    shape : str
        `SLOW`, `SUDDEN` (flat up to the corner), `HIGH_PASS`, or `LEAKY`, a filter that leaves some of the
        longest waves.
    form : str
        Form of the blur.
    """

    law: PowerLaw
    length: float
    penalised: float
    spread: float = 0.0
    noise: bool = False
    shape: str = SLOW
    form: str = NONE

    @property
    def is_filtered(self) -> bool:
        """Whether the long waves were filtered."""
        return self.shape in (HIGH_PASS, LEAKY)

    @property
    def has_noise_alone(self) -> bool:
        """Whether noise is there, and no blur."""
        return self.noise and not self.spread


def fit_rolloff(
    blocks: Blocks,
    inside: Array,
    *,
    blur: tuple[str, float] = (NONE, 0.0),
    noise: bool = False,
    weak_noise: float = 0.0,
    starts: Sequence[float] = _STARTS,
    shape: str = SLOW,
    most: float = np.inf,
) -> RollOff | None:
    """Fit exponent and corner to some blocks; None where the corner is not among their waves.

    None as well where the penalised deviance is far above `most`. `shape` is that of the spectrum at long
    waves, see `Frame.rolled_densities`.

    A blur of some form, with a first guess of its spread, and `noise` are fitted as well; `starts` are first
    guesses of H. `weak_noise` is the rms height of noise that is not fitted, over the rms increment.
    A blur changes the power as that of fractional Brownian heights. The power over the spectral
    density, which is that of such heights at first, is in a second fit that of the covariance that the first
    one found: a plateau of long waves has less effect of the edges.
    """
    fitted = partial(_fitted, blocks, blur=blur, noise=noise, weak_noise=weak_noise, shape=shape)
    found = fitted(inside, starts=starts, most=most)
    if found is None or shape not in (HIGH_PASS, LEAKY):
        return found
    # longer waves show how the filter ended at the edges, and little of the exponent
    shorter = inside & (blocks.wavelength < _SHORTER * found.length)
    narrow = fitted(shorter, starts=(found.law.hurst,))
    return found if narrow is None else replace(found, law=narrow.law)


def _fitted(
    blocks: Blocks,
    inside: Array,
    *,
    blur: tuple[str, float],
    noise: bool,
    weak_noise: float,
    starts: Sequence[float],
    shape: str,
    most: float = np.inf,
) -> RollOff | None:
    """Fit exponent and corner to some blocks, as `fit_rolloff` does."""
    count, wavelength, frame = blocks.count[inside], blocks.wavelength[inside], blocks.frame
    if frame is None or not wavelength.max() > _LEAST_LENGTH:
        return None
    form, first_spread = blur
    first, last = -np.log(wavelength.max()), -np.log(_LEAST_LENGTH)
    model = _Model(frame, inside, blocks.power, form, noise, weak_noise, shape)
    free, parameters = model.free, 1 + int(np.count_nonzero(model.free))
    bounds = (
        np.array([LOWEST, first, 0.0, -80.0, -12.0]),
        np.array([HIGHEST, last, _LARGEST_SQUARE, 80.0, -0.5]),
    )
    guesses = [
        model.start(hurst, place * first + (1.0 - place) * last, first_spread)
        for hurst in starts
        for place in (0.3, 0.6, 0.8)
    ]
    limits, steps = (bounds[0][free], bounds[1][free]), np.array([0.2, 0.7, 0.5, 2.0, 2.0])[free]
    fits: list[Scored] = []
    for _ in range(2 if form == NONE else 3):
        best = best_scored(model, model.power, count, guesses, limits, steps, most + _HOPELESS)
        hurst, corner = (float(value) for value in best.values[:2])
        is_far = best.deviance + 2.0 * parameters > most + _FAR
        if is_far or not (first < corner < last and best.is_regular):
            fits = fits if model.is_filtered or form != NONE else []
            break
        fits.append(best)
        if shape in (SUDDEN, LEAKY):
            break
        square = float(best.values[2]) if form != NONE else 0.0
        model.edges, model.jump = _edges(frame, hurst, float(np.exp(-corner)), shape, square)
        guesses = [best.values]
        if model.edges is None:
            break
    if not fits:
        return None
    # a filter may have reflected the heights at the edges, as those of the first fit, or gone on beyond them
    fits = fits if shape == HIGH_PASS else [fits[0], fits[-1]] if form != NONE else fits[-1:]
    best = min(fits, key=lambda fit: fit.deviance)
    hurst, corner = (float(value) for value in best.values[:2])
    error = float(best.half_widths[0]) * (_CORRELATED if form != NONE else 1.0)
    return RollOff(
        PowerLaw(hurst, hurst - error, hurst + error, float(count.sum()), best.deviance),
        float(np.exp(-corner)),
        best.deviance + 2.0 * parameters,
        float(np.sqrt(best.values[2])) if form != NONE else 0.0,
        noise or weak_noise > 0.0,
        shape,
        form,
    )


class _Model:
    """Expected power of some blocks under a roll-off, perhaps with blur and noise.

    Its parameters are the exponent, the logarithm of the wavenumber of the corner over 2 pi, the squared
    spread of the blur, and the logarithms of the noise and of the leak of a filter; `free` marks those that
    it has. `edges` and `jump`, once known, are what `_edges` returns.
    """

    def __init__(
        self, frame: Frame, inside: Array, power: Array, form: str, noise: bool, weak_noise: float, shape: str
    ) -> None:
        self.frame, self.inside, self.power = frame, inside, power[inside]
        self.form, self.noise, self.weak_noise, self.shape = form, noise, weak_noise, shape
        self.is_filtered = shape in (HIGH_PASS, LEAKY)
        self.free = np.array([True, True, form != NONE, noise, shape == LEAKY])
        self.window = Window(frame, inside, power)
        self.excess = frame.logs - frame.densities
        self.edges: Array | None = None
        self.jump: Array | None = None

    def __call__(self, values: Array) -> tuple[Array, Array]:
        """Return the logarithm of the power, and its derivatives by the free parameters."""
        every = np.array([0.0, 0.0, 0.0, -np.inf, -np.inf])
        every[self.free] = values
        hurst, square, leak = float(every[0]), float((2.0 * np.pi * np.exp(every[1])) ** 2), np.exp(every[4])
        logs, slope, by_square = self.frame.rolled_densities(hurst, square, self.shape, leak)
        if self.edges is None:
            weights, slopes = node_weights(hurst)
            logs, slope = logs + weights @ self.excess, slope + slopes @ self.excess
        else:
            logs = logs + self.edges
        logs, columns = logs[self.inside], np.zeros((5, self.power.size))
        columns[0], columns[1] = slope[self.inside], 2.0 * by_square[self.inside]
        if self.form != NONE:
            logs = self._blurred(logs, columns, hurst, float(every[2]))
        if self.noise or self.weak_noise:
            logs = self._with_noise(logs, columns, every[3], square, leak)
        if self.shape == LEAKY:
            columns[4] = self.frame.passed(square, leak)[2][self.inside]
        return logs, columns[self.free]

    def _blurred(self, logs: Array, columns: Array, hurst: float, blur: float) -> Array:
        """Return the logarithm of the blurred power; the derivatives are changed in place."""
        blurred, blurred_slope, by_blur = self.window.signal(self.form, hurst, blur)
        plain, plain_slope, _ = self.window.signal(NONE, hurst, 0.0)
        fallen = logs + np.log(blurred / plain)
        columns[0] += blurred_slope - plain_slope
        columns[2] = by_blur
        if self.jump is None:
            return np.asarray(fallen)
        edge = fallen - np.log(blurred / plain) + self.jump[self.inside]
        share = 1.0 / (1.0 + np.exp(np.minimum(edge - fallen, 600.0)))
        columns[0] -= (1.0 - share) * (blurred_slope - plain_slope)
        columns[2] *= share
        return np.asarray(np.logaddexp(fallen, edge))

    def _with_noise(self, logs: Array, columns: Array, noise: float, square: float, leak: float) -> Array:
        """Return the logarithm of the power with white noise; the derivatives are changed in place."""
        white: Any = noise if self.noise else _white(self.frame, self.inside, logs, self.weak_noise)
        if self.is_filtered:
            white = white + self.frame.passed(square, leak)[0][self.inside]
        total = np.logaddexp(logs, white)
        share = np.exp(logs - total)
        columns[[0, 2]] *= share
        columns[1] *= 1.0 if self.is_filtered else share
        columns[3] = 1.0 - share
        return np.asarray(total)

    def start(self, hurst: float, corner: float, spread: float) -> Array:
        """Return first values of the free parameters, with noise below the weakest waves."""
        values = np.array([hurst, corner, spread**2, -80.0, -3.0])
        values[3] = self(values[self.free])[0].min() - 2.0
        return np.asarray(values[self.free])


def _white(frame: Frame, inside: Array, logs: Array, share: float) -> float:
    """Return the logarithm of the power of noise, given as a share of the rms increment."""
    # along all axes: where both axes are alike, a block stands for two that are mirrored
    steps = np.mean(
        [2.0 - 2.0 * np.cos(w[inside] * d) for w, d in zip(frame.waves, frame.spacing, strict=True)], 0
    )
    return float(2.0 * np.log(share) + np.log(np.average(steps * np.exp(logs), weights=frame.count[inside])))


def _edges(
    frame: Frame, hurst: float, length: float, shape: str, blur: float
) -> tuple[Array | None, Array | None]:
    """Return what the edges add to a surface with a roll-off, as logarithms by blocks.

    The expected power over the spectral density; and that of the jump of the slope of heights with a squared
    spread `blur` over that of the heights without it, None without blur. The covariance is that of a torus of
    twice the size. None for a profile, and for a large surface.
    """
    if frame.axes == 1 or min(frame.shape) > LARGEST:
        return None, None
    y, x = (np.pi * np.arange(n + 1) / (n * d) for n, d in zip(frame.shape, frame.spacing, strict=True))
    square = (2.0 * np.pi / length) ** 2
    lines = (replace(frame, waves=(np.full(x.size, line), x)) for line in y)
    logs = np.array([line.rolled_densities(hurst, square, shape)[0] for line in lines])

    def power(density: Array) -> Array:
        covariance = fft.dct(density, 1, (0, 1))[:-1, :-1] / (4.0 * np.prod(frame.shape))
        return lattice_power(frame, covariance)

    plain = power(np.exp(logs))
    edges = np.asarray(np.log(plain) - frame.rolled_densities(hurst, square, shape)[0])
    if not blur:
        return edges, None
    blurred = power(np.exp(logs - blur * (y[:, None] ** 2 + x**2)))
    jump = np.maximum(blurred - plain * np.exp(-blur * frame.squares), _LEAST_JUMP * plain)
    return edges, np.log(jump / plain)


@dataclass(frozen=True)
class RollOffs:
    """Roll-offs and high-pass filters as explanations of the same waves.

    Attributes
    ----------
    blocks : Blocks
    fit : BlurredFit
        Blur and noise.
    longest : PowerLaw
        That of the longest octave.
    reference : callable
        Return the penalised deviance of blur and noise on some blocks.
    is_shortened : bool
        Whether the longest waves do not belong to blur and noise.
    has_aliases : bool
    """

    blocks: Blocks
    fit: BlurredFit
    longest: PowerLaw
    reference: Callable[[Array], float]
    is_shortened: bool
    has_aliases: bool

    @cached_property
    def ranked(self) -> list[tuple[float, RollOff]]:
        """Slow roll-offs of a fractal exponent with their `excess`, the likeliest first.

        Noise is fitted where a roll-off alone explains the waves. Elsewhere, where blur and noise leave the
        longest waves out, or show noise, the roll-off has a blur. A high-pass filter is tried where the
        longest waves are weak.
        """
        fit = self.fit
        found = self._fitted(_NO_BLUR)
        if found and found[0][0] < ALIKE:
            starts = (found[0][1].law.hurst + 0.05,)
            noisy = self._fitted(_NO_BLUR, noise=True, starts=starts)
            found += [pair for pair in noisy if pair[0] < found[0][0] - _AGAINST_NOISE]
            # without aliases noise would only stand for them
            found += self._fitted(_NO_BLUR, weak_noise=_WEAK_NOISE, starts=starts) if self.has_aliases else []
        elif fit.form != NONE and (self.is_shortened or np.isfinite(fit.noise) or fit.low <= LOWEST):
            found = self._blurred(dict.fromkeys((fit.form, FILTER, BEFORE), fit.spread), SLOW)
            if not self.is_shortened:  # what looks like noise may be the plateau
                found = [(excess, each) for excess, each in found if excess < 0.0 and not each.noise]
        longest = self.longest
        if 0.5 * (longest.hurst + longest.high) < (_PRESENT if not found else _ROLLED):
            found += self._high_passed
        found = [each for each in found if each[1].law.hurst > LEAST_EXPONENT and each[1].law.low < 1.0]
        return sorted(
            found,
            key=lambda pair: (
                pair[0] + _AGAINST_NOISE * pair[1].has_noise_alone + _AGAINST_FILTER * pair[1].is_filtered
            ),
        )

    @cached_property
    def _high_passed(self) -> list[tuple[float, RollOff]]:
        """High-pass filters; none where a sudden roll-off, of which a run of octaves is left, is likelier."""
        spreads = {NONE: 0.0, FILTER: _FIRST_SPREAD, TRANSFER: _FIRST_SPREAD}
        found = (
            self._blurred(spreads, HIGH_PASS) if self.has_aliases else self._fitted(_NO_BLUR, shape=HIGH_PASS)
        )
        if not found:
            return []
        least, best = min(found, key=lambda pair: pair[0])
        sudden = self._fitted((best.form, best.spread), shape=SUDDEN)
        return [] if sudden and sudden[0][0] < least else found

    def _blurred(self, spreads: dict[str, float], shape: str) -> list[tuple[float, RollOff]]:
        """Fit some forms of blur with a first guess of their spreads, the best of them also with noise.

        Where the first form is no explanation, and the longest waves are not weak, nothing else is tried.
        A filter of short waves before the high-pass filter has also removed noise.
        """
        found: list[tuple[float, RollOff]] = []
        for blur in spreads.items():
            if blur[0] == TRANSFER and found and found[0] == min(found, key=lambda pair: pair[0]):
                break  # another form of blur is no better than none
            found += self._fitted(blur, shape=shape)
            if not (self.is_shortened or (found and found[0][0] < 0.0)):
                return []
        best = min(found, key=lambda pair: pair[0], default=(np.inf, None))[1]
        blur = next(iter(spreads.items())) if best is None else (best.form, best.spread)
        if shape == SLOW or blur == _NO_BLUR:
            found += self._fitted(blur, shape=shape, noise=True)
        return found + (self._fitted(blur, shape=LEAKY) if shape == HIGH_PASS else [])

    def _fitted(self, blur: tuple[str, float], **options: Any) -> list[tuple[float, RollOff]]:
        """Fit one roll-off; beside a blur on its waves and longer ones."""
        inside, reference = self._whole if blur == _NO_BLUR else self._beside_blur
        most = reference if self.is_shortened or blur == _NO_BLUR else reference - _LEFT
        rolloff = fit_rolloff(self.blocks, inside, blur=blur, most=most, **options)
        return [(rolloff.penalised - reference, rolloff)] if rolloff else []

    @cached_property
    def _whole(self) -> tuple[Array, float]:
        """All blocks, and the penalised deviance of blur and noise on them."""
        everywhere = np.ones(self.blocks.count.size, dtype=bool)
        return everywhere, self.reference(everywhere)

    @cached_property
    def _beside_blur(self) -> tuple[Array, float]:
        """Blocks of blur and noise with those of longer waves, and the penalised deviance on them."""
        squares, inside = self.blocks.wavelength**-2.0, self.fit.inside
        inside = inside | (squares < squares[inside].min())
        return inside, self.reference(inside)

    @property
    def likeliest(self) -> RollOff | None:
        """The likeliest roll-off; it holds those of other forms, or with noise, nearly as likely."""
        if not self.ranked:
            return None
        excess, best = self.ranked[0]
        near = [each for other, each in self.ranked if other < excess + ALIKE]
        alike = [
            each
            for each in near
            if each.is_filtered != best.is_filtered or (each.has_noise_alone and not each.is_filtered)
        ]
        laws = [each.law for each in (near if best.spread else [best, *alike])]
        low, high = min(law.low for law in laws), max(law.high for law in laws)
        return replace(best, law=replace(best.law, low=low, high=high))


def rolloff_estimate(rolloff: RollOff, blocks: Blocks, surface: Surface) -> Estimate:
    """Return the estimate of a surface with a roll-off."""
    law, dx = rolloff.law, surface.spacing[1]
    power = "-1 - H" if blocks.axes == 2 else "-1/2 - H"
    length = f"{rolloff.length * dx:.3g} m{_beside(rolloff)}"
    if rolloff.is_filtered:
        note = f"a Gaussian high-pass filter with a cut-off of {length}: waves longer than it are not there"
    else:
        form = f"{'max(q^2, q_0^2)' if rolloff.shape == SUDDEN else '(q^2 + q_0^2)'}^({power})"
        note = f"a {rolloff.shape} roll-off: the spectrum falls as {form} with a corner at waves of {length}"
    return Estimate(
        law.hurst,
        0.5 * (law.high - law.low) / NORMAL,
        law.low,
        law.high,
        scale_min=float(blocks.wavelength.min()) * dx,
        scale_max=rolloff.length * dx,
        window=_WINDOW,
        note=note,
    )


def _beside(rolloff: RollOff) -> str:
    """Return what is fitted beside a roll-off."""
    parts = [f"a blur with a spread of {rolloff.spread:.2g} spacings"] if rolloff.spread > 0.0 else []
    parts += ["white noise"] if rolloff.noise else []
    return f", with {' and '.join(parts)}" if parts else ""
