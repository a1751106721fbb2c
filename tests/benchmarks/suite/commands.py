"""Elapsed time of the command: its start, and the shipped study with and without compiled kernels."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

SCENE = Path(__file__).resolve().parents[3] / "datasets" / "concrete_crack.toml"


def command(*words: str, **environment: str) -> None:
    """Run the command in a process of its own."""
    subprocess.run(
        [sys.executable, "-m", "fractalcontact", *words],
        env=os.environ | environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        check=True,
    )


class Start:
    """The start of the command, which a person waits for."""

    def time_version(self) -> None:
        """Time what loads nothing."""
        command("--version")

    def time_methods(self) -> None:
        """Time a list of the estimators."""
        command("methods")

    def timeraw_import(self) -> str:
        """Time the import of the package."""
        return "import fractalcontact"


class Study:
    """The shipped study, from the start of the process to its end."""

    number, repeat, warmup_time, timeout = 1, 3, 0.0, 600

    def setup(self) -> None:
        """Run once, so that kernels are compiled."""
        self.folder = tempfile.TemporaryDirectory()
        self.time_warm()

    def teardown(self) -> None:
        """Remove the results."""
        self.folder.cleanup()

    def time_warm(self) -> None:
        """Time a run with the kernels of an earlier one."""
        with tempfile.TemporaryDirectory(dir=self.folder.name) as out:
            command("run", str(SCENE), "-o", out, "--quiet")

    def time_cold(self) -> None:
        """Time a run that compiles its kernels."""
        with tempfile.TemporaryDirectory(dir=self.folder.name) as out:
            command("run", str(SCENE), "-o", out, "--quiet", NUMBA_CACHE_DIR=f"{out}/kernels")
