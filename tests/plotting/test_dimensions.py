"""Scaling curves with their fits, and estimated dimensions."""

from itertools import pairwise

import numpy as np
import plotting_synthetic as synthetic
import pytest
import xarray as xr
from plotting_figures import factor, figure_of

import fractalcontact as fc
from fractalcontact import plotting


def test_curve_window_and_slope():
    curves, estimates = synthetic.curves(), synthetic.estimates()
    estimates["hurst"][:] = 0.78
    estimates["fractal_dimension"][:] = 2.22
    axes = plotting.plot(curves, "dimension_curves", estimates=estimates)
    upper, lower = axes
    for ax, below, (name, curve) in zip(upper, lower, curves.items(), strict=True):
        scale = next(iter(curve.dims))
        fx = factor(below.get_xlabel())
        assert np.asarray(ax.lines[0].get_xdata()) * fx == pytest.approx(curve[scale].values)
        slope = float(curve.local_slope[0])
        assert np.allclose(below.lines[1].get_ydata(), slope)
        assert f"slope {slope:.2f}" in ax.texts[0].get_text()
        line, points = (
            np.log([drawn.get_xdata(), drawn.get_ydata()]) for drawn in (ax.lines[1], ax.lines[0])
        )
        assert np.diff(line[1]) / np.diff(line[0]) == pytest.approx(slope)
        assert np.interp(line[0], *points) == pytest.approx(line[1])
        window = np.array([2e-4, 4e-3])
        window = np.sort(2 * np.pi / window) if scale == "wavenumber" else window
        shaded = ax.patches[0]
        assert np.array([shaded.get_x(), shaded.get_x() + shaded.get_width()]) * fx == pytest.approx(window)
        assert name.replace("_", " ") == ax.get_title(loc="left")


@pytest.mark.parametrize("shape", [200, (96, 128)])  # of the second, up to 31400 rad/m
def test_panels_and_tick_labels_of_profiles_and_surfaces(shape):
    heights = fc.surfaces.fbm(shape, 1e-4, hurst=0.7, rms_increment=1e-5, rng=1)
    names = ("spectrum", "variogram", "roughness_length", "variation", "cube_counts", "covering")
    curves = {name: getattr(fc.dimensions, name)(heights) for name in names}
    figure = figure_of(
        plotting.plot(curves, "dimension_curves", estimates=fc.dimensions.estimate(heights, list(names)))
    )
    titles = {ax.get_title(loc="left") for ax in figure.axes}
    assert titles >= {name.replace("_", " ") for name in names}
    figure.draw_without_rendering()
    for ax in figure.axes:
        edge = ax.get_window_extent()
        boxes = [text.get_window_extent() for text in ax.get_xticklabels(which="both") if text.get_text()]
        shown = sorted((box.x0, box.x1) for box in boxes if edge.x0 <= 0.5 * (box.x0 + box.x1) <= edge.x1)
        assert all(left[1] < right[0] for left, right in pairwise(shown))


# log-log slopes on a surface of dimension D = 3 - H: 2-D spectrum -2(1 + H), counts -D, area 2 - D ...
SLOPES = {
    "power_spectral_density": ("wavenumber", lambda dimension: -2 * (4 - dimension)),
    "profile_power_spectral_density": ("wavenumber", lambda dimension: -(5 - 2 * (dimension - 1))),
    "second_variogram": ("lag", lambda dimension: 6 - 2 * dimension),
    "variogram": ("lag", lambda dimension: 6 - 2 * dimension),
    "madogram": ("lag", lambda dimension: 3 - dimension),
    "cube_count": ("cube_size", lambda dimension: -dimension),
    "roughness": ("window_size", lambda dimension: 3 - dimension),
    "variation": ("box_length", lambda dimension: 3 - dimension),
    "covering_area": ("box_length", lambda dimension: 2 - dimension),
    "covering_length": ("box_length", lambda dimension: 2 - dimension),  # length and dimension both one less
}


@pytest.mark.parametrize("hurst", [0.3, 0.8])
@pytest.mark.parametrize("name", list(SLOPES))
def test_slope_of_each_curve(name, hurst):
    """The slope drawn for an estimate is the one that theory gives for its dimension."""
    scale, slope_of = SLOPES[name]
    slope = slope_of(3 - hurst)
    sizes = 1e-4 * 2.0 ** np.arange(6)
    curve = xr.Dataset(
        {name: (scale, sizes**slope), "local_slope": (scale, np.full(6, slope))}, coords={scale: sizes}
    )
    window = np.array([sizes[0], sizes[-1]])
    window = np.sort(2 * np.pi / window) if scale == "wavenumber" else window
    estimates = xr.Dataset(
        {
            key: ("method", [value])
            for key, value in {
                "hurst": hurst,
                "fractal_dimension": 3 - hurst,
                "scale_min": window[0],
                "scale_max": window[1],
            }.items()
        },
        coords={"method": ["fit"]},
    )
    (upper,), (lower,) = plotting.plot({"fit": curve}, "dimension_curves", estimates=estimates)
    assert lower.lines[1].get_ydata() == pytest.approx(slope)
    assert f"slope {slope:.2f}" in upper.texts[0].get_text()


def test_intervals_of_the_dimension():
    estimates = synthetic.estimates()
    ax = plotting.dimensions(estimates, truth=2.22, band=(2.15, 2.29))
    with_interval = estimates.isel(method=slice(0, -1))
    segments = np.array(ax.collections[0].get_segments())[:, :, 0]
    assert segments[:, 0] == pytest.approx((3 - with_interval.ci_high).values)
    assert segments[:, 1] == pytest.approx((3 - with_interval.ci_low).values)
    assert [t.get_text() for t in ax.get_yticklabels()] == ["default", "spectrum", "variogram", "cube counts"]


def test_an_estimate_at_its_limit_is_no_point_and_the_band_is_named(study):
    estimates = study["dimensions"].to_dataset().copy(deep=True)
    estimates["hurst"][-1], estimates["fractal_dimension"][-1] = 1.0, 2.0
    ax = plotting.dimensions(estimates, band=(2.15, 2.29), band_name="1998 paper")
    by_marker = {line.get_marker(): line.get_xdata() for line in ax.lines if len(line.get_xdata())}
    assert list(by_marker["<"]) == [2.0]
    assert 2.0 not in [*by_marker.get("o", ())]
    words = [text.get_text() for text in ax.artists[0].get_texts()]
    assert "at the limit: no\ndimension" in words
    assert "1998 paper" in words


def test_nearly_equal_dimensions_do_not_look_different(study):
    estimates = study["dimensions"].to_dataset().isel(method=[0, 0])
    ax = plotting.dimensions(estimates.assign(fractal_dimension=("method", [2.2, 2.21])))
    low, high = ax.get_xlim()
    assert high - low >= 0.1


def test_intervals_lie_within_the_axis(study):
    one = study["dimensions"].to_dataset().isel(method=[0, 0])
    values = {
        "hurst": [0.8, 0.8],
        "fractal_dimension": [2.2, 2.2],
        "ci_low": [0.5, 0.7],
        "ci_high": [0.9, 0.95],
    }
    ax = plotting.dimensions(one.assign({name: ("method", list(ends)) for name, ends in values.items()}))
    low, high = ax.get_xlim()
    assert low < 2.05
    assert high > 2.5
