"""Roughness in windows against least squares and fractional Brownian surfaces."""

import numpy as np
import pytest

import fractalcontact as fc


@pytest.fixture(scope="module")
def rough():
    return fc.surfaces.fbm((48, 40), (2e-3, 1e-3), hurst=0.6, rms_increment=1e-4, rng=1)


def test_roughness_is_rms_about_plane(rough):
    result = fc.dimensions.roughness_length(rough)
    # windows of 4 spacings of y: 4 x 8 points, overlapping by half
    columns = np.stack([np.ones((4, 8)), *np.indices((4, 8))]).reshape(3, -1).T
    values = []
    for j in range(0, 48 - 3):
        for i in range(0, 40 - 7, 2):
            part = rough.values[j : j + 4, i : i + 8].ravel()
            rest = part - columns @ np.linalg.lstsq(columns, part, rcond=None)[0]
            values.append(np.sqrt(np.mean(rest**2)))
    assert float(result.window_size[0]) == pytest.approx(8e-3)
    assert float(result.roughness[0]) == pytest.approx(np.mean(values), rel=1e-10)
    assert int(result.pair_count[0]) == len(values)


@pytest.mark.parametrize("method", ["roughness_length", "detrended_fluctuation"])
def test_no_corner_counts_more_than_another(method):
    """Windows once started from one corner: .908, .954, .942 and .991 for the four turns of a surface."""
    surface = fc.surfaces.fbm((33, 46), 1e-4, hurst=0.6, rms_increment=1e-6, rng=4)
    heights = surface.where(np.random.default_rng(1).random(surface.shape) > 0.02).values
    turned = [heights, heights[::-1], heights[:, ::-1], heights.T, heights[::-1, ::-1].T]
    surfaces = [fc.surfaces.from_array(part, 1e-4) for part in turned]
    results = [float(fc.dimensions.estimate(part, method).hurst[0]) for part in surfaces]
    np.testing.assert_allclose(results, results[0], rtol=1e-9)


@pytest.mark.parametrize(
    ("method", "shape", "spacing"),
    [
        ("roughness_length", (96, 96), (1e-4, 1e-4)),
        ("roughness_length", (64, 128), (2e-4, 1e-4)),
        ("detrended_fluctuation", (96, 96), (1e-4, 1e-4)),
    ],
)
@pytest.mark.parametrize("hurst", [0.2, 0.5, 0.8])
def test_estimate_corrects_small_windows(method, shape, spacing, hurst):
    """The slope of the curve itself is up to 0.2 higher than H in windows of a few points."""
    surfaces = fc.surfaces.fbm(shape, spacing, hurst=hurst, rms_increment=1e-6, members=12, rng=41)
    result = fc.dimensions.estimate(surfaces, method).hurst
    assert float(result.mean()) == pytest.approx(hurst, abs=0.03)


@pytest.mark.parametrize("hurst", [0.2, pytest.param(0.5, marks=pytest.mark.slow), 0.8])
def test_curve_is_that_expected_of_exact_surfaces(hurst):
    """Mean squares in windows of 8 points, side by side with exact surfaces of the size of a window."""
    parts = fc.surfaces.fbm((9, 9), 1.0, hurst=hurst, rms_increment=1.0, members=1000, rng=40)
    curve = fc.dimensions.roughness_length(parts)
    ratio = [float((curve.roughness**2).isel(window_size=k).mean()) for k in (0, 2)]
    assert curve.window_size.values[[0, 2]].tolist() == [4.0, 8.0]
    y, x = np.mgrid[:8, :8]
    expected = []
    for size in (4, 8):
        inside = (y < size) & (x < size)
        points = np.stack([y[inside], x[inside]]).astype(float)
        plane = np.linalg.qr(np.stack([np.ones(points.shape[1]), *points], axis=1))[0]
        distance = np.sqrt(((points[:, :, None] - points[:, None]) ** 2).sum(axis=0))
        rest = np.eye(points.shape[1]) - plane @ plane.T
        expected.append(np.trace(rest @ (-0.5 * distance ** (2 * hurst)) @ rest) / points.shape[1])
    assert ratio[1] / ratio[0] == pytest.approx(expected[1] / expected[0], rel=0.08)
