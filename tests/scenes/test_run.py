"""A scene run from end to end: only the wanted results, one valid file, resumed where it stopped."""

import functools
import pickle
from concurrent.futures import Executor, Future

import numpy as np
import pytest
import xarray as xr
from study import SOUND, command_here, watch_calls

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.file_contents import file_contents

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


def test_file_has_the_wanted_groups(study):
    tree, out = study
    assert set(tree.children) == {"surfaces", "dimensions", "joints", "domains"}
    with xr.open_datatree(out / "result.nc") as found:
        assert set(found.children) == set(tree.children)
        plain = found["joints/closure"].to_dataset().load()
    closing = tree["joints/closure"].to_dataset()
    xr.testing.assert_identical(plain, closing.drop_indexes("normal_force"))  # files hold no such index
    xr.testing.assert_identical(fc.open(out / "result.nc")["joints/closure"].to_dataset(), closing)
    assert (out / "result.nc").is_file()
    assert not (out / ".stages").exists()
    assert list(out.glob("*.png"))
    assert not list(out.glob(".*"))


def test_result_is_complete_before_the_figures(study, tmp_path, monkeypatch):
    tree, out = study
    for error, raised in (
        (KeyboardInterrupt(), KeyboardInterrupt),
        (OSError(28, "No space left on device"), InvalidInput),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(fc.plotting, "draw", lambda *a, error=error, **k: (_ for _ in ()).throw(error))
            with pytest.raises(raised) as caught:
                fc.scenes.run(out.parent / "study.toml", out=tmp_path, progress=False)
        assert (tmp_path / "result.nc").is_file()
    assert "result.nc, which is complete" in str(caught.value)
    assert "No space left" in str(caught.value)
    saved = fc.open(tmp_path / "result.nc")
    for name in ("joints/closure", "domains/lacunarity", "surfaces"):
        assert set(saved[name].variables) == set(tree[name].variables)
    np.testing.assert_array_equal(saved["joints/closure/closure"], tree["joints/closure/closure"])
    calls = []
    watch_calls(monkeypatch, calls.append)
    again = fc.scenes.run(out.parent / "study.toml", out=tmp_path, progress=False)
    # the parts of the first run are still there; the report computes the friction by the other form
    assert [name for name in calls if name != "describe"] == ["friction"]
    assert list(tmp_path.glob("*.png"))
    assert fc.open(tmp_path / "result.nc").attrs["provenance"] == again.attrs["provenance"]
    assert '"figures": {"run_time"' in again.attrs["provenance"]


def test_dilatancy_takes_what_the_closure_has_pressed(study):
    tree, _ = study
    closing, opening = tree["joints/closure"], tree["joints/elastic_dilatancy"]
    shear = np.intersect1d(closing["shear"], opening["shear"])
    held = closing["interface_closure"].sel(shear=shear)
    forces = closing["normal_force"].values
    found = opening["interface_closure"].sel(direction=str(closing["direction"].values), shear=shear)
    steps = [int(np.flatnonzero(forces == force)[0]) for force in opening["normal_force"].values]
    assert shear.size
    np.testing.assert_array_equal(found, held.isel(step=steps))  # to the last bit: not pressed twice


def test_every_group_passes_the_cf_checker(study, compliance, tmp_path):
    tree, _ = study
    for number, node in enumerate(tree.subtree):
        if node.has_data:
            path = tmp_path / f"{number}.nc"
            node.to_dataset(inherit=False).to_netcdf(path)
            assert compliance(path) == [], node.path


def test_results_equal_those_of_the_public_functions(study):
    tree, _ = study
    face = fc.surfaces.fbm((48, 48), 1e-4, hurst=0.8, rms_increment=4e-6, rng=5)
    np.testing.assert_array_equal(tree["surfaces/height"], face)
    crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=2.4e-3)
    closure = fc.joints.closure(
        crack, shear=[1e-4, 4e-4], direction="W", normal_force=[1.0, 10.0], keep=("state",)
    )
    for name in ("closure", "interface_closure", "contact_fraction", "state"):
        np.testing.assert_array_equal(tree["joints/closure"][name], closure[name])


def test_provenance_has_run_time_and_error_of_every_stage(study):
    import json

    record = json.loads(study[0].attrs["provenance"])["stages"]
    assert {"surfaces", "dimensions", "joints/closure", "domains/box_dimension"} <= set(record)
    assert all(entry["run_time"] >= 0 for entry in record.values())
    assert record["joints/closure"]["residual"] <= 1e-8


