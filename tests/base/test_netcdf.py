"""NetCDF files: round trip, compliance, interrupted writes, clear errors."""

import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.base import provenance, schema
from fractalcontact.base.errors import InvalidInput, UnreadableFile
from fractalcontact.base.grid import plane_coords


@pytest.fixture
def result():
    coords = plane_coords((4, 5), (1e-3, 2e-3), (True, False))
    dataset = xr.Dataset(
        {
            "state": (("step", "y", "x"), np.arange(40, dtype=np.int8).reshape(2, 4, 5) % 3),
            "gap": (("step", "y", "x"), np.linspace(0, 1, 40).reshape(2, 4, 5)),
            "converged": ("step", np.array([True, False])),
            "contact_fraction": ("step", [0.25, np.nan]),
        },
        coords={**coords, "step": [0, 1], "normal_force": ("step", [2.0, 1.0]), "direction": "W"},
    )
    return provenance.stamp(schema.label(dataset), "fractalcontact.test", {"a": 1}, title="a test result")


def test_round_trip_of_a_dataset(tmp_path, result):
    path = fc.save(result, tmp_path / "deep" / "result.nc")
    xr.testing.assert_identical(fc.open(path), result)
    assert fc.open(path)["x"].attrs == result["x"].attrs
    assert list(path.parent.iterdir()) == [path]


def test_round_trip_of_an_array_and_a_tree(tmp_path, result):
    gap = result["gap"].assign_attrs(result.attrs)
    xr.testing.assert_identical(fc.open(fc.save(gap, tmp_path / "gap.nc")), gap)
    tree = xr.DataTree.from_dict({"/": xr.Dataset(), "/joints/closure": result})
    reopened = fc.open(fc.save(tree, tmp_path / "tree.nc"))
    xr.testing.assert_identical(reopened["joints/closure"].to_dataset(), result)
    assert reopened.attrs["Conventions"] == "CF-1.11"


def test_plain_to_netcdf_is_cf_compliant(tmp_path, result, compliance):
    result.to_netcdf(tmp_path / "plain.nc")
    assert compliance(tmp_path / "plain.nc") == []


def test_saved_array_is_cf_compliant(tmp_path, result, compliance):
    assert compliance(fc.save(result["gap"].assign_attrs(result.attrs), tmp_path / "gap.nc")) == []


def test_checker_detects_a_fault(tmp_path, result, compliance):
    result["gap"].attrs["units"] = "furlong per joke"
    result.to_netcdf(tmp_path / "wrong.nc")
    assert compliance(tmp_path / "wrong.nc") != []


def test_encoding_in_the_file(tmp_path, result):
    path = fc.save(result, tmp_path / "result.nc")
    with xr.open_dataset(path) as dataset:
        assert dataset["gap"].encoding["chunksizes"] == (1, 4, 5)
        assert dataset["gap"].encoding["zlib"]
        assert dataset["gap"].encoding["complevel"] == 4
        assert dataset["gap"].encoding["shuffle"]
        assert "_FillValue" not in dataset["x"].encoding
        assert dataset["state"].dtype == np.int8


def test_killed_write_leaves_no_incomplete_file(tmp_path, result):
    code = (
        "import sys, os, signal, xarray as xr, fractalcontact as fc\n"
        "import fractalcontact.base.netcdf as n\n"
        "def die(self, path, **k):\n"
        "    open(path, 'wb').write(b'half'); os.kill(os.getpid(), signal.SIGKILL)\n"
        "xr.Dataset.to_netcdf = die\n"
        "fc.save(xr.Dataset({'gap': ('x', [1.0])}), sys.argv[1])\n"
    )
    target = tmp_path / "result.nc"
    done = subprocess.run([sys.executable, "-c", code, str(target)], check=False)
    assert done.returncode == -9
    assert not target.exists()
    left = list(tmp_path.iterdir())
    assert len(left) == 1
    assert left[0].suffix != ".nc"
    fc.save(result, target)
    assert list(tmp_path.iterdir()) == [target]


def test_existing_file_survives_a_failed_write(tmp_path, result, monkeypatch):
    path = fc.save(result, tmp_path / "result.nc")
    before = path.read_bytes()
    monkeypatch.setattr(
        xr.Dataset, "to_netcdf", lambda *a, **k: (_ for _ in ()).throw(OSError(28, "No space left"))
    )
    with pytest.raises(InvalidInput, match="No space left"):
        fc.save(result, path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("name", ["result.txt", "result"])
def test_wrong_suffix_is_refused(tmp_path, result, name):
    with pytest.raises(InvalidInput, match=r"\.nc"):
        fc.save(result, tmp_path / name)


def test_unreadable_files_are_refused(tmp_path, result):
    with pytest.raises(UnreadableFile, match="existing"):
        fc.open(tmp_path / "none.nc")
    path = fc.save(result, tmp_path / "result.nc")
    path.write_bytes(path.read_bytes()[:1500])
    with pytest.raises(UnreadableFile, match="complete"):
        fc.open(path)
    (tmp_path / "text.nc").write_text("hello")
    with pytest.raises(UnreadableFile, match="complete"):
        fc.open(tmp_path / "text.nc")
