"""Theories of rough contact, from the spectrum of a surface: `theories`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy import optimize, special

from fractalcontact.base import spectra
from fractalcontact.base.grid import Grid, read_grid
from fractalcontact.base.numbers import Array, float_array, power_of_two
from fractalcontact.base.regression import detrended, shifted
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.contact._problem import ContactOptions, LoadPath, check_scale

THEORIES = ("persson", "greenwood_williamson", "bush_gibson_thomas", "hertz")
# contact fraction beyond which asperities no longer deform independently: a choice, for greenwood_williamson
# leaves `press` slowly; its area is .86 of that at a fraction of .012, .77 at .04, .71 at .11, .65 at .33
SMALL_CONTACT = 0.05
NODES, WEIGHTS = np.polynomial.legendre.leggauss(64)  # exp(-t^2) erf(t)^2 on 0 ... 7: error below 1e-13

LAW = (
    f"greenwood_williamson and bush_gibson_thomas hold up to a contact fraction of {SMALL_CONTACT:g}, while "
    "asperities deform independently"
)
PARABOLOID = (
    "hertz holds on one smooth summit (no cylinder) without periods, while the contact is inside the surface"
)
NONE = "NaN where a theory gives none: bush_gibson_thomas gives the area only, and hertz no gap"
REASONS = {
    "contact_fraction": f"NaN where a theory does not hold: {LAW}; {PARABOLOID}",
    "mean_gap": f"{NONE}; without pressure the gap has no bound; {LAW}",
    "interface_stiffness": f"{NONE}; in complete contact it has no bound; {LAW}",
}
FLAT = "NaN: the surface is flat, and no theory of roughness holds"


def _check(problems: Problems) -> None:
    """Collect what is wrong with a call of `theories`."""
    given = problems.given
    surface_is_valid = problems.surface("surface")
    modulus_is_valid = problems.number("contact_modulus", above=0)
    load = problems.construct(LoadPath.among, vars(given))
    if surface_is_valid and modulus_is_valid and load is not None and not problems.messages:
        height_range = float(given.surface.values.max()) - float(given.surface.values.min())
        grid, modulus = read_grid(given.surface), float(given.contact_modulus)
        check_scale(problems, height_range, grid, modulus, ContactOptions(), load)


@public_result(
    title="Theories of rough contact",
    references=(
        "Persson (2001), J. Chem. Phys. 115:3840; Yang and Persson (2008), J. Phys.: Cond. Matter 20:215214; "
        "Greenwood and Williamson (1966), Proc. R. Soc. A 295:300; McCool (1986), Wear 107:37; "
        "Bush, Gibson and Thomas (1975), Wear 35:87; Johnson (1985), Contact Mechanics, section 4.2 (Hertz)"
    ),
    achieved_error="that of the theories, which assume an isotropic Gaussian surface",
    check=_check,
    memory=130.0,
)
def theories(
    surface: xr.DataArray, *, contact_modulus: float, nominal_pressure: float | Sequence[float] | Array
) -> xr.Dataset:
    """Return what theories of rough contact predict for a surface, to be drawn beside `press`.

    They assume an isotropic Gaussian surface that is pressed by a flat, without friction or adhesion, and
    know it by its power spectrum alone.

    Parameters
    ----------
    surface : DataArray, dims (y, x)
        Heights in m, as for `press`.
    contact_modulus : float
        E* of the pair in Pa, see `effective_modulus`.
    nominal_pressure : float or sequence of float
        Force over the whole extent (Pa), 0 or more.

    Returns
    -------
    Dataset over `theory` and `step`
        contact_fraction; mean_gap (m), between the mean planes; interface_stiffness (Pa m-1), minus the
        derivative of the pressure by the mean gap; coordinates nominal_pressure and normal_force (N).
        Without dims: the spectral moments `m0` (m2), `m2` and `m4` (m-2) of the profiles, pressure_spread
        E* g/2 (Pa), the standard deviation of the pressure in complete contact, and contact_modulus. NaN with
        the attribute `reason` where a theory gives no value or does not hold.

    Raises
    ------
    InvalidInput
        Lists everything wrong with the call.

    Notes
    -----
    - persson: area erf(sqrt(2) p/(E* g)), with g the rms slope; gap and stiffness by Yang and Persson with
      gamma = 0.45. Exact in complete contact; at small loads the area is too low, by about a fifth. The gap
      is that of an infinite surface: where few asperities touch, that of a finite one is smaller.
    - greenwood_williamson: spherical summits of one radius with Gaussian heights, their number, radius and
      variance from the moments (McCool). The mean gap neglects the deformation around the summits.
    - bush_gibson_thomas: the asymptote sqrt(2 pi) p/(E* g) at vanishing area, which the full theory leaves
      early.
    - hertz: a single smooth summit, a paraboloid to 0.1 % of its range, and nothing else: the elliptical
      contact and, as stiffness, the derivative of the pressure by the approach.

    The moments are sums over all modes of the spectrum: m0 the mean square height, m2 half the mean square
    gradient, m4 3/8 of the mean square Laplacian. A surface that is not periodic along both axes is first
    levelled by its least-squares plane, which has no slope along a periodic axis, and tapered (Hann) along
    its free axes; m4 then, and so greenwood_williamson, depends most on the spacing and on noise.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.spectral((64, 64), 1e-5, hurst=0.8, rms_slope=0.1, rng=1)
    >>> curves = fc.contact.theories(surface, contact_modulus=1e9, nominal_pressure=[1e6, 1e7])
    >>> curves["contact_fraction"].sel(theory="persson").values.round(3).tolist()
    [0.016, 0.159]
    >>> curves["contact_fraction"].isel(step=0).values.round(3).tolist()  # no single summit: no Hertz
    [0.016, 0.013, 0.025, nan]
    """
    grid, pressure = read_grid(surface), float_array(nominal_pressure)
    heights = np.asarray(surface.values, dtype=np.float64)
    spectrum = _spectrum(heights, grid)
    columns = np.full((3, len(THEORIES), pressure.size), math.nan)
    modulus = float(contact_modulus)
    if spectrum.slope > 0:
        columns[:, 0] = _persson(spectrum, pressure / modulus)
        columns[:, 1] = _greenwood_williamson(spectrum, pressure / modulus)
        columns[[0, 2], 3] = _hertz(heights, grid, pressure / modulus)
        columns[0, 2] = _small(math.sqrt(2 * math.pi) * pressure / modulus / spectrum.slope)
    columns[2] *= modulus
    columns[~np.isfinite(columns)] = math.nan
    result = xr.Dataset(
        {name: (("theory", "step"), column) for name, column in zip(REASONS, columns, strict=True)},
        coords={
            "theory": list(THEORIES),
            "step": np.arange(pressure.size),
            "nominal_pressure": ("step", pressure),
            "normal_force": ("step", pressure * grid.nominal_area),
        },
    ).assign(m0=spectrum.m0, m2=spectrum.m2, m4=spectrum.m4, contact_modulus=modulus)
    result["pressure_spread"] = 0.5 * modulus * spectrum.slope
    for name, reason in REASONS.items():
        if bool(result[name].isnull().any()):
            result[name].attrs["reason"] = reason if spectrum.slope > 0 else FLAT
    return result


@dataclass(frozen=True)
class Spectrum:
    """Moments of the profiles of a surface, and its rms slope mode by mode, in rings of wavenumber.

    `length` is 1/q of each ring that holds modes (m), and `cumulative_slope` the rms slope of all modes up to
    its outer edge.
    """

    m0: float
    m2: float
    m4: float
    length: Array
    cumulative_slope: Array

    @property
    def slope(self) -> float:
        """Root mean square gradient."""
        return math.sqrt(2 * self.m2)


def _spectrum(heights: Array, grid: Grid) -> Spectrum:
    """Return the moments and rings of a surface; lengths are scaled, so that no power overflows."""
    values, _, scale = shifted(heights)
    unit = power_of_two(max(grid.spacing))
    steps = [step / unit for step in grid.spacing]
    if not all(grid.periodic):
        values, _ = detrended(values, 1, grid.periodic)
    tapers = tuple(None if wraps else "hann" for wraps in grid.periodic)
    psd, weights = spectra.periodogram(values, steps, tapers)
    moments = spectra.spectral_moments(psd, values.shape, steps)
    q = spectra.radial_wavenumber(values.shape, steps)
    extent = [edge / unit for edge in grid.extent]
    square = (psd * weights * q**2).ravel() / math.prod(extent)
    # rings of a whole step lump the longest waves: gaps 6 %, stiffnesses 8 % off; 1/64 gives the same to 1e-6
    narrowest = 2 * math.pi / max(extent) / 8
    ring = np.rint(q.ravel() / narrowest).astype(np.int64)
    slope_square = np.bincount(ring, square)
    filled = slope_square > 0
    mean_q = np.bincount(ring, square * q.ravel())[filled] / slope_square[filled]
    ratio = scale / unit
    return Spectrum(
        moments.height * scale**2,
        0.5 * moments.slope * ratio**2,
        0.375 * moments.laplacian * (ratio / unit) ** 2,
        unit / mean_q,
        np.sqrt(np.cumsum(slope_square[filled])) * ratio,
    )


def _persson(spectrum: Spectrum, pressure: Array) -> tuple[Array, Array, Array]:
    """Return contact fraction, mean gap (m) and stiffness (m-1) at pressures over E*.

    Yang and Persson (2008): u = sqrt(pi) int dq q^2 C w int_p^inf dp'/p' F(w p'/E*), with
    F(t) = [gamma + 3 (1 - gamma) erf(t)^2] exp(-t^2) and w = sqrt(2)/s, where s is the rms slope of the modes
    up to q, so that s ds = pi q^3 C dq in the convention of Persson for C. Both integrals over q and p'
    then are, ring by ring, differences of s k(T) with T = sqrt(2) p/(E* s).
    """
    area = special.erf(math.sqrt(2) * pressure / spectrum.slope)
    s = spectrum.cumulative_slope
    gap, compliance = np.full(pressure.size, math.nan), np.zeros(pressure.size)
    for i, p in enumerate(pressure):
        if p == 0:
            continue
        t = np.minimum(math.sqrt(2) * p / s, 26.0)  # contact is complete: exp(-26^2) is the smallest number
        separation, load_rate = _separation_integrals(t)
        gap[i] = math.sqrt(2 / math.pi) * np.sum(np.diff(s * separation, prepend=0.0) * spectrum.length)
        compliance[i] = 2 / math.sqrt(math.pi) * np.sum(np.diff(load_rate, prepend=0.0) * spectrum.length)
    stiffness = np.where(pressure == 0, 0.0, math.nan)  # u grows as -log p: no stiffness without pressure
    np.divide(1.0, compliance, out=stiffness, where=(pressure > 0) & (area < 1))
    return area, gap, stiffness


def _separation_integrals(
    start: Array,
    gamma: float = 0.45,  # Yang and Persson (2008)
    tail: float = 7.0,  # beyond it exp(-t^2) is below 1e-21
) -> tuple[Array, Array]:
    """Return the integrals of F(t) (1/t - start/t^2) and of F(t)/t^2 from `start` to infinity.

    The part with gamma, the elastic energy over that of complete contact at small loads, is in closed form,
    the rest is regular at 0. The second is minus the derivative of the first by `start`.
    """
    small = np.exp(-(start**2)) / start - math.sqrt(math.pi) * special.erfc(start)
    first = gamma * (0.5 * special.exp1(start**2) - start * small)
    second = gamma * small
    half = 0.5 * np.maximum(tail - start, 0.0)[:, None]
    t = start[:, None] + half * (NODES + 1)
    rest = 3 * (1 - gamma) * (special.erf(t) / t) ** 2 * np.exp(-(t**2)) * (half * WEIGHTS)
    return first + (rest * (t - start[:, None])).sum(axis=1), second + rest.sum(axis=1)


def _greenwood_williamson(spectrum: Spectrum, pressure: Array) -> tuple[Array, Array, Array]:
    """Return contact fraction, mean gap (m) and stiffness (m-1) at pressures over E* (McCool 1986)."""
    m0, m2, m4 = spectrum.m0, spectrum.m2, spectrum.m4
    nayak = (m0 / m2) * (m4 / m2)  # at least 1.5
    density = m4 / m2 / (6 * math.pi * math.sqrt(3))
    radius = 3 / 8 * math.sqrt(math.pi / m4)
    spread = math.sqrt((1 - 0.8968 / nayak) * m0)
    above = 4 * math.sqrt(m0 / (math.pi * nayak))  # mean height of the summits over the mean plane
    unit = 4 / 3 * density * math.sqrt(radius) * spread**1.5
    t = np.array([_summit_separation(p / unit) for p in pressure])
    area = _small(math.pi * density * radius * spread * _summit_integral(1.0, t))
    gap = np.where(np.isnan(area), math.nan, above + spread * t)
    stiffness = np.where(np.isnan(area), math.nan, 1.5 * unit / spread * _summit_integral(0.5, t))
    none = pressure == 0
    return np.where(none, 0.0, area), gap, np.where(none, 0.0, stiffness)


def _summit_separation(load: float) -> float:
    """Return t of F_3/2(t) = load, of a flat t standard deviations above the mean summit; NaN outside."""
    low, high = -8.0, 36.0  # F_3/2 from 23 down to 3e-286
    limits = _summit_integral(1.5, np.array([low, high]))
    if not limits[1] < load < limits[0]:
        return math.nan

    def excess(t: float) -> float:
        return math.log(float(_summit_integral(1.5, np.array(t))) / load)

    return float(optimize.brentq(excess, low, high, xtol=1e-13))  # 1e-14 moved results by 3e-14


def _summit_integral(order: float, t: Array) -> Array:
    """Return F_n(t), the integral of (z - t)^n over the standard normal density beyond t."""
    cylinder = special.pbdv(-order - 1, t)[0]
    return np.asarray(special.gamma(order + 1) / math.sqrt(2 * math.pi) * np.exp(-(t**2) / 4) * cylinder)


def _hertz(
    heights: Array,
    grid: Grid,
    pressure: Array,
    *,
    least_m: float = 1e-6,  # below it an ellipse is a circle: 1e-8 and 1e-4 gave the same areas
) -> tuple[Array, Array]:
    """Return contact fraction and stiffness (m-1) at pressures over E*, after Johnson (1985), section 4.2.

    The surface is -(A x^2 + B y^2) along the axes of a paraboloid, A <= B. The semi-axes a >= b of the
    contact follow from B/A = [E(m) a^2/b^2 - K(m)]/[K(m) - E(m)] with m = 1 - b^2/a^2 (4.26a) and
    a^3 = 3 F [K(m) - E(m)]/(2 pi A m E*). The stiffness pi a E*/K(m) is that of an elliptical punch.
    """
    none = np.full(pressure.size, math.nan)
    summit = None if any(grid.periodic) else _paraboloid(heights, grid)
    if summit is None:
        return none, none
    least, most, axis, reach = summit

    def ratio_excess(m: float) -> float:
        return float((special.ellipe(m) / (1 - m) - special.ellipk(m)) / difference(m) - most / least)

    def difference(m: float) -> float:
        return float(special.ellipk(m) - special.ellipe(m))

    m = least_m
    # ends at 1 - 1e-9 and 1 - 1e-15 move the stiffness by 1e-12, the default tolerance by 2e-11
    if ratio_excess(least_m) < 0:
        m = float(optimize.brentq(ratio_excess, least_m, 1 - 1e-12, xtol=1e-14))
    area = grid.nominal_area
    semi_axis = np.cbrt(1.5 * pressure * area * difference(m) / (math.pi * least * m))
    # half the extent of the ellipse along x and y
    extent = np.sqrt(axis**2 + (1 - m) * (1 - axis**2)) * semi_axis[:, None]
    inside = (extent <= reach).all(axis=1)
    fraction = math.pi * semi_axis**2 * math.sqrt(1 - m) / area
    stiffness = math.pi * semi_axis / special.ellipk(m) / area
    return np.where(inside, fraction, math.nan), np.where(inside, stiffness, math.nan)


def _paraboloid(
    heights: Array,
    grid: Grid,
    *,
    misfit: float = 1e-3,  # rms distance of the surface, over its range: beyond, Hertz does not hold
    # curvature along the summit over that across it: the fit of a cylinder leaves 1e-16 of it, and the ratio
    # of the axes, found between 0 and 1 - 1e-12, holds up to 7e10
    cylinder: float = 1e-9,
) -> tuple[float, float, Array, Array] | None:
    """Return A, B (m-1), the axis of A (x, y), and the distances (m) of the summit from the edges.

    They are those to the nearer edge along x and y. None where the surface is no paraboloid.
    """
    (ny, nx), (dy, dx) = grid.shape, grid.spacing
    half = 0.5 * max((ny - 1) * dy, (nx - 1) * dx)
    y, x = np.meshgrid(
        (np.arange(ny) - (ny - 1) / 2) * dy / half, (np.arange(nx) - (nx - 1) / 2) * dx / half, indexing="ij"
    )
    values, _, scale = shifted(heights)
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1).reshape(-1, 6)
    coefficients = np.linalg.lstsq(terms, values.ravel(), rcond=None)[0]
    distance = values.ravel() - terms @ coefficients
    if math.sqrt(float(np.mean(distance**2))) > misfit * float(np.ptp(values)):
        return None
    _, slope_x, slope_y, xx, xy, yy = coefficients
    curvature = -np.array([[xx, 0.5 * xy], [0.5 * xy, yy]])
    (least, most), axes = np.linalg.eigh(curvature)
    if least <= cylinder * most:
        return None
    summit = 0.5 * np.linalg.solve(curvature, [slope_x, slope_y])
    reach = (np.array([x.max(), y.max()]) - np.abs(summit)) * half
    factor = scale / half**2
    return (float(least) * factor, float(most) * factor, axes[:, 0], reach) if reach.min() > 0 else None


def _small(fraction: Array) -> Array:
    """Return contact fractions, NaN where they are not small."""
    return np.where(fraction <= SMALL_CONTACT, fraction, math.nan)
