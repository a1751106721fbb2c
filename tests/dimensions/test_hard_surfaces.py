"""Surfaces on which fits failed: many gaps, single curvatures, tilts, ridges, bands of waves."""

import numpy as np
import pytest
from scipy import ndimage

import fractalcontact as fc

x = np.arange(106.0)


def surface(heights, periodic=False):
    return fc.surfaces.from_array(heights, 1.0, periodic=periodic)


@pytest.mark.parametrize("count", [8, pytest.param(20, marks=pytest.mark.slow)])
def test_interval_of_a_surface_with_most_of_it_missing(count):
    """fBm of H = 1/2, of which the lowest part of a smooth field is missing: 95 % intervals hold H.

    A fit that alternated between two sets of nodes gave 10 of 55.
    """
    hits, errors = [], []
    for seed in range(count):
        rng = np.random.default_rng(seed)
        heights = fc.surfaces.fbm((32, 32), 1.0, hurst=0.5, rms_increment=1.0, rng=seed).values
        field = ndimage.gaussian_filter(rng.standard_normal((32, 32)), 1.0)
        observed = np.where(field < np.quantile(field, 0.7), np.nan, heights)
        result = fc.dimensions.estimate(surface(observed)).isel(method=0)
        if np.isfinite(result.ci_low):
            hits.append(bool(result.ci_low <= 0.5 <= result.ci_high))
            errors.append(float((result.hurst - 0.5) / result.standard_error))
    assert len(hits) >= 0.9 * count - 1
    assert sum(hits) >= 0.9 * count - 1
    assert np.sqrt(np.mean(np.square(errors))) < 1.5  # standard errors were 1/5 of the true ones


@pytest.mark.parametrize(
    ("heights", "periodic", "method"),
    [
        (-((x[:32] - 16) ** 2) * np.ones((32, 1)), True, None),
        (-((x[:24] - 12) ** 2) * np.ones((24, 1)), True, "spectrum"),
        ((x[:31] - 15) ** 2 * np.ones((31, 1)) * 1e-6, False, "spectrum"),
        (np.arange(219) + 1e-7 * np.random.default_rng(1).standard_normal(219), False, None),
    ],
    ids=["periodic parabola", "its spectrum", "free parabola", "tilted profile"],
)
def test_smooth_and_tilted_heights_have_an_estimate_or_a_reason(heights, periodic, method):
    """Warnings are errors here: none comes from an overflow or an empty mean."""
    result = fc.dimensions.estimate(surface(heights, periodic), *([method] if method else []))
    if np.isnan(result.hurst[0]):
        assert result.reason[0] != ""
    else:
        assert 0 <= float(result.hurst[0]) <= 1


@pytest.mark.parametrize("seed", [295, 536])
def test_a_narrow_band_whose_modes_are_all_single_waves_has_a_reason(seed):
    """Their fit ended with the largest change of no mode at all, an error of numpy."""
    rng = np.random.default_rng(seed)
    q = np.hypot(np.fft.fftfreq(21)[:, None], np.fft.rfftfreq(27))
    low, high = sorted(rng.uniform(0.0, 0.5, 2))
    q[0, 0] = 1.0
    modes = np.fft.rfft2(rng.standard_normal((21, 27))) * ((q >= low) & (q <= high)) * q**-1.5
    result = fc.dimensions.estimate(surface(np.fft.irfft2(modes, (21, 27))))
    assert np.isnan(result.ci_low[0])
    assert str(result.reason[0].values) != ""


