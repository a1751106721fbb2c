"""Work on workers that are far away, lost, stopped or not there."""

import importlib.util
import os
import pickle
import signal
import threading
import time
from concurrent.futures import Future

import netCDF4
import numpy as np
import pytest
from study import SOUND, command

import fractalcontact as fc
from fractalcontact import cli
from fractalcontact.base import threads
from fractalcontact.base.errors import FractalContactError
from fractalcontact.base.signals import Stopped
from fractalcontact.scenes import sweeping, working

SWEEP = (
    SOUND.replace("rng = 5", "rng = 5\nmembers = 5").replace("[48, 48]", "[32, 32]").replace("2.4e-3", "1e-3")
)


class Afar:
    """A client whose workers see no folder of this machine; tasks go and come as bytes."""

    def __init__(self, stop_at=None, lost=None):
        self.stop_at, self.lost, self.carried = stop_at, lost, []

    def submit(self):
        """Stand for what tells a client."""

    def nthreads(self):
        return {"one": 1, "two": 1}

    def run(self, function, *arguments, **_):
        return {"one": None, "two": None}

    def map(self, function, tasks, pure):
        return [self.future(function, number, task) for number, task in enumerate(tasks)]

    def future(self, function, number, task):
        found = Future()
        if number == self.lost:
            found.set_exception(type("KilledWorker", (Exception,), {})("one"))
            return found
        if number == self.stop_at:
            signal.raise_signal(signal.SIGINT)
            working._note_stop(task.run)
        task = pickle.loads(pickle.dumps(task))
        self.carried.append(getattr(task.store, "before", {}))
        found.set_result(pickle.loads(pickle.dumps(function(task))))
        return found


def contents(path):
    with netCDF4.Dataset(path) as file:
        return {
            name: np.asarray(variable[...]).tobytes()
            for name, variable in file["joints/closure"].variables.items()
            if name != "run_time"
        }


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("working")
    (folder / "sweep.toml").write_text(SWEEP, encoding="utf-8")
    fc.scenes.run(folder / "sweep.toml", out=folder, progress=False)
    return folder / "sweep.toml", contents(folder / "result.nc")


def test_workers_that_see_no_folder_send_what_is_kept_here_and_a_stopped_sweep_goes_on(whole, tmp_path):
    with pytest.raises(Stopped):
        fc.scenes.run(whole[0], out=tmp_path, progress=False, client=Afar(stop_at=2))
    partial = fc.open(tmp_path / "partial.nc")
    assert "3 of 5 members" in partial.attrs["completeness"]
    np.testing.assert_array_equal(partial["joints/closure"]["member"], [0, 1])
    kept = {path.stem for path in (tmp_path / ".stages").glob("*.nc")}
    assert len(kept) == 6  # two shears and a dilatancy of each of two members
    again = Afar()
    fc.scenes.run(whole[0], out=tmp_path, progress=False, client=again)
    assert set().union(*again.carried) == kept
    assert contents(tmp_path / "result.nc") == whole[1]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["result.nc"]


def test_a_worker_lost_for_good_is_told_and_nothing_else_is_lost(whole, tmp_path):
    with pytest.raises(FractalContactError, match="workers died at it"):
        fc.scenes.run(whole[0], out=tmp_path, progress=False, client=Afar(lost=3))
    assert list((tmp_path / ".stages").glob("joints.closure.*"))
    fc.scenes.run(whole[0], out=tmp_path, progress=False)
    assert contents(tmp_path / "result.nc") == whole[1]


@pytest.mark.parametrize(("count", "workers"), [(64, 2), (64, 1), (7, 3), (3, 3), (1000, 64)])
def test_batches_hold_every_member_once_and_shrink(count, workers):
    batches = list(sweeping.shares(count, workers))
    assert [member for batch in batches for member in batch] == list(range(count))
    sizes = [len(batch) for batch in batches]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[-1] == 1
    assert sizes[0] <= count / workers


def test_a_worker_uses_one_thread_unless_it_is_told_otherwise(monkeypatch):
    counted = []
    task = working._Sent(lambda store, stop: counted.append(threads.thread_count()), working.Store(None), "")
    monkeypatch.delenv("FRACTALCONTACT_THREADS", raising=False)
    task()
    monkeypatch.setenv("FRACTALCONTACT_THREADS", "3")
    task()
    assert counted == [1, 3]


def test_a_sweep_without_a_seed_tells_the_one_it_took(whole, tmp_path):
    import json

    path = tmp_path / "open.toml"
    path.write_text(SWEEP.replace("rng = 5\n", "").replace("members = 5", "members = 2"), encoding="utf-8")
    tree = fc.scenes.run(path, progress=False)
    seed = json.loads(tree.attrs["provenance"])["parameters"]["scene"]["surface"]["rng"]
    path.write_text(path.read_text().replace("members", f"rng = {seed}\nmembers"), encoding="utf-8")
    again = fc.scenes.run(path, progress=False)
    np.testing.assert_array_equal(tree["joints/closure/closure"], again["joints/closure/closure"])


def test_workers_that_cannot_be_had_are_refused(whole, tmp_path, monkeypatch, capsys):
    words = ["run", str(whole[0]), "-o", str(tmp_path / "out")]
    assert cli.main([*words, "--workers", "-1"]) == 2
    found = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "distributed" else found(name)
    )
    assert cli.main([*words, "--workers", "2"]) == 2
    told = capsys.readouterr().err
    assert "--workers: expected at least 0, got -1" in told
    assert "pip install 'fractalcontact[dask]'" in told
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_the_command_with_workers_writes_the_same_bytes(whole, tmp_path):
    pytest.importorskip("distributed")
    done = command("run", whole[0], "-o", tmp_path, "--workers", 2, "--quiet")
    assert (done.returncode, done.stderr) == (0, "")
    assert contents(tmp_path / "result.nc") == whole[1]


@pytest.mark.slow
@pytest.mark.parametrize("once_there_is", ["*", "*.nc"])
def test_a_worker_killed_as_it_is_asked_or_at_its_work_changes_no_byte(whole, tmp_path, once_there_is):
    """A real one: another takes its place, and what it had done and not handed over is done again."""
    distributed = pytest.importorskip("distributed")
    killed = []

    def kill_one(cluster):
        while not list((tmp_path / ".stages").glob(once_there_is)):
            time.sleep(0.005)
        killed.append(next(iter(cluster.workers.values())).pid)
        os.kill(killed[0], signal.SIGKILL)

    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        killer = threading.Thread(target=kill_one, args=(cluster,), daemon=True)
        killer.start()
        fc.scenes.run(whole[0], out=tmp_path, progress=False, client=client)
        killer.join(5)
    assert killed
    assert contents(tmp_path / "result.nc") == whole[1]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["result.nc"]
