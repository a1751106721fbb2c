"""Warnings are issued at the line of the user's code, however deep in the package they arise."""

import warnings

import pytest

import fractalcontact as fc
from fractalcontact.base.errors import ConvergenceWarning, FractalContactWarning


@pytest.mark.parametrize(
    "call",
    [
        lambda rough: fc.contact.press(1e3 * rough, contact_modulus=1e9, nominal_pressure=1e4),
        lambda rough: fc.joints.closure(
            fc.joints.Crack(1e3 * rough, young=1e9, poisson=0.2, block=5e-3), shear=1e-3, nominal_pressure=1e4
        ),
        lambda rough: fc.surfaces.level(rough.assign_coords(x=1e6 * rough.x.values, y=1e6 * rough.y.values)),
    ],
    ids=["press", "closure", "no_unit"],
)
def test_warning_names_the_line_of_the_caller(call):
    rough = fc.surfaces.fbm((16, 16), 1e-3, hurst=0.7, rms_increment=1e-6, rng=1)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call(rough)
    ours = [warning for warning in caught if issubclass(warning.category, FractalContactWarning)]
    assert ours
    assert {warning.filename for warning in ours} == {__file__}


def test_unconverged_result_names_the_line_of_the_caller():
    rough = fc.surfaces.fbm((16, 16), 1e-3, hurst=0.7, rms_increment=1e-6, rng=1)
    with pytest.warns(ConvergenceWarning) as caught:
        fc.contact.press(rough, contact_modulus=1e9, nominal_pressure=1e4, tolerance=1e-18)
    assert {warning.filename for warning in caught} == {__file__}
