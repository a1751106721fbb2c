"""Every stored group is made again from its own provenance, bit for bit but for the run times."""

import json
import signal

import numpy as np
import pytest
from study import watch_calls

import fractalcontact as fc
from fractalcontact.base.errors import FractalContactWarning, InvalidInput
from fractalcontact.base.signals import Stopped
from fractalcontact.base.study import provenance_of

STUDY = """
[surface]
generate = "fbm"
shape = [32, 32]
spacing = 1e-4
hurst = 0.8
rms_increment = 4e-6
rng = 5
level = 1
[material]
young = 30e9
poisson = 0.2
[contact]
normal_force = [1.0, 2.0, 4.0, 3.0]
[joint]
block = 2.0e-3
shear = [0.0, 1e-4, 3e-4]
normal_force = [1.0, 10.0]
[joint.elastic_dilatancy]
direction = ["E", "W"]
[joint.elimination]
block = 1.2e-3
[joint.area_by_resolution]
factors = [1, 2]
[joint.self_weight]
shear = [1e-4, 3e-4]
structure_size = [1.0, 10.0]
unit_weight = 24e3
[want]
surfaces = ["height", "describe"]
dimensions = ["likelihood", "variogram"]
contact = ["press"]
joints = [
    "delta_surface", "closure", "rigid_dilatancy", "elastic_dilatancy", "friction", "decorrelation_length",
    "transmissivity", "elimination", "area_by_resolution", "self_weight",
]
domains = [
    "box_dimension", "box_counts", "boundary_dimension", "lacunarity", "islands", "percolation", "evolution",
    "signature",
]
"""
JOINTS = STUDY.partition("joints = [")[2].partition("]")[0]
ESTIMATES = 'dimensions = ["likelihood", "variogram"]\n'
# what the sections of a path change: results along it
PATH = STUDY.replace(JOINTS, '"closure", "friction"').replace(ESTIMATES, "")
DOMAINS_OF_A_JOINT = PATH.replace('contact = ["press"]', 'keep = ["state"]')
ENSEMBLE = (
    STUDY.replace('contact = ["press"]', 'keep = ["state"]')
    .replace('"elimination", "area_by_resolution", "self_weight",', "")
    .replace("rng = 5", "rng = 5\nmembers = 2")
    .replace('"box_counts", "boundary_dimension", "lacunarity", ', "")
)


def write(folder, text):
    path = folder / "study.toml"
    path.write_text(text, encoding="utf-8")
    return path


def stored_groups(tree):
    return [node for node in tree.subtree if node.data_vars and node is not tree]  # the root repeats them


def check_equal(stored, made):
    """Check all stored variables and coordinates for equal dims, types and bytes."""
    stored = stored.to_dataset() if hasattr(stored, "to_dataset") else stored
    assert set(stored.variables) == set(made.variables)
    for name, variable in stored.variables.items():
        if name != "run_time":
            again = made[name]
            assert variable.dims == again.dims, name
            assert (
                np.asarray(variable.values).tobytes()
                == np.asarray(again.values.astype(variable.dtype)).tobytes()
            ), name


def stored_study(folder, text):
    fc.scenes.run(write(folder, text), out=folder, progress=False)
    return fc.open(folder / "result.nc")


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return stored_study(tmp_path_factory.mktemp("study"), STUDY)


def check_all(tree):
    for group in stored_groups(tree):
        check_equal(group, fc.scenes.reproduce(group))


def test_every_group_is_made_again(study):
    assert len(stored_groups(study)) > 20
    check_all(study)


