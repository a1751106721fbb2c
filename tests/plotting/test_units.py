"""Prefixes: the shown value times the prefix is the value, and the axis is readable."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure

from fractalcontact import plotting

POWERS = {"T": 1e12, "G": 1e9, "M": 1e6, "k": 1e3, "": 1.0, "m": 1e-3, "µ": 1e-6, "n": 1e-9, "p": 1e-12}


def shown(values, units):
    """Return the unit on the colour bar of a field, and the range of numbers on it."""
    plane = xr.DataArray(np.atleast_2d(values), dims=("y", "x"), name="field", attrs={"units": units})
    bar = plotting.field(plane, ax=Figure().add_subplot()).figure.axes[1]
    return bar.get_ylabel().removeprefix("field").strip(" ()"), bar.get_ylim()


@given(st.floats(1e-11, 1e14), st.sampled_from(["m", "N", "Pa", "J"]))
@settings(max_examples=20, deadline=None)
def test_prefix_matches_values(value, units):
    unit, (low, high) = shown([0.1 * value, -value], units)
    factor = POWERS[unit.removesuffix(units)]
    assert np.array([low, high]) * factor == pytest.approx([-value, 0.1 * value])
    assert 0.5 <= -low < 501


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
        (2e9, "Pa m-1", "2 MPa/mm"),
        (9e7, "N m-1", "90 kN/mm"),
        (0.25, "1", "0.25"),
        (0.0, "m", "0 m"),
    ],
)
def test_amounts(value, units, text):
    unit, limits = shown(value, units)
    assert f"{round(np.mean(limits), 15):.3g} {unit}".rstrip() == text


def test_exponents_are_raised():
    assert shown(1.0, "rad m-1")[0] == "rad m⁻¹"
    assert shown(1.0, "m4")[0] == "m⁴"
    assert shown(1e-12, "m4")[0] == "m⁴"


def test_no_finite_value_gives_unit_without_prefix():
    assert shown([np.nan, np.inf], "m")[0] == "m"
    assert shown(np.nan, "m")[0] == "m"
