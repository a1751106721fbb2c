"""Fit of one model of blur and noise: known parameters are found, with the interval of the curvature."""

import numpy as np
import pytest

from fractalcontact.dimensions import _blur_fit
from fractalcontact.dimensions._mode_blocks import frame
from fractalcontact.dimensions._transfer_functions import BEFORE, FILTER, NONE, TRANSFER, Window

FRAME = frame((96, 96), (1.0, 1.0))
EVERY = np.ones(FRAME.count.size, dtype=bool)


def window(form, hurst, square, noise):
    """Modes of exactly their expected power."""
    power = Window(FRAME, EVERY, FRAME.count).signal(form, hurst, square)[0] + noise
    return Window(FRAME, EVERY, 3.0 * power)


@pytest.mark.parametrize(
    ("form", "square"), [(TRANSFER, 0.05), (TRANSFER, 0.5), (FILTER, 0.4), (BEFORE, 0.3)]
)
def test_parameters_are_found(form, square):
    modes = window(form, 0.6, square, 0.02)
    start = _blur_fit.Fit(form, 0.4, 0.2, noise=0.05).with_noise(True, modes)
    fit = _blur_fit.fit(modes, start)
    assert fit.hurst == pytest.approx(0.6, abs=1e-3)
    assert fit.square == pytest.approx(square, rel=0.02)
    assert fit.noise == pytest.approx(0.02, rel=0.02)
    assert fit.amplitude == pytest.approx(3.0, rel=0.01)


def test_interval_is_that_of_the_standard_error():
    modes = window(NONE, 0.5, 0.0, 0.0)
    fit = _blur_fit.fit(modes, _blur_fit.Fit(NONE, 0.3, 0.0))
    low, high = _blur_fit.interval(modes, fit, 3.84)
    # published: n times the least standard deviation is 1.03 at H 0.5, less at small n
    assert 0.5 * (high - low) == pytest.approx(1.96 * 1.0 / 96, rel=0.06)
    assert 0.5 * (low + high) == pytest.approx(0.5, abs=1e-3)


def test_blur_that_is_not_seen_is_in_the_interval():
    modes = window(TRANSFER, 0.5, 0.012, 0.0)
    comparison = _blur_fit.compare(modes, 0.5, noise=False)
    assert comparison.plain.hurst > 0.51
    low, high = comparison.interval(0.08)
    assert low < 0.5 < high
    alone = comparison.interval(0.08, blur=False)
    assert alone[0] > 0.5


def test_agreement_sees_a_slow_change_of_the_exponent():
    exact, rng = window(TRANSFER, 0.6, 0.3, 0.02), np.random.default_rng(3)
    squares = FRAME.squares
    results = []
    for slope in (0.0, 1.0):
        power = exact.power * rng.chisquare(FRAME.count) / FRAME.count
        modes = Window(FRAME, EVERY, power * np.minimum(squares, 0.6) ** slope)
        start = _blur_fit.Fit(TRANSFER, 0.4, 0.2, noise=0.05).with_noise(True, modes)
        fit = _blur_fit.fit(modes, start)
        assert _blur_fit.scatter(modes, fit) < 3.5
        results.append(_blur_fit.agreement(modes, fit))
    assert results[0] > 0.01
    assert results[1] < 1e-4
