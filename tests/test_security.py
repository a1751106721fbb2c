"""What a file or a scene of a stranger cannot do: run code, write elsewhere, hang, or fill the memory."""

import ast
import io
import os
import pickle
import signal
import subprocess
import sys
import zipfile
from pathlib import Path

import netCDF4
import numpy as np
import pytest
from matplotlib.figure import Figure
from study import SOUND, watch_calls

import fractalcontact as fc
from fractalcontact.base.errors import (
    FractalContactError,
    FractalContactWarning,
    InvalidInput,
    UnreadableFile,
)
from fractalcontact.base.file_contents import file_contents
from fractalcontact.base.signals import Stopped

PACKAGE = Path(fc.__file__).parent
# calls that run code of a string or of a file
RUNNING = {"eval", "exec", "compile", "__import__", "os.system", "os.popen", "builtins.eval", "builtins.exec"}
UNPACKING = {"pickle", "dill", "cloudpickle", "shelve", "marshal", "yaml"}


class Touch:
    """An object whose unpickling creates a file."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return (open, (str(self.path), "w"))


def test_no_code_of_a_file_is_run():
    """No call that runs text, opens a shell or makes pickled objects; Numba keeps its own kernels pickled."""
    found = []
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import | ast.ImportFrom):
                modules = {alias.name for alias in node.names} | {getattr(node, "module", None) or ""}
                unpacks = {name.partition(".")[0] for name in modules} & UNPACKING
                found += [(path.name, unpacks)] if unpacks and path.name != "jit.py" else []
            elif isinstance(node, ast.Call):
                found += [(path.name, fault) for fault in faults_of(node)]
    assert found == []


def faults_of(call):
    """Return what a call may do with the content of a file: run it, or make its pickled objects."""
    function = getattr(call.func, "attr", getattr(call.func, "id", ""))
    module = getattr(getattr(call.func, "value", None), "id", "")
    options = {word.arg: getattr(word.value, "value", None) for word in call.keywords}
    return [
        *([function] if f"{module}.{function}".lstrip(".") in RUNNING else []),
        *(word for word in ("allow_pickle", "shell") if options.get(word, False) is not False),
        *(["np.load"] if (module, function) == ("np", "load") and "allow_pickle" not in options else []),
    ]


def pickled(mark, name):
    content = io.BytesIO()
    objects = np.array([[Touch(mark), Touch(mark)]], dtype=object)
    if name.endswith(".npy"):
        np.save(content, objects, allow_pickle=True)
    elif name.endswith(".npz"):
        np.savez(content, heights=objects)
    else:
        pickle.dump(Touch(mark), content)
    return content.getvalue()


@pytest.mark.parametrize("name", ["a.npy", "a.npz", "a.npy.gz", "a.mat", "a.dat", "a.nc", "a.xyz", "a.png"])
def test_pickled_objects_are_not_made(tmp_path, name):
    content = pickled(tmp_path / "mark", name.removesuffix(".gz"))
    if name.endswith(".gz"):
        import gzip

        content = gzip.compress(content)
    (tmp_path / name).write_bytes(content)
    for read in (
        lambda path: fc.surfaces.read(path, spacing=1.0),
        fc.surfaces.read_points,
        lambda path: fc.domains.read_mask(path, 1.0),
        fc.open,
        file_contents,
        fc.scenes.load,
    ):
        with pytest.raises(InvalidInput):
            read(tmp_path / name)
    assert not (tmp_path / "mark").exists()


def test_pickled_part_of_a_stopped_study_is_not_made(tmp_path, monkeypatch):
    scene, out = tmp_path / "study.toml", tmp_path / "out"
    scene.write_text(SOUND, encoding="utf-8")
    with monkeypatch.context() as patch:
        watch_calls(patch, lambda name: signal.raise_signal(signal.SIGINT))
        with pytest.raises(Stopped):
            fc.scenes.run(scene, out=out, progress=False)
    parts = list((out / ".stages").rglob("*.npz"))
    assert parts
    for part in parts:
        np.savez(part, heights=np.array([Touch(tmp_path / "mark")], dtype=object))
    with pytest.warns(FractalContactWarning, match="damaged"):
        fc.scenes.run(scene, out=out, progress=False)
    assert (out / "result.nc").exists()
    assert not (tmp_path / "mark").exists()


SCENE = """
title = "{word}"
[surface]
generate = "fbm"
shape = [20, 20]
spacing = 1e-4
hurst = 0.8
rms_increment = 4e-6
rng = 5
[want]
surfaces = ["describe"]
dimensions = ["variogram"]
figures = true
"""


@pytest.mark.parametrize("word", ["../../escaped", "/tmp/fractalcontact_escaped", "$(touch escaped)"])
def test_nothing_is_written_outside_the_folder(tmp_path, word, monkeypatch):
    if "/" in word:  # nothing but the names of the files; the last one draws the figures as well
        monkeypatch.setattr("fractalcontact.plotting._draw._draw_row", lambda row, tree: Figure((1.0, 1.0)))
    folder = tmp_path / "study"
    folder.mkdir()
    (folder / "scene.toml").write_text(SCENE.format(word=word), encoding="utf-8")
    fc.scenes.run(folder / "scene.toml", out=folder / "out", progress=False)
    assert {path.name for path in tmp_path.iterdir()} == {"study"}
    assert {path.name for path in folder.iterdir()} == {"scene.toml", "out"}
    assert not Path("/tmp/fractalcontact_escaped").exists()


@pytest.mark.parametrize("key", ["out", "folder", "path", "file", "keep"])
def test_scene_cannot_name_a_folder_to_write_in(tmp_path, key):
    text = SCENE.format(word="a").replace("[surface]", f'{key} = "../escaped"\n[surface]', 1)
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InvalidInput, match=key):
        fc.scenes.run(tmp_path / "scene.toml", out=tmp_path / "out", progress=False)
    assert {path.name for path in tmp_path.iterdir()} == {"scene.toml"}


CODE = """
import sys, fractalcontact as fc
from fractalcontact.base.errors import FractalContactError
from fractalcontact.base.file_contents import file_contents
readers = {
    "read": lambda path: fc.surfaces.read(path, spacing=1.0),
    "read_points": lambda path: fc.surfaces.read_points(path),
    "read_mask": lambda path: fc.domains.read_mask(path, 1.0),
    "open": lambda path: fc.open(path),
    "contents": lambda path: file_contents(path),
    "load": lambda path: fc.scenes.load(path),
    "template": lambda path: fc.scenes.template("roughness", path),
}
try:
    fc.scenes.validate(sys.argv[1])
