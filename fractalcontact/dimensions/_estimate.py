"""Hurst exponent and fractal dimension of a surface by any of the methods."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.construction import make_dataset
from fractalcontact.base.coords import leading_coords
from fractalcontact.base.grid import core_dims, read_grid
from fractalcontact.base.memory import Plane
from fractalcontact.base.references import joined_references
from fractalcontact.base.results import announce_loading, public_result
from fractalcontact.base.validation import Problems, word_tuple
from fractalcontact.dimensions import (
    _covering_area,
    _cube_counts,
    _detrended_fluctuation,
    _divider,
    _higuchi,
    _roughness_length,
    _spectrum,
    _variation,
    _variogram,
)
from fractalcontact.dimensions._curve import Curve
from fractalcontact.dimensions._curve_method import CurveMethod
from fractalcontact.dimensions._increments import increments
from fractalcontact.dimensions._likelihood import likelihood
from fractalcontact.dimensions._methods import DEFAULT, METHODS
from fractalcontact.dimensions._periodic_modes import PeriodicModes, band
from fractalcontact.dimensions._records import UNSEEN, Estimate
from fractalcontact.dimensions._surface_input import (
    Scales,
    Surface,
    check_scales,
    check_surface,
    has_gaps,
    read_scales,
    read_surfaces,
)

Array = np.ndarray[Any, np.dtype[Any]]

# bytes of a point at the peak of a method: of maximum likelihood on a torus, on a rectangle and, beyond a
# million points, by blocks of modes (`_surface_likelihood`), which take 61, and 127 where a surface is smooth
# but for spikes: a factor of 1.45 from either; with gaps, which take 98 to 185, and 283 where two fifths are
# missing; and of others
PERIODIC_BYTES, FREE_BYTES, BLOCK_BYTES, GAPPED_BYTES = 97.0, 156.0, 88.0, 195.0
METHOD_BYTES = {"variogram": 325.0, "increments": 16.0, "madogram": 16.0}

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
CHECKED = ("spectrum", "roughness_length", "higuchi", "detrended_fluctuation")  # curves with an interval
IN_BLOCKS = ("increments", "spectrum", "variogram")  # methods that read dask arrays block by block


def _check(problems: Problems, *, surface: Any, methods: Any, scales: Any, psf: Any) -> None:
    names = [DEFAULT]
    if methods is not None and problems.choices("methods", methods, ("default", *METHODS)):
        names = [DEFAULT if name == "default" else name for name in word_tuple(methods)]
        problems.require(bool(names), "methods", "at least one name", methods)
    is_number = psf is not None and problems.number("psf", psf, at_least=0.0)
    is_valid = check_surface(
        problems,
        surface,
        smallest=max((METHODS[name].smallest for name in names), default=4),
        gaps=all(METHODS[name].gaps for name in names),
        points=True,
        reserved=_NAMES,
    )
    if is_valid and is_number:
        extent = max(read_grid(surface, core_dims(surface)).extent)
        problems.number("psf", psf, at_most=extent)
    check_scales(problems, scales, surface if is_valid else None)


def _memory(plane: Plane, arguments: Mapping[str, Any]) -> float:
    """Return the bytes of the method that takes most; surfaces are analysed one by one."""
    methods = arguments.get("methods")
    points = math.prod(plane.shape)
    default = BLOCK_BYTES if points > 1 << 20 else PERIODIC_BYTES if plane.periodic else FREE_BYTES
    default = GAPPED_BYTES if has_gaps(arguments.get("surface")) else default
    most = max((METHOD_BYTES.get(name, default) for name in word_tuple(methods)), default=default)
    return most * points


@public_result(
    title="Hurst exponent and fractal dimension of a surface",
    check=_check,
    in_blocks=True,
    memory=_memory,
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
    is widened, with a note, where the surface fits neither. Theory: page `theory_dimensions`; measured
    coverage and limits: page `estimator_accuracy`. Select a method with ``sel({"method": "spectrum"})``.

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
        by_modes = cache(lambda single=single: likelihood(single, window, bool(noise), psf))
        for column, name in enumerate(names):
            start = time.perf_counter()
            if name in ("default", "likelihood"):
                record = by_modes()
            else:
                record = _ESTIMATORS[name](single, window, bool(noise))
                if name in CHECKED and window is None and np.isfinite(record.ci_low) and not single.is_lazy:
                    found = by_modes().found_beside(record.hurst, record.standard_error)
                    found = found or (UNSEEN if single.axes == 1 else "")
                    record = record.beside_modes(by_modes(), found)
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
    return make_dataset(data, coords, {"default_method": DEFAULT, "references": references})


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


def _higuchi_window(surface: Surface) -> tuple[float, float, str]:
    """Return the lags of Higuchi's lengths to fit."""
    spacing, extent = max(surface.grid.spacing), min(surface.grid.extent)
    longest = max(extent / 16.0, 4.0 * spacing)
    return spacing, longest, "one spacing to a 16th of the profile: longer lags have few independent pairs"


