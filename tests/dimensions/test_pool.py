"""The pooled exponent: closed forms, coverage, and what scatters between scans."""

import numpy as np
import pytest
import xarray as xr
from scipy.ndimage import gaussian_filter

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.regression import random_effects

# values with errors that differ a lot: Paule-Mandel tau^2 and mean solve the two equations of the method
VALUES = np.array([-0.8893, -1.5854, -1.3481, -1.4416, -0.2175, -0.7861, 0.0120])
VARIANCES = np.array([0.3256, 0.1946, 0.4154, 0.0200, 0.0512, 0.0069, 0.0040])


def estimates_of(hurst, error):
    data = {
        "hurst": hurst,
        "standard_error": error,
        "fractal_dimension": 3.0 - np.asarray(hurst),
        "scale_min": np.full(len(hurst), 1e-4),
        "scale_max": np.full(len(hurst), 1e-2),
    }
    columns = {name: (("scan", "method"), np.asarray(values)[:, None]) for name, values in data.items()}
    return xr.Dataset(columns, coords={"method": ["default"]})


def test_mean_and_scatter_solve_the_equations_of_paule_and_mandel():
    found = random_effects(VALUES, np.sqrt(VARIANCES))
    weight = 1.0 / (VARIANCES + found.between**2)
    assert found.mean == pytest.approx(weight @ VALUES / weight.sum(), rel=1e-12)
    assert weight @ (VALUES - found.mean) ** 2 == pytest.approx(VALUES.size - 1, rel=1e-9)


def test_scans_that_agree_are_weighted_by_their_errors():
    pooled = fc.dimensions.pool(estimates_of([0.70, 0.71, 0.69], [0.01, 0.02, 0.05]))
    weight = 1.0 / np.array([0.01, 0.02, 0.05]) ** 2
    assert pooled.between_scans == 0.0
    assert pooled.hurst == pytest.approx(weight @ [0.70, 0.71, 0.69] / weight.sum(), rel=1e-12)


def test_scatter_between_scans_is_told_from_the_error_within():
    rng = np.random.default_rng(5)
    hurst = 0.6 + rng.normal(0, 0.05, 400) + rng.normal(0, 0.03, 400)
    pooled = fc.dimensions.pool(estimates_of(hurst, np.full(400, 0.03)))
    assert pooled.between_scans == pytest.approx(0.05, rel=0.15)
    assert pooled.within_scans == pytest.approx(0.03, rel=1e-9)
    assert pooled.heterogeneity == pytest.approx(0.735, abs=0.1)


@pytest.mark.parametrize("between", [0.0, 0.02, 0.1])
@pytest.mark.parametrize("count", [3, 8, 30])
def test_interval_covers(between, count):
    """Errors of 0.01 to 0.05; with no scatter the factor of at least 1 makes the interval too long."""
    rng, draws = np.random.default_rng(count), 1000
    held = 0
    for _ in range(draws):
        error = rng.uniform(0.01, 0.05, count)
        found = random_effects(0.6 + rng.normal(0, between, count) + rng.normal(0, error), error)
        held += found.low <= 0.6 <= found.high
    low = 0.95 - 3.5 * np.sqrt(0.95 * 0.05 / draws)
    assert low < held / draws <= (0.97 if between == 0.1 and count > 3 else 1.0)


def test_scans_without_an_interval_are_left_out():
    pooled = fc.dimensions.pool(estimates_of([0.7, 0.2, 0.72], [0.01, np.nan, 0.01]))
    assert int(pooled.scan_count) == 2
    assert pooled.hurst == pytest.approx(0.71)


def test_resolutions_of_one_surface_are_pooled():
    """The same area at three spacings, each fitted over the scales that it resolves."""
    fine = fc.surfaces.fbm((256, 256), 1e-5, hurst=0.75, rms_increment=1e-6, rng=3)
    scans = {n: fine.isel(y=slice(0, None, n), x=slice(0, None, n)) for n in (1, 2, 4)}
    each = {str(n): fc.dimensions.estimate(scan, "increments") for n, scan in scans.items()}
    pooled = fc.dimensions.pool(each)
    assert pooled.ci_low < 0.75 < pooled.ci_high
    assert pooled.scale_min == each["1"].scale_min.item()


BLUR, NOISE = 0.7, 0.05  # spacings; rms increments


def twin(hurst, seed):
    """One surface at three resolutions, 64 x 64 points each: all of it, a quarter, a 64th."""
    rng, spacing, scans = np.random.default_rng([seed, 7]), 1e-6, []
    fine = fc.surfaces.fbm((512, 512), spacing, hurst=hurst, rms_increment=1e-7, rng=seed).values
    for step, start, extent in ((8, 0, 512), (4, 128, 256), (1, 200, 64)):
        cut = slice(start, start + extent, step)
        seen = gaussian_filter(fine, BLUR * step, mode="nearest")[cut, cut]
        noise = NOISE * np.diff(seen).std() * rng.standard_normal(seen.shape)
        scans.append(fc.surfaces.from_array(seen + noise, spacing * step))
    return scans


