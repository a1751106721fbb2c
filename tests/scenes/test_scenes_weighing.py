"""What a scene takes is what it needs: libraries, kernels, stages and variables, word by word."""

import json
import pickle
import subprocess
import sys

import pytest
from study import SOUND, command

import fractalcontact as fc
from fractalcontact.base.errors import FractalContactError
from fractalcontact.scenes import grammar, needing
from fractalcontact.scenes.planning import stages_of
from fractalcontact.scenes.weighing import footprint, lean_table, waste

GIVEN = (
    SOUND.partition("[want]")[0].replace("shear = [", "shear = [0.0, ")
    + """
[contact]
nominal_pressure = [1e5, 1e6]
[domains.generalised_dimensions]
q = [0.0, 2.0]
[want]
ROOM = ["WORD"]
"""
)
WORDS = {
    f"{room}/{word}": GIVEN.replace("ROOM", room).replace("WORD", word)
    for room, words in (
        *((room, words) for room, words in grammar.WANTED.items() if room != "keep"),
        ("dimensions", ("default", *fc.dimensions.methods())),
    )
    for word in words
}
# stages beside the one that a word names; all need the face
ALSO = {
    "joints/friction": {"joints/rigid_dilatancy"},
    "joints/transmissivity": {"joints/closure"},
} | {word: {"joints/closure"} for word in WORDS if word.startswith("domains/")}
NAMED = {
    "surfaces/height": "surfaces",
    "surfaces/describe": "surfaces/description",
    "contact/press": "contact",
}


def scene(folder, text):
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return fc.scenes.load(folder / "study.toml")


@pytest.mark.parametrize("word", list(WORDS))
def test_a_word_alone_is_planned_with_what_it_needs(tmp_path, word):
    study = scene(tmp_path, WORDS[word])
    named = "dimensions" if word.startswith("dimensions/") else NAMED.get(word, word)
    expected = {"surfaces", named} | ALSO.get(word, set())
    assert {stage.name for stage in stages_of(study)} == needing.least_stages(study) == expected


CHAIN = """
import gc, importlib, json, pickle, sys
from fractalcontact.base.memory import leave_dask
leave_dask()
from fractalcontact import scenes
from fractalcontact.scenes import needing, probing

def forgotten():
    "Let every kernel be taken from the cache again when it is called next."
    dispatcher = getattr(sys.modules.get("numba.core.dispatcher"), "Dispatcher", ())
    for one in gc.get_objects():
        if isinstance(one, dispatcher) and one.overloads:
            one._reset_overloads()

found = {}
for word, scene in pickle.loads(sys.stdin.buffer.read()):
    need = needing.least(scene)
    for name in need.libraries:
        importlib.import_module(name)
    libraries = set(probing.libraries())
    forgotten()
    scenes.run(scene, progress=False)
    kernels = dict(probing.kernels())
    files = {name.rpartition(".")[0] for name in kernels}
    found[word] = {
        "libraries": sorted(set(probing.libraries()) - libraries),
        "kernels": sorted(files - set(need.kernels)),
        "idle": sorted(set(need.kernels) - files),
        "forms": [name for name, (forms, _) in kernels.items() if forms != 1],
    }
print(json.dumps(found))
"""


def test_no_word_loads_or_compiles_what_it_does_not_need(tmp_path):
    studies = [(word, scene(tmp_path, text)) for word, text in WORDS.items()]
    studies.sort(key=lambda one: (len(needing.least(one[1]).libraries), len(needing.least(one[1]).kernels)))
    done = subprocess.run([sys.executable, "-c", CHAIN], input=pickle.dumps(studies), capture_output=True)
    assert done.returncode == 0, done.stderr.decode()[-2000:]
    more = {
        word: [name for names in found.values() for name in names]
        for word, found in json.loads(done.stdout).items()
    }
    assert {word: names for word, names in more.items() if names} == {}


@pytest.mark.slow
@pytest.mark.parametrize("word", list(WORDS))
def test_a_word_in_a_process_of_its_own_takes_the_least(tmp_path, word):
    study = scene(tmp_path, WORDS[word])
    found = footprint(study)
    assert waste(found) == []
    assert found["warm_kernel_count"] == 0
    assert found["repeated_size"] < 1000  # the load and the shear, which every group states for itself


def test_the_command_tells_what_a_scene_takes(tmp_path):
    scene(tmp_path, WORDS["surfaces/describe"])
    done = command("accuracy", "--lean", tmp_path / "study.toml", "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    found = fc.open(tmp_path / "out" / "lean.nc")["study"].to_dataset()
    assert found["kernel"].size == found["kernel_count"] == found["warm_kernel_count"] == 0
    assert found["stage"].values.tolist() == ["surfaces", "surfaces/description"]
    assert found["library_count"] == found["least_library_count"] == found["library"].size
    assert found["face_memory"] == 8 * 48**2
    assert found["face_memory"] < found["array_memory"]
    assert found["memory"] > found["least_memory"] > 1e7
    assert waste(found) == []
    assert "not needed" not in lean_table({"study": found})
    found["library_needed"][0] = False
    assert f"not needed: {found['library'].values[0]}" in lean_table({"study": found})


def test_a_scene_that_cannot_be_carried_out_is_told(tmp_path):
    face = {"generate": "fbm", "shape": [8, 8], "spacing": 1.0}
    with pytest.raises(FractalContactError, match="not carried out"):
        footprint(fc.scenes.Scene("wrong", {"surface": face}, tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rigid_sliding", "pressed_face", "jacksboro_fault", "concrete_crack"])
def test_a_shipped_scene_takes_no_library_kernel_or_stage_beyond_the_least(name):
    found = footprint(name)
    assert waste(found) == []
    assert found["warm_kernel_count"] == 0
    assert found["file_size"] < 2 * found["result_size"] + 200_000 * (found["stage"].size + 1)
    print(lean_table({name: found}))


@pytest.mark.benchmark
def test_the_solver_is_compiled_in_five_seconds(tmp_path):
    assert footprint(scene(tmp_path, WORDS["joints/closure"]))["compile_time"] < 5.0
