"""Hydraulic from mechanical aperture at worked values, and against solved flow."""

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc


def test_hydraulic_aperture_of_barton():
    # JRC 10: 10^2.5 = 316.228 micrometres, at and beyond which both apertures are equal
    mechanical = np.array([50e-6, 200e-6, 316.228e-6, 1e-3])
    result = fc.joints.hydraulic_aperture(mechanical, roughness_coefficient=10)
    apertures = result.hydraulic_aperture
    np.testing.assert_allclose(apertures * 1e6, [7.9057, 126.491, 316.228, 1000.0], rtol=1e-5)
    np.testing.assert_allclose(result.transmissivity, apertures**3 / 12)
    np.testing.assert_array_equal(result.aperture, mechanical)


def test_labelled_apertures_keep_their_dims():
    gaps = xr.DataArray([[1e-4, 2e-4], [3e-4, 4e-4]], dims=("shear", "step"))
    closed = xr.DataArray([0.0, 0.1], dims="step")
    result = fc.joints.hydraulic_aperture(gaps, model="walsh", contact_fraction=closed)
    assert result.hydraulic_aperture.dims == ("shear", "step")
    np.testing.assert_allclose(result.hydraulic_aperture[:, 1], np.cbrt(0.9 / 1.1) * gaps[:, 1])


def test_hydraulic_aperture_by_hand():
    def e(model, **options):
        result = fc.joints.hydraulic_aperture(1e-4, model=model, **options)
        return result.hydraulic_aperture.item() * 1e6

    assert e("lognormal", spread=0.75e-4) == pytest.approx(80.0)  # 100/sqrt(1.5625)
    assert e("walsh", contact_fraction=0.2) == pytest.approx(100 * (2 / 3) ** (1 / 3))
    worked = e("zimmerman_bodvarsson", spread=4e-5, contact_fraction=0.1)
    assert worked == pytest.approx(100 * 0.608 ** (1 / 3))  # (1 - .24)(1 - .2)


def solved(gap):
    flow = fc.joints.transmissivity(gap)
    return float(flow["hydraulic_aperture"].mean())


def test_round_spots_against_the_solved_flow():
    """One round spot in each period of parallel plates."""
    n = 160
    x = np.arange(n) + 0.5 - n / 2
    gap = 1e-4 * (np.hypot(x, x[:, None]) > 0.18 * n)
    closed = float(np.mean(gap == 0))
    expected = solved(fc.surfaces.from_array(gap, 1e-4, periodic=True))
    for model, error in (("walsh", 0.005), ("zimmerman_bodvarsson", 0.02)):
        options = {"spread": 0.0} if model == "zimmerman_bodvarsson" else {}
        found = fc.joints.hydraulic_aperture(1e-4, model=model, contact_fraction=closed, **options)
        assert found.hydraulic_aperture.item() == pytest.approx(expected, rel=error)


@pytest.mark.parametrize(("spread", "series"), [(0.15, 0.01), (0.45, 0.05)])
def test_lognormal_apertures_against_the_solved_flow(spread, series):
    field = fc.surfaces.spectral((192, 192), 1e-3, hurst=0.8, rms_height=1.0, rolloff=12e-3, rng=2).values
    gap = 1e-4 * np.exp(np.sqrt(np.log(1 + spread**2)) * (field - field.mean()) / field.std())
    surface = fc.surfaces.from_array(gap, 1e-3, periodic=True)
    given, expected = {"spread": float(gap.std())}, solved(surface)
    renshaw = fc.joints.hydraulic_aperture(float(gap.mean()), model="lognormal", **given)
    assert renshaw.hydraulic_aperture.item() == pytest.approx(expected, rel=0.01)
    other = fc.joints.hydraulic_aperture(
        float(gap.mean()), model="zimmerman_bodvarsson", contact_fraction=0.0, **given
    )
    assert other.hydraulic_aperture.item() == pytest.approx(expected, rel=series)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "roughness_coefficient: expected a value for 'barton_bandis'"),
        ({"roughness_coefficient": 10, "spread": 1e-5}, "spread: expected nothing with 'barton_bandis'"),
        ({"roughness_coefficient": 30}, "roughness_coefficient: expected"),
        ({"model": "walsh", "contact_fraction": 0.3}, "contact_fraction: expected"),
        (
            {"model": "zimmerman_bodvarsson", "spread": 6e-5, "contact_fraction": 0.0},
            "spread: expected at most 0.5 of the aperture, got 0.6 of it",
        ),
        ({"model": "cubic"}, "model: expected"),
    ],
)
def test_hydraulic_aperture_outside_its_range(options, message):
    with pytest.raises(ValueError, match=message):
        fc.joints.hydraulic_aperture(1e-4, **options)


def test_arrays_of_several_shapes_are_refused():
    with pytest.raises(ValueError, match="arrays of one shape"):
        fc.joints.hydraulic_aperture(np.full(3, 1e-4), model="walsh", contact_fraction=np.zeros(2))
