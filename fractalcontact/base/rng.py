"""Random streams (SPEC 7): one way in, and a record from which any of them can be made again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fractalcontact.base.errors import InvalidInput

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
    """Return a Generator for anything `numpy.random.default_rng` takes, or for what `record` returned.

    Raises
    ------
    InvalidInput
        It takes no such thing.
    """
    try:
        return _again(rng) if isinstance(rng, Mapping) else np.random.default_rng(rng)
    except (TypeError, ValueError, KeyError, AttributeError) as error:
        expected = "a Generator, a whole number >= 0 or several of them, the record of a stream, or None"
        raise InvalidInput("fractalcontact", [f"rng: expected {expected}, got {rng!r}"]) from error


def record(rng: np.random.Generator) -> dict[str, Any]:
    """Return a stream as it stands, in plain JSON types, for `generator` to make it again.

    Entropy, spawn key and how many children it has had tell a stream that nothing was drawn from; one that
    has been drawn from is told by its state as well. Large numbers are written as strings.
    """
    bits = rng.bit_generator
    seed, kind = bits.seed_seq, type(bits)
    told: dict[str, Any] = {"bit_generator": kind.__name__, "entropy": None, "spawn_key": []}
    if not isinstance(seed, np.random.SeedSequence):
        return told | {"state": _plain(bits.state)}
    entropy = np.asarray(seed.entropy, dtype=object)
    words = [str(int(word)) for word in entropy.flat]
    told["entropy"] = words if entropy.ndim else words[0]
    told["spawn_key"] = [int(key) for key in seed.spawn_key]
    told["children"] = int(seed.n_children_spawned)
    state = _plain(bits.state)
    if state != _plain(kind(_seed(told)).state):
        told["state"] = state
    return told


def _again(told: Mapping[str, Any]) -> np.random.Generator:
    """Make a stream from its record."""
    kind = getattr(np.random, told["bit_generator"])
    bits = kind(_seed(told) if told["entropy"] is not None else None)
    if "state" in told:
        bits.state = _numbers(told["state"])
    return np.random.Generator(bits)


def _seed(told: Mapping[str, Any]) -> np.random.SeedSequence:
    entropy = told["entropy"]
    words = int(entropy) if isinstance(entropy, str) else [int(word) for word in entropy]
    return np.random.SeedSequence(
        words, spawn_key=tuple(told["spawn_key"]), n_children_spawned=told.get("children", 0)
    )


def _plain(state: Any) -> Any:
    """Return the state of a bit generator with its numbers as strings."""
    if isinstance(state, Mapping):
        return {key: _plain(value) for key, value in state.items()}
    if isinstance(state, np.ndarray):
        return [str(value) for value in state.tolist()]
    return state if isinstance(state, str) else str(int(state))


def _numbers(state: Any) -> Any:
    """Undo `_plain`."""
    if isinstance(state, Mapping):
        return {key: _numbers(value) for key, value in state.items()}
    if isinstance(state, list):
        return np.array([int(value) for value in state], dtype=np.uint64)
    return int(state) if state.isdigit() else state
