"""Roughness by direction: against surfaces whose directions are known, and the size of the test."""

import numpy as np
import pytest
from scipy.stats import binom

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput
from fractalcontact.dimensions import _anisotropy, _second_differences
from fractalcontact.dimensions._surface_input import read_surfaces

SPACING = 1e-4


def brownian(n, hurst, seed, spacing=SPACING, **more):
    return fc.surfaces.fbm((n, n), spacing, hurst=hurst, rms_increment=1e-6, rng=seed, **more)


def stretched(n, seed, anisotropy_ratio=2.0, azimuth=30.0, hurst=0.6, thin=4, **more):
    """A stretched fractal with free edges: every fourth point out of the middle of a wider band."""
    whole = fc.surfaces.spectral(
        (2 * thin * n, 2 * thin * n), SPACING / thin, hurst=hurst, rms_height=1e-6,
        anisotropy_ratio=anisotropy_ratio, azimuth=azimuth, rng=seed, **more,
    )  # fmt: skip
    return fc.surfaces.from_array(whole.values[: thin * n : thin, : thin * n : thin], SPACING)


def profile(n, seed, hurst=0.7):
    return fc.surfaces.fbm(n, SPACING, hurst=hurst, rms_increment=1e-6, rng=seed).values


def turned(azimuth, other):
    """Angle between two directions without sense, degrees."""
    return abs((azimuth - other + 90.0) % 180.0 - 90.0)


def test_isotropic_surface_has_one_exponent_and_one_increment():
    found = fc.dimensions.directions(brownian(256, 0.7, 1))
    assert found["hurst"].dims == ("azimuth",)
    assert found["azimuth"].values[[0, 2, 4, 6]] == pytest.approx([0, 45, 90, 135])
    assert ((found["ci_low"] < 0.7) & (found["ci_high"] > 0.7)).all()
    assert found["rms_increment"].values == pytest.approx(1e-6, rel=0.03)
    topothesy = SPACING * (1e-6 / SPACING) ** (1 / 0.3)
    assert np.log(found["topothesy"].values) == pytest.approx(np.log(topothesy), rel=0.05)
    assert float(found["isotropy_p_value"]) > 0.01
    assert float(found["anisotropy_ratio_low"]) == 1.0


@pytest.mark.parametrize("free", [True, False])
def test_stretch_and_its_azimuth_are_found(free):
    if free:
        face = stretched(192, 3)
    else:
        face = fc.surfaces.spectral(
            (192, 192), SPACING, hurst=0.6, rms_height=1e-6, anisotropy_ratio=2.0, azimuth=30.0, rng=3
        )
    found = fc.dimensions.directions(face)
    assert float(found["isotropy_p_value"]) < 1e-6
    assert float(found["anisotropy_ratio_low"]) < 2.0 < float(found["anisotropy_ratio_high"]) + 0.1
    assert turned(float(found["anisotropy_azimuth"]), 30.0) < 2.0
    assert float(found["anisotropy_p_value"]) > 1e-3
    # the exponent is the same all round; heights change least along the anisotropy_ratio
    assert ((found["ci_low"] < 0.65) & (found["ci_high"] > 0.55)).all()
    least = float(found["azimuth"][int(np.argmin(found["rms_increment"].values))])
    assert turned(least, 30.0) < 23.0


def test_turning_the_face_turns_the_answer():
    face = stretched(128, 4, anisotropy_ratio=1.6, azimuth=20.0)
    other = fc.surfaces.from_array(np.ascontiguousarray(face.values.T), SPACING)
    one, two = (fc.dimensions.directions(each) for each in (face, other))
    assert turned(float(two["anisotropy_azimuth"]), 90.0 - float(one["anisotropy_azimuth"])) < 1e-6
    assert float(two["anisotropy_ratio"]) == pytest.approx(float(one["anisotropy_ratio"]), rel=1e-9)
    assert float(two["isotropy_p_value"]) == pytest.approx(float(one["isotropy_p_value"]), rel=1e-6)
    for azimuth in (0.0, 45.0, 90.0):
        pair = [
            one["hurst"].sel(azimuth=azimuth, method="nearest"),
            two["hurst"].sel(azimuth=(90.0 - azimuth) % 180.0, method="nearest"),
        ]
        assert float(pair[0]) == pytest.approx(float(pair[1]), rel=1e-9)


