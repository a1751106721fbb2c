"""Single waves: found, named and removed; false alarms on surfaces without them; marks in `estimate`."""

import re

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.ndimage import gaussian_filter
from scipy.optimize import brentq
from scipy.special import j0

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput

SPACING = 1e-5
STEP = 1e-7


def brownian(shape, hurst, seed):
    return fc.surfaces.fbm(shape, SPACING, hurst=hurst, rms_increment=STEP, rng=seed)


def marks(surface, azimuth, wavelength, amplitude, phase=0.7):
    """Return a cosine; azimuth in degrees, wavelength in spacings, amplitude in rms increments."""
    angle = np.radians(azimuth)
    along = surface.x * np.cos(angle) + (surface.y * np.sin(angle) if "y" in surface.dims else 0.0)
    phases = (0.0 * surface + along).values * (2 * np.pi / (wavelength * SPACING))
    return amplitude * STEP * np.cos(phases + phase)


def order(found, wavelength, azimuth, shape):
    """Return which multiple of a wave each of some waves is, at its alias, and how many modes off at most."""
    angles = np.radians(found.wave_azimuth.values)
    cycles = np.stack([np.sin(angles), np.cos(angles)], axis=1) * SPACING / found.wavelength.values[:, None]
    base = np.array([np.sin(np.radians(azimuth)), np.cos(np.radians(azimuth))]) / wavelength
    multiples = np.arange(1, 100)[:, None] * base
    both = np.stack([cycles[:, None] - multiples, -cycles[:, None] - multiples])
    apart = np.abs((both - np.rint(both)) * shape).max(axis=-1).min(axis=0)
    return 1 + apart.argmin(axis=1), apart.min(axis=1).max()


@pytest.mark.parametrize(("azimuth", "wavelength"), [(30.0, 6.3), (90.0, 5.0), (151.0, 9.1), (0.0, 3.2)])
@pytest.mark.parametrize("shape", [(128, 128), (100, 150)])
def test_wave_is_named(azimuth, wavelength, shape):
    surface = brownian(shape, 0.5, 1)
    result = fc.dimensions.waves(surface + marks(surface, azimuth, wavelength, 2.0))
    assert result.sizes["wave"] == 1
    assert float(result.wavelength[0]) == pytest.approx(wavelength * SPACING, rel=5e-3)
    turned = (float(result.wave_azimuth[0]) - azimuth + 90.0) % 180.0 - 90.0
    assert abs(turned) < 0.5
    assert float(result.wave_amplitude[0]) == pytest.approx(2.0 * STEP, rel=0.1)
    assert float(result.wave_p_value[0]) < 1e-6


def test_pure_waves_are_exact():
    surface = 0.0 * brownian((96, 128), 0.5, 1)
    noise = 1e-2 * STEP * np.random.default_rng(1).standard_normal(surface.shape)
    both = surface + noise + marks(surface, 20.0, 7.3, 3.0) + marks(surface, 110.0, 4.4, 1.0)
    result = fc.dimensions.waves(both)
    assert result.wave.values.tolist() == [0, 1]
    assert result.wavelength.values / SPACING == pytest.approx([7.3, 4.4], rel=1e-4)
    assert result.wave_azimuth.values == pytest.approx([20.0, 110.0], abs=0.02)
    assert result.wave_amplitude.values / STEP == pytest.approx([3.0, 1.0], rel=1e-3)


def test_periodic_surface_and_profile():
    surface = fc.surfaces.spectral((96, 96), SPACING, hurst=0.7, rms_height=STEP, rng=2)
    assert fc.dimensions.waves(surface).sizes["wave"] == 0
    amplitude = 0.3
    result = fc.dimensions.waves(surface + marks(surface, 0.0, 8.0, amplitude))
    assert float(result.wavelength[0]) == pytest.approx(8.0 * SPACING, rel=1e-12)
    assert float(result.wave_amplitude[0]) == pytest.approx(amplitude * STEP, rel=0.1)
    profile = brownian((1024,), 0.3, 3)
    result = fc.dimensions.waves(profile + marks(profile, 0.0, 11.0, 2.0))
    assert float(result.wavelength[0]) == pytest.approx(11.0 * SPACING, rel=1e-3)
    assert float(result.wave_azimuth[0]) == 0.0


def blurred(seed):
    return gaussian_filter(brownian((128, 128), 0.5, seed).values, 2.5)


def anisotropic(seed):
    return fc.surfaces.spectral(
        (160, 160), SPACING, hurst=0.7, rms_height=STEP, anisotropy_ratio=4.0, direction=30.0, rng=seed
    ).values[:128, :128]


