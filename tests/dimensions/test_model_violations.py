"""Surfaces outside the families: the interval is widened or withheld, with a note."""

import json

import numpy as np
import pytest
from scipy.interpolate import griddata
from scipy.ndimage import gaussian_filter
from scipy.special import kv

import fractalcontact as fc
from fractalcontact.base.spectra import aliased_power_law

SIZE, SPACING, STEP = 96, 1e-4, 1e-5


def brownian(hurst, rng, shape=(SIZE, SIZE)):
    return fc.surfaces.fbm(shape, SPACING, hurst=hurst, rms_increment=STEP, rng=rng).values


def rounded(heights, levels):
    step = np.ptp(heights) / levels
    return np.round((heights - heights.min()) / step) * step


def with_spikes(heights, rng):
    spiked = heights.copy()
    places = np.random.default_rng(rng).integers(0, SIZE, (2, 5))
    spiked[tuple(places)] += 50 * STEP
    return spiked


def oblique_step(heights):
    y, x = np.indices(heights.shape)
    return heights + 20 * STEP * (x + 0.37 * y > 0.6 * SIZE)


def estimated(heights, method, **options):
    result = fc.dimensions.estimate(fc.surfaces.from_array(heights, SPACING), method, **options)
    result = result.isel(method=0)
    return (
        float(result.hurst),
        float(result.ci_low),
        float(result.ci_high),
        json.loads(result.hurst.attrs["comment"]).get(method, ""),
    )


def four_steps(heights, rng, height):
    y, x = np.indices(heights.shape)
    generator = np.random.default_rng(rng)
    for _ in range(4):
        angle, at = generator.uniform(0, np.pi), generator.uniform(0.2, 0.8, 2) * heights.shape
        heights = heights + height * (np.cos(angle) * (x - at[1]) + np.sin(angle) * (y - at[0]) > 0)
    return heights


def rolled_off(hurst, rng, longest=8, n=128):
    """A crop of a surface whose waves longer than `longest` spacings have one power."""
    waves = 2 * np.pi * np.fft.fftfreq(2 * n)
    with np.errstate(divide="ignore"):
        power = aliased_power_law((waves[:, None], waves), hurst)
    corner = float(aliased_power_law((np.zeros(1), np.array([2 * np.pi / longest])), hurst)[0])
    white = np.fft.fft2(np.random.default_rng(rng).standard_normal((2 * n, 2 * n)))
    return np.fft.ifft2(white * np.sqrt(np.minimum(power, corner))).real[:n, :n]


DEFECTS = {
    "8 bits": (0.9, lambda s: rounded(brownian(0.9, s), 255), "rounded to steps"),
    "5 bits": (0.7, lambda s: rounded(brownian(0.7, s), 31), "rounded to steps"),
}


@pytest.mark.parametrize("method", ["likelihood", "increments"])
@pytest.mark.parametrize("name", DEFECTS)
def test_defects_widen_interval_to_true_exponent(name, method):
    hurst, defect, words = DEFECTS[name]
    for seed in (1, 3):
        result, low, high, note = estimated(defect(seed), method)
        if (name, method) == ("5 bits", "likelihood"):  # the rounding is in the model
            assert abs(result - hurst) < 0.1  # few waves are left of the coarser one
            assert low <= hurst <= high
        else:
            assert abs(result - hurst) > 0.01  # the estimate itself is wrong ...
            assert low - 0.05 <= hurst <= high + 0.05  # ... and its interval is not that of one that is right
        assert any(word in note for word in words.split("|"))


@pytest.mark.parametrize("method", ["likelihood", "increments"])
@pytest.mark.parametrize("defect", ["an oblique step", "outliers", "four steps"])
def test_steps_and_spikes_are_left_out(method, defect):
    """Steps of five increments, or of twenty, and spikes of fifty."""
    for seed in (1, 3):
        hurst = 0.3 if defect == "four steps" else 0.7
        ground = brownian(hurst, seed, (128, 128)) if hurst == 0.3 else brownian(hurst, seed)
        heights = {
            "an oblique step": lambda ground: oblique_step(ground),
            "outliers": lambda ground, seed=seed: with_spikes(ground, seed),
            "four steps": lambda ground, seed=seed: four_steps(ground, seed, 5 * STEP),
        }[defect](ground)
        result, low, high, note = estimated(heights, method)
        assert abs(result - hurst) < 0.04
        assert low < hurst < high
        assert high - low < 0.25
        assert "left out" in note


