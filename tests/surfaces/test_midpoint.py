"""Random midpoint displacement: exact first stages, symmetry, the documented errors."""

import json

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput


def midpoint(shape, spacing=1.0, *, hurst=0.6, rms_increment=1.0, rng=1, **options):
    return fc.surfaces.midpoint(shape, spacing, hurst=hurst, rms_increment=rms_increment, rng=rng, **options)


@pytest.mark.parametrize("hurst", [0.2, 0.5, 0.8])
def test_first_two_stages_are_exact(covariance_of, hurst):
    # corners are exact; so is the difference of centre and edges from the mean of their neighbours
    covariance = covariance_of(lambda rng: midpoint((3, 3), hurst=hurst, rng=rng).values)

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


def test_both_axes_have_the_same_statistics(covariance_of):
    covariance = covariance_of(lambda rng: midpoint((5, 5), hurst=0.7, additions=True, rng=rng).values)
    plane = covariance.reshape(5, 5, 5, 5)
    variogram = np.einsum("ijij->ij", plane)[:, :, None, None] + np.einsum("ijij->ij", plane) - 2 * plane
    np.testing.assert_allclose(variogram, variogram.transpose(1, 0, 3, 2), atol=1e-12)
    np.testing.assert_allclose(variogram, variogram[::-1, ::-1, ::-1, ::-1], atol=1e-12)


TABLE = {  # relative errors of the mean square increment at lags 1, 8, 64, as documented
    (False, 0.01): (0.04, 1.22, 2.33),
    (False, 0.1): (0.04, 0.73, 1.18),
    (False, 0.3): (0.02, 0.08, 0.07),
    (False, 0.5): (-0.02, -0.24, -0.27),
    (False, 0.7): (-0.10, -0.37, -0.38),
    (False, 0.9): (-0.23, -0.37, -0.36),
    (True, 0.01): (0.05, 1.24, 2.45),
    (True, 0.1): (0.04, 0.75, 1.23),
    (True, 0.3): (0.02, 0.09, 0.11),
    (True, 0.5): (-0.02, -0.23, -0.25),
    (True, 0.7): (-0.11, -0.38, -0.37),
    (True, 0.9): (-0.29, -0.44, -0.39),
}


@pytest.mark.slow
@pytest.mark.parametrize(("additions", "hurst"), TABLE)
def test_documented_errors(additions, hurst):
    heights = fc.surfaces.midpoint(
        (129, 129), 1.0, hurst=hurst, rms_increment=1.0, additions=additions, members=600, rng=77
    ).values
    for lag, expected in zip((1, 8, 64), TABLE[additions, hurst], strict=True):
        squares = np.mean((heights[:, :, lag:] - heights[:, :, :-lag]) ** 2, axis=(1, 2)) / lag ** (2 * hurst)
        error = squares.std() / np.sqrt(600)
        assert abs(squares.mean() - 1 - expected) < 4 * error + 0.005 + 4 * error * np.sqrt(600 / 1500)


@pytest.mark.parametrize(("hurst", "error"), [(0.01, 2), (0.1, 1), (0.5, 0.3), (0.9, 0.4)])
def test_the_stated_error_is_the_documented_one(hurst, error):
    documented = max(abs(TABLE[additions, hurst][-1]) for additions in (False, True))
    assert error == pytest.approx(documented, rel=0.2)
    stated = json.loads(midpoint((9, 9), hurst=hurst).attrs["provenance"])["achieved_error"]
    assert stated == f"about {error:g} of the mean square increments over 64 points"


@pytest.mark.parametrize(
    ("options", "problem"),
    [({"shape": 9}, "shape"), ({"hurst": 1.0}, "hurst"), ({"additions": 1}, "additions")],
)
def test_invalid_arguments_are_refused(options, problem):
    with pytest.raises(InvalidInput, match=problem):
        midpoint(**{"shape": (9, 14), **options})
