"""Surfaces and cracks shared by the tests of joints. Metres, heights up; E is +x and N is +y."""

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc


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


@pytest.fixture(scope="session")
def crack(make_face, rough):
    """A 48-cell block on a 96-cell face, 80 um apart, steep enough to hold the faces apart."""
    face = make_face(2e-4 * rough((96, 96), 11), 8e-5)
    return fc.joints.Crack(face, young=30e9, poisson=0.2, block=48 * 8e-5)


@pytest.fixture(scope="session")
def teeth(make_face):
    """Dilatancy of teeth of 10 degrees, 20 mm long, with a basic angle of 30 degrees, in both directions."""
    x, spacing, period = np.arange(200), 1e-3, 20
    tooth = np.abs((x + period / 2) % period - period / 2) * spacing * np.tan(np.radians(10))
    face = make_face(np.broadcast_to(tooth, (6, 200)), spacing)
    crack = fc.joints.Crack(face, block=(6e-3, 0.1), young=3e10, poisson=0.2, basic_friction_angle=30)
    return fc.joints.dilatancy(crack, shear=np.arange(9) * spacing, direction=("E", "W"))
