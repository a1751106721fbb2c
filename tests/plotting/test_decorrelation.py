"""Correlation of the faces and dimension of the delta-surface."""

from functools import partial

import numpy as np
import pytest
import xarray as xr

from fractalcontact import plotting
from fractalcontact.base.schema import label

SHEAR = np.array([1e-4, 3e-4, 1e-3])
WAYS = ("covering_dimension", "variogram_dimension", "spectrum_dimension")


def decorrelation():
    values = np.array([[0.9, 0.4, -0.1], [0.8, 0.3, 0.0]])
    data = {
        "correlation": (("direction", "shear"), values),
        "decorrelation_length": ("direction", [4e-4, np.nan]),
        "decorrelation_length_low": ("direction", [3e-4, np.nan]),
        "decorrelation_length_high": ("direction", [6e-4, np.nan]),
    }
    return label(xr.Dataset(data, coords={"direction": ["E", "N"], "shear": SHEAR}))


def delta_dimensions():
    values = {
        name: ("shear", base + np.arange(3) / 10) for name, base in zip(WAYS, (2.0, 2.3, 2.6), strict=True)
    }
    return label(xr.Dataset(values, coords={"shear": SHEAR}))


def test_correlation_and_length():
    result = decorrelation()
    ax = plotting.decorrelation_length(result)
    curves = [line for line in ax.lines if len(line.get_xdata()) == 3]
    for line, values in zip(curves, result["correlation"].values, strict=True):
        assert np.array_equal(line.get_ydata(), values)
    (upright,) = [
        line.get_xdata()[0]
        for line in ax.lines
        if len(line.get_xdata()) == 2 and len(set(line.get_xdata())) == 1
    ]
    # in the unit of the curves; the direction without a length has no line
    assert upright / curves[0].get_xdata()[0] == pytest.approx(4.0)
    (band,) = ax.patches
    assert band.get_width() / upright == pytest.approx(0.75)


def test_delta_dimension_curves():
    result = delta_dimensions()
    ax = plotting.plot(result, "delta_dimension")
    assert [list(line.get_ydata()) for line in ax.lines] == [list(result[name].values) for name in WAYS]
    assert ax.get_xscale() == "log"


def test_labels_of_shears_stay_apart():
    result = delta_dimensions()
    shear = np.geomspace(3e-4, 6e-3, result.sizes["shear"])
    ax = plotting.plot(result.assign_coords(shear=("shear", shear)), "delta_dimension")
    ax.figure.draw_without_rendering()
    labels = ax.get_xticklabels(which="both")
    boxes = [label.get_window_extent() for label in labels if label.get_text()]
    assert len(boxes) >= 2
    assert not any(one.overlaps(other) for i, one in enumerate(boxes) for other in boxes[:i])


def test_nan_and_single_shear():
    for result, draw in (
        (decorrelation(), plotting.decorrelation_length),
        (delta_dimensions(), partial(plotting.plot, kind="delta_dimension")),
    ):
        missing = result.assign({name: v * np.nan for name, v in result.data_vars.items()})
        draw(missing).figure.canvas.draw()
        draw(result.isel(shear=0)).figure.canvas.draw()


def test_wrong_result_is_refused():
    with pytest.raises(ValueError, match="correlation"):
        plotting.decorrelation_length(delta_dimensions())
    with pytest.raises(ValueError, match="covering_dimension"):
        plotting.plot(decorrelation(), "delta_dimension")
