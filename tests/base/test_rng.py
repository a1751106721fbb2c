"""Random streams: a stream is restored from its record."""

import json

import numpy as np
import pytest

from fractalcontact.base import rng


def drawn_from(stream):
    stream.random(7)
    return stream


def with_children(stream):
    stream.spawn(3)
    return stream


STREAMS = {
    "an integer": lambda: 7,
    "several numbers": lambda: [1, 2, 2**40],
    "entropy of the machine": lambda: None,
    "a child": lambda: np.random.SeedSequence(12345, spawn_key=(7,)),
    "after a draw": lambda: drawn_from(np.random.default_rng(3)),
    "half a word left": lambda: drawn_from(np.random.Generator(np.random.SFC64(5))),
    "after a spawn": lambda: with_children(np.random.default_rng(3)),
    "after both": lambda: drawn_from(with_children(np.random.default_rng(3))),
    "another bit generator": lambda: np.random.Generator(np.random.Philox(4)),
    "an old bit generator, after a draw": lambda: drawn_from(np.random.Generator(np.random.MT19937(4))),
}


@pytest.mark.parametrize("name", STREAMS)
def test_stream_is_restored_from_its_record(name):
    stream = rng.generator(STREAMS[name]())
    stream.integers(0, 5, dtype=np.uint8) if name == "half a word left" else None
    record = json.loads(json.dumps(rng.record(stream)))
    restored = rng.generator(record)
    np.testing.assert_array_equal(restored.random(5), stream.random(5))
    np.testing.assert_array_equal(
        restored.spawn(2)[1].standard_normal(4), stream.spawn(2)[1].standard_normal(4)
    )


def test_invalid_streams_are_refused():
    for wrong in (
        "x",
        -1,
        {"bit_generator": "None"},
        {"bit_generator": "PCG64", "entropy": "x", "spawn_key": []},
    ):
        with pytest.raises(ValueError, match="rng: expected"):
            rng.generator(wrong)
