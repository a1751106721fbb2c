"""Gaps that depend on the height: found, and their effect on the exponent mended."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import fractalcontact as fc


def _surface(seed: int, hurst: float = 0.3):
    return fc.surfaces.fbm((128, 128), 1e-6, hurst=hurst, rms_increment=1e-7, rng=seed)


def _note(result, attribute="comment") -> str:
    return result.hurst.attrs[attribute]


@pytest.mark.parametrize(("sign", "word"), [(1.0, "low"), (-1.0, "high")])
def test_missing_valleys_and_peaks_are_said_and_do_not_lower_the_exponent(sign, word):
    errors, held = [], []
    for seed in range(3):
        surface = _surface(seed)
        result = fc.dimensions.estimate(surface.where(sign * surface > (sign * surface).quantile(0.1)))
        assert f"{word} heights are missing" in _note(result)
        held.append(result.ci_low.item() < 0.3 < result.ci_high.item())
        errors.append(result.hurst.item() - 0.3)
    assert np.mean(errors) > -0.012  # -0.02 if the gaps count as any others
    assert sum(held) >= 2


def test_gaps_that_do_not_depend_on_the_height_are_not_said_to():
    y, x = np.mgrid[:128, :128]
    rng = np.random.default_rng(0)
    patches = gaussian_filter(rng.standard_normal((128, 128)), 4.0)
    bowl = _surface(0) + 1e-9 * ((y - 64) ** 2 + (x - 64) ** 2)
    for surface, gaps in (
        (_surface(1), rng.random((128, 128)) < 0.1),
        (bowl, patches > np.quantile(patches, 0.9)),
        (bowl, np.hypot(y - 64, x - 64) > 62),
        (bowl, np.hypot(y - 40, x - 50) < 15),
    ):
        result = fc.dimensions.estimate(surface.where(~gaps))
        assert "heights are missing" not in _note(result)


def test_maps_and_directions_leave_the_same_heights_out():
    surface = _surface(1)
    valleys = surface.where(surface > surface.quantile(0.1))
    assert "low heights are missing" in _note(fc.dimensions.hurst_map(valleys, 64e-6))
    assert "low heights are missing" in _note(fc.dimensions.directions(valleys, [0.0, 90.0]), "reason")
