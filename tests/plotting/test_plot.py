"""The standard figure of a result: found by its variables, with the options of its kind."""

import pytest
from calls import CALLS, KINDS, closed, figure_name, options_of, pressed, result_of
from plotting_figures import figure_of

import fractalcontact as fc
from fractalcontact import plotting
from fractalcontact.base.errors import InvalidInput

LABELS = {
    "alluvial": ("normal force $F$ (N)", "cells in contact"),
    "area_by_resolution": ("spacing (µm)", "real contact area (%)"),
    "closure": ("closure (µm)", "normal force $F$ (N)"),
    "contact_area": ("normal force $F$ (N)", "real / nominal contact area (%)"),
    "delta_dimension": ("shear displacement $v$ (", "dimension of the delta-surface"),
    "dimension_curves": ("", "variogram (µm²)"),
    "error_against_time": ("run time (", "true error"),
    "estimator_errors": ("", "rms error / Cramér-Rao bound"),
    "hydraulic_aperture": ("normal force $F$ (N)", "hydraulic aperture (µm)"),
    "pressure_distribution": ("pressure (MPa)", "nominal area per pressure (1/MPa)"),
    "self_weight": ("size of the structure (m)", "shear strength"),
    "shear_curve": ("shear displacement", "shear stress $\\tau$"),
    "slip_loops": ("tangential displacement", "tangential force $Q$ (N)"),
}
# whose standard figure is another one, or what a result without one gets
NO_STANDARD = ("contact_area", "first_contact", "pressure_distribution", "field", "path")


@pytest.mark.parametrize("kind", LABELS)
def test_axes_say_what_is_drawn(kind):
    first = figure_of(plotting.plot(CALLS[figure_name(kind)]()["result"], kind)).axes[0]
    for label, expected in zip((first.get_xlabel(), first.get_ylabel()), LABELS[kind], strict=True):
        assert label.startswith(expected)


@pytest.mark.parametrize("kind", sorted(set(KINDS) - set(NO_STANDARD)))
def test_standard_figure_of_a_result(kind):
    """A result finds its own figure; the drawing itself is tested elsewhere."""
    result = next(iter(CALLS[figure_name(kind)]().values()))
    if kind == "contact_domains":
        result = result["state"]
    if kind == "scans":
        result = result.assign(status=("scan", ["complete"] * result.sizes["scan"]))
    with pytest.raises(InvalidInput, match=f"options of {kind}: expected one of "):
        plotting.plot(result, no_such_option=None)


def test_array_is_drawn_as_a_map_or_along_its_path():
    assert plotting.plot(pressed()["gap"].isel(step=0)).images
    assert plotting.plot(closed()["mean_gap"]).get_ylabel() == "mean gap (µm)"
    share = plotting.plot(fc.domains.percolation(pressed()["state"]))
    assert share.get_ylabel().replace("\n", " ") == "share of the set in its largest island, coverage"


def test_coordinates_and_words_are_drawn_or_refused():
    pressure = pressed()["nominal_pressure"]
    assert plotting.plot(pressure).get_ylabel().startswith("nominal pressure")
    with pytest.raises(InvalidInput, match="result: expected a result or a variable of it, got a coordinate"):
        plotting.plot(result_of("joints.shear_curve")["nominal_pressure"])
    with pytest.raises(InvalidInput, match=r"result.reason: expected numbers, got dtype\('<U"):
        plotting.plot(result_of("domains.signature")["reason"])


def test_docstring_has_every_kind_and_its_options():
    """Kinds without a function of their own are described, with every option that they have."""
    text = plotting.plot.__doc__
    for kind in set(KINDS) - set(plotting.__all__):
        line = next(part for part in text.split("- ") if kind in part.partition(":")[0])
        options = options_of(kind)
        assert all(f"`{name}`" in line for name in options if name not in ("units", "ax", "axes")), kind


def test_wrong_calls_are_refused(study):
    with pytest.raises(InvalidInput, match=r"fc.plotting.plot: .*\n.*kind: .*mean 'contact_area'"):
        plotting.plot(closed(), "contact area")
    with pytest.raises(InvalidInput, match="options of closure: expected one of 'laws'.*got 'theory'"):
        plotting.plot(closed(), theory=closed())
    with pytest.raises(InvalidInput, match="result: expected a labelled result"):
        plotting.plot(3.0)
    with pytest.raises(InvalidInput, match="`draw` draws a study"):
        plotting.plot(study)
    with pytest.raises(InvalidInput, match="variable: expected one of residual: the result has no standard"):
        plotting.plot(pressed()[["residual"]])
    with pytest.raises(InvalidInput, match="result: expected numbers over scan, got none"):
        plotting.plot(pressed(), "scans")
    with pytest.raises(InvalidInput, match="no standard figure"):
        plotting.plot(result_of("contact.theories"))
