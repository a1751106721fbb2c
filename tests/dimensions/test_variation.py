"""Range of heights over segments against loops."""

import numpy as np
import pytest

import fractalcontact as fc


def surface_of(heights, spacing=1e-3, periodic=False):
    return fc.surfaces.from_array(np.asarray(heights, float), spacing, periodic=periodic)


@pytest.mark.parametrize(
    ("shape", "spacing"), [((24, 17), (1e-3, 1e-3)), ((13, 40), (2e-3, 1e-3)), ((1, 50), (1.0, 1e-3))]
)
def test_variation_is_mean_range_of_segments(shape, spacing):
    rng = np.random.default_rng(9)
    heights = rng.standard_normal(shape).cumsum(axis=1)
    heights[rng.random(shape) < 0.05] = np.nan
    profile = shape[0] == 1
    result = fc.dimensions.variation(
        surface_of(heights[0] if profile else heights, spacing[-1 if profile else slice(None)])
    )
    assert result.window_size.size >= 3
    for size, value, number in zip(result.window_size, result.variation, result.pair_count, strict=True):
        ranges = []
        for lines, step in ((heights, spacing[1]), (heights.T, spacing[0])):
            length = round(float(size) / step)
            for line in lines if len(lines[0]) > 1 else ():
                parts = [line[i : i + length + 1] for i in range(line.size - length)]
                ranges += [np.ptp(part) for part in parts if np.isfinite(part).all()]
        assert int(number) == len(ranges)
        assert float(value) == pytest.approx(np.mean(ranges), rel=1e-12)
    once, pairs_of = (
        fc.dimensions.madogram(surface_of(heights[0], 1e-3)),
        fc.dimensions.variation(surface_of(heights[0], 1e-3)),
    )
    assert float(pairs_of.variation[0]) == pytest.approx(2.0 * float(once.madogram[0]), rel=1e-12)
