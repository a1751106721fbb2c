"""Polar figure of the directional roughness."""

import itertools

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact import plotting


@pytest.fixture(scope="module")
def surface():
    return fc.surfaces.fbm((40, 40), 2e-4, hurst=0.8, rms_increment=4e-5, rng=2)


def test_curves_are_closed_and_hold_the_values(surface):
    result = fc.joints.directional_roughness(surface)
    ax = plotting.directional_roughness(result)
    for line, name in zip(ax.lines, ("roughness_metric", "mean_dip"), strict=True):
        angle, radius = line.get_data()
        np.testing.assert_allclose(np.degrees(angle[:-1]), result.azimuth)
        np.testing.assert_allclose(radius[:-1], result[name])
        assert (angle[-1], radius[-1]) == (angle[0], radius[0])
    assert [tick.get_text() for tick in ax.get_xticklabels()][::2] == ["E", "N", "W", "S"]
    assert ax.get_ylim()[0] == 0


@pytest.mark.parametrize("factor", [0.2, 1.0, 7.0])
def test_labels_of_the_rings_stay_apart(surface, factor):
    ax = plotting.directional_roughness(fc.joints.directional_roughness(factor * surface))
    ax.figure.draw_without_rendering()
    boxes = [label.get_window_extent() for label in ax.get_yticklabels() if label.get_text()]
    assert 2 <= len(boxes) <= 5
    assert not any(one.overlaps(other) for one, other in itertools.pairwise(boxes))


def test_a_sector_stays_open_and_is_drawn_in_order(surface):
    result = fc.joints.directional_roughness(surface, direction=[40.0, 0.0, 20.0])
    angle, radius = plotting.directional_roughness(result).lines[0].get_data()
    np.testing.assert_allclose(np.degrees(angle), [0, 20, 40], atol=1e-12)
    np.testing.assert_allclose(radius, result.roughness_metric[[1, 2, 0]])


def test_axes_that_are_not_polar_are_refused(surface):
    from matplotlib.figure import Figure

    result = fc.joints.directional_roughness(surface, direction=[0.0, 90.0])
    with pytest.raises(ValueError, match="polar axes"):
        plotting.directional_roughness(result, ax=Figure().add_subplot())
    polar = Figure().add_subplot(projection="polar")
    assert plotting.directional_roughness(result, ax=polar) is polar
