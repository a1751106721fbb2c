"""A second exponent, which bends the spectrum of a surface as blur and noise do.

Three explanations are compared by their penalised deviance: blur and noise (`_blur`), the sum of two
fractional Brownian surfaces, and one exponent in a run of octaves with others beside it
(`_exponent_by_scale`). Several exponents are also compared with waves that have no aliases, as in a crop of a
periodic surface: nothing beyond the sampling, and often a corner in the spectrum, or a bend (`_rolloff`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from fractalcontact.dimensions._blur import BlurredFit
from fractalcontact.dimensions._exponent_by_scale import (
    Blocks,
    Octave,
    PowerLaw,
    Run,
    fit_power_law,
    frame_blocks,
    interval_of_run,
    longest_run,
    octaves,
    run_estimate,
)
from fractalcontact.dimensions._mode_blocks import (
    HIGHEST,
    LOWEST,
    Frame,
    node_weights,
)
from fractalcontact.dimensions._records import NORMAL, Estimate, joined
from fractalcontact.dimensions._rolloff import ALIKE, LEAST_EXPONENT, RollOff, RollOffs, rolloff_estimate
from fractalcontact.dimensions._scored_fit import best_scored
from fractalcontact.dimensions._surface_input import Surface

Array = np.ndarray[Any, np.dtype[Any]]

_LEAST_CROSSOVER = 2.0  # spacings: shorter waves run along the diagonals only
_WIDEST = 0.15  # half-width of the exponent of a rougher surface that may be there
DECISIVE = 2.0  # decrease of the penalised deviance by which several exponents replace blur and noise
_SHORTENED = 12.0  # its increase up to which they do so where blur leaves the longest waves out
_TWO_ALONE = 6.0  # decrease from which blur and noise are excluded beside two exponents
_UNDECIDED = 5.4  # the same beside a run of octaves: 1.4 times 3.84
_POSSIBLE = 0.5  # decrease of the penalised deviance by which blur or noise may be there
_AGAINST_SINGLE = 6.0  # decrease by which several exponents without aliases replace a single one
_FAR = 30.0  # penalised deviance of a run beyond which aliases are not missing
_SHORTEST_KNEE = 8.0  # spacings: shorter waves show blur and noise
_KNEE_PARAMETERS, _LEAST_KNEE = 5, 12.0  # of two power laws and their place; modes of either
_KNEE_SEEN = 6.0  # decrease of the deviance by a knee from which the interval of a single exponent holds it
_TWO_WINDOW = "the short waves, in which the rougher of two added surfaces is the stronger"
_KNEE_WINDOW = "the waves shorter than those on which the exponent changes"
NO_ALIASES = "there are no waves shorter than two spacings, as in a crop of a periodic surface"
_OR_ROLLOFF = "a slow roll-off explains the waves nearly as well: the interval holds its exponent"
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
    is_sharp : bool
        Whether every wave has the power of the stronger surface instead of their sum.
    """

    rough: PowerLaw
    smooth: PowerLaw
    crossover: float
    penalised: float
    is_sharp: bool

    def held(self, widest: float = _WIDEST) -> tuple[float, float]:
        """Return the interval of the rougher one where it may be there, of at most a given half-width."""
        half_width = min(self.rough.high - self.rough.hurst, widest)
        return self.rough.hurst - half_width, self.rough.hurst + half_width


