"""`press` for several surfaces at once: each is pressed as if it were alone."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base import resources
from fractalcontact.base.errors import ConvergenceWarning

MODULUS = 2e9


@pytest.fixture(scope="module")
def surfaces():
    return fc.surfaces.fbm((24, 32), 1e-5, hurst=0.7, rms_increment=1e-7, rng=1, members=5)


def check_equal(one, other):
    for name in other.variables:
        if name != "run_time":
            np.testing.assert_array_equal(one[name], other[name])


@pytest.mark.parametrize("load", [{"nominal_pressure": [1e6, 1e7]}, {"closure": [1e-7, 5e-7, 2e-7]}])
@pytest.mark.parametrize("influence", ["disc", "square"])
def test_each_surface_is_pressed_as_if_it_were_alone(surfaces, load, influence):
    given = {"contact_modulus": MODULUS, "influence": influence, "keep": ("state", "pressure"), **load}
    together = fc.contact.press(surfaces, **given)
    imposed = next(iter(load))
    assert together["pressure"].dims == ("member", "step", "y", "x")
    assert together["mean_gap"].dims == ("member", "step")
    assert together["rms_slope"].dims == ("member",)
    assert together[imposed].dims == ("step",)
    for member in range(5):
        check_equal(together.isel(member=member), fc.contact.press(surfaces.isel(member=member), **given))


def test_no_bit_depends_on_the_number_of_threads(surfaces):
    given = {"contact_modulus": MODULUS, "nominal_pressure": [1e6, 1e7], "keep": ("pressure",)}
    results = []
    for count in (1, 3):
        with resources.limit(count):
            results.append(fc.contact.press(surfaces, **given))
    check_equal(*results)


def test_several_leading_dims_and_their_coordinates(surfaces, tmp_path):
    heights = surfaces.isel(member=slice(4)).values.reshape(2, 2, 24, 32)
    first = surfaces.isel(member=0, drop=True)
    named = first.expand_dims(shear=[0.0, 1e-4], member=[7, 8]).copy(data=heights)
    found = fc.contact.press(named, contact_modulus=MODULUS, normal_force=1e-4)
    assert found["contact_fraction"].dims == ("shear", "member", "step")
    np.testing.assert_array_equal(found["member"], [7, 8])
    last = fc.contact.press(named[1, 1], contact_modulus=MODULUS, normal_force=1e-4)
    np.testing.assert_array_equal(found["state"][1, 1], last["state"])
    fc.save(found, tmp_path / "ensemble.nc")
    check_equal(fc.open(tmp_path / "ensemble.nc"), found)


def test_a_surface_that_does_not_converge_is_named(surfaces):
    with pytest.warns(ConvergenceWarning, match="member 1, step 1"):
        fc.contact.press(surfaces, contact_modulus=MODULUS, nominal_pressure=[1e6, 1e7], tolerance=1e-17)


def test_every_surface_is_checked(surfaces):
    with pytest.raises(ValueError, match="finite"):
        fc.contact.press(surfaces.where(surfaces.member != 3), contact_modulus=MODULUS, normal_force=1.0)


def test_yielding_and_flat_members(surfaces):
    mixed = surfaces.copy(deep=True)
    mixed[2] = 0.0
    given = {"contact_modulus": MODULUS, "nominal_pressure": [1e6, 5e7, 1e6], "hardness": 2e8}
    found = fc.contact.press(mixed, **given)
    for member in (1, 2):
        check_equal(found.isel(member=member), fc.contact.press(mixed.isel(member=member), **given))
    assert (found["plastic_work"][1, 1:] > 0).all()
    assert (found["contact_fraction"][2, :2] == 1).all()
