"""Every result of the subpackage is labelled, survives a file, and complies with the CF conventions."""

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc


@pytest.fixture(scope="module")
def results(make_face, rough):
    heights = 2e-5 * rough((48, 48), 5)
    crack = fc.joints.Crack(make_face(heights, 8e-5), young=30e9, poisson=0.2, block=24 * 8e-5)
    shear = [0.0, 8e-5, 2e-4]
    opening = fc.joints.dilatancy(
        crack, shear=shear, direction=("E", 30.0), normal_force=[1.0, 50.0], keep=("state",)
    )
    closing = fc.joints.closure(crack, shear=shear, closure=[1e-6, 2e-6], keep=("state", "gap", "pressure"))
    sprung = fc.joints.dilatancy(
        crack, shear=shear, direction=("E", "W"), normal_force=[1.0, 50.0], normal_stiffness=1e10
    )
    other = make_face(heights + 1e-7 * rough((48, 48), 6) + 1e-4, 8e-5)
    return {
        "delta_surface": fc.joints.delta_surface(crack, shear, "N"),
        "one_delta_surface": fc.joints.delta_surface(crack, 1e-4, 30.0),
        "rigid": fc.joints.dilatancy(crack, shear=shear),
        "dilatancy": opening,
        "closure": closing,
        "sprung": sprung,
        "closure_laws": fc.joints.closure_laws(
            fc.joints.closure(crack, shear=shear, normal_force=[1, 5, 50])
        ),
        "roughness_coefficient": fc.joints.roughness_coefficient(crack.lower, direction=["E", 30]),
        "friction": fc.joints.friction(opening),
        "rigid_friction": fc.joints.friction(fc.joints.dilatancy(crack, shear=shear)),
        "transmissivity": fc.joints.transmissivity(closing.gap, viscosity=1e-3),
        "decorrelation_length": fc.joints.decorrelation_length(crack),
        "register": fc.joints.register(crack.lower, other),
    }


NAMES = (
    "sprung", "closure_laws", "roughness_coefficient",
    "delta_surface", "one_delta_surface", "rigid", "dilatancy", "closure", "friction", "rigid_friction",
    "transmissivity", "decorrelation_length", "register",
)  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_round_trip_and_compliance(results, name, tmp_path, compliance):
    result = results[name]
    path = fc.save(result, tmp_path / "result.nc")
    xr.testing.assert_identical(fc.open(path), result)
    assert compliance(path) == []


@pytest.mark.parametrize("name", NAMES)
def test_labels_and_provenance(results, name):
    result = results[name]
    assert '"call": "fractalcontact.joints.' in result.attrs["provenance"]
    assert result.attrs["Conventions"] == "CF-1.11"
    variables = result.variables if isinstance(result, xr.Dataset) else result.coords
    for key, variable in variables.items():
        assert variable.attrs["long_name"], key
        if variable.dtype.kind in "fi":
            assert "units" in variable.attrs, key
    if isinstance(result, xr.Dataset) and "run_time" in result:
        assert np.all(result["run_time"] >= 0)
