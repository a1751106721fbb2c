"""One step, one shear, nothing but NaN, nothing in contact, nanometres and kilometres: a figure each time."""

import numpy as np
import pytest

from fractalcontact import plotting
from fractalcontact.base.schema import label


def render(figure):
    """Draw a figure to its pixels, as a file would have it, and check that nothing is cut off."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3]
    border = np.concatenate([pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]])
    assert (border == 255).all(), "something is cut off at the edge of the figure"
    return pixels


CASES = {
    "one step": {"step": slice(-1, None)},
    "one step without the dim": {"step": -1},
    "one shear": {"shear": slice(0, 1)},
    "one shear without the dim": {"shear": 0},
    "one of each": {"shear": 0, "step": -1},
    "unloaded": {"step": slice(0, 1)},
}


@pytest.mark.parametrize("case", CASES)
def test_parts_of_a_study(made, whole_study, case):
    del made
    for path, drawing in (
        ("joints/closure", plotting.closure_laws),
        ("joints/closure", plotting.contact_area),
        ("joints/transmissivity", plotting.hydraulic_aperture),
        ("domains/box_dimension", plotting.box_dimension),
        ("domains/lacunarity", plotting.lacunarity),
    ):
        render(drawing(whole_study[path].to_dataset().isel(CASES[case])))


@pytest.mark.parametrize("case", [case for case in CASES if "one shear" in case or "one" not in case])
def test_domain_maps_of_parts(whole_study, case):
    render(plotting.contact_domains(whole_study["joints/closure"].to_dataset().isel(CASES[case]), shear=0.0))


def test_many_shears_are_not_all_named(made):
    shears = np.linspace(8e-4, 8e-3, 10)
    closed = made.closure(made.delta(made.heights(), shears=shears))
    ax = plotting.closure_laws(closed).axes[0]
    named = [text.get_text() for legend in ax.artists for text in legend.get_texts()]
    assert "0.8" in named
    assert "8" in named
    assert len(named) <= 8 + 2
    render(ax.figure)


def test_nothing_but_nan(whole_study):
    for path, drawing in (
        ("joints/closure", plotting.closure_laws),
        ("joints/closure", plotting.contact_area),
        ("joints/rigid_dilatancy", plotting.rigid_dilatancy),
        ("joints/elastic_dilatancy", plotting.elastic_dilatancy),
        ("joints/friction", plotting.friction),
        ("joints/transmissivity", plotting.hydraulic_aperture),
        ("domains/box_dimension", plotting.box_dimension),
        ("domains/lacunarity", plotting.lacunarity),
        ("dimensions", plotting.dimensions),
        ("surfaces", plotting.face),
    ):
        data = whole_study[path].to_dataset()
        floats = {name: v * np.nan for name, v in data.data_vars.items() if v.dtype.kind == "f"}
        render(drawing(data.assign(floats)))


def test_an_empty_domain(made):
    closed = made.closure(made.delta(made.heights()))
    empty = closed.assign(state=closed.state * 0)
    render(plotting.contact_domains(empty, shear=8e-3))
    render(plotting.islands(made.islands(empty.state.isel(shear=0, step=0))))


def test_a_full_domain_and_one_island(made):
    closed = made.closure(made.delta(made.heights()))
    full = closed.assign(state=closed.state * 0 + 1)
    render(plotting.contact_domains(full, normal_force=1e3))
    render(plotting.islands(made.islands(full.state.isel(shear=0, step=0))))


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e6])
def test_any_size(made, size):
    face = made.heights()
    grown = label(face.copy(data=face.values * size).assign_coords(x=face.x * size, y=face.y * size))
    render(plotting.face(grown))
    slid = made.delta(face, shears=(8e-3,))
    scaled = slid.copy(data=slid.values * size)
    grown_slid = label(scaled.assign_coords(x=slid.x * size, y=slid.y * size, shear=slid.shear * size))
    render(plotting.sliding_scheme(grown, grown_slid))


@pytest.mark.parametrize("shape", [(3, 3), (1, 40), (40, 1), (3, 300)])
def test_any_shape(shape):
    import xarray as xr

    z = np.random.default_rng(1).standard_normal(shape)
    coords = {dim: (np.arange(n) + 0.5) * 1e-3 for dim, n in zip("yx", shape, strict=True)}
    render(plotting.face(label(xr.DataArray(z * 1e-4, dims=("y", "x"), coords=coords, name="height"))))


@pytest.mark.parametrize("value", [0.0, 1e9, -1e-12])
def test_flat_faces(made, value):
    face = made.heights()
    render(plotting.face(face * 0 + value))


def test_a_mask_without_coordinates():
    import xarray as xr

    mask = xr.DataArray(np.eye(12, dtype=bool), dims=("y", "x"), name="state")
    render(plotting.contact_domains(mask))


def test_directions_of_any_azimuth(made):
    opening = made.dilatancy(forces=(), directions=("E", "NE", "30"))
    ax = plotting.rigid_dilatancy(opening).axes[0]
    named = [text.get_text() for legend in ax.artists for text in legend.get_texts()]
    assert named[:3] == ["East", "NE", "30°"]
    looks = [(line.get_color(), line.get_linestyle()) for line in ax.lines[:6:2]]
    assert len(set(looks)) == 3
    assert plotting.sliding.direction_word("33.5") == "33.5°"
    render(ax.figure)


def test_one_shear_of_dilatancy(made):
    render(plotting.rigid_dilatancy(made.dilatancy(shears=[8e-4], forces=())))
    render(plotting.elastic_dilatancy(made.dilatancy(shears=[0.0], directions=("W",))))


def test_a_scheme_that_has_not_slid_and_one_that_slides_north(made):
    face = made.heights()
    slid = made.delta(face, shears=(8e-3,))
    render(plotting.sliding_scheme(face, made.delta(face, shears=(0.0,))))
    render(plotting.sliding_scheme(face, slid.assign_coords(direction="N", azimuth=90.0)))
    render(plotting.sliding_scheme(face, slid.assign_coords(direction="30", azimuth=30.0)))
