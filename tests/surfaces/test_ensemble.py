"""Properties of every generator: shape, streams, members, units."""

import json

import numpy as np
import pytest
from calls import CALLS

import fractalcontact as fc

GENERATORS = ("fbm", "midpoint", "spectral", "weierstrass")


def generate(name, shape=(9, 14), spacing=1e-3, rng=1, **options):
    options |= {"shape": shape, "spacing": spacing, "rng": rng}
    return getattr(fc.surfaces, name)(**(CALLS[f"surfaces.{name}"]() | options))


@pytest.mark.parametrize("name", GENERATORS)
@pytest.mark.parametrize("shape", [(3, 3), (3, 17), (11, 7), (16, 16)])
def test_shape_and_labels(name, shape):
    surface = generate(name, shape)
    assert surface.shape == shape
    assert surface.dims == ("y", "x")
    assert np.isfinite(surface.values).all()
    assert surface.values.std() > 0
    assert surface.attrs["units"] == "m"
    assert json.loads(surface.attrs["provenance"])["random"]["entropy"] == "1"


@pytest.mark.parametrize("name", GENERATORS)
def test_same_stream_gives_same_surface(name):
    np.testing.assert_array_equal(generate(name).values, generate(name).values)
    assert np.abs(generate(name, rng=2).values - generate(name).values).max() > 0
    np.testing.assert_array_equal(generate(name, members=3).values[:2], generate(name, members=2).values)


@pytest.mark.parametrize("members", [None, 2])
@pytest.mark.parametrize("name", GENERATORS)
def test_file_has_the_record_to_repeat_its_surface(name, members, tmp_path):
    # also for a stream that was drawn from and has spawned
    stream = np.random.default_rng(8)
    stream.random(3)
    stream.spawn(1)
    surface = generate(name, rng=stream, members=members)
    reopened = fc.open(fc.save(surface, tmp_path / "surface.nc"))
    again = generate(name, rng=json.loads(reopened.attrs["provenance"])["random"], members=members)
    np.testing.assert_array_equal(again.values, surface.values)


@pytest.mark.parametrize("name", GENERATORS)
def test_powers_of_two_change_no_bit(name):
    arguments = CALLS[f"surfaces.{name}"]()
    lengths = {key: 2.0**20 * value for key, value in arguments.items() if key.startswith("rms_")}
    scaled = generate(name, spacing=1e-3 * 2.0**-20, **lengths)
    np.testing.assert_array_equal(scaled.values, generate(name).values * 2.0**20)