def test_results_of_a_path_in_sections_are_made_again(tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr("fractalcontact.scenes._stages.PART_SIZE", 32 * 32)
        tree = stored_study(tmp_path, PATH)
    check_all(tree)


def test_domains_of_a_joint_are_made_again(tmp_path):
    tree = stored_study(tmp_path, DOMAINS_OF_A_JOINT)
    assert len(tree["domains"].children) == 8
    check_all(tree)


def test_joined_group_states_the_whole_call_and_the_worst_residual(study):
    closure, dilatancy = study["joints/closure"], study["joints/elastic_dilatancy"]
    entry = provenance_of(closure)
    assert entry["call"] == "fractalcontact.joints.closure"
    assert entry["parameters"]["shear"] == [0.0, 1e-4, 3e-4]
    assert entry["parameters"]["normal_force"] == [1.0, 10.0]
    assert entry["achieved_residual"] == float(closure["residual"].max())
    assert entry["run_time"] >= float(closure["run_time"].sum())
    entry = provenance_of(dilatancy)
    assert entry["parameters"]["direction"] == ["E", "W"]
    assert entry["parameters"]["shear"] == [0.0, 1e-4, 3e-4]
    assert entry["achieved_residual"] == float(dilatancy["residual"].max())
    gap = provenance_of(study["joints/transmissivity"])["parameters"]["gap"]
    assert gap["dims"] == {"shear": 3, "step": 2, "y": 20, "x": 20}
    assert gap["provenance"]["parameters"]["shear"] == [0.0, 1e-4, 3e-4]
    assert "gap" in gap["provenance"]["parameters"]["keep"]
    assert "gap" not in provenance_of(closure)["parameters"]["keep"]


def test_ensemble_member_is_made_again(tmp_path):
    tree = fc.scenes.run(write(tmp_path, ENSEMBLE), progress=False)
    groups = stored_groups(tree)
    assert len(groups) > 8
    for group in groups:
        assert "random" in group.attrs["provenance"]
        made = fc.scenes.reproduce(group, member=1)
        stored = group.to_dataset()
        rows = {dim: stored[f"{dim}_member"] == 1 for dim in ("island", "link") if dim in stored.dims}
        stored = stored.isel(member=1).drop_vars([name for name in stored.variables if "member" in name])
        check_equal(stored.isel({dim: np.flatnonzero(row) for dim, row in rows.items()}), made)
    with pytest.raises(InvalidInput, match="<= 1, got 2"):
        fc.scenes.reproduce(groups[0], member=2)
    with pytest.raises(InvalidInput, match="member"):
        fc.scenes.reproduce(groups[0])


def test_resumed_study_states_the_whole_call(tmp_path, monkeypatch):
    def stop_at_second_shear(name):
        if name == "closure":
            calls.append(name)
            if len(calls) == 2:
                signal.raise_signal(signal.SIGTERM)

    calls = []
    scene = write(tmp_path, DOMAINS_OF_A_JOINT)
    with monkeypatch.context() as patch:
        watch_calls(patch, stop_at_second_shear)
        with pytest.raises(Stopped):
            fc.scenes.run(scene, out=tmp_path, progress=False)
    partial = fc.open(tmp_path / "partial.nc")
    assert partial["joints/closure"].sizes["shear"] == 2
    tree = fc.scenes.run(scene, out=tmp_path, progress=False)
    # `test_every_group_is_made_again` has the groups that no stop divides
    for group in (partial["joints/closure"], *(tree[path] for path in ("joints/closure", "domains/islands"))):
        check_equal(group, fc.scenes.reproduce(group))
    kept_and_new = provenance_of(tree["joints/closure"])["run_time"]
    assert kept_and_new > json.loads(tree.attrs["provenance"])["stages"]["joints/closure"]["run_time"]


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """A study of two faces in files, prepared and registered, and its folder."""
    folder = tmp_path_factory.mktemp("private")
    heights = fc.surfaces.fbm((72, 72), 1e-4, hurst=0.8, rms_increment=4e-6, rng=3).values
    face, upper = heights[4:68, 4:68].copy(), heights[4:68, 3:67] + 1e-6
    face[9, 9] = np.nan
    np.save(folder / "lower.npy", face)
    np.save(folder / "upper.npy", upper)
    text = """
        [surface]
        read = "lower.npy"
        spacing = 1e-4
        fill = true
        despike = true
        level = 1
        [upper]
        read = "upper.npy"
        spacing = 1e-4
        [material]
        young = 30e9
        poisson = 0.2
        [joint]
        block = 1.2e-3
        shear = [0.0, 2e-4]
        normal_force = 1.0
        register = true
        [want]
        surfaces = ["height"]
        dimensions = ["variogram"]
        joints = ["closure", "rigid_dilatancy"]
    """
    return fc.scenes.run(write(folder, text), progress=False), folder


def test_study_of_files_is_made_again_from_the_same_files_only(measured, tmp_path):
    tree, folder = measured
    for group in stored_groups(tree):
        check_equal(group, fc.scenes.reproduce(group, folder=folder))
    for node in tree.subtree:
        assert "private" not in str(node.attrs)
        assert str(folder.parent) not in str(node.attrs)
    with pytest.raises(InvalidInput, match="'lower.npy' that was read, got no such file"):
        fc.scenes.reproduce(tree["surfaces"], folder=tmp_path)
    np.save(tmp_path / "lower.npy", np.zeros((64, 64)))
    with pytest.raises(InvalidInput, match="SHA-256"):
        fc.scenes.reproduce(tree["surfaces"], folder=tmp_path)


def test_references_name_the_methods_and_no_paper_of_1998_for_heights(measured, study):
    for tree in (measured[0], study):
        for group in stored_groups(tree):
            assert group.attrs["references"], group.path
    heights = measured[0]["surfaces"].attrs["references"]
    assert "FRAMCOS" not in heights
    assert "Rousseeuw" in heights
    assert "Briggs" in heights
    for name in ("box_dimension", "lacunarity"):
        if f"domains/{name}" in study.groups or name in study["domains"].children:
            assert "FRAMCOS" not in study[f"domains/{name}"].attrs["references"]
    assert "FRAMCOS" not in fc.dimensions.cube_counts(fc.surfaces.from_array(np.eye(32), 1.0)).references
    assert "FRAMCOS" in study["joints/closure"].attrs["references"]
    for name in ("joints/closure", "joints/elastic_dilatancy"):
        assert "Polonsky" in study[name].attrs["references"]
    assert "Polonsky" not in study["joints/rigid_dilatancy"].attrs["references"]


@pytest.mark.parametrize(
    ("options", "named", "others"),
    [
        ({}, ["FRAMCOS", "Polonsky", "Yastrebov"], ["Love", "Stanley"]),
        ({"influence": "square"}, ["Love", "Polonsky"], ["FRAMCOS", "Stanley"]),
        ({"influence": "square", "method": "elimination"}, ["FRAMCOS", "Love"], ["Polonsky", "Stanley"]),
    ],
)
def test_references_of_a_contact_are_those_of_its_solver(options, named, others):
    surface = fc.surfaces.from_array(np.random.default_rng(1).normal(size=(8, 8)), 1.0)
    references = fc.contact.press(surface, contact_modulus=1.0, closure=0.5, **options).attrs["references"]
    assert all(name in references for name in named)
    assert not any(name in references for name in others)


def test_periodic_contact_names_no_paper_of_plates():
    surface = fc.surfaces.spectral((8, 8), 1.0, hurst=0.8, rms_height=1.0, rng=1)
    references = fc.contact.press(surface, contact_modulus=1.0, closure=0.5).attrs["references"]
    assert "Stanley" in references
    assert "FRAMCOS" not in references


def test_input_without_provenance_is_named():
    surface = fc.surfaces.from_array(np.eye(8), 1.0)
    with pytest.raises(InvalidInput, match="heights: expected an input .* got an array of shape"):
        fc.scenes.reproduce(fc.surfaces.describe(surface))
    with pytest.raises(InvalidInput, match="surface: expected an input with the provenance"):
        fc.scenes.reproduce(fc.surfaces.describe(surface.drop_attrs()))
    with pytest.raises(InvalidInput, match="result: expected a result with the attribute `provenance`"):
        fc.scenes.reproduce(surface.drop_attrs())


@pytest.mark.parametrize("call", ["os.system", "fractalcontact.save", "fractalcontact.joints.Crack"])
def test_text_of_a_file_calls_only_functions_of_results(call):
    entry = {"call": call, "parameters": {}}
    surface = fc.surfaces.from_array(np.eye(8), 1.0).assign_attrs(provenance=json.dumps(entry))
    with pytest.raises(InvalidInput, match="call: expected a public function"):
        fc.scenes.reproduce(surface)


def test_input_that_comes_out_otherwise_is_told():
    surface = fc.surfaces.fbm((8, 8), 1.0, hurst=0.5, rms_increment=1.0, rng=1)
    described = fc.surfaces.describe(surface + 1.0)
    entry = provenance_of(fc.surfaces.describe(surface))
    entry["parameters"]["surface"]["sha256"] = "0" * 64
    with pytest.warns(FractalContactWarning, match="surface differs"):
        fc.scenes.reproduce(described.assign_attrs(provenance=json.dumps(entry)))


def test_total_of_the_summary_is_the_time_of_the_whole_run(study):
    text = fc.scenes.summary(study, verbose=True)
    lines = {line.split("  ")[0]: line.split("  ") for line in text.splitlines() if line}
    lines = {name: next(cell for cell in cells[1:] if cell) for name, cells in lines.items() if cells[1:]}
    assert float(lines["total"]) >= float(lines["all stages"]) > 0
    assert float(lines["total"]) == pytest.approx(provenance_of(study)["run_time"], abs=0.006)


@pytest.mark.parametrize(("total", "told"), [(1.5, True), (2.5, False)])
def test_stages_that_ran_at_the_same_time_are_told(study, total, told):
    entry = provenance_of(study) | {"run_time": total}
    entry["stages"] = {name: {"run_time": 1.0, "origin": "computed"} for name in ("surfaces", "dimensions")}
    other = study.copy()
    other.attrs["provenance"] = json.dumps(entry)
    text = fc.scenes.summary(other, verbose=True)
    assert ("are each counted in full" in " ".join(text.split())) is told


def test_provenance_of_a_study_has_no_folder(tmp_path):
    surface = fc.surfaces.fbm((16, 16), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1)
    path = fc.save(surface, tmp_path / "scan.nc")
    scene = tmp_path / "study.toml"
    scene.write_text(f'[surface]\nread = "{path}"\n[want]\nsurfaces = ["describe"]\n', encoding="utf-8")
    tree = fc.scenes.run(scene, progress=False)
    assert str(tmp_path) not in tree.attrs["provenance"]
    assert '"scan.nc"' in tree.attrs["provenance"]


def test_command_says_that_memory_does_not_suffice(monkeypatch, capsys):
    from fractalcontact import cli

    def exhausted(*_, **__):
        raise MemoryError("Unable to allocate 298 GiB")

    monkeypatch.setattr(fc.scenes, "validate", exhausted)
    assert cli.main(["run", "rigid_sliding", "--plan"]) == 1
    assert "memory of this machine does not suffice (Unable to allocate 298 GiB)" in capsys.readouterr().err
