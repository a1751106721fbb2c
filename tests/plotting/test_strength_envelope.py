"""Strength envelopes of several criteria in one figure."""

import numpy as np
import pytest
from plotting_figures import drawn, figure_of, holds, render

import fractalcontact as fc
from fractalcontact import plotting


@pytest.fixture(scope="module")
def result():
    surface = fc.surfaces.fbm((64, 64), 5e-4, hurst=0.8, rms_increment=1e-4, rng=2)
    return fc.joints.strength_envelope(
        surface,
        nominal_pressure=[20e6, 0.1e6, 5e6, 30e6],
        wall_strength=60e6,
        basic_friction_angle=30,
        cohesion=2e6,
        length=1.0,
    )


def test_curves_are_the_strengths_in_order_of_the_stress(result):
    figure = figure_of(plotting.strength_envelope(result))
    ax = figure.axes[0]
    ordered = result.sortby("nominal_pressure")
    for name in result.criterion.values:
        one = ordered.sel(criterion=name)
        # dots join what is out of range to the nearest point in range
        beside = ~one.in_range.rolling(nominal_pressure=3, center=True, min_periods=1).min().astype(bool)
        assert holds(drawn(ax), one.nominal_pressure, one.shear_strength.where(beside))
        assert holds(drawn(ax), one.nominal_pressure, one.shear_strength.where(one.in_range))
    assert not result.in_range.all()
    labels = [text.get_text() for legend in figure.findobj(type(ax.artists[0])) for text in legend.texts]
    assert "out of range" in labels
    assert "Barton and Choubey" in labels
    render(figure)


def test_axes_start_at_zero_and_share_their_unit(result):
    ax = plotting.strength_envelope(result.isel(criterion=[0]))
    assert ax.get_xlim()[0] == ax.get_ylim()[0] == 0
    assert ax.get_xlabel().endswith("(MPa)")
    assert ax.get_ylabel().endswith("(MPa)")
    assert np.isfinite(ax.get_ylim()).all()


def test_every_criterion_has_a_style_of_its_own(result):
    """Eight criteria, seven colours: the eighth is dashed, and none is dotted as what is out of range."""
    many = result.isel(criterion=np.arange(8) % result.criterion.size)
    many = many.assign_coords(criterion=[f"author{chr(ord('a') + i)}" for i in range(8)])
    ax = plotting.strength_envelope(many)
    styles = {
        line.get_label(): (line.get_color(), line.get_linestyle(), line.is_dashed())
        for line in ax.lines
        if line.get_label().startswith("in range")
    }
    assert len(styles) == len(set(styles.values())) == 8
    assert not {":"} & {line for _, line, _ in styles.values()}
    render(figure_of(ax))