@dataclass(frozen=True)
class Explanations:
    """Blur and noise, and several exponents, as explanations of the same waves; each is fitted once.

    Attributes
    ----------
    fit : BlurredFit
    blocks : Blocks
    has_aliases : bool
        Whether the expected power of the blocks has aliases. Without them the second exponent may also begin
        suddenly, at a corner of the spectrum.
    rival : Explanations, optional
        Those of waves without aliases, which are less likely.
    """

    fit: BlurredFit
    blocks: Blocks
    has_aliases: bool = True
    rival: Explanations | None = None

    @classmethod
    def likelier(cls, fit: BlurredFit, means: Array, frame: Frame) -> Explanations:
        """Return those of waves with aliases, unless several exponents without aliases are likelier.

        Crops of periodic surfaces have no waves beyond the sampling. `means` are the mean squares of the
        blocks of `frame`.
        """
        aliased = cls(fit, frame_blocks(means, frame))
        if not fit.is_even:
            return aliased
        unaliased = cls(fit, frame_blocks(means, frame.unaliased), has_aliases=False)
        shortest = unaliased.record[0].fit
        is_smooth = shortest.low > 1.0 or shortest.high < 0.0
        if is_smooth and (unaliased.rolloff_excess > ALIKE or not unaliased.is_rolloff):
            return aliased
        if unaliased.run_excess > _FAR and unaliased.rolloff_excess > _FAR:
            return aliased
        excess = np.inf if aliased.choice is None else aliased.choice[1] - DECISIVE
        if unaliased.choice is not None and unaliased.choice[1] < excess:
            return unaliased
        return replace(aliased, rival=unaliased)

    @cached_property
    def inside(self) -> Array:
        """Blocks on which the explanations are compared: those of blur and noise, without aliases all."""
        return self.fit.inside if self.has_aliases else self.everywhere

    @cached_property
    def reference(self) -> float:
        """Penalised deviance of blur and noise on the blocks that are compared."""
        return self._reference(self.inside)

    def _reference(self, inside: Array) -> float:
        """Return that of some blocks; octaves of blocks that blur and noise leave out have their own law."""
        parts = [octave.inside & inside & ~self.fit.inside for octave in self.record]
        laws = [fit_power_law(self.blocks, part) for part in parts if np.any(part)]
        return self.fit.penalised + 2.0 + sum(law.deviance + 4.0 for law in laws)

    @cached_property
    def everywhere(self) -> Array:
        """All blocks."""
        return np.ones(self.blocks.count.size, dtype=bool)

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
        if self.has_aliases:
            return None if self.is_shortened else fit_two_exponents(self.blocks, self.inside)
        fits = [fit_two_exponents(self.blocks, self.inside, is_sharp=sharp) for sharp in (False, True)]
        seen = [fit for fit in fits if fit is not None and fit.crossover > _LEAST_CROSSOVER]
        rough = [fit for fit in seen if fit.rough.hurst > LEAST_EXPONENT]
        return min(rough, key=lambda fit: fit.penalised, default=None)

    @cached_property
    def knee(self) -> Knee | None:
        """One exponent of the shorter waves, and a smaller one of the longer waves."""
        return fit_knee(self.record, self.inside)

    @property
    def likely_knee(self) -> Knee | None:
        """The knee; None with aliases if blur and noise leave out the longest waves."""
        return None if self.is_shortened and self.has_aliases else self.knee

    @cached_property
    def run(self) -> Run:
        """The longest run of octaves with one exponent."""
        return longest_run(self.record)

    @cached_property
    def run_excess(self) -> float:
        """`excess` of the run, with other exponents beside it."""
        return self.excess(penalised_deviance(self.record, self.run, self.inside))

    @cached_property
    def rolloffs(self) -> RollOffs:
        """Roll-offs and high-pass filters of the same waves."""
        return RollOffs(
            self.blocks,
            self.fit,
            self.record[-1].fit,
            self._reference,
            is_shortened=self.is_shortened,
            has_aliases=self.has_aliases,
        )

    @property
    def rolloff(self) -> RollOff | None:
        """The likeliest roll-off."""
        return self.rolloffs.likeliest

    @property
    def rolloff_excess(self) -> float:
        """`excess` of the likeliest roll-off; infinite without one."""
        return self.rolloffs.ranked[0][0] if self.rolloffs.ranked else np.inf

    @property
    def is_rolloff(self) -> bool:
        """Whether a slow roll-off is the likeliest."""
        return self.choice is not None and self.choice[0] == "rolloff"

    def beside_rolloff(self, estimate: Estimate, excess: float) -> Estimate:
        """Return an estimate with an `excess` that holds a slow roll-off that is nearly as likely."""
        if self.rolloff is None or self.is_rolloff or self.rolloff_excess > excess + ALIKE:
            return estimate
        return estimate.holding(self.rolloff.law.low, self.rolloff.law.high, _OR_ROLLOFF)

    @cached_property
    def single(self) -> float:
        """`excess` of one exponent, which is among blur and noise with aliases; infinite then."""
        if self.has_aliases:
            return np.inf
        return self.excess(fit_power_law(self.blocks, self.inside).deviance + 4.0)

    @cached_property
    def choice(self) -> tuple[str, float] | None:
        """Several exponents that are likelier than blur and noise, kind and `excess`; None if none are.

        Without aliases they may be a little less likely where blur and noise leave the longest waves out.
        """
        limit = -DECISIVE if self.has_aliases or not self.is_shortened else ALIKE
        return self._choice(min(limit, self.single - _AGAINST_SINGLE))

    @property
    def possible(self) -> list[tuple[float, float]]:
        """The interval of several exponents without aliases that are nearly as likely as blur and noise."""
        choice = self._choice(min(ALIKE, self.single - ALIKE))
        if choice is None:
            return []
        if choice[0] == "two" and self.two is not None:
            return [self.two.held()]
        if choice[0] == "rolloff" and self.rolloff is not None:
            return [(self.rolloff.law.low, self.rolloff.law.high)]
        run = self.knee.run if choice[0] == "knee" and self.knee is not None else self.run
        return [interval_of_run(run, self.record)]

    def _choice(self, limit: float) -> tuple[str, float] | None:
        two, knee, run = self.two, self.likely_knee, self.run
        excess = np.inf if two is None else self.excess(two.penalised)
        rivals = [excess, self.run_excess] if run.last > run.first else [excess]
        if self.rolloff_excess < min(limit, *rivals):
            return "rolloff", self.rolloff_excess
        if two is not None and two.rough.hurst > LEAST_EXPONENT and excess < limit:
            return "two", excess
        excess = np.inf if knee is None else self.excess(knee.penalised)
        if knee is not None and LOWEST < knee.run.fit.hurst < 1.0 and excess < limit:
            return "knee", excess
        if run.last - run.first < 2 or not LOWEST < run.fit.hurst < 1.0:
            return None
        if self.has_aliases:
            limit = _SHORTENED if self.is_shortened else limit
        elif run.first > 0 or run.last == len(self.record):
            return None  # only the shortest waves show that there are no aliases
        if self.run_excess > limit:
            return None
        # where blur and noise leave the longest waves out, the same is left to a roll-off
        return min(("run", self.run_excess), ("rolloff", self.rolloff_excess), key=lambda kind: kind[1])

    def excess(self, penalised: float) -> float:
        """Return a penalised deviance less that of blur and noise."""
        return penalised - self.reference


