"""Random streams (SPEC 7): one way in, and a record from which any of them can be made again."""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.errors import InvalidInput

RNGLike = np.random.Generator | np.random.SeedSequence | np.random.BitGenerator | int | None


def generator(rng: RNGLike) -> np.random.Generator:
    """Return a Generator for anything `numpy.random.default_rng` takes.

    Raises
    ------
    InvalidInput
        It takes no such thing.
    """
    try:
        return np.random.default_rng(rng)
    except (TypeError, ValueError) as error:
        expected = "a Generator, a whole number >= 0 or several of them, or None"
        raise InvalidInput("fractalcontact", [f"rng: expected {expected}, got {rng!r}"]) from error


def record(rng: np.random.Generator) -> dict[str, Any]:
    """Name, entropy and spawn key of a stream, as plain JSON types.

    Entropy is written as a string, because it has up to 128 bits.
    """
    bits = rng.bit_generator
    seed = bits.seed_seq
    if not isinstance(seed, np.random.SeedSequence):
        return {"bit_generator": type(bits).__name__, "entropy": None, "spawn_key": []}
    return {
        "bit_generator": type(bits).__name__,
        "entropy": str(seed.entropy),
        "spawn_key": [int(key) for key in seed.spawn_key],
    }