@pytest.mark.parametrize("size", [48, 160])
def test_striated_faces_are_told_from_isotropic_ones(size):
    x, y = profile(size, 5), profile(size, 6)
    noise = 1e-7 * np.random.default_rng(7).standard_normal((size, size))
    for heights in (x + noise, x + y[:, None] + noise, x + y[:, None]):
        found = fc.dimensions.directions(fc.surfaces.from_array(heights, SPACING))
        assert float(found["isotropy_p_value"]) < 1e-3
        if size > 100:
            assert "no model" in found["ci_low"].attrs["reason"]
            assert np.isnan(found["ci_low"]).all()


def test_ground_face_has_no_exponent_along_its_ridges():
    heights = np.broadcast_to(profile(96, 8), (96, 96))
    found = fc.dimensions.directions(fc.surfaces.from_array(heights, SPACING))
    assert np.flatnonzero(np.isnan(found["hurst"].values)).tolist() == [4]
    assert float(found["hurst"][0]) == pytest.approx(0.7, abs=0.15)
    assert "do not vary" in found["hurst"].attrs["reason"]
    assert float(found["isotropy_p_value"]) == 0.0


def test_ridges_in_noise_are_no_stretch():
    """A anisotropy_ratio as long as the face has no interval; the azimuth of the ridges remains."""
    noise = 1e-7 * np.random.default_rng(7).standard_normal((96, 96))
    found = fc.dimensions.directions(fc.surfaces.from_array(profile(96, 5)[:, None] + noise, SPACING))
    assert float(found["isotropy_p_value"]) < 1e-6
    assert np.isnan(found["anisotropy_ratio_high"])
    assert "ridges" in found["anisotropy_ratio"].attrs["reason"]
    assert turned(float(found["anisotropy_azimuth"]), 0.0) < 2.0
    assert np.isnan(found["ci_low"]).all()


@pytest.mark.parametrize("gaps", [False, True])
def test_smooth_isotropic_face_is_not_told_from_an_isotropic_one(gaps):
    """All waves longer than 30 spacings: what a taper lets through beyond them says nothing."""
    face = fc.surfaces.spectral((128, 128), SPACING, hurst=0.9, rms_height=1e-6, short_cutoff=3e-3, rng=1)
    heights = face.values[:100, :100].copy()
    if gaps:
        heights[np.random.default_rng(2).random(heights.shape) < 0.1] = np.nan
    found = fc.dimensions.directions(fc.surfaces.from_array(heights, SPACING))
    assert (found["hurst"] == 1.0).all()
    assert not float(found["isotropy_p_value"]) < 0.01
    assert "smoother" in found["anisotropy_ratio"].attrs["reason"]


def test_band_limited_face_with_gaps_has_a_wider_interval():
    """Waves end at the grid's shortest: the exponent changes with the lag, and directions do not differ."""
    face = fc.surfaces.spectral((256, 256), SPACING, hurst=0.6, rms_height=1e-6, rng=5)
    heights = np.where(np.random.default_rng(2).random((256, 256)) < 0.1, np.nan, face.values)
    found = fc.dimensions.directions(fc.surfaces.from_array(heights, SPACING))
    assert float(found["isotropy_p_value"]) > 0.01
    assert "changes with the lag" in found["hurst"].attrs["reason"]
    assert (found["ci_high"] - found["ci_low"] > 6 * found["standard_error"]).all()


def test_type_of_the_heights_and_their_level_change_nothing():
    face = brownian(64, 0.5, 1)
    whole = fc.dimensions.directions(face)["hurst"]
    scaled = [np.rint(face.values * 1e9).astype(np.int64), (face.values * 1e6).astype(np.float32)]
    for heights in (*scaled, face.values * 1e12 + 1e9, face.values * 1e-3):
        other = fc.dimensions.directions(face.copy(data=heights))["hurst"]
        assert other.values == pytest.approx(whole.values, abs=2e-4)


