"""Fit of one model of blur and noise to the modes of a window, and the interval of its exponent."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fractalcontact.dimensions._mode_blocks import HIGHEST, LOWEST
from fractalcontact.dimensions._transfer_functions import FILTER, NONE, TRANSFER, Window
from fractalcontact.dimensions._whittle import inverse, misfit

Array = np.ndarray[Any, np.dtype[Any]]

# rise of the deviance at the lower and upper end of an interval where blur and noise may be 0, their bound
_BELOW, _ABOVE = 3.5, 3.7
_PENALTY = 2.0  # Akaike: deviance that a parameter must bring
CORRELATION = 1.05  # of the squared standard error, for the modes are slightly correlated
MORE_CORRELATION = 1.4  # the same where the jump of the slope at the edges matters
NARROW = 0.03  # squared spread below which the jump does not matter
# deviance of blur, of weak noise, and of stronger noise in the interval where neither is seen
_COST, _NOISE_COST, _STRONG_NOISE_COST = 5.0, 1.0, 4.0
_LEAST_HURST = 0.02  # from which on there is more than noise
_LARGEST = 200.0  # squared spread
_FILTERED = 0.15  # least squared spread to start a filter from: it is flat at 0, where points have no weight
_ROUNDS = 6  # of a fit with noise of a known variance
_SHOWN = 4.0  # decrease of the penalised deviance from which there is more than rounding
_ENDS = 6  # steps to an end of an interval
_NO_NOISE = 1e-4  # share of every mode below which noise is as good as none
_STEPS, _TRIES, _DAMPING = 25, 8, 1e-3
_LEAST_OCTAVE = 12.0  # modes of an octave whose level is tested
_LEAST_LEVEL = 1e-4  # of the information of a level beside the fitted parameters


@dataclass(frozen=True)
class Fit:
    """Parameters of one model.

    Attributes
    ----------
    form : str
        A key of `FORMS`.
    hurst, square, noise : float
        H, squared spread, and noise over the amplitude.
    has_noise : bool
    most_noise : float
        Largest noise over the amplitude.
    known : float, optional
        Squared spread that is not fitted.
    parameters : int
        Number that are fitted.
    deviance, amplitude : float
    """

    form: str
    hurst: float
    square: float
    noise: float = 0.0
    has_noise: bool = False
    most_noise: float = np.inf
    known: float | None = None
    parameters: int = 0
    deviance: float = np.inf
    amplitude: float = np.nan

    @property
    def penalised(self) -> float:
        """Deviance with the penalty of the parameters."""
        return self.deviance + _PENALTY * self.parameters

    @property
    def correlation(self) -> float:
        """Factor on the squared standard error for the correlation of the modes."""
        return CORRELATION if self.square < NARROW else MORE_CORRELATION

    def with_noise(self, has_noise: bool, window: Window) -> Fit:
        """Return a start with noise or without."""
        if not has_noise:
            return replace(self, noise=0.0, has_noise=False)
        least = 1e-3 * float(window.signal(self.form, self.hurst, self.square)[0].min())
        noise = min(max(self.noise, least, 1e-280), self.most_noise)
        return replace(self, noise=noise, has_noise=True)


def fit(window: Window, start: Fit, form: str = "", hurst: float | None = None) -> Fit:
    """Fit one model from a start by damped scoring steps; at a given exponent, if there is one."""
    form = form or start.form
    square = 0.0 if form == NONE else start.square if start.known is None else start.known
    if form == FILTER != start.form and start.known is None:
        square = max(square, _FILTERED)
    values = np.array([start.hurst if hurst is None else hurst, square, start.noise])
    free = np.array([hurst is None, form != NONE and start.known is None, start.has_noise])
    low, high = np.array([LOWEST, 0.0, 0.0]), np.array([HIGHEST, _LARGEST, start.most_noise])
    deviance, amplitude, columns, residual = _evaluate(window, form, values)
    damping = _DAMPING
    for _ in range(_STEPS):
        half = 0.5 * window.count * columns
        score = half @ residual
        is_held = ((values <= low) & (score < 0.0)) | ((values >= high) & (score > 0.0))
        is_held[2] |= score[2] < 0.0 and columns[2].max() < _NO_NOISE
        moving = np.flatnonzero(free & ~is_held)
        if not moving.size:
            break
        means = 2.0 * half.sum(axis=1) / window.number
        information = (half @ columns.T - 0.5 * window.number * np.outer(means, means))[
            np.ix_(moving, moving)
        ]
        diagonal = np.diag(np.maximum(np.diag(information), 1e-280))
        for _ in range(_TRIES):
            step = np.zeros(3)
            step[moving] = np.linalg.solve(information + damping * diagonal, score[moving])
            trial = np.where(free, np.clip(_moved(values, step), low, high), values)
            moved = _evaluate(window, form, trial)
            if moved[0] <= deviance + 1e-9:
                break
            damping *= 6.0
        else:
            break
        gain = deviance - moved[0]
        values, (deviance, amplitude, columns, residual) = trial, moved
        damping = max(damping / 10.0, 1e-7)
        if gain < 1e-3:
            break
    return replace(
        start,
        form=form,
        hurst=float(values[0]),
        square=float(values[1]),
        noise=float(values[2]),
        parameters=int(np.count_nonzero(free)),
        deviance=deviance,
        amplitude=amplitude,
    )


def fit_known_noise(window: Window, start: float, variance: float) -> Fit:
    """Fit a surface with white noise of a known variance, and without blur."""
    result = fit(window, Fit(NONE, start, 0.0))
    for _ in range(_ROUNDS):
        result = fit(window, replace(result, noise=variance / result.amplitude))
    return result


def shows_blur(window: Window, plain: Fit) -> bool:
    """Return whether a blur, or other noise than is known, makes the modes likelier than a fit without."""
    blurs = [fit(window, replace(plain, form=form, square=0.15)) for form in (TRANSFER, FILTER)]
    noisy = fit(window, plain.with_noise(True, window))
    return min(each.penalised for each in (*blurs, noisy)) < plain.penalised - _SHOWN


def _moved(values: Array, step: Array) -> Array:
    """Take a step of limited length; that of the noise is in its logarithm."""
    hurst, square, noise = values
    return np.array(
        [
            hurst + np.clip(step[0], -0.3, 0.3),
            square + np.clip(step[1], -max(0.5 * square, 0.05), max(square, 0.1)),
            noise * np.exp(np.clip(step[2], -2.0, 2.0)),
        ]
    )


def _evaluate(window: Window, form: str, values: Array) -> tuple[float, float, Array, Array]:
    """Return the deviance, the amplitude, the columns of the parameters, and the relative residuals.

    The columns (3, blocks) are derivatives of the logarithm of the power by H, the squared spread, and the
    logarithm of the noise.
    """
    hurst, square, noise = values
    signal, by_hurst, by_square = window.signal(form, hurst, square)
    total = signal + noise
    ratio, share = window.power / total, signal / total
    amplitude = float(window.count @ ratio) / window.number
    deviance = float(window.count @ np.log(total)) + window.number * float(np.log(amplitude))
    return (
        deviance,
        amplitude,
        np.stack([by_hurst * share, by_square * share, noise / total]),
        ratio / amplitude - 1.0,
    )


def residuals(window: Window, result: Fit) -> tuple[Array, Array]:
    """Return the columns of the parameters (3, blocks), and the relative residuals of the blocks."""
    values = np.array([result.hurst, result.square, result.noise])
    return _evaluate(window, result.form, values)[2:]


def spread_in_blocks(window: Window, result: Fit) -> Array:
    """Return the variance of the logarithm of the expected power within each block."""
    signal = window.signal(result.form, result.hurst, result.square)[0]
    share = signal / (signal + result.noise)
    fall = (2.0 * result.hurst + window.frame.axes) / window.squares + 2.0 * result.square
    return np.asarray(share**2 * fall**2 * window.frame.variances[1][window.inside])


def scatter(window: Window, result: Fit) -> float:
    """Return z of the squared residuals of the blocks about a fit."""
    return scatter_of(residuals(window, result)[1], window.count)


def scatter_of(residual: Array, count: Array) -> float:
    """Return z of the squared relative residuals of blocks of so many modes."""
    square = 0.5 * count * residual**2
    deviation = np.sqrt((2.0 + 12.0 * np.mean(1.0 / count)) / square.size)
    return float((square.mean() - 1.0) / deviation)


def agreement(window: Window, result: Fit) -> float:
    """Return the probability that octaves of wavenumber differ by chance from a fit as much as they do.

    Score test of a level of each octave beside the fitted parameters: it sees a slow change of the exponent
    that the scatter of single blocks hides.
    """
    from scipy.special import chdtrc

    columns, residual = residuals(window, result)
    fitted = np.stack([np.ones(residual.size), *columns[_is_free(result)]])
    octave = np.floor(0.5 * np.log2(window.squares / window.squares.min())).astype(int)
    modes = np.bincount(octave, window.count)
    first = int(np.argmax(np.cumsum(modes) >= _LEAST_OCTAVE))
    last = modes.size - 1 - int(np.argmax(np.cumsum(modes[::-1]) >= _LEAST_OCTAVE))
    octave = np.clip(octave, first, max(first, last))
    levels = (octave == np.unique(octave)[:, None]).astype(float)
    statistic, number = score_statistic(fitted, levels, 0.5 * window.count, residual)
    return float(chdtrc(number, statistic / result.correlation))


def score_statistic(
    fitted: Array, others: Array, half: Array, residual: Array, prior: Array | None = None
) -> tuple[float, int]:
    """Return chi square of a score test of other columns beside those that are fitted, and its number.

    `half` is half the number of modes of each block, `prior` what is known beforehand of the fitted
    parameters.
    """
    information = (half * fitted) @ fitted.T
    if prior is not None:
        information = information + prior
    others = others - (half * others) @ fitted.T @ inverse(information) @ fitted
    values, vectors = np.linalg.eigh((half * others) @ others.T)
    seen = values > _LEAST_LEVEL * values.max()
    score = vectors[:, seen].T @ (others @ (half * residual))
    return float(np.sum(score**2 / values[seen])), int(np.count_nonzero(seen))


def other_form(window: Window, result: Fit) -> float:
    """Return chi square, of three parameters, of a transfer function of another form than that of a fit.

    Score test of terms of the fourth and sixth degree in the wavenumber of its logarithm.
    """
    columns, residual = residuals(window, result)
    fitted = np.stack([np.ones(residual.size), *columns[_is_free(result)]])
    squares = window.squares / window.squares.max()
    across = np.prod([w[window.inside] for w in window.frame.waves], axis=0) ** 2 / window.squares.max() ** 2
    terms = np.stack([squares**2, across, squares**3])
    statistic, _ = score_statistic(fitted, terms, 0.5 * window.count, residual)
    return statistic / result.correlation


def _is_free(result: Fit) -> Array:
    """Return whether H, the spread and the noise of a model are fitted."""
    return np.array([True, result.form != NONE and result.known is None, result.has_noise])


def error(window: Window, result: Fit) -> float:
    """Return the standard error of H."""
    columns = residuals(window, result)[0][_is_free(result)]
    columns = columns - np.average(columns, axis=1, weights=window.count)[:, None]
    information = 0.5 * (window.count * columns) @ columns.T
    return float(np.sqrt(result.correlation * inverse(information)[0, 0]))


def interval(window: Window, result: Fit, rise: float, above: float | None = None) -> tuple[float, float]:
    """Return where the deviance at the best other parameters has risen by `rise`; above by `above`."""
    step = max(0.5 * error(window, result), 1e-5)
    return _end(window, result, rise, -step), _end(window, result, rise if above is None else above, step)


def _end(window: Window, best: Fit, rise: float, step: float) -> float:
    limit = LOWEST if step < 0.0 else HIGHEST
    inside, below = best, 0.0
    while True:
        hurst = inside.hurst + step
        if (hurst - limit) * step >= 0.0:
            hurst = limit
        outside = fit(window, inside, hurst=hurst)
        above = outside.deviance - best.deviance
        if above >= rise:
            break
        if hurst == limit:
            return limit
        inside, below, step = outside, max(above, 0.0), 1.5 * step
    left, right, start = inside.hurst, outside.hurst, inside
    hurst = right
    for _ in range(_ENDS):  # the root of the deviance is nearly straight
        if not above > below:
            break
        share = (np.sqrt(rise) - np.sqrt(below)) / (np.sqrt(above) - np.sqrt(below))
        hurst = left + share * (right - left)
        trial = fit(window, start, hurst=hurst)
        value = trial.deviance - best.deviance
        if abs(value - rise) < 0.01 * rise:
            break
        if value < rise:
            left, below, start = hurst, max(value, 0.0), trial
        else:
            right, above = hurst, value
    return float(hurst)


@dataclass(frozen=True)
class Comparison:
    """A surface that is fitted without blur and noise, compared with one that has both.

    Attributes
    ----------
    plain : Fit
        The surface without blur.
    gain : float
        Decrease of the deviance by blur and noise, less the penalty.
    misfit : float
        z of a change of the exponent with scale.
    window : Window
    best : Fit
        The best with blur or noise.
    """

    plain: Fit
    gain: float
    misfit: float
    window: Window
    best: Fit

    def interval(self, largest: float, *, blur: bool = True) -> tuple[float, float]:
        """Return the exponents that agree with the modes for some blur, and noise up to `largest`.

        `largest` is the rms noise over the rms increment. The limits are those of the deviance at the best
        blur and noise for each exponent (profile likelihood), so that neither is taken as absent because it
        is not seen. Noise beyond `largest` without blur costs so much that it counts where it makes the modes
        likelier: unlimited, it would double the interval of an exact surface.
        """
        plain = self.plain
        most = np.inf
        if not plain.has_noise and plain.hurst < 1.0:
            most = 2.0 * largest**2 / (1.0 - plain.hurst)

        def cost(model: Fit) -> float:
            """Return the deviance with a cost: an exact surface keeps nearly its own interval."""
            noise = _NOISE_COST if model.most_noise == most else _STRONG_NOISE_COST
            return model.deviance + _COST * (model.form != NONE) + noise * model.has_noise

        forms = ((NONE, 0.0), (TRANSFER, 0.0), (TRANSFER, 0.1), (FILTER, 0.15))[: 4 if blur else 1]
        starts = [replace(plain, form=form, square=square, most_noise=most) for form, square in forms]
        # noise alone has an exponent of 0, and would hold every other
        starts += [plain] if np.isfinite(most) and plain.hurst > _LEAST_HURST else []
        fits = [plain, *(fit(self.window, start.with_noise(True, self.window)) for start in starts)]
        least, low, high = min(map(cost, fits)), plain.hurst, plain.hurst
        # of the two starts of one form the better
        better = {(each.form, each.has_noise, each.most_noise): each for each in sorted(fits, key=cost)[::-1]}
        for best in better.values():
            below, above = (end * best.correlation + least - cost(best) for end in (_BELOW, _ABOVE))
            if below > 0.0:
                ends = interval(self.window, best, below, above)
                low, high = min(low, ends[0]), max(high, ends[1])
        return (low if low > LOWEST else 0.0), high


def compare(window: Window, start: float, *, noise: bool) -> Comparison:
    """Compare a surface without blur, and without noise unless it is asked for, with one that has both."""
    plain = fit(window, Fit(NONE, start, 0.0).with_noise(noise, window))
    forms = (NONE, 0.0), (TRANSFER, 0.1), (TRANSFER, 1.0), (FILTER, 0.15)
    others = [replace(plain, form=form, square=square) for form, square in forms]
    fits = [fit(window, other.with_noise(True, window)) for other in others]
    if not noise:
        fits += [fit(window, others[1]), fit(window, others[3])]
    columns, residual = residuals(window, plain)
    slopes = np.stack([np.ones(residual.size), columns[0]])
    best = min(fits, key=lambda each: each.penalised)
    bend = misfit(slopes, residual, 0.5 * window.count)
    return Comparison(plain, plain.penalised - best.penalised, bend, window, best)
