"""Hurst exponent and fractal dimension of a surface by any of the methods."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.coords import leading_coords
from fractalcontact.base.power_law import fit_line
from fractalcontact.base.references import joined_references
from fractalcontact.base.results import announce_loading, public_result
from fractalcontact.base.validation import Problems, word_tuple
from fractalcontact.dimensions import (
    _covering_area,
    _cube_counts,
    _roughness_length,
    _spectrum,
    _variation,
    _variogram,
)
from fractalcontact.dimensions._curve import Curve
from fractalcontact.dimensions._increments import increments
from fractalcontact.dimensions._likelihood import likelihood
from fractalcontact.dimensions._methods import DEFAULT, METHODS
from fractalcontact.dimensions._periodic_modes import PeriodicModes, band
from fractalcontact.dimensions._records import CONSTANT, Estimate, plane, undefined
from fractalcontact.dimensions._surface_input import (
    Scales,
    Surface,
    check_scales,
    check_surface,
    read_scales,
    read_surfaces,
)

Array = np.ndarray[Any, np.dtype[Any]]

_FIELDS = (
    "hurst",
    "fitted_hurst",
    "standard_error",
    "ci_low",
    "ci_high",
    "scale_min",
    "scale_max",
    "rms_increment",
    "noise_height",
    "blur_spread",
    "misfit",
)
_NAMES = (*_FIELDS, "fractal_dimension", "topothesy", "run_time", "method", "increment_lag")
IN_BLOCKS = ("increments", "spectrum", "variogram")  # methods that read dask arrays block by block


def _check(problems: Problems, *, surface: Any, methods: Any, scales: Any, psf: Any) -> None:
    names = [DEFAULT]
    if methods is not None and problems.choices("methods", methods, ("default", *METHODS)):
        names = [DEFAULT if name == "default" else name for name in word_tuple(methods)]
        problems.require(bool(names), "methods", "at least one name", methods)
    if psf is not None:
        problems.number("psf", psf, at_least=0.0)
    is_valid = check_surface(
        problems,
        surface,
        smallest=max((METHODS[name].smallest for name in names), default=4),
        gaps=all(METHODS[name].gaps for name in names),
        points=True,
        reserved=_NAMES,
    )
    check_scales(problems, scales, surface if is_valid else None)


@public_result(
    title="Hurst exponent and fractal dimension of a surface",
    check=_check,
    in_blocks=True,
)
def estimate(
    surface: xr.DataArray,
    methods: str | Sequence[str] | None = None,
    *,
    scales: tuple[float, float] | None = None,
    noise: bool = False,
    psf: float | None = None,
) -> xr.Dataset:
    """Estimate the Hurst exponent and the fractal dimension of a surface, with a 95 % interval.

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., y, x), or (..., x) for a profile; NaN where missing (not for "spectrum").
    methods : str or sequence of str, optional
        Names of `fractalcontact.dimensions.methods()`, or "default" ("likelihood"), which is the default.
    scales : (low, high), optional
        Lengths in m between which to fit: wavelengths, lags, or edges of windows or cubes. Default: the
        window of the method.
    noise : bool
        Fit white measurement noise in any case ("likelihood" only). By default where the heights show it.
    psf : float, optional
        Standard deviation in m of the Gaussian point spread function of the instrument, 0 for none
        ("likelihood" with free edges only). By default it is estimated where the heights show a blur.

    Returns
    -------
    Dataset over the leading dims and `method`
        `hurst` (limited to 0 ... 1; `fitted_hurst` is not), `fractal_dimension` (3 - hurst, of a profile
        2 - hurst), `standard_error`, `ci_low`, `ci_high` (of hurst; NaN for methods without a validated
        interval), `scale_min`, `scale_max` (m), `rms_increment` over `increment_lag` (m), `topothesy` (m),
        `noise_height`, `blur_spread` (m; NaN where not fitted), `misfit` (z of a change of the exponent
        with scale) and `run_time` (s). Notes, reasons and windows are JSON by method in the attributes
        `comment` and `reason`.

    Raises
    ------
    InvalidInput
        Names, scales or axes are wrong, a surface is too small or entirely NaN.

    Notes
    -----
    Free edges: fractional Brownian heights. Periodic: a power-law spectrum between cut-offs. The interval
    is widened, with a note, where the surface fits neither. Theory, coverage and limits: page
    `theory_dimensions`. Select a method with ``sel({"method": "spectrum"})``.

    References
    ----------
    Whittle (1957), J. R. Stat. Soc. B 19; Sykulski et al. (2019), Biometrika 106.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((128, 128), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1)
    >>> result = fc.dimensions.estimate(surface).sel({"method": "default"})
    >>> bool(result.ci_low < 0.7 < result.ci_high), round(float(result.fractal_dimension), 1)
    (True, 2.3)
    """
    surfaces, window = read_surfaces(surface), read_scales(scales)
    names = ("default",) if methods is None else word_tuple(methods)
    if set(names) - set(IN_BLOCKS):
        announce_loading("fractalcontact.dimensions.estimate", {"surface": surface})
    estimates, times = [], np.zeros((len(surfaces), len(names)))
    for row, single in enumerate(surfaces):
        for column, name in enumerate(names):
            start = time.perf_counter()
            if name in ("default", "likelihood"):
                record = likelihood(single, window, bool(noise), psf)
            else:
                record = _ESTIMATORS[name](single, window, bool(noise))
            if single.finest_scale:
                record = record.gridded(single.finest_scale)
            estimates.append(record.limited())
            times[row, column] = time.perf_counter() - start
    return _with_reasons(_dataset(surface, surfaces, names, estimates, times), names, estimates)


def _dataset(
    surface: xr.DataArray,
    surfaces: Sequence[Surface],
    names: Sequence[str],
    estimates: Sequence[Estimate],
    times: Array,
) -> xr.Dataset:
    """Return the records, surfaces by methods, as a Dataset over the leading dims and the methods."""
    axes, spacing = surfaces[0].axes, surfaces[0].grid.spacing[-1]
    leading = surface.dims[: surface.ndim - axes]
    shape = [*(surface.sizes[dim] for dim in leading), len(names)]

    def stacked(values: Any) -> tuple[Any, Array]:
        return (*leading, "method"), np.asarray(values, dtype=np.float64).reshape(shape)

    data = {"hurst": stacked([record.hurst for record in estimates])}
    data["fractal_dimension"] = data["hurst"][0], 1.0 + axes - data["hurst"][1]
    for field in _FIELDS[1:]:
        data[field] = stacked([getattr(record, field) for record in estimates])
    data["topothesy"] = stacked([record.topothesy(spacing) for record in estimates])
    data["run_time"] = stacked(times)
    coords: dict[str, Any] = dict(leading_coords(surface, leading, taken=data))
    used = [METHODS[DEFAULT if name == "default" else name].references for name in names]
    references = joined_references(*used)
    coords |= {"method": np.array(names, dtype=str), "increment_lag": spacing}
    return xr.Dataset(data, coords=coords, attrs={"default_method": DEFAULT, "references": references})


def _with_reasons(result: xr.Dataset, names: Sequence[str], estimates: Sequence[Estimate]) -> xr.Dataset:
    """Add windows, notes and reasons of missing values to the variables, as JSON by method."""

    def collected(field: str) -> str:
        texts: dict[str, dict[str, None]] = {name: {} for name in names}
        for k, record in enumerate(estimates):
            if text := getattr(record, field):
                texts[names[k % len(names)]][text] = None
        return json.dumps({name: "; ".join(text) for name, text in texts.items() if text}, ensure_ascii=True)

    for name in ("standard_error", "ci_low", "ci_high"):
        result[name].attrs["reason"] = collected("reason")
    for name in ("scale_min", "scale_max"):
        result[name].attrs["comment"] = collected("window")
    result["hurst"].attrs["comment"] = collected("note")
    if any(np.isnan(record.hurst) for record in estimates):
        result["hurst"].attrs["reason"] = collected("reason")
    return result


@dataclass(frozen=True)
class CurveMethod:
    """A straight line through a curve in log-log scale.

    Attributes
    ----------
    measure : callable
        From a surface (and the longest lag, with `has_lags`) to its curve.
    to_hurst : callable
        From slope and number of axes to H.
    power : float or None
        Weights of the points, scale^power; None: their counts.
    window : callable
        From a surface to the shortest scale, the longest scale and the rule in words.
    as_wavelength : bool
        The scales of the curve are wavenumbers.
    equal_octaves : bool
        Give every octave of a free surface the same weight: a measured surface leaves its power law at the
        short end first, where most of the modes are. Counts are right for a periodic one.
    ignores_plane : bool
        The curve does not change when a plane is added.
    corrects_windows : bool
        Compare the line with the expectation for windows of few points.
    has_lags : bool
        The curve can be measured up to a longest lag.
    unit_note : str
        Note of a method that depends on the unit of height.
    """

    measure: Callable[..., Curve]
    to_hurst: Callable[[float, int], float]
    power: float | None
    window: Callable[[Surface], tuple[float, float, str]]
    as_wavelength: bool = False
    equal_octaves: bool = False
    ignores_plane: bool = False
    corrects_windows: bool = False
    has_lags: bool = False
    unit_note: str = ""

    def __call__(self, surface: Surface, scales: Scales, noise: bool) -> Estimate:
        """Measure the curve, choose the window, fit."""
        if self.ignores_plane and surface.is_plane:
            return undefined(CONSTANT) if surface.is_constant else plane()
        if surface.is_constant and not self.unit_note:
            return undefined(CONSTANT)
        low, high, rule = self.window(surface) if scales is None else (*scales, "asked for")
        if surface.finest_scale and scales is None:
            low, high = max(low, surface.finest_scale), max(high, 4.0 * surface.finest_scale)
            rule = f"{rule}; not below the shortest wavelength that the points resolve"
        longest = (high,) if self.has_lags and (scales is not None or surface.finest_scale) else ()
        # slopes do not depend on the unit of height, except for methods with a natural scale
        overflows = not self.unit_note and surface.squares_overflow
        curve = self.measure(surface.in_own_unit() if overflows else surface, *longest)
        lengths = 2.0 * np.pi / curve.scale if self.as_wavelength else curve.scale
        inside = (lengths >= low * (1 - 1e-9)) & (lengths <= high * (1 + 1e-9)) & (curve.value > 0)
        if np.count_nonzero(inside) < 2:
            return undefined(f"fewer than two points of the curve between {low:g} m and {high:g} m")
        x, y = curve.scale[inside], curve.value[inside]
        power = -1.0 if self.equal_octaves and not all(surface.grid.periodic) else self.power
        weights = curve.count[inside].astype(float) if power is None else (x / x[0]) ** power
        slope = fit_line(x, y / y[0], weights).slope  # a constant curve has slope 0 to the last bit
        hurst = self.to_hurst(slope, surface.axes)
        if self.corrects_windows and curve.edges is not None:
            edges = curve.edges[inside]
            hurst = _small_window_hurst(x, y / y[0], weights, edges, surface.plane_spacing, hurst)
        return Estimate(
            hurst,
            scale_min=float(lengths[inside].min()),
            scale_max=float(lengths[inside].max()),
            window=rule,
            reason="the points of the curve are correlated, so the scatter about a straight line gives no "
            "interval",
            note="noise is not in the model of this method" if noise else self.unit_note,
        )


def _small_window_hurst(
    x: Array, y: Array, weights: Array, edges: Array, spacing: tuple[float, float], uncorrected: float
) -> float:
    """Return the exponent whose expected roughness grows as measured; the uncorrected one if none does."""
    from scipy.optimize import brentq

    def excess_slope(hurst: float) -> float:
        expected = _roughness_length.expected_roughness(edges, spacing, hurst)
        return fit_line(x, y / expected, weights).slope

    low, high = 1e-3, 0.999
    if not excess_slope(low) > 0.0 > excess_slope(high):
        return uncorrected
    return float(brentq(excess_slope, low, high, xtol=1e-6))


def _wavelength_window(surface: Surface) -> tuple[float, float, str]:
    """Return the wavelengths of a spectrum to fit."""
    spacing, extent = max(surface.grid.spacing), min(surface.grid.extent)
    if all(surface.grid.periodic):
        heights = surface.heights if surface.axes == 2 else surface.heights[0]
        low, high = band(PeriodicModes.of(heights, surface.relative_spacing))
        unit = max(surface.grid.extent)
        longest = unit / low if low > 0 else unit
        rule = "the band of a periodic surface between its cut-offs and beyond its roll-off"
        return unit / high, longest, rule
    shortest = float(np.clip(min(surface.grid.shape) / 64.0, 4.0, 8.0)) * spacing
    if extent / 4.0 < 2.0 * shortest:
        return 2.0 * spacing, extent, "a small surface: all wavelengths"
    rule = "4 to 8 spacings (a 64th of the surface), where aliasing is negligible, to a quarter of the extent"
    return shortest, extent / 4.0, rule


def _lag_window(surface: Surface) -> tuple[float, float, str]:
    """Return the lags of increments to fit."""
    spacing, extent = max(surface.grid.spacing), min(surface.grid.extent)
    if any(surface.grid.periodic) and extent / 16.0 >= 8.0 * spacing:
        rule = "4 spacings to a 16th of the extent, well inside the band of a periodic surface"
        return 4.0 * spacing, extent / 16.0, rule
    rule = "up to 4 spacings: longer lags have few independent pairs"
    return min(surface.grid.spacing), 4.0 * spacing, rule


def _roughness_window(surface: Surface) -> tuple[float, float, str]:
    """Return the edges of windows of roughness to fit."""
    spacing, extent = max(surface.grid.spacing), min(surface.grid.extent)
    if extent / 8.0 >= 16.0 * spacing:
        rule = "8 spacings to an 8th of the extent: smaller windows hold too few points"
        return 8.0 * spacing, extent / 8.0, rule
    return 4.0 * spacing, extent / 2.0, "a small surface: 4 spacings to half the extent"


def _cube_window(surface: Surface) -> tuple[float, float, str]:
    """Return the edges of cubes and triangles to fit."""
    spacing, extent = max(surface.grid.spacing), min(surface.grid.extent)
    if extent / 4.0 >= 4.0 * spacing:
        return spacing, extent / 4.0, "one spacing to a quarter of the extent"
    return spacing, extent / 2.0, "a small surface: one spacing to half the extent"


def _segment_window(surface: Surface) -> tuple[float, float, str]:
    """Return the lengths of segments to fit."""
    spacing, extent = max(surface.grid.spacing), min(surface.grid.extent)
    if extent / 4.0 >= 16.0 * spacing:
        rule = "8 spacings to a quarter of the extent: shorter segments miss heights between their points"
        return 8.0 * spacing, extent / 4.0, rule
    return _cube_window(surface)


_UNIT = "depends on the unit of height: see the curve's vertical_scale"
_ESTIMATORS: dict[str, Callable[[Surface, Scales, bool], Estimate]] = {
    "likelihood": likelihood,
    "increments": increments,
    "spectrum": CurveMethod(
        lambda surface: _spectrum.spectrum_curve(surface, "auto"),
        lambda slope, axes: -0.5 * (slope + axes),
        None,
        _wavelength_window,
        as_wavelength=True,
        equal_octaves=True,
        ignores_plane=True,
    ),
    "variogram": CurveMethod(
        _variogram.variogram_curve, lambda slope, _: 0.5 * slope, -2.0, _lag_window, has_lags=True
    ),
    "madogram": CurveMethod(
        _variogram.madogram_curve, lambda slope, _: slope, 0.0, _lag_window, has_lags=True
    ),
    "second_variogram": CurveMethod(
        _variogram.second_variogram_curve,
        lambda slope, _: 0.5 * slope,
        0.0,
        _lag_window,
        ignores_plane=True,
        has_lags=True,
    ),
    "roughness_length": CurveMethod(
        _roughness_length.roughness_length_curve,
        lambda slope, _: slope,
        0.0,
        _roughness_window,
        ignores_plane=True,
        corrects_windows=True,
    ),
    "variation": CurveMethod(_variation.variation_curve, lambda slope, _: slope, 0.0, _segment_window),
    "cube_counts": CurveMethod(
        _cube_counts.cube_count_curve,
        lambda slope, axes: 1.0 + axes + slope,
        0.0,
        _cube_window,
        unit_note=_UNIT,
    ),
    "covering": CurveMethod(
        _covering_area.covering_curve, lambda slope, _: 1.0 + slope, 0.0, _cube_window, unit_note=_UNIT
    ),
}