def common_of(hurst, seeds):
    """Return how many intervals of the common exponent hold it, and how many scans disagreed."""
    held, disagreed = 0, 0
    for seed in seeds:
        pooled = fc.dimensions.pool(twin(hurst, seed), model="common")
        held += bool(pooled.ci_low <= hurst <= pooled.ci_high)
        disagreed += bool(pooled.reason)
    return held, disagreed


def test_common_exponent_of_one_surface_at_three_resolutions():
    assert common_of(0.6, range(2)) == (2, 0)


@pytest.mark.slow
@pytest.mark.parametrize("hurst", [0.3, 0.5, 0.8])
def test_interval_of_a_common_exponent_covers(hurst):
    held, disagreed = common_of(hurst, range(60))
    assert held >= 51  # 57 are expected; fewer than 51 have a chance below 0.005
    assert disagreed <= 2


def test_common_interval_is_shorter_than_those_of_the_scans_and_of_random_effects():
    scans = twin(0.6, 1)
    each = [fc.dimensions.estimate(scan) for scan in scans]
    common = fc.dimensions.pool(scans, model="common")
    width = float(common.ci_high - common.ci_low)
    assert width < min(float((one.ci_high - one.ci_low).item()) for one in each)
    random = fc.dimensions.pool(each)
    assert width < float(random.ci_high - random.ci_low)
    assert common.within_scans == random.within_scans


def test_common_exponent_of_one_scan_is_its_own():
    scan = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.7, rms_increment=1e-6, rng=2)
    alone, common = fc.dimensions.estimate(scan), fc.dimensions.pool([scan], model="common")
    assert float(common["hurst"]) == pytest.approx(alone["hurst"].item(), abs=2e-5)
    # the width hardly depends on where a shortest interval begins
    width = alone["ci_high"].item() - alone["ci_low"].item()
    assert float(common["ci_high"] - common["ci_low"]) == pytest.approx(width, abs=1e-4)
    for name in ("ci_low", "ci_high"):
        assert float(common[name]) == pytest.approx(alone[name].item(), abs=2e-3 * width)


def test_scans_of_other_exponents_have_no_common_one():
    scans = [fc.surfaces.fbm((128, 128), 1e-4, hurst=h, rms_increment=1e-6, rng=3) for h in (0.3, 0.3, 0.8)]
    common = fc.dimensions.pool(scans, model="common")
    assert np.isnan(common.ci_low)
    assert "scatter more" in str(common.reason.values)


def test_a_common_exponent_needs_surfaces():
    with pytest.raises(InvalidInput, match="scans: expected surfaces"):
        fc.dimensions.pool(estimates_of([0.7], [0.1]), model="common")
    with pytest.raises(InvalidInput, match="model: expected one of"):
        fc.dimensions.pool(estimates_of([0.7], [0.1]), model="fixed")


def test_other_results_are_refused():
    with pytest.raises(InvalidInput, match="scans: expected results of"):
        fc.dimensions.pool([xr.Dataset()])
    with pytest.raises(InvalidInput, match="method: expected one of"):
        fc.dimensions.pool(estimates_of([0.7], [0.1]), method="spectrum")


@pytest.mark.slow
def test_pooled_interval_covers_surfaces_whose_exponents_scatter():
    """40 collections of 6 surfaces of 64 x 64 points, H drawn about 0.6 with a deviation of 0.05."""
    rng, held = np.random.default_rng(1), 0
    for n in range(40):
        exponents = np.clip(rng.normal(0.6, 0.05, 6), 0.1, 0.9)
        scans = [
            fc.surfaces.fbm((64, 64), 1e-4, hurst=h, rms_increment=1e-6, rng=6 * n + k)
            for k, h in enumerate(exponents)
        ]
        pooled = fc.dimensions.pool([fc.dimensions.estimate(scan, "increments") for scan in scans])
        held += bool(pooled.ci_low < 0.6 < pooled.ci_high)
    assert held >= 33  # 38 of 40 are expected; fewer than 33 have a chance below 0.002


def test_ends_of_the_interval_are_possible():
    pooled = fc.dimensions.pool(estimates_of([0.9, 0.99], [0.05, 0.05]))
    assert 0.0 < float(pooled.ci_low) < float(pooled.ci_high) == 1.0
    assert float(pooled.fractal_dimension_low) == 2.0


def test_equal_exponents_of_which_one_has_no_error():
    exact = fc.dimensions.pool(estimates_of([0.6, 0.6], [0.0, 0.1]))
    assert [float(exact[name]) for name in ("hurst", "ci_low", "ci_high")] == [0.6, 0.6, 0.6]


def test_surfaces_and_profiles_are_not_mixed():
    profile = estimates_of([0.6], [0.1])
    profile["fractal_dimension"] = 2.0 - profile["hurst"]
    with pytest.raises(InvalidInput, match="those of both"):
        fc.dimensions.pool([estimates_of([0.6], [0.1]), profile])
