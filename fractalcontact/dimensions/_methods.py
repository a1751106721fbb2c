"""The methods by name: what they are for, what they do with a face, and how the window is chosen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fractalcontact.base.scaling import fit_line
from fractalcontact.dimensions import _covers, _increments, _measures
from fractalcontact.dimensions._estimates import CONSTANT, Estimate, normal_interval, plane, undefined
from fractalcontact.dimensions._evenness import Evenness, evenness
from fractalcontact.dimensions._faces import LEAST, MOST, Face
from fractalcontact.dimensions._likelihood import Scales, likelihood
from fractalcontact.dimensions._pairs import LAGS
from fractalcontact.dimensions._rounding import quantum, told

Array = np.ndarray[Any, np.dtype[Any]]

DEFAULT = "likelihood"
_ASKED = "asked for"
_DEPENDENT = "the points of the curve depend on each other, and the scatter of a straight line says nothing"


@dataclass(frozen=True)
class Method:
    """One estimator: a line for the reader, what it needs, and the function itself."""

    line: str
    estimate: Callable[[Face, Scales, bool], Estimate]
    gaps: bool = True
    smallest: int = 4


def increments(face: Face, scales: Scales, noise: bool) -> Estimate:
    """Compare increments over one, two and four spacings; see `_increments`."""
    dx = face.spacing[1]
    step, lags = 1, len(LAGS)
    if scales is not None:
        coarse = max(face.grid.spacing)
        step = max(1, int(np.ceil(scales[0] / coarse * (1 - 1e-9))))
        lags = sum(lag * step * coarse <= scales[1] * (1 + 1e-9) for lag in LAGS)
        if lags < 2:
            return undefined(
                f"two lags m and 2 m spacings are needed between {scales[0]:g} m and {scales[1]:g} m"
            )
    moments, unit = _moments(face, step)
    firsts, seconds = moments.means[[0, 6]], moments.means[[3, 9]]
    if not np.nansum(firsts) > 0:
        return undefined(CONSTANT)
    window = {
        "scale_min": step * min(face.grid.spacing),
        "scale_max": step * LAGS[lags - 1] * max(face.grid.spacing),
        "window": "the shortest lags, which carry nearly all that is known of H"
        if scales is None
        else _ASKED,
    }
    steps = 0.0 if face.is_lazy else 4.0 * np.spacing(abs(float(face.raw[0, 0]))) / unit
    if not np.nansum(seconds) > max(1e-22 * np.nansum(firsts), steps**2):
        return replace(plane(), **window)  # type: ignore[arg-type]
    found = _increments.closed_form(moments, face.steps, lags=lags)
    if not np.isfinite(found.hurst):
        return undefined(
            f"increments over at least two of the lags 1, 2 and 4 times {step * dx:g} m are needed"
        )
    reason = _not_fractional(face, noise)
    error = np.nan if reason else found.standard_error * found.strain
    parts = Evenness() if reason else evenness(moments, face.steps, found.hurst)
    low, high = parts.applied(found.hurst, *normal_interval(found.hurst, error))
    turned = rounded = ""
    if not reason:
        low, high, turned = found.quieted(low, high)
    if not reason and not face.is_lazy:
        quiet, rounded = _without_rounding(face, moments, unit, lags, error)
        low, high = float(np.fmin(low, quiet[0])), float(np.fmax(high, quiet[1]))
    strained = (
        "the lags disagree on the exponent, and the interval is widened by it" if found.strain > 1.0 else ""
    )
    return Estimate(
        found.hurst,
        error * parts.widening,
        low,
        high,
        increment=found.increment * unit,
        not_given=reason,
        note="; ".join(
            part for part in (strained if found.strain > 1.0 else "", turned, parts.note, rounded) if part
        ),
        **window,  # type: ignore[arg-type]
    )


def _moments(face: Face, step: int) -> tuple[_increments.Moments, float]:
    """Return mean squares of increments and the unit of height they are in: 1 m unless they overflow."""
    reach = _increments.REACH * step
    moments = _increments.moments(face.slabs(reach), face.grid.shape, step)
    largest = float(np.nanmax(moments.means, initial=0.0))
    if face.is_lazy or LEAST**2 < largest < MOST**2:
        return moments, 1.0
    return _increments.moments(face.slabs(reach, face.unit), face.grid.shape, step), face.unit


def _without_rounding(
    face: Face, moments: _increments.Moments, unit: float, lags: int, error: float
) -> tuple[tuple[float, float], str]:
    """Return the interval of the mean squares less those of rounding, and the note, where that matters."""
    step, share = quantum(face.raw / unit if unit != 1.0 else face.raw)
    if not share > 0.5 * error:
        return (np.nan, np.nan), ""
    square = step**2
    means = moments.means - np.tile(np.repeat([square / 6.0, square / 2.0], 3), 2)
    found = _increments.closed_form(replace(moments, means=means), face.steps, lags=lags)
    interval = normal_interval(found.hurst, found.standard_error * found.strain)
    if not np.isfinite(found.hurst):
        interval = (np.nan, 1.0)
    return interval, told(share, "that of increments without what rounding adds to them")


def _not_fractional(face: Face, noise: bool) -> str:
    """Tell why the interval for fractional Brownian heights would not hold."""
    if any(face.grid.periodic):
        return "a periodic face is not fractional Brownian, and its shortest increments do not scale with H"
    return "noise is not in the model of this method" if noise else ""


@dataclass(frozen=True)
class CurveMethod:
    """A straight line through a curve of `_measures` in log-log scale.

    `to_hurst` turns slope and number of axes into H; `power` weighs the points by scale^power, or by their
    counts where it is None. `octaves` lets every octave of a free face weigh alike: a measured face leaves
    its power law at the short end first, where most of the modes are; on a periodic one counts are right.
    `window` chooses the scales of a face. `levels` tells that the measure does not see a plane; `discrete`
    sets the line against what windows of few points are expected to give; `lags` tells that the curve can
    be measured up to a longest lag; `also` is a note to every estimate.
    """

    measure: Callable[..., _measures.Curve]
    to_hurst: Callable[[float, int], float]
    power: float | None
    window: Callable[[Face], tuple[float, float, str]]
    as_wavelength: bool = False
    octaves: bool = False
    levels: bool = False
    discrete: bool = False
    lags: bool = False
    also: str = ""

    def __call__(self, face: Face, scales: Scales, noise: bool) -> Estimate:
        """Measure the curve, choose the window, fit."""
        if self.levels and face.is_plane:
            return undefined(CONSTANT) if face.is_constant else plane()
        if face.is_constant and not self.also:
            return undefined(CONSTANT)
        # slopes know no unit, but for those methods that have a natural scale
        longest = (scales[1],) if self.lags and scales is not None else ()
        curve = self.measure(face.unitless() if face.is_extreme and not self.also else face, *longest)
        lengths = 2.0 * np.pi / curve.scale if self.as_wavelength else curve.scale
        low, high, rule = self.window(face) if scales is None else (*scales, _ASKED)
        inside = (lengths >= low * (1 - 1e-9)) & (lengths <= high * (1 + 1e-9)) & (curve.value > 0)
        if np.count_nonzero(inside) < 2:
            return undefined(f"fewer than two points of the curve between {low:g} m and {high:g} m")
        x, y = curve.scale[inside], curve.value[inside]
        power = -1.0 if self.octaves and not all(face.grid.periodic) else self.power
        weights = curve.count[inside].astype(float) if power is None else (x / x[0]) ** power
        slope = fit_line(x, y / y[0], weights).slope  # a constant curve has slope 0 to the last bit
        hurst = self.to_hurst(slope, face.axes)
        if self.discrete and curve.edges is not None:
            hurst = _of_few_points(x, y / y[0], weights, curve.edges[inside], face.plane_steps, hurst)
        return Estimate(
            hurst,
            scale_min=float(lengths[inside].min()),
            scale_max=float(lengths[inside].max()),
            window=rule,
            not_given=_DEPENDENT,
            note="noise is not in the model of this method" if noise else self.also,
        )


def _of_few_points(
    x: Array, y: Array, weights: Array, edges: Array, steps: tuple[float, float], plain: float
) -> float:
    """Return the exponent whose expected roughness grows as found; the plain one if there is none."""
    from scipy.optimize import brentq

    def excess(hurst: float) -> float:
        return fit_line(x, y / _covers.expected_roughness(edges, steps, hurst), weights).slope

    low, high = 1e-3, 0.999
    if not excess(low) > 0.0 > excess(high):
        return plain
    return float(brentq(excess, low, high, xtol=1e-6))


def _wave_window(face: Face) -> tuple[float, float, str]:
    """Wavelengths of a spectrum."""
    spacing, extent = max(face.grid.spacing), min(face.grid.extent)
    if all(face.grid.periodic):
        from fractalcontact.dimensions import _periodic

        modes = _periodic.modes(face.heights if face.axes == 2 else face.heights[0], face.steps)
        low, high = _periodic.band(modes)
        unit = max(face.grid.extent)
        longest = unit / low if low > 0 else unit
        return unit / high, longest, "the band of a periodic face between its cut-offs and below its plateau"
    shortest = float(np.clip(min(face.grid.shape) / 64.0, 4.0, 8.0)) * spacing
    if extent / 4.0 < 2.0 * shortest:
        return 2.0 * spacing, extent, "a small face: all wavelengths"
    rule = "4 to 8 spacings (a 64th of the face), where aliasing has faded, to a quarter of the extent"
    return shortest, extent / 4.0, rule


def _short_lags(face: Face) -> tuple[float, float, str]:
    """Lags of increments."""
    spacing, extent = max(face.grid.spacing), min(face.grid.extent)
    if any(face.grid.periodic) and extent / 16.0 >= 8.0 * spacing:
        return (
            4.0 * spacing,
            extent / 16.0,
            "4 spacings to a 16th of the extent, well inside the band of a periodic face",
        )
    return min(face.grid.spacing), 4.0 * spacing, "up to 4 spacings: longer lags have few independent pairs"


def _windows(face: Face) -> tuple[float, float, str]:
    """Edges of windows for roughness."""
    spacing, extent = max(face.grid.spacing), min(face.grid.extent)
    if extent / 8.0 >= 16.0 * spacing:
        return (
            8.0 * spacing,
            extent / 8.0,
            "8 spacings to an 8th of the extent: smaller windows hold too few points",
        )
    return 4.0 * spacing, extent / 2.0, "a small face: 4 spacings to half the extent"


def _edges(face: Face) -> tuple[float, float, str]:
    """Edges of cubes and triangles."""
    spacing, extent = max(face.grid.spacing), min(face.grid.extent)
    if extent / 4.0 >= 4.0 * spacing:
        return spacing, extent / 4.0, "one spacing to a quarter of the extent"
    return spacing, extent / 2.0, "a small face: one spacing to half the extent"


def _stretches(face: Face) -> tuple[float, float, str]:
    """Lengths over which heights range."""
    spacing, extent = max(face.grid.spacing), min(face.grid.extent)
    if extent / 4.0 >= 16.0 * spacing:
        rule = "8 spacings to a quarter of the extent: shorter stretches miss what lies between their points"
        return 8.0 * spacing, extent / 4.0, rule
    return _edges(face)


_UNIT = "depends on the unit of height: see the curve's vertical_scale"
METHODS: dict[str, Method] = {
    "likelihood": Method(
        "the default: maximum likelihood; exact fractional Brownian faces (free), power-law spectra with "
        "cut-offs (periodic); 95 % interval",
        likelihood,
    ),
    "increments": Method(
        "closed form in one pass, first or second differences over 1, 2 and 4 spacings; fractional Brownian "
        "faces; 95 % interval",
        increments,
    ),
    "spectrum": Method(
        "slope of the radially averaged power spectral density; periodic faces, too low on rough free ones; "
        "no interval",
        CurveMethod(
            lambda face: _measures.spectrum(face, "auto"),
            lambda slope, axes: -0.5 * (slope + axes),
            None,
            _wave_window,
            as_wavelength=True,
            octaves=True,
            levels=True,
        ),
        gaps=False,
    ),
    "variogram": Method(
        "slope of the mean square increment; fractional Brownian faces of H below 0.6; no interval",
        CurveMethod(_measures.variogram, lambda slope, _: 0.5 * slope, -2.0, _short_lags, lags=True),
    ),
    "madogram": Method(
        "slope of the mean absolute increment; as the variogram, less moved by outliers; no interval",
        CurveMethod(_measures.madogram, lambda slope, _: slope, 0.0, _short_lags, lags=True),
    ),
    "second_variogram": Method(
        "slope of the mean square second difference; fractional Brownian faces of any H, tilted or not; "
        "no interval",
        CurveMethod(
            _measures.second_variogram, lambda slope, _: 0.5 * slope, 0.0, _short_lags, levels=True, lags=True
        ),
    ),
    "roughness_length": Method(
        "growth of the rms height in windows about their planes, as expected of so few points; fractional "
        "Brownian faces; no interval",
        CurveMethod(
            _measures.roughness_length, lambda slope, _: slope, 0.0, _windows, levels=True, discrete=True
        ),
        smallest=5,
    ),
    "variation": Method(
        "growth of the range of heights over stretches of rows and columns; H too high by 0.05 to 0.25 where "
        "it is below 0.8; no interval",
        CurveMethod(_measures.variation, lambda slope, _: slope, 0.0, _stretches),
    ),
    "cube_counts": Method(
        "slope of the number of cubes that meet the surface, heights scaled to the extent; H too high by "
        "0.05 to 0.4; no interval",
        CurveMethod(_measures.cube_counts, lambda slope, axes: 1.0 + axes + slope, 0.0, _edges, also=_UNIT),
    ),
    "covering": Method(
        "slope of the triangulated area in natural scale; 2 for flat faces, the dimension only where slopes "
        "are far above 1; no interval",
        CurveMethod(_measures.covering, lambda slope, _: 1.0 + slope, 0.0, _edges, also=_UNIT),
    ),
}
