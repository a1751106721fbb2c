"""False alarms of the test for unequal blocks."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.dimensions._heterogeneity import heterogeneity
from fractalcontact.dimensions._increment_moments import increment_moments


@pytest.mark.parametrize(
    ("shape", "steps"), [((40, 40), (1.0, 1.0)), ((24, 90), (3.0, 1.0)), ((1, 400), (1.0,))]
)
@pytest.mark.parametrize("gaps", [0.0, 0.15])
def test_false_alarms_are_rare(shape, steps, gaps):
    size = shape if len(steps) == 2 else shape[1]
    spacing = steps if len(steps) == 2 else 1.0
    for hurst in (0.1, 0.5, 0.9):
        surfaces = fc.surfaces.fbm(size, spacing, hurst=hurst, rms_increment=1.0, members=40, rng=7).values
        missing = np.random.default_rng(8).random(shape) < gaps
        alarms = []
        for surface in surfaces:
            heights = np.where(missing, np.nan, surface.reshape(shape))
            moments = increment_moments([(heights, len(heights))], shape[-len(steps) :])
            assert len(moments.blocks[0]) > 1
            alarms.append(bool(heterogeneity(moments, steps, hurst).note))
        assert sum(alarms) <= 1


@pytest.mark.parametrize("hurst", [0.3, 0.7])
def test_seams_between_tiles_are_left_out(hurst):
    for seed in (1, 2):
        surface = fc.surfaces.fbm((128, 128), 1e-6, hurst=hurst, rms_increment=1e-7, rng=seed)
        offsets = 2e-7 * np.random.default_rng(seed).standard_normal((4, 4))
        result = fc.dimensions.estimate(surface + np.kron(offsets, np.ones((32, 32))))
        assert abs(result.hurst.item() - hurst) < 0.03  # 0.04 too large at 0.3 with the seams
        assert result.ci_low.item() < hurst < result.ci_high.item()
        assert "left out" in result.hurst.attrs["comment"]