@pytest.mark.parametrize(
    "heights",
    [
        pytest.param(lambda seed: brownian((128, 128), 0.2, seed).values, id="rough"),
        pytest.param(lambda seed: brownian((128, 128), 0.9, seed).values, id="smooth"),
        pytest.param(blurred, id="blurred"),
        pytest.param(anisotropic, id="lay"),
        pytest.param(lambda seed: np.round(brownian((96, 96), 0.5, seed) / STEP).values, id="rounded"),
        pytest.param(lambda seed: brownian((2048,), 0.4, seed).values, id="profile"),
    ],
)
def test_no_wave_where_there_is_none(heights):
    for seed in range(6):
        assert fc.dimensions.waves(fc.surfaces.from_array(heights(seed), SPACING)).sizes["wave"] == 0


@pytest.mark.parametrize("ratio", [1.0, 3.0])
def test_band_limited_surface_has_no_wave(ratio):
    for seed in range(6):
        surface = fc.surfaces.spectral(
            (128, 128), SPACING, hurst=0.7, rms_height=STEP, rolloff=30 * SPACING, short_cutoff=5 * SPACING,
            anisotropy_ratio=ratio, direction=30.0, rng=seed,
        )  # fmt: skip
        assert fc.dimensions.waves(surface).sizes["wave"] == 0


def test_invariances():
    surface = brownian((96, 128), 0.6, 4)
    marked = surface + marks(surface, 40.0, 6.0, 1.0)
    first = fc.dimensions.waves(marked)
    scaled = fc.dimensions.waves(fc.surfaces.from_array(2.0**20 * marked.values + 1.0, 2.0**10 * SPACING))
    assert scaled.wavelength.values == pytest.approx(2.0**10 * first.wavelength.values, rel=1e-9)
    assert scaled.wave_amplitude.values == pytest.approx(2.0**20 * first.wave_amplitude.values, rel=1e-9)
    turned = fc.dimensions.waves(fc.surfaces.from_array(marked.values.T, SPACING))
    assert float(turned.wave_azimuth[0]) == pytest.approx(90.0 - float(first.wave_azimuth[0]), abs=1e-3)


def test_stack_is_padded():
    surface = brownian((96, 96), 0.5, 5)
    stack = fc.dimensions.waves(
        fc.surfaces.from_array(
            np.stack([surface.values, (surface + marks(surface, 30.0, 5.0, 2.0)).values]), SPACING
        )
    )
    assert stack.wavelength.dims[-1] == "wave"
    assert np.isnan(stack.wavelength.values[0]).all()
    assert np.isfinite(stack.wavelength.values[1]).all()


def test_gaps_are_refused():
    surface = brownian((32, 32), 0.5, 6)
    surface[3, 3] = np.nan
    with pytest.raises(InvalidInput, match="surface"):
        fc.dimensions.waves(surface)


@pytest.mark.parametrize("amplitude", [1.0, 10.0])
def test_marks_do_not_change_the_estimate(amplitude):
    surface = brownian((128, 128), 0.7, 10)
    alone = fc.dimensions.estimate(surface)
    marked = fc.dimensions.estimate(surface + marks(surface, 25.0, 7.0, amplitude))
    assert float(marked.hurst[0]) == pytest.approx(float(alone.hurst[0]), abs=0.006)
    width = [float(each.ci_high[0] - each.ci_low[0]) for each in (marked, alone)]
    assert width[0] == pytest.approx(width[1], rel=0.1)
    assert "a single wave removed: " in str(marked.note.values)
    assert "removed" not in str(alone.note.values)


def test_cusps_of_a_turned_surface_are_found_with_their_multiples():
    """Parabolic cusps: the k-th of their waves has the amplitude 4 / (pi k)^2 times their height."""
    numbers, errors = [], []
    for seed in range(2):
        surface = brownian((192, 192), 0.6, 40 + seed)
        angle = np.radians(12.0)
        along = (surface.x * np.cos(angle) + surface.y * np.sin(angle)) / (17.0 * SPACING)
        cusps = surface + (3.0 * STEP * 4.0 * ((along + 0.13) % 1.0 - 0.5) ** 2).transpose("y", "x")
        found = fc.dimensions.waves(cusps)
        multiples, apart = order(found, 17.0, 12.0, surface.shape)
        assert apart < 0.5
        expected = 3.0 * STEP * 4.0 / (np.pi * multiples) ** 2
        np.testing.assert_allclose(found.wave_amplitude, expected, atol=0.25 * STEP)
        numbers.append(found.sizes["wave"])
        alone, marked = (float(fc.dimensions.estimate(each).hurst[0]) for each in (surface, cusps))
        errors.append(marked - alone)
    assert min(numbers) >= 2
    assert abs(np.mean(errors)) < 0.012


