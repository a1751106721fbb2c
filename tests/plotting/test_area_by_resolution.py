"""Contact area against spacing, and strength against the size of the structure."""

from functools import partial

import numpy as np
import pytest
import xarray as xr
from matplotlib.legend import Legend
from plotting_figures import drawn, figure_of, holds, render

from fractalcontact import plotting
from fractalcontact.base.schema import label


def areas():
    rng = np.random.default_rng(1)
    dims = ("shear", "step", "resolution")
    return label(
        xr.Dataset(
            {
                "contact_fraction": (dims, rng.uniform(0.01, 0.02, (3, 2, 3))),
                "corrected_contact_fraction": (dims, rng.uniform(0.001, 0.01, (3, 2, 3))),
            },
            {
                "shear": [8e-5, 4e-4, 8e-3],
                "resolution": [8e-5, 1.6e-4, 4e-4],
                "normal_force": ("step", [1e3, 3e4]),
            },
        )
    )


def strengths():
    strength = np.array([[[1e5, 1e6], [2e5, 2e6]], [[np.nan, np.nan], [3e5, 2.5e6]]])
    return label(
        xr.Dataset(
            {
                "shear_strength": (("direction", "shear", "structure_size"), strength),
                "basic_friction_angle": 45.0,
            },
            {
                "direction": ["E", "N"],
                "shear": [8e-4, 8e-3],
                "structure_size": [10.0, 100.0],
                "nominal_pressure": ("structure_size", [2.4e5, 2.4e6]),
            },
        )
    )


def test_area_of_every_load_at_one_shear():
    result = areas()
    for options, shear in (({}, 1), ({"shear": 7e-3}, 2)):
        figure = figure_of(plotting.plot(result, "area_by_resolution", **options))
        ax = figure.axes[0]
        curves = drawn(ax)
        assert len(curves) == 4
        for name in ("contact_fraction", "corrected_contact_fraction"):
            for step in (0, 1):
                assert holds(curves, result.resolution, result[name][shear, step])
        assert [text.get_text() for text in ax.get_xticklabels()] == ["80", "160", "400"]
        render(figure)


def test_strength_of_every_direction_and_shear():
    result = strengths()
    figure = figure_of(plotting.plot(result, "self_weight"))
    curves = drawn(figure.axes[0])
    assert len(curves) == 5
    for direction in range(2):
        for shear in range(2):
            assert holds(curves, result.structure_size, result.shear_strength[direction, shear])
    assert holds(curves, result.structure_size, result.nominal_pressure)  # tan 45 degree
    render(figure)


def test_lines_of_strengths_tell_the_shears_apart():
    result = strengths().isel(shear=[1, 1, 1, 1]).assign_coords(shear=[1e-4, 2e-4, 4e-4, 8e-4])
    figure = figure_of(plotting.plot(result, "self_weight"))
    lines = {line.get_label(): (line.get_color(), line.get_linestyle()) for line in figure.axes[0].lines}
    assert len(lines) == len(set(lines.values())) == 7  # two directions, three of four shears, basic angle
    directions = [
        line.get_linestyle()
        for key in figure.findobj(Legend)
        for line, text in zip(key.get_lines(), key.get_texts(), strict=True)
        if text.get_text() in ("East", "North")
    ]
    assert directions == ["-", "-"]  # the style of a line is its shear


@pytest.mark.parametrize("dim", ["shear", "direction", "structure_size"])
def test_strength_at_one_place_is_that_of_the_whole(dim):
    one = drawn(figure_of(plotting.plot(strengths().isel({dim: 0}), "self_weight")).axes[0])
    whole = drawn(figure_of(plotting.plot(strengths().isel({dim: [0]}), "self_weight")).axes[0])
    assert len(one) == len(whole) > 1
    for mine, other in zip(one, whole, strict=True):
        np.testing.assert_array_equal(np.asarray(mine), np.asarray(other))


@pytest.mark.parametrize(
    ("draw", "data"),
    [
        (partial(plotting.plot, kind="area_by_resolution"), strengths),
        (partial(plotting.plot, kind="self_weight"), areas),
    ],
)
def test_other_results_are_refused(draw, data):
    with pytest.raises(ValueError, match="expected"):
        draw(data())
