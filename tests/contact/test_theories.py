"""Theories of rough contact: closed forms, the published integrals by other quadrature, and the solver."""

import math

import numpy as np
import pytest
from scipy import integrate

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput

MODULUS = 2e9
SIDE, CELLS = 1e-3, 64
X = SIDE / CELLS * np.arange(CELLS)


def waves(*numbers_and_amplitudes):
    """Return a periodic surface of waves along x."""
    heights = sum(a * np.cos(2 * math.pi * n * X / SIDE) for n, a in numbers_and_amplitudes)
    return fc.surfaces.from_array(np.tile(heights, (CELLS, 1)), SIDE / CELLS, periodic=True)


def rough(**options):
    given = {"hurst": 0.8, "rms_slope": 0.1, "short_cutoff": 8e-5, "rolloff": 5e-4, "rng": 3}
    return fc.surfaces.spectral((CELLS, CELLS), SIDE / CELLS, **(given | options))


def theories(surface, pressure, modulus=MODULUS):
    return fc.contact.theories(surface, contact_modulus=modulus, nominal_pressure=pressure)


def test_moments_of_one_wave():
    result, q, a = theories(waves((4, 1e-6)), 1e6), 2 * math.pi * 4 / SIDE, 1e-6
    assert float(result.m0) == pytest.approx(a**2 / 2)
    assert float(result.m2) == pytest.approx(a**2 * q**2 / 4)
    assert float(result.m4) == pytest.approx(3 / 16 * a**2 * q**4)


def test_area_of_persson_and_of_bush_gibson_thomas():
    slope = 1e-6 * 2 * math.pi * 4 / SIDE / math.sqrt(2)
    pressure = np.array([0.0, 0.01, 0.015, 0.5, 3.0]) * MODULUS * slope
    area = theories(waves((4, 1e-6)), pressure)["contact_fraction"]
    expected = [
        0.0,
        0.015957,
        0.023931,
        0.682689,
        1.0,
    ]  # erf(sqrt(2) p/(E* g)) from tables: erf(.7071) = .682689
    np.testing.assert_allclose(area.sel(theory="persson"), expected, atol=2e-6)
    expected = [0.0, 0.0250663, 0.0375994, math.nan, math.nan]  # sqrt(2 pi) = 2.50663; beyond .05 not held
    np.testing.assert_allclose(area.sel(theory="bush_gibson_thomas"), expected, atol=2e-7)
    assert "bush_gibson_thomas hold up to" in area.attrs["reason"]


@pytest.mark.parametrize("separation", [1.5, 2.5, 4.0])
def test_greenwood_williamson_by_quadrature(separation):
    surface = rough()
    moments = theories(surface, 1.0)
    m0, m2, m4 = (float(moments[name]) for name in ("m0", "m2", "m4"))
    nayak = m0 * m4 / m2**2
    density, radius = m4 / (6 * math.pi * math.sqrt(3) * m2), 3 * math.sqrt(math.pi) / (8 * math.sqrt(m4))
    spread = math.sqrt((1 - 0.8968 / nayak) * m0)

    def summits(order, d):
        def deformed(z):
            return (z - d) ** order * math.exp(-0.5 * (z / spread) ** 2) / (spread * math.sqrt(2 * math.pi))

        return integrate.quad(deformed, d, d + 9 * spread, epsrel=1e-10, epsabs=0)[0]

    d = separation * spread
    pressure = 4 / 3 * density * MODULUS * math.sqrt(radius) * summits(1.5, d)
    found = theories(surface, pressure).sel(theory="greenwood_williamson").isel(step=0)
    assert float(found.contact_fraction) == pytest.approx(
        math.pi * density * radius * summits(1, d), rel=1e-6
    )
    assert float(found.mean_gap) == pytest.approx(d + 4 * math.sqrt(m0 / (math.pi * nayak)), rel=1e-6)
    stiffness = 2 * density * MODULUS * math.sqrt(radius) * summits(0.5, d)
    assert float(found.interface_stiffness) == pytest.approx(stiffness, rel=1e-6)