def test_two_exponents_are_more_than_a_stretch():
    face = fc.surfaces.spectral((192, 192), SPACING, hurst=(0.4, 0.8), rms_height=1e-6, rng=9)
    found = fc.dimensions.directions(face)
    assert float(found["isotropy_p_value"]) < 1e-6
    assert float(found["anisotropy_p_value"]) < 1e-6
    assert float(found["hurst"].sel(azimuth=0)) - float(found["hurst"].sel(azimuth=90)) > 0.3


def test_isotropic_spectrum_of_any_form_is_isotropic():
    """A plateau, a cut-off that no fractional Brownian face has, and the same face cut free."""
    face = fc.surfaces.spectral(
        (256, 256), SPACING, hurst=0.8, rms_height=1e-6, rolloff=4e-3, short_cutoff=6e-4, rng=10
    )
    for part in (face, face[:200, :180]):
        found = fc.dimensions.directions(part)
        assert float(found["isotropy_p_value"]) > 0.01
        assert float(found["anisotropy_p_value"]) > 0.01


def test_gaps_and_unequal_spacings():
    face = brownian(160, 0.4, 11, (2e-4, 1e-4))
    heights = face.values.copy()
    heights[np.random.default_rng(12).random(heights.shape) < 0.05] = np.nan
    heights[20:50, 60:100] = np.nan
    found = fc.dimensions.directions(face.copy(data=heights))
    assert ((found["ci_low"] - 0.02 < 0.4) & (found["ci_high"] + 0.02 > 0.4)).all()
    assert float(found["isotropy_p_value"]) > 0.01
    assert float(found["anisotropy_ratio_low"]) == 1.0


def test_asked_directions_are_those_of_the_lattice_nearest_to_them():
    face = brownian(64, 0.5, 13)
    found = fc.dimensions.directions(face, [210.0, 0.0, 90.0])
    assert found["azimuth"].values == pytest.approx([0.0, np.degrees(np.arctan2(3, 5)), 90.0])
    whole = fc.dimensions.directions(face)
    assert float(found["isotropy_p_value"]) == float(whole["isotropy_p_value"])
    assert float(found["hurst"].sel(azimuth=90)) == float(whole["hurst"].sel(azimuth=90))
    periodic = fc.surfaces.spectral((64, 64), SPACING, hurst=0.5, rms_height=1e-6, rng=14)
    assert fc.dimensions.directions(periodic, 33.0)["azimuth"].values.tolist() == [33.0]


def test_members_keep_their_dimension():
    faces = brownian(48, 0.5, 15, members=3)
    found = fc.dimensions.directions(faces)
    assert found["hurst"].dims == ("member", "azimuth")
    assert found["isotropy_p_value"].dims == ("member",)
    alone = fc.dimensions.directions(faces[1])
    assert np.array_equal(found["hurst"][1], alone["hurst"])


def test_units_change_nothing():
    face = brownian(64, 0.6, 16)
    one = fc.dimensions.directions(face)
    for factor in (2.0**40, 2.0**-40):
        other = fc.dimensions.directions(face.copy(data=face.values * factor))
        assert np.array_equal(one["hurst"], other["hurst"])
        assert float(one["isotropy_p_value"]) == float(other["isotropy_p_value"])
        assert np.array_equal(one["rms_increment"] * factor, other["rms_increment"])


