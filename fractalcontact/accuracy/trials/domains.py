"""Measures of sets whose dimension, lacunarity or moments are known in closed form."""

from __future__ import annotations

from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.accuracy.trials.trial import Contest, Experiment

if TYPE_CHECKING:
    import xarray as xr

SIZES = (64, 128, 256, 512, 1024)
HURST, COVERAGE, BOX = 0.5, 0.1, 4
WEIGHTS = np.array([[0.4, 0.3], [0.2, 0.1]])
ORDERS = (0.0, 2.0, 3.0)
# site percolation on the square lattice: coverage, islands for each cell, and what a periodic mask has more
CRITICAL, PER_CELL, EXCESS = 0.59274605, 0.0275981, 0.8835
CROSSINGS = 64


def contests() -> tuple[Contest, ...]:
    """Return what is measured of the domain measures."""
    from fractalcontact import domains as room

    ways: dict[str, tuple[str, dict[str, Any]]] = {
        "box dimension, minimum cover": ("box_dimension", {"cover": "minimum"}),
        "box dimension, mean cover": ("box_dimension", {"cover": "mean"}),
        "correlation dimension": ("correlation_dimension", {}),
        "Minkowski dimension": ("minkowski_dimension", {}),
    }
    carpet = tuple(
        Experiment(name, SIZES, _carpet, partial(_number, function, function, options), _carpet_error)
        for name, (function, options) in ways.items()
        if function in room.__all__
    )
    boundary = (
        Experiment(
            "boundary dimension",
            SIZES,
            _level_set,
            partial(_number, "boundary_dimension", "boundary_dimension", {}),
            lambda found, _: abs(found - (2.0 - HURST)),
        ),
        Experiment(
            "box dimension of the boundary cells",
            SIZES,
            lambda n: _boundary(_level_set(n)),
            partial(_number, "box_dimension", "box_dimension", {}),
            lambda found, _: abs(found - (2.0 - HURST)),
        ),
    )
    lacunarity = tuple(
        Experiment(f"lacunarity, {boxes} boxes", SIZES, _dust, partial(_lacunarity, boxes), _dust_error)
        for boxes in ("gliding", "fixed")
    )
    several = Experiment("area dimension", (27, 81, 243, 729), _resolutions, _area_dimension, _carpet_error)
    islands = Experiment("islands", SIZES, _critical, _island_density, _islands_error)
    crossing = Experiment("percolation", SIZES[:3], _critical, _crosses, _crossing_error)
    moments = Experiment("generalised dimensions", SIZES, _cascade, _moments, _moments_error)
    return (
        Contest(
            "carpet of Sierpinski, cut",
            "error of the dimension",
            "log 8 / log 3; the cut fits no grid of boxes",
            carpet,
            given=True,
        ),
        Contest(
            "boundary of a level set",
            "error of the dimension, one surface",
            f"2 - H for an exact fractional Brownian surface, H = {HURST}",
            boundary,
            given=True,
        ),
        Contest(
            "random dust",
            "relative error of the lacunarity less one, one mask",
            f"(1 - p)/(p r^2) for independent cells, p = {COVERAGE}, boxes of {BOX}",
            lacunarity,
            given=True,
        ),
        Contest(
            "multiplicative cascade",
            "largest error of D_q at q = 0, 2, 3",
            "log2 of the sum of the four weights to the power q, over 1 - q",
            (moments,),
        ),
        Contest(
            "carpet of Sierpinski at three resolutions",
            "error of the dimension",
            "log 8 / log 3",
            (several,),
        ),
        Contest(
            "number of islands at the critical coverage",
            "relative error of the islands for each cell, one periodic mask",
            f"{PER_CELL} + {EXCESS}/n^2 (Ziff, Finch and Adamchik 1997); chance leaves some 1/n",
            (islands,),
            given=True,
        ),
        Contest(
            "crossing at the critical coverage",
            f"error of the share of {CROSSINGS} masks that are crossed along x",
            "1/2 for large masks, by symmetry and universality (Cardy 1992); chance leaves .06",
            (crossing,),
            given=True,
        ),
    )


