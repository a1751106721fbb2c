"""Lacunarity: closed forms, the covariance identity, unobserved cells, limits."""

import numpy as np
import pytest
from domains.sets import DIMENSION, as_mask, lattice_set, level_set, ratio_of

import fractalcontact as fc

ROUND = (True, True)


def slow_lacunarity(cells, size, wraps):
    """Return the lacunarity from an array of all windows."""
    ny, nx = cells.shape
    grown = np.pad(cells.astype(float), [(0, size if wrap else 0) for wrap in wraps], mode="wrap")
    mass = np.lib.stride_tricks.sliding_window_view(grown, (size, size)).sum((-1, -2))
    mass = mass[: ny if wraps[0] else None, : nx if wraps[1] else None]
    return (mass**2).mean() / mass.mean() ** 2


@pytest.mark.parametrize("wraps", [(False, False), (True, False), (False, True), ROUND])
def test_gliding_boxes_match_slow_windows(wraps):
    cells = np.random.default_rng(1).random((30, 23)) < 0.2
    sizes = [1, 2, 3, 7, 16, 23]
    result = fc.domains.lacunarity(as_mask(cells, periodic=wraps), sizes)
    assert result.lacunarity.values == pytest.approx(
        [slow_lacunarity(cells, s, wraps) for s in sizes], rel=1e-14
    )


def test_single_cell():
    cells = np.zeros((65, 65))
    cells[32, 32] = 1
    result = fc.domains.lacunarity(as_mask(cells), [1, 2, 4, 8])
    assert result.lacunarity.values == pytest.approx(
        [((65 - r + 1) / r) ** 2 for r in (1, 2, 4, 8)], rel=1e-15
    )


def test_lattice_of_cells():
    cells = np.zeros((64, 64))
    cells[::8, ::8] = 1
    result = fc.domains.lacunarity(as_mask(cells, periodic=ROUND), [1, 2, 4, 8, 16])
    assert result.lacunarity.values.tolist() == [64, 16, 4, 1, 1]


def test_chequerboard():
    cells = np.indices((64, 64)).sum(0) % 2
    result = fc.domains.lacunarity(as_mask(cells, periodic=ROUND), [1, 2, 3, 4, 5])
    assert result.lacunarity.values == pytest.approx([2, 1, 1 + 3**-4, 1, 1 + 5**-4], rel=1e-15)


def test_carpet_and_cantor_dust():
    carpet = fc.domains.lacunarity(as_mask(lattice_set("carpet", 5)), [1, 3, 9, 27, 81])
    expected = [1.80203247, 1.43750747, 1.28133107, 1.16769101, 1.07433212]
    assert carpet.lacunarity.values == pytest.approx(expected, abs=6e-9)
    assert float(carpet.lacunarity[0]) == pytest.approx((9 / 8) ** 5, rel=1e-15)
    cantor = fc.domains.lacunarity(as_mask(lattice_set("cantor_dust", 5), periodic=ROUND), [1, 3, 9, 27])
    assert cantor.lacunarity.values == pytest.approx(
        [57.66503906, 12.11366272, 4.95758057, 2.49047852], abs=6e-9
    )


def test_bernoulli_cells_and_their_null():
    cells = np.random.default_rng(2).random((512, 512)) < 0.05
    result = fc.domains.lacunarity(as_mask(cells), [1, 2, 4, 8, 16, 32])
    assert result.lacunarity.values == pytest.approx([20, 5.75, 2.1875, 1.2969, 1.0742, 1.0186], rel=0.02)
    p = cells.mean()
    expected = [1 + (1 - p) / (p * r**2) for r in (1, 2, 4, 8, 16, 32)]
    assert result.null_lacunarity.values == pytest.approx(expected, rel=1e-12)


def test_unit_box_gives_inverse_coverage_and_full_plane_one():
    planes = np.array([level_set(40, 0.5, c, np.random.default_rng(3)) for c in (0.1, 0.5, 0.9)])
    planes[2] = True
    result = fc.domains.lacunarity(as_mask(planes))
    assert result.lacunarity.values[:, 0] == pytest.approx(1 / planes.mean((1, 2)), rel=1e-15)
    assert np.all(result.lacunarity.values[2] == 1)
    assert np.all(result.null_lacunarity.values[2] == 1)


