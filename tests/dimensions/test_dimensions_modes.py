"""The likelihood's parts against dense linear algebra written here."""

import numpy as np
import pytest
import scipy.fft
import scipy.stats

import fractalcontact as fc
from fractalcontact.base import threads
from fractalcontact.dimensions import _cosine_modes, _periodic_modes, _profile_likelihood, _whittle
from fractalcontact.dimensions._periodic_modes import PeriodicModes


def squares(shape, steps, observed=None):
    y, x = (p.ravel() for p in np.indices(shape))
    if observed is not None:
        y, x = y[observed.ravel()], x[observed.ravel()]
    return (steps[0] * (y[:, None] - y)) ** 2 + (steps[1] * (x[:, None] - x)) ** 2


def orthonormal_modes(shape):
    """Rows: orthonormal cosine modes that vary along both axes."""
    points = np.eye(shape[0] * shape[1]).reshape(-1, *shape)
    return scipy.fft.dctn(points, axes=(1, 2), norm="ortho")[:, 1:, 1:].reshape(points.shape[0], -1).T


@pytest.mark.parametrize("shape", [(9, 9), (8, 13), (3, 20)])
@pytest.mark.parametrize("ratio", [1.0, 2.5])
@pytest.mark.parametrize("hurst", [0.05, 0.5, 0.9])
def test_expected_power_is_that_of_the_dense_covariance(shape, ratio, hurst):
    lattice = _cosine_modes.Lattice.of(shape, (ratio, 1.0))
    modes = orthonormal_modes(shape)
    dense = -(squares(shape, (ratio, 1.0)) ** hurst) / (1.0 - hurst)
    expected = np.einsum("ki,ij,kj->k", modes, dense, modes)
    np.testing.assert_allclose(_cosine_modes.expected_power(lattice, hurst).ravel(), expected, rtol=1e-10)


def test_expected_power_passes_smoothly_through_one():
    lattice = _cosine_modes.Lattice.of((16, 16), (1.0, 1.0))
    below, at, above = (_cosine_modes.expected_power(lattice, h) for h in (1 - 1e-5, 1.0, 1 + 1e-5))
    assert (at > 0).all()
    np.testing.assert_allclose(0.5 * (below + above), at, rtol=1e-7)


def test_power_is_the_square_of_the_modes_and_blind_to_planes_rows_and_columns():
    rng = np.random.default_rng(1)
    heights = rng.standard_normal((12, 15))
    expected = (orthonormal_modes((12, 15)) @ heights.ravel()) ** 2
    np.testing.assert_allclose(_cosine_modes.mode_power(heights).ravel(), expected, rtol=1e-10, atol=1e-14)
    moved = heights + rng.standard_normal((12, 1)) + rng.standard_normal(15) + 3.0 * np.arange(15)
    np.testing.assert_allclose(_cosine_modes.mode_power(moved).ravel(), expected, rtol=1e-8, atol=1e-12)


def test_wavelengths_along_the_diagonal():
    lengths = _cosine_modes.wavelengths(_cosine_modes.Lattice.of((10, 20), (2.0, 1.0)))
    assert lengths.shape == (9, 19)
    assert lengths[0, 0] == pytest.approx(1.0 / np.hypot(1 / 40, 1 / 40))


def chi_square(expected, rng):
    return expected * rng.standard_normal(expected.size) ** 2


def test_fit_finds_the_parameters_of_perfect_data():
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


def test_standard_error_is_the_scatter_of_independent_modes():
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


def test_misfit_sees_a_bent_spectrum():
    rng = np.random.default_rng(4)
    lattice = _cosine_modes.Lattice.of((48, 48), (1.0, 1.0))
    model = lambda h: _cosine_modes.expected_power(lattice, h).ravel()  # noqa: E731
    bent = model(0.8) / (1.0 + (_cosine_modes.wavelengths(lattice).ravel() / 10.0) ** 3)
    assert abs(_whittle.fit_power(chi_square(bent, rng), model, 0.5).misfit) > 4.0


@pytest.fixture(scope="module")
def holes():
    rng = np.random.default_rng(5)
    observed = rng.random((12, 14)) > 0.15
    observed[4:7, 0:4] = False
    observed[0, -1] = observed[-1, 0] = observed[0, 0] = observed[-1, -1] = True
    return observed


def test_filling_is_exact_on_planes_and_its_transpose_is_its_transpose(holes):
    filling = _cosine_modes.Filling(holes, (2.0, 1.0))
    y, x = np.indices(holes.shape)
    plane = 0.3 * y - 0.1 * x + 5.0
    assert np.abs(filling(plane[holes])).max() < 1e-12
    rng = np.random.default_rng(6)
    face, values = rng.standard_normal(holes.shape), rng.standard_normal(holes.sum())
    assert np.sum(filling(values) * face) == pytest.approx(values @ filling.transpose(face), rel=1e-12)


