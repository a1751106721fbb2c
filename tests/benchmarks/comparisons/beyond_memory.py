"""Peak memory and processor time of functions that read dask arrays block by block.

    python beyond_memory.py                                     # all at 8192 x 8192 points
    python beyond_memory.py --sizes 32768 --only islands,spectrum

Heights are float32 blocks of 2048 x 2048 made as they are read: two periodic self-affine tiles of other
periods (H = 0.5), added. Masks are the highest tenth of them. Each case is a process of its own; the peak is
that of the process, Python and the libraries included.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import time
from typing import Any

import numpy as np
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.process import peak_memory

BLOCK, PERIODS, SPACING = 2048, (1536, 2000), 1e-6
HIGHEST = 0.9  # quantile above which a height is in the mask


def tiles() -> list[np.ndarray[Any, Any]]:
    """Return the two periodic tiles."""
    make = fc.surfaces.spectral
    made = [make((n, n), SPACING, hurst=0.5, rms_slope=0.1, rng=n) for n in PERIODS]
    return [surface.values.astype(np.float32) for surface in made]


def heights(n: int) -> xr.DataArray:
    """Return the surface as a dask array."""
    import dask.array as da

    parts = tiles()

    def block(block_info: Any) -> np.ndarray[Any, Any]:
        rows, columns = (np.arange(*ends) for ends in block_info[None]["array-location"])
        return sum(part[np.ix_(rows % len(part), columns % len(part))] for part in parts)  # type: ignore[return-value]

    chunks = (min(BLOCK, n),) * (n // min(BLOCK, n))
    array = da.map_blocks(block, chunks=(chunks, chunks), dtype=np.float32, meta=np.empty((0, 0), np.float32))
    return fc.surfaces.from_array(array, SPACING)


def mask(n: int) -> xr.DataArray:
    """Return the highest part of the surface."""
    few = sum(part[:BLOCK:3, :BLOCK:3][:500, :500] for part in tiles())
    return heights(n) > float(np.quantile(few, HIGHEST))


CASES = {
    "variogram": lambda n: fc.dimensions.variogram(heights(n)),
    "increments": lambda n: fc.dimensions.estimate(heights(n), "increments"),
    "estimate": lambda n: fc.dimensions.estimate(heights(n)),
    "spectrum": lambda n: fc.dimensions.spectrum(heights(n)),
    "describe": lambda n: fc.surfaces.describe(heights(n)),
    "islands": lambda n: fc.domains.islands(mask(n), keep=()),
    "box_dimension": lambda n: fc.domains.box_dimension(mask(n)),
    "lacunarity": lambda n: fc.domains.lacunarity(mask(n)),
}


def measured(case: tuple[str, int]) -> str:
    """Return a row of the table."""
    name, n = case
    start, used = time.perf_counter(), time.process_time()
    result = CASES[name](n)
    seconds, wall = time.process_time() - used, time.perf_counter() - start
    first = {key: np.ravel(value)[:3].tolist() for key, value in list(result.data_vars.items())[:2]}
    load = os.getloadavg()[0]
    times = f"{seconds:8.0f} s {wall:8.0f} s wall {peak_memory() / 2**30:6.2f} GiB, load {load:.1f}"
    return f"{name:14s} {n:6d} {times} {first}"


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--sizes", default="8192")
    parser.add_argument("--only", default=",".join(CASES))
    options = parser.parse_args()
    for n in map(int, options.sizes.split(",")):
        for name in options.only.split(","):
            with multiprocessing.get_context("spawn").Pool(1) as pool:
                try:
                    print(pool.map(measured, [(name, n)])[0], flush=True)
                except fc.base.errors.FractalContactError as error:
                    print(f"{name:14s} {n:6d} refused: {error}", flush=True)


if __name__ == "__main__":
    main()
