"""Lacunarity of heights against loops, and against that of a mask."""

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc


def test_sums_of_zeros_and_ones_have_the_lacunarity_of_the_mask():
    cells = np.random.default_rng(1).random((40, 48)) < 0.3
    mask = xr.DataArray(cells, dims=("y", "x"))
    expected = fc.domains.lacunarity(mask, [1, 2, 4, 8, 16])
    result = fc.dimensions.height_lacunarity(fc.surfaces.from_array(cells * 1e-6, 1e-3), mass="sum")
    np.testing.assert_allclose(result.lacunarity, expected.lacunarity, rtol=1e-9)


@pytest.mark.parametrize("mass", ["range", "sum"])
@pytest.mark.parametrize("shape", [(17, 24), (30,)])
def test_lacunarity_of_all_windows(mass, shape):
    heights = np.random.default_rng(2).standard_normal(shape)
    heights[3] = np.nan if len(shape) == 1 else heights[3]
    if len(shape) == 2:
        heights[4, 5] = np.nan
    result = fc.dimensions.height_lacunarity(fc.surfaces.from_array(heights, 1.0), mass=mass)
    plane = np.atleast_2d(heights) - np.nanmin(heights)
    for size, value, number in zip(
        result.window_size.values.astype(int), result.lacunarity, result.pair_count, strict=True
    ):
        rows = size if len(shape) == 2 else 1
        windows = np.lib.stride_tricks.sliding_window_view(plane, (rows, size)).reshape(-1, rows * size)
        windows = windows[np.isfinite(windows).all(axis=1)]
        masses = windows.sum(axis=1) if mass == "sum" else np.ptp(windows, axis=1)
        assert int(number) == len(windows)
        assert float(value) == pytest.approx(np.mean(masses**2) / masses.mean() ** 2, rel=1e-9)


def test_range_does_not_depend_on_the_level_but_patches_raise_it():
    rough = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.5, rms_increment=1e-6, rng=1)
    even = fc.dimensions.height_lacunarity(rough)
    np.testing.assert_allclose(
        fc.dimensions.height_lacunarity(rough + 1.0).lacunarity, even.lacunarity, rtol=1e-6
    )
    patchy = rough * xr.where(rough.x < 32e-4, 8.0, 1.0)
    patchy.attrs = rough.attrs
    assert (fc.dimensions.height_lacunarity(patchy).lacunarity > even.lacunarity + 0.3).all()
