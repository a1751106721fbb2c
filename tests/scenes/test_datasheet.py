"""One page about a joint: the curves are the values, and what limits them is printed."""

import re

import numpy as np
import pytest
import xarray as xr
from matplotlib.text import Text
from plotting_figures import figure_of, render

import fractalcontact as fc
from fractalcontact.base.units import quantity_text


@pytest.fixture(scope="module")
def tree():
    face = fc.surfaces.fbm((48, 48), 5e-4, hurst=0.8, rms_increment=8e-5, rng=2)
    crack = fc.joints.Crack(face, young=3e10, poisson=0.2, block=16e-3, basic_friction_angle=30)
    pressures = [1e6, 2e6, 4e6]
    closed = fc.joints.closure(crack, shear=[5e-4, 2e-3], nominal_pressure=pressures, keep=("gap",))
    groups = {
        "roughness_coefficient": fc.joints.roughness_coefficient(face),
        "directional_roughness": fc.joints.directional_roughness(face),
        "strength_envelope": fc.joints.strength_envelope(
            face, nominal_pressure=[*pressures, 5e7], wall_strength=6e7, basic_friction_angle=30
        ),
        "direct_shear": fc.joints.direct_shear(crack, 1e-3, nominal_pressure=pressures[:2], hardness=6e7),
        "closure": closed.drop_vars("gap"),
        "transmissivity": fc.joints.transmissivity(closed["gap"]),
        "uplift": fc.joints.uplift(closed["gap"], upstream_pressure=1e5),
    }
    tree = xr.DataTree.from_dict({f"/joints/{name}": data for name, data in groups.items()})
    tree.attrs["title"] = "Joint under the spillway"
    return tree


def texts(figure):
    return "\n".join(text.get_text() for text in figure.findobj(lambda artist: hasattr(artist, "get_text")))


def test_panels_are_the_values(tree):
    page = figure_of(fc.scenes.datasheet(tree))
    axes = {ax.get_title(loc="left"): ax for ax in page.axes}
    closed, flow = tree["joints/closure"], tree["joints/transmissivity"]
    assert "normal stiffness (MPa/mm)" not in axes  # that of `closure_laws`, which this study lacks
    assert [ax.axison for ax in page.axes if not ax.has_data()] == [False]  # whose place stays blank
    gap = axes["mean gap (mm)"].lines[0]
    np.testing.assert_allclose(gap.get_ydata(), closed.mean_gap[0] * 1e3)
    drawn = [line.get_ydata() for line in axes["transmissivity (m³)"].lines]
    assert any(np.allclose(y, flow.transmissivity.isel(shear=1, axis=0)) for y in drawn)
    render(page)


def test_words_are_those_of_the_results(tree):
    shown = texts(figure_of(fc.scenes.datasheet(tree)))
    for expected in (
        "Joint under the spillway",
        "contacts are not resolved at any load",
        "direct shear: one hardness",
        "face of 24 mm x 24 mm, heights 0.5 mm apart, mated copy above; block of 16 mm x 16 mm",
        "assumed: E 30 GPa; ν 0.2; φb 30°; JCS 60 MPa; hardness 60 MPa; shear towards E",
    ):
        assert expected in shown, expected


def test_page_of_an_ensemble_names_the_member_whose_numbers_it_has(tree):
    twice = xr.DataTree.from_dict(
        {node.path: node.to_dataset().expand_dims(member=2) for node in tree.leaves}
    )
    twice.attrs = dict(tree.attrs)
    shown = texts(figure_of(fc.scenes.datasheet(twice)))
    assert "Joint under the spillway: member 0 of 2" in shown
    assert "member" not in texts(figure_of(fc.scenes.datasheet(tree)))


def test_numbers_are_those_of_the_tables(tree):
    shown = texts(figure_of(fc.scenes.datasheet(tree)))
    coefficient = tree["joints/roughness_coefficient"].roughness_coefficient.values[0]
    assert re.search(rf"E +{coefficient:.1f} +\S+ to \S+ +0.5 mm +0.508 mm", shown)
    water = tree["joints/uplift"].isel(step=-1, shear=1).uplift_force
    numbers = [f"{float(water.sel(diagram=word)):.3g} N" for word in ("joint", "linear")]
    assert re.search(" +".join(["2 mm", *numbers]), shown)
    sheared = tree["joints/direct_shear"].isel(nominal_pressure=0)
    strengths = [f"{float(sheared[f'{word}_shear_strength']) / 1e6:.3g} MPa" for word in ("peak", "residual")]
    assert re.search(rf"1 MPa +{strengths[0]} +\S+ ° +{strengths[1]}", shown)
    assert (
        f"asperity angle of the face: {float(tree['joints/strength_envelope'].asperity_angle):.3g}" in shown
    )
    # the criterion holds up to .3 of the wall strength, 18 MPa: not at 50
    assert re.search("xia: fresh mated fractures.*; in its range from 1 MPa to 4 MPa", shown)
    whole = fc.scenes.summary(tree, verbose=True)
    for number in (*numbers, *strengths):
        assert number in whole


