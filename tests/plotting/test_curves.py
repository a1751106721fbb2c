"""The numbers of a figure as a table: those of the result in the units of the axes, with names of curves."""

import itertools

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from matplotlib.figure import Figure
from plotting_figures import factor

import fractalcontact as fc
from fractalcontact import plotting
from fractalcontact.base.errors import InvalidInput


def test_curves_are_those_of_the_result_and_named_by_their_shear(study):
    closure = study["joints/closure"].to_dataset()
    numbers = plotting.curves(plotting.plot(closure, "closure", units={"shear": "um", "normal_force": "N"}))
    assert set(numbers["y_axis"]) == {"normal force F (N)"}
    for row in range(closure.sizes["shear"]):
        name = f"interface closure, shear v = {1e6 * float(closure['shear'][row]):.4g} µm"
        curve = numbers[numbers["curve"] == name]
        drawn = curve["x"] * factor(curve["x_axis"].iloc[0])
        assert np.allclose(drawn, closure["interface_closure"][row], rtol=1e-12)
        assert np.allclose(curve["y"], closure["normal_force"], rtol=1e-12)


def test_every_figure_names_its_curves(study):
    """Every line that shows data has a name; the others are marks, limits and scale bars."""
    figures = {
        "contact_area": plotting.plot(study["joints/closure"], "contact_area"),
        "rigid_dilatancy": plotting.dilatancy(study["joints/rigid_dilatancy"]),
        "box_dimension": plotting.box_dimension(study["domains/box_dimension"]),
        "hydraulic_aperture": plotting.plot(study["joints/transmissivity"], "hydraulic_aperture"),
        "dimensions": plotting.dimensions(study["dimensions"]),
        "dimension_curves": plotting.plot(study["dimensions"], "dimension_curves"),
    }
    for name, axes in figures.items():
        numbers = plotting.curves(axes)
        assert len(numbers) > 2, name
        assert not numbers.isna().any(axis=None), name
        assert not numbers["curve"].str.startswith("_").any(), name
        assert (numbers["curve"].str.len() > 0).all(), name


def test_panels_have_their_titles_and_rows_their_words(study):
    estimates = study["dimensions"].to_dataset()
    numbers = plotting.curves(plotting.dimensions(estimates))
    points = numbers[numbers["curve"].str.startswith(("estimate", "at the limit"))]
    expected = dict(
        zip(estimates["method"].values.tolist(), estimates["fractal_dimension"].values, strict=True)
    )
    assert dict(zip(points["y"].str.replace(" ", "_"), points["x"], strict=True)) == pytest.approx(expected)
    panels = plotting.curves(plotting.plot(study["dimensions"], "dimension_curves"))["panel"]
    assert set(panels) >= {name.replace("_", " ") for name in study["dimensions"].children}


def test_azimuths_are_in_degrees():
    surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=2e-5, rng=1)
    rough = fc.joints.directional_roughness(surface)
    ax = plotting.directional_roughness(rough, units={"roughness_metric": "rad"})
    numbers = plotting.curves(ax)
    metric = numbers[numbers["curve"] == "θ^*_max/(C+1)"].iloc[: rough.sizes["azimuth"]]
    assert np.allclose(metric["x"], rough["azimuth"])
    assert np.allclose(metric["y"], np.radians(rough["roughness_metric"]))
    assert ax.yaxis.get_units() == "rad"


def test_intervals_and_bands_have_both_ends():
    surface = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.8, rms_increment=2e-5, rng=1)
    result = fc.dimensions.scaling(surface)
    numbers = plotting.curves(plotting.scaling(result))
    ends = numbers.loc[numbers["curve"] == "octave, 95 %, interval", "y"]
    expected = [result[end].values[np.isfinite(result["ci_low"])] for end in ("ci_low", "ci_high")]
    assert np.allclose(np.sort(ends), np.sort(np.ravel(expected)))
    band = numbers.loc[numbers["curve"] == "one exponent, 95 %", "y"]
    assert band.min() == pytest.approx(float(result["window_ci_low"]))
    assert band.max() == pytest.approx(float(result["window_ci_high"]))


def test_scans_are_sorted_with_intervals_and_outliers():
    heights = np.array([2e-6, 1e-6, np.nan, 3e-6, 9e-5, 2.5e-6, 4e-6])
    columns = {"rms_height": heights, "rms_height_low": heights / 2, "rms_height_high": heights * 2}
    overview = xr.Dataset(
        {name: ("scan", values, {"units": "m"}) for name, values in columns.items()},
        {"scan": [f"{letter}.sur" for letter in "abcdefg"]},
    )
    (ax,) = plotting.plot(overview, "scans", units={"rms_height": "um"})
    assert ax.xaxis.get_units() == "µm"
    numbers = plotting.curves(ax).groupby("curve")["x"].apply(list)
    assert np.allclose(numbers["scan"], [1, 2, 2.5, 3, 4])
    assert np.allclose(numbers["outlier"], [90])
    assert np.allclose(numbers["interval"][:4], [0.5, 2, 1, 4])
    assert [text.get_text() for text in ax.texts] == ["e.sur"]
    assert [label.get_text() for label in ax.get_yticklabels()] == [f"{letter}.sur" for letter in "bafdge"]
    assert [text.get_text() for text in ax.artists[0].get_texts()] == ["interval", "outlier", "median"]


def test_a_scan_has_one_row_in_all_panels():
    names = [f"scan {number}" for number in range(5)]
    columns = {
        "fractal_dimension": [2.3, 2.1, np.nan, 2.2, np.nan],
        "roughness_coefficient": [3.0, 12.0, 7.0, 5.0, np.nan],
        "rms_height": [1.2345e-5, 1.2346e-5, 1.2347e-5, 1.2348e-5, np.nan],
    }
    data = {name: ("scan", values, {"units": "m" if name == "rms_height" else "1"})
            for name, values in columns.items()}  # fmt: skip
    axes = plotting.plot(xr.Dataset(data, {"scan": names}), "scans")
    assert [label.get_text() for label in axes[0].get_yticklabels()] == [names[i] for i in (1, 3, 0, 2)]
    for ax, values in zip(axes, columns.values(), strict=True):
        shown = ax.lines[0].get_xdata() * getattr(ax.xaxis, "factor", 1.0)
        rows = [names.index(axes[0].get_yticklabels()[int(y)].get_text()) for y in ax.lines[0].get_ydata()]
        assert np.allclose(shown, np.array(values)[rows])
    axes[0].figure.canvas.draw()
    for ax in axes:
        boxes = [label.get_window_extent() for label in ax.get_xticklabels() if label.get_text()]
        assert len(boxes) >= 2
        assert all(right.x0 > left.x1 + 4 for left, right in itertools.pairwise(boxes))


@pytest.mark.usefixtures("empty_files")
def test_csv_beside_the_figures(study, tmp_path):
    tree = xr.DataTree.from_dict({"/joints/closure": study["joints/closure"].to_dataset()})
    files = plotting.draw(tree, tmp_path, formats=["png", "csv"], units={"normal_force": "N"})
    tables = {file.stem: pd.read_csv(file) for file in files if file.suffix == ".csv"}
    assert set(tables) < {file.stem for file in files if file.suffix == ".png"}
    assert "joint_closure" in tables
    assert "joint_contact_domains" not in tables  # maps alone
    assert set(tables["joint_closure"]["y_axis"]) == {"normal force F (N)"}


@pytest.mark.parametrize("axes", [None, [], "closure", Figure()])
def test_what_is_no_axes_is_refused(axes):
    with pytest.raises(InvalidInput, match="axes"):
        plotting.curves(axes)
