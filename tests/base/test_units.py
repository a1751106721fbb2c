"""Numbers beside units: the prefix times the number is the value, without exponents and signs of zero."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fractalcontact.base.units import (
    fixed,
    metres,
    number,
    quantity_text,
)

FACTORS = {"P": 1e15, "T": 1e12, "G": 1e9, "M": 1e6, "k": 1e3, "": 1, "m": 1e-3, "µ": 1e-6}
FACTORS |= {"n": 1e-9, "p": 1e-12}


@given(st.floats(1e-11, 1e15), st.sampled_from(["m", "N", "Pa", "J"]), st.sampled_from([1, -1]))
@settings(max_examples=200, deadline=None)
def test_number_times_prefix_is_the_value(size, units, sign):
    shown, unit = quantity_text(sign * size, units).split(" ")
    assert "e" not in shown
    assert float(shown) * FACTORS[unit.removesuffix(units)] == pytest.approx(sign * size, rel=6e-3)


@pytest.mark.parametrize(
    ("value", "units", "text"),
    [
        (1e6, "Pa", "1 MPa"),
        (999.9e3, "Pa", "1 MPa"),
        (2e-3, "N", "2 mN"),
        (3e4, "N", "30 kN"),
        (float("nan"), "Pa", "-"),
        (54.31, "degree", "54.3 °"),
        (1.6e-3, "m2", "1600 mm²"),
        (0.04, "m2", "40000 mm²"),
        (1.75e-7, "m2", "0.175 mm²"),
        (0.0, "Pa", "0 Pa"),
    ],
)
def test_amounts(value, units, text):
    assert quantity_text(value, units) == text


def test_zero_has_no_sign():
    assert fixed(-1e-3, 2) == "0.00"
    assert fixed(-0.0, 0) == "0"
    assert fixed(-0.05, 1, sign=True) in ("-0.1", "0.0")
    assert fixed(-10.0, 0) == "-10"
    assert fixed(0.5, 2, sign=True) == "+0.50"
    assert fixed(float("nan"), 2) == "nan"
    assert number(-0.0) == "0"


@pytest.mark.parametrize(
    ("text", "metre"),
    [
        ("0.3mm", 3e-4), ("0.3 mm", 3e-4), ("3e-4", 3e-4), ("3e-1mm", 3e-4), ("300 µm", 3e-4),
        ("2 in", 0.0508), ("0.3 GPa", None), ("mm", None), ("1.2.3 mm", None), ("", None),
    ],
)  # fmt: skip
def test_lengths_with_units(text, metre):
    assert metres(text) == (None if metre is None else pytest.approx(metre, rel=1e-12))