@pytest.mark.parametrize("rng", [1, 2, 3])
@pytest.mark.parametrize("hurst", [0.3, 0.8])
def test_roll_off_leaves_window_of_shorter_waves(hurst, rng):
    """Once taken for blur and noise: 0.01 for 0.3, and 0.4 for 0.8."""
    surface = fc.surfaces.from_array(rolled_off(hurst, rng), SPACING)
    result = fc.dimensions.estimate(surface).isel(method=0)
    assert float(result.ci_low) - 0.01 < hurst < float(result.ci_high) + 0.01
    assert float(result.ci_high - result.ci_low) < 0.1
    assert float(result.scale_max) <= 16.0 * SPACING
    assert "no single exponent holds at all scales" in result.hurst.attrs["comment"]


def broken(short, long, corner, rng, n):
    """A crop of a surface with one exponent of waves below `corner` spacings, and another beyond."""
    wave = np.hypot(*np.meshgrid(*(2 * np.pi * np.fft.fftfreq(2 * n),) * 2)) * corner / (2 * np.pi)
    wave[0, 0] = np.inf
    power = np.where(wave > 1.0, wave ** (-2 * short - 2), wave ** (-2 * long - 2))
    white = np.fft.fft2(np.random.default_rng(rng).standard_normal((2 * n, 2 * n)))
    return np.fft.ifft2(white * np.sqrt(power)).real[:n, :n]


@pytest.mark.parametrize(("short", "long", "corner"), [(1.3, 0.3, 20), (1.5, 0.5, 40)])
def test_blur_that_does_not_fit_gives_way_to_the_window(short, long, corner):
    """Once 1.2 without an interval."""
    surface = fc.surfaces.from_array(STEP * broken(short, long, corner, 4, 400), SPACING)
    result = fc.dimensions.estimate(surface).isel(method=0)
    assert "the longest run of octaves" in result.hurst.attrs["comment"]
    assert float(result.scale_min) >= 0.5 * corner * SPACING
    # a corner inside an octave, and few long waves: the interval holds those of the run without an octave
    assert float(result.ci_low) - 0.06 < long < float(result.ci_high) + 0.06
    assert float(result.ci_high - result.ci_low) < 0.65


def test_large_crop_has_the_exponent_of_the_shorter_waves_and_that_of_the_longer():
    """Once 0.738 [0.727, 0.750] for 0.8, with blur and noise "in the model"."""
    result = fc.dimensions.estimate(fc.surfaces.from_array(STEP * broken(0.8, 0.3, 16, 5, 800), SPACING))
    result = result.isel(method=0)
    assert float(result.ci_low) < 0.8 < float(result.ci_high)
    assert float(result.ci_high - result.ci_low) < 0.02
    assert float(result.scale_max) == pytest.approx(16 * SPACING, rel=0.01)
    assert "0.30 [0.26, 0.33] that of longer ones" in result.hurst.attrs["comment"]


def test_land_surface_is_answered_with_its_window():
    """Smooth slopes, integer metres: once 1.08, with a blur of half a spacing, and no interval."""
    land = fc.surfaces.sample("jacksboro_fault_dem")
    result = fc.dimensions.estimate(land).isel(method=0)
    window = fc.dimensions.scaling(land)
    assert float(result.hurst) == pytest.approx(float(window.window_hurst))
    assert float(result.scale_min) == pytest.approx(float(window.scale_min))
    assert 0.0 <= float(result.ci_low) <= max(float(window.window_ci_low), 0.0) + 1e-9
    assert float(window.window_ci_high) - 1e-9 <= float(result.ci_high) < 0.6


def knee(short, long, corner, rng, n=128):
    """As `broken`, with the aliases of sampling."""
    waves = 2 * np.pi * np.fft.fftfreq(2 * n)
    edge = 2 * np.pi / corner
    with np.errstate(divide="ignore"):
        laws = [
            aliased_power_law((waves[:, None], waves), hurst)
            / aliased_power_law((np.zeros(1), np.array([edge])), hurst)[0]
            for hurst in (short, long)
        ]
    power = np.where(np.hypot(waves[:, None], waves) > edge, *laws)
    power[0, 0] = 0.0
    white = np.fft.fft2(np.random.default_rng(rng).standard_normal((2 * n, 2 * n)))
    return np.fft.ifft2(white * np.sqrt(power)).real[:n, :n]


