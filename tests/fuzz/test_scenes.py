"""Damaged scene files through `fractalcontact.scenes.run`: a clear error, or a result and no other file."""

import shutil
import tempfile
from pathlib import Path

import numpy as np
import pytest
from calls import rough
from fuzz_scenes import SCENES, damaged_text, fault_of_scene, toml_of

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput


def fault(source):
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "study"
        folder.mkdir()
        np.save(folder / "scan.npy", rough().values * 1e6)
        found = fault_of_scene(source, folder)
        stray = {path.name for path in folder.iterdir()} - {"out", "scan.npy", "study.toml"}
        stray |= {path.name for path in Path(name).iterdir()} - {"study"}
        shutil.rmtree(folder)
    return found or (f"wrote {stray}" if stray else None)


def check(pick):
    done, source = damaged_text(pick)
    found = fault(source)
    assert found is None, f"{done}: {found}"


def test_damaged_scenes(draw):
    draw(check, times=40)


def refused(name, tmp_path, *replacements, **changes):
    """Return the problems of a scene with some values of tables replaced."""
    tables = {key: dict(value) if isinstance(value, dict) else value for key, value in SCENES[name].items()}
    for table, values in changes.items():
        tables[table] = {**tables[table], **values} if isinstance(values, dict) else values
    np.save(tmp_path / "scan.npy", rough().values * 1e6)
    text = toml_of(tables)
    for old, new in replacements:
        text = text.replace(old, new)
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InvalidInput) as caught:
        fc.scenes.run(tmp_path / "study.toml", progress=False)
    return [line.partition(": expected")[0] for line in caught.value.problems]


@pytest.mark.parametrize(
    ("name", "changes", "named"),
    [
        ("file", {"surface": {"despike": "no"}}, "surface.despike"),
        ("file", {"surface": {"fill": 1}}, "surface.fill"),
        ("two faces", {"joint": {"register": "no"}}, "joint.register"),
        ("roughness", {"surface": {"shape": 1024}}, "surface.shape"),
        ("roughness", {"surface": {"shape": [1024]}}, "surface.shape"),
        ("roughness", {"want": {"dimensions": 5}}, "want.dimensions"),
        ("roughness", {"surface": {"rng": [[1, 2], [3]]}}, "surface: rng"),
        ("roughness", {"surface": {"spacing": 1e-300}}, "surface: spacing"),
        ("contact", {"surface": {"spacing": 5e-324}}, "surface: spacing"),
        ("spectral", {"surface": {"spacing": [1e-4, 1e-120]}}, "surface: spacing"),
        ("spectral", {"surface": {"spacing": 1e100}}, "surface.y.period"),
        ("roughness", {"surface": {"rms_increment": 1e-300}}, "surface: rms_increment"),
        ("roughness", {"surface": {"rms_increment": 1e100}}, "surface"),
        ("file", {"surface": {"read": "x" * 300}}, "surface.read"),
        ("roughness", {"title": 3}, "title"),
        ("roughness", {"": [1, 2]}, ""),
        ("domains", {"contact": {"method": {"a": 1}}}, "contact.method"),
        ("two faces", {"joint": {"normal_force": [1.0, 10.0, [1]]}}, "joint.normal_force"),
        ("file", {"dimensions": {"scales": {"a": 1}}}, "dimensions.scales"),
        ("joint", {"joint": {"block": {"a": 1}}}, "joint.block"),
        ("joint", {"surface": {"shape": [200_000, 200_000]}, "want": {"joints": "rough"}}, "want.joints"),
    ],
)
def test_kept_scene_gives_a_clear_error(tmp_path, name, changes, named):
    assert named in refused(name, tmp_path, **changes)


@pytest.mark.parametrize("name", ["roughness", "contact", "domains", "joint"])
def test_profile_is_no_surface_of_a_scene(tmp_path, name):
    np.save(tmp_path / "profile.npy", rough().values[0])
    tables = SCENES[name] | {"surface": {"read": "profile.npy", "spacing": 1e-4}}
    (tmp_path / "study.toml").write_text(toml_of(tables), encoding="utf-8")
    with pytest.raises(InvalidInput, match="surface: read: expected a surface, got a profile"):
        fc.scenes.run(tmp_path / "study.toml", progress=False)
    assert fc.scenes.plan(fc.scenes.load(tmp_path / "study.toml")).memory == {}


def test_scene_whose_coordinates_fill_the_memory_is_refused(tmp_path):
    (problem,) = refused("roughness", tmp_path, surface={"shape": [10**13, 10**13]})
    assert "memory" in problem


def test_scene_beyond_the_memory_is_planned_and_not_run(tmp_path):
    (problem,) = refused("roughness", tmp_path, surface={"shape": [200_000, 200_000]})
    assert "memory" in problem
    assert max(fc.scenes.plan(fc.scenes.load(tmp_path / "study.toml")).memory.values()) > 200_000**2 * 8


@pytest.mark.parametrize(
    "text",
    [
        "deep = " + "[" * 20 + "]" * 20,
        "deep = " + "[" * 3000 + "]" * 3000,
        "[" + ".".join(["a"] * 3000) + "]",
        "title = " + "9" * 5000,
    ],
)
def test_extreme_toml_is_refused(tmp_path, text):
    (tmp_path / "study.toml").write_text(toml_of(SCENES["roughness"]) + text + "\n", encoding="utf-8")
    with pytest.raises(InvalidInput, match="nested too deeply|not a TOML file"):
        fc.scenes.load(tmp_path / "study.toml")


def test_problems_of_all_tables_are_listed_though_the_surface_is_wrong(tmp_path):
    changes = {
        "surface": {"hurst": 7},
        "contact": {"boundary": "x", "tolerance": 3},
        "material": {"young": -1},
    }
    changes["domains"] = {"lacunarity": {"box_sizes": [-1]}, "islands": {"connectivity": 9}}
    problems = refused("domains", tmp_path, **changes)
    assert set(problems) == {
        "surface: hurst", "contact.tolerance", "contact: boundary", "material.young",
        "domains/lacunarity: box_sizes", "domains/islands: connectivity",
    }  # fmt: skip


def test_scene_of_changed_tables_is_checked():
    scene = fc.scenes.load("rigid_sliding")
    changed = fc.scenes.Scene(scene.name, {**scene.tables, "want": {"joints": 3}}, scene.folder)
    with pytest.raises(InvalidInput, match="want.joints"):
        fc.scenes.run(changed, progress=False)
