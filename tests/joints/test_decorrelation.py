"""Decorrelation: exact sums, known lengths, coverage of the interval."""

import numpy as np
import pytest

import fractalcontact as fc

MATERIAL = {"young": 30e9, "poisson": 0.2}


def correlated(n, length, seed, spectrum="exponential"):
    """Return a periodic Gaussian face and the shear at which its correlation has fallen to 1/e."""
    q = np.hypot(2 * np.pi * np.fft.fftfreq(n)[:, None], 2 * np.pi * np.fft.rfftfreq(n)[None, :])
    density = {
        "exponential": (1 + (q * length) ** 2) ** -1.5,
        "gaussian": np.exp(-((q * length) ** 2) / 4),
        "rolled off": (1 + (q * length) ** 2) ** -1.8,
    }[spectrum]
    correlation = np.fft.irfft2(density, (n, n))[0, : n // 2]
    correlation = correlation / correlation[0] - np.exp(-1)
    k = int(np.argmax(correlation < 0))
    length_at_1_e = k - 1 + correlation[k - 1] / (correlation[k - 1] - correlation[k])
    noise = np.fft.rfft2(np.random.default_rng(seed).standard_normal((n, n)))
    return np.fft.irfft2(noise * np.sqrt(density), (n, n)), length_at_1_e


def test_periodic_correlation_is_the_autocovariance(make_face, rough):
    heights = rough((32, 48), 0) + 7.0
    crack = fc.joints.Crack(make_face(heights, periodic=True), **MATERIAL)
    result = fc.joints.decorrelation_length(crack, shear=np.arange(10.0))
    z = heights - heights.mean()
    power = np.fft.ifft2(np.abs(np.fft.fft2(z)) ** 2).real / z.size
    np.testing.assert_allclose(result.correlation.sel(direction="E"), power[0, :10] / power[0, 0], atol=1e-13)
    np.testing.assert_allclose(result.correlation.sel(direction="S"), power[:10, 0] / power[0, 0], atol=1e-13)
    variance = 2 * (power[0, 0] - power[0, :10])
    np.testing.assert_allclose(result.structure_function.sel(direction="W"), variance, atol=1e-12)


def test_a_tilt_across_a_periodic_axis_changes_nothing(make_face):
    heights, slope = correlated(64, 3.0, 1)[0], 0.5 * np.arange(64)
    level, tilted = (
        fc.joints.decorrelation_length(
            fc.joints.Crack(make_face(face, periodic=(True, False)), block=(64, 32), **MATERIAL),
            direction="E",
            shear=np.arange(10.0),
        )
        for face in (heights, heights + slope)
    )
    np.testing.assert_allclose(tilted.correlation, level.correlation, atol=1e-12)
    assert tilted.decorrelation_length.item() == pytest.approx(level.decorrelation_length.item(), rel=1e-9)


@pytest.mark.parametrize("alone", ["E", "N"])
def test_a_length_does_not_depend_on_the_directions_beside_it(make_face, alone):
    heights = correlated(96, 3.0, 2)[0][:40]
    crack = fc.joints.Crack(make_face(heights), block=32, **MATERIAL)
    together = fc.joints.decorrelation_length(crack, direction=["E", "N"])
    one = fc.joints.decorrelation_length(crack, direction=alone).squeeze()
    ours = together.sel(direction=alone)
    np.testing.assert_array_equal(ours.decorrelation_length, one.decorrelation_length)
    np.testing.assert_allclose(ours.correlation.sel(shear=one.shear), one.correlation, atol=1e-12)
    # the block travels by 32 cells towards E and by 4 towards N
    assert np.isfinite(together.correlation.sel(direction="E")).sum() == 33
    assert np.isfinite(together.correlation.sel(direction="N")).sum() == 5


def test_a_short_periodic_edge_does_not_limit_the_shears_along_the_long_one(make_face):
    heights = correlated(512, 3.0, 3)[0][:20]
    strip = fc.joints.Crack(make_face(heights, periodic=True), **MATERIAL)
    length = fc.joints.decorrelation_length(strip, direction="E").decorrelation_length.item()
    centred = heights - heights.mean()
    power = np.fft.irfft((np.abs(np.fft.rfft(centred, axis=1)) ** 2).sum(axis=0))[:256]
    k = int(np.argmax(power < power[0] * np.exp(-1)))
    assert k - 1 <= length <= k


def test_block_sums_on_a_free_face(make_face, rough):
    lower, upper = rough((40, 36), 1), rough((40, 36), 2)
    y, x = np.indices(lower.shape)
    design = np.stack([np.ones(lower.size), y.ravel(), x.ravel()], axis=1)
    flat = [
        (z.ravel() - design @ np.linalg.lstsq(design, z.ravel(), rcond=None)[0]).reshape(z.shape)
        for z in (lower, upper)
    ]
    crack = fc.joints.Crack(make_face(lower + 0.3 * x), make_face(upper - y), block=20, **MATERIAL)
    result = fc.joints.decorrelation_length(crack, shear=[0.0, 3.0], direction="N")
    (ay, ax), (by, bx) = crack.layout.start, crack.layout.cells
    under, own = flat[0][ay + 3 : ay + 3 + by, ax : ax + bx], flat[1][ay : ay + by, ax : ax + bx]
    expected = (under * own).sum() / np.sqrt((under**2).sum() * (own**2).sum())
    assert result.correlation.sel(shear=3.0).item() == pytest.approx(expected, rel=1e-9)


def test_correlation_of_mated_faces_starts_at_one(make_face, rough):
    crack = fc.joints.Crack(make_face(rough((64, 64), 3)), block=20, **MATERIAL)
    result = fc.joints.decorrelation_length(crack)
    np.testing.assert_allclose(result.correlation.sel(shear=0), 1, rtol=1e-14)
    np.testing.assert_array_equal(result.structure_function.sel(shear=0), 0)
    assert result.shear[-1] == crack.travel("E")
    assert result.shear.size == 23


def test_faces_that_do_not_match_are_not_called_correlated(make_face, rough):
    heights = rough((48, 48), 3)
    crack = fc.joints.Crack(make_face(heights), make_face(-heights), block=20, **MATERIAL)
    result = fc.joints.decorrelation_length(crack, direction="E")
    assert result.correlation[0, 0] < -0.99
    assert result.missing_reason.item() == "the faces are not correlated at no shear"


def test_structure_function_is_that_of_the_heights_from_both_mean_planes(make_face, rough):
    heights = rough((48, 48), 3)
    tilted = make_face(heights + 0.5 * np.arange(48))
    result = fc.joints.decorrelation_length(
        fc.joints.Crack(make_face(heights), tilted, block=20, **MATERIAL), direction="E", shear=[0.0, 3.0]
    )
    mated = fc.joints.Crack(make_face(heights), block=20, **MATERIAL)
    variance = fc.joints.delta_surface(mated, [0.0, 3.0], "E").var(("y", "x"))
    np.testing.assert_allclose(result.structure_function[0], variance, atol=1e-12)
    assert result.structure_function.attrs["long_name"].startswith("variance of the difference")


def test_length_of_a_wave(make_face):
    # correlation cos(kv): 1/e at v = acos(1/e)/k
    x = np.arange(240)
    face = make_face(np.broadcast_to(np.cos(2 * np.pi * x / 80), (240, 240)), periodic=True)
    crack = fc.joints.Crack(face, **MATERIAL)
    result = fc.joints.decorrelation_length(crack, direction=("E", "N"))
    expected = np.arccos(np.exp(-1)) * 80 / (2 * np.pi)
    assert result.decorrelation_length.sel(direction="E") == pytest.approx(expected, abs=5e-3)
    # along its crests a wave stays correlated
    assert np.isnan(result.decorrelation_length.sel(direction="N"))
    assert "still correlated" in result.missing_reason.sel(direction="N").item()


def test_known_length_with_its_interval(make_face):
    heights, expected = correlated(512, 3.0, 1)
    crack = fc.joints.Crack(make_face(heights[:300, :300] * 1e-6, 1e-4), block=0.0128, **MATERIAL)
    result = fc.joints.decorrelation_length(crack)
    assert (result.decorrelation_length_low < result.decorrelation_length).all()
    assert (result.decorrelation_length < result.decorrelation_length_high).all()
    assert result.decorrelation_length.mean() == pytest.approx(expected * 1e-4, rel=0.15)
    assert (result.missing_reason == "").all()
    assert result.decorrelation_length.attrs["units"] == "m"


def test_no_interval_for_a_small_block(make_face):
    heights, _ = correlated(512, 12.0, 1)
    crack = fc.joints.Crack(make_face(heights[:300, :300]), block=128, **MATERIAL)
    result = fc.joints.decorrelation_length(crack, direction="E")
    assert np.isfinite(result.decorrelation_length)
    assert np.isnan(result.decorrelation_length_low)
    assert "15 lengths" in result.missing_reason.item()
    few = fc.joints.Crack(make_face(heights[:16, :16]), block=5, **MATERIAL)
    assert fc.joints.decorrelation_length(few, direction="E").correlation.shape == (1, 7)


@pytest.mark.parametrize("height", [0.0, 3.3, 1e9])
@pytest.mark.parametrize("slope", [0.0, 0.1])
def test_planes_have_no_length(make_face, height, slope):
    heights = height + slope * np.indices((20, 20))[1]
    crack = fc.joints.Crack(make_face(heights, 0.3), block=9 * 0.3, **MATERIAL)
    result = fc.joints.decorrelation_length(crack)
    assert np.isnan(result.decorrelation_length).all()
    assert (result.missing_reason == "the faces are planes").all()


def test_length_below_one_cell_has_no_interval(make_face):
    noise = np.random.default_rng(0).standard_normal((80, 80))
    result = fc.joints.decorrelation_length(fc.joints.Crack(make_face(noise), block=40, **MATERIAL))
    assert (result.decorrelation_length < 1).all()
    assert np.isnan(result.decorrelation_length_low).all()
    assert "below the first shear" in result.missing_reason[0].item()


def test_long_travel_is_sampled_in_geometric_steps(make_face, rough):
    crack = fc.joints.Crack(make_face(rough((400, 400), 1)), block=20, **MATERIAL)
    shear = fc.joints.decorrelation_length(crack, direction="E").shear.values
    assert shear.size <= 129
    assert shear[0] == 0
    assert shear[-1] == 190
    assert (shear == np.rint(shear)).all()


def test_units_change_nothing(make_face, rough):
    heights = rough((96, 96), 1)
    crack = fc.joints.Crack(make_face(heights), block=40, **MATERIAL)
    scaled = fc.joints.Crack(make_face(heights * 2.0**-30, 2.0**-14), block=40 * 2.0**-14, **MATERIAL)
    result, result_scaled = fc.joints.decorrelation_length(crack), fc.joints.decorrelation_length(scaled)
    np.testing.assert_array_equal(result.correlation, result_scaled.correlation.values)
    np.testing.assert_array_equal(result.decorrelation_length * 2.0**-14, result_scaled.decorrelation_length)


def test_invalid_arguments_are_refused(make_face, rough):
    full = fc.joints.Crack(make_face(rough((32, 32), 1)), **MATERIAL)
    with pytest.raises(ValueError, match="smaller than its face"):
        fc.joints.decorrelation_length(full)
    crack = fc.joints.Crack(make_face(rough((32, 32), 1)), block=10, **MATERIAL)
    with pytest.raises(ValueError, match="ascending from 0"):
        fc.joints.decorrelation_length(crack, shear=[1.0, 2.0])
    with pytest.raises(ValueError, match="crack"):
        fc.joints.decorrelation_length(3)
    heights = rough((32, 32), 1)
    heights[15, 22] = np.nan
    incomplete = fc.joints.Crack(make_face(heights), block=10, **MATERIAL)
    with pytest.raises(ValueError, match="missing"):
        fc.joints.decorrelation_length(incomplete, direction="E")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("spectrum", "length"),
    [("exponential", 3.0), ("exponential", 6.0), ("gaussian", 6.0), ("rolled off", 4.0)],
)
def test_coverage_of_the_interval(make_face, spectrum, length):
    inside, total = 0, 0
    for seed in range(300):
        heights, expected = correlated(512, length, seed, spectrum)
        crack = fc.joints.Crack(make_face(heights[:256, :256]), block=128, **MATERIAL)
        result = fc.joints.decorrelation_length(crack, direction="E", shear=np.arange(40.0))
        if np.isfinite(result.decorrelation_length_low):
            total += 1
            inside += bool(result.decorrelation_length_low <= expected <= result.decorrelation_length_high)
    assert total > 250
    # two standard deviations of 300 draws are 2.5 %
    assert 0.925 <= inside / total <= 0.985