def test_smooth_short_waves_on_rough_long_ones():
    """Once .5 to .6 for .8, with a blur of half a spacing and noise in 24 of 100."""
    inside = 0
    for rng in range(12):
        result = fc.dimensions.estimate(fc.surfaces.from_array(knee(0.8, 0.3, 16, rng), SPACING))
        inside += bool(result.ci_low[0] <= 0.8 <= result.ci_high[0])
        assert float(result.ci_high[0] - result.ci_low[0]) < 0.6
    assert inside >= 10  # measured: .96 of 50


@pytest.mark.parametrize("hurst", [0.3, 0.7])
def test_crop_with_a_rolloff_has_the_exponent_of_the_shorter_waves(hurst):
    """Once .15 for .3 and .51 for .7, as a band limit with noise, in 28 of 30."""
    inside, widths = 0, []
    for rng in range(4):
        surface = fc.surfaces.from_array(STEP * broken(hurst, -1.0, 10, rng, 160), SPACING)
        result = fc.dimensions.estimate(surface).isel(method=0)
        inside += bool(result.ci_low <= hurst <= result.ci_high)
        assert float(result.hurst) == pytest.approx(hurst, abs=0.04)
        widths.append(float(result.ci_high - result.ci_low))
        assert "no waves shorter than two spacings" in result.hurst.attrs["comment"]
    assert inside >= 3
    assert np.median(widths) < 0.2


def matern_heights(shape, hurst, corner, rng):
    """Exact point samples of the Matern covariance, a part of a torus of twice the size."""
    y, x = (np.minimum(np.arange(2 * n), 2 * n - np.arange(2 * n)) for n in shape)
    lag = 2.0 * np.pi / corner * np.hypot(y[:, None], x)
    lag[0, 0] = 1e-9
    power = np.fft.fft2(lag**hurst * kv(hurst, lag)).real
    white = np.fft.fft2(np.random.default_rng(rng).standard_normal(lag.shape))
    return np.fft.ifft2(white * np.sqrt(np.maximum(power, 0.0))).real[: shape[0], : shape[1]]


def band_limited_heights(shape, hurst, corner, rng):
    """The same spectrum without waves beyond the sampling."""
    wave = np.hypot(*np.meshgrid(*(np.fft.fftfreq(2 * n) for n in shape), indexing="ij")) * corner
    white = np.fft.fft2(np.random.default_rng(rng).standard_normal(wave.shape))
    return np.fft.ifft2(white * (1.0 + wave**2) ** (-0.5 - 0.5 * hurst)).real[: shape[0], : shape[1]]


def test_blurred_slow_rolloff_has_the_exponent_before_the_blur():
    """Once .24 [.15, .26]: the plateau of the long waves was left out, or taken for noise."""
    inside = 0
    for rng in range(3):
        heights = gaussian_filter(matern_heights((144, 144), 0.5, 10.0, rng), 0.5)[8:-8, 8:-8]
        result = fc.dimensions.estimate(fc.surfaces.from_array(STEP * heights, SPACING)).isel(method=0)
        inside += bool(result.ci_low <= 0.5 <= result.ci_high)
    assert inside >= 2
    assert "a slow roll-off: " in result.hurst.attrs["comment"]


@pytest.mark.parametrize("heights", [matern_heights, band_limited_heights])
@pytest.mark.parametrize("hurst", [0.3, 0.8])
def test_slow_rolloff_has_the_exponent_of_the_shorter_waves(heights, hurst):
    """Once .10 for .3 and .16 for .8, in intervals that held neither in 16 of 16."""
    inside, widths, corners = 0, [], []
    for rng in range(6):
        surface = fc.surfaces.from_array(STEP * heights((128, 128), hurst, 12.0, rng), SPACING)
        result = fc.dimensions.estimate(surface).isel(method=0)
        if "a slow roll-off:" in result.hurst.attrs["comment"]:
            corners.append(float(result.scale_max))
        widths.append(float(result.ci_high - result.ci_low))
        inside += bool(result.ci_low <= hurst <= result.ci_high)
    assert inside >= 5
    assert np.median(widths) < 0.25
    np.testing.assert_allclose(corners, 12.0 * SPACING, rtol=0.25)
    assert len(corners) >= 5


