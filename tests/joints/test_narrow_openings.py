"""Gaps with cells that are open by rounding only: flow and uplift stay within their bounds."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import ConvergenceWarning

UPSTREAM = 1e6


def rounded_scans(seed):
    """Two faces rounded to one step, less a level of that grid: where they touch, some are 5e-22 m apart."""
    rng = np.random.default_rng(seed)
    n, step = int(rng.choice([16, 24, 32, 64, 96])), float(rng.choice([1e-7, 1e-6, 3e-7, 1e-6 / 3]))
    base = fc.surfaces.fbm((n, n), 1e-4, hurst=0.8, rms_increment=2e-6, rng=seed).values
    lower = np.round(base / step) * step
    noise = rng.uniform(0, 4) * 1e-6 * rng.standard_normal((n, n)) * rng.uniform(0, 1)
    gap = np.round((base + noise) / step) * step + float(rng.choice([0, 1e-3, 7e-5])) - lower
    return gap - float(rng.choice([gap.min(), np.quantile(gap, 0.3), np.median(gap)]))


def terraces(seed):
    """Heights of three levels with noise of 1e-2 to 1e-10 of their distance."""
    rng = np.random.default_rng(seed)
    n, decades = int(rng.integers(4, 20)), int(rng.integers(2, 11))
    heights = rng.integers(0, 3, (n, n)) + 10.0**-decades * rng.standard_normal((n, n))
    return np.maximum(heights - np.quantile(heights, rng.uniform(0, 0.7)), 0) * 1e-6


def decades(seed):
    """Openings over several decades side by side: terraces, or of a log-normal distribution."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(8, 60))
    if seed % 3 == 0:
        heights = rng.integers(0, 3, (n, n)) + 10.0 ** -rng.integers(1, 6) * rng.standard_normal((n, n))
    else:
        heights = 10 ** (rng.uniform(0.1, 1.2) * rng.standard_normal((n, n)))
    return np.maximum(heights - np.quantile(heights, rng.uniform(0, 0.7)), 0) * 1e-6


GAPS = [
    (rounded_scans, 296),
    (rounded_scans, 339),
    (terraces, 135),
    *((terraces, seed) for seed in range(40)),
    *((decades, seed) for seed in (8, 74, 87, 104)),  # beyond the ends by 1e-8 to 3e-6 by one elimination
]


@pytest.mark.parametrize(("gaps", "seed"), GAPS)
def test_flow_within_parallel_plates_and_pressure_within_its_ends(make_face, gaps, seed):
    gap = make_face(gaps(seed), 1e-4)
    flow = fc.joints.transmissivity(gap)
    most = float((gap.clip(0) ** 3).mean()) / 12
    assert ((flow.transmissivity >= 0) & (flow.transmissivity <= most)).all()
    water = fc.joints.uplift(gap, upstream_pressure=UPSTREAM)
    assert float(water.fluid_pressure.min()) >= 0
    assert float(water.fluid_pressure.max()) <= UPSTREAM
    assert float(water.residual) < 1e-14  # the balance, and what a pressure missed its range by
    assert ((water.mean_uplift >= 0) & (water.mean_uplift <= UPSTREAM)).all()


def exact_pressure(gap):
    """Pressure by elimination without subtractions (Grassmann, Taksar and Heyman), held at W and E.

    Cells in one row: links are harmonic means, without the corners of cells in two rows.
    """
    k = gap**3
    links = np.concatenate([[2 * k[0]], 2 * k[1:] * k[:-1] / (k[1:] + k[:-1]), [2 * k[-1]]])
    drops = 1 / links
    return 1 - np.cumsum(drops)[:-1] / drops.sum()


