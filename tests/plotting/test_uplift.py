"""Map of the water pressure with the diagram of the uplift."""

import numpy as np
import pytest
from plotting_figures import drawn, holds

import fractalcontact as fc


@pytest.mark.parametrize("edge", ["W", "N"])
def test_profiles_and_lines_of_action(edge):
    gap = np.where(np.arange(16) < 6, 2e-4, 1e-4) * np.ones((12, 1))
    result = fc.joints.uplift(
        fc.surfaces.from_array(gap, 1.0), upstream_pressure=490e3, upstream=edge, drains=[(4.5, 7.5)]
    )
    ax = fc.plotting.uplift(result)[1]
    dim = "x" if edge == "W" else "y"
    for name in ("joint", "linear", "bilinear"):
        one = result.sel(diagram=name)
        assert holds(drawn(ax), result[dim], one.uplift_profile)
    marks = [float(line.get_xdata()[0]) for line in ax.lines if len(line.get_xdata()) == 1]
    arms = result.uplift_arm.values
    np.testing.assert_allclose(marks, arms if edge == "W" else 12.0 - arms)


def test_several_gaps_are_refused():
    gap = fc.surfaces.from_array(np.full((4, 4), 1e-4), 1.0).expand_dims(step=2)
    with pytest.raises(ValueError, match="step"):
        fc.plotting.uplift(fc.joints.uplift(gap, upstream_pressure=1e5))