except FractalContactError as error:
    print(error)
for path in sys.argv[2:]:
    for name, read in readers.items():
        try:
            read(path)
        except FractalContactError:
            continue
        sys.exit(f"{name} accepted {path}")
    print(path, flush=True)
"""


def test_pipes_and_devices_are_refused_at_once(tmp_path):
    """In a process of its own, which is stopped if it waits for one of them; it prints the others.

    Also by the name that a scene has for one.
    """
    for name in ("pipe.npy", "pipe.nc", "pipe.png", "pipe.xyz"):
        os.mkfifo(tmp_path / name)
    for name, target in (("zero.npy", "/dev/zero"), ("zero.nc", "/dev/zero"), ("link.npy", "/dev/stdin")):
        (tmp_path / name).symlink_to(target)
    paths = [str(path) for path in sorted(tmp_path.iterdir())]
    assert len(paths) == 7
    scene = tmp_path / "scene.toml"
    text = '[surface]\nread = "pipe.npy"\nspacing = 1e-4\n[want]\nsurfaces = ["describe"]\n'
    scene.write_text(text, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", CODE, str(scene), *paths],
        timeout=120,
        check=False,
        capture_output=True,
        text=True,
        stdin=subprocess.PIPE,
    )
    assert (done.returncode, done.stderr, done.stdout.split()[-7:]) == (0, "", paths)
    assert "expected an existing file, got 'pipe.npy'" in done.stdout  # of the scene


def test_archive_that_states_more_than_it_has_is_refused(tmp_path):
    """The size that an archive states is compared with its length before anything is unpacked."""
    pytest.importorskip("SurfaceTopography")
    header = io.BytesIO()
    zeros = np.broadcast_to(0.0, (1 << 13, (1 << 12) + 32))
    np.lib.format.write_array(header, zeros)
    with zipfile.ZipFile(tmp_path / "bomb.npz", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("heights.npy", header.getvalue())
    with pytest.raises(UnreadableFile, match="at most 256 MiB when unpacked, for its size, got 258 MiB"):
        fc.surfaces.read(tmp_path / "bomb.npz", spacing=1.0)


def test_netcdf_file_that_states_terabytes_is_refused(tmp_path):
    with netCDF4.Dataset(tmp_path / "bomb.nc", "w") as file:
        file.createDimension("y", 1 << 20)
        file.createDimension("x", 1 << 20)
        file.createVariable("height", "f8", ("y", "x"), zlib=True, chunksizes=(1 << 10, 1 << 10))
    for read in (fc.open, fc.surfaces.read):
        with pytest.raises(UnreadableFile, match="when unpacked, for its size, got 8388608 MiB"):
            read(tmp_path / "bomb.nc")


def test_image_that_states_terabytes_is_refused(tmp_path):
    import struct
    import zlib

    def chunk(kind, content):
        length, mark = struct.pack(">I", len(content)), struct.pack(">I", zlib.crc32(kind + content))
        return length + kind + content + mark

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", 1 << 20, 1 << 20, 8, 0, 0, 0, 0))
    body = chunk(b"IDAT", zlib.compress(bytes(1000))) + chunk(b"IEND", b"")
    (tmp_path / "bomb.png").write_bytes(b"\x89PNG\r\n\x1a\n" + head + body)
    with pytest.raises(FractalContactError, match="expected an image"):
        fc.domains.read_mask(tmp_path / "bomb.png", 1.0)
