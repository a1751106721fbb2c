"""Random streams (SPEC 7), and a JSON record from which a stream can be restored."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np

from fractalcontact.base.numbers import is_real
from fractalcontact.base.validation import Problems

STREAMS = (np.random.Generator, np.random.BitGenerator, np.random.SeedSequence)

RNGLike = (
    np.random.Generator
    | np.random.SeedSequence
    | np.random.BitGenerator
    | int
    | Sequence[int]
    | Mapping[str, Any]
    | None
)


def generator(rng: RNGLike) -> np.random.Generator:
    """Return a Generator from an argument of `numpy.random.default_rng`, or from a `record`.

    Raises
    ------
    InvalidInput
        The argument is neither.
    """
    with Problems("fractalcontact") as problems:
        stream = _stream(rng)
        expected = "a Generator, an integer >= 0 or several of them, the record of a stream, or None"
        problems.require(stream is not None, "rng", expected, rng)
    return cast(np.random.Generator, stream)


def _stream(rng: Any) -> np.random.Generator | None:
    """Return the Generator of an argument, None if it is none of those that `generator` takes."""
    if isinstance(rng, Mapping):
        try:
            return _restored(rng)
        except (TypeError, ValueError, KeyError, AttributeError):
            return None
    if rng is not None and not isinstance(rng, STREAMS):
        is_sequence = isinstance(rng, (list, tuple)) or (isinstance(rng, np.ndarray) and rng.ndim == 1)
        seeds = list(rng) if is_sequence else [rng]
        if not seeds or not all(map(_is_seed, seeds)):
            return None
    return np.random.default_rng(rng)


def _is_seed(value: Any) -> bool:
    """Return whether a value is an integer that a record can state."""
    integer = is_real(value) and isinstance(value, (int, np.integer))
    return integer and 0 <= value < 1 << 8192  # Python writes integers of up to 4300 digits


def record(rng: np.random.Generator) -> dict[str, Any]:
    """Return the present state of a stream in plain JSON types, for `generator` to restore it.

    Entropy, spawn key and number of spawned children identify a fresh stream; after a draw the state of the
    bit generator is recorded too. The words of the entropy are written as strings.
    """
    bits = rng.bit_generator
    seed, bit_generator = bits.seed_seq, type(bits)
    entry: dict[str, Any] = {"bit_generator": bit_generator.__name__, "entropy": None, "spawn_key": []}
    if not isinstance(seed, np.random.SeedSequence):
        return entry | {"state": _state(bits)}
    entropy = np.asarray(seed.entropy, dtype=object)
    words = [str(int(word)) for word in entropy.flat]
    entry["entropy"] = words if entropy.ndim else words[0]
    entry["spawn_key"] = [int(key) for key in seed.spawn_key]
    entry["children"] = int(seed.n_children_spawned)
    state = _state(bits)
    return entry if state == _state(bit_generator(_seed(entry))) else entry | {"state": state}


def _restored(entry: Mapping[str, Any]) -> np.random.Generator:
    """Return the stream of a record."""
    bit_generator = getattr(np.random, entry["bit_generator"])
    bits = bit_generator(_seed(entry) if entry["entropy"] is not None else None)
    if "state" in entry:
        bits.state = entry["state"]
    return np.random.Generator(bits)


def _seed(entry: Mapping[str, Any]) -> np.random.SeedSequence:
    entropy = entry["entropy"]
    integers = int(entropy) if isinstance(entropy, str) else [int(word) for word in entropy]
    return np.random.SeedSequence(
        integers, spawn_key=tuple(entry["spawn_key"]), n_children_spawned=entry.get("children", 0)
    )


def _state(bits: Any) -> Any:
    """Return the state of a bit generator with lists in place of arrays, which it takes as well."""
    return json.loads(json.dumps(bits.state, default=np.ndarray.tolist))
