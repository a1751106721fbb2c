"""Contact of profiles, dims (..., x): Cantor sets, slow counts, the random null, refusals."""

from itertools import pairwise
from math import log

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc

LEVEL = 7
CANTOR = np.ones(1, int)
for _ in range(LEVEL):
    CANTOR = np.kron([1, 0, 1], CANTOR)
DIMENSION = log(2) / log(3)
POWERS = 3 ** np.arange(LEVEL)
MEASURED = ("box_counts", "box_dimension", "correlation_dimension", "describe", "islands", "lacunarity")
OF_PLANES = (
    "boundary_dimension",
    "evolution",
    "generalised_dimensions",
    "lineage",
    "minkowski_dimension",
    "percolation",
)


def as_profile(cells, *, periodic=False, spacing=1e-3):
    cells = np.asarray(cells) > 0
    n = cells.shape[-1]
    attributes = {"units": "m"} | ({"period": n * spacing} if periodic else {})
    x = xr.DataArray((np.arange(n) + 0.5) * spacing, dims="x", attrs=attributes)
    return xr.DataArray(cells, dims=("step", "x")[-cells.ndim :], coords={"x": x})


def test_cantor_set_is_exact_on_its_own_grid():
    mask = as_profile(CANTOR)
    result = fc.domains.box_dimension(mask, box_sizes=POWERS, cover="aligned")
    assert float(result.box_dimension) == pytest.approx(DIMENSION, abs=1e-14)
    assert result.box_count.values.tolist() == [2 ** (LEVEL - k) for k in range(LEVEL)]
    assert fc.domains.box_dimension(mask, cover="aligned").box_dimension == pytest.approx(
        DIMENSION, abs=1e-14
    )
    lacunarity = fc.domains.lacunarity(mask, POWERS, boxes="fixed")
    expected = (3.0**LEVEL / POWERS) ** (1 - DIMENSION)
    np.testing.assert_allclose(lacunarity.lacunarity, expected, rtol=1e-13)


def test_defaults_are_close_for_the_cantor_set():
    result = fc.domains.box_dimension(as_profile(CANTOR))
    assert float(result.box_dimension) == pytest.approx(DIMENSION, abs=0.01)
    assert float(result.ci_low) < DIMENSION < float(result.ci_high)
    assert result.differs_from_random
    # the pairs of cells of the Cantor set grow with the exponent log 2 / log 3 over powers of 3
    pairs = fc.domains.correlation_dimension(as_profile(CANTOR), box_sizes=POWERS)
    assert float(pairs.correlation_dimension) == pytest.approx(DIMENSION, abs=0.06)


@pytest.mark.parametrize("periodic", [False, True])
def test_line_and_cell_are_exact(periodic):
    cells = np.array([np.ones(500), np.arange(500) == 321, np.zeros(500)])
    mask = as_profile(cells, periodic=periodic)
    for name in ("box_dimension", "correlation_dimension"):
        result = getattr(fc.domains, name)(mask)[name]
        np.testing.assert_allclose(result[:2], [1.0, 0.0], atol=1e-14)
        assert np.isnan(result.values[2])
        assert result.attrs["comment"]
    assert fc.domains.lacunarity(mask).lacunarity.values[0].tolist() == [1.0] * 8


def slow_counts(row, size, periodic):
    """Count boxes at every offset, and their length: that inside where the set goes on in the next box."""
    n = row.size
    counts, lengths = [], []
    for offset in range(size):
        if periodic:
            starts = range(offset, offset + n, size)
            boxes = [np.arange(start, min(start + size, offset + n)) % n for start in starts]
        else:
            edges = [0, *range(offset or size, n, size), n]
            boxes = [np.arange(low, high) for low, high in pairwise(edges)]
        met = [row[box].any() for box in boxes]
        length = 0
        for k, box in enumerate(boxes):
            beside = (
                [k - 1, (k + 1) % len(boxes)]
                if periodic
                else [j for j in (k - 1, k + 1) if 0 <= j < len(boxes)]
            )
            goes_on = any(met[j] for j in beside if j % len(boxes) != k)
            length += met[k] * (box.size if goes_on else size)
        counts.append(sum(met))
        lengths.append(length)
    return counts, lengths