def test_crop_with_two_exponents_has_that_of_the_shorter_waves():
    """Once .43 for .3, as a band limit with noise, in 30 of 30."""
    inside = 0
    for rng in range(4):
        surface = fc.surfaces.from_array(STEP * broken(0.3, 0.8, 16, rng, 160), SPACING)
        result = fc.dimensions.estimate(surface).isel(method=0)
        inside += bool(result.ci_low <= 0.3 <= result.ci_high)
        assert float(result.ci_high - result.ci_low) < 0.2
    assert inside >= 3


@pytest.mark.parametrize("rng", [0, 3])
def test_waves_along_the_diagonals_have_no_exponent_of_their_own(rng):
    """Once .26 and .14 with the ends 0 and .9, of waves shorter than 2 spacings."""
    surface = fc.surfaces.from_array(STEP * broken(0.0, 0.9, 1.8, rng, 128), SPACING)
    result = fc.dimensions.estimate(surface).isel(method=0)
    assert float(result.hurst) == pytest.approx(0.9, abs=0.12)
    assert float(result.ci_low) > 0.7


@pytest.mark.parametrize("rng", [0, 1])
def test_sum_of_two_surfaces_has_the_exponent_of_each(rng):
    rough, smooth = (brownian(hurst, rng + seed, (256, 256)) for hurst, seed in ((0.3, 0), (0.9, 100)))
    surface = fc.surfaces.from_array(rough + smooth * 12.0 ** (0.3 - 0.9), SPACING)
    result = fc.dimensions.estimate(surface).isel(method=0)
    assert "two exponents" in result.hurst.attrs["comment"]
    assert float(result.ci_low) < 0.3 < float(result.ci_high)
    assert float(result.ci_high - result.ci_low) < 0.06
    assert float(result.scale_max) < 128 * SPACING


@pytest.mark.parametrize("lag", [3.0, 8.0])
def test_sum_in_a_small_surface_has_a_wide_interval(lag):
    """Noise and a second exponent are alike at 128 points."""
    inside, notes = 0, []
    for seed in range(12):
        both = ((0.3, 0), (0.8, 100))
        rough, smooth = (brownian(hurst, 300 + seed + more, (128, 128)) for hurst, more in both)
        surface = fc.surfaces.from_array(rough + smooth * lag ** (0.3 - 0.8), SPACING)
        result = fc.dimensions.estimate(surface).isel(method=0)
        inside += bool(result.ci_low <= 0.3 <= result.ci_high)
        notes.append(result.hurst.attrs["comment"])
        assert float(result.ci_high - result.ci_low) < 0.7
    assert inside >= 9  # measured: .93 and .94 of 100
    assert sum("exponent" in note for note in notes) >= 9


def test_slight_change_with_scale_widens_the_interval():
    surfaces = [fc.surfaces.from_array(brownian(0.5, seed), SPACING) for seed in range(40, 80)]
    results = [fc.dimensions.estimate(surface).isel(method=0) for surface in surfaces]
    widths = np.array([float(result.ci_high - result.ci_low) for result in results])
    has_note = np.array(["may change with scale" in result.hurst.attrs["comment"] for result in results])
    misfits = np.array([float(result.misfit) for result in results])
    np.testing.assert_array_equal(has_note, (misfits >= 1.5) | (misfits <= -2.5))
    assert widths[has_note].min(initial=1.0) > widths[~has_note].max()
    assert has_note.sum() <= 10  # one in fourteen of exact surfaces, as measured on 400


def test_few_gaps_leave_the_window_of_one_exponent():
    heights = rolled_off(0.8, 1)
    heights[20, 30] = heights[70:72, 100] = np.nan
    result = fc.dimensions.estimate(fc.surfaces.from_array(heights, SPACING)).isel(method=0)
    assert "no single exponent holds at all scales" in result.hurst.attrs["comment"]
    assert float(result.ci_low) - 0.01 < 0.8 < float(result.ci_high) + 0.01
    assert float(result.ci_high - result.ci_low) < 0.15


