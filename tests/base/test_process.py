"""Peak memory of the process, calls shared with a copy of it, and saving a file without importing dask."""

import multiprocessing
import os
import subprocess
import sys
import threading
import time
import warnings
from pathlib import Path

import pytest
from copies import copied_command

from fractalcontact.base import resources
from fractalcontact.base.process import calls_in_two_processes, peak_memory


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
    done = copied_command(tmp_path / "surface.nc", program=code)
    assert (done.stdout.strip(), done.returncode) == ("[]", 0), done.stderr


def test_only_a_command_of_its_own_process_collects_rarely():
    code = "import gc; usual = gc.get_threshold()[0]; from fractalcontact.cli import main; main({}); "
    code += "print(usual, gc.get_threshold()[0])"
    found = []
    for words in ("", "['methods']"):
        command = [sys.executable, "-c", code.format(words), "methods"]
        printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        found.append([int(number) for number in printed.splitlines()[-1].split()])
    (usual, rare), (_, kept) = found
    assert (rare, kept) == (50_000, usual)


COUNT = 12
EVERY = [(number, number**2) for number in range(COUNT)]


@pytest.fixture
def note(tmp_path, monkeypatch):
    """Return a function that notes in a file which process called it; two processors are available."""
    monkeypatch.setenv("FRACTALCONTACT_THREADS", "2")

    def note(number):
        time.sleep(0.02)
        with (tmp_path / str(number)).open("a") as file:
            file.write(f"{os.getpid()} ")
        return number**2

    note.callers = lambda: [(tmp_path / str(number)).read_text().split() for number in range(COUNT)]
    return note


def alone():
    """Whether no thread keeps this process from being copied; that of a progress bar does not."""
    others = [each for each in threading.enumerate() if each.name != resources.NAME]
    others = [each for each in others if type(each).__name__ != "TMonitor"]
    return sys.platform == "linux" and others == [threading.main_thread()]


def test_every_call_is_made_once_by_one_of_two_processes(note):
    assert sorted(calls_in_two_processes(note, COUNT)) == EVERY
    callers = note.callers()
    assert all(len(each) == 1 for each in callers)
    assert len({each[0] for each in callers}) == (2 if alone() else 1)
    assert callers[0] == [str(os.getpid())]


LATER = """
import sys, time
from pathlib import Path
from fractalcontact.base.process import calls_in_two_processes

begun, done = Path(sys.argv[1]), []


def call(number):
    if number:
        begun.touch()
        time.sleep(0.2)
    while not begun.exists():
        time.sleep(0.01)


for number, _ in calls_in_two_processes(call, 2, lambda: done.append("later")):
    assert done == ["later"] * number  # call 1 is that of the copy
assert done == ["later"]
"""


@pytest.mark.skipif(sys.platform != "linux", reason="no process is copied")
def test_what_is_needed_later_is_done_before_the_wait_for_the_copy(tmp_path):
    # in a process of its own: a worker of the tests has threads, so that it is not copied
    command = [sys.executable, "-c", LATER, str(tmp_path / "begun")]
    subprocess.run(command, check=True, timeout=60, env={**os.environ, "FRACTALCONTACT_THREADS": "2"})


@pytest.mark.parametrize("end", [lambda: os._exit(1), lambda: 1 / 0])
def test_calls_that_the_copy_does_not_end_are_made_here(note, end):
    own = os.getpid()

    def call(number):
        if os.getpid() != own:
            end()
        return note(number)

    assert sorted(calls_in_two_processes(call, COUNT)) == EVERY
    assert note.callers() == [[str(own)]] * COUNT


def test_error_of_a_call_is_raised_and_ends_the_copy(note):
    def call(number):
        note(number)
        if number == 3:
            raise OSError(28, "no space")

    with pytest.raises(OSError, match="no space"):
        list(calls_in_two_processes(call, COUNT))
    assert multiprocessing.active_children() == []


def test_large_results_and_warnings_of_the_copy_come_back(note):
    def call(number):
        warnings.warn(f"number {number}", UserWarning, stacklevel=1)
        return number, bytes(1 << 20), note(number)

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        results = dict(calls_in_two_processes(call, COUNT))
    assert results == {number: (number, bytes(1 << 20), number**2) for number in range(COUNT)}
    assert sorted(str(each.message) for each in caught) == sorted(f"number {n}" for n in range(COUNT))


@pytest.mark.skipif(sys.platform != "linux", reason="no process is copied")
def test_copy_ends_with_a_process_that_is_killed(tmp_path):
    code = (
        "import os, signal, sys, time; from fractalcontact.base.process import calls_in_two_processes\n"
        "own, folder = os.getpid(), sys.argv[1]\n"
        "def call(number):\n"
        "    if os.getpid() != own:\n"
        "        open(f'{folder}/copy', 'w').write(str(os.getpid()))\n"
        "    time.sleep(60 if os.path.exists(f'{folder}/copy') else 0.01)\n"
        "for number, _ in calls_in_two_processes(call, 9999): pass\n"
    )
    environment = {**os.environ, "FRACTALCONTACT_THREADS": "2"}
    with subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], env=environment) as process:
        while not ((file := tmp_path / "copy").exists() and file.read_text()):
            time.sleep(0.01)
        process.kill()
    number = int((tmp_path / "copy").read_text())
    for _ in range(1000):
        if not Path(f"/proc/{number}").exists():
            return
        time.sleep(0.01)
    raise AssertionError("the copy goes on")


@pytest.mark.parametrize("reason", ["one processor", "a worker", "another thread", "not the main thread"])
def test_process_is_not_copied_where_that_is_unsafe_or_useless(note, monkeypatch, reason):
    numbers, done = [], threading.Event()
    if reason == "one processor":
        monkeypatch.setenv("FRACTALCONTACT_THREADS", "1")
        numbers = list(calls_in_two_processes(note, COUNT))
    elif reason == "a worker":
        monkeypatch.setattr("multiprocessing.parent_process", lambda: "the process that started this one")
        numbers = list(calls_in_two_processes(note, COUNT))
    elif reason == "another thread":
        other = threading.Thread(target=done.wait)
        other.start()
        numbers = list(calls_in_two_processes(note, COUNT))
        done.set()
        other.join()
    else:
        other = threading.Thread(target=lambda: numbers.extend(calls_in_two_processes(note, COUNT)))
        other.start()
        other.join()
    assert numbers == EVERY
    assert note.callers() == [[str(os.getpid())]] * COUNT