@pytest.mark.parametrize("periodic", [False, True])
def test_counts_match_a_slow_count(periodic):
    rng = np.random.default_rng(3)
    for n, coverage in ((12, 0.2), (37, 0.1), (40, 0.5)):
        row = rng.random(n) < coverage
        sizes = np.arange(1, n // 2 + 1)
        slow = [slow_counts(row, size, periodic) for size in sizes]
        mask = as_profile(row, periodic=periodic)
        fewest = fc.domains.box_counts(mask, sizes, cover="minimum")
        assert fewest.box_count.values.tolist() == [min(counts) for counts, _ in slow]
        expected = [min(lengths) / size for (_, lengths), size in zip(slow, sizes, strict=True)]
        np.testing.assert_allclose(fewest.box_measure, expected, rtol=1e-14)
        if not periodic:  # a periodic axis has no remainder in the mean
            mean = fc.domains.box_counts(mask, sizes)
            np.testing.assert_allclose(mean.box_count, [np.mean(counts) for counts, _ in slow], rtol=1e-14)


def test_mean_count_wraps_around_a_period():
    row = np.random.default_rng(5).random(30) < 0.1
    for size in (1, 4, 15):
        met = [row[np.arange(start, start + size) % 30].any() for start in range(30)]
        result = fc.domains.box_counts(as_profile(row, periodic=True), [size])
        assert float(result.box_count[0]) == pytest.approx(sum(met) / size, rel=1e-14)


def test_random_cells_have_the_measures_of_their_null():
    mask = as_profile(np.random.default_rng(0).random((100, 2048)) < 0.1, periodic=True)
    scales = [1, 2, 4, 8, 16, 32]
    result = fc.domains.box_dimension(mask, box_sizes=scales, cover="aligned")
    error = result.box_dimension - result.null_dimension
    spread = float(result.null_spread.mean())
    assert abs(float(error.mean())) < 4 * spread / 10
    assert float(error.std()) == pytest.approx(spread, rel=0.3)
    assert float(result.differs_from_random.mean()) < 0.05
    pairs = fc.domains.correlation_dimension(mask)
    assert float(pairs.correlation_dimension.mean()) == pytest.approx(
        float(pairs.null_dimension.mean()), abs=0.01
    )
    gaps = fc.domains.lacunarity(mask, [1, 2, 4, 8])
    np.testing.assert_allclose((gaps.lacunarity / gaps.null_lacunarity).mean("step"), 1.0, atol=0.01)
    inside = (gaps.lacunarity_low < gaps.null_lacunarity) & (gaps.null_lacunarity < gaps.lacunarity_high)
    assert (inside[:, 1:].mean("step") > 0.85).all()


def test_gliding_lacunarity_matches_a_slow_sum():
    row = np.random.default_rng(6).random(50) < 0.3
    for size in (1, 3, 7):
        mass = np.array([row[start : start + size].sum() for start in range(50 - size + 1)])
        result = fc.domains.lacunarity(as_profile(row), [size])
        assert float(result.lacunarity[0]) == pytest.approx((mass**2).mean() / mass.mean() ** 2, rel=1e-14)


def test_correlation_matches_a_slow_count_of_pairs():
    row = np.random.default_rng(8).random(60) < 0.3
    places = np.flatnonzero(row)
    near = (np.arange(60)[:, None] - places) % 60
    near = np.minimum(near, 60 - near)[places]
    mass = fc.domains.correlation_dimension(as_profile(row, periodic=True), box_sizes=[1, 3, 9]).mean_mass
    expected = [np.count_nonzero(near <= size // 2) / places.size for size in (1, 3, 9)]
    np.testing.assert_allclose(mass, expected, rtol=1e-12)


def test_islands_have_lengths():
    row = np.array([1, 1, 0, 0, 1, 0, 1, 1, 1, 0, 0, 1])
    free = fc.domains.islands(as_profile(row))
    assert free.cells.values.tolist() == [2, 1, 3, 1]
    np.testing.assert_allclose(free.length, [2e-3, 1e-3, 3e-3, 1e-3])
    np.testing.assert_allclose(free.centroid_x, [1e-3, 4.5e-3, 7.5e-3, 11.5e-3])
    assert free.label.dims == ("x",)
    assert "area" not in free
    assert "euler_number" not in free
    assert float(free.mean_island_length) == pytest.approx(7e-3 / 4)
    ring = fc.domains.islands(as_profile(row, periodic=True))
    assert int(ring.n_islands) == 3
    assert float(ring.largest_length) == pytest.approx(3e-3)
    with pytest.raises(ValueError, match="include: expected"):
        fc.domains.islands(as_profile(row), include=["area"])


@pytest.mark.parametrize("name", MEASURED)
def test_results_are_labelled_and_come_back_from_a_file(name, tmp_path, compliance):
    mask = as_profile(np.random.default_rng(1).random((2, 64)) < 0.3)
    result = getattr(fc.domains, name)(mask)
    path = fc.save(result, tmp_path / f"{name}.nc")
    xr.testing.assert_identical(fc.open(path), result)
    assert compliance(path) == []
    alone = getattr(fc.domains, name)(mask.isel(step=0))
    assert "y" not in alone.dims
    for key, variable in result.data_vars.items():
        if "step" in variable.dims:
            np.testing.assert_array_equal(variable.isel(step=0), alone[key])


@pytest.mark.parametrize("name", MEASURED)
def test_unobserved_cells_make_no_difference(name):
    rng = np.random.default_rng(2)
    mask, valid = (as_profile(rng.random(64) < share) for share in (0.3, 0.9))
    first = getattr(fc.domains, name)(mask & valid, valid=valid).drop_vars("run_time")
    other = getattr(fc.domains, name)(mask | ~valid, valid=valid).drop_vars("run_time")
    assert first.identical(other.assign_attrs(first.attrs))
    with pytest.raises(ValueError, match="valid: expected"):
        getattr(fc.domains, name)(mask, valid=valid.isel(x=slice(9)))


def test_a_full_profile_with_gaps_in_the_scan_is_a_line():
    valid = as_profile(np.random.default_rng(2).random(200) < 0.8)
    result = fc.domains.box_dimension(valid, valid=valid)
    assert float(result.box_dimension) == pytest.approx(1.0, abs=1e-12)
    assert float(result.null_dimension) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("name", OF_PLANES)
def test_measures_of_planes_refuse_profiles(name):
    with pytest.raises(ValueError, match="for the contact of a profile.* there are box_dimension"):
        getattr(fc.domains, name)(as_profile(CANTOR[None]))


@pytest.mark.parametrize("n", [1, 2, 3, 50])
@pytest.mark.parametrize("name", MEASURED)
def test_tiny_profiles_give_no_infinity(name, n):
    cells = np.array([np.zeros(n), np.arange(n) == 0, np.ones(n)]) > 0
    result = getattr(fc.domains, name)(xr.DataArray(cells, dims=("step", "x")))
    for variable in result.data_vars.values():
        if variable.dtype.kind == "f":
            assert not np.isinf(variable.values).any()
