"""Band and roll-off of periodic modes."""

import numpy as np
import pytest
import scipy.fft
import scipy.stats

import fractalcontact as fc
from fractalcontact.dimensions import _periodic_modes
from fractalcontact.dimensions._periodic_modes import PeriodicModes


def modes_of_a_profile(power):
    wavenumber = np.arange(1.0, power.size + 1)
    return PeriodicModes(power, wavenumber, np.full(power.size, 2.0), 1)


def test_band_of_spectrum():
    rng = np.random.default_rng(12)
    heights = rng.standard_normal((128, 128))
    q = np.hypot(np.fft.fftfreq(128, 1 / 128)[:, None], np.fft.fftfreq(128, 1 / 128))
    amplitude = np.where((q >= 4) & (q <= 40), np.maximum(q, 10) ** -1.7, 0.0)
    surface = np.fft.ifft2(np.fft.fft2(heights) * amplitude).real
    low, high = _periodic_modes.band(PeriodicModes.of(surface, (1.0, 1.0)))
    assert 9.0 < low < 13.0
    assert 38.0 < high <= 40.0
    complete = np.fft.ifft2(np.fft.fft2(heights) * np.where(q > 0, np.maximum(q, 1) ** -1.7, 0)).real
    assert _periodic_modes.band(PeriodicModes.of(complete, (1.0, 1.0))) == (-np.inf, np.inf)


@pytest.mark.parametrize("shape", [1024, (4, 700)])
def test_one_weak_mode_is_no_cut_off(shape):
    surfaces = fc.surfaces.spectral(shape, 1.0, hurst=0.5, rms_height=1.0, rng=4, members=5)
    steps = (1.0,) * (surfaces.ndim - 1)
    highest = [_periodic_modes.band(PeriodicModes.of(surface.values, steps))[1] for surface in surfaces]
    longest = max(surfaces.shape[1:])
    assert min(highest) >= 0.5 * longest - 4


def test_running_sums_equal_likelihood():
    modes = modes_of_a_profile(np.random.default_rng(12).exponential(size=40))
    hurst, q = 0.4, modes.wavenumber
    deviances = _periodic_modes.RolloffLikelihood(modes).deviances(hurst)
    assert deviances.size == 40 - _periodic_modes.LEAST_BEYOND
    for k in (0, 5, 32):
        expected = np.maximum(q, q[k]) ** (-1 - 2 * hurst)
        expected *= np.mean(modes.power / expected)
        direct = -2.0 * scipy.stats.expon.logpdf(modes.power, scale=expected).sum()
        # the sum of all squares over their expectations is the number of modes, twice
        assert deviances[k] == pytest.approx(direct - 2.0 * q.size, rel=1e-12)


@pytest.mark.parametrize(("corner", "count"), [(0, 32), (8, 64), (20, 128)])
def test_rolloff_interval_coverage(corner, count):
    """Modes drawn from the model: the standard deviation of the coverage of 300 is .0126."""
    rng, covered = np.random.default_rng([13, corner]), 0
    for _ in range(300):
        expected = np.maximum(np.arange(1.0, count + 1), corner) ** -2.0
        result = _periodic_modes.fit_rolloff(modes_of_a_profile(expected * rng.exponential(size=count)))
        covered += result.low <= 0.5 <= result.high
    assert 0.95 - 3 * 0.0126 < covered / 300 < 0.95 + 3 * 0.0126


@pytest.mark.parametrize("hurst", [0.3, 0.7])
def test_slow_rolloff_of_whole_periodic_surfaces(hurst):
    """Once .08 to .28 too small: no octave has the exponent of the short waves."""
    n, corner = 128, 16.0
    wave = np.hypot(*np.meshgrid(np.fft.fftfreq(n), np.fft.fftfreq(n), indexing="ij")) * corner
    inside, found = 0, []
    for rng in range(8):
        white = np.fft.fft2(np.random.default_rng(rng).standard_normal((n, n)))
        heights = np.fft.ifft2(white * (1.0 + wave**2) ** (-0.5 - 0.5 * hurst)).real
        surface = fc.surfaces.from_array(1e-6 * heights, 1e-4, periodic=True)
        result = fc.dimensions.estimate(surface).isel(method=0)
        inside += bool(result.ci_low <= hurst <= result.ci_high)
        found.append(float(result.hurst))
        assert float(result.ci_high - result.ci_low) < 0.2
        assert "a slow roll-off" in result.hurst.attrs["comment"]
    assert inside >= 7  # measured: .98 of 240
    assert np.mean(found) == pytest.approx(hurst, abs=0.03)
