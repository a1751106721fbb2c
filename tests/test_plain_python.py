"""Each family of kernels on a small input, against brute force: with the compiler, and without it.

`NUMBA_DISABLE_JIT=1 pytest -m plain_python` runs the same loops as plain Python, where an index out of
bounds is an error and a debugger can stop.
"""

import numpy as np
import pytest
import xarray as xr
from scipy import ndimage

import fractalcontact as fc

pytestmark = pytest.mark.plain_python
SPACING = 1e-4
HEIGHTS = 1e-6 * np.random.default_rng(5).normal(size=(12, 12)).cumsum(axis=0).cumsum(axis=1)
SURFACE = fc.surfaces.from_array(HEIGHTS, SPACING)
MASK = np.random.default_rng(6).random((12, 12)) < 0.4


def mask_of(cells):
    centres = {dim: (np.arange(n) + 0.5) * SPACING for dim, n in zip("yx", cells.shape, strict=True)}
    return xr.DataArray(cells, dims=("y", "x"), coords=centres)


def test_islands_are_those_of_scipy():
    labels, count = ndimage.label(MASK, structure=np.ones((3, 3)))
    result = fc.domains.islands(mask_of(MASK), connectivity=2)
    assert int(result.n_islands) == count
    assert sorted(result.cells.values) == sorted(np.bincount(labels.ravel())[1:])


def test_box_counts_of_a_carpet():
    carpet = np.kron(*2 * [np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], dtype=bool)])
    counts = fc.domains.box_counts(mask_of(carpet), [1, 3], cover="aligned")
    assert counts.box_count.values.tolist() == [64, 8]


def test_gliding_box_lacunarity():
    windows = np.lib.stride_tricks.sliding_window_view(MASK, (3, 3)).sum(axis=(-2, -1)).astype(float)
    result = fc.domains.lacunarity(mask_of(MASK), [3])
    np.testing.assert_allclose(result.lacunarity, np.mean(windows**2) / np.mean(windows) ** 2, rtol=1e-13)


def test_correlation_mass():
    result = fc.domains.correlation_dimension(mask_of(MASK), box_sizes=[1, 3])
    assert float(result.mean_mass[0]) == pytest.approx(1.0)


def test_variogram():
    along = np.concatenate([np.diff(HEIGHTS, axis=axis).ravel() ** 2 for axis in (0, 1)])
    result = fc.dimensions.variogram(SURFACE)
    assert float(result.variogram[0]) == pytest.approx(0.5 * along.mean(), rel=1e-12)


def test_dividers_on_a_slope():
    result = fc.dimensions.divider(fc.surfaces.from_array(0.75 * np.arange(17.0), 1.0))
    np.testing.assert_allclose(result.divider_length, 20.0, rtol=1e-12)


@pytest.mark.parametrize("method", ["increments", "likelihood"])
def test_exponent_is_that_of_the_surface(method):
    surface = fc.surfaces.fbm((24, 24), SPACING, hurst=0.7, rms_increment=1e-6, rng=3)
    estimate = fc.dimensions.estimate(surface, [method])
    assert abs(estimate.hurst.item() - 0.7) < 5 * estimate.standard_error.item()


def test_fast_and_elimination_solvers_agree():
    load = {"contact_modulus": 1e9, "nominal_pressure": 1e5, "tolerance": 1e-10, "keep": ("state",)}
    fast = fc.contact.press(SURFACE, **load)
    slow = fc.contact.press(SURFACE, method="elimination", **load)
    np.testing.assert_array_equal(fast.state, slow.state)
    np.testing.assert_allclose(fast.closure, slow.closure, rtol=1e-9)


def test_periodic_solver_carries_the_force():
    surface = fc.surfaces.spectral((16, 16), SPACING, hurst=0.8, rms_height=1e-6, rng=4)
    result = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=1e6, keep=("pressure",))
    assert float(result.pressure.mean()) == pytest.approx(1e6, rel=1e-9)
    assert bool(result.converged.all())


def test_flow_between_parallel_plates():
    gap = fc.surfaces.from_array(np.full((12, 12), 1e-5), SPACING).rename("gap")
    result = fc.joints.transmissivity(gap)
    np.testing.assert_allclose(result.hydraulic_aperture, 1e-5, rtol=1e-9)


def test_rigid_dilatancy():
    crack = fc.joints.Crack(SURFACE, young=3e10, poisson=0.2, block=6e-4)
    result = fc.joints.dilatancy(crack, shear=[0.0, SPACING], direction="E")
    block = slice(3, 9)  # in the middle of the surface
    rise = np.max(HEIGHTS[block, 4:10] - HEIGHTS[block, 3:9])
    assert result.rigid_dilatancy.sel(shear=SPACING).item() == pytest.approx(rise, rel=1e-9)
