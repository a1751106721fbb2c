"""Checks of the input surface, and surfaces that are not in memory."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import LoadedWarning, TooLittleMemory


@pytest.fixture(scope="module")
def rough():
    return fc.surfaces.fbm((48, 40), (2e-3, 1e-3), hurst=0.6, rms_increment=1e-4, rng=1)


NAMES = list(fc.dimensions.methods())


def estimate(*arguments, **options):
    return fc.dimensions.estimate(*arguments, **options)


def test_dask_surface_gives_same_results(rough, monkeypatch):
    pytest.importorskip("dask")
    monkeypatch.setattr("fractalcontact.dimensions._surface_input.SLAB", 400)
    lazy = rough.chunk({"y": 7})
    for increments in ("square", "absolute", "second"):
        first, second = (
            fc.dimensions.variogram(surface, increments=increments, max_lag=8e-3) for surface in (rough, lazy)
        )
        name = next(iter(first.data_vars))
        np.testing.assert_allclose(second[name], first[name], rtol=1e-12)
        assert (second.pair_count == first.pair_count).all()
    tiles = [fc.dimensions.spectrum(s, tile=16).power_spectral_density for s in (rough, lazy)]
    np.testing.assert_allclose(tiles[1], tiles[0], rtol=1e-9)
    result = [fc.dimensions.estimate(s, "increments").hurst.values for s in (rough, lazy)]
    np.testing.assert_array_equal(*result)


def test_functions_that_load_a_dask_array_say_so(rough):
    """A warning names argument and size; what reads blocks, or returns dask, gives none."""
    pytest.importorskip("dask")
    lazy = rough.chunk({"y": 7})
    size = f"{rough.nbytes / 1e6:.3g} MB"
    with pytest.warns(LoadedWarning, match=f"texture: the dask arrays of `surface` .* {size}"):
        fc.surfaces.texture(lazy)
    with pytest.warns(LoadedWarning, match="estimate"):
        fc.dimensions.estimate(lazy, "cube_counts")
    fc.dimensions.estimate(lazy, ["increments", "variogram", "default"])  # a warning is an error here
    assert fc.surfaces.from_array(lazy.data, 1e-4).chunks is not None


def test_of_large_dask_arrays_a_part_is_transformed_at_a_time(rough, monkeypatch):
    pytest.importorskip("dask")
    lazy, edge = rough.chunk({"y": 7}), 32
    for module in ("_surface_input", "_spectrum"):
        monkeypatch.setattr(f"fractalcontact.dimensions.{module}.LARGEST", edge)
    assert min(rough.shape) > edge
    cuts = [slice((n - edge) // 2, (n + edge) // 2) for n in rough.shape]
    part, whole = fc.dimensions.estimate(rough[cuts[0], cuts[1]]), fc.dimensions.estimate(lazy)
    for name in ("hurst", "ci_low", "ci_high"):
        np.testing.assert_array_equal(whole[name], part[name])
    assert f"of the middle {edge} x {edge} points" in str(whole.note.values)
    curves = fc.dimensions.spectrum(lazy), fc.dimensions.spectrum(rough, tile=edge)
    np.testing.assert_allclose(curves[0].power_spectral_density, curves[1].power_spectral_density, rtol=1e-9)
    assert f'"tile": {edge}' in curves[0].attrs["provenance"]


def test_a_method_that_needs_all_heights_is_refused_for_a_huge_dask_array():
    da = pytest.importorskip("dask.array")
    huge = fc.surfaces.from_array(da.zeros((1 << 18, 1 << 18), chunks=4096), 1e-6)
    with pytest.raises(TooLittleMemory, match=r"in blocks: increments, variogram, likelihood"):
        fc.dimensions.estimate(huge, "spectrum")


def test_invalid_arguments_of_curves(rough):
    with pytest.raises(ValueError, match=r"taper.*\n.*tile") as caught:
        fc.dimensions.spectrum(rough, taper="boxcar", tile=4)
    assert "2 problems" in str(caught.value)
    with pytest.raises(ValueError, match=r"surface: expected finite values.*fill"):
        fc.dimensions.spectrum(rough.where(rough > rough.mean()))
    with pytest.raises(ValueError, match="max_lag: expected at least one spacing"):
        fc.dimensions.variogram(rough, max_lag=1e-5)
    with pytest.raises(ValueError, match="uniform spacing"):
        fc.dimensions.variogram(rough.assign_coords(x=rough.x**2))
    with pytest.raises(ValueError, match="vertical_scale"):
        fc.dimensions.covering(rough, vertical_scale=-1.0)
    with pytest.raises(ValueError, match="nothing but NaN"):
        fc.dimensions.variogram(rough * np.nan, increments="absolute")
    with pytest.raises(ValueError, match="infinite"):
        fc.dimensions.cube_counts(rough.where(rough.x > 5e-3, np.inf))


@pytest.mark.parametrize(
    "name", ["estimate", "directions", "spectrum", "variogram", "cube_counts", "covering"]
)
def test_validate_raises_like_the_call(rough, name):
    function = getattr(fc.dimensions, name)
    assert function.validate(rough) is None
    for arguments in ({"surface": rough * np.nan}, {"surface": rough.values}):
        with pytest.raises(ValueError, match="surface") as of_call:
            function(**arguments)
        with pytest.raises(ValueError, match="surface") as of_validate:
            function.validate(**arguments)
        assert str(of_validate.value) == str(of_call.value)
