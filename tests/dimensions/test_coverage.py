"""Many surfaces: error against the least possible one, and coverage of the intervals.

The least standard deviation of H from n x n points of an exact fractional Brownian surface of unknown
amplitude is sqrt(2 / var(d ln f / dH)) / n, f being the aliased spectral density and the variance being over
all wavevectors; it is computed here, and not taken from the package.
"""

import numpy as np
import pytest

import fractalcontact as fc

pytestmark = pytest.mark.slow
MEMBERS = {64: 600, 128: 200, 256: 60}


def aliased(hurst, points=256, images=6):
    """Spectral density of the sampled surface; the tail of the sum over images as an integral."""
    w = (np.arange(points) + 0.5) / points * np.pi
    total = np.zeros((points, points))
    for i in range(-images, images + 1):
        for j in range(-images, images + 1):
            total += ((w[:, None] + 2 * np.pi * i) ** 2 + (w + 2 * np.pi * j) ** 2) ** (-hurst - 1)
    # outside the square of side 2 images + 1
    edge = (2 * images + 1) * np.pi
    angle = (np.arange(2000) + 0.5) / 2000 * np.pi / 4
    tail = 8 * np.mean((edge / np.cos(angle)) ** (-2 * hurst)) * np.pi / 4 / (2 * hurst) / (2 * np.pi) ** 2
    return total + tail


def bound(hurst, noise=0.0, step=1e-4):
    """Return n times the least standard deviation of H, the noise being unknown if there is any."""

    def density(h):
        # half the mean square increment over one spacing is one
        f = aliased(h)
        w = (np.arange(256) + 0.5) / 256 * np.pi
        return f / np.mean(f * (1 - np.cos(w)))

    middle = density(hurst) + noise
    slope = (density(hurst + step) - density(hurst - step)) / (2 * step) / middle
    columns = [np.ones(slope.size), slope.ravel()] + ([1.0 / middle.ravel()] if noise else [])
    information = 0.5 * np.cov(np.stack(columns[1:]), bias=True).reshape(len(columns) - 1, -1)
    return float(np.sqrt(np.linalg.inv(information)[0, 0]))


def sample(shape, hurst, members, seed, spacing=1e-4):
    rng = np.random.default_rng([seed, int(1000 * hurst), *shape])
    for _ in range(members):
        yield fc.surfaces.fbm(shape, spacing, hurst=hurst, rms_increment=1e-6, rng=rng), rng


def table(surfaces, methods, **options):
    """Return hurst, ci_low and ci_high: (members, methods) each."""
    result = [fc.dimensions.estimate(surface, methods, **options) for surface in surfaces]
    return tuple(
        np.array([dataset[key].values for dataset in result]) for key in ("hurst", "ci_low", "ci_high")
    )


def rms(values):
    return np.sqrt(np.mean(np.square(values), axis=0))


def covered(low, high, hurst):
    """Coverage, and how far it may fall from .95: .02, or two binomial standard deviations."""
    share = np.mean((low <= hurst) & (hurst <= high), axis=0)
    return share, max(0.02, 2.2 * np.sqrt(0.95 * 0.05 / len(low)))


def is_fair(low, high, hurst, least=np.inf, slack=0.0):
    """Whether the intervals of the default and of increments hold H as often as they should.

    Those of the default hold it in up to .98, as any departure widens them: they are at most 1.6 times as
    wide as those of the `least` standard deviation.
    """
    share, allowed = covered(low, high, hurst)
    too_low, too_high = 0.95 - share, share[1:] - 0.95
    of_default = 0.98 + 2.2 * np.sqrt(0.98 * 0.02 / len(low))  # two binomial standard deviations
    width = np.median(high - low, axis=0)[0] / (2 * 1.96 * least)
    holds = (too_low < allowed + slack).all() and (too_high < allowed + slack).all()
    return bool(holds and share[0] < of_default + slack and width < 1.6)


def test_bound_equals_published_values():
    published = {0.1: 0.512, 0.3: 0.856, 0.5: 1.029, 0.7: 1.130, 0.9: 1.194}
    for hurst, value in published.items():
        assert bound(hurst) == pytest.approx(value, rel=0.01)


@pytest.mark.parametrize("n", [64, 128, 256])
@pytest.mark.parametrize("hurst", [0.1, 0.3, 0.5, 0.7, 0.9])
def test_error_and_coverage_of_fbm(n, hurst):
    members = MEMBERS[n]
    surfaces = (surface for surface, _ in sample((n, n), hurst, members, 1))
    estimates, low, high = table(surfaces, ["default", "increments"])
    scatter = 1.0 + 2.2 / np.sqrt(2 * members)
    assert (rms(estimates - hurst) * n / bound(hurst) < np.array([1.15, 1.4]) * scatter).all()
    assert is_fair(low, high, hurst, bound(hurst) / n)


