"""Expected power of Fourier modes under a metric, beside sums over all pairs of points."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.dimensions._azimuths import PlaneModes, fit_azimuths
from fractalcontact.dimensions._gaussian_mixture import (
    ALIASED,
    FILTERED,
    UNALIASED,
    AxisBlur,
    Bins,
    alias_logs,
    mixture,
    spread_nodes,
    weights,
)
from fractalcontact.dimensions._metric_spectrum import (
    MetricSpectrum,
    gaussian_tables,
    metric_of,
    squared_length,
)
from fractalcontact.dimensions._mode_fit import first_fit
from fractalcontact.dimensions._spectral_posterior import DEPARTURE, Known
from fractalcontact.dimensions._surface_input import read_surfaces

SHAPE, DY = (36, 33), 1.3
STENCIL = {
    (0, 0): -2.0 / DY**2 - 2.0,
    (1, 0): DY**-2,
    (-1, 0): DY**-2,
    (0, 1): 1.0,
    (0, -1): 1.0,
}


def spectrum(hurst, log_ratio, noise=0.0):
    return MetricSpectrum(np.array([hurst, 0.0, noise, 0.0, 0.0, 1.0]), ALIASED, np.array(log_ratio), DY)


def by_pairs(hurst, metric, noise):
    """Return the expected squared modes of the tapered Laplacian of heights with the variogram (r' M r)^H.

    The covariance of the Laplacian is that of the heights, minus half the variogram, under both stencils.
    """
    modes = PlaneModes(SHAPE, DY, False)
    ny, nx = modes.shape
    y, x = np.meshgrid(np.arange(1 - ny, ny), np.arange(1 - nx, nx), indexing="ij")
    covariance = np.zeros(y.shape)
    for (a, one), (b, two) in itertools.product(STENCIL.items(), repeat=2):
        down, across = y + a[0] - b[0], x + a[1] - b[1]
        heights = -0.5 * squared_length(metric, down * DY, across * 1.0) ** hurst
        covariance += one * two * (heights + noise**2 * ((down == 0) & (across == 0)))
    taper = modes.taper
    pairs = np.zeros((ny, nx))
    rows, columns = np.arange(ny), np.arange(nx)
    for i, j in itertools.product(rows, columns):
        part = covariance[ny - 1 + rows - i][:, nx - 1 + columns - j] * taper
        phase = np.exp(2j * np.pi * (np.fft.fftfreq(ny)[:, None] * i + np.fft.fftfreq(nx) * j))
        pairs += taper[i, j] * (np.fft.fft2(part) * phase).real
    return pairs[:, : nx // 2 + 1] / np.sum(taper**2), modes


@pytest.mark.parametrize(("hurst", "ratio", "noise"), [(0.3, 4.0, 0.0), (0.8, 2.0, 0.0), (0.5, 3.0, 0.2)])
def test_expected_power_of_an_oblique_metric_is_that_of_all_pairs(hurst, ratio, noise):
    """To .1 %, but for the longest wave, whose density depends on the azimuth alone."""
    u, v = np.log(ratio) * np.cos(np.radians(60.0)), np.log(ratio) * np.sin(np.radians(60.0))
    expected, modes = by_pairs(hurst, metric_of(u, v), noise)
    q = np.hypot(modes.y, modes.x)
    others = modes.half & (q > 1.001 * q[modes.half].min())

    def deviations(*log_ratio):
        return np.abs(modes.expected(spectrum(hurst, log_ratio, noise))[0] / expected - 1.0)

    right = deviations(u, v)
    assert np.median(right[modes.half]) < 1e-3
    assert right[others].max() < 0.02
    for wrong in ((0.0, 0.0), (u, -v)):
        assert np.median(deviations(*wrong)[modes.half]) > 0.1


@pytest.mark.parametrize("dy", [0.2, 1.0, 4.0])
@pytest.mark.parametrize("ratio", [1.0, 4.0])
def test_densities_under_a_metric_are_sums_over_all_images(ratio, dy):
    """Spectrum and tables beside the plain sum; with dy = 4 they were off by a fifth."""
    hurst, log_ratio = 0.8, np.log(ratio) * np.array([np.cos(1.0), np.sin(1.0)])
    stream = np.random.default_rng(1)
    y, x = stream.uniform(-np.pi / dy, np.pi / dy, 40), stream.uniform(0.0, np.pi, 40)
    down, across = (2.0 * np.pi * np.arange(-200, 201) / d for d in (dy, 1.0))
    inverse = np.linalg.inv(metric_of(*log_ratio))
    images = squared_length(inverse, y[:, None, None] + down[:, None], x[:, None, None] + across)
    plain = (images ** (-1.0 - hurst)).sum(axis=(1, 2))
    theta = np.array([hurst, 0.0, 0.0, 0.0, 0.0, 1.0])
    t = mixture(64.0 * max(dy, 1.0))
    spectrum = MetricSpectrum(theta, ALIASED, log_ratio, dy)
    tables = gaussian_tables(t, np.zeros(1), spectrum, y, x, np.ones(y.size), np.arange(y.size))
    for found in (spectrum.at(y, x), tables[0, 0] @ weights(hurst, t, 0, 2)):
        deviation = np.log(found / plain)
        assert np.abs(deviation - np.median(deviation)).max() < 2e-3


@pytest.mark.parametrize(("dy", "largest"), [(0.25, 0.007), (1.0, 0.001), (4.0, 0.007)])
@pytest.mark.parametrize("hurst", [0.2, 0.5, 0.8])
def test_a_rolloff_leaves_the_aliases_of_its_waves(hurst, dy, largest):
    """Spectrum and bins beside the sum over images of a Matern density.

    Deviations were .005, .004 and .003 where aliases had the factor of the waves themselves, and up to .02
    with spacings of 4 to 1 where they had that of waves of one spacing along x.
    """
    theta = np.array([hurst, 0.0, 0.0, 2.0 * np.pi / 16.0 * max(1.0, 1.0 / dy), -1.0, 1.0])
    q, azimuth = np.geomspace(0.1, 3.1, 60), np.random.default_rng(2).uniform(-0.5 * np.pi, 0.5 * np.pi, 60)
    y, x = q * np.sin(azimuth) / dy, q * np.cos(azimuth)
    images = 2.0 * np.pi * np.arange(-200, 201)
    squares = (y[:, None, None] + images[:, None] / dy) ** 2 + (x[:, None, None] + images) ** 2
    plain = (squares + theta[3] ** 2) ** (-1.0 - hurst)
    # the integral over all images beyond the rectangle
    quarter = np.pi / 720.0 * (np.arange(360) + 0.5)
    edge = (images[-1] + np.pi) / np.maximum(np.sin(quarter) * dy, np.cos(quarter))
    beyond = np.mean(edge ** (-2.0 * hurst)) * dy / (4.0 * np.pi * hurst)
    expected = np.log(plain.sum(axis=(1, 2)) + beyond)
    spectrum, t = MetricSpectrum(theta, ALIASED, np.zeros(2), dy), mixture(64.0 * max(1.0, dy))
    spreads, nodes = spread_nodes(64.0, is_pilot=False)
    tables = gaussian_tables(t, spreads, spectrum, y, x, np.ones(y.size), np.arange(y.size))
    lnq, unit = 0.5 * np.log(y * y + x * x), np.ones(y.size)
    bins = Bins(expected, unit, tables, nodes, t, unit, lnq, alias_logs(y, x, dy, 2), 64.0, min(1.0, dy), 2)
    assert np.std(np.log(spectrum.at(y, x)) - expected) < 0.001
    assert np.std(bins.log_power(theta[None], ALIASED)[0][0] - expected) < largest


@pytest.mark.parametrize("form", [ALIASED, FILTERED, UNALIASED])
@pytest.mark.parametrize("dy", [0.25, 1.0, 4.0])
def test_densities_of_a_bent_and_blurred_spectrum_are_sums_over_all_images(form, dy):
    """Deviations were .84 after a filter of the points, and .30 after a blur, with spacings of 4 to 1."""
    hurst, spread, corner, reach = 0.8, 1.0, 0.5 * np.pi, 0 if form == UNALIASED else 40
    spectrum = MetricSpectrum(np.array([hurst, spread, 0.0, corner, -1.0, 1.0]), form, np.zeros(2), dy)
    y, x = np.random.default_rng(2).uniform(0.1, 3.1, (2, 60)) / np.array([[dy], [1.0]])
    images = 2.0 * np.pi * np.arange(-reach, reach + 1)
    squares = (y[:, None, None] + images[:, None] / dy) ** 2 + (x[:, None, None] + images) ** 2
    density = (squares + corner**2) ** (-1.0 - hurst)
    if form == FILTERED:
        by_axis = [AxisBlur(q).transfers(s)[1] for q, s in ((y * dy, spread / dy), (x, spread))]
        expected = density.sum(axis=(1, 2)) * np.square(by_axis[0] * by_axis[1])
    else:
        expected = (density * np.exp(-(spread**2) * squares)).sum(axis=(1, 2))
    deviation = np.log(spectrum.at(y, x) / expected)
    assert np.std(deviation) < 0.003


@pytest.mark.parametrize("anisotropy_ratio", [1.0, 1.15, 2.0])
def test_evidence_of_a_lay_by_quadrature(anisotropy_ratio):
    """The log ratio of lengths is zero, or, with the probability of a departure, normal: a sum over both."""
    surface = fc.surfaces.spectral(
        (64, 64), 1e-4, hurst=0.5, rms_height=1e-6, anisotropy_ratio=anisotropy_ratio, direction=30.0, rng=2
    )
    fit = fit_azimuths(first_fit(read_surfaces(surface)[0]), None, Known())
    classes, start = fit.classes, replace(fit.spectrum, log_ratio=fit.uv)
    weight = classes.count * classes.information

    def likelihood(uv):
        excess = classes.excess(classes.relative(replace(start, log_ratio=np.array(uv))))
        return np.exp(-weight @ (excess - np.log(1.0 + excess)) - least)

    least = 0.0  # of the logarithm, so that nothing underflows
    least = np.log(likelihood(fit.uv))
    deviation, step = np.log(2.0), 0.25 * np.sqrt(np.linalg.eigvalsh(fit.covariance)[0])
    steps = step * np.arange(-24, 25)
    nodes = [np.add(fit.uv, (du, dv)) for du in steps for dv in steps]
    prior = [np.exp(-0.5 * uv @ uv / deviation**2) / (2.0 * np.pi * deviation**2) for uv in nodes]
    with_lay = step**2 * sum(p * likelihood(uv) for p, uv in zip(prior, nodes, strict=True))
    expected = DEPARTURE * with_lay + (1.0 - DEPARTURE) * likelihood((0.0, 0.0))
    found = np.exp(-0.5 * classes.fit_metric(start)[2] - least)
    assert np.log(found) == pytest.approx(np.log(expected), abs=0.3)
