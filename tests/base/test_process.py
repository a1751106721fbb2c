"""Peak memory of the process, and saving a file without importing dask."""

import subprocess
import sys

import pytest

from fractalcontact.base.process import peak_memory


def test_peak_memory_includes_a_large_block():
    before = peak_memory()
    if before == 0:
        pytest.skip("this system does not report the peak memory")
    block = bytearray(b"x") * (1 << 26)
    assert peak_memory() >= max(before, len(block))


def test_dask_is_not_imported_to_save_a_result(tmp_path):
    code = (
        "import sys; from fractalcontact.base.process import block_dask_import; block_dask_import()\n"
        "import fractalcontact as fc\n"
        "surface = fc.surfaces.spectral((8, 8), 1e-4, hurst=0.7, rms_height=1e-6, rng=1)\n"
        "fc.save(surface, sys.argv[1])\n"
        "print([name for name in sys.modules if name.startswith(('dask.', 'distributed'))])\n"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "surface.nc")]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip() == "[]"
