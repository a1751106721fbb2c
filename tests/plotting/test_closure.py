"""Closure laws and contact area: the curves are the values of the result in the unit of the label."""

import numpy as np
import plotting_synthetic as synthetic
import pytest
import xarray as xr
from plotting_figures import drawn, holds, render

import fractalcontact as fc
from fractalcontact import plotting
from fractalcontact.base import provenance
from fractalcontact.base.errors import InvalidInput


@pytest.fixture
def closed():
    return synthetic.closure(synthetic.delta(synthetic.heights(), shears=(8e-4, 1.6e-3, 8e-3)))


def test_closure_laws_curves(closed):
    curves = drawn(plotting.plot(closed, "closure"))
    for v in closed.shear:
        for name in ("closure", "interface_closure"):
            assert holds(curves, closed[name].sel(shear=v), closed.normal_force)


@pytest.fixture(scope="module")
def under_pressure():
    face = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    crack = fc.joints.Crack(face, young=3e10, poisson=0.2, block=1.6e-3)
    return fc.joints.closure(crack, shear=[1e-4, 2e-4], nominal_pressure=[1e5, 3e5, 1e6], keep=["state"])


def test_figures_follow_the_load_that_was_prescribed(under_pressure, tmp_path):
    read = fc.open(fc.save(under_pressure, tmp_path / "closure.nc"))
    of_domains = fc.domains.box_dimension(provenance.with_provenance(under_pressure, "state"))
    for result in (under_pressure, read, under_pressure.reset_index("nominal_pressure")):
        assert plotting.plot(result).get_ylabel() == "nominal pressure (MPa)"
        assert plotting.plot(result, "contact_area").get_xlabel() == "nominal pressure (MPa)"
        maps = plotting.plot(result, "contact_domains", shear=1e-4)
        assert "$p$ = 0.1 MPa" in maps[0].get_title(loc="left")
    assert plotting.path(under_pressure["mean_gap"]).get_xlabel() == "nominal pressure (MPa)"
    assert plotting.box_dimension(of_domains)[0].get_xlabel() == "nominal pressure (MPa)"
    forces = plotting.plot(under_pressure, "contact_area", against="normal_force")
    assert forces.get_xlabel() == "normal force $F$ (N)"


def test_closure_against_the_nominal_pressure(closed):
    assert plotting.plot(closed).get_ylabel() == "normal force $F$ (kN)"
    pressure = ("step", closed.normal_force.values / 4e-4, {"units": "Pa"})
    ax = plotting.plot(closed.assign_coords(nominal_pressure=pressure), against="nominal_pressure")
    assert ax.get_ylabel() == "nominal pressure (MPa)"
    for v in closed.shear:
        assert holds(drawn(ax), closed.closure.sel(shear=v), pressure[1])
    laws = xr.Dataset()
    with pytest.raises(InvalidInput, match="against: expected nominal_pressure"):
        plotting.plot(closed, "closure", laws=laws, against="normal_force")


def test_closure_fits_are_the_laws():
    p = np.geomspace(1e5, 1e7, 9)
    curves = [
        3e-5 * np.log(p / 2e3),
        p * 1e-4 / (2e6 + p),
    ]
    closure = xr.Dataset(
        {"interface_closure": (("shear", "step"), np.array(curves))},
        coords={
            "shear": ("shear", [0.0, 1e-3], {"units": "m"}),
            "step": np.arange(9),
            "nominal_pressure": ("step", p, {"units": "Pa"}),
        },
    )
    for seat in (None, float(p[1])):
        laws = fc.joints.closure_laws(closure, seating_pressure=seat)
        ax = plotting.plot(closure, "closure", laws=laws)
        lines = [(line.get_xdata(), line.get_ydata(), line.get_linewidth()) for line in ax.lines]
        for i, preferred in enumerate((0, 1)):  # exponential, then hyperbolic: after the points of all shears
            x, y, width = lines[2 + 2 * i + preferred]
            assert width > lines[3 + 2 * i - preferred][2]
            origin = 0.0 if seat is None else curves[i][1]
            np.testing.assert_allclose(lines[i][0], (curves[i] - origin) * 1e6, atol=1e-9)
            shown = slice(0 if seat is None else 2, None)
            found = np.interp(np.log(p[shown] / 1e6), np.log(y), x)
            np.testing.assert_allclose(found, (curves[i][shown] - origin) * 1e6, rtol=2e-3)
    render(ax.figure)
    with pytest.raises(InvalidInput, match="laws: expected 2 shears"):
        plotting.plot(closure, "closure", laws=laws.isel(shear=[0]))


def test_marked_points(closed):
    ax = plotting.plot(closed, "closure", shear=1.6e-3, marked=[1, 3])
    expected = closed.sel(shear=1.6e-3).isel(step=[1, 3])
    assert holds(drawn(ax), expected.interface_closure, expected.normal_force)
    assert [text.get_text() for text in ax.texts] == ["A", "B"]


def test_contact_area_raw_and_corrected(closed):
    curves = drawn(plotting.plot(closed, "contact_area"))
    for v in closed.shear:
        expected = closed.sel(shear=v)
        assert holds(curves, expected.normal_force, expected.contact_fraction)
        assert holds(curves, expected.normal_force, expected.corrected_contact_fraction)


