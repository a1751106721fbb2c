"""A spectrum that bends slowly into a plateau of long waves, as (q^2 + q_0^2)^(-1 - H) (K-correlation).

It is that of the Matern covariance. No octave has the exponent of the short waves, but all waves together
have it. Palasantzas (1993), Phys. Rev. B 48, 14472.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.dimensions._exponent_by_scale import Blocks, PowerLaw, best_scored
from fractalcontact.dimensions._mode_blocks import (
    HIGHEST,
    LARGEST,
    LOWEST,
    Frame,
    lattice_power,
    node_weights,
)
from fractalcontact.dimensions._records import NORMAL, Estimate
from fractalcontact.dimensions._surface_input import Surface
from fractalcontact.dimensions._transfer_functions import NONE, Window

Array = np.ndarray[Any, np.dtype[Any]]

_LEAST_LENGTH = 2.5  # spacings: a shorter corner leaves no waves beyond it
_STARTS = 0.3, 0.8  # first guesses of H
_LARGEST_SQUARE = 200.0  # spread of a blur
_FAR = 60.0  # deviance that the edges do not change
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
    is_sharp : bool
        Whether the spectrum is flat up to the corner, instead of bending slowly.
    """

    law: PowerLaw
    length: float
    penalised: float
    spread: float = 0.0
    noise: bool = False
    is_sharp: bool = False


def fit_rolloff(
    blocks: Blocks,
    inside: Array,
    *,
    blur: tuple[str, float] = (NONE, 0.0),
    noise: bool = False,
    starts: Sequence[float] = _STARTS,
    is_sharp: bool = False,
    most: float = np.inf,
) -> RollOff | None:
    """Fit exponent and corner to some blocks; None where the corner is not among their waves.

    None as well where the penalised deviance is far above `most`. With `is_sharp` the spectrum is flat up to
    the corner, instead of bending slowly.

    A blur of some form, with a first guess of its spread, and `noise` are fitted as well; `starts` are first
    guesses of H. A blur changes the power as that of fractional Brownian heights. The power over the spectral
    density, which is that of such heights at first, is in a second fit that of the covariance that the first
    one found: a plateau of long waves has less effect of the edges.
    """
    count, wavelength, frame = blocks.count[inside], blocks.wavelength[inside], blocks.frame
    if frame is None or not wavelength.max() > _LEAST_LENGTH:
        return None
    form, spread = blur
    free = np.array([True, True, form != NONE, noise])
    parameters = 1 + int(np.count_nonzero(free))
    window = Window(frame, inside, blocks.power)
    first, last = -np.log(wavelength.max()), -np.log(_LEAST_LENGTH)
    low, high = np.array([LOWEST, first, 0.0, -80.0]), np.array([HIGHEST, last, _LARGEST_SQUARE, 80.0])
    excess, edges = frame.logs - frame.densities, None

    def model(values: Array) -> tuple[Array, Array]:
        """Return the logarithm of the power, and its derivatives."""
        every = np.zeros(4)
        every[free] = values
        hurst, square = float(every[0]), float((2.0 * np.pi * np.exp(every[1])) ** 2)
        logs, slope, by_square = frame.rolled_densities(hurst, square, is_sharp=is_sharp)
        if edges is None:
            weights, slopes = node_weights(hurst)
            logs, slope = logs + weights @ excess, slope + slopes @ excess
        else:
            logs = logs + edges
        logs, columns = logs[inside], np.stack([slope, 2.0 * by_square, 0.0 * slope, 0.0 * slope])[:, inside]
        if form != NONE:
            blurred, blurred_slope, by_blur = window.signal(form, hurst, float(every[2]))
            plain, plain_slope, _ = window.signal(NONE, hurst, 0.0)
            logs = logs + np.log(blurred / plain)
            columns[0] += blurred_slope - plain_slope
            columns[2] = by_blur
        if noise:
            total = np.logaddexp(logs, every[3])
            columns *= np.exp(logs - total)
            columns[3] = np.exp(every[3] - total)
            logs = total
        return logs, columns[free]

    def start(hurst: float, place: float) -> Array:
        """Return first values, with noise below the weakest waves."""
        values = np.array([hurst, place * first + (1.0 - place) * last, spread**2, -80.0])
        values[3] = model(values[free])[0].min() - 2.0
        return np.asarray(values[free])

    guesses = [start(hurst, place) for hurst in starts for place in (0.3, 0.6, 0.8)]
    steps = np.array([0.2, 0.7, 0.5, 2.0])[free]
    for _ in range(2):
        bounds = low[free], high[free]
        best = best_scored(model, blocks.power[inside], count, guesses, bounds, steps, most + _HOPELESS)
        hurst, corner = (float(value) for value in best.values[:2])
        is_far = best.deviance + 2.0 * parameters > most + _FAR
        if is_far or not (first < corner < last and best.is_regular):
            return None
        edges, guesses = _edges(frame, hurst, float(np.exp(-corner))), [best.values]
        if edges is None or is_sharp:
            break
    error = float(best.half_widths[0])
    law = PowerLaw(hurst, hurst - error, hurst + error, float(count.sum()), best.deviance)
    spread = float(np.sqrt(best.values[2])) if form != NONE else 0.0
    return RollOff(law, float(np.exp(-corner)), best.deviance + 2.0 * parameters, spread, noise, is_sharp)


def _edges(frame: Frame, hurst: float, length: float) -> Array | None:
    """Return the logarithm of the expected power of a surface with a roll-off over its spectral density.

    Its covariance is that of a torus of twice the size. None for a profile, and for a large surface.
    """
    if frame.axes == 1 or min(frame.shape) > LARGEST:
        return None
    y, x = (np.pi * np.arange(n + 1) / (n * d) for n, d in zip(frame.shape, frame.spacing, strict=True))
    square = (2.0 * np.pi / length) ** 2
    logs = [replace(frame, waves=(np.full(x.size, line), x)).rolled_densities(hurst, square)[0] for line in y]
    covariance = fft.dct(np.exp(np.array(logs)), 1, (0, 1))[:-1, :-1] / (4.0 * np.prod(frame.shape))
    power = lattice_power(frame, covariance)
    return np.asarray(np.log(power) - frame.rolled_densities(hurst, square)[0])


def rolloff_estimate(rolloff: RollOff, blocks: Blocks, surface: Surface) -> Estimate:
    """Return the estimate of a surface with a roll-off."""
    law, dx = rolloff.law, surface.spacing[1]
    power = "-1 - H" if blocks.axes == 2 else "-1/2 - H"
    form = f"{'max(q^2, q_0^2)' if rolloff.is_sharp else '(q^2 + q_0^2)'}^({power})"
    return Estimate(
        law.hurst,
        0.5 * (law.high - law.low) / NORMAL,
        law.low,
        law.high,
        scale_min=float(blocks.wavelength.min()) * dx,
        scale_max=rolloff.length * dx,
        window=_WINDOW,
        note=f"a {'sudden' if rolloff.is_sharp else 'slow'} roll-off: the spectrum falls as {form} with a "
        f"corner at waves of {rolloff.length * dx:.3g} m{_beside(rolloff)}",
    )


def _beside(rolloff: RollOff) -> str:
    """Return what is fitted beside a roll-off."""
    parts = [f"a blur with a spread of {rolloff.spread:.2g} spacings"] if rolloff.spread > 0.0 else []
    parts += ["white noise"] if rolloff.noise else []
    return f", with {' and '.join(parts)}" if parts else ""