def test_map_read_only_by_other_stages_is_not_stored(tmp_path):
    text = SOUND.replace('["closure", "rigid_dilatancy"]', '["closure"]\ndomains = ["box_dimension"]')
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    tree = fc.scenes.run(tmp_path / "study.toml", progress=False)
    assert "state" not in tree["joints/closure"]
    assert "box_dimension" in tree["domains/box_dimension"]
    assert "surfaces" not in tree.children


def test_info_names_the_calls_that_made_a_surface(tmp_path):
    path = fc.save(fc.surfaces.sample("concrete_crack")[:8, :8], tmp_path / "face.nc")
    last = file_contents(path).splitlines()[-1]
    assert last.startswith("call fractalcontact.surfaces.sample")
    assert last.endswith(", after fractalcontact.surfaces.from_array")


def test_failed_run_resumes_from_kept_stages(tmp_path, monkeypatch):
    text = SOUND.replace('"rigid_dilatancy"]', '"friction"]\ndomains = ["lacunarity"]')
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    uninterrupted = fc.scenes.run(tmp_path / "study.toml", progress=False)

    def fail_in_friction(name):
        if name == "friction":
            raise RuntimeError("power failure")

    with monkeypatch.context() as patch:
        watch_calls(patch, fail_in_friction)
        with pytest.raises(RuntimeError):
            fc.scenes.run(tmp_path / "study.toml", out=tmp_path / "out", progress=False)
    assert not (tmp_path / "out" / "result.nc").exists()
    part_names = sorted(path.name for path in (tmp_path / "out" / ".stages").iterdir())
    assert sum(name.startswith("joints.closure") for name in part_names) == 2

    calls = []
    watch_calls(monkeypatch, calls.append)
    resumed = fc.scenes.run(tmp_path / "study.toml", out=tmp_path / "out", progress=False)
    assert calls == ["friction"]
    for path in ("joints/closure", "domains/lacunarity"):
        ours, theirs = resumed[path].to_dataset(), uninterrupted[path].to_dataset()
        xr.testing.assert_identical(
            ours.drop_vars("run_time", errors="ignore").drop_attrs(deep=False),
            theirs.drop_vars("run_time", errors="ignore").drop_attrs(deep=False),
        )
    assert not (tmp_path / "out" / ".stages").exists()


@pytest.mark.parametrize(
    ("old", "new", "recomputed"),
    [
        ("young = 30e9", "young = 60e9", {"closure", "dilatancy"}),
        ("[want]", "[want]", set()),
        ("rng = 5", "rng = 6", {"closure", "dilatancy"}),
        ("normal_force = [1.0, 10.0]", "normal_force = [1.0, 20.0]", {"closure"}),
    ],
)
def test_kept_stages_of_a_changed_scene_are_not_used(tmp_path, monkeypatch, old, new, recomputed):
    text = SOUND.replace('"rigid_dilatancy"]', '"rigid_dilatancy", "friction"]')
    path, calls = tmp_path / "study.toml", []
    path.write_text(text, encoding="utf-8")

    def fail_in_friction(name):
        calls.append(name)
        if name == "friction":
            raise RuntimeError("power failure")

    watch_calls(monkeypatch, fail_in_friction)
    for scene in (text, text.replace(old, new)):
        path.write_text(scene, encoding="utf-8")
        calls.clear()
        with pytest.raises(RuntimeError):
            fc.scenes.run(path, out=tmp_path / "out", progress=False)
    assert set(calls) & {"closure", "dilatancy"} == recomputed


def test_info_states_the_unit_of_an_error(tmp_path):
    surface = fc.surfaces.fbm((48, 48), 1e-4, hurst=0.7, rms_increment=1e-5, rng=1)
    placed = fc.joints.register(surface, surface + 1e-3)
    text = file_contents(fc.save(placed, tmp_path / "placed.nc"))
    assert f"shift x error: {float(placed.shift_x_error):.3g} m\n" in text
    assert f"rotation error: {float(placed.rotation_error):.3g} degree\n" in text


