"""Range of heights over segments against loops."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput


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
        fc.dimensions.variogram(surface_of(heights[0], 1e-3), increments="absolute"),
        fc.dimensions.variation(surface_of(heights[0], 1e-3)),
    )
    assert float(pairs_of.variation[0]) == pytest.approx(2.0 * float(once.madogram[0]), rel=1e-12)


@pytest.mark.parametrize("mean", ["arithmetic", "geometric"])
def test_range_over_squares_of_chosen_sizes(mean):
    heights = np.random.default_rng(4).standard_normal((13, 17))
    heights[3, 4] = np.nan
    heights[8:12, 8:14] = 1.0  # windows without a range have no logarithm
    result = fc.dimensions.variation(
        surface_of(heights, (2.0, 1.0)), [2.0, 4.0, 4.1], windows="squares", mean=mean
    )
    assert result.window_size.values.tolist() == [2.0, 4.0]
    for size, value, number in zip((2, 4), result.variation, result.pair_count, strict=True):
        rows, columns = size // 2 + 1, size + 1
        parts = [
            heights[i : i + rows, j : j + columns] for i in range(14 - rows) for j in range(18 - columns)
        ]
        ranges = np.array([np.ptp(part) for part in parts if np.isfinite(part).all()])
        ranges = ranges[ranges > 0] if mean == "geometric" else ranges
        assert int(number) == ranges.size
        expected = np.exp(np.log(ranges).mean()) if mean == "geometric" else ranges.mean()
        assert float(value) == pytest.approx(expected, rel=1e-12)


def test_sizes_outside_the_surface_are_refused():
    with pytest.raises(InvalidInput, match="lengths from"):
        fc.dimensions.variation(surface_of(np.random.default_rng(1).random((9, 9)), 1.0), [0.5, 20.0])
