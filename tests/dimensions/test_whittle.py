"""Whittle fit on exact and on random modes."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.dimensions import _cosine_modes, _whittle


def chi_square(expected, rng):
    return expected * rng.standard_normal(expected.size) ** 2


def test_fit_recovers_parameters_of_exact_data():
    lattice = _cosine_modes.Lattice.of((40, 40), (1.0, 1.0))
    model = lambda h: _cosine_modes.expected_power(lattice, h).ravel()  # noqa: E731
    for hurst in (0.03, 0.3, 0.8, 0.99, 1.3):
        fit = _whittle.fit_power(4.0 * model(hurst), model, 0.5)
        assert fit.converged
        assert fit.hurst == pytest.approx(hurst, rel=2e-4)
        assert fit.amplitude == pytest.approx(4.0, rel=1e-2)
        assert abs(fit.misfit) < 0.05
    noisy = _whittle.fit_power(4.0 * (model(0.6) + 0.07), model, 0.3, noise=0.01)
    assert noisy.hurst == pytest.approx(0.6, rel=1e-3)
    assert noisy.noise == pytest.approx(0.28, rel=1e-2)
    assert noisy.noise_note == ""
    smoothed = _whittle.fit_power(4.0 * (model(0.6) - 0.02), model, 0.6, noise=0.01)
    assert smoothed.noise == pytest.approx(-0.08, rel=0.05)
    assert "negative" in smoothed.noise_note


def test_white_noise_ends_at_the_limit_of_the_range():
    lattice = _cosine_modes.Lattice.of((40, 40), (1.0, 1.0))
    model = lambda h: _cosine_modes.expected_power(lattice, h).ravel()  # noqa: E731
    assert not _whittle.fit_power(np.ones(39**2), model, 0.5).converged
    white = 1e-6 * np.random.default_rng(1).standard_normal((128, 128))
    result = fc.dimensions.estimate(fc.surfaces.from_array(white, 1e-4)).isel(method=0)
    assert "limit of its range" in result.hurst.attrs["comment"]
    assert float(result.hurst) < 1e-3


def test_standard_error_equals_scatter():
    rng = np.random.default_rng(3)
    lattice = _cosine_modes.Lattice.of((32, 32), (1.0, 1.0))
    model = lambda h: _cosine_modes.expected_power(lattice, h).ravel()  # noqa: E731
    truth = model(0.6)
    fits = [_whittle.fit_power(chi_square(truth, rng), model, 0.5) for _ in range(60)]
    scores = np.array([(f.hurst - 0.6) / f.standard_error for f in fits])
    assert 0.75 < scores.std() < 1.25
    assert abs(scores.mean()) < 0.5
    misfits = np.array([f.misfit for f in fits])
    assert 0.7 < misfits.std() < 1.3


def test_misfit_of_bent_spectrum():
    rng = np.random.default_rng(4)
    lattice = _cosine_modes.Lattice.of((48, 48), (1.0, 1.0))
    model = lambda h: _cosine_modes.expected_power(lattice, h).ravel()  # noqa: E731
    bent = model(0.8) / (1.0 + (_cosine_modes.wavelengths(lattice).ravel() / 10.0) ** 3)
    assert abs(_whittle.fit_power(chi_square(bent, rng), model, 0.5).misfit) > 4.0
