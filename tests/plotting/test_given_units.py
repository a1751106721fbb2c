"""Units of axes: as wanted, readable from the axes, and the shown number times the unit is the value."""

import numpy as np
import plotting_synthetic
import pytest
import xarray as xr
from matplotlib.figure import Figure
from plotting_figures import drawn, factor

from fractalcontact import joints, plotting, surfaces
from fractalcontact.base.errors import InvalidInput


def test_units_are_as_wanted_and_can_be_read(study):
    closed = study["joints/closure"].to_dataset()
    wanted = {"closure": "m", "normal_force": "kN", "shear": "um"}
    ax, plain = plotting.plot(closed, "closure", units=wanted), plotting.plot(closed, "closure")
    assert (ax.get_xlabel(), ax.xaxis.get_units()) == ("closure (m)", "m")
    assert (ax.get_ylabel(), ax.yaxis.get_units()) == ("normal force $F$ (kN)", "kN")
    assert ax.artists[0].get_title().get_text() == "shear $v$ (µm)"
    for one, other in zip(drawn(ax), drawn(plain), strict=True):
        assert np.allclose(one, other, rtol=1e-12)
    assert "display_units" not in closed["closure"].attrs  # the data stay as they are


def test_chosen_prefix_can_be_read(study):
    ax = plotting.plot(study["joints/closure"], "closure")
    assert ax.xaxis.get_units() == "µm"
    assert ax.xaxis.get_units() in ax.get_xlabel()


def test_units_of_the_load_can_be_read(study):
    ax = plotting.plot(study["joints/transmissivity"], "hydraulic_aperture", units={"normal_force": "N"})
    assert (ax.get_xlabel(), ax.xaxis.get_units()) == ("normal force $F$ (N)", "N")
    loads, shears = plotting.box_dimension(study["domains/box_dimension"], units={"shear": "m"})
    assert loads.xaxis.get_units() in loads.get_xlabel()
    assert (shears.get_xlabel(), shears.xaxis.get_units()) == ("shear displacement $v$ (m)", "m")


def test_units_of_maps_and_of_both_axes_of_an_envelope(study):
    surface = study["surfaces"]
    ax = plotting.surface(surface, units={"x": "µm", "height": "nm"})
    assert (ax.xaxis.get_units(), ax.yaxis.get_units()) == ("µm", "µm")
    bar = ax.figure.axes[1]
    assert bar.yaxis.get_units() == "nm"
    assert bar.get_ylim()[1] * factor(bar.get_ylabel()) == pytest.approx(
        float(surface["height"].max()), rel=0.3
    )


@pytest.mark.parametrize(
    ("units", "bar", "along"),
    [
        ({"height": "nm"}, "nm", "mm"),
        ({"x": "µm"}, "µm", "µm"),
        ({"height": "m", "x": "m"}, "m", "m"),
    ],
)
@pytest.mark.parametrize("drawing", [plotting.surface, plotting.field])
@pytest.mark.parametrize("name", ["height", None])
def test_units_of_an_array(drawing, name, units, bar, along):
    heights = surfaces.fbm((16, 16), 1e-3, hurst=0.8, rms_increment=1e-5, rng=1).rename(name)
    ax = drawing(heights, units=units)
    assert ax.xaxis.get_units() == ax.yaxis.get_units() == along
    assert ax.figure.axes[1].yaxis.get_units() == bar
    assert not any("display_units" in part.attrs for part in (heights, heights["x"]))


def test_units_of_an_array_with_scalars_beside_it(study):
    state = study["joints/closure"].to_dataset()["state"].isel(shear=0, step=-1)
    pressure = (1e9 * state).rename("pressure").assign_attrs(units="Pa")
    ax = plotting.field(pressure, units={"pressure": "GPa", "shear": "m"})
    assert ax.figure.axes[1].yaxis.get_units() == "GPa"
    with pytest.raises(InvalidInput, match=r"units\['height'\]"):
        plotting.field(pressure, units={"height": "mm"})


