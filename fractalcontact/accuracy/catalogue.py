"""The catalogue of extreme surfaces and masks, each with the limit that is expected of it.

What is expected is written as `room.function.quantity: expectation`. An expectation is a number (reached
within one part in 10^6 of it, or of the scale of the case for zero), a pair (lowest, highest), `NOT_DEFINED`
(NaN, with a reason in the result) or `REFUSED` (a clear `InvalidInput`). What stands in none of them must
still run or be refused, be finite where it is not NaN, and not depend on units.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from fractalcontact.accuracy import calls
from fractalcontact.base import grid
from fractalcontact.base.schema import label

if TYPE_CHECKING:
    import xarray as xr

NOT_DEFINED: Literal["not defined"] = "not defined"
REFUSED: Literal["refused"] = "refused"
Expectation = float | tuple[float, float] | str
Array = np.ndarray[Any, np.dtype[Any]]


@dataclass(frozen=True)
class Case:
    """One extreme input.

    Attributes
    ----------
    name, story : str
        What it is, and what is extreme about it.
    kind : str
        "surface", "mask", or "call".
    make : callable
        Returns the input afresh: `height` in metres or a boolean mask, dims (y, x); of a call, the result.
    expected : mapping
        `room.function.quantity` to its expectation.
    modulus : float
        Contact modulus with which a surface is pressed, Pa.
    large : bool
        Takes minutes and gigabytes: left out unless asked for.
    """

    name: str
    story: str
    kind: Literal["surface", "mask", "call"]
    make: Callable[[], Any]
    expected: Mapping[str, Expectation] = field(default_factory=dict)
    modulus: float = 1e9
    large: bool = False


def _surface(
    heights: Array, spacing: float | tuple[float, float] = 1e-4, *, periodic: bool = False
) -> xr.DataArray:
    import xarray as xr

    steps = spacing if isinstance(spacing, tuple) else (spacing, spacing)
    coords = grid.plane_coords(heights.shape, steps, (periodic, periodic))
    return label(xr.DataArray(np.asarray(heights, float), dims=("y", "x"), coords=coords, name="height"))


def _mask(values: Array, *, periodic: bool = False) -> xr.DataArray:
    import xarray as xr

    coords = grid.plane_coords(values.shape, (1e-4, 1e-4), (periodic, periodic))
    return xr.DataArray(np.asarray(values, bool), dims=("y", "x"), coords=coords, name="contact")


def _axes(n: int, m: int | None = None) -> tuple[Array, Array]:
    y, x = np.mgrid[0:n, 0 : n if m is None else m]
    return y.astype(float), x.astype(float)


def _noise(shape: tuple[int, int], scale: float = 1e-6, seed: int = 1) -> Array:
    return scale * np.random.default_rng(seed).normal(size=shape)


def _brownian(hurst: float, n: int = 64) -> xr.DataArray:
    from fractalcontact import surfaces

    return surfaces.fbm((n, n), 1e-4, hurst=hurst, rms_increment=1e-6, rng=7)


def _spike() -> Array:
    heights = np.zeros((33, 33))
    heights[16, 16] = 1e-5
    return heights


def _sphere(n: int = 65, radius: float = 0.05, spacing: float = 1e-4) -> Array:
    y, x = _axes(n)
    middle = (n - 1) / 2
    return np.asarray(-((y - middle) ** 2 + (x - middle) ** 2) * spacing**2 / (2 * radius))


def _wave(n: int = 64, amplitude: float = 1e-6) -> Array:
    _, x = _axes(n)
    return np.asarray(amplitude * np.cos(2 * np.pi * x / n))


def _with_islands(heights: Array) -> Array:
    heights = heights.copy()
    heights[5:15, 5:13] = heights[40:50, 30:40] = np.nan
    return heights


def _carpet(levels: int = 4) -> Array:
    cell = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], bool)
    mask = np.ones((1, 1), bool)
    for _ in range(levels):
        mask = np.kron(mask, cell).astype(bool)
    return mask


def _one_cell(n: int = 32) -> Array:
    mask = np.zeros((n, n), bool)
    mask[n // 2, n // 3] = True
    return mask


def _row(n: int = 32) -> Array:
    mask = np.zeros((n, n), bool)
    mask[n // 2] = True
    return mask


_FLAT: dict[str, Expectation] = {
    "surfaces.describe.rms_height": 0.0,
    "surfaces.describe.rms_slope": 0.0,
    "surfaces.level.rms_height": 0.0,
    "dimensions.estimate.hurst": NOT_DEFINED,
    "contact.press.contact_fraction": 1.0,
    "contact.press.corrected_contact_fraction": 1.0,
    "contact.press.mean_gap": 0.0,
    "joints.dilatancy.rigid_dilatancy": 0.0,
    "joints.closure.interface_closure": 0.0,
}
_ROUGH: dict[str, Expectation] = {
    "contact.press.contact_fraction": (1e-4, 1.0),
    "joints.dilatancy.rigid_dilatancy": (0.0, np.inf),
}

# white noise in any unit, with any modulus, on any offset: the area at a load in proportion to slope and
# modulus is always that of 37 nodes in 32 x 32
_ALIKE: dict[str, Expectation] = {**_ROUGH, "contact.press.contact_fraction": 37 / 1024}


def _between(low: float, high: float) -> dict[str, Expectation]:
    return {"dimensions.estimate.hurst": (low, high), **_ROUGH}


_SURFACES = (
    Case("flat", "a constant face", "surface", lambda: _surface(np.zeros((16, 16))), _FLAT),
    Case("flat, high up", "constant at 10^6 m", "surface", lambda: _surface(np.full((16, 16), 1e6)), _FLAT),
    Case("one spike", "one node above a flat", "surface", lambda: _surface(_spike()), _ROUGH),
    Case(
        "plane",
        "a plane of slope 0.1 along x",
        "surface",
        lambda: _surface(1e-5 * _axes(24)[1]),
        {
            "surfaces.describe.mean_slope_x": 0.1,
            "surfaces.describe.mean_slope_y": 0.0,
            "surfaces.level.rms_height": 0.0,
            "joints.dilatancy.rigid_dilatancy": 1e-5,
        },
    ),
    Case("sphere", "a smooth cap: the limit H = 1", "surface", lambda: _surface(_sphere()), _ROUGH),
    Case(
        "white noise",
        "uncorrelated heights: the limit H = 0",
        "surface",
        lambda: _surface(_noise((64, 64))),
        {"dimensions.estimate.hurst": (-0.1, 0.05), **_ROUGH},
    ),
    Case(
        "quantised",
        "heights in eight steps, as of a coarse instrument",
        "surface",
        lambda: _surface(2e-6 * np.rint(_brownian(0.7).values / 2e-6)),
        _ROUGH,
    ),
    Case(
        "plateaus",
        "summits cut off at the median: many equal highest points",
        "surface",
        lambda: _surface(np.minimum(_noise((32, 32)), 0.0)),
        {"contact.press.contact_fraction": (0.4, 1.0)},
    ),
    Case(
        "H = 0.01",
        "the roughest fractional Brownian face",
        "surface",
        lambda: _brownian(0.01),
        _between(0, 0.06),
    ),
    Case("H = 0.99", "the smoothest one", "surface", lambda: _brownian(0.99), _between(0.9, 1.05)),
    Case(
        "slope 10",
        "rms slopes far outside small strains",
        "surface",
        lambda: _surface(_noise((32, 32), 1e-3)),
        {"surfaces.describe.rms_slope": (5.0, 30.0), **_ALIKE},
    ),
    Case("slope 1e-6", "nearly flat", "surface", lambda: _surface(_noise((32, 32), 1e-10)), _ALIKE),
    Case(
        "n = 3",
        "the smallest face: it has no room to slide",
        "surface",
        lambda: _surface(_noise((3, 3))),
        {**_ROUGH, "joints.dilatancy.rigid_dilatancy": REFUSED},
    ),
    Case("prime", "31 by 37 points", "surface", lambda: _surface(_noise((31, 37))), _ROUGH),
    Case("strip", "aspect 1:1000", "surface", lambda: _surface(_noise((4, 4000))), _ROUGH),
    Case(
        "E* = 1e-6 Pa",
        "softer than anything",
        "surface",
        lambda: _surface(_noise((32, 32))),
        _ALIKE,
        modulus=1e-6,
    ),
    Case(
        "E* = 1 Pa",
        "the modulus of a jelly",
        "surface",
        lambda: _surface(_noise((32, 32))),
        _ALIKE,
        modulus=1.0,
    ),
    Case(
        "E* = 1e15 Pa",
        "stiffer than anything",
        "surface",
        lambda: _surface(_noise((32, 32))),
        _ALIKE,
        modulus=1e15,
    ),
    Case(
        "offset 1e9",
        "metres on an offset of 10^9 m",
        "surface",
        lambda: _surface(1e9 + _noise((32, 32), 1.0), 10.0),
        _ALIKE,
    ),
    Case(
        "steps below rounding",
        "nanometres on an offset of 10^9 m: nothing of them is left",
        "surface",
        lambda: _surface(1e9 + _noise((16, 16), 1e-9)),
        _FLAT,
    ),
    Case(
        "a step of one rounding",
        "one node higher than a flat by the last bit of 10^9 m",
        "surface",
        lambda: _surface(np.where(_spike() > 0, np.nextafter(1e9, np.inf), 1e9), 1.0),
        _ROUGH,
    ),
    Case(
        "islands of NaN",
        "two blocks that were not observed",
        "surface",
        lambda: _surface(_with_islands(_brownian(0.5).values)),
        {
            "contact.press.contact_fraction": REFUSED,
            "surfaces.describe.missing_points": 180.0,
            "dimensions.estimate.hurst": (0.3, 0.7),
        },
    ),
    Case(
        "high up",
        "micrometres on an offset of 10^6 m",
        "surface",
        lambda: _surface(1e6 + _noise((32, 32), 1e-3)),
        _ALIKE,
    ),
    Case(
        "nanometres", "heights of 10^-9 m", "surface", lambda: _surface(_noise((32, 32), 1e-9), 1e-8), _ALIKE
    ),
    Case("mountains", "heights of 10^6 m", "surface", lambda: _surface(_noise((32, 32), 1e6), 1e7), _ALIKE),
    Case(
        "spacings 1:100",
        "cells a hundred times as long as wide",
        "surface",
        lambda: _surface(_noise((24, 24)), (1e-2, 1e-4)),
        _ROUGH,
    ),
    Case(
        "periodic wave",
        "one wave, which wraps",
        "surface",
        lambda: _surface(_wave(), periodic=True),
        {"surfaces.describe.rms_height": 1e-6 / np.sqrt(2)},
    ),
    Case(
        "a missing point",
        "one NaN",
        "surface",
        lambda: _surface(np.where(_axes(32)[0] * 32 + _axes(32)[1] == 200, np.nan, _noise((32, 32)))),
        {"contact.press.contact_fraction": REFUSED, "surfaces.describe.missing_points": 1.0},
    ),
    Case(
        "nothing observed",
        "all NaN",
        "surface",
        lambda: _surface(np.full((16, 16), np.nan)),
        {
            "contact.press.contact_fraction": REFUSED,
            "dimensions.estimate.hurst": REFUSED,
            "joints.dilatancy.rigid_dilatancy": REFUSED,
        },
    ),
)

_EMPTY: dict[str, Expectation] = {
    "domains.islands.n_islands": 0.0,
    "domains.box_dimension.box_dimension": NOT_DEFINED,
    "domains.lacunarity.lacunarity": NOT_DEFINED,
    "domains.percolation.percolates": 0.0,
}
_FULL: dict[str, Expectation] = {
    "domains.islands.n_islands": 1.0,
    "domains.box_dimension.box_dimension": 2.0,
    "domains.lacunarity.lacunarity": 1.0,
    "domains.percolation.percolates": 1.0,
}

_MASKS = (
    Case("empty mask", "no contact at all", "mask", lambda: _mask(np.zeros((32, 32))), _EMPTY),
    Case("full mask", "contact everywhere", "mask", lambda: _mask(np.ones((32, 32))), _FULL),
    Case(
        "full periodic mask",
        "contact everywhere, wrapped",
        "mask",
        lambda: _mask(np.ones((32, 32)), periodic=True),
        _FULL,
    ),
    Case(
        "one cell",
        "a single contact",
        "mask",
        lambda: _mask(_one_cell()),
        {
            "domains.islands.n_islands": 1.0,
            "domains.box_dimension.box_dimension": 0.0,
            "domains.lacunarity.lacunarity": 1024.0,
            "domains.percolation.percolates": 0.0,
        },
    ),
    Case(
        "one row",
        "a line across the whole face",
        "mask",
        lambda: _mask(_row()),
        {
            "domains.islands.n_islands": 1.0,
            "domains.box_dimension.box_dimension": 1.0,
            "domains.lacunarity.lacunarity": 32.0,
        },
    ),
    Case(
        "one column",
        "the same, turned",
        "mask",
        lambda: _mask(_row().T),
        {"domains.islands.n_islands": 1.0, "domains.box_dimension.box_dimension": 1.0},
    ),
    Case(
        "checkerboard",
        "every second cell: no two contacts touch by an edge",
        "mask",
        lambda: _mask(_axes(32)[0] % 2 == _axes(32)[1] % 2, periodic=True),
        {"domains.islands.n_islands": 512.0, "domains.lacunarity.lacunarity": 2.0},
    ),
    Case(
        "carpet",
        "the carpet of Sierpinski, dimension log 8 / log 3 = 1.8928",
        "mask",
        lambda: _mask(_carpet()),
        {"domains.box_dimension.box_dimension": (1.81, 1.97), "domains.islands.n_islands": 1.0},
    ),
    Case(
        "dust",
        "a random dust of one cell in ten",
        "mask",
        lambda: _mask(np.random.default_rng(3).random((64, 64)) < 0.1),
        {"domains.lacunarity.lacunarity": (8.0, 12.0)},
    ),
    Case(
        "a mask of one cell",
        "1 by 1: no scales at all",
        "mask",
        lambda: _mask(np.ones((1, 1)), periodic=True),
        {"domains.islands.n_islands": 1.0},
    ),
    Case("three by three", "smaller than most boxes", "mask", lambda: _mask(np.eye(3)), {}),
    Case("a strip", "one row of cells", "mask", lambda: _mask(np.ones((2, 64))), {}),
    Case(
        "all but one",
        "99.9 % contact",
        "mask",
        lambda: _mask(~_one_cell()),
        {"domains.islands.n_islands": 1.0},
    ),
)

_CALLS = (
    Case(
        "modulus ratio 1e6",
        "a stiff body on a soft one: the limit of a rigid one",
        "call",
        calls.stiff_and_soft,
        {
            "contact.effective_modulus.ratio_to_soft": 1.0 / (1.0 + 1e-6 * 0.96 / 0.91),
            "contact.effective_modulus.ratio_turned": 1.0,
        },
    ),
    Case(
        "one contact",
        "a force so small that one node bears it: the plate of the closed form",
        "call",
        calls.one_contact,
        {"contact.press.nodes": 1.0, "contact.press.closure_of_a_plate": 1.0},
    ),
    Case(
        "99.99 % contact",
        "a wave under all but 2.5e-8 of the pressure that closes it (Westergaard)",
        "call",
        calls.nearly_full,
        {"contact.press.open_share": (4e-5, 2e-4), "contact.press.converged": 1.0},
    ),
    Case(
        "loads over 12 decades",
        "up and down again: an elastic face comes back to where it was",
        "call",
        calls.up_and_down,
        {
            "contact.press.hysteresis": (0.0, 1e-6),
            "contact.press.steps_that_fell": 0.0,
            "contact.press.converged": 1.0,
        },
    ),
    Case(
        "hardness barely above the mean pressure",
        "by one part in 10^4: all but as little must yield",
        "call",
        calls.barely_hard_enough,
        {"contact.press.contact_fraction": (0.9998, 1.0), "contact.press.carried": 1.0},
    ),
    Case(
        "a very long path",
        "2000 steps between two loads: no drift, no more memory than the numbers kept",
        "call",
        calls.long_path,
        {"contact.press.drift": (0.0, 1e-6), "contact.press.kilobytes_a_step": (0.0, 1.0)},
    ),
    Case(
        "n = 8192",
        "67 million points",
        "call",
        calls.huge,
        {
            "contact.press.contact_fraction": (0.1, 0.35),
            "contact.press.converged": 1.0,
            "surfaces.spectral.rms_slope": (0.09, 0.11),
        },
        large=True,
    ),
)

cases: Mapping[str, Case] = {case.name: case for case in (*_SURFACES, *_MASKS, *_CALLS)}
