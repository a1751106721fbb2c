"""Finished parts are kept: a study stopped by a signal, a full disk or a damaged file resumes."""

import os
import signal
import time
import zipfile

import netCDF4
import numpy as np
import pytest
from copies import Copy, copied_command
from study import SOUND, watch_calls

import fractalcontact as fc
from fractalcontact.base.errors import FractalContactWarning, InvalidInput, UnreadableFile
from fractalcontact.base.file_contents import file_contents
from fractalcontact.base.signals import Stopped

pytest.importorskip("resource")  # signals and limits as Unix has them

STUDY = SOUND.replace(
    'joints = ["closure", "rigid_dilatancy"]',
    'surfaces = ["height", "describe"]\ndimensions = ["default"]\n'
    'joints = ["closure", "elastic_dilatancy", "friction"]\n'
    'domains = ["box_dimension", "islands"]\nkeep = ["state"]\n',
).replace('direction = "W"', 'direction = "W"\nelastic_dilatancy = { direction = ["E", "W"] }')


def variables(path):
    """Return the bytes of every variable of a file but the run times."""
    contents = {}

    def walk(group, place):
        for name, variable in group.variables.items():
            if not name.endswith("run_time"):
                variable.set_auto_maskandscale(False)
                contents[f"{place}/{name}"] = (variable.dimensions, np.asarray(variable[...]).tobytes())
        for name, child in group.groups.items():
            walk(child, f"{place}/{name}")

    with netCDF4.Dataset(path) as file:
        walk(file, "")
    return contents


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    folder = tmp_path_factory.mktemp("uninterrupted")
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    fc.scenes.run(folder / "study.toml", out=folder, progress=False)
    return folder / "study.toml", variables(folder / "result.nc")


def test_study_stopped_at_every_part_gives_the_same_bytes(uninterrupted, tmp_path, monkeypatch):
    scene, expected = uninterrupted
    asked, numbers, runs = [], [], 0
    in_turn = signal.SIGINT, signal.SIGTERM

    def stop_in_first_part(name):
        """Request a stop in the first part that is computed in each run."""
        if not asked:
            asked.append(True)
            signal.raise_signal(in_turn[runs % 2])

    watch_calls(monkeypatch, stop_in_first_part)
    before = {signum: signal.getsignal(signum) for signum in (signal.SIGINT, signal.SIGTERM)}
    while True:
        asked.clear()
        runs += 1
        try:
            fc.scenes.run(scene, out=tmp_path, progress=False)
            break
        except Stopped as stop:
            numbers.append(stop.number)
        assert [path.name for path in tmp_path.glob("*.nc")] == ["partial.nc"]
        partial = fc.open(tmp_path / "partial.nc")
        assert "partial" in partial.attrs["completeness"]
        assert runs < 20
    assert len(numbers) > 6
    assert set(numbers) == set(in_turn)
    assert {signum: signal.getsignal(signum) for signum in before} == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report.html", "result.nc"]
    assert variables(tmp_path / "result.nc") == expected


def test_partial_file_has_the_finished_part_of_a_stage(uninterrupted, tmp_path, monkeypatch):
    def stop_in_closure(name):
        if name == "closure":
            signal.raise_signal(signal.SIGTERM)

    watch_calls(monkeypatch, stop_in_closure)
    with pytest.raises(Stopped, match="SIGTERM"):
        fc.scenes.run(uninterrupted[0], out=tmp_path, progress=False)
    partial = fc.open(tmp_path / "partial.nc")
    assert partial["joints/closure"].sizes["shear"] == 1
    assert "joints/closure (1 of 2 parts done)" in partial.attrs["completeness"]
    assert "domains/islands" in partial.attrs["completeness"]


def test_second_signal_stops_at_once():
    from fractalcontact.base import signals

    # a job in the background inherits a SIGINT that is ignored, and would go on ignoring it
    usual = signals.leaving(signal.default_int_handler)
    with pytest.raises(KeyboardInterrupt) as caught, usual, signals.noted(echo=0.0) as stop:
        signal.raise_signal(signal.SIGINT)
        assert stop.number == signal.SIGINT
        time.sleep(0.001)
        signal.raise_signal(signal.SIGINT)
    assert not isinstance(caught.value, Stopped)


def test_repeated_signal_within_half_a_second_counts_once(tmp_path):
    from fractalcontact.base import signals

    with signals.noted() as stop:
        signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGTERM)
    assert stop.number == signal.SIGTERM


@pytest.mark.parametrize(
    "number", [signal.SIGKILL, signal.SIGTERM, pytest.param(signal.SIGINT, marks=pytest.mark.slow)]
)
def test_killed_study_leaves_no_incomplete_file(uninterrupted, tmp_path, number):
    process = Copy("run", uninterrupted[0], "-o", tmp_path, "--quiet")
    deadline = time.monotonic() + 60
    while not list(tmp_path.glob(".stages/*.npz")) and time.monotonic() < deadline:
        time.sleep(0.001)
    os.kill(process.pid, number)
    _, text = process.communicate()
    if number != signal.SIGKILL:
        assert process.returncode == 128 + number
        assert "resumes" in text
        assert fc.open(tmp_path / "partial.nc").attrs["completeness"].startswith("partial")
    assert not (tmp_path / "result.nc").exists()
    tree = fc.scenes.run(uninterrupted[0], out=tmp_path, progress=False)
    assert "completeness" not in tree.attrs
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report.html", "result.nc"]
    assert variables(tmp_path / "result.nc") == uninterrupted[1]


