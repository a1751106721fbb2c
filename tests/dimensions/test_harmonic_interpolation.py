"""Harmonic interpolation over missing points, against its equations and its transpose."""

import numpy as np
import pytest

from fractalcontact.dimensions._harmonic_interpolation import Filling


def test_filling_of_plane_and_transpose(holes):
    filling = Filling(holes, (2.0, 1.0))
    y, x = np.indices(holes.shape)
    plane = 0.3 * y - 0.1 * x + 5.0
    assert np.abs(filling(np.where(holes, plane, np.nan))).max() < 1e-12
    rng = np.random.default_rng(6)
    surface, values = rng.standard_normal((2, *holes.shape))
    assert np.sum(filling(values) * surface) == pytest.approx(
        np.sum(values * filling.transpose(surface)), rel=1e-12
    )


@pytest.mark.parametrize("ratio", [1.0, 1.3])
def test_large_gaps_are_harmonic(ratio):
    """Each missing height is the weighted mean of its neighbours, whichever solver is used."""
    rng = np.random.default_rng(9)
    observed = rng.random((260, 301)) > 0.05
    observed[20:230, 40:240] = False  # 2^15 points and more are not eliminated
    observed[:, -30:-20] = False
    observed[100:104, 100:104] = True
    filling = Filling(observed, (ratio, 1.0))
    values = np.cumsum(rng.standard_normal(observed.shape), axis=1)
    filled = np.pad(filling(values), 1, mode="edge")  # the border has no neighbour beyond it
    vertical = filled[2:, 1:-1] + filled[:-2, 1:-1] - 2.0 * filled[1:-1, 1:-1]
    along = filled[1:-1, 2:] + filled[1:-1, :-2] - 2.0 * filled[1:-1, 1:-1]
    assert np.abs((vertical / ratio**2 + along)[~observed]).max() < 1e-6 * np.std(values[observed])
    surface = rng.standard_normal(observed.shape)
    assert np.sum(filling(values) * surface) == pytest.approx(
        np.sum(values * filling.transpose(surface)), rel=1e-7
    )


def test_filling_without_gaps_removes_plane():
    observed = np.ones((5, 6), dtype=bool)
    values = np.random.default_rng(7).standard_normal(30)
    filled = Filling(observed, (1.0, 1.0))(values.reshape(5, 6))
    columns = np.stack([np.ones(30), *(p.ravel() for p in np.indices((5, 6)))], axis=1)
    rest = values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]
    np.testing.assert_allclose(filled.ravel(), rest, atol=1e-13)


def test_middle_of_a_large_gap_is_harmonic():
    """The heights x^2 - y^2 are harmonic, and no plane; cells of four points hold the middle of the gap."""
    observed = np.ones((403, 381), dtype=bool)
    observed[30:370, 31:361] = False
    observed[380:, 10:30] = False
    filling = Filling(observed, (1.0, 1.0))
    y, x = (p / 100.0 for p in np.indices(observed.shape))
    heights = x**2 - y**2
    rest = (heights - filling(np.where(observed, heights, np.nan))).ravel()
    columns = np.stack([np.ones(heights.size), y.ravel(), x.ravel()], axis=1)
    known, gap = observed.ravel(), np.zeros_like(observed)
    plane = columns @ np.linalg.lstsq(columns[known], rest[known], rcond=None)[0]
    gap[30:370, 31:361] = True
    assert np.abs(rest - plane)[known].max() < 1e-12
    assert 1e-9 < np.abs(rest - plane)[gap.ravel()].max() < 0.08  # the slope is 0.08 a point
    values, surface = np.random.default_rng(2).standard_normal((2, *observed.shape))
    assert np.sum(filling(values) * surface) == pytest.approx(
        np.sum(values * filling.transpose(surface)), rel=1e-4
    )
