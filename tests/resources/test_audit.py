"""A scene takes what its wanted words require: libraries, kernels, stages and variables, word by word."""

import json
import pickle
import subprocess
import sys
from pathlib import Path

import pytest
from resources import audit as resources
from study import SOUND

import fractalcontact as fc
from fractalcontact.base.errors import FractalContactError

TEMPLATE = (
    SOUND.partition("[want]")[0]
    .replace("shear = [", "shear = [0.0, ")
    .replace("poisson = 0.2", "poisson = 0.2\nbasic_friction_angle = 30.0")
    + """
[contact]
nominal_pressure = [1e5, 1e6]
[contact.partial_slip]
normal_force = 1.0
tangential_force = [0.1, 0.2]
[joint.partial_slip]
normal_force = 1.0
tangential_force = [0.1, 0.2]
[joint.closure_laws]
seating_pressure = 1e3
[joint.direct_shear]
hardness = 1e8
nominal_pressure = [1e6]
path = 4e-4
[joint.shear_curve]
displacement = [0.0, 1e-4, 4e-4]
nominal_pressure = [1e6]
wall_strength = 1e8
[joint.strength_envelope]
nominal_pressure = [1e6, 2e6]
wall_strength = 1e8
[joint.elimination]
block = 1.2e-3
[joint.self_weight]
shear = [1e-4]
structure_size = [1.0, 10.0]
unit_weight = 24e3
[joint.uplift]
upstream_pressure = 1e4
[domains.generalised_dimensions]
q = [0.0, 2.0]
[want]
SUBPACKAGE = ["WORD"]
"""
)
WANT = fc.scenes.json_schema()["properties"]["want"]["properties"]  # made from the table of stages
WORDS = {
    f"{subpackage}/{word}": TEMPLATE.replace("SUBPACKAGE", subpackage).replace("WORD", word)
    for subpackage in ("surfaces", "dimensions", "contact", "joints", "domains")
    for word in WANT[subpackage]["anyOf"][0]["enum"]
}


def scene(folder, text):
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return fc.scenes.load(folder / "study.toml")


@pytest.mark.parametrize("word", list(WORDS))
def test_wanted_result_plans_only_the_required_stages(tmp_path, word):
    study = scene(tmp_path, WORDS[word])
    named = "dimensions" if word.startswith("dimensions/") else resources.NAMED.get(word, word)
    planned = {stage.name: stage.reason for stage in fc.scenes.plan(study)}
    assert {"surfaces", named} <= planned.keys() == resources.required_stages(study)
    reasons = {reason for stage, reason in planned.items() if stage not in ("surfaces", named)}
    assert reasons <= {f"{named.partition('/')[2]} needs it"}


def test_every_estimator_has_its_requirements():
    assert {f"dimensions/{name}" for name in fc.dimensions.methods()} <= set(resources.REQUIREMENTS)


CHAIN = """
import gc, importlib, json, pickle, sys
sys.path.insert(0, sys.argv[1])
import probe
from fractalcontact.base.process import block_dask_import
block_dask_import()
from fractalcontact import scenes

def reset_kernels():
    "Let every kernel be taken from the cache again when it is called next."
    dispatcher = getattr(sys.modules.get("numba.core.dispatcher"), "Dispatcher", ())
    for item in gc.get_objects():
        if isinstance(item, dispatcher) and item.overloads:
            item._reset_overloads()

report = {}
for word, (scene, libraries) in pickle.loads(sys.stdin.buffer.read()):
    for name in libraries:
        importlib.import_module(name)
    before = set(probe.libraries())
    reset_kernels()
    scenes.run(scene, progress=False)
    report[word] = {"libraries": sorted(set(probe.libraries()) - before), "kernels": probe.kernels()}
print(json.dumps(report))
"""


def test_no_wanted_result_loads_or_compiles_more_than_required(tmp_path):
    """Every fifth word; the slow test below has all of them."""
    studies = {word: scene(tmp_path, WORDS[word]) for word in list(WORDS)[::5]}
    required = {word: resources.requirements(study) for word, study in studies.items()}
    # from the word that requires least to the one that requires most: what is loaded stays loaded
    order = sorted(studies, key=lambda word: (len(required[word].libraries), len(required[word].kernels)))
    task = pickle.dumps([(word, (studies[word], required[word].libraries)) for word in order])
    chain = [sys.executable, "-c", CHAIN, str(Path(resources.__file__).parent)]
    done = subprocess.run(chain, input=task, capture_output=True)
    assert done.returncode == 0, done.stderr.decode()[-2000:]
    wrong = {}
    for word, report in json.loads(done.stdout).items():
        limits = resources.kernel_limits(required[word])
        subpackages = [name.partition(".")[0] for name in report["kernels"]]
        problems = [
            *report["libraries"],
            *(name for name, (forms, _) in report["kernels"].items() if forms != 1),
            *(name for name in set(subpackages) if subpackages.count(name) > limits.get(name, 0)),
            *(f"{name}: no kernel" for name in limits if name not in subpackages),
        ]
        if problems:
            wrong[word] = (problems, report)
    assert wrong == {}


@pytest.mark.slow
@pytest.mark.parametrize("word", list(WORDS))
def test_wanted_result_uses_only_the_required_resources(tmp_path, word):
    study = scene(tmp_path, WORDS[word])
    measured = resources.audit(study)
    assert resources.surplus(measured) == []
    assert measured["warm_kernel_count"] == 0
    assert measured["repeated_size"] < 1000  # the load and the shear, which every group states for itself


def test_command_reports_the_resources_of_a_scene(tmp_path, capsys):
    scene(tmp_path, WORDS["surfaces/describe"])
    assert resources.main([str(tmp_path / "study.toml"), "-o", str(tmp_path / "out")]) == 0
    assert "resources.nc" in capsys.readouterr().out
    measured = fc.open(tmp_path / "out" / "resources.nc")["study"].to_dataset()
    assert measured["kernel"].size == measured["kernel_count"] == measured["warm_kernel_count"] == 0
    assert measured["stage"].values.tolist() == ["surfaces", "surfaces/description"]
    assert measured["library_count"] == measured["required_library_count"] == measured["library"].size
    assert measured["surface_memory"] == 8 * 48**2
    assert measured["surface_memory"] < measured["array_memory"]
    assert measured["memory"] > measured["required_memory"] > 1e7
    assert resources.surplus(measured) == []
    assert "not required" not in resources.table({"study": measured})
    measured["library_required"][0] = False
    assert f"not required: {measured['library'].values[0]}" in resources.table({"study": measured})


def test_scene_that_fails_is_reported(tmp_path):
    surface = {"generate": "fbm", "shape": [8, 8], "spacing": 1.0}
    with pytest.raises(FractalContactError, match="did not run"):
        resources.audit(fc.scenes.Scene("wrong", {"surface": surface}, tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rigid_sliding", "pressed_surface", "jacksboro_fault", "concrete_crack"])
def test_shipped_scene_uses_only_the_required_resources(name):
    measured = resources.audit(name)
    assert resources.surplus(measured) == []
    assert measured["warm_kernel_count"] == 0
    assert measured["file_size"] < 2 * measured["result_size"] + 200_000 * (measured["stage"].size + 1)
    print(resources.table({name: measured}))


@pytest.mark.benchmark
def test_solver_compiles_in_five_seconds(tmp_path):
    assert resources.audit(scene(tmp_path, WORDS["joints/closure"]))["compile_time"] < 5.0
