"""Dimension by the area at several resolutions."""

import numpy as np
import pytest
from domains.sets import DIMENSION, as_mask, lattice_set, ratio_of

import fractalcontact as fc


def resolved(name, levels, periodic=(False, False)):
    ratio = ratio_of(name)
    return [as_mask(lattice_set(name, k), (0.81 / ratio**k,) * 2, periodic) for k in levels]


@pytest.mark.parametrize("name", ["carpet", "cantor_dust", "vicsek"])
def test_lattice_sets_are_exact(name):
    result = fc.domains.area_dimension(resolved(name, (4, 2, 1, 3)))
    assert float(result.area_dimension) == pytest.approx(DIMENSION[name], abs=1e-13)
    assert float(result.ci_low) <= DIMENSION[name] <= float(result.ci_high)
    assert result.resolution.values == pytest.approx([0.01, 0.03, 0.09, 0.27])
    assert result.local_slope.values == pytest.approx(np.full(4, DIMENSION[name]))


def test_contact_fractions_match_press():
    surface = fc.surfaces.spectral((32, 32), 1e-6, hurst=0.8, rms_slope=0.1, rng=1)
    contact = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=[1e6, 1e7], keep=("state",))
    masks = [contact.state, contact.state.isel(x=slice(None, None, 2), y=slice(None, None, 2))]
    result = fc.domains.area_dimension(masks)
    for name in ("contact_fraction", "corrected_contact_fraction"):
        assert result[name].values[:, 0] == pytest.approx(contact[name].values, rel=1e-8)
    assert result.area_dimension.dims == ("step",)


def test_correction_reduces_the_area_of_pixels():
    masks = []
    for n in (64, 128, 256, 512):
        place = (np.arange(n) + 0.5) / n - 0.5
        # a coarse cell is in contact where any point in it is: an excess along the boundary
        reach = np.hypot(*np.meshgrid(*[np.maximum(np.abs(place) - 0.5 / n, 0)] * 2))
        masks.append(as_mask(reach < 0.3, (1 / n, 1 / n)))
    counted, improved = (fc.domains.area_dimension(masks, corrected=corrected) for corrected in (False, True))
    assert float(counted.area_dimension) < float(improved.area_dimension) < 2
    assert np.all(counted.corrected_contact_fraction < counted.contact_fraction)


def test_empty_masks_are_nan_with_a_reason():
    masks = [as_mask(np.zeros((2, 9, 9)), (1.0, 1.0)), as_mask(np.ones((2, 3, 3)), (3.0, 3.0))]
    result = fc.domains.area_dimension(masks)
    assert np.isnan(result.area_dimension).all()
    assert "empty" in result.area_dimension.attrs["comment"]


def test_incompatible_masks_are_refused():
    first = as_mask(np.ones((9, 9)), (1.0, 1.0))
    for others, words in (
        ([first], "two masks or more"),
        ([first, first], "a spacing of its own"),
        ([first, as_mask(np.ones((9, 9)), (2.0, 2.0))], "extent"),
        ([first, as_mask(np.ones((2, 3, 3)), (3.0, 3.0))], "leading dims"),
        ([first, first.drop_vars(["x", "y"])], "coordinates"),
    ):
        with pytest.raises(ValueError, match=words):
            fc.domains.area_dimension(others)


def test_file_round_trip_and_compliance(tmp_path, compliance):
    result = fc.domains.area_dimension(resolved("carpet", (1, 2, 3)))
    path = fc.save(result, tmp_path / "area.nc")
    assert fc.open(path).identical(result)
    assert compliance(path) == []
