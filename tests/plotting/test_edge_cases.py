"""Single steps, single shears, NaN, empty and full domains, extreme sizes: a complete figure each time."""

from functools import partial

import numpy as np
import plotting_synthetic as synthetic
import pytest
import xarray as xr
from plotting_figures import render

from fractalcontact import domains, plotting, surfaces
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.schema import label

CASES = {
    "one step": {"step": slice(-1, None)},
    "one step without the dim": {"step": -1},
    "one shear": {"shear": slice(0, 1)},
    "one shear without the dim": {"shear": 0},
    "one of each": {"shear": 0, "step": -1},
    "unloaded": {"step": slice(0, 1)},
}


SLOW = ("one step without the dim", "one shear")  # two cases in one: "one of each" has neither dim


@pytest.mark.parametrize(
    "case", [pytest.param(case, marks=pytest.mark.slow if case in SLOW else []) for case in CASES]
)
def test_parts_of_a_study(study, case):
    for path, drawing in (
        ("joints/closure", partial(plotting.plot, kind="closure")),
        ("joints/closure", partial(plotting.plot, kind="contact_area")),
        ("joints/transmissivity", partial(plotting.plot, kind="hydraulic_aperture")),
        ("domains/box_dimension", plotting.box_dimension),
        ("domains/lacunarity", plotting.lacunarity),
    ):
        render(drawing(study[path].to_dataset().isel(CASES[case])))


@pytest.mark.parametrize("case", [case for case in CASES if "one shear" in case or "one" not in case])
def test_domain_maps_of_parts(study, case):
    render(
        plotting.plot(study["joints/closure"].to_dataset().isel(CASES[case]), "contact_domains", shear=0.0)
    )


def test_all_nan(study):
    for path, drawing in (
        ("joints/closure", partial(plotting.plot, kind="closure")),
        ("joints/closure", partial(plotting.plot, kind="contact_area")),
        ("joints/rigid_dilatancy", plotting.dilatancy),
        ("joints/elastic_dilatancy", plotting.dilatancy),
        ("joints/friction", plotting.friction),
        ("joints/transmissivity", partial(plotting.plot, kind="hydraulic_aperture")),
        ("domains/box_dimension", plotting.box_dimension),
        ("domains/lacunarity", plotting.lacunarity),
        ("dimensions", plotting.dimensions),
        ("surfaces", plotting.surface),
    ):
        data = study[path].to_dataset()
        floats = {name: v * np.nan for name, v in data.data_vars.items() if v.dtype.kind == "f"}
        render(drawing(data.assign(floats)))


def test_interval_of_a_variable_without_values():
    """Its band has no point: it sets no limits of a logarithmic axis."""
    nothing = {
        name: ("step", np.full(3, np.nan)) for name in ("spot_size", "spot_size_low", "spot_size_high")
    }
    result = label(xr.Dataset(nothing | {"normal_force": ("step", [1.0, 10.0, 100.0])}))
    ax = plotting.path(result, "spot_size")
    render(ax)
    assert ax.get_xlim()[0] > 0


def test_load_of_a_path_at_one_shear():
    """It is a coordinate, the data of which are no variable that could get a dim."""
    closed = synthetic.closure(synthetic.delta(synthetic.heights()))
    load = closed.isel(shear=0, drop=True)["normal_force"]
    line = plotting.plot(load).get_lines()[0]
    assert np.array_equal(line.get_xdata(), line.get_ydata())


def test_signature_without_a_box_size_is_refused():
    mask = np.random.default_rng(1).random((32, 32)) > 0.7
    result = domains.signature(surfaces.from_array(mask.astype(float), 1e-3) > 0.5)
    with pytest.raises(InvalidInput, match="result.side: expected at least one entry"):
        plotting.signature(result.isel(side=slice(0, 0)))


def test_empty_domain():
    closed = synthetic.closure(synthetic.delta(synthetic.heights()))
    empty = closed.assign(state=closed.state * 0)
    render(plotting.plot(empty, "contact_domains", shear=8e-3))
    render(plotting.islands(synthetic.islands(empty.state.isel(shear=0, step=0))))


def test_full_domain():
    closed = synthetic.closure(synthetic.delta(synthetic.heights()))
    full = closed.assign(state=closed.state * 0 + 1)
    render(plotting.plot(full, "contact_domains", normal_force=1e3))
    render(plotting.islands(synthetic.islands(full.state.isel(shear=0, step=0))))


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e6])
def test_any_size(size):
    surface = synthetic.heights()
    grown = label(
        surface.copy(data=surface.values * size).assign_coords(x=surface.x * size, y=surface.y * size)
    )
    render(plotting.surface(grown))
