"""Contact area against the spacing: the same contacts solved one by one, mated faces, and a smooth limit."""

import numpy as np
import pytest

import fractalcontact as fc

S = 8e-5


def test_equals_the_contacts_of_every_spacing(crack):
    result = fc.joints.area_by_resolution(
        crack, shear=[S, 5 * S], direction="W", factors=[4, 1, 2], normal_force=[10.0, 1e3]
    )
    assert result.area_dimension.dims == ("shear", "step")
    np.testing.assert_allclose(result.resolution, [S, 2 * S, 4 * S])
    masks = []
    for i, factor in enumerate((1, 2, 4)):
        for j, shear in enumerate((S, 5 * S)):
            delta = fc.joints.delta_surface(crack, shear, "W")[::factor, ::factor]
            pressed = fc.contact.press(
                delta, contact_modulus=crack.contact_modulus, normal_force=[10.0, 1e3], keep=("state",)
            )
            one = result.isel(resolution=i, shear=j)
            np.testing.assert_array_equal(one.contact_fraction, (pressed.state > 0).mean(("y", "x")))
            flat = fc.contact.press(
                0.0 * delta, contact_modulus=crack.contact_modulus, normal_force=[10.0, 1e3]
            )
            np.testing.assert_allclose(one.interface_closure, pressed.closure - flat.closure, rtol=1e-6)
            if shear == S:
                masks.append(pressed.state)
    slope = np.polyfit(np.log([1, 2, 4]), np.log([mask[1].mean() for mask in masks]), 1)[0]
    assert float(result.area_dimension[0, 1]) == pytest.approx(2 - slope, abs=1e-12)
    # finer heights touch on less area
    assert (result.contact_fraction.isel(resolution=0) < result.contact_fraction.isel(resolution=2)).all()
    assert (result.area_dimension < 2).all()


def test_mated_faces_touch_everywhere_at_every_spacing(crack):
    result = fc.joints.area_by_resolution(crack, shear=0.0, nominal_pressure=1e6)
    np.testing.assert_allclose(result.resolution, [S, 2 * S, 3 * S])  # of 48 cells, at least 8 an edge
    assert (result.contact_fraction == 1).all()
    np.testing.assert_allclose(result.area_dimension, 2.0, atol=1e-12)
    np.testing.assert_allclose(result.interface_closure, 0.0, atol=1e-12)
    np.testing.assert_allclose(result.nominal_pressure, 1e6)


def test_smooth_face_has_an_area_of_its_own(make_face):
    """One Hertzian dome resolved by many cells: the dimension by area is 2."""
    x = (np.arange(160) - 40.0) * 1.5e-5
    dome = np.hypot(x, x[:, None])
    face = make_face(np.where(dome < 6e-4, -(dome**2) / 0.02, -1.8e-5), 1.5e-5)
    crack = fc.joints.Crack(
        face, make_face(np.zeros((160, 160)), 1.5e-5), young=30e9, poisson=0.2, block=1.2e-3
    )
    result = fc.joints.area_by_resolution(crack, shear=0.0, factors=[1, 2], normal_force=50.0)
    assert 0.05 < float(result.contact_fraction[0, 0, 0]) < 0.5
    assert float(result.area_dimension.squeeze()) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"factors": [1, 5]}, "divisors of the 48 x 48 cells"),
        ({"factors": [2, 2]}, "two different divisors"),
        ({"factors": [1]}, "at least two"),
        ({"factors": [1, 24]}, "1 to 16"),
        ({"normal_force": 1.0}, "exactly one of"),
        ({"direction": ["E", "W"]}, "direction"),
    ],
)
def test_wrong_arguments_are_named(crack, options, named):
    with pytest.raises(ValueError, match=named):
        fc.joints.area_by_resolution.validate(crack, **({"shear": S, "nominal_pressure": 1e6} | options))