def test_openings_down_to_the_stated_share(make_face):
    """A row of cells down to 0.001 of the mean opening is solved; below, it is closed and stated."""
    gap = np.array([1.0, 2.0, 0.01, 3.0, 1.0, 0.0015, 2.0, 1.0]) * 1e-5
    solved = fc.joints.uplift(make_face(np.tile(gap, (3, 1))), upstream_pressure=1.0)
    np.testing.assert_allclose(solved.fluid_pressure[1], exact_pressure(gap), rtol=1e-12, atol=1e-14)
    gap[5] = 0.001e-5
    flow = fc.joints.transmissivity(make_face(np.tile(gap, (3, 1))), axis="x")
    assert flow.transmissivity.item() == 0
    assert flow.narrow_fraction == pytest.approx(1 / 8)
    assert "narrow_fraction" in flow.transmissivity.attrs["comment"]
    assert "comment" not in fc.joints.transmissivity(make_face(np.ones((4, 4)))).transmissivity.attrs


def test_hole_beyond_the_precision_is_refused_with_the_reason(make_face):
    """A hole 10 000 times as deep as the joint is wide: its pressure is lost in the rounding of its links."""
    gap = np.random.default_rng(0).uniform(0.5, 1.5, (24, 24)) * 1e-6
    gap[8:12, 8:14] *= 1e4
    with pytest.warns(ConvergenceWarning, match="2 of 2 flows not known"):
        flow = fc.joints.transmissivity(make_face(gap), viscosity=1e-3, keep="flux")
    for name in ("transmissivity", "hydraulic_aperture", "flow_conductance", "flux_x"):
        assert flow[name].isnull().all()
    assert "precision" in flow.transmissivity.attrs["reason"]
    for options in ({}, {"normal_stiffness": 1e12}):
        with pytest.warns(ConvergenceWarning, match="precision of the computer"):
            water = fc.joints.uplift(make_face(gap), upstream_pressure=UPSTREAM, **options)
        joint = water.sel(diagram="joint")
        assert np.isnan(joint.mean_uplift)
        assert "precision" in water.mean_uplift.attrs["reason"]
        assert water.mean_uplift.sel(diagram="linear") == UPSTREAM / 2


@pytest.mark.parametrize("stretch", [0.5, 1.0, 2.0])
def test_radius_of_a_drain_of_one_cell(make_face, stretch):
    """A row of drains across a wide strip between two edges of one head, against wells (Muskat 1937)."""
    dx, dy = 1.0, stretch
    n, far = 21, 61  # cells between drains (the sides repeat), and to either edge
    gap = make_face(np.full((n, 2 * far + 1), 1e-4), (dy, dx), periodic=(True, False))
    centre = (far + 0.5) * dx, (n // 2 + 0.5) * dy
    water = fc.joints.uplift(
        gap, upstream_pressure=1.0, downstream_pressure=1 - 1e-9, drains=[centre], drain_pressure=0.0
    )
    # wells with the period L along y: p ~ ln(2 (cosh(2 pi x/L) - cos(2 pi y/L)))/2
    period, column = n * dy, water.fluid_pressure.isel(y=n // 2).values
    x = np.array([far // 2, far]) * dx
    waves = 0.5 * np.log(2 * (np.cosh(2 * np.pi * x / period) - 1))
    near, distant = column[far + far // 2], column[2 * far]
    strength = (distant - near) / (waves[1] - waves[0])
    radius = period / (2 * np.pi) * np.exp(waves[0] - near / strength)
    assert radius == pytest.approx(0.14 * np.hypot(dx, dy), rel=0.01)


def test_narrow_cells_beside_water_are_contact_and_not_isolated(make_face):
    gap = np.full((8, 16), 1e-4)
    gap[2:4, 4:8] = 1e-8  # water runs around them
    gap[5:8, 9:12], gap[6, 10] = 0.0, 1e-4  # one open cell without water
    water = fc.joints.uplift(make_face(gap, 1.0), upstream_pressure=1e5)
    assert water.isolated_fraction == 1 / gap.size
    assert water.wet_fraction == 1 - (8 + 9) / gap.size
