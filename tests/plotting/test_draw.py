"""A study to PNG files: exactly the figures it has data for."""

from pathlib import Path

import numpy as np
import plotting_synthetic as synthetic
import pytest
import xarray as xr
from copies import copied_command
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

import fractalcontact as fc
from fractalcontact import plotting
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.schema import label

FIGURES = [  # in the order of the groups of the study
    "surface",
    "dimensions",
    "dimension_curves",
    "delta_surface",
    "joint_closure",
    "joint_contact_area",
    "joint_contact_domains",
    "joint_contact_domains_along_shear",
    "joint_first_contact",
    "rigid_dilatancy",
    "joint_dilatancy",
    "friction",
    "hydraulic_aperture",
    "box_dimension",
    "lacunarity",
    "lacunarity_maps",
    "islands",
]


def names(paths):
    return [path.name.removesuffix(".png") for path in paths]


def part(tree, *paths):
    return xr.DataTree.from_dict({f"/{path}": tree[path].to_dataset(inherit=False) for path in paths})


@pytest.fixture(scope="module")
def written(study, tmp_path_factory):
    """The files of the complete study, in a folder that did not exist; two processes draw them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FRACTALCONTACT_THREADS", "2")
        return plotting.draw(study, tmp_path_factory.mktemp("study") / "new")


def test_complete_study(written):
    assert names(written) == FIGURES
    assert sorted(p.name for p in written[0].parent.iterdir()) == sorted(p.name for p in written)
    for path in written:
        assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
        assert path.stat().st_size < 600_000


@pytest.mark.parametrize(
    ("paths", "expected"),
    [
        (("surfaces",), ["surface"]),
        (("surfaces", "joints/delta_surface"), ["surface", "delta_surface"]),
        (("joints/rigid_dilatancy",), ["rigid_dilatancy"]),
        (("joints/elastic_dilatancy",), ["joint_dilatancy"]),
        (
            ("joints/closure",),
            [name for name in FIGURES if name.startswith(("joint_closure", "joint_contact", "joint_first"))],
        ),
        (("dimensions",), ["dimensions"]),
        (("dimensions/variogram",), ["dimension_curves"]),
        (("domains/lacunarity",), ["lacunarity", "lacunarity_maps"]),
        ((), []),
    ],
)
@pytest.mark.usefixtures("empty_files")
def test_part_of_a_study(study, tmp_path, paths, expected):
    """The files that are written; the test above draws what is in them."""
    assert names(plotting.draw(part(study, *paths), tmp_path)) == expected


@pytest.mark.usefixtures("empty_files")
def test_study_without_a_joint(study, tmp_path):
    pressed = study["joints/closure"].to_dataset().isel(shear=0, drop=True)
    tree = xr.DataTree.from_dict({"/contact": pressed})
    expected = ["closure_law", "contact_area", "contact_domains", "first_contact"]
    assert names(plotting.draw(tree, tmp_path)) == expected
    tree = xr.DataTree.from_dict({"/contact": pressed.drop_vars("state")})
    assert names(plotting.draw(tree, tmp_path)) == ["closure_law", "contact_area"]


@pytest.mark.usefixtures("empty_files")
def test_figure_along_the_path_that_a_result_states(study, tmp_path):
    states = study["joints/closure"].to_dataset()["state"]
    percolation = fc.domains.percolation(states)
    assert percolation.attrs["path_figure"] == "largest_share coverage"
    tree = xr.DataTree.from_dict({"/domains/percolation": percolation})
    tree.to_netcdf(tmp_path / "result.nc")
    assert names(plotting.draw(fc.open(tmp_path / "result.nc"), tmp_path)) == ["domains_percolation"]
    of_one_state = xr.DataTree.from_dict({"/domains/percolation": fc.domains.percolation(states[0, 0])})
    assert plotting.draw(of_one_state, tmp_path) == []


@pytest.mark.usefixtures("empty_files")
def test_closure_without_maps(study, tmp_path):
    tree = part(study, "joints/closure")
    tree["joints/closure"] = tree["joints/closure"].to_dataset().drop_vars("state")
    assert names(plotting.draw(tree, tmp_path)) == ["joint_closure", "joint_contact_area"]


@pytest.mark.usefixtures("empty_files")
def test_letters_match_between_curve_and_maps(study, tmp_path, monkeypatch):
    """The steps that are marked on the closure law are those of the maps of contact domains."""
    shown = {}

    def keep(canvas, path, **options):
        figure = canvas.figure
        letters = [text.get_text() for ax in figure.axes for text in ax.texts if len(text.get_text()) == 1]
        titles = [ax.get_title(loc="left") for ax in figure.axes]
        shown[len(shown)] = letters, [title[5] for title in titles if title.startswith(r"$\bf{")]
        Path(path).touch()

    monkeypatch.setattr(FigureCanvasAgg, "print_png", keep)
    plotting.draw(part(study, "joints/closure"), tmp_path)
    (on_the_curve, _), _, (_, on_the_maps), *_ = shown.values()
    assert on_the_curve == on_the_maps == list("ABCD")


@pytest.mark.usefixtures("empty_files")
def test_shear_curve_of_tests_and_of_the_criterion(tmp_path):
    dims = ("nominal_pressure", "shear_displacement")
    coords = {"nominal_pressure": [1e6], "shear_displacement": [0.0, 1e-3]}
    curve = label(xr.Dataset({name: (dims, [[0.0, 1.0]]) for name in ("shear_stress", "dilatancy")}, coords))
    both = {"/joints/direct_shear": curve, "/joints/shear_curve": curve}
    for groups in (both, {"/joints/shear_curve": curve}):
        assert names(plotting.draw(xr.DataTree.from_dict(groups), tmp_path)) == ["shear_curve"]


@pytest.mark.usefixtures("empty_files")
def test_several_directions_under_force(tmp_path):
    opening = synthetic.dilatancy(shears=np.linspace(0, 8e-4, 5))
    tree = xr.DataTree.from_dict(
        {"/joints/elastic_dilatancy": opening, "/joints/friction": synthetic.friction(opening)}
    )
    assert names(plotting.draw(tree, tmp_path)) == ["joint_dilatancy", "friction"]


def test_failed_write_keeps_old_file(study, tmp_path, monkeypatch):
    (tmp_path / "lacunarity.png").write_bytes(b"old")

    def fails(canvas, path, **options):
        path.write_bytes(b"half")
        raise OSError("disk full")

    monkeypatch.setattr(FigureCanvasAgg, "print_png", fails)
    with pytest.raises(InvalidInput, match="disk full"):
        plotting.draw(part(study, "domains/lacunarity"), tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["lacunarity.png"]
    assert (tmp_path / "lacunarity.png").read_bytes() == b"old"


def test_no_pyplot_and_no_figure_left(tmp_path, study):
    path = fc.save(part(study, "domains/lacunarity"), tmp_path / "result.nc")
    script = (
        "import sys, gc\n"
        "import fractalcontact as fc\n"
        "from fractalcontact.plotting import draw\n"
        f"tree = fc.open({str(path)!r})\n"
        f"draw(tree, {str(tmp_path)!r})\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
        "from matplotlib.figure import Figure\n"
        "gc.collect()\n"
        "assert not [o for o in gc.get_objects() if isinstance(o, Figure)]\n"
    )
    done = copied_command(program=script)
    assert done.returncode == 0, done.stderr


def test_every_file_says_what_it_shows(written):
    captions = {}
    for file in written:
        with Image.open(file) as picture:
            captions[file.stem] = picture.info.get("Description")
    assert len(captions) > 10
    assert all(captions.values())
    assert captions["joint_closure"].startswith("normal force F against closure; ")
    assert captions["surface"] == "map of the height"
    assert "along the path of load" in captions["joint_contact_domains"]  # which may turn back
    assert not any("(" in caption for caption in captions.values())  # no units
