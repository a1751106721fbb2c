"""Midpoint displacement, Weierstrass surfaces, and what holds for every maker of surfaces."""

import json
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput
from fractalcontact.surfaces import _midpoints

MAKERS = {
    "fbm": {"hurst": 0.6, "rms_increment": 1e-6},
    "midpoint": {"hurst": 0.6, "rms_increment": 1e-6},
    "spectral": {"hurst": 0.6, "rms_height": 1e-6},
    "weierstrass": {"hurst": 0.6, "rms_height": 1e-6},
}


def made(name, shape=(9, 14), spacing=1e-3, rng=1, **options):
    return getattr(fc.surfaces, name)(shape, spacing, rng=rng, **{**MAKERS[name], **options})


@pytest.mark.parametrize("name", MAKERS)
@pytest.mark.parametrize("shape", [(3, 3), (3, 17), (11, 7), (16, 16)])
def test_every_shape(name, shape):
    surface = made(name, shape)
    assert surface.shape == shape
    assert surface.dims == ("y", "x")
    assert np.isfinite(surface.values).all()
    assert surface.values.std() > 0
    assert surface.attrs["units"] == "m"
    assert json.loads(surface.attrs["provenance"])["random"]["entropy"] == "1"


@pytest.mark.parametrize("name", MAKERS)
def test_same_stream_same_surface_and_members(name):
    np.testing.assert_array_equal(made(name).values, made(name).values)
    assert np.abs(made(name, rng=2).values - made(name).values).max() > 0
    np.testing.assert_array_equal(made(name, members=3).values[:2], made(name, members=2).values)


@pytest.mark.parametrize("members", [None, 2])
@pytest.mark.parametrize("name", MAKERS)
def test_a_file_alone_tells_how_to_make_its_surface_again(name, members, tmp_path):
    """Also where the stream had been drawn from, and had had children."""
    stream = np.random.default_rng(8)
    stream.random(3)
    stream.spawn(1)
    surface = made(name, rng=stream, members=members)
    kept = fc.open(fc.save(surface, tmp_path / "surface.nc"))
    again = made(name, rng=json.loads(kept.attrs["provenance"])["random"], members=members)
    np.testing.assert_array_equal(again.values, surface.values)


@pytest.mark.parametrize("name", MAKERS)
def test_powers_of_two_change_no_bit(name):
    lengths = {key: 2.0**20 * value for key, value in MAKERS[name].items() if key != "hurst"}
    scaled = made(name, spacing=1e-3 * 2.0**-20, **lengths)
    np.testing.assert_array_equal(scaled.values, made(name).values * 2.0**20)


RESULTS = {
    **{name: lambda name=name: made(name, members=2) for name in MAKERS},
    "from_array": lambda: fc.surfaces.from_array(np.eye(5), 1e-3, periodic=True),
    "level": lambda: fc.surfaces.level(made("fbm")),
    "fill": lambda: fc.surfaces.fill(made("fbm").where(made("fbm").x > 2e-3)),
    "describe": lambda: fc.surfaces.describe(made("fbm", members=2)),
    "flat": lambda: fc.surfaces.describe(0.0 * made("fbm").assign_attrs(units="m")),
}


@pytest.mark.parametrize("name", RESULTS)
def test_every_result_is_clean_on_disk_and_comes_back(name, tmp_path, compliance):
    found = RESULTS[name]()
    fc.save(found, tmp_path / "a.nc")
    assert compliance(tmp_path / "a.nc") == []
    xr.testing.assert_identical(fc.open(tmp_path / "a.nc"), found)


@pytest.mark.parametrize("hurst", [0.2, 0.5, 0.8])
def test_first_two_generations_of_midpoints(covariance_of, hurst):
    # corners are exact; the centre and the edges differ from the mean of their neighbours as they should
    covariance = covariance_of(
        lambda stream: _midpoints.displaced(1, (1.0, 1.0), hurst, stream, additions=False)
    )

    def spread(point, neighbours):
        weights = np.zeros(9)
        weights[point] += 1.0
        weights[neighbours] -= 1.0 / len(neighbours)
        return weights @ covariance @ weights

    def exact(point, neighbours):
        places = np.array([divmod(k, 3) for k in range(9)], dtype=float)
        variogram = np.hypot(*(places[:, None] - places).transpose(2, 0, 1)) ** (2 * hurst)
        return variogram[point, neighbours].mean() - 0.5 * variogram[np.ix_(neighbours, neighbours)].mean()

    for corner, other in ((0, 2), (0, 6), (0, 8), (2, 6)):
        lag = np.hypot(*np.subtract(divmod(corner, 3), divmod(other, 3)))
        assert spread(corner, [other]) == pytest.approx(lag ** (2 * hurst), rel=1e-12)
    assert spread(4, [0, 2, 6, 8]) == pytest.approx(exact(4, [0, 2, 6, 8]), rel=1e-12)
    for edge, neighbours in ((1, [0, 2, 4]), (3, [0, 6, 4]), (5, [2, 8, 4]), (7, [6, 8, 4])):
        assert spread(edge, neighbours) == pytest.approx(exact(edge, neighbours), rel=1e-12)


