"""Orders of convergence: error against spacing for each influence and each problem with a closed form."""

import numpy as np
import pytest

import fractalcontact as fc

SECOND = {
    "second order": {},
    "square": {"influence": "square"},
}
FIRST = {
    "inscribed": {"disc_radius": "inscribed"},
    "equal area": {"disc_radius": "equal_area"},
}
RADII = np.array([6, 12, 24])


def press(heights, periodic=False, **options):
    surface = fc.surfaces.from_array(heights, 1.0, periodic=periodic)
    return fc.contact.press(surface, contact_modulus=1.0, tolerance=1e-9, keep=(), **options)


def ball(y, x, radius, **options):
    curvature = 100.0 * radius
    heights, depth = -(x**2 + y**2) / (2 * curvature), radius**2 / curvature
    result = press(heights, closure=depth + heights.max(), **options)
    return result["normal_force"] / (4 / 3 * curvature**0.5 * depth**1.5) - 1


def area_of_a_ball(y, x, radius, name="contact_fraction", **options):
    heights = -(x**2 + y**2) / (2 * radius)
    result = press(heights, closure=radius + heights.max(), **options)
    return result[name] * heights.size / (np.pi * radius**2) - 1


def energy_of_a_ball(y, x, radius, **options):
    curvature = 100.0 * radius
    heights, depth = -(x**2 + y**2) / (2 * curvature), radius**2 / curvature
    result = press(heights, closure=depth + heights.max(), **options)
    return result["elastic_energy"] / (8 / 15 * curvature**0.5 * depth**2.5) - 1


def cone(y, x, radius, **options):
    heights = -0.1 * np.hypot(x, y)
    result = press(heights, closure=np.pi * radius * 0.05 + heights.max(), **options)
    return result["normal_force"] / (np.pi * radius**2 * 0.05) - 1


def round_punch(y, x, radius, **options):
    result = press(np.where(np.hypot(x, y) <= radius, 1.0, 0.0), closure=1e-3, **options)
    return result["normal_force"] / (2e-3 * radius) - 1


def root_mean_square(problem, places=4, radii=RADII, **options):
    """Error over the places of the centre between the nodes, for every radius."""
    rng, errors = np.random.default_rng(7), []
    for radius in radii:
        n, some = int(2.4 * radius) + 3, []
        for _ in range(places):
            start = rng.uniform(-0.5, 0.5, 2) - n / 2
            y, x = np.arange(n)[:, None] + start[0], np.arange(n)[None, :] + start[1]
            some.append(float(problem(y, x, radius * rng.uniform(1.0, 1.05), **options)[0]))
        errors.append(np.sqrt(np.mean(np.square(some))))
    return np.array(errors)


def order(errors, radii=RADII):
    return -np.polyfit(np.log(radii), np.log(errors), 1)[0]


@pytest.mark.parametrize("problem", [ball, cone, energy_of_a_ball])
@pytest.mark.parametrize("influence", SECOND)
def test_second_order_for_smooth_pressure(problem, influence):
    errors = root_mean_square(problem, **SECOND[influence])
    assert 1.7 < order(errors) < 2.5
    assert errors[-1] < 2e-4


@pytest.mark.parametrize("problem", [ball, cone])
@pytest.mark.parametrize("influence", FIRST)
def test_first_order_with_other_radii(problem, influence):
    errors = root_mean_square(problem, places=3, **FIRST[influence])
    assert order(errors) == pytest.approx(1.07, abs=0.06)


@pytest.mark.parametrize("influence", SECOND)
def test_round_punch_first_order(influence):
    errors = root_mean_square(round_punch, **SECOND[influence])
    assert 0.7 < order(errors) < 1.3
    assert errors[-1] < 0.15 / RADII[-1]


@pytest.mark.parametrize("influence", SECOND)
@pytest.mark.parametrize("aspect", [1, 3])
def test_rectangular_punch_first_order(influence, aspect):
    """Capacitance of a square, 1.15230 L; a rectangle against its own limit, by Richardson's rule."""
    stiffness = np.array(
        [
            fc.contact.flat_stiffness((n, n * aspect), 1 / n, contact_modulus=1.0, **SECOND[influence])
            for n in (12, 24, 48, 96)
        ]
    )
    limit = 1.15230 if aspect == 1 else 2 * stiffness[3] - stiffness[2]
    assert 2 * stiffness[3] - stiffness[2] == pytest.approx(limit, rel=2e-3)
    assert order(abs(stiffness[:3] / limit - 1), [12, 24, 48]) == pytest.approx(1.0, abs=0.06)


def test_rectangular_cells_same_limit():
    fine = fc.contact.flat_stiffness((96, 96), 1 / 96, contact_modulus=1.0, influence="square")
    long = fc.contact.flat_stiffness((48, 192), (1 / 48, 1 / 192), contact_modulus=1.0, influence="square")
    assert long == pytest.approx(fine, rel=1e-2)


