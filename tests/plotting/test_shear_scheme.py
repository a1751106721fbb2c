"""Plan and section of the sliding block."""

import numpy as np
import plotting_synthetic as synthetic
import pytest
from plotting_figures import factor, render

from fractalcontact import plotting
from fractalcontact.base.errors import InvalidInput


def test_plan_and_section():
    surface = synthetic.heights()
    slid = synthetic.delta(surface, shears=(8e-3,))
    plan, cut = plotting.sliding_scheme(surface, slid)
    start, moved = plan.patches
    assert start.get_x() - moved.get_x() == pytest.approx(8.0)  # to West
    assert start.get_y() == pytest.approx(moved.get_y())
    ground, block = (np.array([line.get_xdata(), line.get_ydata()]) for line in cut.lines[:2])
    lift = float(slid.max())
    row = surface.sel(y=slid.y[slid.sizes["y"] // 2])
    assert ground[1] == pytest.approx(row.values[::-1] * 1e3)
    assert block[1] == pytest.approx((row.sel(x=slid.x).values[::-1] + lift) * 1e3)
    assert f"{lift * 1e6:.3g}" in cut.texts[-1].get_text()


def test_block_stays_above_lower_surface():
    surface = synthetic.heights()
    _, cut = plotting.sliding_scheme(surface, synthetic.delta(surface))
    ground, block = (np.array([line.get_xdata(), line.get_ydata()]) for line in cut.lines[:2])
    below = np.interp(block[0, 1:-1], *ground)
    assert (block[1, 1:-1] >= below - 1e-9).all()


def test_zero_shear_and_other_directions():
    surface = synthetic.heights()
    slid = synthetic.delta(surface, shears=(8e-3,))
    render(plotting.sliding_scheme(surface, synthetic.delta(surface, shears=(0.0,))))
    render(plotting.sliding_scheme(surface, slid.assign_coords(direction="N", azimuth=90.0)))
    render(plotting.sliding_scheme(surface, slid.assign_coords(direction="30", azimuth=30.0)))


def test_heights_are_exaggerated_as_the_title_says():
    surface = synthetic.heights()
    _, cut = plotting.sliding_scheme(surface, synthetic.delta(surface))
    cut.figure.draw_without_rendering()
    (x, y), (right, top) = cut.transData.transform([(0, 0), (1, 1)])
    units = [factor(label) for label in (cut.get_xlabel(), cut.get_ylabel())]
    times = ((top - y) / units[1]) / ((right - x) / units[0])
    assert cut.get_title(loc="left").endswith(f"heights × {times:.0f}")


@pytest.mark.parametrize("argument", ["surface", "delta", "upper"])
@pytest.mark.parametrize("height", [np.inf, -np.inf])
def test_infinite_height_is_refused(argument, height):
    surface = synthetic.heights()
    arguments = {"surface": surface, "delta": synthetic.delta(surface), "upper": surface}
    arguments[argument] = arguments[argument].copy(deep=True)
    arguments[argument][..., 3, 3] = height
    with pytest.raises(InvalidInput) as caught:
        plotting.sliding_scheme(**arguments)
    assert caught.value.problems == (f"{argument}: expected finite heights, or NaN, got 1 infinite",)