def _fluctuation_window(surface: Surface) -> tuple[float, float, str]:
    """Return the windows of the fluctuation to fit."""
    spacing, extent = max(surface.grid.spacing), min(surface.grid.extent)
    if extent / 8.0 >= 16.0 * spacing:
        return 8.0 * spacing, extent / 8.0, "8 spacings to an 8th of the profile"
    return 4.0 * spacing, extent / 4.0, "a short profile: 4 spacings to a quarter of it"


def _divider_window(surface: Surface) -> tuple[float, float, str]:
    """Return the openings of dividers to fit."""
    spacing, extent = max(surface.grid.spacing), min(surface.grid.extent)
    return spacing, max(extent / 8.0, 2.0 * spacing), "one spacing to an 8th of the profile"


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


def _expected_roughness(surface: Surface, curve: Curve, hurst: float) -> Array:
    assert curve.edges is not None
    return _roughness_length.expected_roughness(curve.edges, surface.plane_spacing, hurst)


def _roughness_covariance(surface: Surface, curve: Curve, hurst: float) -> Array | str:
    assert curve.edges is not None
    if any(surface.grid.periodic):
        return _PERIODIC
    if min(surface.grid.extent) < _LEAST_WINDOWS * max(surface.grid.spacing):
        return "so small a surface holds too few windows"
    return _roughness_length.roughness_covariance(curve.edges, surface.shape, hurst)


def _fluctuation_covariance(surface: Surface, curve: Curve, hurst: float) -> Array | str:
    assert curve.edges is not None
    if surface.axes == 2 or any(surface.grid.periodic):
        return _ROWS if surface.axes == 2 else _PERIODIC
    return _detrended_fluctuation.fluctuation_covariance(curve.edges, surface.shape[1], hurst)


def _higuchi_covariance(surface: Surface, curve: Curve, hurst: float) -> Array | str:
    if surface.axes == 2 or any(surface.grid.periodic):
        return _ROWS if surface.axes == 2 else _PERIODIC
    lags = np.rint(curve.scale / surface.spacing[1]).astype(np.int64)
    return _higuchi.mean_increment_covariance(lags, surface.shape[1], hurst)


def _expected_spectrum(surface: Surface, _: Curve, hurst: float) -> Array | None:
    """Return the expected spectrum of a free surface; None of a profile or a periodic surface."""
    if surface.axes == 1 or any(surface.grid.periodic):
        return None
    return _spectrum.expected_spectrum(surface.shape, surface.spacing, hurst)


def _spectrum_covariance(surface: Surface, curve: Curve, _: float) -> Array | str:
    if surface.axes == 1:
        return "a ring of a profile is one mode, whose logarithm is not normally distributed"
    sides = surface.grid.extent
    if max(sides) > _LONGEST * min(sides):
        return "the surface is too long for its width: its rings hold few waves along the short side"
    if any(surface.grid.periodic) and not all(surface.grid.periodic):
        return _PERIODIC
    return _spectrum.ring_covariance(
        curve.count, surface.shape, surface.spacing, is_tapered=not all(surface.grid.periodic)
    )


_LEAST_WINDOWS = 128  # points along an axis from which on windows are at most an eighth of the surface
_LONGEST = 4.0  # ratio of the sides up to which the covariance of rings was checked
_PERIODIC = "a periodic surface is not fractional Brownian, for which the covariance of the curve is known"
_ROWS = "the covariance of the curve is known for a single profile, not for the rows of a surface"
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
        expected=_expected_spectrum,
        covariance=_spectrum_covariance,
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
        expected=_expected_roughness,
        covariance=_roughness_covariance,
    ),
    "variation": CurveMethod(_variation.variation_curve, lambda slope, _: slope, 0.0, _segment_window),
    "higuchi": CurveMethod(
        _higuchi.higuchi_curve,
        lambda slope, _: 2.0 + slope,
        0.0,
        _higuchi_window,
        covariance=_higuchi_covariance,
    ),
    "detrended_fluctuation": CurveMethod(
        _detrended_fluctuation.detrended_fluctuation_curve,
        lambda slope, _: slope,
        0.0,
        _fluctuation_window,
        ignores_plane=True,
        expected=_expected_roughness,
        covariance=_fluctuation_covariance,
    ),
    "divider": CurveMethod(
        _divider.divider_curve, lambda slope, _: 1.0 + slope, 0.0, _divider_window, unit_note=_UNIT
    ),
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