def _mask(values: Any) -> xr.DataArray:
    import xarray as xr

    return xr.DataArray(np.asarray(values, bool), dims=("y", "x"))


@lru_cache(maxsize=8)
def _carpet(n: float) -> xr.DataArray:
    mask = np.ones((1, 1), bool)
    while mask.shape[0] < n:
        mask = np.kron(mask, np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], bool)).astype(bool)
    return _mask(mask[: int(n), : int(n)])


@lru_cache(maxsize=8)
def _level_set(n: float) -> xr.DataArray:
    from fractalcontact import surfaces

    face = surfaces.fbm((int(n), int(n)), 1.0, hurst=HURST, rms_increment=1.0, rng=int(n)).values
    return _mask(face > np.median(face))


def _boundary(mask: xr.DataArray) -> xr.DataArray:
    inside = mask.values
    edge = np.zeros_like(inside)
    edge[:, :-1] |= inside[:, 1:] != inside[:, :-1]
    edge[:-1] |= inside[1:] != inside[:-1]
    return _mask(edge)


def _number(function: str, name: str, options: dict[str, Any], mask: xr.DataArray) -> float:
    from fractalcontact import domains as room

    return float(getattr(room, function)(mask, **options)[name])


def _carpet_error(dimension: float, _: float) -> float:
    return float(abs(dimension - np.log(8) / np.log(3)))


def _dust(n: float) -> xr.DataArray:
    return _mask(np.random.default_rng(int(n)).random((int(n), int(n))) < COVERAGE)


def _lacunarity(boxes: str, mask: xr.DataArray) -> float:
    from fractalcontact import domains as room

    return float(room.lacunarity(mask, [BOX], boxes=boxes, periodic=False)["lacunarity"].squeeze())


def _dust_error(found: float, _: float) -> float:
    return float(abs((found - 1.0) / ((1.0 - COVERAGE) / (COVERAGE * BOX**2)) - 1.0))


def _resolutions(n: float) -> list[xr.DataArray]:
    masks = []
    for size in (int(n) // 9, int(n) // 3, int(n)):
        places = (np.arange(size) + 0.5) / size
        masks.append(_carpet(size).assign_coords(y=places, x=places))
    return masks


def _area_dimension(masks: list[xr.DataArray]) -> float:
    from fractalcontact import domains as room

    return float(room.area_dimension(masks)["area_dimension"])


def _critical(n: float, seed: int = 0) -> xr.DataArray:
    return _mask(np.random.default_rng((int(n), seed)).random((int(n), int(n))) < CRITICAL)


def _island_density(mask: xr.DataArray) -> float:
    from fractalcontact import domains as room

    return float(room.islands(mask, periodic=True, keep=())["n_islands"]) / mask.size


def _islands_error(density: float, n: float) -> float:
    return float(abs(density / (PER_CELL + EXCESS / n**2) - 1.0))


def _crosses(mask: xr.DataArray) -> bool:
    from fractalcontact import domains as room

    return bool(room.percolation(mask, periodic=False)["percolates"].sel(axis="x"))


def _crossing_error(_: bool, n: float) -> float:
    return float(abs(np.mean([_crosses(_critical(n, seed)) for seed in range(CROSSINGS)]) - 0.5))


def _cascade(n: float) -> xr.DataArray:
    import xarray as xr

    measure = np.ones((1, 1))
    while measure.shape[0] < n:
        measure = np.kron(measure, WEIGHTS)
    return xr.DataArray(measure, dims=("y", "x"))


def _moments(measure: xr.DataArray) -> np.ndarray[Any, Any]:
    from fractalcontact import domains as room

    return room.generalised_dimensions(measure, list(ORDERS))["generalised_dimension"].values


def _moments_error(found: np.ndarray[Any, Any], _: float) -> float:
    exact = [np.log2(np.sum(WEIGHTS**q)) / (1.0 - q) for q in ORDERS]
    return float(np.abs(found - exact).max())
