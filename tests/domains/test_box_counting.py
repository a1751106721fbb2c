"""Box counts and the box dimension: sets of known dimension, slow counts, limits, intervals."""

import numpy as np
import pytest
import xarray as xr
from domains.sets import (
    DIMENSION,
    GENERATORS,
    aggregate,
    as_mask,
    fractal_percolation,
    koch_raster,
    lattice_set,
    level_set,
    percolating_cluster,
    placed,
    random_lattice_set,
    random_null,
    ratio_of,
)

import fractalcontact as fc

SIDE = {"carpet": 5, "cantor_dust": 5, "vicsek": 5, "gasket": 8}


def parts_of_axis(n, size, offset, wraps):
    """Cut an axis into boxes (start, stop) by the grid of one offset."""
    if wraps:
        full = [(offset + k * size, offset + (k + 1) * size) for k in range(n // size)]
        return full + ([(offset + n // size * size, offset + n)] if n % size else [])
    starts = range(offset - size, n, size)
    return [(max(s, 0), min(s + size, n)) for s in starts if min(s + size, n) > max(s, 0)]


def slow_minimum(cells, size, wraps):
    """Count boxes offset by offset: the fewest full boxes, and the smallest measure."""
    ny, nx = cells.shape

    def met(box_y, box_x):
        return cells[np.ix_(np.arange(*box_y) % ny, np.arange(*box_x) % nx)].any()

    def beside(boxes, k, wrap):
        if len(boxes) == 1:
            return []
        near = [k - 1, k + 1]
        return [boxes[i % len(boxes)] for i in near if wrap or 0 <= i < len(boxes)]

    counts, measures = [], []
    for offset_y in range(size):
        for offset_x in range(size):
            rows = parts_of_axis(ny, size, offset_y, wraps[0])
            columns = parts_of_axis(nx, size, offset_x, wraps[1])
            count = measure = 0
            for p, row in enumerate(rows):
                for q, column in enumerate(columns):
                    if met(row, column):
                        on_y = any(met(other, column) for other in beside(rows, p, wraps[0]))
                        on_x = any(met(row, other) for other in beside(columns, q, wraps[1]))
                        height = row[1] - row[0] if on_y else size
                        width = column[1] - column[0] if on_x else size
                        count += 1
                        measure += height * width
            counts.append(count)
            measures.append(measure)
    return min(counts), min(measures) / size**2, np.mean(counts)


@pytest.mark.parametrize("wraps", [(False, False), (True, False), (True, True)])
def test_minimum_cover_matches_slow_count(wraps):
    rng = np.random.default_rng(1)
    for shape in ((7, 9), (12, 12), (5, 13)):
        cells = rng.random(shape) < rng.random()
        sizes = [1, 2, 3, 4, 5, 8, 14]
        result = fc.domains.box_counts(as_mask(cells, periodic=wraps), sizes, cover="minimum")
        slow = np.array([slow_minimum(cells, size, wraps) for size in sizes])
        assert np.array_equal(result.box_count, slow[:, 0])
        assert result.box_measure.values == pytest.approx(slow[:, 1], rel=1e-15)


def test_mean_cover_matches_slow_count():
    rng = np.random.default_rng(2)
    for shape in ((11, 9), (8, 14)):
        cells = rng.random(shape) < 0.2
        result = fc.domains.box_counts(as_mask(cells), [1, 2, 3, 4])
        slow = [slow_minimum(cells, size, (False, False))[2] for size in (1, 2, 3, 4)]
        assert result.box_count.values == pytest.approx(slow, rel=1e-14)


def test_mean_cover_wraps_around_a_periodic_plane():
    rng = np.random.default_rng(3)
    cells = rng.random((12, 12)) < 0.1
    sizes = [1, 2, 3, 4, 6]
    result = fc.domains.box_counts(as_mask(cells, periodic=(True, True)), sizes)
    slow = [slow_minimum(cells, size, (True, True))[2] for size in sizes]
    assert result.box_count.values == pytest.approx(slow, rel=1e-14)
    moved = fc.domains.box_counts(as_mask(np.roll(cells, (5, 7), (0, 1)), periodic=(True, True)), sizes)
    assert np.array_equal(moved.box_measure, result.box_measure)


def test_aligned_cover_counts_blocks():
    cells = np.random.default_rng(4).random((21, 34)) < 0.05
    sizes = [1, 2, 3, 4, 6, 8, 16, 32]
    result = fc.domains.box_counts(as_mask(cells), sizes, cover="aligned")
    for size, count in zip(sizes, result.box_count.values, strict=True):
        padded = np.zeros((-(-21 // size) * size, -(-34 // size) * size), bool)
        padded[:21, :34] = cells
        blocks = padded.reshape(padded.shape[0] // size, size, padded.shape[1] // size, size)
        assert count == np.count_nonzero(blocks.any((1, 3)))


@pytest.mark.parametrize("name", GENERATORS)
def test_lattice_sets_are_exact_on_their_grid(name):
    level, ratio = SIDE[name], ratio_of(name)
    scales = [ratio**k for k in range(level + 1)]
    for cover in ("minimum", "aligned"):
        result = fc.domains.box_dimension(as_mask(lattice_set(name, level)), box_sizes=scales, cover=cover)
        n_copies = int(GENERATORS[name].sum())
        assert np.array_equal(result.box_count, [n_copies ** (level - k) for k in range(level + 1)])
        assert float(result.box_dimension) == pytest.approx(DIMENSION[name], abs=1e-13)


@pytest.mark.parametrize("name", GENERATORS)
def test_lattice_sets_off_the_grid_are_exact_at_powers_of_their_ratio(name):
    level, ratio = SIDE[name], ratio_of(name)
    plane = placed(lattice_set(name, level), 1024, np.random.default_rng(5))
    result = fc.domains.box_dimension(as_mask(plane), box_sizes=[ratio**k for k in range(level + 1)])
    assert float(result.box_dimension) == pytest.approx(DIMENSION[name], abs=1e-10)


@pytest.mark.parametrize(
    ("name", "allowed"),
    [("carpet", 0.08), ("cantor_dust", 0.12), ("vicsek", 0.08), ("gasket", 0.08), ("koch", 0.03)],
)
def test_default_dimension_and_interval_of_known_sets(name, allowed):
    rng = np.random.default_rng(6)
    for _ in range(2):
        plane = koch_raster(1024, rng) if name == "koch" else placed(lattice_set(name, SIDE[name]), 1024, rng)
        result = fc.domains.box_dimension(as_mask(plane))
        assert abs(float(result.box_dimension) - DIMENSION[name]) <= allowed
        assert float(result.ci_low) <= DIMENSION[name] <= float(result.ci_high)


@pytest.mark.slow
@pytest.mark.parametrize("cover", ["minimum", "mean"])
@pytest.mark.parametrize("n", [250, 512, 729, 1024])
def test_interval_covers_fractals_placed_anywhere(n, cover):
    rng = np.random.default_rng(n)
    inside = []
    for _ in range(10):
        level, halvings = (4, 7) if n < 256 else (5, 8)
        planes = {
            DIMENSION["koch"]: koch_raster(n, rng),
            np.log(8) / np.log(3): placed(random_lattice_set(8, 3, level, rng), n, rng),
            np.log(6) / np.log(3): placed(random_lattice_set(6, 3, level, rng), n, rng),
            np.log(3) / np.log(2): placed(random_lattice_set(3, 2, halvings - 1, rng), n, rng),
        }
        planes |= {
            DIMENSION[name]: placed(lattice_set(name, SIDE[name] - (n < 256)), n, rng) for name in GENERATORS
        }
        for dimension, plane in planes.items():
            result = fc.domains.box_dimension(as_mask(plane), cover=cover)
            inside.append(float(result.ci_low) <= dimension <= float(result.ci_high))
    assert np.mean(inside) >= 0.95


@pytest.mark.slow
@pytest.mark.parametrize("cover", ["minimum", "mean"])
def test_interval_covers_many_families_of_sets(cover):
    rng = np.random.default_rng(77)
    inside = []
    for n in (100, 250, 512):
        sets = [(91 / 48, percolating_cluster(n, rng)) for _ in range(3)]
        for ratio, keeps in ((2, (2, 3)), (3, (2, 4, 6, 7)), (4, (5, 8, 11)), (5, (8, 13, 18))):
            level = int(np.log(n) / np.log(ratio) + 1e-9)
            for keep in keeps:
                pattern = (rng.permutation(ratio**2) < keep).reshape(ratio, ratio)
                fixed = np.ones((1, 1), bool)
                for _ in range(level):
                    fixed = np.kron(pattern, fixed)
                drawn = random_lattice_set(keep, ratio, level, rng)
                turned = (np.rot90(cells, rng.integers(4)) for cells in (fixed, drawn))
                sets += [(np.log(keep) / np.log(ratio), placed(cells, n, rng)) for cells in turned]
        for ratio, keep in ((2, 0.7), (2, 0.85), (3, 0.6)):
            cells = fractal_percolation(keep, ratio, int(np.log(n) / np.log(ratio) + 1e-9), rng)
            sets.append((2 + np.log(keep) / np.log(ratio), placed(cells, n, rng)))
        for dimension, cells in sets:
            result = fc.domains.box_dimension(as_mask(cells), cover=cover)
            inside.append(float(result.ci_low) <= dimension <= float(result.ci_high))
    assert np.mean(inside) >= (0.95 if cover == "minimum" else 0.9)


@pytest.mark.parametrize(
    "shape", [(3, 3), (4, 4), (9, 9), (27, 27), (100, 37), (250, 250), (509, 509), (64, 128)]
)
@pytest.mark.parametrize("wraps", [False, True])
def test_cell_row_column_and_full_mask_are_exact(shape, wraps):
    ny, nx = shape
    for y, x in ((0, 0), (ny // 2, nx // 3), (ny - 1, nx - 1)):
        planes = np.zeros((4, ny, nx), bool)
        planes[0, y, x] = planes[1, y] = planes[2, :, x] = planes[3] = True
        result = fc.domains.box_dimension(as_mask(planes, periodic=(wraps, wraps)))
        assert result.box_dimension.values.tolist() == [0.0, 1.0, 1.0, 2.0]
        if min(shape) >= 4:
            assert (result.ci_high - result.ci_low).values == pytest.approx(np.zeros(4), abs=1e-13)
        else:
            assert np.isnan(result.ci_low).all()


def test_mean_cover_of_cell_row_column_and_full_mask():
    planes = np.zeros((4, 100, 37), bool)
    planes[0, 99, 0] = planes[1, 0] = planes[2, :, 5] = planes[3] = True
    result = fc.domains.box_dimension(as_mask(planes), cover="mean")
    assert result.box_dimension.values == pytest.approx([0, 1, 1, 2], abs=1e-14)


def test_two_distant_cells_have_dimension_zero():
    cells = np.zeros((64, 64), bool)
    cells[0, 3] = cells[63, 60] = True
    assert float(fc.domains.box_dimension(as_mask(cells)).box_dimension) == pytest.approx(0, abs=1e-12)


def test_empty_planes_are_nan_with_a_reason():
    planes = np.zeros((3, 20, 20), bool)
    planes[1] = True
    result = fc.domains.box_dimension(as_mask(planes))
    assert np.isnan(result.box_dimension.values[[0, 2]]).all()
    assert float(result.box_dimension[1]) == 2
    assert "empty (2 planes)" in result.box_dimension.attrs["comment"]
    assert np.isnan(result.null_dimension[0])
    assert not result.differs_from_random.values.any()


def test_narrow_masks_are_nan_with_a_reason():
    for shape in ((1, 1), (1, 40)):
        mask = xr.DataArray(np.ones(shape, bool), dims=("y", "x"))
        result = fc.domains.box_dimension(mask)
        assert np.isnan(result.box_dimension)
        assert "too narrow" in result.box_dimension.attrs["comment"]


def test_stack_equals_its_planes():
    rng = np.random.default_rng(7)
    planes = np.array([level_set(48, 0.8, c, rng) for c in (0.05, 0.2, 0.5)]).reshape(1, 3, 48, 48)
    stack = fc.domains.box_dimension(as_mask(planes, dims=("seed", "step", "y", "x")), window="each")
    assert stack.box_count.dims == ("seed", "step", "box_size")
    for k in range(3):
        alone = fc.domains.box_dimension(as_mask(planes[0, k]))
        for name in ("box_dimension", "ci_low", "null_dimension", "null_spread", "box_measure"):
            assert np.array_equal(stack[name].values[0, k], alone[name].values)


def test_one_window_serves_a_stack():
    """It ends where half of the boxes meet the islands of the fullest plane."""
    rng = np.random.default_rng(7)
    planes = np.array([np.zeros((256, 256)), *(level_set(256, 0.8, c, rng) for c in (0.01, 0.03, 0.06))])
    result = fc.domains.box_dimension(as_mask(planes))
    low, high = (np.unique(result[name].values[1:]) for name in ("window_low", "window_high"))
    assert low.size == high.size == 1
    assert np.isnan(result.window_low[0])
    assert not result.is_saturated.any()
    counts = fc.domains.box_counts(as_mask(planes), [round(high[0] / 1e-3)]).box_measure
    assert (counts * (high / 1e-3) ** 2 / 256**2 < 0.5).all()
    np.testing.assert_allclose(result.scale_max[1:], high.item() / 1e-3)


def test_no_default_window_is_saturated():
    """The steadiest slopes of all are those of saturated boxes, 2 without scatter."""
    for count, radius in ((100, 6), (300, 3)):
        cells = np.zeros((512, 512), bool)
        for y, x in np.random.default_rng(1).integers(10, 500, (count, 2)):
            rows, columns = np.ogrid[:512, :512]
            cells |= (rows - y) ** 2 + (columns - x) ** 2 <= radius**2
        for window in (None, "each"):
            result = fc.domains.box_dimension(as_mask(cells), window=window)
            assert not result.is_saturated
            assert float(result.box_dimension) < 1.9
            assert float(fc.domains.box_dimension(as_mask(cells)).window_high) < 0.06
    full = fc.domains.box_dimension(as_mask(np.random.default_rng(2).random((128, 128)) < 0.4))
    assert bool(full.is_saturated)


def test_window_in_metres_does_not_depend_on_the_grid():
    n = 1024
    q = np.hypot(np.fft.fftfreq(n)[:, None], np.fft.rfftfreq(n)[None]) * n
    amplitude = np.where((q > 0) & (q < 32), np.maximum(q, 8.0) ** -1.8, 0)
    draws = np.random.default_rng(1).standard_normal((n, n))
    heights = np.fft.irfft2(amplitude * np.fft.rfft2(draws), s=(n, n))
    cells = heights > np.quantile(heights, 0.97)
    found = []
    for k in (4, 2, 1):
        mask = as_mask(cells[::k, ::k], (k / n, k / n), (True, True))
        result = fc.domains.box_dimension(mask, window=(1 / 32, 1 / 8), cover="mean")
        assert float(result.window_low) == pytest.approx(1 / 32)
        assert float(result.window_high) == pytest.approx(1 / 8)
        found.append(float(result.box_dimension))
    assert np.ptp(found) < 0.07  # boxes of whole cells; `signature` interpolates


def test_wrong_windows_are_refused():
    mask = as_mask(np.ones((32, 32)))
    for window in ("all", (1e-3,), (8e-3, 2e-3), (1e-3, 20e-3)):
        with pytest.raises(ValueError, match="window: expected"):
            fc.domains.box_dimension(mask, window=window)
    with pytest.raises(ValueError, match="None beside `box_sizes`"):
        fc.domains.box_dimension(mask, window=(2e-3, 8e-3), box_sizes=[1, 2])


def test_transposed_and_mirrored_masks_have_the_same_counts():
    cells = level_set(60, 0.5, 0.2, np.random.default_rng(8))
    expected = fc.domains.box_dimension(as_mask(cells)).box_measure.values
    for other in (cells.T, cells[::-1], cells[:, ::-1]):
        assert np.array_equal(fc.domains.box_dimension(as_mask(other)).box_measure.values, expected)


def test_unit_of_length_changes_only_box_length():
    cells = level_set(48, 0.5, 0.2, np.random.default_rng(9))
    first, other = (fc.domains.box_dimension(as_mask(cells, (s, 4 * s))) for s in (1.0, 2.0**-30))
    assert np.array_equal(first.box_dimension, other.box_dimension)
    assert np.array_equal(first.box_length, other.box_length * 2.0**30)
    assert float(first.box_length[0]) == 2.0  # the side of a square as large as a cell of 1 m x 4 m


def test_result_is_independent_of_the_number_of_threads():
    from fractalcontact.base.resources import limit

    planes = np.array([level_set(64, 0.5, c, np.random.default_rng(10)) for c in (0.1, 0.4)])
    results = []
    for threads in (1, 4):
        with limit(threads):
            results.append(fc.domains.box_dimension(as_mask(planes)).drop_vars("run_time"))
    assert results[0].identical(results[1].assign_attrs(results[0].attrs))


def test_unobserved_cells_keep_a_full_plane_full():
    rng = np.random.default_rng(15)
    valid = rng.random((60, 60)) < 0.8
    valid[20:35, 30:50] = False
    observed = as_mask(valid)
    for cover in ("minimum", "mean"):
        full = fc.domains.box_dimension(as_mask(np.ones((60, 60))), valid=observed, cover=cover)
        assert float(full.box_dimension) == pytest.approx(2.0, abs=1e-12)
        assert float(full.coverage) == 1.0
        assert float(full.null_dimension) == pytest.approx(2.0, abs=1e-12)
    cells = level_set(60, 0.8, 0.3, rng)
    first = fc.domains.box_dimension(as_mask(cells), valid=observed)
    other = fc.domains.box_dimension(as_mask(cells | ~valid), valid=observed)
    assert first.box_measure.identical(other.box_measure)


def test_unobserved_cells_change_the_dimension_little():
    rng = np.random.default_rng(16)
    cells = level_set(256, 0.5, 0.3, rng)
    complete = fc.domains.box_dimension(as_mask(cells))
    gappy = fc.domains.box_dimension(as_mask(cells), valid=as_mask(rng.random((256, 256)) < 0.9))
    assert float(gappy.box_dimension) == pytest.approx(float(complete.box_dimension), abs=0.06)
    assert bool(gappy.differs_from_random)
    null = fc.domains.box_dimension(
        as_mask(random_null(256, 3000, rng)), valid=as_mask(rng.random((256, 256)) < 0.9)
    )
    assert not bool(null.differs_from_random)


def test_default_sizes_are_products_of_two_and_three():
    for shape, sizes, further in (
        ((1024, 1024), [1, 2, 3, 4, 6, 8, 9, 12, 16, 18, 24, 27, 32], [48, 64, 96, 128, 192, 256]),
        ((250, 250), [1, 2, 3, 4, 6, 8, 9, 12], [16, 24, 32, 48]),
        ((3, 100), [1, 2, 3], []),
    ):
        mask = as_mask(np.zeros(shape))
        assert fc.domains.box_dimension(mask).box_size.values.tolist() == sizes + further
        assert fc.domains.correlation_dimension(mask).box_size.values.tolist() == sizes


def test_window_of_a_percolating_cluster_leaves_out_the_lattice():
    # the counts of boxes of a few cells have the slope 1.31, far below 91/48
    cells = percolating_cluster(512, np.random.default_rng(21))
    result = fc.domains.box_dimension(as_mask(cells))
    assert float(result.scale_min) > 2
    assert float(result.scale_max) >= 8 * float(result.scale_min)
    assert float(result.box_dimension) == pytest.approx(91 / 48, abs=0.07)
    assert float(result.ci_low) <= 91 / 48 <= float(result.ci_high)
    small = fc.domains.box_dimension(as_mask(cells), box_sizes=[1, 2, 3, 4, 6, 8, 9, 12, 16, 18])
    assert float(small.box_dimension) < 91 / 48 - 0.1
    # the null of equal coverage is fitted in the same window
    inside = (result.box_size >= result.scale_min) & (result.box_size <= result.scale_max)
    steps = -np.diff(np.log(result.null_count[inside])) / np.diff(np.log(result.box_size[inside]))
    assert steps.min() <= float(result.null_dimension) <= steps.max()


@pytest.mark.slow
def test_natural_clusters_are_within_a_twentieth():
    errors = []
    for seed in range(6):
        cluster = percolating_cluster(1024, np.random.default_rng(seed))
        errors.append(float(fc.domains.box_dimension(as_mask(cluster)).box_dimension) - 91 / 48)
    assert abs(np.mean(errors)) <= 0.05
    errors = []
    for seed in range(3):
        result = fc.domains.box_dimension(as_mask(aggregate(1024, np.random.default_rng(seed))))
        errors.append(float(result.box_dimension) - 1.71)
        assert float(result.ci_low) <= 1.71 <= float(result.ci_high)
    assert abs(np.mean(errors)) <= 0.05


def test_set_without_a_power_law_says_so():
    islands = level_set(256, 0.8, 0.06, np.random.default_rng(22))  # resolved: slopes fall from 2
    result = fc.domains.box_dimension(as_mask(np.array([islands, islands[::-1], islands > 1])))
    assert result.follows_power_law.values.tolist() == [False, False, False]
    assert "no power law in 2 of 3 planes: local slopes from" in result.box_dimension.comment
    assert float(result.scale_min[0]) == 1
    carpet = fc.domains.box_dimension(as_mask(lattice_set("carpet", 5)))
    assert bool(carpet.follows_power_law)
    assert "comment" not in carpet.box_dimension.attrs


@pytest.mark.parametrize("cover", ["minimum", "mean", "aligned"])
def test_intervals_stay_within_zero_and_two(cover):
    rng = np.random.default_rng(23)
    planes = np.array([random_null(100, count, rng) for count in (1, 3, 30, 1000, 9000, 9990)])
    result = fc.domains.box_dimension(as_mask(planes), cover=cover)
    for name in ("box_dimension", "ci_low", "ci_high"):
        values = result[name].values[np.isfinite(result[name].values)]
        assert values.size
        assert (values >= 0).all()
        assert (values <= 2).all()
    assert bool(
        (result.ci_low <= result.box_dimension).all() & (result.ci_high >= result.box_dimension).all()
    )


def test_chosen_scales_and_labels():
    result = fc.domains.box_dimension(as_mask(lattice_set("carpet", 3)), box_sizes=[9, 1, 3, 3])
    assert result.box_size.values.tolist() == [1, 3, 9]
    assert (float(result.scale_min), float(result.scale_max)) == (1, 9)
    assert result.scale_min.attrs["units"] == "1"
    assert result.box_length.attrs["units"] == "m"
    assert result.box_length.values == pytest.approx([1e-3, 3e-3, 9e-3])
    assert "standard deviations" in result.ci_low.attrs["long_name"]


def test_all_invalid_arguments_are_reported():
    mask = as_mask(np.ones((8, 8)))
    with pytest.raises(fc.base.errors.InvalidInput) as caught:
        fc.domains.box_dimension(mask, box_sizes=[0, 2.5, 99], cover="most", periodic=True)
    text = str(caught.value)
    for word in (
        "cover",
        "periodic",
        "box_sizes: expected a finite number >= 1 and <= 16",
        "expected integers",
    ):
        assert word in text