@pytest.mark.parametrize("hurst", [0.1, 0.3, 0.5, 0.7, 0.9])
def test_noise_of_a_tenth_of_the_variogram(hurst):
    """Variance of the noise: a tenth of half the mean square increment over one spacing."""
    n, members = 256, 40
    surfaces = (
        surface.copy(data=surface.values + np.sqrt(0.05) * 1e-6 * rng.standard_normal(surface.shape))
        for surface, rng in sample((n, n), hurst, members, 2)
    )
    result = [
        fc.dimensions.estimate(surface, noise=np.sqrt(0.05) * 1e-6).isel(method=0) for surface in surfaces
    ]
    error = np.array([float(dataset.hurst) for dataset in result]) - hurst
    least = bound(hurst, 0.1) / n
    assert abs(error.mean()) < 0.02
    assert rms(error) < 1.3 * least * (1.0 + 2.2 / np.sqrt(2 * members))
    height = np.array([float(dataset.noise_height) for dataset in result])
    # where noise and roughness look alike, only the sum of both is known well
    assert np.mean(height**2) == pytest.approx(0.05e-12, rel=0.1 if hurst > 0.4 else 1.0)


@pytest.mark.parametrize("hurst", [0.2, 0.5, 0.85])
@pytest.mark.parametrize("gaps", ["random", "blocks"])
def test_coverage_with_gaps(hurst, gaps):
    n, members = 96, 200
    allowed = 1.25 * np.sqrt(0.9)  # a full surface of as many points has the edge n sqrt(.9)

    def gapped():
        for surface, rng in sample((n, n), hurst, members, 3):
            heights = surface.values.copy()
            if gaps == "random":
                heights[rng.random(heights.shape) < 0.1] = np.nan
            while np.isfinite(heights).mean() > 0.9:
                y, x, *size = *rng.integers(0, n - 4, 2), *rng.integers(4, n // 6, 2)
                heights[y : y + size[0], x : x + size[1]] = np.nan
            yield surface.copy(data=heights)

    estimates, low, high = table(gapped(), ["default", "increments"])
    least = bound(hurst) / (n * 0.9)
    assert rms(estimates - hurst)[0] < allowed * least * (1.0 + 2.2 / np.sqrt(2 * members))
    assert is_fair(low, high, hurst, least, slack=0.01)


@pytest.mark.parametrize("hurst", [0.2, 0.5, 0.85])
def test_unequal_spacings(hurst):
    members = 200
    surfaces = (surface for surface, _ in sample((64, 64), hurst, members, 4, (3e-4, 1e-4)))
    estimates, low, high = table(surfaces, ["default", "increments"])
    assert (rms(estimates - hurst) < 1.25 * 1.15 * bound(hurst) / 64).all()
    assert is_fair(low, high, hurst)


TWO_OCTAVES = {"long_cutoff": 64e-4, "rolloff": 16e-4, "short_cutoff": 4e-4}
TOO_HIGH = pytest.mark.xfail(reason="the exponent of two octaves is too high: .85 of the intervals hold .2")
OF_BANDS = [
    (0.2, {}), (0.5, {}), (0.9, {}), (0.5, TWO_OCTAVES), (0.9, TWO_OCTAVES),
    pytest.param(0.2, TWO_OCTAVES, marks=TOO_HIGH),
]  # fmt: skip


@pytest.mark.parametrize(("hurst", "cut"), OF_BANDS)
def test_periodic_family(hurst, cut):
    """All modes of a square band: n times the least standard deviation is 1.383."""
    n, members = 128, 200
    surfaces = (
        fc.surfaces.spectral((n, n), 1e-4, hurst=hurst, rms_height=1e-6, rng=[5, k], **cut)
        for k in range(members)
    )
    estimates, low, high = table(surfaces, ["default"])
    if not cut:
        assert rms(estimates - hurst)[0] * n < 1.1 * 1.383
    assert is_fair(low, high, hurst, slack=0.01)


@pytest.mark.parametrize("hurst", [0.1, 0.5, 0.9])
def test_profiles(hurst):
    surfaces = (surface for surface, _ in sample((400,), hurst, 300, 6))
    estimates, low, high = table(surfaces, ["default", "increments"])
    assert rms(estimates - hurst)[0] * 20 < 0.85
    assert is_fair(low, high, hurst)
