"""NetCDF files: round trip, compliance, interrupted writes, clear errors."""

import netCDF4
import numpy as np
import pytest
import xarray as xr
from copies import copied_command

import fractalcontact as fc
from fractalcontact.base import provenance, schema
from fractalcontact.base.errors import InvalidInput, UnreadableFile
from fractalcontact.base.file_contents import file_contents
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
        assert dataset["gap"].encoding["fletcher32"]
        assert "_FillValue" not in dataset["x"].encoding
        assert dataset["state"].dtype == np.int8


def test_killed_write_leaves_no_incomplete_file(tmp_path, result):
    code = (
        "import sys, os, signal, xarray as xr, fractalcontact as fc\n"
        "import fractalcontact.base.netcdf as n\n"
        "def die(self, store, **k):\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
        "xr.Dataset.dump_to_store = die\n"
        "fc.save(xr.Dataset({'gap': ('x', [1.0])}), sys.argv[1])\n"
    )
    target = tmp_path / "result.nc"
    assert copied_command(target, program=code).returncode == -9
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
        xr.Dataset, "dump_to_store", lambda *a, **k: (_ for _ in ()).throw(OSError(28, "No space left"))
    )
    with pytest.raises(InvalidInput, match="No space left"):
        fc.save(result, path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_file_that_cannot_be_begun_leaves_nothing(tmp_path, result, monkeypatch):
    def full(path, *_, **__):
        path.write_bytes(b"begun")
        raise OSError(28, "No space left")

    monkeypatch.setattr(netCDF4, "Dataset", full)
    with pytest.raises(InvalidInput, match="No space left"):
        fc.save(result, tmp_path / "result.nc")
    assert list(tmp_path.iterdir()) == []


def numbers(tree):
    return [
        (node.path, name, variable.dims, variable.values.tobytes())
        for node in tree.subtree
        for name, variable in node.variables.items()
        if variable.dtype != object
    ]


def test_flipped_bits_are_found(tmp_path, result):
    """150 bits: every one leaves the numbers as they were, or is an error that calls the file damaged."""
    tree = xr.DataTree.from_dict({"/": xr.Dataset({"run_time": 0.5}), "/joints": result})
    path = fc.save(tree, tmp_path / "result.nc")
    written, content, stream = numbers(fc.open(path)), path.read_bytes(), np.random.default_rng(1)
    messages = []
    for bit in stream.choice(8 * len(content), 150, replace=False):
        damaged = bytearray(content)
        damaged[bit // 8] ^= 1 << (bit % 8)
        path.write_bytes(damaged)
        try:
            assert numbers(fc.open(path)) == written
        except UnreadableFile as error:
            messages.append(str(error))
    assert len(messages) > 146
    assert all("'result.nc' is damaged" in message for message in messages)


def test_flipped_bit_of_one_number_is_found(tmp_path):
    path = fc.save(xr.Dataset({"run_time": 0.123456789}), tmp_path / "number.nc")
    content = bytearray(path.read_bytes())
    content[content.index(np.float64(0.123456789).tobytes())] ^= 1
    path.write_bytes(content)
    with xr.open_dataset(path) as dataset:
        assert float(dataset["run_time"]) != 0.123456789  # the NetCDF library does not find it
    for read in (fc.open, file_contents):
        with pytest.raises(UnreadableFile, match="'number.nc' is damaged"):
            read(path)


def test_packing_of_another_file_is_refused_and_left_behind(tmp_path):
    heights = fc.surfaces.fbm((16, 16), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1)
    for name, value in {"scale_factor": 2.0, "_FillValue": 0.0, "add_offset": 1.0}.items():
        with pytest.raises(InvalidInput, match=f"{name}: expected values that are unpacked"):
            fc.save(heights.assign_attrs({name: value}), tmp_path / "a.nc")
    packed = heights.copy()
    packed.encoding = {"dtype": "int16", "scale_factor": 1e-7, "_FillValue": np.int16(-1)}
    path = fc.save(packed, tmp_path / "b.nc")
    np.testing.assert_array_equal(fc.open(path), heights)


def test_file_changed_by_another_program_is_read(tmp_path, result):
    path = fc.save(result, tmp_path / "result.nc")
    with netCDF4.Dataset(path, "a") as file:
        file["normal_force"][:] = [5.0, 6.0]
    assert fc.open(path)["normal_force"].values.tolist() == [5.0, 6.0]
    with xr.open_dataset(path) as dataset:
        dataset.isel(step=0).to_netcdf(tmp_path / "step.nc")
    assert float(fc.open(tmp_path / "step.nc")["normal_force"]) == 5.0


@pytest.mark.parametrize("name", ["result.txt", "result"])
def test_wrong_suffix_is_refused(tmp_path, result, name):
    with pytest.raises(InvalidInput, match=r"\.nc"):
        fc.save(result, tmp_path / name)


def test_all_names_and_attributes_that_cannot_be_stored_are_listed(tmp_path, result):
    gap = result[["gap"]].rename(gap="g" * 256).assign_attrs(settings={"a": 1}, lists=[[1], [2, 3]])
    gap["g" * 256].attrs |= {"is_rough": True, "a/b": 1.0}
    tree = xr.DataTree.from_dict({"/": xr.Dataset(), "/joints": gap, "/domains": xr.Dataset({1: 2.0})})
    with pytest.raises(InvalidInput) as caught:
        fc.save(tree, tmp_path / "tree.nc")
    for words in ("6 problems", "joints/settings: ", "joints/lists: ", "is_rough: ", "got 'a/b'", "got 1\n"):
        assert words in f"{caught.value}\n"
    assert all(line.startswith("result.") for line in caught.value.problems)
    assert not list(tmp_path.iterdir())


THREADS = """
import os, sys, threading
import xarray as xr
import fractalcontact as fc
from fractalcontact.base.file_contents import file_contents

folder = sys.argv[1]
surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.7, rms_increment=5e-6, rng=11)
groups = {path: surface.to_dataset() for path in ("/joints/closure", "/domains", "/surfaces")}
tree = xr.DataTree.from_dict({"/": xr.Dataset()} | groups)
path = fc.save(tree, folder + "/tree.nc")
lazy = xr.open_dataset(fc.save(surface, folder + "/surface.nc"), cache=False)
failed = []

def save(number):
    fc.save(tree, f"{folder}/{number}.nc")
    assert fc.open(f"{folder}/{number}.nc").identical(fc.open(path))
    fc.save(tree, folder + "/common.nc")

def read(number):
    assert fc.surfaces.read(folder + "/surface.nc").equals(surface)
    assert "joints/closure" in file_contents(path)

def read_lazily(number):
    for column in range(20):
        assert lazy.height.isel(x=column).values.tobytes() == surface.values[:, column].tobytes()
    fc.save(lazy.height, f"{folder}/{number}.nc")

def work(number):
    try:
        for _ in range(10):
            (save, read, read_lazily, save)[number](number)
    except BaseException as error:
        failed.append(error)

threads = [threading.Thread(target=work, args=(number,)) for number in range(4)]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
assert not failed, failed
assert fc.open(folder + "/common.nc").identical(fc.open(path))
print(sorted(name for name in os.listdir(folder) if name.startswith(".")))
"""


def test_threads_save_open_read_and_read_lazily_at_the_same_time(tmp_path):
    """The NetCDF library ends a process in which two threads use it at the same time."""
    done = copied_command(tmp_path, program=THREADS)
    assert (done.returncode, done.stdout.strip()) == (0, "[]"), done.stderr


def test_lazy_and_dask_arrays_are_saved(tmp_path, result):
    path = fc.save(result, tmp_path / "result.nc")
    for chunks in (None, {"step": 1}):
        with xr.open_dataset(path, chunks=chunks) as lazy:
            copy = fc.save(lazy[["gap", "state"]] + 0 if chunks else lazy, tmp_path / "copy.nc")
        reopened = fc.open(copy)
        np.testing.assert_array_equal(reopened["gap"], result["gap"])
        np.testing.assert_array_equal(reopened["state"], result["state"])


def test_process_forked_during_a_save_can_save(tmp_path, result):
    code = (
        "import os, sys, threading, time, numpy as np, xarray as xr, fractalcontact as fc\n"
        "noise = np.random.default_rng(1).normal(size=(4, 400, 400))\n"
        "large = xr.Dataset({'gap': (('step', 'y', 'x'), noise)})\n"
        "large.gap.encoding = {'zlib': True, 'complevel': 9}\n"
        "fc.save(xr.Dataset({'gap': 1.0}), sys.argv[1] + '/first.nc')\n"
        "saving = threading.Thread(target=fc.save, args=(large, sys.argv[1] + '/large.nc'))\n"
        "saving.start(); time.sleep(0.1)\n"
        "child = os.fork()\n"
        "if child == 0:\n"
        "    fc.save(xr.Dataset({'gap': 2.0}), sys.argv[1] + '/child.nc'); os._exit(0)\n"
        "saving.join()\n"
        "assert os.waitpid(child, 0)[1] == 0\n"
    )
    done = copied_command(tmp_path, program=code)
    assert done.returncode == 0, done.stderr
    assert float(fc.open(tmp_path / "child.nc").gap) == 2.0
    assert fc.open(tmp_path / "large.nc").gap.shape == (4, 400, 400)


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


@pytest.mark.parametrize("chunks", ["auto", 1, {"step": 1}])
def test_words_are_opened_in_blocks(tmp_path, result, chunks):
    """Dask cannot size words: they are read, beside numbers in blocks."""
    pytest.importorskip("dask")
    result["reason"] = "step", ["none", "a long reason"]
    result = result.assign_coords(outcome=("step", ["one", "other"]))
    path = fc.save(result, tmp_path / "words.nc")
    opened = fc.open(path, chunks=chunks)
    assert opened["gap"].chunks is not None
    assert opened["reason"].chunks is None
    xr.testing.assert_identical(opened.compute(), fc.open(path))


def test_open_in_blocks(tmp_path):
    """A file opened with chunks holds dask arrays of the same values, in every group."""
    pytest.importorskip("dask")
    surfaces = fc.surfaces.fbm((16, 20), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1, members=4)
    path = fc.save(surfaces, tmp_path / "members.nc")
    lazy = fc.open(path, chunks={"member": 1})
    assert lazy.chunks[0] == (1, 1, 1, 1)
    assert lazy.compute().identical(fc.open(path))
    tree = xr.DataTree.from_dict(
        {"/a": surfaces.to_dataset(name="height"), "/b": xr.Dataset({"step": [1, 2]})}
    )
    opened = fc.open(fc.save(tree, tmp_path / "tree.nc"), chunks="auto")
    assert opened["a/height"].chunks is not None
    np.testing.assert_array_equal(opened["a/height"], surfaces)
    # functions that promise it take the blocks, one surface at a time
    blocked = fc.dimensions.estimate(lazy, "increments")
    np.testing.assert_allclose(blocked.hurst, fc.dimensions.estimate(surfaces, "increments").hurst, rtol=1e-9)


@pytest.mark.parametrize("chunks", [0, "some", {"x": 0}, {1: 2}, 1.5, True])
def test_wrong_chunks(tmp_path, chunks):
    path = fc.save(fc.surfaces.from_array(np.eye(4), 1.0), tmp_path / "a.nc")
    with pytest.raises(InvalidInput, match="chunks"):
        fc.open(path, chunks=chunks)
