"""Every example of the gallery runs alone, without a network, and prints the data it made."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

GALLERY = Path(__file__).parents[2] / "gallery"
SCRIPTS = sorted(path.relative_to(GALLERY).as_posix() for path in (GALLERY / "examples").glob("**/plot_*.py"))
NO_NETWORK = (
    "import runpy, socket, sys\n"
    "def refuse(*a, **k): raise OSError('no network here')\n"
    "socket.socket.connect = refuse\n"
    "runpy.run_path(sys.argv[1], run_name='__main__')\n"
)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCRIPTS)
def test_gallery_example_runs(tmp_path, tmp_path_factory, name):
    """A script runs alone in an empty folder; those of the paper share one study."""
    shutil.copy(GALLERY / name, tmp_path / "example.py")
    environment = os.environ | {"FRACTALCONTACT_GALLERY": str(tmp_path_factory.getbasetemp() / "study")}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", NO_NETWORK, "example.py"],
        cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    assert "<xarray." in done.stdout


def test_gallery_has_examples():
    assert len(SCRIPTS) >= 10
    assert (GALLERY / "images" / "overview.png").stat().st_size < 300_000


@pytest.mark.parametrize("name", SCRIPTS)
def test_examples_use_only_public_names(name):
    lines = (GALLERY / name).read_text().splitlines()
    imports = [line for line in lines if line.startswith(("import ", "from ")) and "fractalcontact" in line]
    assert imports == ["import fractalcontact as fc"]
    assert not any("fc._" in line or "._" in line for line in lines)