def test_limits_and_refusals():
    flat = fc.dimensions.directions(fc.surfaces.from_array(np.full((20, 20), 3.0), SPACING))
    assert np.isnan(flat["hurst"]).all()
    assert "constant" in flat["hurst"].attrs["reason"]
    plane = fc.surfaces.from_array(np.broadcast_to(np.arange(20) * 1e-6, (20, 20)), SPACING)
    assert (fc.dimensions.directions(plane)["hurst"] == 1).all()
    white = fc.surfaces.from_array(np.random.default_rng(17).standard_normal((128, 128)), SPACING)
    found = fc.dimensions.directions(white)
    assert (found["hurst"] < 0.03).all()
    assert float(found["isotropy_p_value"]) > 0.001
    assert np.isnan(found["anisotropy_ratio"])
    periodic = fc.surfaces.from_array(white.values, SPACING, periodic=True)
    assert np.isnan(fc.dimensions.directions(periodic)["anisotropy_ratio"])
    with pytest.raises(InvalidInput, match="16"):
        fc.dimensions.directions(brownian(12, 0.5, 1))
    with pytest.raises(InvalidInput, match="dims"):
        fc.dimensions.directions(fc.surfaces.fbm(100, SPACING, hurst=0.5, rms_increment=1e-6, rng=1))
    with pytest.raises(InvalidInput) as caught:
        fc.dimensions.directions(brownian(32, 0.5, 1).transpose("x", "y"))
    assert len(caught.value.problems) == 1
    with pytest.raises(InvalidInput, match="nothing but NaN"):
        fc.dimensions.directions(white.where(False))
    with pytest.raises(InvalidInput, match="scales"):
        fc.dimensions.directions(brownian(32, 0.5, 1), scales=(1.0, 2.0))


@pytest.mark.parametrize(("hurst", "missing"), [(0.2, 0.0), (0.8, 0.0), (0.2, 0.2)])
def test_scatter_of_second_differences_is_the_one_expected(hurst, missing):
    """Over a thousand small faces: a variance of so many is known to 4.5 %."""
    n = 40
    rays = _second_differences.lattice_directions(None, (1.0, 1.0))[:4]
    vectors = np.array([(m * ray.dy, m * ray.dx) for ray in rays for m in (1, 2)])
    gone = np.random.default_rng(19).random((n, n)) < missing
    logs = []
    for heights in brownian(n, hurst, 18, members=1000).values:
        heights[gone] = np.nan
        means = []
        for dy, dx in vectors:
            middle, far = heights[dy : n - dy, dx : n - dx], heights[2 * dy :, 2 * dx :]
            means.append(np.nanmean((heights[: n - 2 * dy, : n - 2 * dx] - 2 * middle + far) ** 2))
        logs.append(np.log(means))
    face = fc.surfaces.from_array(np.where(gone, np.nan, 0.0) + np.arange(n) ** 2, SPACING)
    means, _ = _second_differences.SecondDifferences.of(read_surfaces(face)[0], rays, (0.0, 5e-4))
    own = means.part([np.flatnonzero((means.vectors == vector).all(axis=1))[0] for vector in vectors])
    pairs = _second_differences.MiddlePairs.of(face.values, missing == 0, own.vectors, own.numbers)
    expected = _second_differences.covariance(own.vectors, pairs, hurst, np.eye(2))
    found = np.cov(np.transpose(logs))
    assert np.diag(found) == pytest.approx(np.diag(expected), rel=0.17)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert found / scale == pytest.approx(expected / scale, abs=0.17)


def test_scatter_does_not_hang_on_where_the_sum_is_cut():
    """Shifts beyond those summed one by one, and the coarse lattice of long lags, against a longer sum."""
    vectors = np.array([(0, 2), (3, 4), (8, 0), (6, -6)])
    shape, form = (300, 200), _anisotropy.metric_of(0.3, -0.2)
    line = np.stack([np.ones(3), np.arange(3)], axis=1)  # a slope along one direction
    for hurst, error in ((0.1, 1e-3), (0.6, 5e-3), (0.95, 0.02)):
        found = _second_differences.covariance(vectors, _pairs(shape, vectors), hurst, form)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(_second_differences, "_REACH", 120)
            longer = _second_differences.covariance(vectors, _pairs(shape, vectors), hurst, form)
        assert found == pytest.approx(longer, rel=error, abs=error * longer.max())
        far = np.array([(0, 12), (0, 24), (0, 48)])
        coarse = _second_differences.covariance(far, _pairs(shape, far), hurst, form)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(_second_differences, "_LONG", 48)
            fine = _second_differences.covariance(far, _pairs(shape, far), hurst, form)
        errors = [np.linalg.inv(line.T @ np.linalg.solve(spread, line))[1, 1] for spread in (coarse, fine)]
        assert errors[0] == pytest.approx(errors[1], rel=0.06)