def test_midpoints_know_no_preferred_axis(covariance_of):
    covariance = covariance_of(
        lambda stream: _midpoints.displaced(2, (1.0, 1.0), 0.7, stream, additions=True)
    )
    plane = covariance.reshape(5, 5, 5, 5)
    variogram = np.einsum("ijij->ij", plane)[:, :, None, None] + np.einsum("ijij->ij", plane) - 2 * plane
    np.testing.assert_allclose(variogram, variogram.transpose(1, 0, 3, 2), atol=1e-12)
    np.testing.assert_allclose(variogram, variogram[::-1, ::-1, ::-1, ::-1], atol=1e-12)


TABLE = {  # relative errors of the mean square increment at lags 1, 8, 64, as the docstring has them
    (False, 0.1): (0.04, 0.73, 1.18),
    (False, 0.3): (0.02, 0.08, 0.07),
    (False, 0.5): (-0.02, -0.24, -0.27),
    (False, 0.7): (-0.10, -0.37, -0.38),
    (False, 0.9): (-0.23, -0.37, -0.36),
    (True, 0.1): (0.04, 0.75, 1.23),
    (True, 0.3): (0.02, 0.09, 0.11),
    (True, 0.5): (-0.02, -0.23, -0.25),
    (True, 0.7): (-0.11, -0.38, -0.37),
    (True, 0.9): (-0.29, -0.44, -0.39),
}


@pytest.mark.slow
@pytest.mark.parametrize(("additions", "hurst"), TABLE)
def test_documented_error_of_midpoint_displacement(additions, hurst):
    heights = fc.surfaces.midpoint(
        (129, 129), 1.0, hurst=hurst, rms_increment=1.0, additions=additions, members=600, rng=77
    ).values
    for lag, wanted in zip((1, 8, 64), TABLE[additions, hurst], strict=True):
        squares = np.mean((heights[:, :, lag:] - heights[:, :, :-lag]) ** 2, axis=(1, 2)) / lag ** (2 * hurst)
        error = squares.std() / np.sqrt(600)
        assert abs(squares.mean() - 1 - wanted) < 4 * error + 0.005 + 4 * error * np.sqrt(600 / 1500)


def test_weierstrass_has_the_height_asked_for():
    for shape in ((40, 50), 64):
        surface = made("weierstrass", shape, rms_height=3.0)
        assert surface.values.std() == pytest.approx(3.0, rel=1e-13)
        assert abs(surface.values.mean()) < 1e-14


def test_weierstrass_is_the_sum_it_says():
    shape, spacing, hurst, ratio, ridges = (12, 20), (1e-3, 2e-3), 0.7, 1.7, 3
    found = made(
        "weierstrass", shape, spacing, hurst=hurst, ratio=ratio, ridges=ridges, rms_height=1.0
    ).values
    stream = np.random.default_rng(1)
    first = stream.random()
    longest = 20 * 2e-3
    waves = 1 + int(np.floor(np.log(longest / 4e-3) / np.log(ratio)))
    phases = 2 * np.pi * stream.random(waves * ridges).reshape(waves, ridges)
    x, y = np.meshgrid(np.arange(20) * 2e-3, np.arange(12) * 1e-3)
    total = np.zeros(shape)
    for n in range(waves):
        for m in range(ridges):
            azimuth = np.pi * (m + first) / ridges
            along = x * np.cos(azimuth) + y * np.sin(azimuth)
            total += ratio ** (-hurst * n) * np.cos(2 * np.pi * ratio**n * along / longest + phases[n, m])
    total -= total.mean()
    np.testing.assert_allclose(found, total / total.std(), atol=1e-11)


def test_weierstrass_variogram_follows_its_exponent():
    heights = made("weierstrass", (256, 256), 1.0, hurst=0.6, rms_height=1.0, members=20).values
    lags = np.array([4, 8, 16, 32])
    squares = [np.mean((heights[:, :, lag:] - heights[:, :, :-lag]) ** 2) for lag in lags]
    slope = np.polyfit(np.log(lags), np.log(squares), 1)[0]
    assert slope == pytest.approx(1.2, abs=0.15)


@pytest.mark.parametrize(
    ("name", "options", "word"),
    [
        ("midpoint", {"shape": 9}, "shape"),
        ("midpoint", {"hurst": 1.0}, "hurst"),
        ("midpoint", {"additions": 1}, "additions"),
        ("weierstrass", {"ratio": 1.0}, "ratio"),
        ("weierstrass", {"ridges": 0}, "ridges"),
        ("weierstrass", {"rms_height": -1.0}, "rms_height"),
    ],
)
def test_what_cannot_be_made_is_refused(name, options, word):
    with pytest.raises(InvalidInput, match=word):
        made(name, **options)


def test_the_room_loads_nothing_heavy():
    code = (
        "import sys, numpy, fractalcontact.surfaces as s; [getattr(s, n) for n in s.__all__];"
        "heavy = {'numba', 'matplotlib', 'skimage', 'dask', 'netCDF4', 'xarray', 'SurfaceTopography'};"
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
