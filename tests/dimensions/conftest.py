"""Gaps that several tests of modes and of filling share."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def holes():
    """Return which points are observed: scattered gaps, and a block at the edge."""
    rng = np.random.default_rng(5)
    observed = rng.random((12, 14)) > 0.15
    observed[4:7, 0:4] = False
    observed[0, -1] = observed[-1, 0] = observed[0, 0] = observed[-1, -1] = True
    return observed
