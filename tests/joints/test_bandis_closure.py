"""Closure after Barton and Bandis at worked values."""

import numpy as np
import pytest

import fractalcontact as fc

JOINT = {"roughness_coefficient": 10, "wall_strength": 100e6, "aperture": 0.2e-3}


@pytest.mark.parametrize(
    ("roughness", "walls", "intact", "aperture"),
    [(10, 100e6, 100e6, 0.2e-3), (10, 50e6, 100e6, 0.6e-3), (8, 50e6, 75e6, 0.32e-3)],
)
def test_aperture_without_load(roughness, walls, intact, aperture):
    # a = JRC/5 (0.2 UCS/JCS - 0.1) mm: 2 (0.2 - 0.1), 2 (0.4 - 0.1), 1.6 (0.3 - 0.1)
    joint = fc.joints.bandis_closure(
        1e6, roughness_coefficient=roughness, wall_strength=walls, compressive_strength=intact
    )
    assert joint.aperture.item() == pytest.approx(aperture)
    if walls == intact:  # which is the default
        fresh = fc.joints.bandis_closure(1e6, roughness_coefficient=roughness, wall_strength=walls)
        assert fresh.aperture.item() == joint.aperture.item()


def test_closure_is_the_hyperbola():
    joint = fc.joints.bandis_closure([0.0, 1e6, 10e6, 30e6], **JOINT)
    assert joint.initial_stiffness.item() == pytest.approx(20.35e9)
    assert joint.greatest_closure.item() == pytest.approx(0.136871e-3, rel=1e-5)
    expected = np.array([0, 0.036158, 0.107053, 0.125243]) * 1e-3
    np.testing.assert_allclose(joint.closure, expected, rtol=1e-5)
    assert joint.closure.attrs["units"] == "m"


# (JCS/a)^D of 500 MPa/mm: ln 500 = 6.214608, exp(-1.429981) = .239313, exp(-1.559867) = .210164
@pytest.mark.parametrize(
    ("cycle", "closure"),
    [
        (2, -0.1005 - 0.073 + 1.0082 * 0.239313),
        (3, -0.1032 - 0.074 + 1.1350 * 0.210164),
    ],
)
def test_cycles(cycle, closure):
    later, first = (fc.joints.bandis_closure(1e6, **JOINT, cycle=number) for number in (cycle, 1))
    assert later.greatest_closure.item() == pytest.approx(closure * 1e-3, rel=1e-4)
    assert later.greatest_closure < first.greatest_closure
    assert later.initial_stiffness == first.initial_stiffness


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"cycle": 4}, "cycle: expected"),
        # a closure of 0.274 mm for an aperture of 0.1 mm
        ({"roughness_coefficient": 5, "wall_strength": 22e6, "aperture": 0.1e-3}, "0.274 mm"),
        (
            {"roughness_coefficient": 20, "wall_strength": 200e6, "aperture": 0.01e-3},
            "values inside the range of the fit",
        ),
        ({"roughness_coefficient": 0.0, "wall_strength": 1e6, "aperture": 1e-3}, "range of the fit"),
        ({"roughness_coefficient": 0.0, "aperture": None}, "range of the fit"),
        ({"compressive_strength": 50e6}, "wall_strength: expected at most compressive_strength"),
        ({"aperture": 0.0}, "aperture"),
        ({"roughness_coefficient": 30}, "roughness_coefficient: expected"),
    ],
)
def test_values_outside_the_fit_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        fc.joints.bandis_closure(1e6, **JOINT | options)