@pytest.mark.parametrize("influence", SECOND)
def test_corrected_area_of_a_ball_converges(influence):
    """Both fall with the spacing; from 12 spacings on the corrected one has about a third of the error."""
    radii = [12, 24, 48]
    raw = root_mean_square(area_of_a_ball, radii=radii, **SECOND[influence])
    corrected = root_mean_square(
        area_of_a_ball, radii=radii, name="corrected_contact_fraction", **SECOND[influence]
    )
    assert order(raw, radii) == pytest.approx(1.0, abs=0.25)
    assert (corrected < 0.6 * raw).all()
    assert order(corrected, radii) > 0.8


def test_corrected_area_of_a_rough_surface_converges():
    """Raw area drifts and the corrected one stays on grids of 1, 1/2 and 1/4 of the points."""
    fine = fc.surfaces.spectral(
        (512, 512), 1.0, hurst=0.8, rms_slope=0.1, long_cutoff=512.0, short_cutoff=24.0, rng=3
    )
    raw, corrected = [], []
    for factor in (4, 2, 1):
        surface = fc.surfaces.from_array(fine.values[::factor, ::factor], float(factor), periodic=True)
        result = fc.contact.press(
            surface, contact_modulus=1.0, nominal_pressure=0.005, keep=(), tolerance=1e-6
        )
        raw.append(float(result["contact_fraction"][0]))
        corrected.append(float(result["corrected_contact_fraction"][0]))
    limit = 2 * corrected[-1] - corrected[-2]
    drift = abs(np.array(raw) / limit - 1), abs(np.array(corrected) / limit - 1)
    assert order(drift[0], [1, 2, 4]) == pytest.approx(1.0, abs=0.3)
    assert (drift[1] < 0.35 * drift[0]).all()


def wave(n, phase, share):
    heights = np.cos(2 * np.pi * (np.arange(n) + phase) / n) * np.ones((4, 1))
    return press(heights, periodic=True, nominal_pressure=share * np.pi / n)


def test_wave_gap_second_order_area_first():
    """Westergaard (1939): area 2/pi asin sqrt f, gap cos^2 + 2 f ln sin, at random phases and shares."""
    rng = np.random.default_rng(4)
    gaps, areas, sizes = [], [], [16, 32, 64, 128]
    for n in sizes:
        missed = []
        for _ in range(12):
            share = rng.uniform(0.1, 0.9)
            result, half = wave(n, rng.uniform(0, 1), share), np.arcsin(np.sqrt(share))
            gap = np.cos(half) ** 2 + 2 * share * np.log(np.sin(half))
            area = float(result["contact_fraction"][0]) - 2 * half / np.pi
            missed.append((float(result["mean_gap"][0]) - gap, area))
            assert abs(area) < 1.5 / n
        gap, area = np.sqrt(np.mean(np.square(missed), axis=0))
        gaps.append(gap)
        areas.append(area)
    assert order(gaps, sizes) == pytest.approx(2.0, abs=0.35)
    assert order(areas, sizes) == pytest.approx(1.0, abs=0.35)


def test_crossed_waves_gap_second_order():
    """Johnson, Greenwood and Higginson (1985) give 0.3848; finer grids than these tend to 0.384749."""
    rng, sizes, errors = np.random.default_rng(5), [16, 32, 64], []
    for n in sizes:
        missed = []
        for _ in range(6):
            along, across = (np.cos(2 * np.pi * (np.arange(n) + rng.uniform()) / n) for _ in range(2))
            surface, pressure = across[:, None] * along, 0.1 * np.sqrt(2) * np.pi / n
            result = press(surface, periodic=True, nominal_pressure=pressure)
            missed.append(float(result["mean_gap"][0]) - 0.384749)
        errors.append(np.sqrt(np.mean(np.square(missed))))
    assert 1.5 < order(errors, sizes) < 2.6


@pytest.mark.parametrize("shape", [(16, 16), (15, 20), (9, 64)])
def test_flattened_wave_is_exact(shape):
    """Full contact of one wave: pressure amplitude E* |q| a/2 about the mean."""
    y, x = np.arange(shape[0])[:, None] * 2.0, np.arange(shape[1])[None, :] * 0.5
    q = np.array([2 * np.pi / (2.0 * shape[0]), -4 * np.pi / (0.5 * shape[1])])
    heights = 1e-3 * np.cos(q[0] * y + q[1] * x + 0.3)
    surface = fc.surfaces.from_array(heights, (2.0, 0.5), periodic=True)
    result = fc.contact.press(
        surface, contact_modulus=3.0, nominal_pressure=1.0, keep=("pressure",), tolerance=1e-13
    )
    exact = 1.0 + 3.0 * np.hypot(*q) / 2 * heights
    np.testing.assert_allclose(result["pressure"][0], exact, rtol=1e-12)
