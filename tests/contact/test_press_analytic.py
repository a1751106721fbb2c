"""Closed forms: crossed waves, energy of a wave, cone, punch; scaling laws."""

import numpy as np
import pytest

import fractalcontact as fc

JGH = [  # nominal over full-contact pressure, corrected area, mean gap over amplitude (Johnson et al. 1985)
    (0.02, 0.0587, 0.7288),
    (0.10, 0.1906, 0.3848),
    (0.40, 0.620, 0.0769),
    (0.60, 0.7760, 0.0242),
    (0.90, 0.9507, None),
]


def test_johnson_greenwood_higginson_wave():
    n = 256
    wave = np.cos(2 * np.pi * np.arange(n) / n)
    surface = fc.surfaces.from_array(wave[:, None] * wave, 1 / n, periodic=True)
    full = np.sqrt(2) * np.pi
    shares = [share for share, _, _ in JGH]
    result = fc.contact.press(surface, contact_modulus=1.0, nominal_pressure=np.array(shares) * full, keep=())
    for step, (_, area, gap) in enumerate(JGH):
        assert float(result["corrected_contact_fraction"][step]) == pytest.approx(area, abs=2e-3)
        if gap is not None:
            assert float(result["mean_gap"][step]) == pytest.approx(gap, rel=1e-2)


@pytest.mark.parametrize("share", [0.05, 0.5, 0.8])
def test_westergaard_energy(share):
    n = 256
    x = np.cos(2 * np.pi * np.arange(n) / n)
    surface = fc.surfaces.from_array(np.broadcast_to(x, (8, n)), (1 / n, 1 / n), periodic=True)
    result = fc.contact.press(
        surface, contact_modulus=1.0, nominal_pressure=share * np.pi, keep=("pressure",)
    )
    area = 8 / n
    exact = np.pi * share**2 * (0.25 - np.log(share) / 2) * area
    assert float(result["elastic_energy"][0]) == pytest.approx(exact, rel=3e-4 + 0.02 * (share > 0.6))


def test_sneddon_cone():
    n = 129
    x = (np.arange(n) - n // 2) * 1.0
    slope = 0.1
    surface = fc.surfaces.from_array(-slope * np.hypot(x, x[:, None]), 1.0)
    depth = 3.0
    radius = 2 * depth / (np.pi * slope)
    result = fc.contact.press(surface, contact_modulus=1.0, closure=depth, keep=(), influence="square")
    assert float(result["normal_force"][0]) == pytest.approx(np.pi * radius**2 * slope / 2, rel=3e-3)
    assert float(result["contact_area"][0]) == pytest.approx(np.pi * radius**2, rel=0.06)


def test_round_punch_stiffness():
    n = 161
    x = np.arange(n) - n // 2
    punch = np.where(np.hypot(x, x[:, None]) <= 60, 1.0, 0.0)
    result = fc.contact.press(fc.surfaces.from_array(punch, 1.0), contact_modulus=1.0, closure=1e-3, keep=())
    radius = np.sqrt(float(result["contact_area"][0]) / np.pi)
    assert float(result["normal_force"][0]) == pytest.approx(2 * radius * 1e-3, rel=4e-3)


def test_inscribed_plate_error_is_first_order():
    half, cells = 40, 25.6
    x = np.arange(-half, half + 1)
    surface = fc.surfaces.from_array(-(x**2 + x[:, None] ** 2) / 2e3, 1.0)
    closure = cells**2 / 1e3
    result = fc.contact.press(surface, contact_modulus=1.0, closure=closure, disc_radius="inscribed", keep=())
    excess = float(result["normal_force"][0]) / (4 / 3 * np.sqrt(1e3) * closure**1.5) - 1
    assert excess * cells == pytest.approx(0.0539, rel=0.1)


@pytest.mark.parametrize("boundary", ["periodic", "free"])
def test_area_nearly_proportional_to_force(boundary):
    surface = fc.surfaces.spectral((128, 128), 1e-4, hurst=0.8, rms_slope=0.1, short_cutoff=8e-4, rng=5)
    share = np.array([0.002, 0.004, 0.008])
    result = fc.contact.press(
        surface, contact_modulus=1.0, nominal_pressure=0.1 * share, boundary=boundary, keep=()
    )
    slope = np.polyfit(np.log(share), np.log(result["contact_fraction"].values), 1)[0]
    assert 0.85 < slope < 1.02


def test_scaling_with_modulus_and_heights():
    surface = fc.surfaces.spectral((48, 48), 1e-4, hurst=0.7, rms_height=1e-6, rng=6)
    one = fc.contact.press(
        surface, contact_modulus=1e9, nominal_pressure=1e6, keep=("pressure",), tolerance=1e-12
    )
    stiff = fc.contact.press(
        surface, contact_modulus=3e9, nominal_pressure=3e6, keep=("pressure",), tolerance=1e-12
    )
    np.testing.assert_allclose(
        stiff["pressure"], 3 * one["pressure"], atol=1e-9 * float(one["pressure"].max())
    )
    np.testing.assert_allclose(stiff["closure"], one["closure"], rtol=1e-12)
    high = surface * 1e-5
    high["x"].attrs, high["y"].attrs = surface["x"].attrs, surface["y"].attrs
    low = fc.contact.press(
        high, contact_modulus=1e9, nominal_pressure=10.0, keep=("pressure",), tolerance=1e-12
    )
    np.testing.assert_allclose(low["closure"], 1e-5 * one["closure"], rtol=1e-12)


@pytest.mark.parametrize("offset", [0.0, 1e9])
def test_height_datum_is_irrelevant(offset):
    steps = np.round(np.random.default_rng(4).random((24, 24)) * 64) * 2.0**-4
    surface = fc.surfaces.from_array(steps + offset, 1.0)
    result = fc.contact.press(surface, contact_modulus=1.0, closure=0.5)
    plain = fc.contact.press(fc.surfaces.from_array(steps, 1.0), contact_modulus=1.0, closure=0.5)
    np.testing.assert_array_equal(result["normal_force"], plain["normal_force"])
