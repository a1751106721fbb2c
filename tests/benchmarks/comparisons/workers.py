"""Benchmark of ensembles on worker processes against the same ensemble in one process.

    python workers.py                                  # 16 members of 128 x 128 points
    python workers.py --sizes 128,512 --members 64 --rounds 3 --out sweeps

The study presses each member at four loads after three shears and measures its roughness and its contact.
Every run is a process of its own, from the start of Python to its end, with the kernels compiled before. The
baseline has one process and one thread, as each worker has one thread; `threads` is one process with all
processors. The runs follow each other `--rounds` times, with files written and without, and ratios are formed
within each round. Writes `sweeps.csv` into `--out`.
"""

from __future__ import annotations

import argparse
import csv
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

SCENE = """title = "ensemble"
[surface]
generate = "fbm"
shape = [{n}, {n}]
spacing = 1e-4
hurst = 0.8
rms_increment = 4e-6
rng = 5
members = {members}
[material]
young = 30e9
poisson = 0.2
[joint]
block = {block}
direction = "W"
shear = [1e-4, 4e-4, 1e-3]
normal_force = [1.0, 10.0, 100.0, 300.0]
[want]
joints = ["closure", "rigid_dilatancy"]
dimensions = ["default"]
domains = ["box_dimension"]
"""
CODE = """
import sys, time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
import fractalcontact as fc

if __name__ == "__main__":
    scene, few, workers, out, ready = sys.argv[1:]
    options = {"out": out or None, "progress": False}
    if ready:
        workers = int(workers)
        client = ProcessPoolExecutor(workers, mp_context=get_context("forkserver")) if workers else None
        for _ in range(2):
            fc.scenes.run(few, client=client, progress=False)
        start = time.perf_counter()
        fc.scenes.run(scene, client=client, **options)
        print(time.perf_counter() - start)
    else:
        fc.scenes.run(scene, workers=int(workers), **options)
"""
WAYS = {"one thread": (0, 1), "threads": (0, 0), "workers": (2, 0)}  # workers and threads of a process


def seconds(scene: Path, few: Path, workers: int, threads: int, *, out: bool, ready: bool) -> float:
    """Return the wall time of a study in a process of its own, or its time where all has started."""
    environment = os.environ | ({"FRACTALCONTACT_THREADS": str(threads)} if threads else {})
    if ready:
        environment["OPENBLAS_NUM_THREADS"] = "1"  # of workers that the user starts
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / "study.py"
        script.write_text(CODE)
        target = str(Path(folder) / "out") if out else ""
        arguments = [sys.executable, script, scene, few, str(workers), target, "ready" if ready else ""]
        start = time.perf_counter()
        done = subprocess.run(arguments, env=environment, check=True, capture_output=True, text=True)
        return float(done.stdout) if ready else time.perf_counter() - start


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--sizes", default="128")
    parser.add_argument("--members", type=int, default=16)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", default="memory,files", help="of memory, files")
    parser.add_argument("--ready", action="store_true", help="the second study of processes that go on")
    parser.add_argument("--out", default="sweeps")
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    folder = Path(options.out)
    folder.mkdir(parents=True, exist_ok=True)
    for n in map(int, options.sizes.split(",")):
        scene = folder / f"ensemble_{n}.toml"
        scene.write_text(SCENE.format(n=n, members=options.members, block=n * 1e-4 / 2))
        few = folder / "few.toml"
        few.write_text(SCENE.format(n=n, members=2, block=n * 1e-4 / 2))
        seconds(few, few, 0, 0, out=True, ready=False)  # compiles the kernels
        for kept in options.only.split(","):
            rounds = [
                {
                    way: seconds(scene, few, *how, out=kept == "files", ready=options.ready)
                    for way, how in WAYS.items()
                }
                for _ in range(options.rounds)
            ]
            for way in WAYS:
                times = [lap[way] for lap in rounds]
                speedup = [lap["one thread"] / lap[way] for lap in rounds]
                row = {"n": n, "members": options.members, "kept": kept, "way": way}
                row["start"] = "not counted" if options.ready else "counted"
                row |= {"time": min(times), "time_median": statistics.median(times)}
                row |= {"ratio": statistics.median(speedup), "ratio_min": min(speedup)}
                rows.append(row | {"load_average": os.getloadavg()[0]})
                print(
                    f"{n:5d} {options.members} members, {kept:7s} {way:11s} {min(times):8.2f} s, "
                    f"{row['ratio']:.2f} times one thread (least {row['ratio_min']:.2f})",
                    flush=True,
                )
    with (folder / "sweeps.csv").open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
