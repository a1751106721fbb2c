"""Maps of heights and other fields."""

import matplotlib
import numpy as np
import plotting_synthetic as synthetic
import pytest
import xarray as xr
from plotting_figures import MISSING, OPEN, colours, factor, figure_of, render

from fractalcontact import plotting
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.schema import label


def plane_of(values, spacing=(1.0, 1.0)):
    """Return a labelled plane with the given spacing (m) of its rows and columns."""
    coords = {
        dim: (np.arange(n) + 0.5) * step for dim, n, step in zip("yx", values.shape, spacing, strict=True)
    }
    return label(xr.DataArray(values, dims=("y", "x"), coords=coords, name="height"))


def test_extent_and_light():
    x = np.linspace(1e-3, 3e-3, 41)
    bump = np.exp(-((x - 2e-3) ** 2 + (x[:, None] - 2e-3) ** 2) / 2e-7)
    plane = label(xr.DataArray(1e-5 * bump, dims=("y", "x"), coords={"y": x, "x": x}, name="height"))
    ax = plotting.surface(plane, shaded=True)
    half = 0.5 * (x[1] - x[0]) * 1e3
    assert ax.images[0].get_extent() == pytest.approx([1 - half, 3 + half, 1 - half, 3 + half])
    assert ax.get_aspect() == 1.0
    light = colours(ax).sum(axis=-1)
    assert light[26, 14] > light[14, 26]  # row 26 is north of the top, column 14 west of it
    assert ax.get_xlabel() == "$x$ (mm)"


def test_colours_are_those_of_the_bar():
    surface = synthetic.heights()
    drawn = {shaded: plotting.surface(surface, shaded=shaded) for shaded in (False, True)}
    bar = drawn[False].figure.axes[1]
    low, high = (1e-3 * end for end in bar.get_ylim())
    expected = matplotlib.colormaps["cividis"](np.clip((surface.values - low) / (high - low), 0, 1))[..., :3]
    assert np.allclose(colours(drawn[False]), expected, atol=1e-12)
    ratio = colours(drawn[True]).sum(axis=-1) / expected.sum(axis=-1)
    assert ratio.mean() == pytest.approx(1.0, abs=0.02)  # shading changes them, but not on average
    assert ratio.std() > 0.05


def test_colour_bar_of_heights():
    surface = synthetic.heights()
    figure = figure_of(plotting.surface(surface))
    bar = figure.axes[1]
    assert bar.get_ylabel() == "height (mm)"
    assert bar.get_ylim() == pytest.approx((float(surface.min()) * 1e3, float(surface.max()) * 1e3), rel=0.25)


def test_outliers_are_cut():
    z = np.random.default_rng(0).standard_normal((60, 60))
    bar = plotting.surface(plane_of(z)).figure.axes[1]
    assert bar.get_ylabel() == "height (m)"
    assert bar.get_ylim() == pytest.approx((z.min(), z.max()))
    assert not bar.patches  # no pointed end
    z[3, 4] = 1e6
    bar = plotting.surface(plane_of(z)).figure.axes[1]
    low, high = np.array(bar.get_ylim()) * factor(bar.get_ylabel())
    assert low == pytest.approx(z.min())
    assert high < 5
    assert len(bar.patches) == 1  # the upper end is pointed


def test_missing_heights_are_grey():
    surface = synthetic.heights().copy()
    surface.values[:5, :7] = np.nan
    image = colours(plotting.surface(surface))
    assert np.allclose(image[:5, :7], MISSING)
    assert np.isfinite(image).all()


def test_large_planes_are_averaged():
    means = np.linspace(0.0, 1.0, 1600)[:, None] * np.ones((1, 3))
    fine = np.repeat(means, 2, axis=0)
    fine[::2] -= 0.25
    fine[1::2] += 0.25
    image = colours(plotting.field(plane_of(fine, (0.5, 1.0))))
    assert image.shape == (1600, 3, 3)
    assert np.allclose(image, colours(plotting.field(plane_of(means))))


def test_zero_pressure_is_pale():
    surface = synthetic.heights()
    pressure = label(
        xr.DataArray(np.maximum(surface.values, 0) * 1e10, coords=surface.coords, name="pressure")
    )
    figure = figure_of(plotting.field(pressure))
    image = colours(figure.axes[0])
    assert np.array_equal(np.all(image == OPEN, axis=-1), pressure.values == 0)
    assert figure.axes[1].get_ylabel() == "contact pressure (MPa)"


def test_planes_without_x_and_y_are_refused():
    with pytest.raises(InvalidInput, match="dims"):
        plotting.surface(synthetic.estimates())
    with pytest.raises(InvalidInput, match="one shear"):
        plotting.surface(synthetic.delta(synthetic.heights()))


@pytest.mark.parametrize("shape", [(3, 3), (1, 40), (40, 1), (3, 300)])
def test_any_shape(shape):
    z = np.random.default_rng(1).standard_normal(shape)
    coords = {dim: (np.arange(n) + 0.5) * 1e-3 for dim, n in zip("yx", shape, strict=True)}
    render(plotting.surface(label(xr.DataArray(z * 1e-4, dims=("y", "x"), coords=coords, name="height"))))


@pytest.mark.parametrize("value", [0.0, 1e9, -1e-12])
def test_flat_surfaces(value):
    surface = synthetic.heights()
    ax = plotting.surface(surface * 0 + value)
    render(ax)
    (bar,) = [each for each in ax.figure.axes if each is not ax]
    assert not bar.yaxis.get_offset_text().get_text()  # ticks that can be read without adding a number