def test_contact_area_against_closure(closed):
    curves = drawn(plotting.plot(closed, "contact_area", against="closure"))
    assert holds(curves, closed.closure.isel(shear=0), closed.contact_fraction.isel(shear=0))


def test_long_legend_is_thinned():
    shears = np.linspace(8e-4, 8e-3, 10)
    closed = synthetic.closure(synthetic.delta(synthetic.heights(), shears=shears))
    ax = plotting.plot(closed, "closure")
    named = [text.get_text() for legend in ax.artists for text in legend.get_texts()]
    assert "0.8" in named
    assert "8" in named
    assert len(named) <= 8 + 2
    render(ax.figure)


def test_draw_into_given_axes(closed):
    from matplotlib.figure import Figure

    sheet = Figure(layout="constrained")
    left, right = sheet.subplots(1, 2)
    assert plotting.plot(closed, "closure", ax=left) is left
    assert plotting.plot(closed, "contact_area", ax=right) is right
    assert len(sheet.axes) == 2


def test_rc_settings_are_restored(closed):
    import matplotlib

    before = dict(matplotlib.rcParams)
    plotting.plot(closed, "closure")
    assert dict(matplotlib.rcParams) == before


def test_missing_variables_are_listed():
    with pytest.raises(InvalidInput, match="'closure'.*\n.*'normal_force'"):
        plotting.plot(synthetic.estimates(), "closure")
    with pytest.raises(InvalidInput, match="labelled result"):
        plotting.box_dimension([1, 2, 3])
    with pytest.raises(InvalidInput, match="one of 'E', 'N', 'W', 'S', got 'Q'"):
        plotting.dilatancy(synthetic.dilatancy(), direction="Q")


def test_theories_beside_the_contact_area():
    surface = fc.surfaces.spectral((32, 32), 1e-4, hurst=0.8, rms_slope=0.1, rng=1)
    given = {"contact_modulus": 1e9, "nominal_pressure": [1e5, 5e5, 1e6]}
    pressed, theory = fc.contact.press(surface, **given), fc.contact.theories(surface, **given)
    for against in ("nominal_pressure", "normal_force"):
        ax = plotting.plot(pressed, "contact_area", against=against, theory=theory)
        for name in theory.theory[:-1]:  # hertz does not hold on a rough surface, and is not drawn
            expected = theory.contact_fraction.sel(theory=name)
            assert holds(drawn(ax), expected[against], expected)
    named = [text.get_text() for legend in ax.artists for text in legend.get_texts()]
    assert "Bush, Gibson, Thomas" in named
    with pytest.raises(InvalidInput, match="'closure'"):
        plotting.plot(pressed, "contact_area", against="closure", theory=theory)


def test_logarithmic_axes_show_every_decade_with_a_line_proportional_to_the_load(closed):
    loaded = closed.isel(step=slice(1, None))
    ax = plotting.plot(loaded, "contact_area", log=True)
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    x, y = next(line for line in ax.lines if line.get_linestyle() == ":").get_data()
    assert x == pytest.approx(np.array([0.1, 30.0]))  # kN
    assert y[1] / y[0] == pytest.approx(300.0)
    laws = plotting.plot(loaded, "closure", log=True)
    assert (laws.get_xscale(), laws.get_yscale()) == ("log", "log")
    assert plotting.plot(loaded, "closure").get_xscale() == "linear"


@pytest.mark.parametrize("factor", [0.0, 1e-3, 1.0])
def test_letters_do_not_overlap(closed, factor):
    near = closed.assign({name: factor * closed[name] for name in ("closure", "interface_closure")})
    near = near.assign_coords(normal_force=factor * near.normal_force)
    ax = plotting.plot(near.isel(shear=0), "closure", marked=[0, 1, 2, 3, 4])
    ax.set_xlim(0, 1e3)
    render(ax)
    boxes = [text.get_bbox_patch().get_window_extent() for text in ax.texts]
    centres = np.array([[box.x0 + box.x1, box.y0 + box.y1] for box in boxes]) / 2
    apart = np.hypot(*(centres[:, None] - centres[None]).transpose(2, 0, 1))[np.triu_indices(len(boxes), 1)]
    assert apart.min() > 0.7 * boxes[0].width


def test_letters_above_their_points_stay_on_the_figure(closed):
    twice = closed.isel(shear=0, step=[0, 4, 0, 4, 4])
    ax = plotting.plot(twice, "closure", marked=[0, 1, 2, 3, 4])
    render(ax)
    top = max(text.get_bbox_patch().get_window_extent().y1 for text in ax.texts)
    assert top <= ax.figure.bbox.y1


def test_line_of_proportional_growth_ends_with_the_curves():
    loads = np.geomspace(1.0, 1e4, 9)
    fraction = np.minimum(1e-2 * loads, 1.0)
    loading = {"nominal_pressure": ("step", 1e6 * loads)}
    pressed = xr.Dataset({"contact_fraction": ("step", fraction)}, loading)
    ax = plotting.plot(pressed, "contact_area", against="nominal_pressure", log=True)
    (line,) = [line for line in ax.lines if line.get_label().startswith("proportional")]
    assert line.get_ydata().max() == pytest.approx(100.0)
    assert line.get_xdata().max() == pytest.approx(0.1)  # GPa
