"""What the figures of a forgetting joint show is what the results hold."""

import numpy as np
import pytest
import xarray as xr

from fractalcontact import plotting
from fractalcontact.base.schema import label

SHEAR = np.array([1e-4, 3e-4, 1e-3])


def memory():
    values = np.array([[0.9, 0.4, -0.1], [0.8, 0.3, 0.0]])
    data = {
        "correlation": (("direction", "shear"), values),
        "decorrelation_length": ("direction", [4e-4, np.nan]),
        "decorrelation_length_low": ("direction", [3e-4, np.nan]),
        "decorrelation_length_high": ("direction", [6e-4, np.nan]),
    }
    return label(xr.Dataset(data, coords={"direction": ["E", "N"], "shear": SHEAR}))


def dimensions():
    values = {
        name: ("shear", base + np.arange(3) / 10) for name, base in zip(WAYS, (2.0, 2.3, 2.6), strict=True)
    }
    return label(xr.Dataset(values, coords={"shear": SHEAR}))


WAYS = ("covering_dimension", "variogram_dimension", "spectrum_dimension")


def test_the_correlation_and_the_length_where_it_is_lost():
    given = memory()
    ax = plotting.correlation(given).axes[0]
    curves = [line for line in ax.lines if len(line.get_xdata()) == 3]
    for line, values in zip(curves, given["correlation"].values, strict=True):
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


def test_each_way_to_measure_the_dimension_has_its_curve():
    given = dimensions()
    ax = plotting.delta_dimension(given).axes[0]
    assert [list(line.get_ydata()) for line in ax.lines] == [list(given[name].values) for name in WAYS]
    assert ax.get_xscale() == "log"


def test_nothing_but_nan_and_one_shear():
    for given, drawing in ((memory(), plotting.correlation), (dimensions(), plotting.delta_dimension)):
        nothing = given.assign({name: v * np.nan for name, v in given.data_vars.items()})
        drawing(nothing).canvas.draw()
        drawing(given.isel(shear=0)).canvas.draw()


def test_a_result_of_another_kind_is_refused():
    with pytest.raises(ValueError, match="correlation"):
        plotting.correlation(dimensions())
    with pytest.raises(ValueError, match="covering_dimension"):
        plotting.delta_dimension(memory())
