"""Roll-offs and high-pass filters against sums over the covariance of all pairs of points."""

import numpy as np
import pytest
from scipy.fft import dct
from scipy.ndimage import gaussian_filter, gaussian_filter1d
from scipy.special import kv

import fractalcontact as fc
from fractalcontact.dimensions import _mode_blocks
from fractalcontact.dimensions._exponent_by_scale import frame_blocks
from fractalcontact.dimensions._rolloff import fit_rolloff
from tests.dimensions.test_model_violations import brownian

SIZE, CUT_OFF, SPACING = 48, 8.0, 1e-4
WEIGHT = CUT_OFF * np.sqrt(np.log(2.0) / np.pi) / np.sqrt(2.0 * np.pi)  # standard deviation, ISO 16610-61


def pair_sums(first, second, covariance, margin):
    """Covariance of two kinds of cosine modes of each wavenumber, summed over all pairs of points."""
    n = SIZE + 2 * margin
    lags = np.abs(np.arange(1 - n, n))
    at_lags = covariance(np.hypot(lags[:, None], lags))
    pairs = np.array([np.correlate(a, b, "full") for a, b in zip(first, second, strict=True)])
    return (pairs @ at_lags @ pairs.T)[1:, 1:]


def lines(margin, spread):
    """Weights of the heights in each cosine mode of the middle of a line that is filtered, or not."""
    eye = np.eye(SIZE + 2 * margin)
    filtered = gaussian_filter1d(eye, spread, axis=1, truncate=6.0) if spread else eye
    return dct(filtered[:, margin : margin + SIZE], norm="ortho", axis=1).T


def fitted(power, **options):
    frame = _mode_blocks.frame((SIZE, SIZE), (1.0, 1.0))
    blocks = frame_blocks(frame.mean(power), frame)
    return fit_rolloff(blocks, np.ones(frame.count.size, dtype=bool), **options)


def matern(hurst):
    """Covariance of a slow roll-off with a corner at waves of 10 spacings."""

    def covariance(r):
        lag = np.maximum(2.0 * np.pi / 10.0 * r, 1e-7)
        return lag**hurst * kv(hurst, lag)

    return covariance


@pytest.mark.parametrize("margin", [0, 10])
@pytest.mark.parametrize("hurst", [0.3, 0.7])
def test_high_pass_filter_of_known_power(hurst, margin):
    """A filter that reflects the heights at the edges, and one that goes on beyond them."""
    heights, filtered = lines(margin, 0.0), lines(margin, WEIGHT)
    power = [
        pair_sums(first, second, lambda r: -(r ** (2 * hurst)), margin)
        for first, second in ((heights, heights), (heights, filtered), (filtered, filtered))
    ]
    result = fitted(power[0] - 2.0 * power[1] + power[2], shape="high-pass")
    assert result.law.hurst == pytest.approx(hurst, abs=0.02)
    assert result.length == pytest.approx(CUT_OFF, rel=0.02)


def test_blurred_slow_rolloff_of_known_power():
    """Beyond the edges the slope of blurred heights jumps; without that H is 0.47."""
    hurst, lines_of_modes = 0.8, lines(8, 1.0)
    result = fitted(pair_sums(lines_of_modes, lines_of_modes, matern(hurst), 8), blur=("filter", 0.7))
    assert result.law.hurst == pytest.approx(hurst, abs=0.08)
    assert result.length == pytest.approx(10.0, rel=0.06)
    assert result.spread == pytest.approx(1.0, abs=0.005)


def test_high_passed_surface_has_the_exponent_of_the_shorter_waves():
    """Once .02 for .3, as a filter with white noise."""
    heights = brownian(0.3, 5, (128, 128))
    heights = heights - gaussian_filter(heights, WEIGHT, truncate=5.0)
    result = fc.dimensions.estimate(fc.surfaces.from_array(heights, SPACING)).isel(method=0)
    assert result.ci_low < 0.3 < result.ci_high
    assert result.ci_high - result.ci_low < 0.25
    assert result.scale_max.item() == pytest.approx(CUT_OFF * SPACING, rel=0.15)
    assert "a Gaussian high-pass filter" in result.hurst.attrs["comment"]


def test_known_noise_of_a_slow_rolloff():
    """A tenth of the rms increment; without it H is 0.03 too small."""
    hurst, lines_of_modes, covariance = 0.9, lines(0, 0.0), matern(0.9)
    square = 2.0 * (covariance(0.0) - covariance(1.0))  # of an increment
    power = pair_sums(lines_of_modes, lines_of_modes, covariance, 0) + 0.1**2 * square
    assert fitted(power, weak_noise=0.1).law.hurst == pytest.approx(hurst, abs=0.02)
    assert fitted(power).law.hurst < hurst - 0.02
