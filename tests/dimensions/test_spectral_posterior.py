"""The posterior of the exponent: Laplace's method beside quadrature, and limits that it must keep."""

from dataclasses import replace

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.dimensions import _spectral_posterior as sp
from fractalcontact.dimensions._mode_fit import first_fit
from fractalcontact.dimensions._surface_input import read_surfaces


def bins_of(hurst, n=96, seed=1):
    surface = fc.surfaces.fbm((n, n), 1e-4, hurst=hurst, rms_increment=1e-6, rng=seed)
    fit = first_fit(read_surfaces(surface)[0]).modes
    return fit.bins(fit.keep)


def log_density(bins, theta, form=0):
    """Return the log likelihood without discrepancy, amplitude integrated out, up to a constant."""
    residual, weight = bins.level - bins.log_power(theta[None], form)[0][0], 1.0 / bins.variance
    residual = residual - weight @ residual / weight.sum()
    return -0.5 * weight @ np.square(residual)


@pytest.mark.parametrize("hurst", [0.3, 0.7])
def test_one_exponent_by_quadrature(hurst):
    bins = bins_of(hurst)
    found = sp.posterior(bins, sp.Known(0.0, 0.0))
    plain = next(m for m, h in enumerate(found.hypotheses) if not h.fits(sp.CORNER) and h.form == 0)
    grid = np.linspace(0.01, 0.99, 500)
    logs = np.array([log_density(bins, np.array([h, 0.0, 0.0, 0.0, 0.0, 1.0])) for h in grid])
    weights = np.exp(logs - logs.max())
    mean = weights @ grid / weights.sum()
    deviation = np.sqrt(weights @ np.square(grid - mean) / weights.sum())
    u, du = found.centre[plain, 0], found.scale[plain, 0]
    from scipy.stats import norm

    laplace = sp.LOWEST + (sp.HIGHEST - sp.LOWEST) * norm.cdf(u)
    slope = (sp.HIGHEST - sp.LOWEST) * norm.pdf(u)
    assert abs(laplace - mean) < 0.1 * deviation
    assert du * slope == pytest.approx(deviation, rel=0.05)


def test_evidence_of_noise_by_quadrature():
    bins = bins_of(0.6)
    found = sp.posterior(bins, sp.Known(0.0))
    plain = [m for m, h in enumerate(found.hypotheses) if not h.fits(sp.CORNER) and h.form == 0]
    chosen = {found.hypotheses[m].fits(sp.NOISE): m for m in plain}
    ratio = found.share[chosen[True], 0] / found.share[chosen[False], 0]
    heights = np.linspace(0.01, 0.99, 100)
    # u of ln nu is normal; at equal steps of its probability the prior is a mean
    from scipy.stats import norm

    noises = np.exp(sp._PRIOR_NOISE[0] + sp._PRIOR_NOISE[1] * norm.ppf((np.arange(60) + 0.5) / 60))
    plain = np.array([log_density(bins, np.array([h, 0.0, 0.0, 0.0, 0.0, 1.0])) for h in heights])
    noisy = np.array(
        [[log_density(bins, np.array([h, 0.0, nu, 0.0, 0.0, 1.0])) for nu in noises] for h in heights]
    )
    top = plain.max()
    odds = sp._NOISY / (1.0 - sp._NOISY)
    expected = odds * np.mean(np.exp(noisy - top)) / np.mean(np.exp(plain - top))
    assert np.log(ratio) == pytest.approx(np.log(expected), abs=0.5)


def test_shares_sum_to_one():
    found = sp.posterior(bins_of(0.5))
    assert found.share.sum() == pytest.approx(1.0)
    kinds = {id(kind): kind for kind in found.discrepancies}  # a kind stands at each of its maxima
    assert sum(kind.prior for kind in kinds.values()) == pytest.approx(1.0)
    assert sum(np.exp(hypothesis.log_prior) for hypothesis in found.hypotheses) == pytest.approx(1.0)
    low, median, high, _ = found.interval()
    assert low < median < high


def test_level_changes_nothing():
    bins = bins_of(0.5)
    found = sp.posterior(bins).interval()
    bins.level[:] += 7.0
    assert sp.posterior(bins).interval() == pytest.approx(found, abs=1e-4)


