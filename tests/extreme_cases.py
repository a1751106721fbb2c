"""The catalogue of extreme cases: input, and what is expected of each quantity.

A quantity is written `subpackage.function.variable`. What is expected of it is a number (reached within one
part in 10^6 of it, or of the scale of the case for zero), a pair (lowest, highest), `NOT_DEFINED` (NaN, with
a reason in the result) or `REFUSED` (an `InvalidInput`). Every other function that takes such an input must
return as well, or refuse the input; its numbers must be finite, or NaN with a reason, and must not depend on
the units.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Literal

import extreme_inputs as inputs
import numpy as np
from extreme_inputs import brownian, uniform_mask, white_noise

NOT_DEFINED: Literal["not defined"] = "not defined"
REFUSED: Literal["refused"] = "refused"
Expectation = float | tuple[float, float] | str


@dataclass(frozen=True)
class Case:
    """One extreme input, and what is expected of the results.

    `input_type` is "surface", "mask" or "call"; `make` returns heights in metres or a boolean mask over
    (y, x), or the result of the call; `modulus` (Pa) is that with which a surface is pressed. A
    `large` case takes minutes and gigabytes.
    """

    name: str
    description: str
    input_type: Literal["surface", "mask", "call"]
    make: Callable[[], Any]
    expected: Mapping[str, Expectation] = field(default_factory=dict)
    modulus: float = 1e9
    large: bool = False


def _surface(
    name: str,
    description: str,
    make: Callable[[], Any],
    expected: Mapping[str, Expectation],
    modulus: float = 1e9,
) -> Case:
    return Case(name, description, "surface", make, expected, modulus)


def _mask(name: str, description: str, make: Callable[[], Any], **expected: Expectation) -> Case:
    """Return a case of a mask; the keywords are quantities of `_MASK_QUANTITIES`."""
    return Case(name, description, "mask", make, {_MASK_QUANTITIES[key]: v for key, v in expected.items()})


def _call(name: str, description: str, make: Callable[[], Any], expected: Mapping[str, Expectation]) -> Case:
    return Case(name, description, "call", make, expected)


HURST = "dimensions.estimate.hurst"
FRACTION = "contact.press.contact_fraction"
DILATANCY = "joints.dilatancy.rigid_dilatancy"
RMS_HEIGHT = "surfaces.describe.rms_height"
_MASK_QUANTITIES = {
    "islands": "domains.islands.n_islands",
    "dimension": "domains.box_dimension.box_dimension",
    "lacunarity": "domains.lacunarity.lacunarity",
    "percolates": "domains.percolation.percolates",
}

FLAT: Mapping[str, Expectation] = {
    RMS_HEIGHT: 0.0,
    "surfaces.describe.rms_slope": 0.0,
    "surfaces.level.rms_height": 0.0,
    HURST: NOT_DEFINED,
    FRACTION: 1.0,
    "contact.press.corrected_contact_fraction": 1.0,
    "contact.press.mean_gap": 0.0,
    DILATANCY: 0.0,
    "joints.closure.interface_closure": 0.0,
}
ROUGH: Mapping[str, Expectation] = {FRACTION: (1e-4, 1.0), DILATANCY: (0.0, np.inf)}
# white noise in any unit, with any modulus, on any offset: at a load in proportion to slope and modulus the
# area is always that of 37 nodes in 32 x 32
ALIKE: Mapping[str, Expectation] = {**ROUGH, FRACTION: 37 / 1024}
SLOPED: Mapping[str, Expectation] = {
    "surfaces.describe.mean_slope_x": 0.1,
    "surfaces.describe.mean_slope_y": 0.0,
    "surfaces.level.rms_height": 0.0,
    DILATANCY: 1e-5,
}
MISSING = "surfaces.describe.missing_points"
UNOBSERVED: Mapping[str, Expectation] = {FRACTION: REFUSED, HURST: REFUSED, DILATANCY: REFUSED}

_square = partial(white_noise, (32, 32))
_far_square = partial(_square, 1.0, 10.0, offset=1e9)
_nanometres_far = partial(white_noise, (16, 16), 1e-9, offset=1e9)
_holes = partial(brownian, 0.5, holes=True)

# name, what is extreme, input, expected
_SURFACES = (
    _surface("flat", "a constant surface", partial(inputs.constant, 0.0), FLAT),
    _surface("flat, high up", "constant at 10^6 m", partial(inputs.constant, 1e6), FLAT),
    _surface("one spike", "one node above a plane", inputs.spike, ROUGH),
    _surface("plane", "a plane of slope 0.1 along x", inputs.plane, SLOPED),
    _surface("sphere", "a smooth cap: the limit H = 1", inputs.sphere, ROUGH),
    _surface(
        "white noise",
        "uncorrelated heights: the limit H = 0",
        partial(white_noise, (64, 64)),
        {HURST: (-0.1, 0.05), **ROUGH},
    ),
    _surface(
        "quantised",
        "heights of a coarse instrument, in eight steps",
        partial(brownian, 0.7, quantum=2e-6),
        ROUGH,
    ),
    _surface(
        "plateaus",
        "summits cut off at the median: many equal highest points",
        partial(_square, highest=0.0),
        {FRACTION: (0.4, 1.0)},
    ),
    _surface(
        "H = 0.01", "the roughest Brownian surface", partial(brownian, 0.01), {HURST: (0, 0.06), **ROUGH}
    ),
    _surface(
        "H = 0.99", "the smoothest Brownian surface", partial(brownian, 0.99), {HURST: (0.9, 1.05), **ROUGH}
    ),
    _surface(
        "slope 10",
        "rms slopes far outside small strains",
        partial(_square, 1e-3),
        {"surfaces.describe.rms_slope": (5.0, 30.0), **ALIKE},
    ),
    _surface("slope 1e-6", "nearly flat", partial(_square, 1e-10), ALIKE),
    _surface(
        "n = 3",
        "the smallest surface: too small to slide on itself",
        partial(white_noise, (3, 3)),
        {**ROUGH, DILATANCY: REFUSED},
    ),
    _surface("prime", "31 by 37 points", partial(white_noise, (31, 37)), ROUGH),
    _surface("strip", "aspect ratio 1:1000", partial(white_noise, (4, 4000)), ROUGH),
    _surface("E* = 1e-6 Pa", "softer than any material", _square, ALIKE, modulus=1e-6),
    _surface("E* = 1 Pa", "the modulus of a jelly", _square, ALIKE, modulus=1.0),
    _surface("E* = 1e15 Pa", "stiffer than any material", _square, ALIKE, modulus=1e15),
    _surface("offset 1e9", "metres on an offset of 10^9 m", _far_square, ALIKE),
    _surface("steps below rounding", "nanometres on 10^9 m: rounded away", _nanometres_far, FLAT),
    _surface(
        "a step of one rounding",
        "one node higher than a plane by the last bit of 10^9 m",
        inputs.step_of_one_rounding,
        ROUGH,
    ),
    _surface(
        "islands of NaN",
        "two blocks that were not observed",
        _holes,
        {FRACTION: REFUSED, MISSING: 180.0, HURST: (0.3, 0.7)},
    ),
    _surface("high up", "millimetres on an offset of 10^6 m", partial(_square, 1e-3, offset=1e6), ALIKE),
    _surface("nanometres", "heights of 10^-9 m", partial(_square, 1e-9, 1e-8), ALIKE),
    _surface("mountains", "heights of 10^6 m", partial(_square, 1e6, 1e7), ALIKE),
    _surface(
        "spacings 1:100",
        "cells a hundred times as long as wide",
        partial(white_noise, (24, 24), 1e-6, (1e-2, 1e-4)),
        ROUGH,
    ),
    _surface("periodic wave", "one wave, which wraps", inputs.wave, {RMS_HEIGHT: 1e-6 / np.sqrt(2)}),
    _surface(
        "a missing point", "one NaN", partial(_square, missing=(6, 8)), {FRACTION: REFUSED, MISSING: 1.0}
    ),
    _surface("nothing observed", "all NaN", partial(inputs.constant, np.nan), UNOBSERVED),
)

_full = partial(uniform_mask, True)
_one_cell_mask = partial(uniform_mask, True, (1, 1), periodic=True)

_MASKS = (
    _mask(
        "empty mask",
        "no contact at all",
        partial(uniform_mask, False),
        islands=0.0,
        dimension=NOT_DEFINED,
        lacunarity=NOT_DEFINED,
        percolates=0.0,
    ),
    _mask(
        "full mask", "contact everywhere", _full, islands=1.0, dimension=2.0, lacunarity=1.0, percolates=1.0
    ),
    _mask(
        "full periodic mask",
        "contact everywhere, wrapped",
        partial(_full, periodic=True),
        islands=1.0,
        dimension=2.0,
        lacunarity=1.0,
        percolates=1.0,
    ),
    _mask(
        "one cell",
        "a single contact",
        inputs.single_cell,
        islands=1.0,
        dimension=0.0,
        lacunarity=1024.0,
        percolates=0.0,
    ),
    _mask(
        "one row",
        "a line across the surface",
        partial(inputs.line, "x"),
        islands=1.0,
        dimension=1.0,
        lacunarity=32.0,
    ),
    _mask("one column", "the same along y", partial(inputs.line, "y"), islands=1.0, dimension=1.0),
    _mask(
        "checkerboard",
        "every second cell: no two contacts share an edge",
        inputs.checkerboard,
        islands=512.0,
        lacunarity=2.0,
    ),
    _mask(
        "carpet",
        "the carpet of Sierpinski, dimension log 8 / log 3 = 1.8928",
        inputs.carpet,
        dimension=(1.81, 1.97),
        islands=1.0,
    ),
    _mask("independent cells", "random, one cell in ten", inputs.independent_cells, lacunarity=(8.0, 12.0)),
    _mask("a mask of one cell", "1 by 1: no scales at all", _one_cell_mask, islands=1.0),
    _mask("three by three", "smaller than most boxes", inputs.diagonal),
    _mask("a strip", "two rows of cells", partial(_full, (2, 64))),
    _mask("all but one", "99.9 % contact", partial(inputs.single_cell, inverted=True), islands=1.0),
)

_CALLS = (
    _call(
        "modulus ratio 1e6",
        "a stiff body on a soft one: the limit of a rigid one",
        inputs.stiff_and_soft,
        {
            "contact.effective_modulus.ratio_to_soft": 1.0 / (1.0 + 1e-6 * 0.96 / 0.91),
            "contact.effective_modulus.ratio_swapped": 1.0,
        },
    ),
    _call(
        "one contact",
        "a force so small that one node carries it: the closed form of the plate",
        inputs.one_contact,
        {"contact.press.nodes": 1.0, "contact.press.closure_of_a_plate": 1.0},
    ),
    _call(
        "99.99 % contact",
        "a wave under all but 2.5e-8 of the pressure that closes it (Westergaard)",
        inputs.nearly_full,
        {"contact.press.open_share": (4e-5, 2e-4), "contact.press.converged": 1.0},
    ),
    _call(
        "loads over 12 decades",
        "up and down again: an elastic surface returns to its closures",
        inputs.up_and_down,
        {
            "contact.press.hysteresis": (0.0, 1e-6),
            "contact.press.steps_that_fell": 0.0,
            "contact.press.converged": 1.0,
        },
    ),
    _call(
        "hardness barely above the mean pressure",
        "by one part in 10^4: nearly every node must yield",
        inputs.barely_hard_enough,
        {FRACTION: (0.9998, 1.0), "contact.press.carried": 1.0},
    ),
    _call(
        "spikes that yield on a plane",
        "far higher than the plane is pressed in, hardness twice the pressure: the plane shares the rest",
        inputs.yielded_spikes,
        {
            "contact.press.converged": 1.0,
            "contact.press.yielded": 2.0,
            "contact.press.plane_over_rest": 1.0,
        },
    ),
    _call(
        "a very long path",
        "1000 steps between two loads: no drift, no more memory than the numbers kept",
        inputs.long_path,
        {"contact.press.drift": (0.0, 1e-6), "contact.press.kilobytes_a_step": (0.0, 1.0)},
    ),
    Case(
        "n = 8192",
        "67 million points",
        "call",
        inputs.huge,
        {FRACTION: (0.1, 0.35), "contact.press.converged": 1.0, "surfaces.spectral.rms_slope": (0.09, 0.11)},
        large=True,
    ),
)

cases: Mapping[str, Case] = {case.name: case for case in (*_SURFACES, *_MASKS, *_CALLS)}