def _pairs(shape, vectors):
    """Those of a complete face."""
    return _second_differences.MiddlePairs(shape, np.prod(np.array(shape) - 2.0 * np.abs(vectors), axis=1))


@pytest.mark.slow
@pytest.mark.parametrize("hurst", [0.1, 0.5, 0.9])
@pytest.mark.parametrize("kind", ["free", "small", "gaps", "periodic"])
def test_size_of_the_test_and_coverage(kind, hurst):
    n, members = (48 if kind == "small" else 112), 400
    if kind == "periodic":
        faces = fc.surfaces.spectral(
            (n, n), SPACING, hurst=hurst, rms_height=1e-6, short_cutoff=4e-4, members=members, rng=20
        )
    else:
        faces = brownian(n, hurst, 20, members=members)
        if kind == "gaps":
            heights = faces.values.copy()
            heights[np.random.default_rng(21).random(heights.shape) < 0.1] = np.nan
            faces = faces.copy(data=heights)
    found = fc.dimensions.directions(faces)
    for name in ("isotropy_p_value", "anisotropy_p_value"):
        assert as_often((found[name] < 0.05).sum(), found[name].count(), 0.05).all()
    given = np.isfinite(found["anisotropy_ratio_low"])
    assert float(given.mean()) > 0.95  # not where the exponent is within three standard errors of none
    assert as_often((found["anisotropy_ratio_low"] == 1.0).where(given).sum(), given.sum(), 0.95).all()
    given = np.isfinite(found["ci_low"])
    assert float(given.mean()) > 0.98  # not where the test of a anisotropy_ratio is below .001
    covered = ((found["ci_low"] <= hurst) & (hurst <= found["ci_high"])).where(given).sum("member")
    # an exponent within two standard errors of 0 or 1 is covered more often: estimates end there
    limited = found["standard_error"].mean("member") > 0.5 * min(hurst, 1 - hurst)
    assert (as_often(covered, given.sum("member"), 0.95) | (limited & (covered > 0.95 * members))).all()


def as_often(count, trials, share):
    """Tell whether events came as often as their chance says.

    The bounds are those of the binomial distribution, so wide that chance alone breaks any of the 132 of the
    twelve cases (eight directions, two tests and one interval of the ratio in each) in one run of twenty.
    """
    risk = 0.05 / (12 * (8 + 2 + 1))
    low, high = (binom.ppf(chance, trials, share) for chance in (0.5 * risk, 1 - 0.5 * risk))
    return (low <= count) & (count <= high)


def test_pairs_of_middle_points_of_a_face_with_gaps_are_counted():
    heights = np.random.default_rng(22).standard_normal((20, 23))
    heights[np.random.default_rng(23).random(heights.shape) < 0.2] = np.nan
    vectors = np.array([(0, 1), (1, -2), (3, 2)])
    middles = [
        {
            (y, x)
            for y in range(dy, 20 - dy)
            for x in range(abs(dx), 23 - abs(dx))
            if np.isfinite([heights[y, x], heights[y - dy, x - dx], heights[y + dy, x + dx]]).all()
        }
        for dy, dx in vectors
    ]
    numbers = np.array([len(each) for each in middles])
    pairs = _second_differences.MiddlePairs.of(heights, False, vectors, numbers)
    for i, j in ((0, 0), (1, 0), (2, 1)):
        for y, x in ((0, 0), (0, 1), (1, -2), (3, 2), (4, 0), (2, -7)):
            expected = sum((a + y, b + x) in middles[i] for a, b in middles[j])
            assert pairs.counts[j][i - j, y, 24 + x] == pytest.approx(expected, abs=1e-3)


def test_gaps_in_a_pattern_are_no_lay():
    """Every second row and column of an isotropic face: shifts between its points are even."""
    face = brownian(96, 0.5, 24)
    found = fc.dimensions.directions(face.where((face.x / SPACING % 2 < 1) & (face.y / SPACING % 2 < 1)))
    assert float(found["isotropy_p_value"]) > 0.01
    assert ((found["ci_low"] - 0.05 < 0.5) & (found["ci_high"] + 0.05 > 0.5)).all()
