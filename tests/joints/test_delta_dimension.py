"""Dimension of the delta-surface: known limits by area and by spectrum."""

import numpy as np
import pytest

import fractalcontact as fc

MATERIAL = {"young": 30e9, "poisson": 0.2}


@pytest.mark.parametrize("seed", [1, 2])
def test_dimension_by_area_rises_and_by_spectrum_falls(seed):
    # 2.000, 2.07, 2.115, 2.13, ... 2.10 by area and 3.2 falling to 2.2 by spectrum at H = 0.78, slope 1
    face = fc.surfaces.spectral((256, 256), 1e-4, hurst=0.78, rms_slope=1.0, rng=seed)
    crack = fc.joints.Crack(face, **MATERIAL)
    result = fc.joints.delta_dimension(crack, shear=np.array([0, 1, 2, 4, 10, 30, 100]) * 1e-4)
    area, lag, wave = (result[f"{name}_dimension"].values for name in ("covering", "variogram", "spectrum"))
    assert area[0] == 2.0
    np.testing.assert_allclose(area[1:], [2.068, 2.115, 2.13, 2.125, 2.111, 2.104], atol=0.03)
    assert (np.diff(area[:4]) > 0).all()
    assert np.isnan(lag[0])
    assert np.isnan(wave[0])
    assert "flat" in result.spectrum_dimension.attrs["reason"]
    np.testing.assert_allclose(lag[1:], [2.81, 2.73, 2.58, 2.39, 2.28, 2.24], atol=0.1)
    assert (np.diff(wave[1:6]) < 0).all()
    assert wave[1] > 2.9
    assert wave[-1] == pytest.approx(3 - 0.78, abs=0.1)


def test_unmated_faces_are_rough_at_no_shear(make_face, rough):
    lower, upper = 2e-4 * rough((80, 80), 1), 2e-4 * rough((80, 80), 2)
    crack = fc.joints.Crack(make_face(lower, 8e-5), make_face(upper, 8e-5), block=64 * 8e-5, **MATERIAL)
    result = fc.joints.delta_dimension(crack, shear=[0.0, 8e-5], direction=200)
    assert (result.covering_dimension > 2).all()
    assert "reason" not in result.spectrum_dimension.attrs
    assert result.direction == "200"


def test_invalid_arguments_are_refused(make_face, rough):
    crack = fc.joints.Crack(make_face(rough((40, 40), 1), (1.0, 2.0)), **MATERIAL)
    with pytest.raises(ValueError, match="equal spacings"):
        fc.joints.delta_dimension(crack, shear=0.0)
    crack = fc.joints.Crack(make_face(rough((40, 40), 1)), block=30, **MATERIAL)
    with pytest.raises(ValueError, match="at least two scales"):
        fc.joints.delta_dimension(crack, shear=1.0, window=(1.1, 1.2))
    with pytest.raises(ValueError, match="least, greatest"):
        fc.joints.delta_dimension(crack, shear=1.0, window=(2.0, 1.0))
