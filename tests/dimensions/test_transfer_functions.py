"""Expected power under the transfer functions of instruments, against closed forms."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from fractalcontact.dimensions._mode_blocks import frame
from fractalcontact.dimensions._transfer_functions import (
    BAND,
    BEFORE,
    FILTER,
    FORMS,
    NONE,
    TRANSFER,
    Edges,
    Window,
    edge_power,
    plain_power,
)

FRAME = frame((64, 64), (1.0, 1.0))
EVERY = np.ones(FRAME.count.size, dtype=bool)


@pytest.fixture
def window():
    return Window(FRAME, EVERY, np.ones(EVERY.size))


@pytest.mark.parametrize("form", [BEFORE, FILTER, TRANSFER])
def test_no_blur_is_no_change(form, window):
    plain, blurred = (window.signal(f, 0.4, 1e-12)[0] for f in (NONE, form))
    np.testing.assert_allclose(blurred, plain, rtol=1e-3)


def test_filter_is_that_of_sampled_weights():
    single = frame((23, 23), (1.0, 1.0))  # blocks of one mode, and its mirrored one
    window = Window(single, np.ones(single.count.size, dtype=bool), np.ones(single.count.size))
    impulse = np.zeros((65, 65))
    impulse[32, 32] = 1.0
    kernel = gaussian_filter(impulse, 0.8, truncate=12)
    place = np.arange(65) - 32
    phase = single.waves[0][:, None, None] * place[:, None] + single.waves[1][:, None, None] * place
    transfer = np.sum(kernel * np.cos(phase), axis=(1, 2))
    ratio = window.signal(FILTER, 0.4, 0.64)[0] / window.signal(NONE, 0.4, 0.0)[0]
    np.testing.assert_allclose(ratio, transfer**2, rtol=1e-6)


def test_power_is_that_of_the_mean_mode_of_a_block(window):
    """To a tenth of the largest change from its centre, where the blur has left 1 % of the power."""
    hurst, square = 0.6, 0.5
    modes = np.pi * np.arange(1, 64) / 64
    squares = modes[:, None] ** 2 + modes**2
    plain, blurred = (FRAME.mean(squares ** -(hurst + 1.0) * np.exp(-s * squares)) for s in (0.0, square))
    centre = np.exp(-square * FRAME.squares)
    ratio = window.signal(TRANSFER, hurst, square)[0] / window.signal(NONE, hurst, 0.0)[0]
    change = blurred / plain / centre - 1.0
    left = square * FRAME.squares < 4.6
    assert change[left].max() > 0.01
    np.testing.assert_allclose((ratio / centre - 1.0)[left], change[left], atol=0.1 * change[left].max())


def test_wide_blur_leaves_no_aliases(window):
    before, band = (window.signal(form, 0.4, 2.0)[0] for form in (BEFORE, BAND))
    long = FRAME.squares < 4.0
    np.testing.assert_allclose(before[long], band[long], rtol=1e-6)


@pytest.mark.parametrize("form", list(FORMS))
@pytest.mark.parametrize("square", [0.05, 0.5])
def test_derivatives(form, square, window):
    step = 1e-5
    _, by_hurst, by_square = window.signal(form, 0.6, square)
    ends = [np.log(window.signal(form, 0.6 + s, square)[0]) for s in (-step, step)]
    np.testing.assert_allclose((ends[1] - ends[0]) / (2 * step), by_hurst, atol=2e-4)
    ends = [np.log(window.signal(form, 0.6, square + s)[0]) for s in (-step, step)]
    np.testing.assert_allclose((ends[1] - ends[0]) / (2 * step), by_square, atol=1e-3)


@pytest.mark.parametrize("form", list(FORMS))
def test_widest_blur_leaves_finite_power(form, window):
    signal, by_hurst, by_square = window.signal(form, 0.6, 200.0)
    assert np.isfinite([signal, by_hurst, by_square]).all()
    if form != NONE:
        assert signal[FRAME.squares > 1.0].max() < 1e-15 * signal.max()


def test_power_of_the_edges_near_another_exponent_and_spread():
    """Within 15 % of that summed there, where it is above a millionth of the surface before the blur."""
    near = Edges.of(FRAME, 0.3, 2.0)
    window = Window(FRAME, EVERY, np.ones(EVERY.size), near)
    without = Window(FRAME, EVERY, np.ones(EVERY.size))
    for hurst, square in ((0.3, 2.0), (0.2, 2.0), (0.4, 2.3)):
        added = window.signal(TRANSFER, hurst, square)[0] - without.signal(TRANSFER, hurst, square)[0]
        blurred = plain_power(FRAME, hurst) * np.exp(-square * FRAME.squares)
        counted = edge_power(FRAME, hurst, square) * blurred
        seen = counted > 1e-6 * plain_power(FRAME, hurst)
        np.testing.assert_allclose(added[seen], counted[seen], rtol=0.15)


@pytest.mark.parametrize("form", [BEFORE, FILTER, TRANSFER])
def test_derivatives_with_edges(form):
    window, step = Window(FRAME, EVERY, np.ones(EVERY.size), Edges.of(FRAME, 0.3, 0.5)), 1e-5
    _, by_hurst, by_square = window.signal(form, 0.35, 0.6)
    up, down = (np.log(window.signal(form, 0.35 + s, 0.6)[0]) for s in (step, -step))
    np.testing.assert_allclose(by_hurst, (up - down) / (2.0 * step), atol=1e-5)
    up, down = (np.log(window.signal(form, 0.35, 0.6 + s)[0]) for s in (step, -step))
    np.testing.assert_allclose(by_square, (up - down) / (2.0 * step), atol=1e-4)
