"""Fractional Brownian surfaces: covariance, shape, units, streams, labels."""

import importlib.util
import json

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base import resources
from fractalcontact.base.errors import InvalidInput


def fbm(shape=(24, 30), spacing=1e-3, hurst=0.7, rms_increment=1e-5, rng=5, **options):
    return fc.surfaces.fbm(shape, spacing, hurst=hurst, rms_increment=rms_increment, rng=rng, **options)


@pytest.mark.parametrize("hurst", [0.2, 0.75, 0.9])
@pytest.mark.parametrize(("shape", "spacing"), [((3, 4), (1.0, 1.0)), ((4, 3), (0.5, 1.5)), (9, 2.0)])
def test_covariance_is_that_of_the_process(covariance_of, shape, spacing, hurst):
    sizes, steps = np.atleast_1d(shape), np.atleast_1d(spacing)
    diagonal = np.hypot.reduce((sizes - 1) * steps)
    covariance = covariance_of(
        lambda rng: fbm(shape, spacing, hurst, rms_increment=1.0, lag=diagonal, rng=rng).values
    )
    axes = [np.arange(n) * step / diagonal for n, step in zip(sizes, steps, strict=True)]
    points = np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=1)
    away = np.hypot.reduce(points, axis=1) ** (2 * hurst)
    apart = np.hypot.reduce(points[:, None] - points, axis=2) ** (2 * hurst)
    np.testing.assert_allclose(covariance, 0.5 * (away[:, None] + away - apart), atol=1e-14)


@pytest.mark.parametrize(("hurst", "ratio"), [(0.5, 2.4142), (0.75, 2.4142), (0.8, 3.8284)])
def test_torus_has_the_next_fast_length(hurst, ratio):
    for n in (128, 300, 500):
        torus = json.loads(fbm((n, n), hurst=hurst).attrs["provenance"])["torus"]
        least = (ratio - 1) * (n - 1) + n - 1
        assert np.floor(least) <= torus[0] <= 1.05 * least
        assert torus[0] % 2 == 0


def test_mean_square_increment():
    # over 400 surfaces of 32 x 32 points the mean square at lag 1 is known to about half a percent
    heights = fbm((32, 32), 2e-3, hurst=0.5, rms_increment=3e-6, lag=8e-3, members=400).values
    mean_square = np.mean((heights[:, :, 4:] - heights[:, :, :-4]) ** 2)
    assert mean_square == pytest.approx(9e-12, rel=0.04)
    lag_one = np.mean(np.diff(heights, axis=1) ** 2)
    assert lag_one == pytest.approx(9e-12 / 4, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("hurst", [0.2, 0.5, 0.8])
def test_variance_of_second_differences(hurst):
    heights = fbm((128, 128), 1.0, hurst=hurst, rms_increment=1.0, members=60).values
    second = heights[:, 1:-1, 2:] - 2 * heights[:, 1:-1, 1:-1] + heights[:, 1:-1, :-2]
    assert np.mean(second**2) == pytest.approx(4 - 4**hurst, rel=0.01)


def test_first_point_is_zero_and_members_differ():
    heights = fbm(members=3)
    assert heights.dims == ("member", "y", "x")
    assert (heights.values[:, 0, 0] == 0).all()
    assert np.abs(heights.values[0] - heights.values[1]).max() > 0


def test_members_do_not_depend_on_their_number():
    few, many = fbm(members=2), fbm(members=5)
    np.testing.assert_array_equal(few.values, many.values[:2])


def test_profile():
    profile = fbm(64)
    assert profile.dims == ("x",)
    assert profile.values[0] == 0.0
    np.testing.assert_array_equal(profile.values, fbm((64,)).values)


def test_same_stream_gives_same_surface():
    np.testing.assert_array_equal(fbm(rng=3).values, fbm(rng=np.random.default_rng(3)).values)
    assert np.abs(fbm(rng=3).values - fbm(rng=4).values).max() > 0


@pytest.mark.parametrize("library", ["scipy", "ducc0"])
def test_thread_count_changes_no_bit(monkeypatch, library):
    if library == "ducc0" and importlib.util.find_spec("ducc0") is None:
        pytest.skip("ducc0 is not installed")
    monkeypatch.setenv("FRACTALCONTACT_FFT", library)
    surfaces = []
    for count in (1, 2, 3):
        with resources.limit(count):
            surfaces.append(fbm((150, 140)).values)
    np.testing.assert_array_equal(surfaces[0], surfaces[1])
    np.testing.assert_array_equal(surfaces[0], surfaces[2])


def test_transform_libraries_agree(monkeypatch):
    pytest.importorskip("ducc0")
    heights = []
    for library in ("scipy", "ducc0"):
        monkeypatch.setenv("FRACTALCONTACT_FFT", library)
        heights.append(fbm().values)
    np.testing.assert_allclose(heights[0], heights[1], atol=1e-12 * np.abs(heights[0]).max())


def test_units_by_powers_of_two_change_no_bit():
    base = fbm(spacing=(1e-3, 3e-3))
    scaled = fbm(spacing=(1e-3 * 2.0**-30, 3e-3 * 2.0**-30), rms_increment=1e-5 * 2.0**40)
    np.testing.assert_array_equal(scaled.values, base.values * 2.0**40)


def test_lag_sets_the_scale():
    base = fbm(hurst=0.5)
    np.testing.assert_allclose(fbm(hurst=0.5, lag=4e-3).values, base.values / 2, rtol=1e-13)


def test_labels_and_provenance():
    surface = fbm(spacing=(1e-3, 2e-3))
    assert surface.name == "height"
    assert surface.attrs["units"] == "m"
    assert "period" not in surface.x.attrs
    np.testing.assert_allclose(surface.x.values, (np.arange(30) + 0.5) * 2e-3, rtol=1e-14)
    entry = json.loads(surface.attrs["provenance"])
    assert entry["random"]["entropy"] == "5"
    assert entry["parameters"]["lag"] == 2e-3
    assert entry["clipped_fraction"] == 0.0
    assert 0 < entry["smallest_eigenvalue"] < 1


def test_all_problems_are_reported_together():
    with pytest.raises(InvalidInput) as caught:
        fc.surfaces.fbm((2, 5), -1.0, hurst=1.0, rms_increment=np.nan, members=0)
    assert len(caught.value.problems) == 5
    for word in ("shape", "spacing", "hurst", "rms_increment", "members"):
        assert any(problem.startswith(word) for problem in caught.value.problems)


@pytest.mark.parametrize("hurst", [0.0, 0.009, 0.995, 1.2, "a", None])
def test_exponent_out_of_range_is_refused(hurst):
    with pytest.raises(InvalidInput, match="hurst"):
        fbm(hurst=hurst)


@pytest.mark.parametrize("shape", [(5,) * 3, "ab", 2.5, (4, 5.0), ()])
def test_wrong_shape_is_refused(shape):
    with pytest.raises(InvalidInput, match="shape"):
        fbm(shape)


def test_too_large_torus_is_refused():
    with pytest.raises(InvalidInput, match="GiB"):
        fbm((3, 2_000_000))
    with pytest.raises(InvalidInput, match="GiB"):
        fbm((4096, 4096), spacing=(1.0, 1e-3))
