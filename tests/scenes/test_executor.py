"""Workers that are remote, lost, stopped or not available."""

import json
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import time
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from pathlib import Path

import netCDF4
import numpy as np
import pytest
from copies import Copy, copied_command
from study import SOUND, watch_calls

import fractalcontact as fc
from fractalcontact import cli
from fractalcontact.base import resources
from fractalcontact.base.errors import FractalContactError, InvalidInput
from fractalcontact.base.signals import Stopped

SWEEP = (
    SOUND.replace("rng = 5", "rng = 5\nmembers = 5").replace("[48, 48]", "[32, 32]").replace("2.4e-3", "1e-3")
)


class Remote(Executor):
    """Workers that do not see the folders of this machine; tasks go and come as bytes."""

    def __init__(self, stop_at=None, lost=None):
        self.stop_at, self.lost, self.kept, self.number = stop_at, lost, [], 0

    def submit(self, function, *arguments):
        number, future = self.number, Future()
        self.number += 1
        if number == self.lost:
            future.set_exception(type("KilledWorker", (Exception,), {})("one"))
            return future
        if number == self.stop_at:
            signal.raise_signal(signal.SIGINT)
        task, store, kept, mark = pickle.loads(pickle.dumps(arguments))
        self.kept.append(kept)
        mark = mark and mark.with_name("of another machine")
        future.set_result(pickle.loads(pickle.dumps(function(task, store, kept, mark))))
        return future


def contents(path):
    with netCDF4.Dataset(path) as file:
        return {
            name: np.asarray(variable[...]).tobytes()
            for name, variable in file["joints/closure"].variables.items()
            if name != "run_time"
        }


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    folder = tmp_path_factory.mktemp("working")
    (folder / "sweep.toml").write_text(SWEEP, encoding="utf-8")
    fc.scenes.run(folder / "sweep.toml", out=folder, progress=False)
    return folder / "sweep.toml", contents(folder / "result.nc")


def test_remote_workers_return_their_parts_and_a_stopped_ensemble_resumes(uninterrupted, tmp_path):
    with pytest.raises(Stopped):
        fc.scenes.run(uninterrupted[0], out=tmp_path, progress=False, client=Remote(stop_at=1))
    partial = fc.open(tmp_path / "partial.nc")
    assert "3 of 5 members" in partial.attrs["completeness"]
    np.testing.assert_array_equal(partial["joints/closure"]["member"], [0, 1])
    part_names = {path.stem for path in (tmp_path / ".stages").glob("*.npz")}
    assert len(part_names) == 6  # two shears and a dilatancy of each of two members
    again = Remote()
    fc.scenes.run(uninterrupted[0], out=tmp_path, progress=False, client=again)
    assert set().union(*again.kept) == part_names
    assert contents(tmp_path / "result.nc") == uninterrupted[1]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report.html", "result.nc"]


def test_lost_worker_is_reported_and_nothing_else_is_lost(uninterrupted, tmp_path):
    with pytest.raises(FractalContactError, match="workers died at it"):
        fc.scenes.run(uninterrupted[0], out=tmp_path, progress=False, client=Remote(lost=3))
    assert list((tmp_path / ".stages").glob("joints.closure.*"))
    fc.scenes.run(uninterrupted[0], out=tmp_path, progress=False)
    assert contents(tmp_path / "result.nc") == uninterrupted[1]


def test_a_worker_uses_one_thread_unless_the_environment_sets_more(uninterrupted, monkeypatch):
    counts = []
    watch_calls(monkeypatch, lambda name: counts.append(resources.thread_count()))
    monkeypatch.delenv("FRACTALCONTACT_THREADS", raising=False)
    fc.scenes.run(uninterrupted[0], progress=False, client=Remote())
    assert set(counts) == {1}
    counts.clear()
    monkeypatch.setenv("FRACTALCONTACT_THREADS", "3")
    fc.scenes.run(uninterrupted[0], progress=False, client=Remote())
    assert set(counts) == {3}


def test_ensemble_without_a_seed_records_one(uninterrupted, tmp_path):
    import json

    path = tmp_path / "open.toml"
    path.write_text(SWEEP.replace("rng = 5\n", "").replace("members = 5", "members = 2"), encoding="utf-8")
    tree = fc.scenes.run(path, progress=False)
    seed = json.loads(tree.attrs["provenance"])["parameters"]["scene"]["surface"]["rng"]
    path.write_text(path.read_text().replace("members", f"rng = {seed}\nmembers"), encoding="utf-8")
    again = fc.scenes.run(path, progress=False)
    np.testing.assert_array_equal(tree["joints/closure/closure"], again["joints/closure/closure"])


