"""Figures of an ensemble: median and quantiles of the members, and words that say so."""

from itertools import combinations

import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg

import fractalcontact as fc

FORCES = np.array([1.0, 2.0, 4.0])
FACTORS = np.array([0.01, 0.02, 0.03, 0.05, 0.09])


@pytest.fixture
def drawn(monkeypatch, tmp_path):
    """Draw a tree and return what its figures show: curves, corners of bands, and all words."""

    def draw(tree):
        shown = {}
        print_png = FigureCanvasAgg.print_png

        def record(canvas, target, *arguments, **options):
            figure, name = canvas.figure, str(target)
            curves = [line.get_xydata() for ax in figure.axes for line in ax.get_lines()]
            bands = [patch.get_xy() for ax in figure.axes for patch in ax.patches if hasattr(patch, "get_xy")]
            words = figure._supxlabel.get_text() if figure._supxlabel else ""
            shown[name] = curves, [np.asarray(band) for band in bands if np.ndim(band) == 2], words
            print_png(canvas, target, *arguments, **options)
            below = [*figure.legends, figure._supxlabel] if words else []
            boxes = [each.get_window_extent() for each in below]
            assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))

        monkeypatch.setattr(FigureCanvasAgg, "print_png", record)
        fc.plotting.draw(tree, tmp_path)
        return {key: value for name, value in shown.items() for key in NAMES if key in name}

    return draw


NAMES = ("contact_area", "contact_domains", "closure_law")


def study(factors):
    """Return the tree of an ensemble whose contact areas are known multiples of the force."""
    area = FORCES * factors[:, None] / 10
    state = np.zeros((factors.size, 3, 8, 8), np.int8)
    state[:, :, :2, :2] = 1
    pressed = xr.Dataset(
        {
            "contact_fraction": (("member", "step"), area),
            "corrected_contact_fraction": (("member", "step"), 0.5 * area),
            "state": (("member", "step", "y", "x"), state),
        },
        {
            "member": np.arange(factors.size),
            "step": np.arange(3),
            "normal_force": ("step", FORCES, {"units": "N"}),
            "closure": (("member", "step"), 1e-6 * area / FORCES, {"units": "m"}),
            "y": ("y", np.arange(8.0), {"units": "m"}),
            "x": ("x", np.arange(8.0), {"units": "m"}),
        },
    )
    return xr.DataTree.from_dict({"contact": pressed})


def areas(tree):
    """Return the tree with the contact areas alone, of which one figure is drawn."""
    return tree.map_over_datasets(lambda dataset: dataset.drop_vars(["state", "closure"], errors="ignore"))


def test_curves_are_the_median_bands_the_quantiles_and_maps_name_their_member(drawn):
    figures = drawn(study(FACTORS))
    assert figures["contact_domains"][2] == "member 0 of 5"
    curves, bands, words = figures["contact_area"]
    assert words == "curves: median, band: central 68 % of 5 members"
    cells = next(curve for curve in curves if curve[-1, 1] == pytest.approx(100 * 0.03 * 0.4))
    np.testing.assert_allclose(cells[:, 1], 100 * 0.03 * FORCES / 10)
    low, high = np.quantile(FACTORS, [0.16, 0.84]) * 100 / 10
    corners = max(bands, key=lambda band: band[:, 1].max())
    np.testing.assert_allclose(corners[:3], np.column_stack([FORCES, low * FORCES]))
    np.testing.assert_allclose(corners[3:6], np.column_stack([FORCES, high * FORCES])[::-1])


def test_maps_name_their_member_beside_the_colours_of_their_flags(drawn):
    tree = study(FACTORS)
    tree["contact/state"].values[:, 2, 0, 0] = 2  # yielded: the flags have a legend below the maps
    tree["contact"] = tree["contact"].to_dataset()[["state"]].drop_vars("closure")
    assert drawn(tree)["contact_domains"][2] == "member 0 of 5"


def test_bands_of_a_path_that_turns_back_are_those_of_its_legs(drawn):
    """An outline that is run through to and fro encloses nothing."""
    tree = areas(study(FACTORS))
    back = xr.DataTree.from_dict({"contact": tree["contact"].to_dataset().isel(step=[0, 1, 2, 1, 0])})
    (one, other), legs = drawn(tree)["contact_area"][1], drawn(back)["contact_area"][1]
    assert len(legs) == 4
    for leg, there in zip(legs, (one, one, other, other), strict=True):
        np.testing.assert_allclose(np.unique(leg, axis=0), np.unique(there, axis=0))


def test_bands_do_not_need_the_same_lines_of_reference(drawn):
    """The forces of a high quantile may need logarithmic axes, where those of the median do not."""
    pressed = areas(study(FACTORS))["contact"].to_dataset()
    force = np.tile(FORCES, (FACTORS.size, 1))
    force[-1, -1] = 400
    loaded = pressed.assign_coords(normal_force=(("member", "step"), force, {"units": "N"}))
    curves, bands, words = drawn(xr.DataTree.from_dict({"contact": loaded}))["contact_area"]
    assert len(curves) == len(bands) == 2
    assert words == "curves: median, band: central 68 % of 5 members"


def test_band_has_the_unit_of_the_axis(drawn):
    # closures from nanometres to hundreds of micrometres: each alone would have another prefix
    tree = study(np.array([1e-4, 1.0, 1e3]))
    tree["contact"] = tree["contact"].to_dataset().drop_vars("state")
    curves, bands, _ = drawn(tree)["closure_law"]
    low, middle, high = np.quantile([1e-4, 1.0, 1e3], [0.16, 0.5, 0.84])
    shown = next(curve for curve in curves if len(curve) == 3)[0, 0]
    assert bands[0][0, 0] / shown == pytest.approx(low / middle)
    assert bands[0][-2, 0] / shown == pytest.approx(high / middle)


def test_single_study_has_neither_bands_nor_words(drawn):
    single = study(FACTORS).map_over_datasets(lambda dataset: dataset.isel(member=0, missing_dims="ignore"))
    for curves, bands, words in drawn(single).values():
        assert not bands or not curves
        assert words == ""


def test_band_from_no_load_on_draws_without_warning(drawn, recwarn):
    """On a logarithmic axis the first point, at which nothing touches, is beyond the limits."""
    faces = fc.surfaces.spectral((16, 16), 1e-5, hurst=0.8, rms_slope=0.05, members=3, rng=5)
    pressed = fc.contact.press(faces, contact_modulus=1e10, nominal_pressure=[0.0, 1.0, 1e7], keep="state")
    assert "contact_area" in drawn(areas(xr.DataTree.from_dict({"contact": pressed})))
    assert [str(warning.message) for warning in recwarn if "non-positive" in str(warning.message)] == []


def test_band_ends_where_it_has_no_bound_and_gives_no_warning(drawn, recwarn):
    tree = areas(study(FACTORS))
    for name in ("contact_fraction", "corrected_contact_fraction"):
        tree[f"contact/{name}"].values[3:, -1] = np.inf
    _, bands, _ = drawn(tree)["contact_area"]
    low, high = np.quantile(FACTORS, [0.16, 0.84]) * 100 / 10
    corners = max(bands, key=lambda band: band[:, 1].max())
    np.testing.assert_allclose(corners[:2], np.column_stack([FORCES, low * FORCES])[:2])
    np.testing.assert_allclose(corners[2:4], np.column_stack([FORCES, high * FORCES])[1::-1])
    assert [str(warning.message) for warning in recwarn if "invalid value" in str(warning.message)] == []
