"""Influence coefficients against closed forms, quadrature and the lattice sums they must obey."""

import numpy as np
import pytest
from scipy.integrate import dblquad

from fractalcontact.contact import _influence as influence
from fractalcontact.contact._operator import HalfSpaceOperator, PeriodicOperator


def test_disc_coefficients():
    table = influence.disc_coefficients((5, 7), (1.0, 1.0), 0.5)
    assert table[0, 0] == 1.0
    assert table[0, 1] == pytest.approx(1 / 3, rel=1e-14)
    assert table[3, 4] == pytest.approx(np.arcsin(0.1) / (0.5 * np.pi), rel=1e-14)
    np.testing.assert_array_equal(table[:5, :5], table[:5, :5].T)
    far = influence.disc_coefficients((2, 4000), (1.0, 1.0), 0.4)[0, 3999] * np.pi * 3999
    assert far == pytest.approx(1 + (0.4 / 3999) ** 2 / 6, rel=1e-13)


def test_love_square_coefficients():
    table = influence.square_coefficients((3, 3), (1.0, 1.0))
    assert table[0, 0] == pytest.approx(4 * np.log(1 + np.sqrt(2)) / np.pi, rel=1e-14)
    assert table[0, 1] == pytest.approx(0.330421493, rel=1e-8)


@pytest.mark.parametrize("spacing", [(1.0, 1.0), (1.0, 2.5), (0.3, 30.0), (7.0, 0.2)])
def test_love_rectangle_closed_form(spacing):
    shape = (60, 90)
    dy, dx = (np.longdouble(edge) for edge in spacing)
    y, x = np.arange(shape[0])[:, None] * dy, np.arange(shape[1])[None, :] * dx
    total = np.longdouble(0)
    for b, a, sign in ((1, 1, 1), (-1, -1, 1), (1, -1, -1), (-1, 1, -1)):
        u, v = y + b * dy / 2, x + a * dx / 2
        total = total + sign * (u * np.arcsinh(v / abs(u)) + v * np.arcsinh(u / abs(v)))
    exact = total / (np.longdouble(np.pi) * dy * dx)
    result = influence.square_coefficients(shape, spacing)
    assert float(np.abs(result / exact - 1).max()) < 1e-13


def test_love_rectangle_far_quadrature():
    result = influence.square_coefficients((400, 3), (1.0, 3.0))[399, 2]
    integral = dblquad(lambda y, x: 1 / np.hypot(399 + y, 6 + x), -1.5, 1.5, -0.5, 0.5, epsabs=1e-16)[0]
    assert result == pytest.approx(integral / (3 * np.pi), rel=1e-13)


def test_second_order_radius_square_grid():
    assert influence.second_order_radius(1.0) == pytest.approx(0.4365941, abs=5e-8)
    nearly = influence.second_order_radius(np.nextafter(1.0, 2.0))  # the root of the lattice sum
    assert influence.second_order_radius(1.0) == pytest.approx(nearly, rel=1e-14)


@pytest.mark.parametrize("ratio", [1.0, 1.3, 2.0])
def test_second_order_radius_matches_half_space(ratio):
    """Under uniform pressure the sum over plates less that over Love cells has no term in the spacing."""
    spacing = (np.sqrt(ratio), 1 / np.sqrt(ratio))
    radius = influence.second_order_radius(ratio)
    excess = []
    for n in (200, 400):
        shape = (int(n / np.sqrt(ratio)), int(n * np.sqrt(ratio)))
        plates = influence.disc_coefficients(shape, spacing, radius)
        cells = influence.square_coefficients(shape, spacing)
        weight = np.where(np.arange(shape[0])[:, None] > 0, 2, 1) * np.where(
            np.arange(shape[1])[None] > 0, 2, 1
        )
        excess.append(float(np.sum(weight * (plates - cells))))
    # what is left is the tail beyond the table, (a^2/6 - cell moments) / r^3, which halves with the table
    assert abs(2 * excess[1] - excess[0]) < 1e-5


@pytest.mark.parametrize(
    ("radius", "excess"), [(0.5, -0.11296), (1 / np.sqrt(np.pi), -0.18790), (0.4365941, 0.0)]
)
def test_local_excess(radius, excess):
    assert influence.local_excess(radius, 1.0) == pytest.approx(excess, abs=1e-4)


def test_epstein_zeta():
    assert influence.epstein_zeta(1, 1.0) == pytest.approx(-3.9002649200019558, rel=1e-13)
    assert influence.epstein_zeta(3, 1.0) == pytest.approx(9.0336216831, rel=1e-9)
    index = np.arange(-60, 61)
    distance = np.hypot(index[:, None] * np.sqrt(1.7), index[None, :] / np.sqrt(1.7))
    assert influence.epstein_zeta(7, 1.7) == pytest.approx(np.sum(distance[distance > 0] ** -7.0), rel=1e-9)


@pytest.mark.parametrize(
    ("choice", "ratio", "is_positive"),
    [
        *((choice, ratio, True) for choice in influence.DISC_RADII for ratio in (1.0, 1.5, 2.0)),
        ("inscribed", 5.0, True),
        ("equal_area", 3.0, False),
    ],
)
def test_plates_leave_the_operator_positive(choice, ratio, is_positive):
    """Up to the greatest ratio of the spacings; beyond, plates of equal area would not."""
    spacing = (np.sqrt(ratio), 1 / np.sqrt(ratio))
    radius = influence.disc_radius(choice, spacing)
    table = influence.disc_coefficients((14, 14), spacing, radius)
    index = np.abs(np.subtract.outer(np.arange(14), np.arange(14)))
    matrix = table[index[:, None, :, None], index[None, :, None, :]].reshape(196, 196)
    assert (np.linalg.eigvalsh(matrix).min() > 0) == is_positive


@pytest.mark.parametrize("shape", [(3, 5), (8, 8), (13, 7), (1, 9)])
@pytest.mark.parametrize("kind", ["disc", "square"])
def test_free_operator_matches_pair_sum(shape, kind):
    is_disc, spacing = kind == "disc", (0.7, 1.0)
    table = (
        influence.disc_coefficients(shape, spacing, 0.3)
        if is_disc
        else influence.square_coefficients(shape, spacing)
    )
    pressure = np.random.default_rng(1).random(shape)
    iy, ix = np.indices(shape)
    direct = np.array(
        [
            [np.sum(table[abs(iy - i), abs(ix - j)] * pressure) for j in range(shape[1])]
            for i in range(shape[0])
        ]
    )
    np.testing.assert_allclose(HalfSpaceOperator(table).apply(pressure), direct, rtol=1e-13)


@pytest.mark.parametrize("shape", [(8, 12), (9, 7), (31, 5)])
def test_periodic_operator_one_wave(shape):
    y, x = np.arange(shape[0])[:, None] * 0.5, np.arange(shape[1])[None, :] * 2.0
    q = (2 * np.pi / (shape[0] * 0.5), -2 * 2 * np.pi / (shape[1] * 2.0))
    wave = np.cos(q[0] * y + q[1] * x + 0.4)
    result = PeriodicOperator(shape, (0.5, 2.0)).apply(3.0 + wave)
    np.testing.assert_allclose(result, 2 * wave / np.hypot(*q), atol=1e-14)