def test_summary_and_info_print_the_main_results(study, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")  # no head of a table is broken
    tree, out = study
    text = fc.scenes.summary(tree, verbose=True)
    for word in (
        "fractal dimension",
        "interface closure",
        "rigid dilatancy",
        "box D (random)",
        "joints/closure",
    ):
        assert word in text
    done = command_here("info", out / "result.nc")
    assert done.returncode == 0
    for word in ("/joints/closure", "interface_closure", "[m]", "residual", "run time"):
        assert word in done.stdout
    (tmp_path / "broken.nc").write_text("no")
    assert command_here("info", tmp_path / "broken.nc").returncode == 2


def test_command_lists_methods():
    done = command_here("methods")
    assert done.returncode == 0
    for name in ("spectrum", "variogram", "cube_counts"):
        assert name in done.stdout


def test_parts_run_on_an_executor(tmp_path):
    class Cluster(Executor):
        """Tasks go and come as bytes, as on a cluster."""

        sent = 0

        def submit(self, function, *arguments):
            self.sent += 1
            function, arguments = pickle.loads(pickle.dumps((function, arguments)))
            future = Future()
            future.set_result(pickle.loads(pickle.dumps(function(*arguments))))
            return future

    (tmp_path / "study.toml").write_text(SOUND, encoding="utf-8")
    serial = fc.scenes.run(tmp_path / "study.toml", progress=False)
    cluster = Cluster()
    shared = fc.scenes.run(tmp_path / "study.toml", progress=False, client=cluster)
    assert cluster.sent == 3  # both shears of the closure, and beside them the rigid dilatancy
    for name in ("closure", "contact_fraction", "normal_force"):
        np.testing.assert_array_equal(serial["joints/closure"][name], shared["joints/closure"][name])


@pytest.mark.parametrize("folder", ["out", None])
def test_summary_is_printed_on_request_and_computed_once(tmp_path, capsys, monkeypatch, folder):
    """A caveat of a scan, which all forms of the summary have, compares it with the scan without spikes."""
    computed, despike = [], fc.surfaces.despike
    monkeypatch.setattr(fc.surfaces, "despike", lambda scan: computed.append(scan) or despike(scan))
    generated = SOUND.partition("[surface]")[2].partition("[material]")[0]
    options = {"hurst": 0.8, "rms_increment": 4e-6, "rng": 5}
    fc.save(fc.surfaces.fbm((48, 48), 1e-4, **options), tmp_path / "scan.nc")
    scene = SOUND.replace(generated, '\nread = "scan.nc"\n') + 'surfaces = ["height"]\n'
    (tmp_path / "study.toml").write_text(scene, encoding="utf-8")
    out = None if folder is None else tmp_path / folder
    tree = fc.scenes.run(tmp_path / "study.toml", out=out, progress=False, summary=True)
    assert len(computed) == 1
    assert capsys.readouterr().out.strip() == fc.scenes.summary(tree)
    if out is not None:
        last = tree["joints/closure/closure"].isel(shear=-1, step=-1)
        assert f"{float(last) * 1e6:.3g} µm" in (out / "report.html").read_text(encoding="utf-8")


def test_azimuths_rigid_strength_and_stiffness_from_a_scene(tmp_path):
    path = tmp_path / "azimuths.toml"
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


def test_a_file_is_read_once(tmp_path, monkeypatch):
    lower = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1)
    fc.save(lower, tmp_path / "lower.nc")
    fc.save(lower + 1e-5, tmp_path / "upper.nc")
    text = (
        '[surface]\nread = "lower.nc"\n[upper]\nread = "upper.nc"\n[joint]\nblock = 1.6e-3\n'
        'shear = [0.0, 1e-4]\n[want]\nsurfaces = ["height", "describe"]\njoints = ["rigid_dilatancy"]\n'
    )
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    files, read = [], fc.surfaces.read
    monkeypatch.setattr(
        fc.surfaces, "read", lambda path, **more: files.append(path.name) or read(path, **more)
    )
    tree = fc.scenes.run(tmp_path / "study.toml", progress=False)
    assert files == ["lower.nc", "upper.nc"]
    np.testing.assert_array_equal(tree["surfaces/height"], lower)


@pytest.mark.parametrize(("table", "taken"), [("", True), ("[domains.evolution]\nconnectivity = 2\n", False)])
def test_evolution_takes_the_signature_if_the_options_are_alike(table, taken, tmp_path, monkeypatch):
    text = f"""[surface]
generate = "fbm"
shape = [48, 48]
spacing = 1e-4
hurst = 0.8
rms_increment = 2e-6
rng = 1
[material]
young = 3e10
poisson = 0.2
[joint]
block = 3.2e-3
shear = [1e-4, 2e-4]
normal_force = [10.0, 100.0]
{table}[want]
joints = ["closure"]
domains = ["signature", "evolution"]
keep = ["state"]
"""
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    signatures = []

    @functools.wraps(fc.domains.evolution)
    def recorded(mask, *, signature=None, **options):
        signatures.append(signature)
        return recorded.__wrapped__(mask, signature=signature, **options)

    monkeypatch.setattr(fc.domains, "evolution", recorded)
    tree = fc.scenes.run(tmp_path / "study.toml", progress=False)
    monkeypatch.undo()
    assert [each is not None for each in signatures] == [taken]
    state, options = tree["joints/closure/state"], {} if taken else {"connectivity": 2}
    alone, stored = fc.domains.evolution(state, **options), tree["domains/evolution"].to_dataset()
    for name in alone.data_vars.keys() - {"run_time"}:
        np.testing.assert_array_equal(stored[name], alone[name])
