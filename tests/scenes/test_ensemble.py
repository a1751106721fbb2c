"""Ensembles: each member as a single study, on workers too, with few maps in memory."""

from concurrent.futures import Executor, Future

import numpy as np
import pytest
import xarray as xr
from study import SOUND

import fractalcontact as fc

PARTS_OF_THE_PAPER = """[joint.decorrelation_length]
shear = [0.0, 1e-4, 4e-4]
[joint.elimination]
block = 1.2e-3
[joint.self_weight]
structure_size = [1.0, 10.0]
unit_weight = 24e3
[want]
"""
ENSEMBLE = (
    SOUND.replace("rng = 5", "rng = 5\nmembers = 2")
    .replace("[want]\n", PARTS_OF_THE_PAPER)
    .replace(
        'joints = ["closure", "rigid_dilatancy"]',
        'surfaces = ["height", "describe"]\ndimensions = ["default"]\n'
        'joints = ["closure", "elastic_dilatancy", "friction", "elimination", "area_by_resolution",\n'
        '"self_weight", "delta_dimension", "decorrelation_length", "transmissivity"]\n'
        'domains = ["box_dimension", "islands"]\nfigures = true\n',
    )
)


@pytest.fixture(scope="module")
def ensemble(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ensemble")
    (folder / "study.toml").write_text(ENSEMBLE, encoding="utf-8")
    return fc.scenes.run(folder / "study.toml", out=folder / "out", progress=False), folder


def test_each_member_equals_a_study_of_its_surface(ensemble):
    tree, _ = ensemble
    faces = fc.surfaces.fbm((48, 48), 1e-4, hurst=0.8, rms_increment=4e-6, rng=5, members=2)
    for number in range(2):
        face = faces.isel(member=number)
        crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=2.4e-3)
        closed = fc.joints.closure(
            crack, shear=[1e-4, 4e-4], direction="W", normal_force=[1.0, 10.0], keep=("state",)
        )
        member = tree["joints/closure"].isel(member=number)
        for name in ("closure", "contact_fraction", "normal_force"):
            np.testing.assert_array_equal(member[name], closed[name])
        boxes = tree["domains/box_dimension"].isel(member=number)
        expected = fc.domains.box_dimension(closed["state"])
        for name in ("box_dimension", "window_low", "window_high"):
            np.testing.assert_array_equal(boxes[name], expected[name])
        measured = boxes["box_dimension"].notnull()  # all shears and loads, parts of the study, in one window
        assert len(np.unique(boxes["window_high"].values[measured.values])) == 1
        hurst = fc.dimensions.estimate(face)["hurst"]
        np.testing.assert_array_equal(tree["dimensions/hurst"][number], hurst)


