"""Dilatancy of rigid surfaces and elastic bodies."""

import plotting_synthetic as synthetic
import pytest
from plotting_figures import drawn, holds, render

from fractalcontact import plotting
from fractalcontact.base.errors import InvalidInput


def test_rigid_dilatancy_curves():
    opening = synthetic.dilatancy(forces=())
    ax = plotting.dilatancy(opening)
    for word in "ENWS":
        expected = opening.sel(direction=word)
        assert holds(drawn(ax), expected.shear, expected.rigid_dilatancy)
        end = float(opening.shear.max())
        assert holds(drawn(ax), [0, end], [0, end * float(expected.mean_slope)])


def test_shears_in_any_order_make_one_curve():
    opening = synthetic.dilatancy(forces=())
    ax = plotting.dilatancy(opening.isel(shear=slice(None, None, -1)))
    assert holds(drawn(ax), opening.shear, opening.rigid_dilatancy.sel(direction="E"))


def test_elastic_dilatancy_curves():
    opening = synthetic.dilatancy()
    ax = plotting.dilatancy(opening, direction="N", reach=8e-4)
    expected = opening.sel(direction="N").where(opening.shear < 8.1e-4, drop=True)
    assert holds(drawn(ax), expected.shear, expected.rigid_dilatancy)
    for step in range(3):
        assert holds(drawn(ax), expected.shear, expected.dilatancy.isel(step=step))
    assert len(ax.lines) == 4


def test_rigid_curve_is_no_step_number():
    """Under a spring each curve has a range of loads, and is named by its number."""
    opening = synthetic.dilatancy().sel(direction="E")
    opening = opening.assign_coords(normal_force=opening.normal_force * (1.0 + 100.0 * opening.shear))
    ax = plotting.dilatancy(opening)
    named = [text.get_text() for legend in ax.artists for text in legend.get_texts()]
    assert named == ["rigid", "0", "1", "2"]


def test_several_directions_are_refused():
    with pytest.raises(InvalidInput, match=r"one direction; choose with \.sel or \.isel, got 4"):
        plotting.dilatancy(synthetic.dilatancy())


def test_direction_names_and_styles():
    opening = synthetic.dilatancy(forces=(), directions=("E", "NE", "30", "33.5"))
    ax = plotting.dilatancy(opening)
    named = [text.get_text() for legend in ax.artists for text in legend.get_texts()]
    assert named[:4] == ["East", "NE", "30°", "33.5°"]
    styles = [(line.get_color(), line.get_linestyle()) for line in ax.lines[:8:2]]
    assert len(set(styles)) == 4
    render(ax.figure)


def test_single_shear():
    render(plotting.dilatancy(synthetic.dilatancy(shears=[8e-4], forces=())))
    render(plotting.dilatancy(synthetic.dilatancy(shears=[0.0], directions=("W",))))
