"""A kernel runs whatever state its files are in, and damaged files are replaced."""

import builtins
import importlib.util
import io
import shutil
from pathlib import Path

import numpy as np
import pytest
from numba.core import caching

SOURCE = """
from fractalcontact.base.jit import kernel

@kernel
def total(values):
    result = 0.0
    for value in values:
        result += value
    return result
"""
VALUES = np.arange(5.0)


def loaded(path):
    """Return the kernel of a source file as a new process would have it, with nothing compiled yet."""
    spec = importlib.util.spec_from_file_location("sums", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.total


def compiled(folder):
    """Write a source file, compile its kernel and yield the file; remove the kernel at the end."""
    path = folder / "sums.py"
    path.write_text(SOURCE, encoding="utf-8")
    assert loaded(path)(VALUES) == 10.0
    kernel = loaded(path)
    assert kernel(VALUES) == 10.0
    assert kernel.stats.cache_hits  # nothing is compiled twice
    yield path
    shutil.rmtree(kernel.stats.cache_path, ignore_errors=True)


@pytest.fixture
def source(tmp_path):
    yield from compiled(tmp_path)


@pytest.fixture(scope="module")
def mended(tmp_path_factory):
    """Yield a source file whose kernel is as it was after each test."""
    yield from compiled(tmp_path_factory.mktemp("mended"))


def flipped(content):
    content = bytearray(content)
    content[len(content) // 2] ^= 4
    return bytes(content)


DAMAGES = {
    "empty": lambda content: b"",
    "one byte": lambda content: content[:1],
    "cut in the middle": lambda content: content[: len(content) // 2],
    "one byte short": lambda content: content[:-1],
    "random": lambda content: np.random.default_rng(1).bytes(len(content)),
    "zeros": lambda content: bytes(len(content)),
    "one bit": flipped,
    "a pickle of something else": lambda content: b"\x80\x05K\x01.",
}


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_file_is_replaced(mended, suffix, damage):
    (path,) = Path(loaded(mended).stats.cache_path).glob(f"*{suffix}")
    path.write_bytes(DAMAGES[damage](path.read_bytes()))
    assert loaded(mended)(VALUES) == 10.0
    kernel = loaded(mended)
    assert kernel(VALUES) == 10.0
    assert kernel.stats.cache_hits


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize("mode", [0o000, 0o200])
def test_file_without_permission_is_replaced(source, suffix, mode, monkeypatch):
    (path,) = Path(loaded(source).stats.cache_path).glob(f"*{suffix}")
    path.chmod(mode)
    original = builtins.open

    def refuse(name, mode="r", *arguments, **options):  # the administrator may read everything
        is_refused = "r" in mode and isinstance(name, (str, Path)) and Path(name).exists()
        if is_refused and not Path(name).stat().st_mode & 0o400:
            raise PermissionError(13, "Permission denied")
        return original(name, mode, *arguments, **options)

    monkeypatch.setattr(builtins, "open", refuse)
    monkeypatch.setattr(io, "open", refuse)
    assert loaded(source)(VALUES) == 10.0
    kernel = loaded(source)
    assert kernel(VALUES) == 10.0
    assert kernel.stats.cache_hits


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
def test_folder_in_the_place_of_a_file_is_left_alone(source, suffix):
    (path,) = Path(loaded(source).stats.cache_path).glob(f"*{suffix}")
    path.unlink()
    path.mkdir()
    assert loaded(source)(VALUES) == 10.0
    assert path.is_dir()


def test_code_of_another_signature_is_not_used(source):
    """Two processes may choose the same file: the index then names code that the other one wrote."""
    folder = Path(loaded(source).stats.cache_path)
    assert loaded(source)(np.arange(5, dtype=np.int8)) == 10.0
    first, second = sorted(folder.glob("*.nbc"))
    shutil.copy(first, second)
    assert loaded(source)(np.arange(5, dtype=np.int8)) == 10.0
    shutil.copy(second, first)
    assert loaded(source)(VALUES) == 10.0


def test_kernels_run_on_a_full_disk(tmp_path, monkeypatch):
    tried = []

    def full(*arguments):
        tried.append(arguments)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(caching.IndexDataCacheFile, "_save_index", full)
    (tmp_path / "sums.py").write_text(SOURCE, encoding="utf-8")
    assert loaded(tmp_path / "sums.py")(VALUES) == 10.0
    assert tried
