"""A study to its files: exactly the figures it has data for, reproducible from the saved file alone."""

import subprocess
import sys

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact import plotting
from fractalcontact.base.errors import InvalidInput

PAPER = [
    "figure_1_face",
    "figure_2_sliding_scheme",
    "figure_3_closure",
    "figure_4_contact_domains",
    "figure_5_dilatancy",
]
OTHERS = [
    "dimensions",
    "dimension_curves",
    "friction",
    "box_dimension",
    "lacunarity",
    "islands",
    "hydraulic_aperture",
]


def names(paths):
    return [path.name.removesuffix(".png") for path in paths]


def part(tree, *paths):
    import xarray as xr

    return xr.DataTree.from_dict({f"/{path}": tree[path].to_dataset(inherit=False) for path in paths})


def test_whole_study(whole_study, tmp_path):
    written = plotting.draw(whole_study, tmp_path / "new")
    assert names(written) == PAPER + OTHERS
    assert sorted(p.name for p in (tmp_path / "new").iterdir()) == sorted(p.name for p in written)
    for path in written:
        assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
        assert path.stat().st_size < 600_000


@pytest.mark.parametrize(
    ("paths", "expected"),
    [
        (("surfaces",), ["figure_1_face"]),
        (("surfaces", "joints/delta_surface"), ["figure_1_face", "figure_2_sliding_scheme"]),
        (("joints/rigid_dilatancy",), ["figure_5_dilatancy"]),
        (("joints/elastic_dilatancy",), ["figure_5_dilatancy"]),
        (("joints/closure",), ["figure_3_closure", "figure_4_contact_domains"]),
        (("dimensions",), ["dimensions"]),
        (("domains/lacunarity",), ["lacunarity"]),
        ((), []),
    ],
)
def test_part_of_a_study(whole_study, tmp_path, paths, expected):
    assert names(plotting.draw(part(whole_study, *paths), tmp_path)) == expected


def test_study_without_a_joint(whole_study, tmp_path):
    import xarray as xr

    pressed = whole_study["joints/closure"].to_dataset().isel(shear=0, drop=True)
    tree = xr.DataTree.from_dict({"/contact": pressed})
    assert names(plotting.draw(tree, tmp_path)) == ["closure_law", "contact_area", "contact_domains"]
    tree = xr.DataTree.from_dict({"/contact": pressed.drop_vars("state")})
    assert names(plotting.draw(tree, tmp_path)) == ["closure_law", "contact_area"]


def test_closure_without_maps(whole_study, tmp_path):
    tree = part(whole_study, "joints/closure")
    tree["joints/closure"] = tree["joints/closure"].to_dataset().drop_vars("state")
    assert names(plotting.draw(tree, tmp_path)) == ["figure_3_closure"]


def test_several_directions_under_force(made, tmp_path):
    import xarray as xr

    opening = made.dilatancy(shears=np.linspace(0, 8e-4, 5))
    tree = xr.DataTree.from_dict(
        {"/joints/elastic_dilatancy": opening, "/joints/friction": made.friction(opening)}
    )
    assert names(plotting.draw(tree, tmp_path)) == ["figure_5_dilatancy", "friction"]


@pytest.mark.parametrize("number", range(1, 6))
def test_a_saved_study_gives_the_same_figure(whole_study, tmp_path, number):
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    def pixels(tree):
        canvas = FigureCanvasAgg(plotting.paper_figure(tree, number))
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())

    again = fc.open(fc.save(whole_study, tmp_path / "result.nc"))
    assert np.array_equal(pixels(whole_study), pixels(again))


def test_paper_figures_need_their_data(whole_study):
    with pytest.raises(InvalidInput, match="data for figure 3 in joints/closure"):
        plotting.paper_figure(part(whole_study, "surfaces"), 3)
    with pytest.raises(InvalidInput, match="<= 5, got 6"):
        plotting.paper_figure(whole_study, 6)


def test_paper_figure_shows_the_shear_near_a_fiftieth_of_the_block(whole_study):
    # the block is 19.2 mm wide: 0.8 mm is nearer to a fiftieth of it than 1.6 or 8 mm
    figure = plotting.paper_figure(whole_study, 4)
    assert "0.8 mm" in figure.get_suptitle()


def test_letters_of_the_maps_are_those_on_the_curve(whole_study):
    laws = plotting.paper_figure(whole_study, 3).axes[0]
    maps = plotting.paper_figure(whole_study, 4)
    on_the_curve = [text.get_text() for text in laws.texts]
    on_the_maps = [ax.get_title(loc="left")[5] for ax in maps.axes if ax.images]
    assert on_the_curve == on_the_maps == list("ABCD")


def test_a_failed_write_leaves_nothing(whole_study, tmp_path, monkeypatch):
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    (tmp_path / "lacunarity.png").write_bytes(b"old")

    def fails(canvas, path):
        path.write_bytes(b"half")
        raise OSError("disk full")

    monkeypatch.setattr(FigureCanvasAgg, "print_png", fails)
    with pytest.raises(OSError, match="disk full"):
        plotting.draw(part(whole_study, "domains/lacunarity"), tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["lacunarity.png"]
    assert (tmp_path / "lacunarity.png").read_bytes() == b"old"


def test_importing_loads_no_matplotlib_and_drawing_no_pyplot(tmp_path, whole_study):
    path = fc.save(part(whole_study, "domains/lacunarity"), tmp_path / "result.nc")
    script = (
        "import sys, gc\n"
        "import fractalcontact as fc\n"
        "import fractalcontact.plotting\n"
        "assert not {'matplotlib', 'xarray', 'numba'} & set(sys.modules)\n"
        "from fractalcontact.plotting import draw, drawing, paper_figure\n"
        "assert not {'matplotlib', 'xarray', 'numba'} & set(sys.modules)\n"
        f"tree = fc.open({str(path)!r})\n"
        f"for _ in range(3): draw(tree, {str(tmp_path)!r})\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
        "from matplotlib.figure import Figure\n"
        "gc.collect()\n"
        "assert not [o for o in gc.get_objects() if isinstance(o, Figure)]\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True, timeout=120)
