"""Prefixes: the number shown times the prefix is the number, and the axis reads well."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fractalcontact.plotting._units import PREFIXES, amount, pretty, scale_for

POWERS = {prefix: 10.0**exponent for exponent, prefix in PREFIXES.items()}


@given(st.floats(1e-11, 1e14), st.sampled_from(["m", "N", "Pa", "J"]))
def test_prefix_undoes_itself_and_suits_the_number(value, units):
    scale = scale_for(units, [0.1 * value, -value])
    assert POWERS[scale.unit.removesuffix(units)] == scale.factor
    assert 0.5 <= value / scale.factor < 501


@pytest.mark.parametrize(
    ("value", "units", "text"),
    [
        (30e3, "N", "30 kN"),
        (8e-3, "m", "8 mm"),
        (8e-4, "m", "0.8 mm"),
        (8e-5, "m", "80 µm"),
        (2.5e6, "Pa", "2.5 MPa"),
        (4e-4, "m2", "400 mm²"),
        (3e-12, "m2", "3 µm²"),
        (5e-9, "m3", "5 mm³"),
        (40.0, "s", "40 s"),
        (4e6, "s", "4e+06 s"),
        (35.0, "degree", "35 °"),
        (0.25, "1", "0.25"),
        (0.0, "m", "0 m"),
        (float("nan"), "m", "nan m"),
    ],
)
def test_amounts(value, units, text):
    assert amount(value, units) == text


def test_exponents_are_raised():
    assert pretty("rad m-1") == "rad m⁻¹"
    assert pretty("Pa m-1") == "Pa m⁻¹"
    assert pretty("m4") == "m⁴"
    assert scale_for("m4", 1e-12).unit == "m⁴"


def test_nothing_finite_gives_the_bare_unit():
    assert scale_for("m", [np.nan, np.inf]).unit == "m"
    assert scale_for("m", []).factor == 1.0
