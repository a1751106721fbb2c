"""Closed forms of the self-affine spectrum against quadrature."""

import itertools

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import gamma, j0

from fractalcontact.base.errors import InvalidInput
from fractalcontact.surfaces import SelfAffine


@pytest.mark.parametrize("hurst", [0.2, 0.5, 0.8, 1.0])
@pytest.mark.parametrize("order", [0, 1, 2, 4])
def test_closed_moments_against_quadrature(hurst, order):
    spectrum = SelfAffine(hurst, 1e-3, 3e-4, 2e-6, plateau=4.0)
    low, corner, high = (2 * np.pi / length for length in (1e-3, 3e-4, 2e-6))

    def integrand(logarithm):
        q = np.exp(logarithm)
        return q ** (order + 2) * spectrum.psd(q) / (2 * np.pi)

    parts = [
        quad(integrand, np.log(a) + 1e-12, np.log(b) - 1e-12, epsrel=1e-11, limit=200)[0]
        for a, b in ((low, corner), (corner, high))
    ]
    assert spectrum.moment(order) == pytest.approx(sum(parts), rel=1e-8)


def test_scaled_spectrum_has_its_height_or_slope():
    assert SelfAffine.scaled(0.8, 1e-3, 1e-3, 1e-6, rms_height=2e-6).moments().rms_height == pytest.approx(
        2e-6
    )
    assert SelfAffine.scaled(0.8, 1e-3, 1e-3, 1e-6, rms_slope=0.1).moments().rms_slope == pytest.approx(0.1)
    assert SelfAffine(0.8, 1e-3, 1e-3, 1e-6).psd(np.array([0.0, 1e9])).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("hurst", [0.2, 0.5, 0.8, 1.0])
def test_autocorrelation_is_the_bessel_transform(hurst):

    spectrum = SelfAffine(hurst, 1e-3, 3e-4, 2e-5, plateau=4.0)
    low, corner, high = (2 * np.pi / length for length in (1e-3, 3e-4, 2e-5))
    lags = np.array([0.0, 1e-7, 3e-6, 2e-5, 1.3e-4, 5e-4])
    for lag, value in zip(lags, spectrum.autocorrelation(lags), strict=True):
        parts = [
            quad(lambda q, r=lag: q * spectrum.psd(q) * j0(q * r), a, b, epsrel=1e-11, limit=500)[0]
            for a, b in ((low, corner), (corner, high))
        ]
        assert value == pytest.approx(sum(parts) / (2 * np.pi), rel=1e-9, abs=1e-10 * spectrum.moment(0))
    # any shape, both signs
    assert spectrum.autocorrelation(-lags.reshape(2, 3)).shape == (2, 3)


def test_autocorrelation_of_a_wide_band_follows_a_power_law():
    """2 (A(0) - A(r)) follows r^2H between the cut-offs, with a known factor."""

    hurst = 0.4
    spectrum = SelfAffine(hurst, 1e3, 1e3, 1e-9)
    lags = np.array([1e-4, 1e-3])
    rise = 2 * (spectrum.autocorrelation(0.0) - spectrum.autocorrelation(lags))
    corner = 2 * np.pi / 1e3
    factor = corner ** (2 + 2 * hurst) / np.pi * gamma(1 - hurst) / (hurst * 4**hurst * gamma(1 + hurst)) / 2
    assert rise == pytest.approx(factor * lags ** (2 * hurst), rel=1e-3)


@pytest.mark.parametrize("hurst", [0.2, 0.5, 0.8])
def test_profile_spectrum_is_the_integral_across(hurst):

    spectrum = SelfAffine(hurst, 1e-3, 3e-4, 2e-6, plateau=4.0)
    low, corner, high = (2 * np.pi / length for length in (1e-3, 3e-4, 2e-6))
    for q in (0.0, 0.3 * low, 0.5 * corner, 3 * corner, 0.9 * high):
        edges = [np.sqrt(max(edge**2 - q**2, 0.0)) for edge in (low, corner, high)]
        parts = [
            quad(lambda p, q=q: float(spectrum.psd(np.hypot(p, q))), a, b, epsrel=1e-11, limit=500)[0]
            for a, b in itertools.pairwise(edges)
            if b > a
        ]
        assert float(spectrum.profile_psd(q)) == pytest.approx(sum(parts) / np.pi, rel=1e-6)
    assert spectrum.profile_psd(np.array([-2 * corner, 1.1 * high])).tolist()[1] == 0.0
    total = quad(lambda t: float(spectrum.profile_psd(np.exp(t))) * np.exp(t), np.log(low) - 25, np.log(high),
                 points=[np.log(low), np.log(corner)], epsrel=1e-9, limit=500)[0]  # fmt: skip
    assert total / np.pi == pytest.approx(spectrum.moment(0), rel=1e-6)


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ((2.0, 1e-3, 1e-4, 1e-5), "hurst"),
        ((0.5, -1.0, 1e-4, 1e-5), "long_cutoff"),
        ((0.5, np.inf, 1e-4, 1e-5), "long_cutoff"),
        ((0.5, 1e-3, 1e-2, 1e-5), "long_cutoff >= rolloff"),
        ((0.5, 1e-3, 1e-4, 1e-3), "rolloff >= short_cutoff"),
        (("rough", 1e-3, 1e-4, 0.0), "short_cutoff"),
    ],
)
def test_invalid_spectra_are_refused(arguments, problem):
    with pytest.raises(InvalidInput, match=problem):
        SelfAffine.scaled(*arguments, rms_height=1e-6)


@pytest.mark.parametrize(
    ("cutoffs", "rms", "problem"),
    [
        ((1e-4, 1e-4, 1e-4), {"rms_height": 1e-6}, "long_cutoff > short_cutoff"),
        ((1e-4, 1e-4, 1e-6), {"rms_height": -1e-6}, "rms_height"),
        ((1e-4, 1e-4, 1e-6), {"rms_slope": np.nan}, "rms_slope"),
    ],
)
def test_a_spectrum_that_cannot_have_the_rms_is_refused(cutoffs, rms, problem):
    with pytest.raises(InvalidInput, match=problem):
        SelfAffine.scaled(0.5, *cutoffs, **rms)
