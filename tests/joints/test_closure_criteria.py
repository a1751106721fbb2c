"""Closure and aperture after Barton and Bandis at worked values; aperture relations against solved flow."""

import numpy as np
import pytest

import fractalcontact as fc


def test_bandis_aperture():
    # a = JRC/5 (0.2 UCS/JCS - 0.1) mm: 2 (0.2 - 0.1), 2 (0.4 - 0.1), 1 (0.3 - 0.1)
    worked = {(10, 100e6, 100e6): 0.2e-3, (10, 50e6, 100e6): 0.6e-3, (5, 40e6, 60e6): 0.2e-3}
    for (jrc, jcs, ucs), aperture in worked.items():
        assert fc.joints.bandis_aperture(jrc, jcs, ucs) == pytest.approx(aperture)
    with pytest.raises(ValueError, match="wall_strength: expected at most compressive_strength"):
        fc.joints.bandis_aperture(10, 100e6, 50e6)


def test_bandis_closure():
    constants = fc.joints.bandis_constants(10, 100e6, 0.2e-3)
    assert constants.initial_stiffness == pytest.approx(20.35e9)
    assert constants.greatest_closure == pytest.approx(0.136871e-3, rel=1e-5)
    closures = fc.joints.bandis_closure(
        np.array([0.0, 1e6, 10e6, 30e6]),
        initial_stiffness=constants.initial_stiffness,
        greatest_closure=constants.greatest_closure,
    )
    np.testing.assert_allclose(closures, np.array([0, 0.036158, 0.107053, 0.125243]) * 1e-3, rtol=1e-5)


# (JCS/a)^D of 500 MPa/mm: ln 500 = 6.214608, exp(-1.429981) = .239313, exp(-1.559867) = .210164
@pytest.mark.parametrize(
    ("cycle", "closure"),
    [
        (2, -0.1005 - 0.073 + 1.0082 * 0.239313),
        (3, -0.1032 - 0.074 + 1.1350 * 0.210164),
    ],
)
def test_bandis_cycles(cycle, closure):
    constants = fc.joints.bandis_constants(10, 100e6, 0.2e-3, cycle=cycle)
    assert constants.greatest_closure == pytest.approx(closure * 1e-3, rel=1e-4)
    first = fc.joints.bandis_constants(10, 100e6, 0.2e-3)
    assert constants.greatest_closure < first.greatest_closure
    assert constants.initial_stiffness == first.initial_stiffness


def test_cycles_are_three():
    with pytest.raises(ValueError, match="cycle: expected"):
        fc.joints.bandis_constants(10, 100e6, 0.2e-3, cycle=4)


def test_no_closure_outside_the_fit():
    with pytest.raises(ValueError, match="0.274 mm"):  # of an aperture of 0.1 mm
        fc.joints.bandis_constants(5, 22e6, 0.1e-3)
    with pytest.raises(ValueError, match="values inside the range of the fit"):
        fc.joints.bandis_constants(20, 200e6, 0.01e-3)


def test_hydraulic_aperture_of_barton():
    # JRC 10: 10^2.5 = 316.228 micrometres, at and beyond which both apertures are equal
    apertures = fc.joints.hydraulic_aperture(np.array([[50e-6, 200e-6], [316.228e-6, 1e-3]]), roughness=10)
    np.testing.assert_allclose(apertures * 1e6, [[7.9057, 126.491], [316.228, 1000.0]], rtol=1e-5)


def test_hydraulic_aperture_by_hand():
    def e(model, **options):
        return float(fc.joints.hydraulic_aperture(1e-4, model=model, **options)) * 1e6

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
        assert float(found) == pytest.approx(expected, rel=error)


@pytest.mark.parametrize(("spread", "series"), [(0.15, 0.01), (0.45, 0.05)])
def test_lognormal_apertures_against_the_solved_flow(spread, series):
    field = fc.surfaces.spectral((192, 192), 1e-3, hurst=0.8, rms_height=1.0, rolloff=12e-3, rng=2).values
    gap = 1e-4 * np.exp(np.sqrt(np.log(1 + spread**2)) * (field - field.mean()) / field.std())
    surface = fc.surfaces.from_array(gap, 1e-3, periodic=True)
    given = {"spread": float(gap.std())}
    renshaw = fc.joints.hydraulic_aperture(float(gap.mean()), model="lognormal", **given)
    assert float(renshaw) == pytest.approx(solved(surface), rel=0.01)
    other = fc.joints.hydraulic_aperture(
        float(gap.mean()), model="zimmerman_bodvarsson", contact_fraction=0.0, **given
    )
    assert float(other) == pytest.approx(solved(surface), rel=series)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "roughness: expected a value for 'barton_bandis'"),
        ({"roughness": 10, "spread": 1e-5}, "spread: expected nothing with 'barton_bandis'"),
        ({"roughness": 30}, "roughness: expected"),
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
