"""Exponents by octave of wavelength."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact import plotting
from fractalcontact.base.errors import InvalidInput


@pytest.fixture(scope="module")
def result():
    surface = fc.surfaces.spectral((128, 128), 1e-4, hurst=0.7, rms_height=1e-6, rolloff=16e-4, rng=2)
    return fc.dimensions.scaling(surface)


def test_points_and_window(result):
    ax = plotting.scaling(result)
    window = next(line for line in ax.lines if np.ptp(line.get_xdata()) > 0 and len(line.get_xdata()) == 2)
    assert window.get_ydata()[0] == pytest.approx(float(result.window_hurst))
    assert ax.get_xlabel() == "wavelength (mm)"
    (octaves,) = [line for line in ax.lines if line.get_label() == "octave, 95 %"]
    assert len(octaves.get_xdata()) == result.sizes["wavelength"]


def test_no_window_is_drawn_where_there_is_none(result):
    ax = plotting.scaling(result.assign(window_hurst=np.nan))
    assert ax.get_legend_handles_labels()[1] == ["octave, 95 %, interval", "octave, 95 %"]


@pytest.mark.parametrize("name", ["hurst", "ci_low", "ci_high"])
def test_missing_numbers_are_left_out(result, name):
    ax = plotting.scaling(result.assign({name: result[name] * np.nan}))
    low, high = ax.get_ylim()
    assert low < high


@pytest.mark.parametrize(
    "name", ["window_hurst", "window_ci_low", "window_ci_high", "scale_min", "scale_max"]
)
def test_missing_variable_is_named(result, name):
    with pytest.raises(InvalidInput, match=name):
        plotting.scaling(result.drop_vars(name))
