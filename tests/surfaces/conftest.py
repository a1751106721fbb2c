"""What the tests of surfaces share."""

import numpy as np
import pytest


class OneNumber:
    """Stands in for a random stream: all its normal numbers are 0 but one."""

    def __init__(self, place):
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
    """Return a function that gives the exact covariance of what a linear generator draws.

    The generator is called once for each normal number it uses; no statistics are involved.
    """

    def covariance(draw):
        counter = OneNumber(-1)
        draw(counter)
        columns = [np.ravel(draw(OneNumber(place))) for place in range(counter.drawn)]
        return sum(np.multiply.outer(column, column) for column in columns)

    return covariance
