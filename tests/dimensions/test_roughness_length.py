"""Roughness in windows against least squares and fractional Brownian surfaces."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.dimensions import _roughness_length


@pytest.fixture(scope="module")
def rough():
    return fc.surfaces.fbm((48, 40), (2e-3, 1e-3), hurst=0.6, rms_increment=1e-4, rng=1)


def test_roughness_is_rms_about_plane(rough):
    result = fc.dimensions.roughness_length(rough)
    # windows of 4 spacings of y: 4 x 8 points, overlapping by half
    columns = np.stack([np.ones((4, 8)), *np.indices((4, 8))]).reshape(3, -1).T
    values = []
    for j in range(0, 48 - 3, 2):
        for i in range(0, 40 - 7, 4):
            part = rough.values[j : j + 4, i : i + 8].ravel()
            rest = part - columns @ np.linalg.lstsq(columns, part, rcond=None)[0]
            values.append(np.sqrt(np.mean(rest**2)))
    assert float(result.window_size[0]) == pytest.approx(8e-3)
    assert float(result.roughness[0]) == pytest.approx(np.mean(values), rel=1e-10)
    assert int(result.pair_count[0]) == len(values)


@pytest.mark.parametrize("steps", [(1.0, 1.0), (2.0, 1.0)])
@pytest.mark.parametrize("hurst", [0.2, 0.8])
def test_expected_roughness_of_window(hurst, steps):
    """The mean square about a plane, over exact surfaces of the size of a window."""
    shape = (5, 8)
    surfaces = fc.surfaces.fbm(
        shape, steps, hurst=hurst, rms_increment=1.0, lag=1.0, members=4000, rng=40
    ).values
    y, x = np.mgrid[: shape[0], : shape[1]]
    plane = np.linalg.qr(np.stack([np.ones(x.size), x.ravel(), y.ravel()], axis=1))[0]
    flat = surfaces.reshape(len(surfaces), -1)
    rest = flat - (flat @ plane) @ plane.T
    result = np.sqrt(np.mean(rest**2))
    expected = _roughness_length.expected_roughness(np.array([shape]), steps, hurst)[0]
    assert expected == pytest.approx(result, rel=0.015)


@pytest.mark.parametrize("hurst", [0.2, 0.5, 0.8])
def test_estimate_corrects_small_windows(hurst):
    surfaces = fc.surfaces.fbm((96, 96), 1e-4, hurst=hurst, rms_increment=1e-6, members=12, rng=41)
    result = fc.dimensions.estimate(surfaces, "roughness_length").hurst
    assert float(result.mean()) == pytest.approx(hurst, abs=0.03)
