"""Many scans on worker processes against the same scans in one process.

    python scans.py                          # 60 scans of 512 x 512 points, two workers
    python scans.py --scans 200 --rounds 3

The command is `fractalcontact roughness`, with figures and reports, from the start of Python to its end, with
the kernels compiled before. The baseline has one process and one thread. The ideal share is its time over the
number of workers. Processor time is that of the parent and the longest worker together, which other work on
the machine changes little; wall time needs a machine without other work.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import fractalcontact as fc

TICK = os.sysconf("SC_CLK_TCK")  # of the times in /proc, per second
PAUSE = 0.1  # seconds between two looks at the processes


def make_scans(folder: Path, count: int, size: int) -> list[Path]:
    """Write synthetic scans of five exponents."""
    folder.mkdir(parents=True)
    files = []
    for seed in range(count):
        hurst = 0.4 + 0.1 * (seed % 5)
        surface = fc.surfaces.fbm((size, size), 2e-5, hurst=hurst, rms_increment=4e-6, rng=seed)
        files.append(fc.save(surface, folder / f"scan_{seed:03d}.nc"))
    return files


def times(files: list[Path], out: Path, workers: int) -> tuple[float, list[float]]:
    """Return the wall time of the command, and the processor time of each of its processes, own one first."""
    words = [sys.executable, "-m", "fractalcontact", "roughness", *files, "-o", out, "--quiet"]
    threads = {"FRACTALCONTACT_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    start, used = time.perf_counter(), dict[int, float]()
    process = subprocess.Popen(
        [*words, "--workers", str(workers)], env=os.environ | threads, start_new_session=True
    )
    while process.poll() is None:
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                fields = (folder / "stat").read_text().rpartition(")")[2].split()
            except OSError:  # it has ended
                continue
            if int(fields[3]) == process.pid:  # of its session
                used[int(folder.name)] = (int(fields[11]) + int(fields[12])) / TICK
        time.sleep(PAUSE)
    if process.returncode:
        raise SystemExit(process.returncode)
    seconds = time.perf_counter() - start
    own = used.pop(process.pid)
    return seconds, [own, *sorted(used.values(), reverse=True)]


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--scans", type=int, default=60)
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=1)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        files = make_scans(folder / "scans", options.scans, options.size)
        times(files[:2], folder / "warm", 0)  # compiles the kernels
        for number in range(options.rounds):
            wall, (alone, *_) = times(files, folder / f"one_{number}", 0)
            shared, (own, *others) = times(files, folder / f"shared_{number}", options.workers)
            parts = " ".join(f"{each:.1f}" for each in others)
            ratios = (own + others[0]) / (alone / options.workers), shared / (wall / options.workers)
            print(
                f"one process {alone:.1f} s ({wall:.1f} wall); {options.workers} workers: parent {own:.1f}, "
                f"others {parts} s ({shared:.1f} s wall); over the ideal share {ratios[0]:.2f} of processor "
                f"time, {ratios[1]:.2f} of wall time; load {os.getloadavg()[0]:.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
