"""Fit of an exponent to the modes of an octave of wavelength, or of a run of octaves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fractalcontact.dimensions import _blur_fit, _cosine_modes, _mode_blocks
from fractalcontact.dimensions._blur_fit import CORRELATION
from fractalcontact.dimensions._mode_blocks import HIGHEST, LOWEST, Frame, node_weights
from fractalcontact.dimensions._records import NORMAL, Estimate
from fractalcontact.dimensions._restored_power import restored_power
from fractalcontact.dimensions._surface_input import Scales, Surface, between
from fractalcontact.dimensions._transfer_functions import BEFORE, FILTER, TRANSFER, Window

Array = np.ndarray[Any, np.dtype[Any]]

_LEAST = 12  # modes of an octave
_FIRST_GUESS = 0.5  # exponent of the modes beside gaps
_STEPS, _LONGEST_STEP = 60, 0.5
_LEAST_HURST = 0.02  # white noise has an exponent of 0 at the shortest waves, where it is aliased
_FALSE_ALARM = 0.003  # probability that a run of one exponent is rejected
_WITHOUT_ALIASES = 10.0  # decrease of the deviance from which a surface has no aliases
_BLURS = (BEFORE, 0.05), (TRANSFER, 0.1), (FILTER, 0.15)  # forms of a blur, and where their fits start
_RUN_WINDOW = "the longest run of octaves of wavelength that one exponent fits"


@dataclass(frozen=True)
class Blocks:
    """Mean squares of blocks of modes, and their expected power.

    Attributes
    ----------
    power, count, wavelength : ndarray, shape (blocks,)
        The wavelength is in spacings of x.
    frame : Frame, optional
        Table of the expected power with free edges; None for a periodic surface, whose power law is exact.
    axes : int
    """

    power: Array
    count: Array
    wavelength: Array
    frame: Frame | None
    axes: int

    def logs(self, hurst: float) -> tuple[Array, Array]:
        """Return the logarithm of the expected power, and its derivative by H.

        Beyond the table the slope of the logarithm at its end is that of a power law.
        """
        slope = 2.0 * np.log(self.wavelength)
        if self.frame is None:
            return (0.5 * self.axes + hurst) * slope, slope
        inside = float(np.clip(hurst, LOWEST, HIGHEST))
        weights, slopes = node_weights(inside)
        logs = weights @ self.frame.logs
        if inside != hurst:
            return logs + (hurst - inside) * slope, slope
        return logs, slopes @ self.frame.logs


@dataclass(frozen=True)
class PowerLaw:
    """Exponent of some blocks with its interval; the deviance is that at the best amplitude."""

    hurst: float
    low: float
    high: float
    modes: float
    deviance: float


@dataclass(frozen=True)
class Octave:
    """Blocks of one octave: wavelengths in spacings, a mask of the blocks, and their fit."""

    low: float
    high: float
    inside: Array
    fit: PowerLaw
    blocks: Blocks


@dataclass(frozen=True)
class Run:
    """Successive octaves `first` to `last` - 1 that one exponent fits; wavelengths in spacings."""

    first: int
    last: int
    low: float
    high: float
    fit: PowerLaw


def blocks_of(surface: Surface) -> Blocks:
    """Return the blocks of a surface or a complete profile; a periodic surface with gaps counts as free."""
    if all(surface.grid.periodic) and surface.is_complete:
        power, count, wavelength = _periodic(surface)
        return Blocks(power, count, wavelength, None, surface.axes)
    if surface.axes == 1:
        return free_blocks(surface.heights[0], (1.0,))
    return free_blocks(surface.heights, surface.plane_spacing)


def free_blocks(heights: Array, spacing: tuple[float, ...]) -> Blocks:
    """Return the blocks of heights with free edges, (ny, nx), or (n,) without gaps."""
    frame = _mode_blocks.frame(heights.shape, spacing)
    if np.isnan(heights).any():
        lattice = _cosine_modes.Lattice.of((heights.shape[0], heights.shape[1]), (spacing[0], spacing[1]))
        power, share = restored_power(heights, lattice, _FIRST_GUESS)
        frame = frame.weakened(share)
        return frame_blocks(frame.mean(power), frame)
    power = (
        _cosine_modes.mode_power(heights) if heights.ndim == 2 else _mode_blocks.profile_modes(heights) ** 2
    )
    return frame_blocks(frame.mean(power), frame)


def frame_blocks(means: Array, frame: Frame) -> Blocks:
    """Return the blocks of a frame with the mean squares of their modes."""
    return Blocks(means, frame.count, 2.0 * np.pi / np.sqrt(frame.squares), frame, frame.axes)


def with_or_without_aliases(blocks: Blocks) -> Blocks:
    """Return blocks without aliases where the two shortest octaves have one exponent only then.

    So it is in crops of periodic surfaces, which have no waves beyond the sampling. A blur with aliases must
    not explain those octaves better.
    """
    if blocks.frame is None:
        return blocks
    unaliased = frame_blocks(blocks.power, blocks.frame.unaliased)
    shortest = octaves(unaliased)[:2]
    if len(shortest) < 2:
        return blocks
    inside = shortest[0].inside | shortest[1].inside
    fit = fit_power_law(unaliased, inside)
    if fit.deviance > fit_power_law(blocks, inside).deviance - _WITHOUT_ALIASES or fit.hurst < _LEAST_HURST:
        return blocks
    window = Window(blocks.frame, inside, blocks.power)
    blurred = min(
        _blur_fit.fit(window, _blur_fit.Fit(form, 0.5, square)).penalised for form, square in _BLURS
    )
    is_likelier = fit.deviance + 2.0 < blurred  # one parameter beside the amplitude
    return unaliased if is_likelier and has_one_exponent(shortest, fit) else blocks


def window_of(blocks: Blocks, inside: Array) -> Run | None:
    """Return the exponent of some blocks, of one or several octaves; None if no one fits them."""
    run, fit = _octaves_within(blocks, inside), fit_power_law(blocks, inside)
    if not run or not has_one_exponent(run, fit):
        return None
    wavelength = blocks.wavelength[inside]
    return Run(0, len(run), float(wavelength.min()), float(wavelength.max()), fit)


def exponents_within(surface: Surface, scales: Scales) -> tuple[float, float]:
    """Return the range of the exponents of short and long waves of a window; (inf, -inf) if it has one.

    They change at an edge of an octave.
    """
    from scipy.special import chdtrc

    blocks = with_or_without_aliases(blocks_of(surface))
    inside = between(blocks.wavelength * surface.spacing[1], scales)
    edges = [octave.high for octave in _octaves_within(blocks, inside)[:-1]]
    if not edges:
        return np.inf, -np.inf
    splits = [
        [
            fit_power_law(blocks, inside & part)
            for part in (blocks.wavelength < edge, blocks.wavelength >= edge)
        ]
        for edge in edges
    ]
    best = min(splits, key=lambda pair: pair[0].deviance + pair[1].deviance)
    gain = fit_power_law(blocks, inside).deviance - sum(fit.deviance for fit in best)
    if len(splits) * chdtrc(2, max(gain / CORRELATION, 0.0)) > _FALSE_ALARM:
        return np.inf, -np.inf
    return min(fit.low for fit in best), max(fit.high for fit in best)


def _octaves_within(blocks: Blocks, inside: Array) -> list[Octave]:
    """Return the parts of the octaves in a window that have enough modes, each fitted alone."""
    parts = [replace(octave, inside=octave.inside & inside) for octave in octaves(blocks)]
    parts = [part for part in parts if blocks.count[part.inside].sum() >= _LEAST]
    return [replace(part, fit=fit_power_law(blocks, part.inside)) for part in parts]


def _periodic(surface: Surface) -> tuple[Array, Array, Array]:
    """Return the mean power, the number of modes and the wavelength of every ring of a periodic surface."""
    from fractalcontact.dimensions._periodic_modes import PeriodicModes

    heights = surface.heights if surface.axes == 2 else surface.heights[0]
    modes = PeriodicModes.of(heights, surface.relative_spacing)
    ring = np.unique(np.rint(32.0 * np.log2(modes.wavenumber)), return_inverse=True)[1]
    count = np.bincount(ring, modes.weights)
    mean = np.bincount(ring, modes.weights * modes.power) / count
    radius = np.exp(np.bincount(ring, modes.weights * np.log(modes.wavenumber)) / count)
    unit = max(surface.grid.extent) / surface.spacing[1]
    return mean, count, unit / radius


def octaves(blocks: Blocks) -> list[Octave]:
    """Fit every octave of wavelength, the shortest first; the longest holds all waves that are left."""
    shortest = 2.0
    result: list[Octave] = []
    low = 0.0  # waves along a diagonal are shorter than two spacings
    while blocks.count[blocks.wavelength >= low * (1 - 1e-9)].sum() >= _LEAST:
        high = 2.0 * max(low, shortest)
        if blocks.count[blocks.wavelength >= high * (1 - 1e-9)].sum() < _LEAST:
            high = float(blocks.wavelength.max()) * (1 + 1e-6)
        inside = (blocks.wavelength >= low * (1 - 1e-9)) & (blocks.wavelength < high * (1 - 1e-9))
        if blocks.count[inside].sum() >= _LEAST:
            bottom = float(blocks.wavelength[inside].min()) if low == 0.0 else low
            result.append(Octave(bottom, high, inside, fit_power_law(blocks, inside), blocks))
        low = high
    return result


def fit_power_law(blocks: Blocks, inside: Array) -> PowerLaw:
    """Fit exponent and amplitude to some blocks by scoring."""
    part = Blocks(blocks.power[inside], blocks.count[inside], blocks.wavelength[inside], None, blocks.axes)
    hurst, error, modes = 0.5, np.nan, float(part.count.sum())
    for _ in range(_STEPS):
        logs, slope = (values[inside] for values in blocks.logs(hurst))
        ratio = np.log(np.maximum(part.power, 1e-300)) - logs
        ratio = np.exp(ratio - ratio.max())
        mean = float(np.sum(part.count * ratio) / modes)
        slope = slope - np.average(slope, weights=part.count)
        information = 0.5 * float(np.sum(part.count * slope * slope))
        if not information > 0.0:
            break
        step = 0.5 * float(np.sum(part.count * slope * (ratio / mean - 1.0))) / information
        error = float(np.sqrt(CORRELATION / information))
        hurst += float(np.clip(step, -_LONGEST_STEP, _LONGEST_STEP))
        if abs(step) < 1e-6:
            break
    logs = blocks.logs(hurst)[0][inside]
    top = np.log(np.maximum(part.power, 1e-300)) - logs
    level = float(top.max() + np.log(np.sum(part.count * np.exp(top - top.max())) / modes))
    deviance = float(np.sum(part.count * logs) + modes * level)
    return PowerLaw(hurst, hurst - NORMAL * error, hurst + NORMAL * error, modes, deviance)


def longest_run(record: Sequence[Octave]) -> Run:
    """Return the longest run of octaves that one exponent of a fractal fits; of equal ones the surest."""
    best, width = None, 0
    for first in range(len(record)):
        for last in range(first + 1, len(record) + 1):
            run = record[first:last]
            if len(run) < max(width, min(2, len(record))):
                continue
            fit = _joint_fit(run)
            is_fractal = fit.hurst > _LEAST_HURST and fit.low < 1.0
            if not is_fractal or not has_one_exponent(run, fit):
                continue
            if best is None or len(run) > width or fit.modes > best.fit.modes:
                best, width = Run(first, last, run[0].low, run[-1].high, fit), len(run)
    if best is None:
        return Run(0, 0, np.nan, np.nan, PowerLaw(np.nan, np.nan, np.nan, 0.0, np.nan))
    return best


def has_one_exponent(run: Sequence[Octave], fit: PowerLaw) -> bool:
    """Return whether the joint fit of some octaves is not rejected against their own exponents."""
    from scipy.special import chdtrc

    ratio = (fit.deviance - sum(octave.fit.deviance for octave in run)) / CORRELATION
    return len(run) == 1 or bool(chdtrc(2 * (len(run) - 1), max(ratio, 0.0)) > _FALSE_ALARM)


def is_smooth(record: Sequence[Octave]) -> bool:
    """Return whether the shortest waves are weaker than those of any fractal."""
    return record[0].fit.low > 1.0


def interval_of_run(run: Run, record: Sequence[Octave]) -> tuple[float, float]:
    """Return the interval of a run; beside other octaves it holds that of the run without its octave there.

    A blur ends gradually: the octave next to it is bent by less than chance, and has the most modes.
    """
    low, high = run.fit.low, run.fit.high
    shorter = record[run.first + 1 : run.last] if run.first > 0 else []
    longer = record[run.first : run.last - 1] if run.last < len(record) else []
    for part in (shorter, longer):
        if part:
            fit = _joint_fit(part)
            low, high = min(low, fit.low), max(high, fit.high)
    return low, high


def _joint_fit(run: Sequence[Octave]) -> PowerLaw:
    """Fit one exponent to successive octaves."""
    return fit_power_law(run[0].blocks, np.logical_or.reduce([octave.inside for octave in run]))


def run_estimate(run: Run, surface: Surface) -> Estimate:
    """Return the estimate of the window of scales that has one exponent."""
    dx = surface.spacing[1]
    low, high = run.low * dx, run.high * dx
    return Estimate(
        run.fit.hurst,
        0.5 * (run.fit.high - run.fit.low) / NORMAL,
        run.fit.low,
        run.fit.high,
        scale_min=low,
        scale_max=high,
        window=_RUN_WINDOW,
        note=f"no single exponent holds at all scales: {run.fit.hurst:.2f} is that of waves from {low:.3g} "
        f"to {high:.3g} m, the longest run of octaves that one exponent fits (see `scaling`)",
    )