def test_numbers_end_before_the_strength_begins(tree):
    panels = fc.scenes.datasheet(tree)
    page = figure_of(panels)
    render(page)
    (numbers,) = (text for text in page.findobj(Text) if text.get_text().startswith("joint roughness"))
    numbers.set_text("\n".join([numbers.get_text(), 74 * "0"]))  # the longest line
    left = panels["strength"].get_tightbbox().x0
    assert numbers.get_window_extent().x1 < left


def test_end_of_a_shear_test_is_named(tree):
    shown = texts(figure_of(fc.scenes.datasheet(tree)))
    assert "residual" not in shown
    assert "direct shear, at the end\n(1 mm)" in shown
    assert re.search(r"1 MPa +\S+ MPa +\S+ ° +\S+ MPa +1 mm", shown)


def closures(pressure, *curves):
    return xr.Dataset(
        {"interface_closure": (("shear", "step"), np.array(curves))},
        coords={
            "shear": ("shear", 1e-3 * np.arange(len(curves)), {"units": "m"}),
            "step": np.arange(pressure.size),
            "nominal_pressure": ("step", pressure, {"units": "Pa"}),
        },
    )


def test_closure_laws_are_drawn_and_named(tree, monkeypatch):
    pressure = tree["joints/closure"]["nominal_pressure"].values
    many = np.geomspace(1e5, 1e7, 9)
    laws = fc.joints.closure_laws(
        closures(
            many,
            3e-6 * np.log(many / 2e3),
            many * 1e-4 / (2e6 + many),
            np.zeros(9),
        ),
        seating_pressure=1.5e5,
    )
    study = xr.DataTree.from_dict({"/joints/closure_laws": laws})
    page = figure_of(fc.scenes.datasheet(study))
    # Vm is 100 um less 1e-4 (1.5e5/2.15e6) up to the seating pressure, Kni 20 (1 + 0.075)^2
    constants = "Vm 93 (93 to 93) µm, Kni 23.1 (23.1 to 23.1) MPa/mm"
    monkeypatch.setenv("COLUMNS", "300")  # no cell takes several lines
    shown, whole = texts(page), fc.scenes.summary(study, verbose=True)
    for name in ("exponential, l 3 ", f"hyperbolic, {constants}", "none"):
        assert name in whole
        assert all(word in shown for word in name.split())
    assert "150 kPa" in shown
    render(page)
    own = fc.joints.closure_laws(tree["joints/closure"].to_dataset())
    both = tree.copy()
    both["joints/closure_laws"] = xr.DataTree(own)
    page = figure_of(fc.scenes.datasheet(both))
    axes = {ax.get_title(loc="left"): ax for ax in page.axes}
    line = axes["normal stiffness (MPa/mm)"].lines[1]
    np.testing.assert_allclose(line.get_ydata(), own["stiffness"].isel(shear=1) / 1e9)
    np.testing.assert_allclose(line.get_xdata(), pressure / 1e6)
    assert "undecided, misfits" in texts(page)  # three steps
    whole = fc.scenes.summary(both, verbose=True)
    for state in (own.isel(shear=0), own.isel(shear=1)):
        one, other = (quantity_text(state[f"{law}_misfit"], "m") for law in ("exponential", "hyperbolic"))
        assert f", misfits: exponential {one}, hyperbolic {other}" in whole
    assert "seating pressure" not in texts(page)  # from first touch


def test_a_study_of_the_roughness_alone_has_a_page(tree):
    page = figure_of(
        fc.scenes.datasheet(
            xr.DataTree.from_dict(
                {
                    "/joints/roughness_coefficient": fc.joints.roughness_coefficient(
                        fc.surfaces.fbm((24, 24), 5e-4, hurst=0.8, rms_increment=8e-5, rng=2)
                    )
                }
            )
        )
    )
    assert "JRC" in texts(page)
    render(page)


def test_a_study_without_a_joint_is_refused():
    with pytest.raises(ValueError, match="joints/strength_envelope"):
        fc.scenes.datasheet(xr.DataTree())
