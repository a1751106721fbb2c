"""The command in processes of their own that copy one with the libraries imported and the kernels loaded.

Most of a short command is the import of the libraries: `study.command` starts a new interpreter for it.
"""

import atexit
import functools
import json
import os
import select
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

from study import SOUND

PATIENCE = 120.0  # seconds
SIZE = 8  # bytes of a number

SERVER = f"""
import gc, json, os, runpy, socket, sys
from fractalcontact.base.process import block_dask_import
block_dask_import()
from fractalcontact import scenes
scenes.run(sys.argv[1], out=os.path.dirname(sys.argv[1]), progress=False)
gc.freeze()  # a copy goes through the objects of its own only
orders = socket.socket(fileno=int(sys.argv[2]))
while True:
    task, places, *_ = socket.recv_fds(orders, 1 << 20, 2)
    if not task:
        raise SystemExit
    copy = os.fork()
    if not copy:
        break
    for place in places:
        os.close(place)
    orders.sendall(copy.to_bytes({SIZE}))
    orders.sendall(os.waitstatus_to_exitcode(os.waitpid(copy, 0)[1]).to_bytes({SIZE}, signed=True))
orders.close()
sys.argv, folder, environment, largest_file, program = json.loads(task)
if largest_file:
    import resource
    resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, largest_file))
os.environ.clear()
os.environ.update(environment)
os.chdir(folder)
for number, place in enumerate([os.open(os.devnull, os.O_RDONLY), *places]):
    os.dup2(place, number)
    os.close(place)
if program:
    exec(program)
else:
    runpy.run_module("fractalcontact", run_name="__main__", alter_sys=True)
"""


class Copy:
    """The command in a copy, with the calls of `subprocess.Popen` that tests use; one at a time.

    Parameters
    ----------
    words
        Of the command.
    largest_file : int
        The bytes that a file may have, on a disk that is full then.
    program : str
        Python that is run in place of the command.

    Attributes
    ----------
    pid, returncode : int
        Number of the process; how it ended, None before.
    """

    def __init__(self, *words, largest_file=None, program=None):
        self._out = tempfile.TemporaryFile()  # noqa: SIM115
        self._error, error = os.pipe()
        arguments = ["fractalcontact", *map(str, words)]
        task = arguments, str(Path.cwd()), dict(os.environ), largest_file, program
        socket.send_fds(_orders(), [json.dumps(task).encode()], [self._out.fileno(), error])
        os.close(error)
        self.pid, self.returncode = self._number(), None

    def poll(self):
        """Return how the copy ended, None if it runs."""
        if self.returncode is None and select.select([_orders()], [], [], 0)[0]:
            self.returncode = self._number()
        return self.returncode

    def communicate(self):
        """Wait until every process has closed its standard error; return what was printed, and the errors."""
        errors = b""
        while True:
            assert select.select([self._error], [], [], PATIENCE)[0], errors
            if not (content := os.read(self._error, 1 << 16)):
                break
            errors += content
        os.close(self._error)
        self.returncode = self._number() if self.returncode is None else self.returncode
        self._out.seek(0)
        with self._out:
            return self._out.read().decode(), errors.decode()

    @staticmethod
    def _number():
        return int.from_bytes(_orders().recv(SIZE, socket.MSG_WAITALL), signed=True)


def copied_command(*words, **options):
    """Run the command in a copy; return what `subprocess.run` returns."""
    copy = Copy(*words, **options)
    out, errors = copy.communicate()
    return subprocess.CompletedProcess(words, copy.returncode, out, errors)


@functools.cache
def _orders():
    """Start the process that is copied, which ends with this one; return the socket for orders."""
    folder = tempfile.TemporaryDirectory()
    scene = Path(folder.name, "study.toml")
    scene.write_text(SOUND, encoding="utf-8")
    ours, theirs = socket.socketpair()
    with theirs:
        ours.settimeout(PATIENCE)
        words = [sys.executable, "-c", SERVER, scene, str(theirs.fileno())]
        # with one thread no thread is started, and a copy has all that the process had
        environment = os.environ | {"FRACTALCONTACT_THREADS": "1"}
        server = subprocess.Popen(words, pass_fds=[theirs.fileno()], env=environment)
    atexit.register(lambda: (ours.close(), server.wait(), folder.cleanup()))
    return ours
