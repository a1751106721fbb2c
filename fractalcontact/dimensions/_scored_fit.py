"""Parameters of an expected power fitted to the mean squares of blocks of modes, by damped scoring."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.dimensions._blur_fit import CORRELATION
from fractalcontact.dimensions._records import NORMAL

Array = np.ndarray[Any, np.dtype[Any]]

_STARTS = 2  # likeliest first guesses from which parameters are fitted
_SCORING_STEPS = 40  # of a fit of two or three parameters
_FLAT = 1.2  # times their standard errors: the likelihood is flatter than a parabola


@dataclass(frozen=True)
class Scored:
    """Parameters of an expected power that were fitted by scoring.

    Attributes
    ----------
    deviance : float
    values : ndarray, shape (parameters,)
    information : ndarray, shape (parameters, parameters)
    """

    deviance: float
    values: Array
    information: Array

    @property
    def is_regular(self) -> bool:
        """Whether the blocks determine all parameters."""
        return bool(np.linalg.cond(self.information) < 1e12)

    @property
    def half_widths(self) -> Array:
        """Half the widths of the 95 % intervals."""
        return _FLAT * NORMAL * np.sqrt(CORRELATION * np.diag(np.linalg.inv(self.information)))


def best_scored(
    model: Callable[[Array], tuple[Array, Array]],
    power: Array,
    count: Array,
    starts: Sequence[Array],
    bounds: tuple[Array, Array],
    largest_step: Array,
    most: float = np.inf,
    precision: Array | float = 0.0,
) -> Scored:
    """Fit the parameters of a model to blocks by damped scoring from the two best starts.

    `model` returns the logarithm of the expected power but for its level, and the derivatives.
    Beyond the deviance `most` the second start is not tried. `precision` is one over the squared deviation
    of each parameter from 0 that is known beforehand; 0 where nothing is known.
    """
    logs, modes = np.log(np.maximum(power, 1e-300)), float(count.sum())

    def evaluate(values: Array) -> tuple[float, Array, Array]:
        """Return the deviance, the derivatives less their means, and the relative residuals."""
        expected, columns = model(values)
        ratio = np.exp(logs - expected)
        level = float(np.sum(count * ratio) / modes)
        columns -= np.average(columns, axis=1, weights=count)[:, None]
        deviance = float(np.sum(count * expected) + modes * np.log(level) + np.sum(precision * values**2))
        return deviance, columns, ratio / level - 1.0

    first, *others = sorted(starts, key=lambda start: evaluate(start)[0])[:_STARTS]
    best = _scored(evaluate, count, first, bounds, largest_step, precision)
    for start in others if best.deviance < most else []:
        other = _scored(evaluate, count, start, bounds, largest_step, precision)
        best = min(best, other, key=lambda fit: fit.deviance)
    return best


def _scored(
    evaluate: Callable[[Array], tuple[float, Array, Array]],
    count: Array,
    values: Array,
    bounds: tuple[Array, Array],
    largest_step: Array,
    precision: Array | float,
) -> Scored:
    damping, prior = 1e-2, np.diag(np.broadcast_to(precision, values.shape))
    current = evaluate(values)
    for _ in range(_SCORING_STEPS):
        deviance, columns, residual = current
        information = 0.5 * (count * columns) @ columns.T + prior
        score = 0.5 * (count * columns) @ residual - prior @ values
        ridge = np.diag(damping * np.diag(information) + 1e-12)
        step = np.linalg.solve(information + ridge, score)
        moved = np.clip(values + np.clip(step, -largest_step, largest_step), *bounds)
        trial = evaluate(moved)
        if trial[0] > deviance + 1e-9:
            damping *= 6.0
            if damping > 1e6:
                break
            continue
        values, current, damping = moved, trial, max(damping / 10.0, 1e-7)
        if deviance - trial[0] < 1e-3:
            break
    return Scored(current[0], values, 0.5 * (count * current[1]) @ current[1].T + prior)