def test_invalid_number_of_workers_is_refused(uninterrupted, tmp_path, capsys):
    words = ["run", str(uninterrupted[0]), "-o", str(tmp_path / "out")]
    assert cli.main([*words, "--workers", "-1"]) == 2
    assert "--workers: expected an integer" in (message := capsys.readouterr().err)
    assert message.rstrip().endswith("got -1")
    assert cli.main([*words, "--workers", "100000"]) == 2
    assert "--workers: expected an integer" in capsys.readouterr().err
    with pytest.raises(InvalidInput, match="workers: .* got 100000"):
        fc.scenes.run(uninterrupted[0], workers=100_000, progress=False)
    with pytest.raises(InvalidInput, match="workers"):
        fc.scenes.run(uninterrupted[0], workers=1.5, progress=False)
    with pytest.raises(InvalidInput, match="workers / client"):
        fc.scenes.run(uninterrupted[0], workers=2, client=Remote(), progress=False)
    assert not (tmp_path / "out").exists()


WATCH = """
import os, sys
from pathlib import Path
class Watch:
    def find_spec(self, name, path, target=None):
        if name == "numpy":
            with Path(__file__).with_name("seen").open("a") as file:
                print(os.environ.get("OPENBLAS_NUM_THREADS"), os.environ.get("MKL_NUM_THREADS"), file=file)
sys.meta_path.insert(0, Watch())
"""


def test_command_with_worker_processes_writes_the_same_bytes(uninterrupted, tmp_path, monkeypatch):
    """The workers have one thread of linear algebra, which NumPy reads when it is imported."""
    watch = tmp_path / "watch"
    watch.mkdir()
    (watch / "sitecustomize.py").write_text(WATCH, encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(watch), os.environ.get("PYTHONPATH", "")]))
    for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        monkeypatch.delenv(name, raising=False)
    done = copied_command("run", uninterrupted[0], "-o", tmp_path / "out", "--workers", 2, "--quiet")
    assert (done.returncode, done.stderr) == (0, "")
    assert contents(tmp_path / "out" / "result.nc") == uninterrupted[1]
    # the last one is the process that the workers copy
    assert (watch / "seen").read_text().splitlines()[-1] == "1 1"


@pytest.mark.parametrize(
    "number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow), signal.SIGKILL]
)
def test_stopped_worker_processes_end_and_the_study_resumes(uninterrupted, tmp_path, number):
    process = Copy("run", uninterrupted[0], "-o", tmp_path, "--workers", 2)
    while not list(tmp_path.glob(".stages/*.npz")) and process.poll() is None:
        time.sleep(0.005)
    os.kill(process.pid, number)
    _, message = process.communicate()  # the pipe closes when the last worker has ended
    assert process.returncode == (-number if number == signal.SIGKILL else 128 + number), message
    fc.scenes.run(uninterrupted[0], out=tmp_path, progress=False)
    assert contents(tmp_path / "result.nc") == uninterrupted[1]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report.html", "result.nc"]


def test_killed_worker_process_is_reported_and_the_study_resumes(uninterrupted, tmp_path):
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("forkserver")) as executor:
        worker = executor.submit(os.getpid).result()

        def kill_worker():
            while not list((tmp_path / ".stages").glob("*.npz")):
                time.sleep(0.005)
            os.kill(worker, signal.SIGKILL)

        threading.Thread(target=kill_worker, daemon=True).start()
        with pytest.raises(FractalContactError, match="a worker process died"):
            fc.scenes.run(uninterrupted[0], out=tmp_path, progress=False, client=executor)
    fc.scenes.run(uninterrupted[0], out=tmp_path, progress=False)
    assert contents(tmp_path / "result.nc") == uninterrupted[1]


@pytest.mark.slow
@pytest.mark.parametrize("once_there_is", ["*", "*.npz"])
def test_killed_worker_of_dask_changes_no_byte(uninterrupted, tmp_path, once_there_is):
    """Another worker takes its place and repeats what was not handed over."""
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
        fc.scenes.run(uninterrupted[0], out=tmp_path, progress=False, client=client)
        killer.join(5)
    assert killed
    assert contents(tmp_path / "result.nc") == uninterrupted[1]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report.html", "result.nc"]