def test_covariance_identity_on_the_torus():
    cells = level_set(48, 0.6, 0.3, np.random.default_rng(4))[:, :40]
    mask = as_mask(cells, periodic=ROUND)
    power = np.abs(np.fft.fft2(cells)) ** 2
    covariance = np.fft.ifft2(power).real / cells.size
    for r in (2, 5, 19, 40):
        u = np.arange(-r + 1, r)
        weight = np.outer(r - np.abs(u), r - np.abs(u))
        pairs = covariance[np.ix_(u % 48, u % 40)]
        expected = (weight * pairs).sum() / (cells.mean() * r**2) ** 2
        assert float(fc.domains.lacunarity(mask, [r]).lacunarity[0]) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("library", ["scipy", "default"])
def test_transform_equals_gliding_bit_for_bit(library, monkeypatch):
    if library == "scipy":
        monkeypatch.setenv("FRACTALCONTACT_FFT", "scipy")
    cells = np.random.default_rng(5).random((45, 36)) < 0.1
    mask = as_mask(cells, periodic=ROUND)
    every = fc.domains.lacunarity(mask, np.arange(1, 37)).lacunarity.values
    single = [float(fc.domains.lacunarity(mask, [r]).lacunarity[0]) for r in range(1, 37)]
    assert np.array_equal(every, single)