@pytest.mark.parametrize(
    ("unit", "largest"),
    [("MPa/mm", 20.0), ("GPa/m", 20.0), ("kPa/um", 20.0), ("Pa/m", 2e10), ("Pa m-1", 2e10)],
)
def test_unit_of_a_stiffness_is_a_quotient(unit, largest):
    values = {"stiffness": ("step", [1e10, 2e10], {"units": "Pa m-1"}), "closure": ("step", [1e-6, 2e-6])}
    path = xr.Dataset(values)
    ax = plotting.path(path, "stiffness", units={"stiffness": unit})
    assert ax.lines[0].get_ydata()[-1] == pytest.approx(largest, rel=1e-12)
    with pytest.raises(
        InvalidInput, match=r"units\['stiffness'\]: expected Pa m-1, with a prefix, got 'N/mm'"
    ):
        plotting.path(path, "stiffness", units={"stiffness": "N/mm"})


def test_percent_or_fraction(study):
    data = study["joints/closure"].to_dataset()
    percent, fraction = (
        plotting.plot(data, "contact_area", units={"contact_fraction": unit}) for unit in "%1"
    )
    highest = [max(line.get_ydata().max() for line in ax.lines) for ax in (percent, fraction)]
    assert highest[0] == pytest.approx(100 * highest[1])
    assert fraction.get_ylabel() == "real / nominal contact area"


@pytest.mark.parametrize(
    ("units", "named"),
    [({"closure": "N"}, "closure"), ({"stiffness": "N"}, "stiffness"), ({"closure": "furlong"}, "closure")],
)
def test_wrong_units_are_refused(study, units, named):
    with pytest.raises(InvalidInput, match=rf"units\['{named}'\]"):
        plotting.plot(study["joints/closure"], "closure", units=units, ax=Figure().add_subplot())


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_formats_of_files(study, tmp_path, suffix):
    tree = xr.DataTree.from_dict({"/dimensions": study["dimensions"].to_dataset()})
    files = plotting.draw(tree, tmp_path, formats=[suffix])
    start = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[suffix]
    assert files
    assert all(file.suffix == f".{suffix}" and file.read_bytes().startswith(start) for file in files)
    with pytest.raises(InvalidInput, match="formats"):
        plotting.draw(tree, tmp_path, formats=["gif"])


def test_units_of_the_accuracy_figures():
    measured = plotting_synthetic.accuracy()["contact"].to_dataset()
    units = {"run_time": "us", "memory": "kB"}
    time, memory = plotting.plot(measured, "error_against_time", units=units)[0]
    assert (time.get_xlabel(), time.xaxis.get_units()) == ("run time (µs)", "µs")
    assert (memory.get_xlabel(), memory.xaxis.get_units()) == ("peak memory (kB)", "kB")
    first = measured.isel(method=0).dropna("setting")
    assert time.lines[0].get_xdata() == pytest.approx(1e6 * first["run_time"].values)
    assert memory.lines[0].get_xdata() == pytest.approx(first["memory"].values / 1e3)


def test_numbers_without_a_unit_say_so(study):
    assert plotting.dimensions(study["dimensions"]).xaxis.get_units() == ""


@pytest.mark.parametrize("units", ["kN", 3, {"normal_force": 3}, ["normal_force", "kN"]])
def test_units_of_all_figures_are_words_by_name(study, tmp_path, units):
    tree = xr.DataTree.from_dict({"/joints/closure": study["joints/closure"].to_dataset()})
    with pytest.raises(InvalidInput, match="units: expected a dict of variable and unit"):
        plotting.draw(tree, tmp_path, units=units)
    with pytest.raises(InvalidInput, match="units: expected a dict of variable and unit"):
        plotting.plot(tree["joints/closure"], "closure", units=units)


def test_units_in_titles_and_names_of_curves():
    gap = surfaces.from_array(np.full((8, 16), 1e-4), 1.0)
    water = joints.uplift(gap, upstream_pressure=490e3).assign_coords(shear=2e-3, effective_stress=4e5)
    title = plotting.uplift(water)[0].get_title(loc="left")
    assert title == "shear 2 mm, effective stress 400 kPa"
    units = {"shear": "um", "effective_stress": "MPa"}
    title = plotting.uplift(water, units=units)[0].get_title(loc="left")
    assert title == "shear 2000 µm, effective stress 0.4 MPa"

    face = surfaces.fbm((32, 32), 5e-4, hurst=0.8, rms_increment=1e-4, rng=1)
    law = {"nominal_pressure": 1e6, "wall_strength": 6e7, "residual_friction_angle": 30}
    curve = joints.shear_curve(face, [0, 1e-3, 5e-3], **law)
    numbers = plotting.curves(plotting.plot(curve, "shear_curve", units={"nominal_pressure": "kPa"}))
    assert numbers["curve"].str.endswith("normal stress = 1000 kPa").all()