FIVE_SHEARS = SOUND.replace("[1e-4, 4e-4]", "[1e-4, 2e-4, 3e-4, 4e-4, 5e-4]")


# a study whose first call lasts long enough that a copy of the process is worth it, with two threads; the
# processes that run tests have other threads, with which they are not copied
SLOW_START = """
import os, sys, time, types
sys.path.insert(0, sys.argv[3])
import fractalcontact as fc
from fractalcontact.base import resources
from study import watch_calls

copies, counts = [], []

def note(name):
    counts.append(resources.thread_count())
    time.sleep(0.6 if len(counts) == 1 else 0)

os.register_at_fork(before=lambda: copies.append(1))
watch_calls(types.SimpleNamespace(setattr=setattr), note)
fc.scenes.run(sys.argv[1], out=sys.argv[2], progress=False)
print(len(copies), *counts)
"""


def run_with_a_slow_start(folder, text, program=SLOW_START):
    """Run a study in a process of its own; return its result, the copies made, the threads of its calls."""
    (folder / "study.toml").write_text(text, encoding="utf-8")
    done = copied_command(folder / "study.toml", folder / "out", Path(__file__).parents[1], program=program)
    copies, *counts = map(int, done.stdout.split())
    return done, copies, counts


@pytest.mark.skipif(sys.platform != "linux", reason="no process is copied")
@pytest.mark.parametrize("text", ["shears", "members", "stages"])
def test_copy_of_the_process_computes_the_same_numbers(tmp_path, monkeypatch, text):
    wanted = 'surfaces = ["height", "describe"]\ndimensions = ["default", "spectrum"]\njoints = ['
    texts = {"shears": FIVE_SHEARS, "members": SWEEP, "stages": SOUND.replace("joints = [", wanted)}
    monkeypatch.setenv("FRACTALCONTACT_THREADS", "2")
    done, copies, counts = run_with_a_slow_start(tmp_path, texts[text])
    assert (done.returncode, done.stderr) == (0, "")
    assert copies >= 1
    assert counts[0] == 2
    assert set(counts[1:]) == {1}
    monkeypatch.setenv("FRACTALCONTACT_THREADS", "1")
    serial = fc.scenes.run(tmp_path / "study.toml", progress=False)
    with fc.open(tmp_path / "out" / "result.nc") as shared:
        stages = [[*json.loads(tree.attrs["provenance"])["stages"]] for tree in (serial, shared)]
        assert stages[0] == stages[1]
        assert [node.path for node in serial.subtree] == [node.path for node in shared.subtree]
        for node in serial.subtree:
            for name in set(node.variables) - {"run_time"}:
                np.testing.assert_array_equal(node[name].values, shared[node.path][name].values, name)


@pytest.mark.skipif(sys.platform != "linux", reason="no process is copied")
def test_last_task_keeps_all_threads(tmp_path, monkeypatch):
    """A copy of the process helps from two tasks on: one alone is not held to half of the threads."""
    monkeypatch.setenv("FRACTALCONTACT_THREADS", "2")
    done, _, counts = run_with_a_slow_start(tmp_path, SOUND.replace(', "rigid_dilatancy"', ""))
    assert (done.returncode, counts) == (0, [2, 2])  # whatever copy prepares the page


FAILING = SLOW_START.replace(
    "watch_calls(",
    """
import functools
from fractalcontact.base.errors import InvalidInput
closure = fc.joints.closure
def fail_late(crack, *, shear, **options):
    if shear[0] > 3.5e-4:
        raise InvalidInput("fractalcontact.joints.closure", ["shear: too far"])
    return closure(crack, shear=shear, **options)
fc.joints.closure = functools.update_wrapper(fail_late, closure)
watch_calls(""",
).replace(
    "fc.scenes.run(sys.argv[1], out=sys.argv[2], progress=False)",
    """
try:
    fc.scenes.run(sys.argv[1], out=sys.argv[2], progress=False)
except InvalidInput as error:
    sys.stderr.write(str(error))
""",
)


@pytest.mark.skipif(sys.platform != "linux", reason="no process is copied")
def test_error_of_a_part_is_raised_with_a_copy(tmp_path, monkeypatch):
    monkeypatch.setenv("FRACTALCONTACT_THREADS", "2")
    done, copies, _ = run_with_a_slow_start(tmp_path, FIVE_SHEARS, FAILING)
    assert copies == 1
    assert "shear: too far" in done.stderr
    assert len(list((tmp_path / "out" / ".stages").glob("joints.closure.*"))) == 3
