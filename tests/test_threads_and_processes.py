"""Every public function that computes or reads, in threads, after a fork, and in new processes."""

import json
import multiprocessing
import subprocess
import sys
from pathlib import Path

import every_call
import pytest

MODES = [("threads", "fork"), ("forkserver", "spawn")]


def test_every_public_function_has_a_call():
    assert [name for name in every_call.names() if not every_call.has_call(name)] == []
    assert not (set(every_call.CALLS) | every_call.LEFT_OUT) - {*every_call.names(), *every_call.LEFT_OUT}


@pytest.mark.processes
@pytest.mark.parametrize("modes", MODES, ids=" and ".join)
def test_every_function_returns_the_same_numbers(modes):
    """The numbers of calls one after another; no call hangs, fails or ends the process."""
    modes = [mode for mode in modes if mode in ("threads", *multiprocessing.get_all_start_methods())]
    words = [sys.executable, Path(every_call.__file__), *modes]
    done = subprocess.run(words, capture_output=True, text=True, timeout=900, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    assert json.loads(done.stdout.splitlines()[-1]) == {}