def test_marks_on_profiles_and_periodic_surfaces():
    profile = brownian((1024,), 0.5, 20)
    marked = fc.dimensions.estimate(profile + marks(profile, 0.0, 9.0, 5.0))
    assert float(marked.hurst[0]) == pytest.approx(float(fc.dimensions.estimate(profile).hurst[0]), abs=0.02)
    surface = fc.surfaces.spectral((128, 128), SPACING, hurst=0.7, rms_height=STEP, rng=21)
    marked = fc.dimensions.estimate(surface + marks(surface, 0.0, 8.0, 1.0))
    assert float(marked.hurst[0]) == pytest.approx(float(fc.dimensions.estimate(surface).hurst[0]), abs=0.01)


def test_long_wave_of_a_profile_is_found():
    """8.4 waves in the profile; the exponent with it would be 0.1 too high."""
    for seed in range(2):
        profile = brownian((512,), 0.5, 60 + seed)
        marked = profile + marks(profile, 0.0, 61.0, 40.0)
        found = fc.dimensions.waves(marked)
        assert found.wavelength.values == pytest.approx([61 * SPACING], rel=0.01)
        alone, removed = (float(fc.dimensions.estimate(each).hurst[0]) for each in (profile, marked))
        assert removed == pytest.approx(alone, abs=0.04)


def limiting_amplitude(shape, hurst, wavelength):
    """Return the amplitude in rms increments at which half of the waves would be found without a taper.

    The power of the sine over the aliased density S of the surface, a^2 N / (4 S), is the logarithm of the
    places that are searched over the false alarm, with (pi u / 3)^(1/2) maxima a place along each axis.
    """
    axes, n = len(shape), min(shape)
    wavenumber = 2 * np.pi / wavelength
    if axes == 2:
        scale = quad(lambda q: (1 - j0(q)) * q ** (-1 - 2 * hurst), 0, 500, limit=3000)[0]
        azimuths = np.pi * np.arange(32) / 32
        waves = wavenumber * np.sin(azimuths), wavenumber * np.cos(azimuths)
        shifts = 2 * np.pi * np.arange(-6, 7)
        squares = (waves[0] + shifts[:, None, None]) ** 2 + (waves[1] + shifts[:, None]) ** 2
        density = np.pi / scale * np.mean(np.sum(squares ** (-1 - hurst), axis=(0, 1)))
    else:
        scale = quad(lambda q: (1 - np.cos(q)) * q ** (-1 - 2 * hurst), 0, 500, limit=3000)[0]
        shifts = 2 * np.pi * np.arange(-200, 201)
        density = np.pi / 2 / scale * np.sum(np.abs(wavenumber + shifts) ** (-1 - 2 * hurst))
    octaves = np.log(n / 2.05 / (4.0 if axes == 2 else 7.0))
    places = octaves * (np.pi * (n / wavelength) ** 2 if axes == 2 else n / wavelength)
    power = brentq(lambda u: u - np.log(places / 1e-3) - axes / 2 * np.log(np.pi * u / 3), 5.0, 40.0)
    return 2 * np.sqrt(power * density / np.prod(shape))


@pytest.mark.parametrize(
    ("shape", "hurst", "wavelength"), [((128, 128), 0.3, 6.6), ((96, 96), 0.8, 9.3), ((1024,), 0.5, 11.0)]
)
def test_limit_of_detection_is_twice_that_of_the_best_test(shape, hurst, wavelength):
    limit = limiting_amplitude(shape, hurst, wavelength)
    shares = []
    for factor in (0.9, 3.0):  # half of them at 1.5: the taper hides power, and lines and boxes are compared
        found = []
        for seed in range(16):
            surface = brownian(shape, hurst, 200 + seed)
            azimuth = 11.0 * seed if len(shape) == 2 else 0.0
            marked = surface + marks(surface, azimuth, wavelength, factor * limit)
            wavelengths = fc.dimensions.waves(marked).wavelength.values / SPACING
            found.append(np.any(np.abs(wavelengths / wavelength - 1) < 0.03))
        shares.append(np.mean(found))
    assert shares[0] <= 0.2
    assert shares[1] >= 0.8