def test_filling_without_holes_only_takes_the_plane_off():
    whole = np.ones((5, 6), dtype=bool)
    values = np.random.default_rng(7).standard_normal(30)
    filled = _cosine_modes.Filling(whole, (1.0, 1.0))(values)
    columns = np.stack([np.ones(30), *(p.ravel() for p in np.indices((5, 6)))], axis=1)
    rest = values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]
    np.testing.assert_allclose(filled.ravel(), rest, atol=1e-13)


def test_excess_and_covariance_of_gapped_modes_against_dense_algebra(holes):
    hurst = 0.6
    lattice = _cosine_modes.Lattice.of(holes.shape, (1.0, 1.0))
    gapped = _cosine_modes.GappedModes(lattice, holes, 0.5, probes=500)
    filling = _cosine_modes.Filling(holes, (1.0, 1.0))
    operator = np.array([_cosine_modes.cosine_modes(filling(e)).ravel() for e in np.eye(holes.sum())]).T
    dense = operator @ (-(squares(holes.shape, (1, 1), holes) ** hurst) / (1 - hurst)) @ operator.T
    complete = _cosine_modes.expected_power(lattice, hurst).ravel()
    reference = gapped.reference_power().ravel()
    excess = gapped.excess(hurst).ravel()
    assert np.sum((np.diag(dense) - complete) / reference) == pytest.approx(
        np.sum(excess / reference), rel=0.04
    )
    white = np.sum(operator**2, axis=1) - 1.0
    assert np.sum(white / reference) == pytest.approx(
        np.sum(gapped.white_excess().ravel() / reference), rel=0.04
    )
    weights = np.random.default_rng(8).standard_normal((2, *gapped.reference_power().shape))
    scaled = dense / np.sqrt(np.outer(reference, reference))
    exact = [[2 * np.sum(a.ravel()[:, None] * scaled * b.ravel() * scaled) for b in weights] for a in weights]
    found = gapped.score_covariance(weights, hurst)
    np.testing.assert_allclose(np.diag(found), np.diag(exact), rtol=0.05)
    assert abs(found[0, 1] - exact[0][1]) < 0.1 * np.sqrt(exact[0][0] * exact[1][1])


def test_profile_likelihood_is_the_dense_one():
    rng = np.random.default_rng(9)
    heights = np.cumsum(rng.standard_normal(60))
    heights[[3, 4, 20, 41]] = np.nan
    places = np.flatnonzero(np.isfinite(heights)).astype(float)
    jumps, gaps = np.diff(heights[np.isfinite(heights)]), np.diff(places)

    def dense(hurst, noise):
        rise = -0.5 * np.abs(places[:, None] - places) ** (2 * hurst) + noise * np.eye(places.size)
        covariance = np.diff(np.diff(rise, axis=0), axis=1)
        inverse = np.linalg.inv(covariance)
        own = gaps @ inverse @ gaps
        square = jumps @ inverse @ jumps - (jumps @ inverse @ gaps) ** 2 / own
        freedom = jumps.size - 1
        return np.linalg.slogdet(covariance)[1] + np.log(own) + freedom * np.log(square / freedom)

    increments = _profile_likelihood.ProfileIncrements(heights)
    for hurst, noise in ((0.2, 0.0), (0.7, 0.3), (0.95, 0.0)):
        assert increments.solve(hurst, noise)[0] == pytest.approx(dense(hurst, noise), rel=1e-10)


def test_chunks_of_a_profile_add_up_and_regular_ones_share_a_factor():
    heights = np.cumsum(np.random.default_rng(10).standard_normal(600))
    whole = _profile_likelihood.ProfileIncrements(heights)
    assert whole.positions.shape == (3, 200)
    assert whole.is_regular
    deviance, amplitude = whole.solve(0.6, 0.1)
    whole.is_regular = False
    again = whole.solve(0.6, 0.1)
    assert (deviance, amplitude) == pytest.approx(again, rel=1e-12)


def test_profile_fit_does_not_depend_on_threads():
    heights = np.cumsum(np.random.default_rng(11).standard_normal(1100))
    heights[::97] = np.nan
    found = []
    for count in (1, 2):
        with threads.limit(count):
            found.append(_profile_likelihood.fit_profile(heights))
    assert found[0] == found[1]


