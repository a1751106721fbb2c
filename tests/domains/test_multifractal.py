"""Generalised dimensions: exact values of cascades and lattice sets, large orders, unobserved cells."""

import numpy as np
import pytest
import xarray as xr
from domains.sets import DIMENSION, as_mask, lattice_set, level_set

import fractalcontact as fc

WEIGHTS = np.array([[0.1, 0.2], [0.3, 0.4]])
Q = np.array([-4, -1, 0, 0.5, 1, 2, 4])


def cascade(levels, weights=WEIGHTS):
    measure = np.ones((1, 1))
    for _ in range(levels):
        measure = np.kron(measure, weights)
    return xr.DataArray(measure, dims=("y", "x"))


def test_cascade_of_four_weights_is_exact():
    result = fc.domains.generalised_dimensions(cascade(9), Q)
    weights = WEIGHTS.ravel()[:, None]
    tau = -np.log2((weights**Q).sum(0))
    assert result.mass_exponent.values == pytest.approx(tau, abs=1e-12)
    published = {-4: -13.397075518767, 2: 1.736965594166, 4: 4.820106829466}
    for order, value in published.items():
        assert float(result.mass_exponent.sel(moment_order=order)) == pytest.approx(value, abs=1e-11)
    plain = Q != 1
    expected = tau[plain] / (Q[plain] - 1)
    assert result.generalised_dimension.values[plain] == pytest.approx(expected, abs=1e-12)
    assert float(result.generalised_dimension.sel(moment_order=1)) == pytest.approx(1.846439344671, abs=1e-12)
    alpha = -((weights**Q) * np.log2(weights)).sum(0) / (weights**Q).sum(0)
    assert result.singularity_strength.values == pytest.approx(alpha, abs=1e-11)
    assert result.singularity_spectrum.values == pytest.approx(Q * alpha - tau, abs=1e-11)
    assert (result.ci_high - result.ci_low).values == pytest.approx(np.zeros(Q.size), abs=1e-11)


def test_dimension_falls_with_the_order_and_is_continuous_at_one():
    result = fc.domains.generalised_dimensions(cascade(7), [0, 0.999999, 1, 1.000001, 3])
    values = result.generalised_dimension.values
    assert np.all(np.diff(values) < 0)
    assert values[1] == pytest.approx(values[2], abs=1e-5)


def test_cascade_by_three():
    weights = np.array([[1, 2, 1], [3, 0, 3], [1, 2, 1]]) / 14
    result = fc.domains.generalised_dimensions(cascade(5, weights), Q, box_sizes=[1, 3, 9, 27, 81])
    positive = weights[weights > 0][:, None]
    tau = -np.log((positive**Q).sum(0)) / np.log(3)
    assert result.mass_exponent.values == pytest.approx(tau, abs=1e-12)


def test_monofractal_sets_have_one_dimension():
    for name, scales in (("gasket", [1, 2, 4, 8, 16]), ("carpet", [1, 3, 9, 27])):
        level = 6 if name == "gasket" else 4
        result = fc.domains.generalised_dimensions(as_mask(lattice_set(name, level)), box_sizes=scales)
        assert result.generalised_dimension.values == pytest.approx(np.full(5, DIMENSION[name]), abs=1e-13)


def test_order_zero_is_the_aligned_box_count():
    mask = as_mask(level_set(64, 0.5, 0.1, np.random.default_rng(1)))
    scales = [1, 2, 4, 8]
    boxes = fc.domains.box_dimension(mask, box_sizes=scales, cover="aligned")
    result = fc.domains.generalised_dimensions(mask, 0, box_sizes=scales)
    assert float(result.generalised_dimension[0]) == pytest.approx(float(boxes.box_dimension), abs=1e-13)
    assert float(result.ci_low[0]) == pytest.approx(float(boxes.ci_low), abs=1e-12)


def test_unit_of_the_measure_changes_no_bit():
    unit = fc.domains.generalised_dimensions(cascade(6), Q)
    scaled = fc.domains.generalised_dimensions(cascade(6) * 2.0**-900, Q)
    assert unit.mass_exponent.identical(scaled.mass_exponent)


def test_large_orders_do_not_underflow():
    result = fc.domains.generalised_dimensions(cascade(9), [200.0, -200.0])
    assert result.generalised_dimension.values == pytest.approx(
        [200 / 199 * -np.log2(0.4), 200 / 201 * -np.log2(0.1)], rel=1e-9
    )


def test_empty_planes_and_stacks():
    planes = np.zeros((2, 16, 16))
    planes[1] = 1
    result = fc.domains.generalised_dimensions(as_mask(planes))
    assert np.isnan(result.generalised_dimension.values[0]).all()
    assert result.generalised_dimension.values[1] == pytest.approx(np.full(5, 2.0))
    assert "empty (1 planes)" in result.generalised_dimension.attrs["comment"]
    assert result.generalised_dimension.dims == ("step", "moment_order")


@pytest.mark.parametrize("invalid", [-1.0, np.nan, np.inf])
def test_invalid_measures_are_refused(invalid):
    values = cascade(3).copy()
    values[2, 3] = invalid
    with pytest.raises(ValueError, match="1 of 64 NaN, infinite or negative"):
        fc.domains.generalised_dimensions(values)


def test_unobserved_cells_keep_a_full_plane_full():
    rng = np.random.default_rng(9)
    valid = rng.random((64, 64)) < 0.8
    result = fc.domains.generalised_dimensions(
        as_mask(np.ones((64, 64))), [-1.0, 0.0, 1.0, 2.0, 3.0], valid=as_mask(valid)
    )
    assert result.generalised_dimension.values == pytest.approx(np.full(5, 2.0), abs=1e-12)
    weights = fc.domains.generalised_dimensions(
        as_mask(np.ones((64, 64))).astype(float) * 3.5, [0.0, 2.0], valid=as_mask(valid)
    )
    assert weights.generalised_dimension.values == pytest.approx([2.0, 2.0], abs=1e-12)