def published_gap(bands, relative_pressure):
    """Return the double integral of Yang and Persson (2008) over narrow bands (q, mean square height)."""
    width, total, below = 1e-4, 0.0, 0.0
    for q, height in bands:
        density = height / (2 * math.pi * q * q * width)  # C of Persson: m0 = 2 pi int q C dq

        def weight(k, q=q, density=density, below=below):
            return (math.pi * (density * (k**4 - q**4) / 4) + below) ** -0.5

        def at(k, density=density, weight=weight):
            w = weight(k)

            def over(log_p):
                x = w * math.exp(log_p)
                return (0.45 + 1.65 * math.erf(x) ** 2) * math.exp(-(x**2))

            low = math.log(relative_pressure)
            high = max(low, math.log(7 / w))
            inner = integrate.quad(over, low, high, epsabs=1e-12, limit=200)[0]
            return k**2 * density * w * inner

        # k = q (1 + width x^2) takes away the root of the weight at the edge of the first band
        total += integrate.quad(
            lambda x, q=q, at=at: at(q * (1 + width * x * x)) * 2 * q * width * x, 1e-9, 1, epsrel=1e-6
        )[0]
        below += math.pi * density * q**4 * ((1 + width) ** 4 - 1) / 4
    return math.sqrt(math.pi) * total


@pytest.mark.parametrize("share", [1e-4, 1e-2, 0.2, 1.0])
def test_gap_of_persson_by_its_published_integral(share):
    bands = [(2 * math.pi * n / SIDE, a**2 / 2) for n, a in ((2, 2e-6), (7, 1e-6))]
    slope = math.sqrt(sum(q**2 * height for q, height in bands))
    found = theories(waves((2, 2e-6), (7, 1e-6)), share * MODULUS * slope).sel(theory="persson")
    assert float(found.mean_gap[0]) == pytest.approx(published_gap(bands, share * slope), rel=1e-3)


def test_small_loads_of_persson_are_exponential():
    """One wave: p ~ exp(-u/u0) with u0 = gamma sqrt(2/pi) h_rms, and a stiffness p/u0."""
    pressure = np.array([1.0, math.e, 1e3])
    found = theories(waves((4, 1e-6)), pressure).sel(theory="persson")
    u0 = 0.45 * math.sqrt(2 / math.pi) * 1e-6 / math.sqrt(2)
    assert float(found.mean_gap[0] - found.mean_gap[1]) == pytest.approx(u0, rel=1e-6)
    np.testing.assert_allclose(found.interface_stiffness[:2], pressure[:2] / u0, rtol=1e-6)


@pytest.mark.parametrize("theory", ["persson", "greenwood_williamson"])
def test_stiffness_is_the_derivative_of_the_pressure_by_the_gap(theory):
    pressure = 2e5 * np.array([0.999, 1.0, 1.001])
    found = theories(rough(), pressure).sel(theory=theory)
    slope = -(pressure[2] - pressure[0]) / float(found.mean_gap[2] - found.mean_gap[0])
    assert float(found.interface_stiffness[1]) == pytest.approx(slope, rel=1e-5)


def test_persson_agrees_with_the_solver():
    pressure = np.array([0.05, 0.2, 0.5]) * MODULUS * 0.1
    surface = rough()
    pressed = fc.contact.press(surface, contact_modulus=MODULUS, nominal_pressure=pressure)
    found = theories(surface, pressure).sel(theory="persson")
    height = float(np.sqrt(found.m0))
    assert np.abs(found.mean_gap - pressed.mean_gap).max() < 0.1 * height
    ratio = found.contact_fraction / pressed.corrected_contact_fraction
    assert ratio.min() > 0.7
    assert ratio.max() < 1.02


def test_scales():
    """Heights and lengths by one factor: the same areas; the gap grows by it and the stiffness falls."""
    surface, factor = rough(), 1e3
    larger = fc.surfaces.from_array(factor * surface.values, factor * SIDE / CELLS, periodic=True)
    one, other = theories(surface, [1e5, 1e7]), theories(larger, [1e6, 1e8], 10 * MODULUS)
    np.testing.assert_allclose(other.contact_fraction, one.contact_fraction, rtol=1e-9)
    np.testing.assert_allclose(other.mean_gap, factor * one.mean_gap, rtol=1e-9)
    np.testing.assert_allclose(other.interface_stiffness, 10 / factor * one.interface_stiffness, rtol=1e-9)