@pytest.mark.parametrize("seeds", [1, pytest.param(3, marks=pytest.mark.slow)])
def test_fifth_of_an_increment_is_found_named_and_excluded(seeds):
    for seed in range(seeds):
        surface = brownian((256, 256), 0.5, 300 + seed)
        azimuth = 20.0 + 50.0 * seed
        marked = surface + marks(surface, azimuth, 5.3, 0.2)
        found = fc.dimensions.waves(marked)
        assert found.wavelength.values / SPACING == pytest.approx([5.3], rel=5e-3)
        assert found.wave_azimuth.values == pytest.approx([azimuth], abs=0.5)
        assert found.wave_amplitude.values / STEP == pytest.approx([0.2], rel=0.2)
        alone, removed = (fc.dimensions.estimate(each) for each in (surface, marked))
        assert float(removed.hurst[0]) == pytest.approx(float(alone.hurst[0]), abs=4e-4)
        assert re.search(r"a single wave removed: 5[23]\.?\d? µm at", str(removed.note.values))


def test_note_has_the_units_of_the_other_notes():
    """A wave along x; its azimuth is 0 or 180 degrees, whichever rounding gives."""
    heights = 2e-6 * np.sin(2 * np.pi * np.arange(200) / 20) + np.random.default_rng(1).normal(
        0, 5e-8, (200, 200)
    )
    note = str(fc.dimensions.estimate(fc.surfaces.from_array(heights, 5e-6)).note.values)
    assert "a single wave removed: 100 µm at 0 degrees with the amplitude 2 µm" in note


def test_multiples_and_crossed_marks():
    surface = brownian((128, 128), 0.8, 77)
    crossed = surface + marks(surface, 33.0, 6.1, 0.3) + marks(surface, 118.0, 5.2, 0.3)
    assert sorted(fc.dimensions.waves(crossed).wavelength.values / SPACING) == pytest.approx(
        [5.2, 6.1], rel=0.01
    )
    angle = np.radians(27.0)
    along = (surface.x * np.cos(angle) + surface.y * np.sin(angle)) / (19.0 * SPACING)
    sawtooth = surface + (1.2 * STEP * (2.0 * ((along + 0.3) % 1.0) - 1.0)).transpose("y", "x")
    multiples, apart = order(fc.dimensions.waves(sawtooth), 19.0, 27.0, surface.shape)
    assert len(multiples) >= 5
    assert apart < 0.5


@pytest.mark.parametrize("seeds", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_sawtooth_is_named_with_its_multiples(seeds):
    errors = []
    for seed in range(seeds):
        surface = brownian((128, 128), 0.5, 500 + seed)
        angle = np.radians(20.0 + 40.0 * seed)
        along = (surface.x * np.cos(angle) + surface.y * np.sin(angle)) / (13.7 * SPACING)
        sawtooth = surface + (2.0 * STEP * (2.0 * ((along + 0.3) % 1.0) - 1.0)).transpose("y", "x")
        alone, removed = (fc.dimensions.estimate(each) for each in (surface, sawtooth))
        comment = str(removed.note.values)
        named = re.search(r"removed: 13[67] µm at (\d+) degrees .*? and (\d+) of its", comment)
        assert abs(int(named[1]) - np.degrees(angle)) <= 1.0
        assert int(named[2]) >= 8
        errors.append(float(removed.hurst[0] - alone.hurst[0]))
    assert max(map(abs, errors)) < 0.04


def test_alternating_columns_are_one_wave():
    """Once three waves of twice the amplitude, of which one was left."""
    surface = brownian((96, 128), 0.5, 5)
    columns = surface + 0.8 * STEP * (-1.0) ** np.arange(128)
    found = fc.dimensions.waves(columns)
    assert found.wavelength.values / SPACING == pytest.approx([2.0], rel=1e-3)
    assert found.wave_amplitude.values / STEP == pytest.approx([0.8], rel=0.05)
    alone, removed = (float(fc.dimensions.estimate(each).hurst[0]) for each in (surface, columns))
    assert removed == pytest.approx(alone, abs=2e-3)


def test_offset_rows_and_a_narrow_band_are_no_waves():
    """Once a wave in 10 of 40 narrow bands, and in 5 to 30 % of surfaces whose rows are offset."""
    wrong = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        offset = brownian((96, 96), 0.5, seed) + 0.5 * STEP * np.cumsum(rng.normal(size=(96, 1)), axis=0)
        white = np.fft.rfft2(rng.normal(size=(192, 192)))
        wavenumber = np.hypot(np.fft.fftfreq(192)[:, None], np.fft.rfftfreq(192))
        band = np.fft.irfft2(white * (abs(wavenumber - 0.1) < 0.01))[:96, :96]
        band = band / np.diff(band).std() + 0.3 * rng.normal(size=(96, 96))
        wrong += [fc.dimensions.waves(offset).sizes["wave"] > 0]
        wrong += [fc.dimensions.waves(fc.surfaces.from_array(STEP * band, SPACING)).sizes["wave"] > 0]
    assert sum(wrong) == 0


def drawn_ridges(seed):
    """A profile along one direction, to the next point: its spectrum is a ray, folded at two spacings."""
    y, x = np.mgrid[:128, :128]
    across = x * np.cos(0.3 * seed) + y * np.sin(0.3 * seed)
    return (
        brownian((128, 128), 0.5, seed)
        + 2.0 * brownian((400,), 0.5, 1000 + seed).values[np.clip((across + 150).astype(int), 0, 399)]
    )


def random_ridges(seed):
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:128, :128]
    azimuth = rng.uniform(0.0, np.pi)
    across = x * np.cos(azimuth) + y * np.sin(azimuth)
    places = rng.uniform(-128.0, 192.0, rng.integers(10, 80))
    ridges = sum(np.exp(-0.5 * ((across - place) / 2.0) ** 2) for place in places)
    return brownian((128, 128), 0.5, seed) + 3.0 * STEP * ridges


