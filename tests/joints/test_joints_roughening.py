"""The dimension of the delta-surface: it rises by area and falls by spectrum, and both have known ends."""

import numpy as np
import pytest

import fractalcontact as fc

MATERIAL = {"young": 30e9, "poisson": 0.2}


@pytest.mark.parametrize("seed", [1, 2])
def test_area_rises_from_two_and_levels_while_the_spectrum_falls_to_the_face(seed):
    # 2.000, 2.07, 2.115, 2.13, ... 2.10 by area and 3.2 falling to 2.2 by spectrum at H = 0.78, slope 1
    face = fc.surfaces.spectral((256, 256), 1e-4, hurst=0.78, rms_slope=1.0, rng=seed)
    crack = fc.joints.Crack(face, **MATERIAL)
    found = fc.joints.delta_dimension(crack, shear=np.array([0, 1, 2, 4, 10, 30, 100]) * 1e-4)
    area, lag, wave = (found[f"{name}_dimension"].values for name in ("covering", "variogram", "spectrum"))
    assert area[0] == 2.0
    np.testing.assert_allclose(area[1:], [2.068, 2.115, 2.13, 2.125, 2.111, 2.104], atol=0.03)
    assert (np.diff(area[:4]) > 0).all()
    assert np.isnan(lag[0])
    assert np.isnan(wave[0])
    assert "flat" in found.spectrum_dimension.attrs["reason"]
    np.testing.assert_allclose(lag[1:], [2.81, 2.73, 2.58, 2.39, 2.28, 2.24], atol=0.1)
    assert (np.diff(wave[1:6]) < 0).all()
    assert wave[1] > 2.9
    assert wave[-1] == pytest.approx(3 - 0.78, abs=0.1)


def test_faces_that_do_not_match_are_rough_at_no_shear(make_face, rough):
    lower, upper = 2e-4 * rough((80, 80), 1), 2e-4 * rough((80, 80), 2)
    crack = fc.joints.Crack(make_face(lower, 8e-5), make_face(upper, 8e-5), block=64 * 8e-5, **MATERIAL)
    found = fc.joints.delta_dimension(crack, shear=[0.0, 8e-5], direction=200)
    assert (found.covering_dimension > 2).all()
    assert "reason" not in found.spectrum_dimension.attrs
    assert found.direction == "200"


def test_faults_are_named(make_face, rough):
    crack = fc.joints.Crack(make_face(rough((40, 40), 1), (1.0, 2.0)), **MATERIAL)
    with pytest.raises(ValueError, match="equal spacings"):
        fc.joints.delta_dimension(crack, shear=0.0)
    crack = fc.joints.Crack(make_face(rough((40, 40), 1)), block=30, **MATERIAL)
    with pytest.raises(ValueError, match="at least two scales"):
        fc.joints.delta_dimension(crack, shear=1.0, window=(1.1, 1.2))
    with pytest.raises(ValueError, match="least, greatest"):
        fc.joints.delta_dimension(crack, shear=1.0, window=(2.0, 1.0))