def test_ensemble_is_written_drawn_and_summarised(ensemble, compliance, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")  # no head of a table is broken
    tree, folder = ensemble
    assert list((folder / "out").glob("*.png"))
    (head,) = (line for line in fc.scenes.summary(tree).splitlines() if "interface closure" in line)
    assert head.startswith("shear to W, at 1.74 MPa ")
    for path in ("joints/closure", "joints/friction", "domains/box_dimension", "dimensions"):
        tree[path].to_dataset().to_netcdf(tmp_path / "one.nc")
        assert compliance(tmp_path / "one.nc") == [], path
    xr.testing.assert_identical(
        fc.open(folder / "out" / "result.nc")["joints/closure"].to_dataset(),
        tree["joints/closure"].to_dataset(),
    )


TILTED = (
    SOUND.partition("[joint]")[0].replace("rng = 5", "rng = 5\nmembers = 3\n{level}")
    + """
[contact]
nominal_pressure = 1e6
[want]
contact = ["press"]
"""
)


def test_tilt_of_members_is_told_and_what_levelling_did(tmp_path):
    faces = fc.surfaces.fbm((48, 48), 1e-4, hurst=0.8, rms_increment=4e-6, rng=5, members=3)
    levelled = fc.surfaces.level(faces, 1)
    shares = 1 - (levelled.std(["y", "x"]) / faces.std(["y", "x"])).values ** 2
    trees = {}
    for level in ("", "level = 1"):
        (tmp_path / "study.toml").write_text(TILTED.format(level=level), encoding="utf-8")
        trees[level] = fc.scenes.run(tmp_path / "study.toml", progress=False)
    np.testing.assert_allclose(trees[""].attrs["plane_share"], shares, rtol=1e-9)
    percent = 100 * shares[shares > 0.5]
    text = " ".join(fc.scenes.summary(trees[""]).split())
    span = " to ".join(dict.fromkeys(f"{end:.0f}" for end in (percent.min(), percent.max())))
    assert f"tilted in {percent.size} of 3 members: its mean plane carries {span} % of Sq²" in text
    text = " ".join(fc.scenes.summary(trees["level = 1"]).split())
    assert "member 0: levelled: tilt" in text
    assert "tilted" not in text


PATH = """
[surface]
generate = "fbm"
shape = [32, 32]
spacing = 1e-4
hurst = 0.8
rms_increment = 4e-6
rng = 5
[contact]
contact_modulus = 1e9
nominal_pressure = { first = 1e3, last = 1e7, count = 60 }
[want]
contact = ["press"]
domains = ["box_counts"]
"""


def test_plan_has_the_maps_of_all_members(tmp_path):
    """They stay until they are joined: 8 and 24 members of 256 x 256 points took 506 and 930 MB."""
    text = PATH.replace("[32, 32]", "[256, 256]").replace("count = 60", "count = 12")
    text = text.replace('domains = ["box_counts"]', 'keep = ["state", "pressure", "gap"]')
    peaks = []
    for members in (8, 24):
        scene = tmp_path / "study.toml"
        scene.write_text(text.replace("rng = 5", f"rng = 5\nmembers = {members}"), encoding="utf-8")
        peaks.append(fc.scenes.plan(fc.scenes.load(scene)).memory["contact"])
    maps = 12 * 256 * 256 * (1 + 8 + 8)  # bytes of a state, a pressure and a gap
    assert peaks[1] - peaks[0] == 2 * 16 * maps  # those of the members, and joined
    np.testing.assert_allclose(peaks, [506e6, 930e6], rtol=0.15)


class Recorder(Executor):
    """Runs every task at once and keeps the datasets of its result."""

    def __init__(self):
        self.results = []

    def submit(self, function, *arguments):
        future = Future()
        future.set_result(function(*arguments))
        (datasets, _), _ = future.result()
        self.results.append(datasets)
        return future


def test_long_path_is_solved_in_sections_and_keeps_no_map(tmp_path, monkeypatch):
    (tmp_path / "path.toml").write_text(PATH, encoding="utf-8")
    undivided = fc.scenes.run(tmp_path / "path.toml", progress=False)
    monkeypatch.setattr("fractalcontact.scenes._stages.PART_SIZE", 8 * 32 * 32)
    recorder = Recorder()
    parts = fc.scenes.run(tmp_path / "path.toml", progress=False, client=recorder)
    steps = [results[0].sizes["step"] for results in recorder.results if "closure" in results[0]]
    assert len(steps) == 8
    assert max(steps) <= 8
    assert all("y" not in result.dims for results in recorder.results for result in results)
    assert parts["contact"].sizes["step"] == 60
    np.testing.assert_array_equal(parts["contact/step"], np.arange(60))
    for name in ("closure", "contact_fraction"):
        np.testing.assert_allclose(parts["contact"][name], undivided["contact"][name], rtol=1e-3)
    assert parts["domains/box_counts/box_count"].dims == ("step", "box_size")
    np.testing.assert_array_equal(parts["contact/nominal_pressure"], undivided["contact/nominal_pressure"])


@pytest.mark.slow
def test_workers_of_dask_give_the_same_bytes(ensemble):
    distributed = pytest.importorskip("distributed")
    tree, folder = ensemble
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        there = fc.scenes.run(folder / "study.toml", progress=False, client=client)
    for node in tree.subtree:
        for name, variable in node.to_dataset(inherit=False).variables.items():
            if not str(name).endswith("run_time"):
                assert variable.values.tobytes() == there[node.path][name].values.tobytes(), (node.path, name)


def test_lineage_of_several_shears_is_joined(tmp_path):
    text = SOUND.replace('joints = ["closure", "rigid_dilatancy"]', 'domains = ["lineage"]')
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    lineage = fc.scenes.run(tmp_path / "study.toml", progress=False)["domains/lineage"]
    np.testing.assert_array_equal(np.unique(lineage["link_shear"]), [1e-4, 4e-4])
