"""Measures of sets whose dimension, lacunarity or moments are known in closed form."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact import domains, surfaces
from fractalcontact.accuracy._benchmarks import Array, Benchmark, Method, largest_error, value_of

# an octave each
SIZES = (64, 128, 256, 512, 1024)
HURST = 0.5  # of level sets, of dimension 1.5: half-way between line and plane
COVERAGE, BOX = 0.1, 4  # share of the cells, box in cells: the lacunarity is then 1.56
# of a cascade, unequal and 1 in all: each order has a dimension of its own
WEIGHTS = np.array([[0.4, 0.3], [0.2, 0.1]])
ORDERS = (0.0, 2.0, 3.0)  # support, pairs, triples; the closed form has no value at 1
# site percolation on the square lattice: coverage (Jacobsen, J. Phys. A 48:454003 (2015); Newman and Ziff,
# Phys. Rev. Lett. 85:4104 (2000), had .59274621(13)), islands per cell, and the excess of a periodic mask
# (Ziff, Finch and Adamchik, Phys. Rev. Lett. 79:3447 (1997))
CRITICAL, PER_CELL, EXCESS = 0.59274605, 0.0275981, 0.8835
CROSSINGS = 64  # the share that crosses is then known to 1/16, sqrt(.25/64)
REPLICATES = 8  # random masks: the rms error is then known to a quarter, 1/sqrt(2 n); the first is timed
CARPET = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], bool)


def benchmarks() -> tuple[Benchmark, ...]:
    """Return the benchmarks of the domain measures."""
    sierpinski = largest_error(np.log(8) / np.log(3))
    on_carpet = {
        "box dimension, minimum cover": value_of(domains.box_dimension, "box_dimension", cover="minimum"),
        "box dimension, mean cover": value_of(domains.box_dimension, "box_dimension", cover="mean"),
        "correlation dimension": value_of(domains.correlation_dimension, "correlation_dimension"),
        "Minkowski dimension": value_of(domains.minkowski_dimension, "minkowski_dimension"),
    }
    boundary = value_of(domains.boundary_dimension, "boundary_dimension")
    boxes = value_of(domains.box_dimension, "box_dimension")
    cascade = value_of(domains.generalised_dimensions, "generalised_dimension", q=ORDERS)
    moments = np.array([np.log2(np.sum(WEIGHTS**q)) / (1.0 - q) for q in ORDERS])
    islands = value_of(domains.islands, "n_islands", periodic=True, keep=())
    density = largest_error(lambda n: PER_CELL * n**2 + EXCESS, relative=True)
    return (
        Benchmark(
            "carpet of Sierpinski, cut",
            "error of the dimension",
            "log 8 / log 3; the cut fits no grid of boxes",
            tuple(Method(name, SIZES, _carpet, solve, sierpinski) for name, solve in on_carpet.items()),
            equal_parameters=True,
        ),
        Benchmark(
            "boundary of a level set",
            f"root mean square error of the dimension over {REPLICATES} surfaces",
            f"2 - H for an exact fractional Brownian surface, H = {HURST}",
            (
                _random_method("boundary dimension", _level_set, boundary, 2.0 - HURST),
                _random_method("box dimension of the boundary cells", _boundary_cells, boxes, 2.0 - HURST),
            ),
            equal_parameters=True,
        ),
        Benchmark(
            "independent cells",
            f"root mean square relative error of the lacunarity less one, over {REPLICATES} masks",
            f"(1 - p)/(p r^2) for independent cells, p = {COVERAGE}, boxes of {BOX}",
            tuple(_lacunarity_method(boxes) for boxes in ("gliding", "fixed")),
            equal_parameters=True,
        ),
        Benchmark(
            "multiplicative cascade",
            "largest error of D_q at q = 0, 2, 3",
            "log2 of the sum of the four weights to the power q, over 1 - q",
            (Method("generalised dimensions", SIZES, _cascade, cascade, largest_error(moments)),),
        ),
        Benchmark(
            "carpet of Sierpinski at three resolutions",
            "error of the dimension",
            "log 8 / log 3",
            (
                Method(
                    "area dimension",
                    (27, 81, 243, 729),  # powers of 3, on which the carpet is whole
                    _resolutions,
                    value_of(domains.area_dimension, "area_dimension"),
                    sierpinski,
                ),
            ),
        ),
        Benchmark(
            "number of islands at the critical coverage",
            "relative error of the islands for each cell, one periodic mask",
            f"{PER_CELL} + {EXCESS}/n^2 (Ziff, Finch and Adamchik 1997); the random scatter is about 1/n",
            (Method("islands", SIZES, _critical, islands, density),),
            equal_parameters=True,
        ),
        Benchmark(
            "crossing at the critical coverage",
            f"error of the share of {CROSSINGS} masks that are crossed along x",
            "1/2 for large masks, by symmetry and universality (Cardy 1992); the random scatter is .06",
            (Method("percolation", SIZES[:3], _critical, _crosses, _crossing_error),),
            equal_parameters=True,
        ),
    )


def _mask(values: Any) -> xr.DataArray:
    return xr.DataArray(np.asarray(values, bool), dims=("y", "x"))


def _random_method(
    name: str,
    make: Callable[[float, int], xr.DataArray],
    solve: Callable[[xr.DataArray], Array],
    truth: float,
    scale: float = 1.0,
) -> Method:
    """Return a method with the errors of a measure, over `scale`, on independent masks of one size."""

    def errors(_: Any, n: float) -> Array:
        return np.array([solve(make(n, seed)) for seed in range(REPLICATES)]) / scale - truth / scale

    return Method(name, SIZES, lambda n: make(n, 0), solve, errors)


def _lacunarity_method(boxes: str) -> Method:
    exact = 1.0 + (1.0 - COVERAGE) / (COVERAGE * BOX**2)
    solve = value_of(domains.lacunarity, "lacunarity", box_sizes=[BOX], boxes=boxes, periodic=False)
    return _random_method(f"lacunarity, {boxes} boxes", _independent_cells, solve, exact, exact - 1.0)


def _stream(n: float, seed: int) -> np.random.Generator:
    return np.random.default_rng(int(n) if seed == 0 else (int(n), seed))


@lru_cache(maxsize=8)  # the sizes of a benchmark
def _carpet(n: float) -> xr.DataArray:
    mask = np.ones((1, 1), bool)
    while mask.shape[0] < n:
        mask = np.kron(mask, CARPET).astype(bool)
    return _mask(mask[: int(n), : int(n)])


@lru_cache(maxsize=2 * REPLICATES)
def _level_set(n: float, seed: int) -> xr.DataArray:
    size = (int(n), int(n))
    heights = surfaces.fbm(size, 1.0, hurst=HURST, rms_increment=1.0, rng=_stream(n, seed)).values
    return _mask(heights > np.median(heights))


def _boundary_cells(n: float, seed: int) -> xr.DataArray:
    inside = _level_set(n, seed).values
    edge = np.zeros_like(inside)
    edge[:, :-1] |= inside[:, 1:] != inside[:, :-1]
    edge[:-1] |= inside[1:] != inside[:-1]
    return _mask(edge)


def _independent_cells(n: float, seed: int) -> xr.DataArray:
    return _mask(_stream(n, seed).random((int(n), int(n))) < COVERAGE)


def _resolutions(n: float) -> list[xr.DataArray]:
    masks = []
    for size in (int(n) // 9, int(n) // 3, int(n)):
        places = (np.arange(size) + 0.5) / size
        masks.append(_carpet(size).assign_coords(y=places, x=places))
    return masks


def _critical(n: float, seed: int = 0) -> xr.DataArray:
    return _mask(np.random.default_rng((int(n), seed)).random((int(n), int(n))) < CRITICAL)


def _crosses(mask: xr.DataArray) -> bool:
    return bool(domains.percolation(mask, periodic=False)["percolates"].sel(axis="x"))


def _crossing_error(_: bool, n: float) -> float:
    return float(abs(np.mean([_crosses(_critical(n, seed)) for seed in range(CROSSINGS)]) - 0.5))


def _cascade(n: float) -> xr.DataArray:
    measure = np.ones((1, 1))
    while measure.shape[0] < n:
        measure = np.kron(measure, WEIGHTS)
    return xr.DataArray(measure, dims=("y", "x"))