def several_exponents(explained: Explanations, surface: Surface) -> Estimate | None:
    """Return the estimate where the exponent changes with scale; None if blur and noise are likelier.

    A roll-off at long waves, or a second exponent, bends the spectrum as blur and noise do. They differ
    where blur and noise describe only the shorter waves, and in the likelihood.
    """
    if explained.choice is None:
        return None
    kind, excess = explained.choice
    fit, two, knee = explained.fit, explained.two, explained.knee
    if kind == "two" and two is not None:
        estimate = two_estimate(two, explained.record[0], explained.blocks, surface)
    elif kind == "rolloff" and explained.rolloff is not None:
        estimate = rolloff_estimate(explained.rolloff, explained.blocks, surface)
    elif kind == "knee" and knee is not None:
        estimate = knee_estimate(knee, explained.record, surface)
    else:
        estimate = run_estimate(explained.run, surface)
    if not explained.has_aliases:
        estimate = replace(estimate, note=joined(estimate.note, NO_ALIASES))
    estimate = explained.beside_rolloff(estimate, excess)
    if not fit.is_good or excess < (-_TWO_ALONE if kind == "two" else -_UNDECIDED):
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
    has_second = two is not None and explained.excess(two.penalised) < ALIKE
    if two is not None and has_second:
        ranges.append(two.held())
    if knee is not None and explained.excess(knee.penalised) < ALIKE:
        ranges.append((knee.run.fit.low, knee.run.fit.high))
    limit = _SHORTENED if explained.is_shortened else ALIKE
    if explained.rolloff is not None and explained.rolloff_excess < limit:
        ranges.append((explained.rolloff.law.low, explained.rolloff.law.high))
    if explained.rival is not None:
        ranges += explained.rival.possible
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


