"""Error against run time and memory: the curves are the measured values."""

import re

import numpy as np
import plotting_synthetic as synthetic
import pytest

from fractalcontact import plotting


def test_error_against_time_curves():
    measured = synthetic.accuracy()
    axes = plotting.error_against_time(measured)
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
    ((_, right),) = plotting.error_against_time(expected)
    styles = {(line.get_color(), line.get_marker()) for line in right.lines[::2]}
    assert len(styles) == 10
    low, high = right.get_xlim()
    assert high > 2 * low
