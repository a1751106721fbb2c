"""Fixtures shared by the tests of surfaces."""

import numpy as np
import pytest


class UnitImpulse(np.random.Generator):
    """A random stream whose normal numbers are all 0 except the one at `place`, which is 1."""

    def __init__(self, place):
        super().__init__(np.random.PCG64(0))
        self.place = place
        self.drawn = 0

    def standard_normal(self, size=None, out=None):
        values = np.zeros(size) if out is None else out
        flat = np.zeros(values.size)
        if 0 <= self.place - self.drawn < values.size:
            flat[self.place - self.drawn] = 1.0
        self.drawn += values.size
        values[...] = flat.reshape(values.shape)
        return values


@pytest.fixture
def covariance_of():
    """Return a function that computes the exact covariance of a generator linear in its normal numbers.

    The generator is called with `rng`, once for each normal number it uses; no statistics are involved.
    """

    def covariance(generate):
        counter = UnitImpulse(-1)
        generate(counter)
        columns = [np.ravel(generate(UnitImpulse(place))) for place in range(counter.drawn)]
        return sum(np.multiply.outer(column, column) for column in columns)

    return covariance
