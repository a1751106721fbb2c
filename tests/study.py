"""A small sound scene, and the command run as a user runs it."""

import os
import subprocess
import sys

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
