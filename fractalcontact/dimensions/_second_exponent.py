"""A second exponent, which bends the spectrum of a surface as blur and noise do.

Three explanations are compared by their penalised deviance: blur and noise (`_blur`), the sum of two
fractional Brownian surfaces, and one exponent in a run of octaves with others beside it
(`_exponent_by_scale`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from fractalcontact.dimensions._blur import BlurredFit
from fractalcontact.dimensions._blur_fit import CORRELATION
from fractalcontact.dimensions._exponent_by_scale import (
    Blocks,
    Octave,
    PowerLaw,
    Run,
    fit_power_law,
    interval_of_run,
    longest_run,
    octaves,
    run_estimate,
)
from fractalcontact.dimensions._mode_blocks import HIGHEST, LOWEST, node_weights
from fractalcontact.dimensions._records import NORMAL, Estimate
from fractalcontact.dimensions._surface_input import Surface

Array = np.ndarray[Any, np.dtype[Any]]

_SCORING_STEPS = 40  # of a fit of two exponents
_LEAST_EXPONENT = 0.02  # of the rougher of two surfaces; noise has 0
_FLAT = 1.2  # times the standard errors of two exponents: the likelihood is flatter than a parabola
_WIDEST = 0.15  # half-width of the exponent of a rougher surface that may be there
_DECISIVE = 2.0  # decrease of the penalised deviance by which several exponents replace blur and noise
_SHORTENED = 12.0  # its increase up to which they do so where blur leaves the longest waves out
_TWO_ALONE = 6.0  # decrease from which blur and noise are excluded beside two exponents
_UNDECIDED = 5.4  # the same beside a run of octaves: 1.4 times 3.84
_POSSIBLE = 0.5  # decrease of the penalised deviance by which blur or noise may be there
_ALIKE = 4.0  # its increase up to which two exponents may be there, beside blur and noise
_SHORTEST_KNEE = 8.0  # spacings: shorter waves show blur and noise
_KNEE_PARAMETERS, _LEAST_KNEE = 5, 12.0  # of two power laws and their place; modes of either
_KNEE_SEEN = 6.0  # decrease of the deviance by a knee from which the interval of a single exponent holds it
_TWO_WINDOW = "the waves in which the rougher of two surfaces is the stronger"
_KNEE_WINDOW = "the waves shorter than those on which the exponent changes"
_OR_NOISE = "blur and noise explain the waves nearly as well: the interval holds their exponent"


@dataclass(frozen=True)
class TwoExponents:
    """Sum of two independent surfaces: the rougher one holds the shorter waves.

    Attributes
    ----------
    rough, smooth : PowerLaw
        Their exponents with intervals.
    crossover : float
        Wavelength in spacings at which both have the same power.
    penalised : float
        Deviance with Akaike's penalty.
    """

    rough: PowerLaw
    smooth: PowerLaw
    crossover: float
    penalised: float


@dataclass(frozen=True)
class Explanations:
    """Blur and noise, and several exponents, as explanations of the same waves; each is fitted once.

    Attributes
    ----------
    fit : BlurredFit
    blocks : Blocks
    """

    fit: BlurredFit
    blocks: Blocks

    @cached_property
    def record(self) -> list[Octave]:
        """The octaves of wavelength, the shortest first."""
        return octaves(self.blocks)

    @cached_property
    def is_shortened(self) -> bool:
        """Whether the longest waves do not belong to blur and noise."""
        wavelength = self.blocks.wavelength
        return float(wavelength[self.fit.inside].max()) < 0.99 * float(wavelength.max())

    @cached_property
    def two(self) -> TwoExponents | None:
        """Two exponents; None if they are not fitted, because blur and noise leave out the longest waves."""
        return None if self.is_shortened else fit_two_exponents(self.blocks, self.fit.inside)

    @cached_property
    def knee(self) -> Knee | None:
        """One exponent of the shorter waves, and a smaller one of the longer waves."""
        return fit_knee(self.record, self.fit.inside)

    def excess(self, penalised: float) -> float:
        """Return a penalised deviance less that of blur and noise, which does not count the amplitude."""
        return penalised - 2.0 - self.fit.penalised


def several_exponents(explained: Explanations, surface: Surface) -> Estimate | None:
    """Return the estimate where the exponent changes with scale; None if blur and noise are likelier.

    A roll-off at long waves, or a second exponent, bends the spectrum as blur and noise do. They differ
    where blur and noise describe only the shorter waves, and in the likelihood.
    """
    fit, record, two = explained.fit, explained.record, explained.two
    if two is not None and two.rough.hurst > _LEAST_EXPONENT:
        excess = explained.excess(two.penalised)
        if excess < -_DECISIVE:
            estimate = _two_estimate(two, record[0], explained.blocks, surface)
            is_decided = excess < -_TWO_ALONE or not fit.is_good
            return estimate if is_decided else estimate.holding(fit.low, fit.high, _OR_NOISE)
    knee = None if explained.is_shortened else explained.knee
    if knee is not None and LOWEST < knee.run.fit.hurst < 1.0:
        excess = explained.excess(knee.penalised)
        if excess < -_DECISIVE:
            estimate = _knee_estimate(knee, record, surface)
            is_decided = excess < -_UNDECIDED or not fit.is_good
            return estimate if is_decided else estimate.holding(fit.low, fit.high, _OR_NOISE)
    run = longest_run(record)
    if run.last - run.first < 2 or not LOWEST < run.fit.hurst < 1.0:
        return None
    excess = explained.excess(penalised_deviance(record, run, fit.inside))
    if excess >= (_SHORTENED if explained.is_shortened else -_DECISIVE):
        return None
    estimate = run_estimate(run, surface)
    if not (fit.is_good and excess > -_UNDECIDED):
        return estimate
    return estimate.holding(fit.low if fit.low > LOWEST else 0.0, fit.high, _OR_NOISE)


def alternatives(explained: Explanations, *, is_bent: bool) -> tuple[float, float]:
    """Return the range of exponents of explanations that are nearly as likely; (inf, -inf) if there are none.

    They are blur and noise, two exponents, and, unless a single exponent is excluded (`is_bent`), that of the
    shortest octave. In a small surface noise and a second exponent of the shorter waves are much alike.
    """
    fit, two, knee = explained.fit, explained.two, explained.knee
    ranges: list[tuple[float, float]] = []
    if fit.is_good and fit.gain > _POSSIBLE:
        ranges.append((fit.low, fit.high))
    has_second = two is not None and explained.excess(two.penalised) < _ALIKE
    if two is not None and has_second:
        half_width = min(two.rough.high - two.rough.hurst, _WIDEST)
        ranges.append((two.rough.hurst - half_width, two.rough.hurst + half_width))
    if knee is not None and explained.excess(knee.penalised) < _ALIKE:
        ranges.append((knee.run.fit.low, knee.run.fit.high))
    if has_second or not is_bent:
        shortest = explained.record[0].fit
        ranges.append((shortest.low, shortest.high))
    lows, highs = zip(*ranges, strict=True) if ranges else ((np.inf,), (-np.inf,))
    return max(min(lows), 0.0), min(max(highs), 1.0)


@dataclass(frozen=True)
class Knee:
    """Two exponents that change at the edge of an octave: the run of the shorter waves, and the longer ones.

    Attributes
    ----------
    run : Run
        The octaves of the shorter waves.
    longer : PowerLaw
    penalised : float
        Deviance with Akaike's penalty.
    gain : float
        Decrease of the deviance against one exponent.
    """

    run: Run
    longer: PowerLaw
    penalised: float
    gain: float

    @property
    def held(self) -> tuple[float, float]:
        """The interval of the shorter waves where a knee may be there; (inf, -inf) otherwise."""
        return (self.run.fit.low, self.run.fit.high) if self.gain > _KNEE_SEEN else (np.inf, -np.inf)


def _knee_estimate(knee: Knee, record: Sequence[Octave], surface: Surface) -> Estimate:
    """Return the estimate of the shorter of the waves on either side of a knee."""
    law, end = knee.longer, knee.run.high * surface.spacing[1]
    note = (
        f"no single exponent holds at all scales: {knee.run.fit.hurst:.2f} is that of waves shorter than "
        f"{end:.3g} m, {law.hurst:.2f} [{law.low:.2f}, {law.high:.2f}] that of longer ones (see `scaling`)"
    )
    estimate = run_estimate(knee.run, surface).holding(*interval_of_run(knee.run, record))
    return replace(estimate, window=_KNEE_WINDOW, note=note)


def fit_knee(record: Sequence[Octave], inside: Array) -> Knee | None:
    """Fit one exponent to the shorter of some waves, and a smaller one to the longer waves.

    None if there are too few waves, or none that are smooth on rough longer ones: a sum of two surfaces is
    never so.
    """
    blocks, best = record[0].blocks, None
    for k in range(1, len(record)):
        short = np.logical_or.reduce([octave.inside for octave in record[:k]]) & inside
        long = inside & ~short
        numbers = blocks.count[short].sum(), blocks.count[long].sum()
        if record[k - 1].high < _SHORTEST_KNEE * (1 - 1e-9) or min(numbers) < _LEAST_KNEE:
            continue
        shorter, longer = (fit_power_law(blocks, part) for part in (short, long))
        deviance = shorter.deviance + longer.deviance
        if shorter.hurst > longer.hurst and (best is None or deviance < best[0]):
            best = deviance, Run(0, k, record[0].low, record[k - 1].high, shorter), longer
    if best is None:
        return None
    deviance, run, longer = best
    single = fit_power_law(blocks, inside).deviance
    return Knee(run, longer, deviance + 2.0 * _KNEE_PARAMETERS, single - deviance)


def _two_estimate(two: TwoExponents, shortest: Octave, blocks: Blocks, surface: Surface) -> Estimate:
    """Return the estimate of the rougher of two surfaces, which holds the shorter waves.

    The interval also holds that of the shortest octave alone, for the exponent may change suddenly.
    """
    dx, rough, smooth = surface.spacing[1], two.rough, two.smooth
    return Estimate(
        rough.hurst,
        0.5 * (rough.high - rough.low) / NORMAL,
        min(rough.low, shortest.fit.low),
        max(rough.high, shortest.fit.high),
        scale_min=float(blocks.wavelength.min()) * dx,
        scale_max=two.crossover * dx,
        window=_TWO_WINDOW,
        note=f"two exponents: {rough.hurst:.2f} of waves shorter than {two.crossover * dx:.3g} m, and "
        f"{smooth.hurst:.2f} [{smooth.low:.2f}, {smooth.high:.2f}] of longer ones, as in a sum of two "
        "surfaces (see `scaling`)",
    )


def fit_two_exponents(blocks: Blocks, inside: Array) -> TwoExponents | None:
    """Fit the sum of two fractional Brownian surfaces to some blocks; None without a crossover in them.

    The exponents and the wavenumber at which both have the same power are found by damped scoring.
    """
    if blocks.frame is None:
        return None
    logs, power, count = blocks.frame.logs[:, inside], blocks.power[inside], blocks.count[inside]
    waves = np.log(2.0 * np.pi / blocks.wavelength[inside])
    modes, best = float(count.sum()), None
    for place in (0.25, 0.5, 0.75):
        start = np.array([0.3, 0.8, (1.0 - place) * waves.min() + place * waves.max()])
        fit = _scored(logs, power, count, waves, start)
        if best is None or fit[0] < best[0]:
            best = fit
    if best is None:
        return None
    deviance, (rough, smooth, crossing), information = best
    if not (waves.min() < crossing < waves.max() and np.linalg.cond(information) < 1e12):
        return None
    errors = _FLAT * NORMAL * np.sqrt(CORRELATION * np.diag(np.linalg.inv(information)))
    laws = [
        PowerLaw(float(hurst), float(hurst - error), float(hurst + error), modes, deviance)
        for hurst, error in zip((rough, smooth), errors[:2], strict=True)
    ]
    return TwoExponents(laws[0], laws[1], float(2.0 * np.pi / np.exp(crossing)), deviance + 2.0 * 4)


def _scored(
    logs: Array, power: Array, count: Array, waves: Array, values: Array
) -> tuple[float, Array, Array]:
    """Return deviance, parameters (both exponents, logarithm of the crossover) and information.

    `logs` is the table of the expected power at the nodes.
    """
    modes, damping = float(count.sum()), 1e-2

    def evaluate(values: Array) -> tuple[float, Array, Array]:
        weights = np.stack([part for hurst in values[:2] for part in node_weights(hurst)])
        first, first_slope, second, second_slope = weights @ logs
        at = np.argmin(np.abs(waves - values[2]))
        # both powers are equal at the wavenumber; there they fall as q^(-2 H - axes)
        shift = first[at] - second[at] + 2.0 * (values[1] - values[0]) * (values[2] - waves[at])
        total = np.logaddexp(first, second + shift)
        share = np.exp(second + shift - total)
        ratio = np.exp(np.log(np.maximum(power, 1e-300)) - total)
        level = float(np.sum(count * ratio) / modes)
        columns = np.stack(
            [
                (1.0 - share) * first_slope + share * first_slope[at],
                share * (second_slope - second_slope[at]),
                2.0 * (values[1] - values[0]) * share,
            ]
        )
        columns -= np.average(columns, axis=1, weights=count)[:, None]
        deviance = float(np.sum(count * total) + modes * np.log(level))
        return deviance, columns, ratio / level - 1.0

    current = evaluate(values)
    for _ in range(_SCORING_STEPS):
        deviance, columns, residual = current
        information = 0.5 * (count * columns) @ columns.T
        score = 0.5 * (count * columns) @ residual
        ridge = np.diag(damping * np.diag(information) + 1e-12)
        step = np.linalg.lstsq(information + ridge, score, rcond=None)[0]
        step = np.clip(step, [-0.2, -0.2, -0.7], [0.2, 0.2, 0.7])
        moved = np.clip(values + step, [LOWEST, LOWEST, waves.min()], [HIGHEST, HIGHEST, waves.max()])
        trial = evaluate(moved)
        if trial[0] > deviance + 1e-9:
            damping *= 6.0
            if damping > 1e6:
                break
            continue
        values, current, damping = moved, trial, max(damping / 10.0, 1e-7)
        if deviance - trial[0] < 1e-3:
            break
    columns = current[1]
    return current[0], values, 0.5 * (count * columns) @ columns.T


def penalised_deviance(record: Sequence[Octave], run: Run, inside: Array) -> float:
    """Return the deviance of one exponent in a run and another in every other octave, with its penalty.

    Akaike's penalty of two parameters, exponent and amplitude, for the run and for every other octave.
    """
    blocks = record[0].blocks
    parts = [np.logical_or.reduce([octave.inside for octave in record[run.first : run.last]])]
    parts += [octave.inside for k, octave in enumerate(record) if not run.first <= k < run.last]
    fits = [fit_power_law(blocks, part & inside) for part in parts if np.any(part & inside)]
    return sum(fit.deviance + 4.0 for fit in fits)