@pytest.mark.parametrize("method", ["likelihood", "increments"])
def test_two_exponents_side_by_side(method):
    half = (SIZE, SIZE // 2)
    rough, smooth = brownian(0.3, 4, half), brownian(0.8, 5, half)
    heights = np.concatenate([rough, smooth - smooth[:, :1] + rough[:, -1:]], axis=1)
    _, low, high, note = estimated(heights, method)
    assert low < 0.35
    assert high > 0.62
    assert "differs from part to part" in note


@pytest.mark.parametrize("method", ["likelihood", "increments"])
def test_unequal_patches_widen_interval(method):
    """The scatter of the estimate on lognormal surfaces, and the width of its interval."""
    result = [estimated(np.exp(brownian(0.5, s) / (5 * STEP)), method)[:3] for s in range(8)]
    hurst, low, high = np.array(result).T
    half = 0.5 * (high - low)
    assert np.std(hurst) < np.mean(half) < 8 * np.std(hurst)
    assert np.mean(half) > 3 * 1.96 * 0.008


@pytest.mark.parametrize("periodic", [False, True])
def test_anisotropic_surface_is_noted(periodic):
    surface = fc.surfaces.spectral(
        (SIZE, SIZE), SPACING, hurst=0.7, rms_height=STEP, anisotropy_ratio=2.0, azimuth=30.0, rng=6
    )
    result = fc.dimensions.estimate(surface if periodic else fc.surfaces.from_array(surface.values, SPACING))
    assert "more than their share" in result.hurst.attrs["comment"]
    if periodic:
        assert float(result.ci_low[0]) < 0.7 < float(result.ci_high[0])


def test_band_limited_periodic_surface_fits():
    for seed in range(5):
        surface = fc.surfaces.spectral(
            (SIZE, SIZE), SPACING, hurst=0.7, rms_height=STEP, rolloff=2e-3, short_cutoff=4e-4, rng=seed
        )
        assert "share" not in fc.dimensions.estimate(surface).hurst.attrs["comment"]


def test_rounded_and_uneven_profiles_are_noted():
    heights = brownian(0.8, 9, 300)
    _, low, high, note = estimated(rounded(heights, 63), "likelihood")
    assert low < 0.8 < high
    assert "rounded to steps" in note
    _, _, _, note = estimated(heights * np.where(np.arange(300) < 100, 8.0, 1.0), "likelihood")
    assert "not equally rough" in note


def test_fitted_noise_explains_rounding():
    _, low, high, note = estimated(rounded(brownian(0.9, 12), 255), "likelihood", noise=True)
    assert low < 0.9 < high
    assert "rounded" not in note


@pytest.mark.parametrize("rng", [1, 2, 3])
def test_unfitted_noise_widens_interval(rng):
    heights = brownian(0.9, rng, (128, 128))
    noise = np.random.default_rng(rng).standard_normal(heights.shape)
    hurst, low, high, note = estimated(heights + np.sqrt(0.05) * STEP * noise, "increments")
    assert "changes with" in note
    assert "white noise" in note
    assert hurst < 0.85
    assert low < 0.9 < high


@pytest.mark.parametrize("shape", [(128, 128), (4096,)])
@pytest.mark.parametrize("rng", [1, 4])
def test_noise_that_shows_is_in_the_model(rng, shape):
    heights = brownian(0.9, rng, shape)
    noise = np.random.default_rng(rng).standard_normal(heights.shape)
    hurst, low, high, note = estimated(heights + np.sqrt(0.05) * STEP * noise, "likelihood")
    assert "white noise" in note
    assert abs(hurst - 0.9) < 0.1
    assert low < 0.9 < high


@pytest.mark.parametrize("shape", [(800, 800), (1024, 1024), (1025, 1131)])
@pytest.mark.parametrize("noise", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_large_smooth_surface_is_estimated(shape, noise):
    """Here the expected power of a smooth surface once cancelled below zero."""
    smooth = gaussian_filter(brownian(0.7, 7, shape), 0.7)
    hurst, low, _, note = estimated(smooth, "likelihood", noise=noise)
    assert np.isfinite(hurst)
    assert np.isnan(low) or low <= 0.7
    assert "in the model" in note


@pytest.mark.parametrize("step", [1e-4, 2e-4, 3e-4])
def test_linear_interpolation_has_no_interval(step):
    """Points gridded finely by hand look smooth; without their distance no interval can hold the truth."""
    heights = fc.surfaces.fbm((256, 256), 1e-4, hurst=0.8, rms_increment=3e-5, rng=4).values
    flat = np.random.default_rng(4).choice(256 * 256, 64**2, replace=False)
    row, column = np.unravel_index(flat, heights.shape)
    y, x = np.meshgrid(*(np.arange(2e-3, 23e-3, step),) * 2, indexing="ij")
    gridded = griddata(np.c_[row, column] * 1e-4, heights[row, column], (y, x))
    result = fc.dimensions.estimate(gridded, spacing=step).isel(method=0)
    assert np.isnan(result.ci_low)
    assert np.isnan(result.standard_error)
    assert "interpolated" in result.ci_low.attrs["reason"]
    resolved = fc.dimensions.estimate(gridded, spacing=step, scales=(3.2e-3, 0.1)).isel(method=0)
    assert float(resolved.ci_low) - 0.035 <= 0.8 <= float(resolved.ci_high)


@pytest.mark.parametrize("step", [1e-5, 1e-6, 1e-7])
def test_rounded_heights_do_not_count_as_interpolated(step):
    heights = fc.surfaces.fbm((256, 256), 1e-4, hurst=0.8, rms_increment=3e-6, rng=4).values
    result = fc.dimensions.estimate(step * np.rint(heights / step), spacing=1e-4)
    assert "interpolated" not in result.hurst.attrs["comment"]


@pytest.mark.parametrize("form", ["saddle", "oblique cylinder"])
def test_a_form_is_removed_and_named(form):
    """With the form, the exponents are 0.1 to 1.2: its power falls as that of H = 1 along the axes."""
    name = "product x y"
    surface = fc.surfaces.fbm((96, 96), 1e-4, hurst=0.4, rms_increment=1e-6, rng=11)
    y, x = np.meshgrid(*(np.linspace(-1.0, 1.0, 96),) * 2, indexing="ij")
    formed = surface + 5e-4 * (x * y if form == "saddle" else (x + y) ** 2)
    result = fc.dimensions.estimate(formed).isel(method=0)
    alone = fc.dimensions.estimate(surface).isel(method=0)
    assert float(result.hurst) == pytest.approx(float(alone.hurst), abs=0.003)
    assert result.ci_low < 0.4 < result.ci_high
    assert name in result.hurst.attrs["comment"]
    assert name not in fc.dimensions.estimate(surface).hurst.attrs["comment"]


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("axis", ["rows", "columns"])
def test_lines_levelled_one_by_one_are_seen(order, axis):
    """Without the waves along the lines that levelling takes out, H of 0.3 came out 0.011 too small."""
    place = np.linspace(-1.0, 1.0, 128)
    differences = []
    for rng in range(4):
        heights = fc.surfaces.fbm((128, 128), 1e-4, hurst=0.3, rms_increment=1e-6, rng=rng).values
        lines = heights if axis == "rows" else heights.T
        lines = lines - np.polynomial.polynomial.polyval(
            place, np.polynomial.polynomial.polyfit(place, lines.T, order)
        )
        levelled = lines if axis == "rows" else lines.T
        result = fc.dimensions.estimate(levelled, spacing=1e-4).isel(method=0)
        assert f"the {axis} were levelled" in result.hurst.attrs["comment"]
        alone = fc.dimensions.estimate(heights, spacing=1e-4).isel(method=0)
        assert "levelled" not in alone.hurst.attrs["comment"]
        differences.append(float(result.hurst - alone.hurst))
    assert np.mean(differences) == pytest.approx(0.0, abs=0.004)


def test_profile_with_slow_roll_off_holds_its_exponent():
    """A Markov profile, sampled exactly: its covariance exp(-q_0 r) is Matern's of H = 1/2."""
    rng, decay = np.random.default_rng(3), float(np.exp(-2.0 * np.pi / 16.0))
    heights = [rng.standard_normal()]
    for jump in rng.standard_normal(255):
        heights.append(decay * heights[-1] + np.sqrt(1.0 - decay**2) * jump)
    profile = fc.surfaces.from_array(1e-6 * np.array(heights), 1e-4)
    result = fc.dimensions.estimate(profile).isel(method=0)
    assert result.ci_low < 0.5 < result.ci_high


def test_window_across_a_corner_names_both_exponents():
    """Exponent 0.3 below waves of 32 spacings, 0.9 beyond."""
    wave = np.abs(np.fft.fftfreq(32768)) * 8 * 32.0
    wave[0] = np.inf
    amplitude = np.where(wave > 1.0, wave**-0.8, wave**-1.4)
    white = np.fft.fft(np.random.default_rng(2).standard_normal(32768))
    heights = np.fft.ifft(white * amplitude).real[:16384:8]
    profile = fc.surfaces.from_array(1e-6 * heights, 1e-4)
    result = fc.dimensions.estimate(profile, scales=(4e-4, 5e-2)).isel(method=0)
    assert "within the scales" in json.loads(result.hurst.attrs["comment"])["default"]
    assert result.ci_low < 0.3
    assert result.ci_high > 0.9
