"""Maximum likelihood estimate of a surface whose heights are coarsely rounded."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fractalcontact.dimensions._blur import LEAST_AGREEMENT, POOR
from fractalcontact.dimensions._blur_fit import (
    MORE_CORRELATION,
    agreement,
    error,
    fit_known_noise,
    interval,
    scatter,
    shows_blur,
)
from fractalcontact.dimensions._free_edges import FREE_WINDOW, FreeEdges
from fractalcontact.dimensions._heterogeneity import Heterogeneity
from fractalcontact.dimensions._mode_blocks import LOWEST
from fractalcontact.dimensions._quantisation import quantisation, resolved_lag, rounding_note
from fractalcontact.dimensions._records import Estimate, joined
from fractalcontact.dimensions._transfer_functions import Window
from fractalcontact.dimensions._whittle import QUANTILE

_MATTERS = 0.005  # standard error of an exponent that rounding changes where it matters
_LEAST_ROUNDED = 60  # modes of coarsely rounded heights
_ROUNDED_WINDOW = "waves over whose quarter the heights differ by half a step of their rounding or more"


def rounded_estimate(
    free: FreeEdges, compared_parts: Callable[[float, int], Heterogeneity]
) -> Estimate | None:
    """Return the estimate of coarsely rounded heights; None where rounding matters little, or more is seen.

    Errors of rounding are white noise of a known variance while heights differ by half a step or more. Where
    neighbours differ less, only waves over whose quarter they do so are used.
    """
    if not free.is_default or free.power is None or not rounding_note(free.heights, _MATTERS):
        return None
    step = quantisation(free.heights)[0]
    lag, noise = resolved_lag(free.heights, step), step**2 / 12.0
    frame = free.frame
    inside = 2.0 * np.pi / np.sqrt(frame.squares) >= (4.0 * lag if lag > 1 else 0.0)
    if not lag or frame.count[inside].sum() < _LEAST_ROUNDED:
        return None
    window = Window(frame, inside, frame.mean(free.power))
    fit = fit_known_noise(window, free.pilot, noise)
    is_good = LOWEST < fit.hurst < 1.0 and scatter(window, fit) < POOR
    is_other = agreement(window, fit) < LEAST_AGREEMENT or shows_blur(window, fit)
    if not is_good or (lag == 1 and is_other):
        return None
    low, high = interval(window, fit, QUANTILE * MORE_CORRELATION)
    waves = 2.0 * np.pi / np.sqrt(window.squares) * free.surface.spacing[1]
    parts = compared_parts(fit.hurst, 4 * lag)
    low, high = parts.widened(fit.hurst, low, high)
    note = (
        f"heights are rounded to steps of {step * free.surface.unit:.3g} m: white noise of a twelfth of "
        "their square is in the model"
    )
    return Estimate(
        fit.hurst,
        error(window, fit) * parts.widening,
        low if low > LOWEST else 0.0,
        high,
        scale_min=float(waves.min()),
        scale_max=float(waves.max()),
        rms_increment=float(np.sqrt(2.0 * fit.amplitude / (1.0 - fit.hurst))) * free.surface.unit,
        noise_height=step / np.sqrt(12.0) * free.surface.unit,
        window=FREE_WINDOW if lag == 1 else _ROUNDED_WINDOW,
        note=joined(note, parts.note),
    )
