"""Time, pairs of transforms and memory of one contact solution against the number of points.

    python large_grids.py                                   # 64 to 1024 points along an axis
    python large_grids.py --sizes 4096,8192,16384 --boundaries periodic --out large

A self-affine surface of H = 0.8 with all its waves and an rms slope of 0.1 is pressed once to 0.01 of the
modulus, tolerance 1e-6, each case in a process of its own. The peak is that of the process, Python and the
surface included. Adds a line for each case to `large.csv` in `--out`, and prints the exponents of growth.
"""

from __future__ import annotations

import argparse
import csv
import multiprocessing
import time
from pathlib import Path
from typing import Any

import numpy as np

import fractalcontact as fc
from fractalcontact.base.process import peak_memory
from fractalcontact.base.resources import thread_count

PRESSURE, TOLERANCE = 0.01, 1e-6


def pressed(case: tuple[int, str, int]) -> dict[str, Any]:
    """Press one surface; of several times the least one."""
    n, boundary, rounds = case
    small = fc.surfaces.spectral((128, 128), 1 / 128, hurst=0.8, rms_slope=0.1, rng=1)
    options = {"contact_modulus": 1.0, "nominal_pressure": PRESSURE, "tolerance": TOLERANCE, "keep": ()}
    options |= {"boundary": boundary, "influence": "spectral" if boundary == "periodic" else "square"}
    fc.contact.press(small, **options)  # compiled
    surface = fc.surfaces.spectral((n, n), 1 / n, hurst=0.8, rms_slope=0.1, rng=1)
    seconds = []
    for _ in range(rounds):
        start = time.perf_counter()
        result = fc.contact.press(surface, **options)
        seconds.append(time.perf_counter() - start)
    return {
        "date": time.strftime("%Y-%m-%d"),
        "n": n,
        "boundary": boundary,
        "threads": thread_count(),
        "seconds": min(seconds),
        "pairs": int(result["transforms"].item()),
        "residual": float(result["residual"].item()),
        "contact_fraction": float(result["contact_fraction"].item()),
        "peak_bytes": peak_memory(),
    }


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--sizes", default="64,128,256,512,1024")
    parser.add_argument("--boundaries", default="periodic,free")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--out", type=Path, default=Path("large"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    target = options.out / "large.csv"
    for boundary in options.boundaries.split(","):
        rows = []
        for n in map(int, options.sizes.split(",")):
            with multiprocessing.get_context("spawn").Pool(1) as pool:
                row = pool.map(pressed, [(n, boundary, options.rounds)])[0]
            rows.append(row)
            print(row, flush=True)
            is_new = not target.exists()
            with target.open("a", newline="", encoding="utf-8") as stream:
                writer = csv.DictWriter(stream, list(row))
                if is_new:
                    writer.writeheader()
                writer.writerow(row)
        if len(rows) > 1:
            n = np.log([row["n"] for row in rows])
            for name in ("pairs", "seconds"):
                print(boundary, name, f"grow as n^{np.polyfit(n, np.log([r[name] for r in rows]), 1)[0]:.2f}")


if __name__ == "__main__":
    main()
