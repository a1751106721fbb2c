"""A study to PNG files: exactly the figures it has data for."""

import subprocess
import sys

import numpy as np
import plotting_synthetic as synthetic
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact import plotting
from fractalcontact.base.errors import InvalidInput

PAPER = [
    "figure_1_surface",
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
    return xr.DataTree.from_dict({f"/{path}": tree[path].to_dataset(inherit=False) for path in paths})


def test_complete_study(study, tmp_path):
    written = plotting.draw(study, tmp_path / "new")
    assert names(written) == PAPER + OTHERS
    assert sorted(p.name for p in (tmp_path / "new").iterdir()) == sorted(p.name for p in written)
    for path in written:
        assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
        assert path.stat().st_size < 600_000


def test_study_that_is_not_compared_with_the_paper(study, tmp_path):
    tree = part(study, "surfaces", "joints/closure")
    expected = ["surface", "joint_closure", "joint_contact_domains"]
    assert names(plotting.draw(tree, tmp_path, paper=False)) == expected


@pytest.mark.parametrize(
    ("paths", "expected"),
    [
        (("surfaces",), ["figure_1_surface"]),
        (("surfaces", "joints/delta_surface"), ["figure_1_surface", "figure_2_sliding_scheme"]),
        (("joints/rigid_dilatancy",), ["figure_5_dilatancy"]),
        (("joints/elastic_dilatancy",), ["figure_5_dilatancy"]),
        (("joints/closure",), ["figure_3_closure", "figure_4_contact_domains"]),
        (("dimensions",), ["dimensions"]),
        (("domains/lacunarity",), ["lacunarity"]),
        ((), []),
    ],
)
def test_part_of_a_study(study, tmp_path, paths, expected):
    assert names(plotting.draw(part(study, *paths), tmp_path)) == expected


def test_study_without_a_joint(study, tmp_path):
    pressed = study["joints/closure"].to_dataset().isel(shear=0, drop=True)
    tree = xr.DataTree.from_dict({"/contact": pressed})
    assert names(plotting.draw(tree, tmp_path)) == ["closure_law", "contact_area", "contact_domains"]
    tree = xr.DataTree.from_dict({"/contact": pressed.drop_vars("state")})
    assert names(plotting.draw(tree, tmp_path)) == ["closure_law", "contact_area"]


def test_closure_without_maps(study, tmp_path):
    tree = part(study, "joints/closure")
    tree["joints/closure"] = tree["joints/closure"].to_dataset().drop_vars("state")
    assert names(plotting.draw(tree, tmp_path)) == ["figure_3_closure"]


def test_several_directions_under_force(tmp_path):
    opening = synthetic.dilatancy(shears=np.linspace(0, 8e-4, 5))
    tree = xr.DataTree.from_dict(
        {"/joints/elastic_dilatancy": opening, "/joints/friction": synthetic.friction(opening)}
    )
    assert names(plotting.draw(tree, tmp_path)) == ["figure_5_dilatancy", "friction"]


def test_failed_write_keeps_old_file(study, tmp_path, monkeypatch):
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    (tmp_path / "lacunarity.png").write_bytes(b"old")

    def fails(canvas, path, **options):
        path.write_bytes(b"half")
        raise OSError("disk full")

    monkeypatch.setattr(FigureCanvasAgg, "print_png", fails)
    with pytest.raises(InvalidInput, match="disk full"):
        plotting.draw(part(study, "domains/lacunarity"), tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["lacunarity.png"]
    assert (tmp_path / "lacunarity.png").read_bytes() == b"old"


def test_lazy_imports_and_no_pyplot(tmp_path, study):
    path = fc.save(part(study, "domains/lacunarity"), tmp_path / "result.nc")
    script = (
        "import sys, gc\n"
        "import fractalcontact as fc\n"
        "import fractalcontact.plotting\n"
        "assert not {'matplotlib', 'xarray', 'numba'} & set(sys.modules)\n"
        "from fractalcontact.plotting import draw, paper_figure\n"
        "assert not {'matplotlib', 'numba'} & set(sys.modules)\n"
        f"tree = fc.open({str(path)!r})\n"
        f"for _ in range(3): draw(tree, {str(tmp_path)!r})\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
        "from matplotlib.figure import Figure\n"
        "gc.collect()\n"
        "assert not [o for o in gc.get_objects() if isinstance(o, Figure)]\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True, timeout=120)