def test_free_surface_is_levelled_and_tapered():
    """A tilt changes nothing; over shifts by quarters the tapers add up to one: nearly the true moments."""
    periodic, step = rough(rolloff=1e-4), SIDE / CELLS
    free = fc.surfaces.from_array(periodic.values, step)
    tilted = fc.surfaces.from_array(periodic.values + 0.3 * X, step)
    shifts = [(i, j) for i in range(0, CELLS, CELLS // 4) for j in range(0, CELLS, CELLS // 4)]
    rolled = [theories(fc.surfaces.from_array(np.roll(free.values, s, (0, 1)), step), 1e6) for s in shifts]
    for name in ("m0", "m2", "m4"):
        assert float(theories(tilted, 1e6)[name]) == pytest.approx(float(theories(free, 1e6)[name]), rel=1e-9)
        mean = np.mean([float(result[name]) for result in rolled])
        assert mean == pytest.approx(float(theories(periodic, 1e6)[name]), rel=0.05)


def test_no_pressure_complete_contact_and_flat_surface():
    result = theories(rough(), [0.0, 1e12])
    assert result["contact_fraction"].sel(theory="persson").values.tolist() == [0.0, 1.0]
    assert result["interface_stiffness"].isel(step=0).values[:2].tolist() == [0.0, 0.0]
    assert np.isnan(result["interface_stiffness"].isel(step=0).values[2:]).all()
    assert np.isnan(result["mean_gap"].isel(step=0)).all()
    assert float(result["mean_gap"].sel(theory="persson")[1]) == pytest.approx(0.0, abs=1e-20)
    assert np.isnan(result["interface_stiffness"].isel(step=1)).all()
    assert "complete contact" in result["interface_stiffness"].attrs["reason"]
    flat = theories(waves((4, 0.0)), 1e6)
    assert np.isnan(flat["contact_fraction"]).all()
    assert "flat" in flat["contact_fraction"].attrs["reason"]
    assert float(flat["m2"]) == 0.0


def test_all_problems_are_listed():
    with pytest.raises(InvalidInput) as caught:
        fc.contact.theories(waves((4, 1e-6)), contact_modulus=0, nominal_pressure=-1.0)
    assert "contact_modulus" in str(caught.value)
    assert "nominal_pressure" in str(caught.value)


def summit(curvature_x, curvature_y, *, turned=0.0, side=1e-3, cells=81, offset=0.0):
    """Return a free surface with one paraboloid, of two curvatures (m-1)."""
    x = np.linspace(-side / 2, side / 2, cells)
    along = (x - offset) * math.cos(turned) + x[:, None] * math.sin(turned)
    across = x[:, None] * math.cos(turned) - (x - offset) * math.sin(turned)
    return fc.surfaces.from_array(-(curvature_x * along**2 + curvature_y * across**2) / 2, x[1] - x[0])


def hertz(surface, pressure):
    return theories(surface, pressure).sel(theory="hertz")


def test_hertz_on_a_ball():
    surface = summit(10.0, 10.0)  # radius 0.1 m
    found, side = hertz(surface, [0.0, 1e2, 1e4]), 81 / 80 * 1e-3
    force = np.array([0.0, 1e2, 1e4]) * side**2
    a = np.cbrt(3 * force * 0.1 / (4 * MODULUS))
    np.testing.assert_allclose(found.contact_fraction * side**2, math.pi * a**2, rtol=1e-5)
    np.testing.assert_allclose(found.interface_stiffness * side**2, 2 * a * MODULUS, rtol=1e-5)
    assert np.isnan(found.mean_gap).all()


# semi-axes over the cube root of 3 F/(4 E* (A + B)), at cos(theta) = (B - A)/(B + A): the table of Whittemore
# and Petrenko (1921) in Timoshenko and Goodier, Theory of Elasticity, section 140
PUBLISHED = {30: (2.731, 0.493), 45: (1.926, 0.604), 60: (1.486, 0.717), 75: (1.202, 0.846), 90: (1.0, 1.0)}


@pytest.mark.parametrize("theta", PUBLISHED)
def test_hertz_on_an_ellipsoid_by_the_published_table(theta):
    cosine = math.cos(math.radians(theta))
    least, most = 20.0 * (1 - cosine), 20.0 * (1 + cosine)  # 2 A and 2 B
    surface, side, pressure = summit(least, most, turned=0.4), 81 / 80 * 1e-3, 1e3
    unit = np.cbrt(3 * pressure * side**2 / (4 * MODULUS * 20.0))
    a, b = (number * unit for number in PUBLISHED[theta])
    found = hertz(surface, pressure)
    assert float(found.contact_fraction[0]) * side**2 == pytest.approx(math.pi * a * b, rel=2e-3)


def test_hertz_agrees_with_the_solver_on_an_ellipsoid():
    surface, pressure = summit(10.0, 30.0), 5e4
    pressed = fc.contact.press(
        surface, contact_modulus=MODULUS, nominal_pressure=pressure, include="stiffness"
    ).isel(step=0)
    found = hertz(surface, pressure).isel(step=0)
    assert float(pressed.corrected_contact_fraction) == pytest.approx(float(found.contact_fraction), rel=0.02)
    assert float(pressed.contact_stiffness) == pytest.approx(float(found.interface_stiffness), rel=0.02)


@pytest.mark.parametrize(
    "surface",
    [
        summit(10.0, -10.0),  # a saddle
        summit(-10.0, -10.0),  # a hollow
        summit(10.0, 10.0, offset=2e-3),  # the summit is outside
        waves((1, 1e-6)),
        rough(),
    ],
)
def test_hertz_holds_on_single_summits_only(surface):
    found = theories(surface, 1e3)
    assert np.isnan(found["contact_fraction"].sel(theory="hertz")).all()
    assert "one smooth summit" in found["contact_fraction"].attrs["reason"]


def test_hertz_on_a_long_summit_ends_where_the_ellipse_reaches_the_edge():
    """As the solver has it: an ellipse along the longer side may be longer than the shorter side."""
    x, y = 1e-4 * np.arange(-80, 81), 1e-4 * np.arange(-20, 21)
    long = -(0.5 * x[None, :] ** 2 + 20.0 * y[:, None] ** 2)
    pressure = np.array([40.0, 200.0, 800.0]) / (long.size * 1e-8)
    surface = fc.surfaces.from_array(long, 1e-4)
    pressed = fc.contact.press(surface, contact_modulus=MODULUS, nominal_pressure=pressure)
    edges = pressed["state"].isel(x=[0, -1]).any(("y", "x"))
    np.testing.assert_array_equal(edges, [False, False, True])
    for heights in (long, long.T):
        found = hertz(fc.surfaces.from_array(heights, 1e-4), pressure)["contact_fraction"]
        np.testing.assert_allclose(found[:2], pressed["corrected_contact_fraction"][:2], rtol=0.02)
        assert np.isnan(found[2])


def test_hertz_ends_where_the_contact_reaches_the_edge():
    found = hertz(summit(10.0, 10.0), [1e4, 1e9])["contact_fraction"].values
    assert np.isfinite(found).tolist() == [True, False]


def test_pressure_spread_of_one_wave():
    """Under a flattened wave of amplitude a the pressure is (E* q a/2) cos(q x): spread E* q a/sqrt(8)."""
    q = 2 * math.pi * 4 / SIDE
    expected = MODULUS * q * 1e-6 / math.sqrt(8)
    assert float(theories(waves((4, 1e-6)), 1e6).pressure_spread) == pytest.approx(expected)


@pytest.mark.slow
def test_summits_of_a_gaussian_surface():
    """Density, mean height, variance and curvature of the summits (Nayak 1971), by random sampling.

    At a point of an isotropic Gaussian surface the second derivatives have the variances m4, m4 and m4/3, the
    covariance m4/3 and the covariance -m2 with the height; the gradient is independent, of variance m2.
    The density of summits is the mean of |det H| where H is negative definite, over 2 pi m2.
    """
    m0, m2, m4 = 1.0, 1.0, 3.0  # Nayak's parameter is 3
    covariance = [[m0, -m2, -m2, 0], [-m2, m4, m4 / 3, 0], [-m2, m4 / 3, m4, 0], [0, 0, 0, m4 / 3]]
    z, xx, yy, xy = np.random.default_rng(0).multivariate_normal(np.zeros(4), covariance, 4_000_000).T
    determinant = xx * yy - xy**2
    weight = np.where((determinant > 0) & (xx + yy < 0), determinant, 0.0)
    density = weight.mean() / (2 * math.pi * m2)
    mean = (weight @ z) / weight.sum()
    variance = (weight @ (z - mean) ** 2) / weight.sum()
    curvature = -(weight @ (xx + yy)) / 2 / weight.sum()
    nayak = m0 * m4 / m2**2
    assert density == pytest.approx(m4 / m2 / (6 * math.pi * math.sqrt(3)), rel=3e-3)
    assert mean == pytest.approx(4 * math.sqrt(m0 / (math.pi * nayak)), rel=3e-3)
    assert variance == pytest.approx((1 - 0.8968 / nayak) * m0, rel=5e-3)
    assert 1 / curvature == pytest.approx(3 / 8 * math.sqrt(math.pi / m4), rel=3e-3)


def test_work_of_persson_in_complete_contact():
    """The work of the pressure on the gap is the energy of a flattened wave, E* q a^2/8, for any gamma."""
    q, a = 2 * math.pi * 4 / SIDE, 1e-6
    pressure = MODULUS * q * a * (np.arange(1000) + 0.5) / 200  # the middles of steps
    stiffness = theories(waves((4, a)), pressure)["interface_stiffness"].sel(theory="persson").values
    work = np.nansum(pressure / stiffness) * (pressure[1] - pressure[0])
    assert work == pytest.approx(MODULUS * q * a**2 / 8, rel=1e-3)


@pytest.mark.parametrize("turned", [False, True])
def test_a_cylinder_has_no_summit(turned):
    for n in range(16, 48, 3):
        heights = -((np.arange(float(n)) - n // 2) ** 2) * np.ones((n, 1)) * 1e-8
        surface = fc.surfaces.from_array(heights.T if turned else heights, 1e-4)
        result = fc.contact.theories(surface, contact_modulus=1e9, nominal_pressure=[1e4])
        assert np.isnan(result["contact_fraction"].sel(theory="hertz")).all()
        assert "no cylinder" in result["contact_fraction"].attrs["reason"]


@pytest.mark.parametrize("exponent", range(-8, 1))
def test_long_summits_keep_their_hertz(exponent):
    """Down to a ratio of the curvatures of 1e-8 an ellipse is none of a cylinder."""
    x = np.linspace(-1, 1, 41)
    heights = -1e-6 * (x**2 + 10.0**exponent * x[:, None] ** 2)
    result = fc.contact.theories(
        fc.surfaces.from_array(heights, 5e-5), contact_modulus=1e9, nominal_pressure=[1e-9]
    ).sel(theory="hertz")
    assert float(result["contact_fraction"][0]) > 0


@pytest.mark.parametrize("name", ["greenwood_williamson", "bush_gibson_thomas"])
def test_asperities_hold_up_to_a_twentieth_of_the_area(name):
    found = theories(rough(), MODULUS * np.linspace(5e-4, 5e-3, 200)).contact_fraction.sel(theory=name)
    assert 0.049 < float(found.max()) <= 0.05
    assert found.isnull().any()


@pytest.mark.parametrize("shift", [0, 16])
def test_a_wave_along_a_periodic_axis_keeps_its_moments(shift):
    """A plane through one period of a wave has a slope; the periodic axis has none."""
    heights = np.roll(1e-6 * np.sin(2 * math.pi * np.arange(CELLS) / CELLS), shift)
    surface = fc.surfaces.from_array(
        heights[:, None] * np.ones((1, CELLS)), SIDE / CELLS, periodic=(True, False)
    )
    result, q = theories(surface, 1e5), 2 * math.pi / SIDE
    assert float(result.m0) == pytest.approx(0.5e-12, rel=1e-3)
    assert float(result.m2) == pytest.approx(0.25e-12 * q**2 * 4 / 3, rel=1e-3)  # a third is the Hann taper


def test_persson_does_not_change_where_a_surface_is_repeated():
    """The same waves on a patch of two periods: gap and stiffness took the longest ones in rings."""
    surface = rough()
    twice = fc.surfaces.from_array(np.tile(surface.values, (2, 2)), SIDE / CELLS, periodic=True)
    once, repeated = (theories(each, [1e6, 1e7]).sel(theory="persson") for each in (surface, twice))
    for name in ("contact_fraction", "mean_gap", "interface_stiffness"):
        np.testing.assert_allclose(repeated[name], once[name], rtol=1e-4, err_msg=name)