MIXTURES = {
    "one": ([1.0], [0.3], [0.1]),
    "narrow": ([1.0], [0.3], [5e-4]),
    "skewed": ([0.7, 0.2, 0.1], [0.0, 0.1, 0.4], [0.05, 0.1, 0.3]),
    "two maxima": ([0.6, 0.4], [-0.5, 0.5], [0.1, 0.1]),
    "at the end": ([0.8, 0.2], [-2.0, -1.0], [0.5, 1.0]),
}


@pytest.mark.parametrize("name", MIXTURES)
def test_interval_is_the_shortest_by_root_finding(name):
    from scipy.optimize import brentq
    from scipy.special import ndtr, ndtri

    share, centre, scale = map(np.array, MIXTURES[name])

    def below(hurst):
        u = ndtri((hurst - sp.LOWEST) / (sp.HIGHEST - sp.LOWEST))
        return share @ ndtr((u - centre) / scale)

    def quantile(probability):
        u = brentq(lambda u: share @ ndtr((u - centre) / scale) - probability, -9.0, 9.0, xtol=1e-13)
        return sp.LOWEST + (sp.HIGHEST - sp.LOWEST) * ndtr(u)

    low, median, high, deviation = sp.mixture_interval(share, centre, scale)
    widths = [quantile(p + 0.95) - quantile(p) for p in np.linspace(1e-6, 0.05 - 1e-6, 401)]
    assert below(high) - below(low) == pytest.approx(0.95, abs=1e-3)
    assert high - low == pytest.approx(min(widths), rel=0.01)
    assert median == pytest.approx(quantile(0.5), abs=1e-3 * (high - low))
    drawn = np.random.default_rng(1)
    kind = drawn.choice(share.size, 200_000, p=share)
    u = centre[kind] + scale[kind] * drawn.standard_normal(kind.size)
    assert deviation == pytest.approx(np.std((sp.HIGHEST - sp.LOWEST) * ndtr(u)), rel=0.01)
    if name == "skewed":
        assert high - low < 0.97 * (quantile(0.975) - quantile(0.025))


def test_joint_interval_of_one_surface_is_its_own():
    found = sp.posterior(bins_of(0.5))
    low, _, high, _ = found.interval()
    assert sp.joint_interval([found]) == pytest.approx(found.interval(), abs=0.01 * (high - low))


def test_a_filter_of_first_order_only_weakens():
    """Beside levels that rise with the wavenumber it is impossible, beside falling ones certain."""
    bins = bins_of(0.5)
    steps = np.array([[0.5], [0.0], [-0.5]]) * np.exp(bins.lnq)
    rising, even, falling = np.exp(sp._log_weakening(bins, steps + 3.0))  # the amplitude does not matter
    assert rising < 1e-6
    assert even == pytest.approx(0.5)
    assert falling == pytest.approx(1.0)


def test_an_error_that_bins_share_adds_to_that_of_the_exponent():
    """Levels that may all be off as those of another exponent, by .025: its variance grows by the square."""
    from scipy.stats import norm

    bins = bins_of(0.6)

    def deviation(error):
        found = sp.posterior(replace(bins, shared=np.outer(error, error)), sp.Known(0.0, 0.0))
        u, scale = found.centre[0, 0], found.scale[0, 0]  # of an exact surface
        without_prior = 1.0 / np.sqrt(scale**-2.0 - 1.0)
        return (sp.HIGHEST - sp.LOWEST) * norm.pdf(u) * without_prior

    def levels(hurst):
        return bins.log_power(np.array([[hurst, 0.0, 0.0, 0.0, 0.0, 1.0]]), 0)[0][0]

    alone = deviation(np.zeros(bins.lnq.size))
    assert alone < 0.02
    assert deviation(np.full(bins.lnq.size, 0.05)) == pytest.approx(alone, rel=1e-3)  # the amplitude is free
    other = 0.025 / 2e-4 * (levels(0.6 + 1e-4) - levels(0.6 - 1e-4))
    assert deviation(other) == pytest.approx(np.hypot(alone, 0.025), rel=0.02)
