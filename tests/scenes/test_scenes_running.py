"""Scenes carried out: only what is asked, one clean file, resumed where it stopped."""

import subprocess
import sys

import numpy as np
import pytest
import xarray as xr
from study import SOUND, command

import fractalcontact as fc
from fractalcontact.scenes import keeping, stages, studying

WHOLE = SOUND.replace(
    'joints = ["closure", "rigid_dilatancy"]',
    'surfaces = ["height", "describe"]\n'
    'dimensions = ["default", "spectrum", "variogram", "cube_counts"]\n'
    'joints = ["closure", "rigid_dilatancy", "elastic_dilatancy", "friction"]\n'
    'domains = ["box_dimension", "lacunarity"]\nkeep = ["state"]\nfigures = true\n',
)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    (folder / "study.toml").write_text(WHOLE, encoding="utf-8")
    tree = fc.scenes.run(folder / "study.toml", out=folder / "out", progress=False)
    return tree, folder / "out"


def test_the_groups_are_those_asked_for(study):
    tree, out = study
    assert set(tree.children) == {"surfaces", "dimensions", "joints", "domains"}
    with xr.open_datatree(out / "result.nc") as found:
        assert set(found.children) == set(tree.children)
        xr.testing.assert_identical(
            found["joints/closure"].to_dataset().load(), tree["joints/closure"].to_dataset()
        )
    assert (out / "result.nc").is_file()
    assert not (out / ".stages").exists()
    assert list(out.glob("*.png"))
    assert not list(out.glob(".*"))


def test_every_group_alone_is_clean(study, compliance, tmp_path):
    tree, _ = study
    for number, node in enumerate(tree.subtree):
        if node.has_data:
            path = tmp_path / f"{number}.nc"
            node.to_dataset(inherit=False).to_netcdf(path)
            assert compliance(path) == [], node.path


def test_the_results_are_those_of_the_rooms(study):
    tree, _ = study
    face = fc.surfaces.fbm((48, 48), 1e-4, hurst=0.8, rms_increment=4e-6, rng=5)
    np.testing.assert_array_equal(tree["surfaces/height"], face)
    crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=2.4e-3)
    closure = fc.joints.closure(
        crack, shear=[1e-4, 4e-4], direction="W", normal_force=[1.0, 10.0], keep=("state",)
    )
    for name in ("closure", "interface_closure", "contact_fraction", "state"):
        np.testing.assert_array_equal(tree["joints/closure"][name], closure[name])


def test_the_record_tells_time_and_error_of_every_stage(study):
    import json

    record = json.loads(study[0].attrs["provenance"])["stages"]
    assert {"surfaces", "dimensions", "joints/closure", "domains/box_dimension"} <= set(record)
    assert all(entry["run_time"] >= 0 for entry in record.values())
    assert record["joints/closure"]["residual"] <= 1e-8


def test_a_map_that_only_the_domains_read_is_not_stored(tmp_path):
    text = SOUND.replace('["closure", "rigid_dilatancy"]', '["closure"]\ndomains = ["box_dimension"]')
    (tmp_path / "lean.toml").write_text(text, encoding="utf-8")
    tree = fc.scenes.run(tmp_path / "lean.toml", progress=False)
    assert "state" not in tree["joints/closure"]
    assert "box_dimension" in tree["domains/box_dimension"]
    assert "surfaces" not in tree.children


def test_rigid_sliding_runs_no_solver_and_imports_no_compiler(tmp_path):
    heavy = ("numba", "matplotlib", "skimage", "fractalcontact.contact", "fractalcontact.plotting")
    code = (
        "import sys; from fractalcontact.cli import main\n"
        "assert main(['run', 'rigid_sliding', '-o', sys.argv[1], '--quiet']) == 0\n"
        f"print([m for m in {heavy!r} if m in sys.modules])"
    )
    words = [sys.executable, "-c", code, str(tmp_path)]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_failed_run_goes_on_from_its_kept_stages(tmp_path, monkeypatch):
    text = SOUND.replace('"rigid_dilatancy"]', '"friction"]\ndomains = ["lacunarity"]')
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    whole = fc.scenes.run(tmp_path / "study.toml", progress=False)

    def broken(*_):
        raise RuntimeError("the lights went out")

    original, last = stages._call, "friction"
    with monkeypatch.context() as patch:
        patch.setattr(stages, "_call", lambda *a, **k: broken() if a[1] == last else original(*a, **k))
        with pytest.raises(RuntimeError):
            fc.scenes.run(tmp_path / "study.toml", out=tmp_path / "out", progress=False)
    assert not (tmp_path / "out" / "result.nc").exists()
    kept = sorted(path.name for path in (tmp_path / "out" / ".stages").iterdir())
    assert sum(name.startswith("joints.closure") for name in kept) == 2

    calls = []
    monkeypatch.setattr(stages, "_call", lambda *a, **k: calls.append(a[1]) or original(*a, **k))
    resumed = fc.scenes.run(tmp_path / "study.toml", out=tmp_path / "out", progress=False)
    assert calls == [last]
    for path in ("joints/closure", "domains/lacunarity"):
        ours, theirs = resumed[path].to_dataset(), whole[path].to_dataset()
        xr.testing.assert_identical(
            ours.drop_vars("run_time", errors="ignore").drop_attrs(deep=False),
            theirs.drop_vars("run_time", errors="ignore").drop_attrs(deep=False),
        )
    assert not (tmp_path / "out" / ".stages").exists()


