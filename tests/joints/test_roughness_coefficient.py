"""Joint roughness coefficient of profiles of known slope."""

import numpy as np
import pytest

import fractalcontact as fc


@pytest.mark.parametrize(("direction", "share"), [("E", 1.0), ("W", 1.0), ("NE", 0.5)])
def test_slope_of_a_sawtooth(make_face, direction, share):
    s = 1.27e-3
    tooth = 0.25 * s * np.abs((np.arange(60) + 10) % 20 - 10)
    face = make_face(np.broadcast_to(tooth, (60, 60)), s)
    result = fc.joints.roughness_coefficient(face, direction=direction)
    z2 = 0.25 * (1.0 if share == 1.0 else np.sqrt(0.5))
    assert result.profile_slope.item() == pytest.approx(z2, rel=0.02)
    expected = 32.2 + 32.47 * np.log10(result.profile_slope.item())
    assert result.roughness_coefficient.item() == pytest.approx(expected, rel=1e-12)
    flat = fc.joints.roughness_coefficient(face, direction="N")
    assert flat.profile_slope < 1e-12
    assert np.isnan(flat.roughness_coefficient)
    assert 1e3 * result.lag.item() == pytest.approx(1.27 if share == 1.0 else 1.796, rel=1e-3)


def test_coefficient_outside_the_scale_is_missing(make_face, rough):
    face = make_face(1e-2 * rough((40, 40), 1), 1e-4)
    result = fc.joints.roughness_coefficient(face)
    assert np.isnan(result.roughness_coefficient).all()
    assert "standard profiles" in result.roughness_coefficient.attrs["reason"]
    assert (result.profile_slope > 0.5).all()


def test_gaps_are_left_out(make_face, rough):
    heights = 1e-4 * rough((40, 40), 1)
    heights[3:8, 5:20] = np.nan
    assert np.isfinite(fc.joints.roughness_coefficient(make_face(heights, 1e-4)).profile_slope).all()
    with pytest.raises(ValueError, match=r"heights 1 m apart towards E"):
        fc.joints.roughness_coefficient(make_face(heights, 1e-4), lag=1.0)