@pytest.mark.parametrize("seeds", [4, pytest.param(9, marks=pytest.mark.slow)])
def test_ridges_are_no_waves(seeds):
    """Without lines in the test, waves in 33 of 40 surfaces with drawn ridges; with them in 7 of 80."""
    surfaces = [*map(drawn_ridges, range(seeds)), *map(random_ridges, range(seeds))]
    assert sum(fc.dimensions.waves(surface).sizes["wave"] > 0 for surface in surfaces) <= seeds // 3


@pytest.mark.parametrize("points", [np.repeat(np.arange(48), 2), np.rint(np.arange(96) / 1.7).astype(int)])
def test_repeated_points_are_no_waves(points):
    """Once a wave of two spacings in 25 of 40 surfaces."""
    heights = brownian((96, 96), 0.7, 3).values
    for repeated in (heights[np.ix_(points, points)], heights[points], heights[0, points]):
        surface = fc.surfaces.from_array(repeated, SPACING)
        assert fc.dimensions.waves(surface).sizes["wave"] == 0
        result = fc.dimensions.estimate(surface)
        assert np.isnan(result.ci_low[0])
        assert "repeat their neighbours" in str(result.reason.values)
    rounded = fc.surfaces.from_array(np.round(heights / STEP), SPACING)
    assert np.isfinite(fc.dimensions.estimate(rounded).ci_low[0])


@pytest.mark.filterwarnings("error")
def test_shortest_profile_gives_no_warning():
    for seed in range(12):
        assert fc.dimensions.waves(brownian((16,), 0.3 + 0.1 * (seed % 5), seed)).sizes["wave"] == 0


def test_wave_along_one_axis_alone_is_the_surface():
    """Its rows are constant: no increment along them may be divided by."""
    wave = np.cos(2.0 * np.pi * 0.21 * np.arange(64))
    for heights in (np.tile(wave[:, None], (1, 48)), np.tile(wave, (48, 1))):
        found = fc.dimensions.waves(fc.surfaces.from_array(STEP * heights, SPACING))
        assert found.wavelength.values[0] == pytest.approx(SPACING / 0.21, rel=1e-3)
        result = fc.dimensions.estimate(fc.surfaces.from_array(STEP * heights, SPACING))
        assert str(result.reason.values[0]) or np.isfinite(float(result.ci_low[0]))


def test_sum_of_waves_is_left_alone():
    surface = fc.surfaces.weierstrass((1024,), SPACING, hurst=0.5, rms_height=STEP)
    assert "removed" not in str(fc.dimensions.estimate(surface).note.values)


@pytest.mark.slow
def test_false_alarm_is_one_in_a_thousand():
    number = sum(
        fc.dimensions.waves(brownian(shape, hurst, seed)).sizes["wave"] > 0
        for shape in ((64, 64), (128, 128), (512,))
        for hurst in (0.2, 0.5, 0.9)
        for seed in range(400)
    )
    assert number <= 10  # of 3600


@pytest.mark.slow
@pytest.mark.parametrize("hurst", [0.3, 0.7])
def test_coverage_with_marks(hurst):
    rng = np.random.default_rng(7)
    inside = []
    for seed in range(200):
        surface = brownian((128, 128), hurst, 1000 + seed)
        wave = marks(surface, rng.uniform(5, 85), rng.uniform(4, 12), 10 ** rng.uniform(-1, 0.5))
        result = fc.dimensions.estimate(surface + wave)
        inside.append(float(result.ci_low[0]) <= hurst <= float(result.ci_high[0]))
    assert np.mean(inside) >= 0.9
