"""Error against run time and memory: the curves are the measured values."""

import re

import numpy as np
import plotting_synthetic as synthetic
import pytest
import xarray as xr

from fractalcontact import plotting


def test_error_against_time_curves():
    measured = synthetic.accuracy()
    axes = plotting.plot(measured, "error_against_time")
    for left, right, (name, part) in zip(*axes.T, measured.children.items(), strict=True):
        assert left.get_title(loc="left").startswith(f"{name}: sphere")
        unit = {"ms": 1e-3, "µs": 1e-6, "s": 1.0}[re.search(r"\((.*)\)", left.get_xlabel()).group(1)]
        for row, method in enumerate(part.method.values):
            expected = part.to_dataset().sel({"method": method}).dropna("setting")
            best = expected.isel(setting=expected.on_pareto_front.values)
            size = {"kB": 1e3, "MB": 1e6}[re.search(r"\((.*)\)", right.get_xlabel()).group(1)]
            for ax, cost, scale in ((left, "run_time", unit), (right, "memory", size)):
                line, filled = ax.lines[2 * row : 2 * row + 2]
                assert np.asarray(line.get_xdata()) * scale == pytest.approx(expected[cost].values)
                assert np.array_equal(line.get_ydata(), expected.error.values)
                assert np.array_equal(filled.get_ydata(), best.error.values)


def test_distinct_styles_and_narrow_cost_axis():
    expected = synthetic.accuracy()["contact"].to_dataset().isel(method=[0] * 10)
    expected["method"] = [f"method {k}" for k in range(10)]
    expected["memory"] = expected["memory"] * 0 + 1e6 * (1 + 1e-5 * np.arange(expected.sizes["setting"]))
    ((_, right),) = plotting.plot(expected, "error_against_time")
    styles = {(line.get_color(), line.get_marker()) for line in right.lines[::2]}
    assert len(styles) == 10
    low, high = right.get_xlim()
    assert high > 2 * low


def test_intervals_lie_within_the_axes():
    dims = ("method", "family", "hurst", "size")
    ends = {"error_ratio": (0.5, 1.2, 4.0), "interval_coverage": (0.7, 0.94, 1.0)}
    values = {f"{name}{end}": value for name, three in ends.items()
              for end, value in zip(("_low", "", "_high"), three, strict=True)}  # fmt: skip
    coords = {"method": ["default"], "family": ["fbm"], "hurst": [0.3, 0.8], "size": [128]}
    bench = xr.Dataset({name: (dims, np.full((1, 1, 2, 1), value)) for name, value in values.items()}, coords)
    (upper,), (lower,) = plotting.plot(bench, "estimator_errors")
    for ax, (first, _, last) in zip((upper, lower), ends.values(), strict=True):
        low, high = ax.get_ylim()
        assert low < first < last < high


def test_panels_of_cases_with_equal_or_unknown_sizes():
    dims = ("method", "family", "hurst", "size")
    coords = {"method": ["default"], "family": ["fbm", "fbm"], "hurst": [0.3, 0.8], "size": [128.0, np.nan]}
    ratio = np.arange(1.0, 9.0).reshape(1, 2, 2, 2)
    bench = xr.Dataset({"error_ratio": (dims, ratio), "interval_coverage": (dims, ratio / 10)}, coords)
    upper, _ = plotting.plot(bench, "estimator_errors")
    drawn = [ax.lines[0].get_ydata().tolist() for ax in upper]
    assert drawn == [[1, 3], [2, 4], [5, 7], [6, 8]]
