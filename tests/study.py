"""A small sound scene, and the command run as a user runs it."""

import contextlib
import functools
import importlib
import io
import os
import subprocess
import sys
import warnings

from fractalcontact.cli import main

SOUND = """
title = "a small study"
[surface]
generate = "fbm"
shape = [48, 48]
spacing = 1e-4
hurst = 0.8
rms_increment = 4e-6
rng = 5
[material]
young = 30e9
poisson = 0.2
[joint]
block = 2.4e-3
direction = "W"
shear = [1e-4, 4e-4]
normal_force = [1.0, 10.0]
[want]
joints = ["closure", "rigid_dilatancy"]
"""


def command(*words):
    environment = {key: value for key, value in os.environ.items() if key != "NO_SUCH_VARIABLE"}
    return subprocess.run(
        [sys.executable, "-m", "fractalcontact", *map(str, words)],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
    )


def command_here(*words):
    """Run the command in this process: most of a short command is the import of the libraries."""
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error), warnings.catch_warnings():
        warnings.simplefilter("default")
        code = main([str(word) for word in words])
    return subprocess.CompletedProcess(words, code, out.getvalue(), error.getvalue())


# the public functions that the stages of a study call
FUNCTIONS = {
    "surfaces": ("describe",),
    "dimensions": ("estimate", "spectrum", "variogram", "cube_counts"),
    "contact": ("press",),
    "joints": (
        "delta_surface",
        "closure",
        "dilatancy",
        "friction",
        "decorrelation_length",
        "transmissivity",
        "area_by_resolution",
        "self_weight",
    ),
    "domains": ("box_dimension", "lacunarity", "islands", "evolution"),
}


def watch_calls(monkeypatch, before):
    """Call `before(name)` before each computation of a public function that a study calls."""
    for subpackage, names in FUNCTIONS.items():
        module = importlib.import_module(f"fractalcontact.{subpackage}")
        for name in names:
            monkeypatch.setattr(module, name, _watched(getattr(module, name), before))


def _watched(function, before):
    @functools.wraps(function)
    def call(*arguments, **options):
        before(function.__name__)
        return function(*arguments, **options)

    return call
