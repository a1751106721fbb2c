"""Correlation dimension: the mean mass pair by pair, a lattice of cells, one scale."""

import numpy as np
import pytest
import xarray as xr
from domains.sets import as_mask

import fractalcontact as fc


@pytest.mark.parametrize("wraps", [(False, False), (True, False), (True, True)])
def test_mean_mass_matches_pairs_one_by_one(wraps):
    rng = np.random.default_rng(2)
    ny, nx = 7, 9
    cells, valid = (
        (rng.random((ny, nx)) < 0.4).astype(np.uint8),
        (rng.random((ny, nx)) < 0.8).astype(np.uint8),
    )
    cells &= valid
    sizes = np.array([1, 2, 3, 4])
    expected = np.zeros(sizes.size)
    for down in range(-2, 3):
        for right in range(-2, 3):
            pairs = observed_pairs = 0
            for i in range(ny):
                for j in range(nx):
                    y, x = i + down, j + right
                    if (not wraps[0] and not 0 <= y < ny) or (not wraps[1] and not 0 <= x < nx):
                        continue
                    observed_pairs += int(valid[i, j] & valid[y % ny, x % nx])
                    pairs += int(cells[i, j] & cells[y % ny, x % nx])
            part = np.clip((sizes + 1) / 2 - abs(down), 0, 1) * np.clip((sizes + 1) / 2 - abs(right), 0, 1)
            expected += part * pairs / observed_pairs
    expected *= valid.sum() / cells.sum()
    mask, observed = as_mask(cells, periodic=wraps), as_mask(valid, periodic=wraps)
    result = fc.domains.correlation_dimension(mask, box_sizes=sizes, valid=observed)
    assert result.mean_mass.values == pytest.approx(expected, rel=1e-13)


def test_mean_mass_of_a_lattice():
    cells = np.zeros((48, 48))
    cells[::4, ::4] = 1
    mass = fc.domains.correlation_dimension(
        as_mask(cells, periodic=(True, True)), box_sizes=[1, 3, 7, 8, 9, 15]
    )
    # every fourth row and column: one cell, then a part of the outline, then 3 x 3
    assert mass.mean_mass.values == pytest.approx([1, 1, 1, 4, 9, 9])


def test_one_scale_gives_no_slope():
    mask = xr.DataArray(np.ones((1, 9), bool), dims=("y", "x"))
    result = fc.domains.correlation_dimension(mask)
    assert np.isnan(result.correlation_dimension)
    assert "no slope" in result.correlation_dimension.attrs["comment"]
    assert result.mean_mass.sizes["box_size"] == 1


def test_scales_must_be_integers():
    with pytest.raises(ValueError, match="box_sizes: expected integers, got 1.5"):
        fc.domains.correlation_dimension(as_mask(np.ones((5, 9))), box_sizes=[1.5])


def test_interval_stays_within_zero_and_two():
    rng = np.random.default_rng(3)
    planes = np.array([rng.random((81, 81)) < share for share in (2e-3, 0.02, 0.2, 0.9, 0.999)])
    result = fc.domains.correlation_dimension(as_mask(planes))
    for name in ("correlation_dimension", "ci_low", "ci_high"):
        assert result[name].min() >= 0
        assert result[name].max() <= 2
    assert (result.ci_high == 2).any()  # limited: two and a half deviations reach beyond
    lattice = np.zeros((48, 48))
    lattice[::4, ::4] = 1  # the mass jumps from 1 to 4 and 9: slopes above 2
    mask = as_mask(lattice, periodic=(True, True))
    assert float(fc.domains.correlation_dimension(mask, box_sizes=[6, 9, 10]).correlation_dimension) == 2.0