def damaged(folder, how):
    parts = list((folder / ".stages").glob("*.npz"))
    assert parts
    for path in parts:
        if how == "truncated":
            path.write_bytes(path.read_bytes()[:-200])
        elif how == "foreign":
            np.savez(path, height=np.zeros((8, 8)))
        elif how == "NetCDF":
            surface = fc.surfaces.fbm((8, 8), 1.0, hurst=0.5, rms_increment=1.0, rng=1)
            fc.save(surface, path.with_suffix(".nc")).replace(path)
        elif how == "flipped bit":
            with zipfile.ZipFile(path) as archive:
                largest = max(archive.infolist(), key=lambda member: member.file_size)
            content = bytearray(path.read_bytes())
            content[largest.header_offset + largest.file_size // 2] ^= 1
            path.write_bytes(content)
        else:
            path.write_text("not an archive", encoding="utf-8")


def test_surface_read_from_a_file_is_not_kept_again(uninterrupted, tmp_path, monkeypatch):
    surface = fc.surfaces.fbm((48, 48), 1e-4, hurst=0.8, rms_increment=4e-6, rng=5)
    fc.save(surface, tmp_path / "surface.nc")
    text = SOUND.partition("[material]")[2]
    (tmp_path / "read.toml").write_text(f'[surface]\nread = "surface.nc"\n[material]{text}', encoding="utf-8")
    part_names = []

    def list_kept(name):
        part_names.extend(path.name for path in (tmp_path / "out" / ".stages").glob("*.npz"))

    watch_calls(monkeypatch, list_kept)
    fc.scenes.run(tmp_path / "read.toml", out=tmp_path / "out", progress=False)
    assert part_names
    assert not [name for name in part_names if name.startswith("surfaces")]


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A study of two stages beside the surface: its scene, and its variables."""
    folder = tmp_path_factory.mktemp("small")
    (folder / "study.toml").write_text(SOUND, encoding="utf-8")
    fc.scenes.run(folder / "study.toml", out=folder, progress=False)
    return folder / "study.toml", variables(folder / "result.nc")


@pytest.mark.parametrize("how", ["truncated", "foreign", "NetCDF", "flipped bit", "text"])
def test_damaged_part_is_reported_and_computed_again(small, tmp_path, monkeypatch, how):
    with monkeypatch.context() as patch:
        watch_calls(patch, lambda name: signal.raise_signal(signal.SIGINT))
        with pytest.raises(Stopped):
            fc.scenes.run(small[0], out=tmp_path, progress=False)
    damaged(tmp_path, how)
    with pytest.warns(FractalContactWarning, match="computed again"):
        fc.scenes.run(small[0], out=tmp_path, progress=False)
    assert variables(tmp_path / "result.nc") == small[1]


@pytest.mark.parametrize("cut", [0, 10, 1000, -1])
def test_truncated_result_file_is_refused(uninterrupted, tmp_path, cut):
    path = tmp_path / "cut.nc"
    path.write_bytes((uninterrupted[0].parent / "result.nc").read_bytes()[:cut])
    with pytest.raises(UnreadableFile, match=r"cut\.nc"):
        fc.open(path)


def test_contents_of_a_foreign_file(tmp_path):
    with netCDF4.Dataset(tmp_path / "other.nc", "w") as file:
        file.createDimension("t", 3)
        file.createVariable("temperature", "f8", ("t",))[:] = 1.0
        file.provenance = "from a boat"
    assert "temperature" in fc.open(tmp_path / "other.nc")
    assert "temperature" in file_contents(tmp_path / "other.nc")


@pytest.mark.parametrize(
    "text", ['{"stages": {"a": 3}}', '{"stages": {"a": {"residual": null}}}', '{"stages": [1]}', "[1]", "3"]
)
def test_contents_of_a_file_with_foreign_provenance(tmp_path, text):
    with netCDF4.Dataset(tmp_path / "other.nc", "w") as file:
        file.createDimension("t", 2)
        file.createVariable("temperature", "f8", ("t",))[:] = 1.0
        file.createVariable("ragged", file.createVLType("f8", "list"), ("t",))
        file.createVariable("word", str, ("t",))[:] = np.array(["a", "b"], dtype=object)
        file.provenance = text
    assert "temperature" in file_contents(tmp_path / "other.nc")
    assert list(fc.open(tmp_path / "other.nc")["word"].values) == ["a", "b"]


def test_full_disk_is_a_clear_error_and_the_study_resumes(uninterrupted, tmp_path):
    done = copied_command("run", uninterrupted[0], "-o", tmp_path, "--quiet", largest_file=40_000)
    assert done.returncode == 2, done.stderr
    assert "cannot be written here" in done.stderr
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.glob("*.nc"))
    fc.scenes.run(uninterrupted[0], out=tmp_path, progress=False)
    assert variables(tmp_path / "result.nc") == uninterrupted[1]


def test_folder_without_write_access_is_refused_first(uninterrupted, tmp_path):
    (tmp_path / "file").write_text("in the way", encoding="utf-8")
    for out in (tmp_path / "file", tmp_path / "file" / "below", "/proc/nowhere"):
        with pytest.raises(InvalidInput, match="folder"):
            fc.scenes.run(uninterrupted[0], out=out, progress=False)
