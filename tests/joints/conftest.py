"""Faces that the tests of this room share. The units are metres; heights up; E is +x and N is +y."""

import numpy as np
import pytest
import xarray as xr


@pytest.fixture(scope="session")
def make_face():
    """Heights on a grid as a labelled surface; `periodic` for both axes or (y, x)."""

    def make(heights, spacing=1.0, *, periodic=False, origin=(0.0, 0.0)):
        heights = np.asarray(heights, dtype=float)
        spacings = np.broadcast_to(spacing, 2)
        wraps = np.broadcast_to(periodic, 2)
        coords = {}
        for axis, dim in enumerate(("y", "x")):
            n, step = heights.shape[axis], float(spacings[axis])
            attributes = {"units": "m"} | ({"period": n * step} if wraps[axis] else {})
            centres = origin[axis] + (np.arange(n) + 0.5) * step
            coords[dim] = xr.DataArray(centres, dims=dim, attrs=attributes)
        return xr.DataArray(heights, dims=("y", "x"), coords=coords, name="height", attrs={"units": "m"})

    return make


@pytest.fixture(scope="session")
def rough():
    """A periodic random plane with spectrum ~ q^(-2 - 2H), unit variance."""

    def make(shape, seed, hurst=0.8):
        rng = np.random.default_rng(seed)
        modes = np.fft.rfft2(rng.standard_normal(shape))
        qy, qx = np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1])[None, :]
        q = np.hypot(qy, qx)
        q[0, 0] = 1.0
        modes *= q ** (-1.0 - hurst)
        modes[0, 0] = 0.0
        heights = np.fft.irfft2(modes, shape)
        return heights / heights.std()

    return make