def test_band_of_a_periodic_spectrum():
    rng = np.random.default_rng(12)
    heights = rng.standard_normal((128, 128))
    q = np.hypot(np.fft.fftfreq(128, 1 / 128)[:, None], np.fft.fftfreq(128, 1 / 128))
    amplitude = np.where((q >= 4) & (q <= 40), np.maximum(q, 10) ** -1.7, 0.0)
    face = np.fft.ifft2(np.fft.fft2(heights) * amplitude).real
    low, high = _periodic_modes.band(PeriodicModes.of(face, (1.0, 1.0)))
    assert 9.0 < low < 13.0
    assert 38.0 < high <= 40.0
    whole = np.fft.ifft2(np.fft.fft2(heights) * np.where(q > 0, np.maximum(q, 1) ** -1.7, 0)).real
    assert _periodic_modes.band(PeriodicModes.of(whole, (1.0, 1.0))) == (-np.inf, np.inf)


@pytest.mark.parametrize("shape", [1024, (4, 700)])
def test_one_weak_mode_is_no_cut_off(shape):
    faces = fc.surfaces.spectral(shape, 1.0, hurst=0.5, rms_height=1.0, rng=4, members=5)
    steps = (1.0,) * (faces.ndim - 1)
    highest = [_periodic_modes.band(PeriodicModes.of(face.values, steps))[1] for face in faces]
    longest = max(faces.shape[1:])
    assert min(highest) >= 0.5 * longest - 4


def modes_of_a_profile(power):
    wavenumber = np.arange(1.0, power.size + 1)
    return PeriodicModes(power, wavenumber, np.full(power.size, 2.0), 1)


def test_running_sums_are_the_likelihood_of_every_corner():
    modes = modes_of_a_profile(np.random.default_rng(12).exponential(size=40))
    hurst, q = 0.4, modes.wavenumber
    deviances = _periodic_modes.RolloffLikelihood(modes).deviances(hurst)
    assert deviances.size == 40 - _periodic_modes.LEAST_BEYOND
    for k in (0, 5, 32):
        expected = np.maximum(q, q[k]) ** (-1 - 2 * hurst)
        expected *= np.mean(modes.power / expected)
        direct = -2.0 * scipy.stats.expon.logpdf(modes.power, scale=expected).sum()
        # the sum of all squares over their expectations is the number of modes, twice
        assert deviances[k] == pytest.approx(direct - 2.0 * q.size, rel=1e-12)


@pytest.mark.parametrize(("corner", "count"), [(0, 32), (8, 64), (20, 128)])
def test_the_interval_of_a_profile_knows_that_its_plateau_is_not_known(corner, count):
    """Modes drawn from the model: 300 of them tell a coverage of .95 to .0126."""
    rng, held = np.random.default_rng([13, corner]), 0
    for _ in range(300):
        expected = np.maximum(np.arange(1.0, count + 1), corner) ** -2.0
        found = _periodic_modes.fit_rolloff(modes_of_a_profile(expected * rng.exponential(size=count)))
        held += found.low <= 0.5 <= found.high
    assert 0.95 - 3 * 0.0126 < held / 300 < 0.95 + 3 * 0.0126


def test_noise_of_a_periodic_profile_is_found_without_an_interval():
    profile = fc.surfaces.spectral(2048, 1.0, hurst=0.6, rms_height=30.0, rolloff=128.0, rng=14)
    noisy = profile + np.random.default_rng(15).standard_normal(2048)
    found = fc.dimensions.estimate(noisy, noise=True)
    assert found.noise_height.item() == pytest.approx(1.0, abs=0.25)
    assert found.hurst.item() == pytest.approx(0.6, abs=0.15)
    assert np.isnan(found.ci_low.item())
    assert "noise" in found.ci_low.attrs["reason"]


def test_a_cut_off_under_noise_leaves_no_interval():
    face = fc.surfaces.spectral((64, 64), 1.0, hurst=0.5, rms_height=10.0, short_cutoff=4.0, rng=16)
    noisy = face + 0.3 * np.random.default_rng(17).standard_normal(face.shape)
    assert "scales" in fc.dimensions.estimate(noisy, noise=True).ci_low.attrs["reason"]
    told = fc.dimensions.estimate(noisy, noise=True, scales=(5.0, 100.0))
    assert told.ci_low.item() < 0.5 < told.ci_high.item()


def test_a_short_plateau_of_a_profile_is_seen():
    faces = fc.surfaces.spectral(
        512, 1.0, hurst=0.5, rms_height=1.0, rolloff=64.0, short_cutoff=4.0, rng=5, members=30
    )
    found = fc.dimensions.estimate(faces)
    held = (found["ci_low"] <= 0.5) & (found["ci_high"] >= 0.5)
    assert float(held.mean()) > 0.85
    assert abs(float(found["hurst"].mean()) - 0.5) < 0.04