@pytest.mark.parametrize("turned", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_ridges_are_no_isotropic_surface(turned):
    """A periodic ramp: all waves run along it, so that no ratio can be fitted."""
    ramp = x[:53] + 1e-8 * np.random.default_rng(1).standard_normal((75, 53))
    result = fc.dimensions.directions(surface(ramp.T if turned else ramp, periodic=True))
    assert float(result.isotropy_p_value) < 1e-18
    assert np.isnan(result.anisotropy_ratio)
    assert "ridges" in result.anisotropy_ratio.attrs["reason"]
    difference = float(result.anisotropy_azimuth) - (0.0 if turned else 90.0)
    assert abs((difference + 90.0) % 180.0 - 90.0) < 1.0


@pytest.mark.parametrize("seed", [28, 0, 1, *(pytest.param(n, marks=pytest.mark.slow) for n in (2, 3, 4))])
def test_a_band_of_waves(seed):
    """Part of a surface of few wavelengths, with a plateau: 9 of 243 had no wave left to fit."""
    rng = np.random.default_rng(seed)
    n = 64
    k = np.hypot(np.fft.fftfreq(2 * n)[:, None], np.fft.fftfreq(2 * n)[None])
    k[0, 0] = 9
    low, high = np.sort(np.exp(rng.uniform(np.log(1.5 / n), np.log(0.5), 2)))
    modes = np.fft.fft2(rng.standard_normal((2 * n, 2 * n))) * np.where(
        k > high, 0, np.maximum(k, low) ** -1.7
    )
    part = surface(np.fft.ifft2(modes).real[:n, :n])
    estimate = fc.dimensions.estimate(part).isel(method=0)
    assert np.isnan(estimate.hurst) or 0 <= float(estimate.hurst) <= 1
    octaves = fc.dimensions.scaling(part)
    assert np.isfinite(octaves.hurst).any()


def _interpolated(heights):
    heights[:, 1:-1:2] = 0.5 * (heights[:, 0:-2:2] + heights[:, 2::2])
    return heights


def _partly_rounded(heights):
    heights[:, :300] = 5e-7 * np.rint(heights[:, :300] / 5e-7)
    return heights


def _with_spikes(heights):
    heights[10:45:7, 10:100:9] += 3e-5
    return heights


@pytest.mark.parametrize(
    ("damage", "points"),
    [(_interpolated, 128), pytest.param(_partly_rounded, 384, marks=pytest.mark.slow), (_with_spikes, 128)],
)
def test_what_is_said_of_a_map_does_not_depend_on_its_orientation(damage, points):
    """Reasons and exponents are those of the heights: flips and transposes change neither."""
    heights = fc.surfaces.fbm((points, points), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1).values.copy()
    heights = damage(heights)
    reasons, exponents = set(), []
    for turned in (heights, heights.T, heights[::-1]):  # all others follow one another
        surface = fc.surfaces.from_array(np.ascontiguousarray(turned), 1e-4)
        result = fc.dimensions.estimate(surface)
        reasons.add(str(result.reason.values[0]))
        exponents.append(float(result.hurst[0]))
    assert len(reasons) == 1, reasons
    assert np.ptp(exponents) <= 0.01  # modes are averaged over an even sample of each bin


@pytest.mark.parametrize("seed", [5, 15])
def test_a_slightly_blurred_map_of_512_points(seed):
    # with a coarser table of the expected power another exponent, .8, was as probable; with a filter of first
    # order in the model intervals are up to .061 wide, without it .046
    heights = fc.surfaces.fbm((560, 560), 1e-4, hurst=0.5, rms_increment=1e-6, rng=seed).values
    blurred = ndimage.gaussian_filter(heights, 1.0)[24:-24, 24:-24]
    found = fc.dimensions.estimate(fc.surfaces.from_array(blurred, 1e-4)).isel(method=0)
    assert found.hurst == pytest.approx(0.5, abs=0.03)
    assert 0.02 < float(found.ci_high - found.ci_low) < 0.07


def test_spacings_that_differ_by_orders_overflow_nothing():
    heights = fc.surfaces.fbm((175, 130), 1e-4, hurst=0.6, rms_increment=1e-6, rng=3).values
    for spacing in ((1e-7, 3e-3), (3e-3, 1e-7), (0.12, 350.0)):
        found = fc.dimensions.estimate(fc.surfaces.from_array(heights, spacing)).isel(method=0)
        assert np.isfinite(found.ci_low) or str(found.reason.values)


@pytest.mark.parametrize("hurst", [0.3, 0.7])
def test_a_point_spread_with_long_tails_leaves_the_exponent(hurst):
    """The transfer function exp(-q / 2): as a Gaussian blur it gave an exponent .2 to .4 too high."""
    height = fc.surfaces.fbm((144, 144), 1.0, hurst=hurst, rms_increment=1.0, rng=4).values
    mirrored = np.pad(height, ((0, 144), (0, 144)), "symmetric")
    q = 2.0 * np.pi * np.hypot(np.fft.fftfreq(288)[:, None], np.fft.rfftfreq(288))
    seen = np.fft.irfft2(np.fft.rfft2(mirrored) * np.exp(-0.5 * q), mirrored.shape)[8:136, 8:136]
    result = fc.dimensions.estimate(surface(seen)).isel(method=0)
    assert float(result.ci_low) < hurst < float(result.ci_high)
    assert float(result.ci_high - result.ci_low) < 0.3
    assert "no Gaussian" in str(result.note.values)
    along = fc.dimensions.directions(surface(seen))
    assert ((along.ci_low < hurst) & (hurst < along.ci_high)).all()  # without the filter .77 for .3
    assert float(along.isotropy_p_value) > 0.001
    blurred = fc.dimensions.estimate(surface(ndimage.gaussian_filter(height, 0.7)))
    assert "no Gaussian" not in str(blurred.note[0].values)


@pytest.mark.parametrize(
    ("points", "missing", "is_known"), [(59, 0.991, False), (24, 0.9, False), (48, 0.7, True)]
)
def test_few_points_of_a_large_map_leave_no_exponent(points, missing, is_known):
    """Of 59 x 59 points 31 were there: the power of their modes overflowed."""
    heights = fc.surfaces.fbm((points, points), 1e-4, hurst=0.5, rms_increment=1e-6, rng=1)
    found = fc.dimensions.estimate(heights.where(np.random.default_rng(2).random(heights.shape) > missing))
    assert np.isfinite(found.ci_low.item()) == is_known
    assert ("too few modes" in found.reason.item()) != is_known


def test_few_waves_of_a_periodic_surface_are_not_laid_to_its_edges():
    y, x = 2.0 * np.pi * np.indices((64, 64)) / 64
    heights = 1e-6 * (np.cos(5 * x + 3 * y) + np.cos(9 * x - 7 * y) + np.cos(2 * x + 11 * y))
    found = fc.dimensions.estimate(fc.surfaces.from_array(heights, 1e-4, periodic=True)).isel(method=0)
    assert np.isnan(float(found.hurst))
    assert "modes beside those of edges, filters, waves or rounding" in found.reason.item()


@pytest.mark.parametrize("hurst", [0.3, 0.85])
def test_sums_of_waves_are_no_random_surface(hurst):
    surface = fc.surfaces.weierstrass((96, 96), 1e-4, hurst=hurst, rms_height=1e-5, rng=1)
    found = fc.dimensions.estimate(surface).isel(method=0)
    assert np.isnan(float(found.ci_low))
    assert found.reason.item().startswith("most of the power is in single waves")