def test_a_changed_scene_does_not_take_stages_of_another(tmp_path):
    first, second = SOUND, SOUND.replace("young = 30e9", "young = 60e9")
    keys = []
    for text in (first, second, first):
        (tmp_path / "study.toml").write_text(text, encoding="utf-8")
        scene = fc.scenes.load(tmp_path / "study.toml")
        keys.append(studying.Study(scene, keeping.Store(None), False, None).digests)
    assert keys[0] == keys[2]
    assert keys[0]["joints/closure"] != keys[1]["joints/closure"]
    assert keys[0]["surfaces"] == keys[1]["surfaces"]


def test_summary_and_info_print_the_main_figures(study, tmp_path):
    from fractalcontact.scenes.reporting import summary

    tree, out = study
    text = summary(tree)
    for word in (
        "fractal dimension",
        "closure at shear",
        "rigid dilatancy",
        "contact domain",
        "joints/closure",
    ):
        assert word in text
    done = command("info", out / "result.nc")
    assert done.returncode == 0
    for word in ("/joints/closure", "interface_closure", "[m]", "residual", "seconds"):
        assert word in done.stdout
    (tmp_path / "broken.nc").write_text("no")
    assert command("info", tmp_path / "broken.nc").returncode == 2


def test_methods_are_listed():
    done = command("methods")
    assert done.returncode == 0
    for name in ("spectrum", "variogram", "cube_counts"):
        assert name in done.stdout


def test_parts_can_run_elsewhere(tmp_path):
    import pickle
    from concurrent.futures import Future

    class Worker:
        """Takes tasks as a cluster does: as bytes."""

        sent = 0

        def submit(self):
            """Stand for what tells a client."""

        def map(self, function, tasks, pure):
            futures = []
            for task in tasks:
                Worker.sent += 1
                futures.append(Future())
                futures[-1].set_result(pickle.loads(pickle.dumps(function))(pickle.loads(pickle.dumps(task))))
            return futures

    (tmp_path / "study.toml").write_text(SOUND, encoding="utf-8")
    here = fc.scenes.run(tmp_path / "study.toml", progress=False)
    there = fc.scenes.run(tmp_path / "study.toml", progress=False, client=Worker())
    assert Worker.sent == 2
    for name in ("closure", "contact_fraction", "normal_force"):
        np.testing.assert_array_equal(here["joints/closure"][name], there["joints/closure"][name])


def test_azimuths_strengths_of_rigid_faces_and_springs_from_a_scene(tmp_path):
    path = tmp_path / "turned.toml"
    path.write_text(
        """
[surface]
generate = "fbm"
shape = [48, 48]
spacing = 1e-4
hurst = 0.8
rms_increment = 1e-6
rng = 1
[material]
young = 30e9
poisson = 0.2
[joint]
block = 2e-3
direction = 30
nominal_pressure = [1e6, 2e6]
shear = [1e-4, 4e-4]
[joint.rigid_dilatancy]
direction = ["NE", 200]
[joint.friction]
nominal_pressure = [1e6, 3e6]
[want]
joints = ["closure", "rigid_dilatancy", "friction"]
"""
    )
    tree = fc.scenes.run(fc.scenes.load(path), out=None, progress=False)
    assert tree["joints/closure"].azimuth == 30
    assert list(tree["joints/rigid_dilatancy"].direction.values) == ["NE", "200"]
    assert tree["joints/friction"].shear_strength.dims == ("direction", "shear", "step")
    text = path.read_text().replace("[joint.friction]\nnominal_pressure = [1e6, 3e6]\n", "")
    text = text.replace(
        "[joint.rigid_dilatancy]\n",
        "[joint.elastic_dilatancy]\nnormal_force = 1.0\nnormal_stiffness = 1e11\n",
    )
    path.write_text(text.replace('"rigid_dilatancy"', '"elastic_dilatancy"'))
    tree = fc.scenes.run(fc.scenes.load(path), out=None, progress=False)
    assert tree["joints/elastic_dilatancy"].normal_force.dims == ("direction", "shear", "step")
    assert np.isfinite(tree["joints/friction"].friction_angle).all()