def knee_estimate(knee: Knee, record: Sequence[Octave], surface: Surface) -> Estimate:
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


def two_estimate(two: TwoExponents, shortest: Octave, blocks: Blocks, surface: Surface) -> Estimate:
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
        f"{smooth.hurst:.2f} [{smooth.low:.2f}, {smooth.high:.2f}] of longer ones"
        f"{'' if two.is_sharp else ', as in a sum of two surfaces'} (see `scaling`)",
    )


def fit_two_exponents(blocks: Blocks, inside: Array, *, is_sharp: bool = False) -> TwoExponents | None:
    """Fit the sum of two fractional Brownian surfaces to some blocks; None without a crossover in them.

    The exponents and the wavenumber at which both have the same power are found by damped scoring. With
    `is_sharp` every wave has the power of the stronger one instead of their sum.
    """
    if blocks.frame is None:
        return None
    table, power, count = blocks.frame.logs[:, inside], blocks.power[inside], blocks.count[inside]
    waves = np.log(2.0 * np.pi / blocks.wavelength[inside])
    bounds = np.array([LOWEST, LOWEST, waves.min()]), np.array([HIGHEST, HIGHEST, waves.max()])

    def model(values: Array) -> tuple[Array, Array]:
        """Return the logarithm of the sum of both powers, and its derivatives."""
        weights = np.stack([part for hurst in values[:2] for part in node_weights(hurst)])
        first, first_slope, second, second_slope = weights @ table
        at = np.argmin(np.abs(waves - values[2]))
        # both powers are equal at the wavenumber; there they fall as q^(-2 H - axes)
        shift = first[at] - second[at] + 2.0 * (values[1] - values[0]) * (values[2] - waves[at])
        second = second + shift
        total = np.maximum(first, second) if is_sharp else np.logaddexp(first, second)
        share = np.where(second > first, 1.0, 0.0) if is_sharp else np.exp(second - total)
        columns = np.stack(
            [
                (1.0 - share) * first_slope + share * first_slope[at],
                share * (second_slope - second_slope[at]),
                2.0 * (values[1] - values[0]) * share,
            ]
        )
        return total, columns

    starts = [
        np.array([0.3, 0.8, (1.0 - place) * waves.min() + place * waves.max()]) for place in (0.25, 0.5, 0.75)
    ]
    best = best_scored(model, power, count, starts, bounds, np.array([0.2, 0.2, 0.7]))
    rough, smooth, crossing = best.values
    if not (waves.min() < crossing < waves.max() and best.is_regular):
        return None
    laws = [
        PowerLaw(float(hurst), float(hurst - error), float(hurst + error), float(count.sum()), best.deviance)
        for hurst, error in zip((rough, smooth), best.half_widths[:2], strict=True)
    ]
    crossover = float(2.0 * np.pi / np.exp(crossing))
    return TwoExponents(laws[0], laws[1], crossover, best.deviance + 2.0 * 4, is_sharp)


def penalised_deviance(record: Sequence[Octave], run: Run, inside: Array) -> float:
    """Return the deviance of one exponent in a run and another in every other octave, with its penalty.

    Akaike's penalty of two parameters, exponent and amplitude, for the run and for every other octave.
    """
    blocks = record[0].blocks
    parts = [np.logical_or.reduce([octave.inside for octave in record[run.first : run.last]])]
    parts += [octave.inside for k, octave in enumerate(record) if not run.first <= k < run.last]
    fits = [fit_power_law(blocks, part & inside) for part in parts if np.any(part & inside)]
    return sum(fit.deviance + 4.0 for fit in fits)
