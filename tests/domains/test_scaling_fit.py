"""Fits of the Minkowski and the correlation dimension: exact limits, intervals, null, invariance."""

import numpy as np
import pytest
from domains.sets import DIMENSION, as_mask, koch_raster, lattice_set, placed, random_null

import fractalcontact as fc

BOTH = ("minkowski_dimension", "correlation_dimension")


def measured(name, mask, **options):
    result = getattr(fc.domains, name)(mask, **options)
    return result, result[name]


@pytest.mark.parametrize("shape", [(9, 9), (27, 27), (100, 37)])
@pytest.mark.parametrize("wraps", [False, True])
def test_row_column_and_full_mask_are_exact(shape, wraps):
    ny, nx = shape
    for y, x in ((0, 0), (ny // 2, nx // 3), (ny - 1, nx - 1)):
        planes = np.zeros((4, ny, nx), bool)
        planes[0, y, x] = planes[1, y] = planes[2, :, x] = planes[3] = True
        mask = as_mask(planes, periodic=(wraps, wraps))
        for name in BOTH:
            result, dimension = measured(name, mask)
            assert dimension.values[1:] == pytest.approx([1, 1, 2], abs=1e-12)
            assert (result.ci_high - result.ci_low).values[1:] == pytest.approx([0, 0, 0], abs=1e-12)
            assert (
                result.ci_low.values[0] <= (0.35 if name == BOTH[0] else 0) <= result.ci_high.values[0] + 0.2
            )
        assert float(measured(BOTH[1], mask)[1][0]) == 0.0


@pytest.mark.parametrize("name", BOTH)
def test_null_is_the_mean_of_realisations(name):
    rng = np.random.default_rng(3)
    planes = np.array([random_null(64, 200, rng) for _ in range(200)])
    result = getattr(fc.domains, name)(as_mask(planes, periodic=(True, True)))
    curve, null = ("grown_fraction", "null_fraction") if name == BOTH[0] else ("mean_mass", "null_mass")
    values = result[curve].values
    error = values.std(0) / np.sqrt(200)
    assert np.all(np.abs(values.mean(0) - result[null].values[0]) <= 4 * error + 1e-9)
    assert float(result.null_dimension[0]) == pytest.approx(float(result[name].mean()), abs=0.03)


@pytest.mark.parametrize("name", BOTH)
def test_interval_covers_sets_placed_anywhere(name):
    rng = np.random.default_rng(4)
    for _ in range(2):
        for family, level in (("carpet", 5), ("cantor_dust", 5), ("vicsek", 5), ("gasket", 8)):
            result = getattr(fc.domains, name)(as_mask(placed(lattice_set(family, level), 400, rng)))
            assert float(result.ci_low) <= DIMENSION[family] <= float(result.ci_high), family
        result = getattr(fc.domains, name)(as_mask(koch_raster(400, rng)))
        assert float(result.ci_low) <= DIMENSION["koch"] <= float(result.ci_high)


@pytest.mark.parametrize("name", BOTH)
def test_periodic_shifts_and_mirrors_change_nothing(name):
    cells = random_null(60, 300, np.random.default_rng(5))
    expected = measured(name, as_mask(cells, periodic=(True, True)))[1].item()
    for other in (np.roll(cells, (7, 50), (0, 1)), cells[::-1], cells.T):
        assert measured(name, as_mask(other, periodic=(True, True)))[1].item() == pytest.approx(
            expected, rel=1e-12
        )


@pytest.mark.parametrize("name", BOTH)
def test_stack_equals_its_planes(name):
    planes = np.array([np.zeros((40, 40)), random_null(40, 100, np.random.default_rng(6)), np.ones((40, 40))])
    result, dimension = measured(name, as_mask(planes[None], dims=("shear", "step", "y", "x")))
    assert dimension.dims == ("shear", "step")
    assert np.isnan(dimension.values[0, 0])
    assert "empty (1 planes)" in dimension.attrs["comment"]
    for k in (1, 2):
        alone = measured(name, as_mask(planes[k]))[0]
        for variable in (name, "ci_low", "null_dimension", "local_slope"):
            assert np.array_equal(alone[variable].values, result[variable].values[0, k])


@pytest.mark.parametrize("name", BOTH)
def test_unobserved_cells_change_the_dimension_little(name):
    rng = np.random.default_rng(7)
    valid = rng.random((243, 243)) < 0.9
    valid[50:90, 100:160] = False
    carpet = as_mask(lattice_set("carpet", 5))
    complete = measured(name, carpet)[1].item()
    assert measured(name, carpet, valid=as_mask(valid))[1].item() == pytest.approx(complete, abs=0.05)
    full = measured(name, as_mask(np.ones((243, 243))), valid=as_mask(valid))[1].item()
    assert full == pytest.approx(2.0, abs=1e-12)
