"""Error against run time: what is measured is true error, and the budget is kept."""

import time

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.accuracy.experiments import PARTS
from fractalcontact.accuracy.reporting import curves_table
from fractalcontact.base.errors import InvalidInput


@pytest.mark.parametrize("part", list(PARTS))
def test_each_part_is_measured_within_its_budget(part):
    start = time.perf_counter()
    tree = fc.accuracy.measure(part, budget=4)
    assert time.perf_counter() - start < 60
    data = tree[part].to_dataset()
    assert data["error"].dims == ("method", "knob")
    measured = np.isfinite(data["error"].values)
    assert measured.any(axis=1).all()
    assert (data["run_time"].values[measured] > 0).all()
    assert (data["first_run_time"].values[measured] >= data["run_time"].values[measured]).all()
    assert data["error"].attrs["truth"]
    assert part in curves_table(tree)


def test_the_error_of_the_solver_falls_with_the_spacing():
    data = fc.accuracy.measure("contact", budget=20)["contact"].to_dataset()
    square = data["error"].sel({"method": "fast, square"}).dropna("knob")
    assert square.values[-1] < 0.1 * square.values[0]
    paper, fast = (
        data["error"].sel({"method": name}).dropna("knob") for name in ("elimination, disc", "fast, disc")
    )
    common = np.intersect1d(paper["knob"], fast["knob"])
    np.testing.assert_allclose(paper.sel(knob=common), fast.sel(knob=common), atol=1e-6)


def test_unknown_parts_and_budgets_are_refused():
    with pytest.raises(InvalidInput, match="magic"):
        fc.accuracy.measure("magic")
    with pytest.raises(InvalidInput, match="budget"):
        fc.accuracy.measure("contact", budget=0)