def test_large_boxes_do_not_overflow():
    n, size = 6800, 6700
    assert size**4 * n > np.iinfo(np.int64).max
    row = np.zeros((n, n), bool)
    row[n // 2] = True  # met by `size` of the n positions along y, with a mass of `size`
    value = float(fc.domains.lacunarity(as_mask(row, periodic=ROUND), [size]).lacunarity[0])
    assert value == pytest.approx(n / size, rel=1e-13)


def test_many_large_boxes_do_not_overflow():
    n = 1500
    sizes = np.arange(n - 24, n + 1)
    assert float(n) ** 6 > np.iinfo(np.int64).max
    mask = as_mask(np.random.default_rng(6).random((n, n)) < 0.4, periodic=ROUND)
    by_transform = fc.domains.lacunarity(mask, sizes).lacunarity.values
    by_gliding = fc.domains.lacunarity(mask, sizes[[0, 12, 24]]).lacunarity.values
    assert by_transform[[0, 12, 24]] == pytest.approx(by_gliding, rel=1e-13)


def test_only_fully_observed_boxes_count():
    rng = np.random.default_rng(7)
    cells, valid = rng.random((40, 30)) < 0.3, rng.random((40, 30)) < 0.97
    result = fc.domains.lacunarity(as_mask(cells), [1, 2, 4, 30], valid=as_mask(valid))
    for place, r in enumerate((1, 2, 4)):
        windows = np.lib.stride_tricks.sliding_window_view
        mass = windows((cells & valid).astype(float), (r, r)).sum((-1, -2))
        seen = windows(valid, (r, r)).all((-1, -2))
        expected = (mass[seen] ** 2).mean() / mass[seen].mean() ** 2
        assert float(result.lacunarity[place]) == pytest.approx(expected, rel=1e-14)
    assert np.isnan(result.lacunarity[3])
    assert "wholly observed" in result.lacunarity.attrs["comment"]
    assert float(result.coverage) == pytest.approx(cells[valid].mean())


def test_valid_everywhere_changes_nothing():
    cells = np.random.default_rng(8).random((2, 20, 24)) < 0.3
    mask = as_mask(cells, periodic=ROUND)
    everywhere = as_mask(np.ones((20, 24)), periodic=ROUND)
    default, everywhere_valid = fc.domains.lacunarity(mask), fc.domains.lacunarity(mask, valid=everywhere)
    assert default.lacunarity.identical(everywhere_valid.lacunarity)


def test_empty_planes_are_nan_with_a_reason():
    planes = np.zeros((2, 16, 16))
    planes[1, 3, 3] = 1
    result = fc.domains.lacunarity(as_mask(planes))
    assert np.isnan(result.lacunarity.values[0]).all()
    assert np.isfinite(result.lacunarity.values[1]).all()
    assert "empty (1 planes)" in result.lacunarity.attrs["comment"]


def test_level_sets_exceed_the_null_and_fall_with_coverage():
    planes = [level_set(256, 0.8, c, np.random.default_rng(10)) for c in (0.02, 0.06, 0.18)]
    result = fc.domains.lacunarity(as_mask(np.array(planes)), [2, 4, 8, 16])
    assert np.all(result.lacunarity.values > 2 * result.null_lacunarity.values)
    assert np.all(np.diff(result.lacunarity.values, axis=0) < 0)
    assert np.all(np.diff(result.lacunarity.values, axis=1) < 0)


def test_periodic_false_is_allowed_and_true_needs_periodic_axes():
    cells = np.random.default_rng(11).random((20, 20)) < 0.3
    free = fc.domains.lacunarity(as_mask(cells), [5])
    declared_free = fc.domains.lacunarity(as_mask(cells, periodic=ROUND), [5], periodic=False)
    assert float(free.lacunarity[0]) == float(declared_free.lacunarity[0])
    with pytest.raises(ValueError, match="periodic: expected periodic axes"):
        fc.domains.lacunarity(as_mask(cells), [5], periodic=True)
    with pytest.raises(ValueError, match="box_sizes: expected a finite number >= 1 and <= 20"):
        fc.domains.lacunarity(as_mask(cells), [21])


def test_fixed_grid_lacunarity_of_lattice_sets():
    for name, level in (("carpet", 4), ("cantor_dust", 4), ("vicsek", 4), ("gasket", 6)):
        ratio = ratio_of(name)
        sizes = ratio ** np.arange(level + 1)
        result = fc.domains.lacunarity(as_mask(lattice_set(name, level)), sizes, boxes="fixed")
        expected = (ratio**level / sizes) ** (2 - DIMENSION[name])
        assert result.lacunarity.values == pytest.approx(expected, rel=1e-12)
        assert "fixed grid" in result.lacunarity.attrs["long_name"]


def test_fixed_grid_counts_fully_observed_boxes():
    rng = np.random.default_rng(20)
    cells, valid = rng.random((11, 14)) < 0.4, rng.random((11, 14)) < 0.95
    result = fc.domains.lacunarity(as_mask(cells), [3], boxes="fixed", valid=as_mask(valid))
    boxes = [(slice(i, i + 3), slice(j, j + 3)) for i in range(0, 9, 3) for j in range(0, 12, 3)]
    mass = np.array([cells[box].sum() for box in boxes if valid[box].all()])
    assert float(result.lacunarity[0]) == pytest.approx((mass**2).mean() / mass.mean() ** 2, rel=1e-13)


def test_normalisation():
    cells = np.zeros((64, 64))
    cells[::8, ::8] = 1
    result = fc.domains.lacunarity(as_mask(cells, periodic=(True, True)), [1, 2, 4, 8])
    # m^2 / r^2 up to the period m = 8
    assert result.normalised_lacunarity.values == pytest.approx((64 / np.array([1, 4, 16, 64]) - 1) / 63)
    expected = (64 / np.array([1, 4, 16, 64]) - 1) / 64 * (np.array([1, 2, 4, 8]) * 1e-3) ** 2
    assert result.integral_range.values == pytest.approx(expected, rel=1e-12)
    full = fc.domains.lacunarity(as_mask(np.ones((16, 16))))
    assert np.isnan(full.normalised_lacunarity).all()
    assert (full.integral_range == 0).all()


@pytest.mark.parametrize("wraps", [(False, False), ROUND])
def test_boxes_along_one_axis_match_slow_windows(wraps):
    cells = np.random.default_rng(1).random((30, 23)) < 0.2
    sizes = [1, 2, 7, 16]
    mask = as_mask(cells, periodic=wraps)
    for boxes, lines in (("along_x", cells), ("along_y", cells.T)):
        result = fc.domains.lacunarity(mask, sizes, boxes=boxes)
        for size, value in zip(sizes, result.lacunarity.values, strict=True):
            grown = np.pad(lines.astype(float), ((0, 0), (0, size - 1 if wraps[0] else 0)), mode="wrap")
            mass = np.lib.stride_tricks.sliding_window_view(grown, size, 1).sum(-1)
            assert value == pytest.approx((mass**2).mean() / mass.mean() ** 2, rel=1e-13)
        assert boxes.replace("_", " ") in result.lacunarity.attrs["long_name"]
        assert "integral_range" not in result


def test_stripes_have_their_lacunarity_across():
    cells = np.zeros((32, 32), bool)
    cells[:, ::4] = True
    mask = as_mask(cells, periodic=ROUND)
    along, across = (fc.domains.lacunarity(mask, [4], boxes=f"along_{axis}") for axis in "yx")
    assert float(along.lacunarity[0]) == 4.0
    assert float(across.lacunarity[0]) == 1.0


@pytest.mark.parametrize("wraps", [(False, False), ROUND])
@pytest.mark.parametrize("has_gaps", [False, True])
def test_lacunarity_of_a_field(wraps, has_gaps):
    rng = np.random.default_rng(2)
    pressure = np.where(rng.random((24, 31)) < 0.3, rng.exponential(3e6, (24, 31)), 0.0)
    valid = rng.random((24, 31)) < (0.95 if has_gaps else 2.0)
    field = as_mask(pressure, periodic=wraps).astype(float) * pressure
    result = fc.domains.lacunarity(field, [1, 2, 3], valid=as_mask(valid, periodic=wraps))
    for size, value in zip([1, 2, 3], result.lacunarity.values, strict=True):
        pad = [(0, size - 1 if wrap else 0) for wrap in wraps]
        windows = [
            np.lib.stride_tricks.sliding_window_view(np.pad(each, pad, mode="wrap"), (size, size))
            for each in (pressure, valid)
        ]
        mass = windows[0].sum((-1, -2))[windows[1].all((-1, -2))]
        assert value == pytest.approx((mass**2).mean() / mass.mean() ** 2, rel=1e-12)
    seen = pressure[valid]
    p = seen.mean() ** 2 / (seen**2).mean()
    assert float(result.lacunarity[0]) == pytest.approx(1 / p, rel=1e-12)
    assert float(result.normalised_lacunarity[0]) == pytest.approx(1.0, rel=1e-12)
    with pytest.raises(ValueError, match="none negative"):
        fc.domains.lacunarity(-field, [1, 2])


@pytest.mark.parametrize("unit", [2.0**-600, 2.0**600])
def test_unit_of_the_field_changes_no_bit(unit):
    field = as_mask(np.ones((2, 16, 16))).astype(float)
    field.values = np.random.default_rng(5).exponential(size=field.shape)
    first, other = (fc.domains.lacunarity(each).drop_vars("run_time") for each in (field, field * unit))
    assert first.identical(other.assign_attrs(first.attrs))


def test_field_of_one_value_is_a_set():
    cells = np.random.default_rng(3).random((40, 40)) < 0.2
    mask = as_mask(cells, periodic=ROUND)
    of_set, of_field = (fc.domains.lacunarity(each, [1, 4, 9]) for each in (mask, mask * 7e6))
    for name in ("lacunarity", "lacunarity_low", "null_lacunarity", "integral_range", "coverage"):
        np.testing.assert_allclose(of_field[name], of_set[name], rtol=1e-11)


def test_intervals_hold_the_lacunarity_of_random_cells():
    """1 + (1 - p) / (p r^2), of 40 planes of 128 x 128 at three sizes."""
    planes = np.random.default_rng(4).random((40, 128, 128)) < 0.1
    result = fc.domains.lacunarity(as_mask(planes, periodic=ROUND), [4, 8, 16])
    truth = 1 + 0.9 / (0.1 * np.array([4, 8, 16]) ** 2)
    inside = (result.lacunarity_low <= truth) & (truth <= result.lacunarity_high)
    assert (inside.mean("step") >= 0.85).all()
    width = np.log((result.lacunarity_high - 1) / (result.lacunarity_low - 1)).mean("step")
    assert (width < 1.0).all()
    fixed = fc.domains.lacunarity(as_mask(planes[:1]), [4], boxes="fixed")
    assert np.isnan(fixed.lacunarity_low).all()


def box_variance(covariance, r):
    """Sum a covariance over all pairs of cells of a box of r cells."""
    u = np.arange(-r + 1, r)
    weight = np.outer(r - np.abs(u), r - np.abs(u))
    return (weight * covariance(u[:, None], u[None, :])).sum() / r**4


def test_median_level_sets_of_gaussian_surfaces():
    rng = np.random.default_rng(21)
    n, cut = 256, 24
    modes = np.hypot(np.fft.fftfreq(n)[:, None] * n, np.fft.fftfreq(n)[None, :] * n)
    power = np.exp(-((modes / cut) ** 2))
    rho = np.fft.ifft2(power).real
    rho = np.clip(rho / rho[0, 0], -1, 1)
    planes = []
    for _ in range(24):
        noise = np.fft.fft2(rng.standard_normal((n, n)))
        planes.append(np.fft.ifft2(noise * np.sqrt(power)).real > 0)
    values = fc.domains.lacunarity(as_mask(np.array(planes), periodic=ROUND), [2, 5, 12]).lacunarity.values
    for place, r in enumerate((2, 5, 12)):
        # the bivariate normal orthant gives the second moment of the set
        expected = box_variance(lambda v, u: 0.25 + np.arcsin(rho[v % n, u % n]) / (2 * np.pi), r) / 0.25
        error = values[:, place].std() / np.sqrt(24)
        assert values[:, place].mean() == pytest.approx(expected, abs=4 * error)
        assert error < 0.02 * (expected - 1)


def test_random_discs():
    rng = np.random.default_rng(22)
    n, radius, number = 256, 6.0, 250
    planes = []
    for _ in range(24):
        cells = np.zeros((n, n), bool)
        for cy, cx in rng.uniform(0, n, (rng.poisson(number), 2)):
            rows = np.arange(int(cy) - 8, int(cy) + 9)
            columns = np.arange(int(cx) - 8, int(cx) + 9)
            inside = np.hypot((rows - cy)[:, None], columns - cx) <= radius
            cells[np.ix_(rows % n, columns % n)] |= inside
        planes.append(cells)

    def common(v, u):
        """Area that two discs share."""
        half = np.minimum(np.hypot(v, u) / (2 * radius), 1.0)
        return 2 * radius**2 * (np.arccos(half) - half * np.sqrt(1 - half**2))

    density = number / n**2
    covered = 1 - np.exp(-density * np.pi * radius**2)
    result = fc.domains.lacunarity(as_mask(np.array(planes), periodic=ROUND), [2, 5, 12])
    assert float(result.coverage.mean()) == pytest.approx(covered, rel=0.02)
    for place, r in enumerate((2, 5, 12)):
        second = box_variance(
            lambda v, u: 2 * covered - 1 + (1 - covered) ** 2 * np.exp(density * common(v, u)), r
        )
        values = result.lacunarity.values[:, place]
        assert values.mean() == pytest.approx(second / covered**2, abs=4 * values.std() / np.sqrt(24))


@pytest.mark.parametrize(("width", "period"), [(1, 4), (3, 8), (5, 12)])
def test_stripes(width, period):
    cells = np.zeros((period * 3, 24), bool)
    for k in range(3):
        cells[k * period : k * period + width] = True
    sizes = np.arange(1, 2 * period + 1)
    values = fc.domains.lacunarity(as_mask(cells, periodic=ROUND), sizes[sizes <= 24]).lacunarity.values
    for r, value in zip(sizes, values, strict=False):
        # rows of the stripe seen by a window of r rows that starts anywhere in a period
        rows = [sum((start + k) % period < width for k in range(r)) for start in range(period)]
        expected = period * sum(row**2 for row in rows) / sum(rows) ** 2
        assert value == pytest.approx(expected, rel=1e-13)
