"""The curve behind each method, with its local slope, before any fit."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.provenance import accounted
from fractalcontact.base.scaling import local_slope
from fractalcontact.dimensions import _measures
from fractalcontact.dimensions._faces import read_faces
from fractalcontact.dimensions._tables import finish, stack

if TYPE_CHECKING:
    import xarray as xr

Array = np.ndarray[Any, np.dtype[Any]]
SPECTRA = ("power_spectral_density", "profile_power_spectral_density")
ALL = ("local_slope", "run_time")  # what every curve has
SUMMED = "rounding: a mean over all there are; what chance leaves in it is told by `estimate`"


@accounted("relative standard error of each value sqrt(2 / mode_count), where no window mixes the modes")
def spectrum(surface: xr.DataArray, *, window: str | None = "auto", tile: int | None = None) -> xr.Dataset:
    """Return the radially averaged power spectral density.

    Parameters
    ----------
    surface : DataArray
        Heights in metres, dims (..., y, x) or (..., x) for a profile, complete.
    window : "auto", "hann" or None
        Taper of the free axes. "auto" is "hann" on free axes and None on periodic ones; None leaves free axes
        untapered too, and their edges then show as a tail q^-3. A plane is taken off unless both axes are
        periodic, then only the mean.
    tile : int, optional
        Average the spectra of square tiles with this edge in points, overlapping by half (Welch 1967): for
        surfaces that do not fit in memory, or for a smoother curve. Default: the whole face.

    Returns
    -------
    Dataset over `wavenumber` (rad m-1)
        `power_spectral_density` (m4; `profile_power_spectral_density`, m3, of a profile), `mode_count`,
        `local_slope` (over a factor of two in wavenumber), and `wavelength` beside the wavenumber. Rings as
        wide as the step of the wavenumbers, up to the smaller Nyquist wavenumber.

    Raises
    ------
    InvalidInput
        Heights are missing, an axis is not uniform, a tile does not fit.

    Notes
    -----
    Convention: C(q) = dx dy |Z(q)|^2 / (nx ny), so that its integral over dqx dqy / (2 pi)^2 is the mean
    square height; see `fractalcontact.base.spectra`. For a self-affine surface C falls as q^(-2 - 2 H), for
    a profile as q^(-1 - 2 H).

    References
    ----------
    Jacobs, Junge and Pastewka (2017), Surface Topography: Metrology and Properties 5, 013001.
    """
    with Problems("fractalcontact.dimensions.spectrum") as problems:
        taken = (*SPECTRA, "wavenumber", "wavelength", "mode_count", *ALL)
        faces = read_faces(surface, problems, smallest=4, gaps=False, squares=True, taken=taken)
        given = problems.choice("window", "none" if window is None else window, ("auto", "hann", "none"))
        edge = None if tile is None else problems.integer("tile", tile, at_least=8)
        if faces and edge is not None:
            problems.require(
                edge <= min(faces[0].grid.shape), "tile", f"at most {min(faces[0].grid.shape)}", edge
            )
    started = time.perf_counter()
    curves = [_measures.spectrum(face, given, edge) for face in faces]
    name = SPECTRA[2 - faces[0].axes]
    result = stack(surface, faces, "wavenumber", curves, {name: "value"}, {"mode_count": "count"})
    result = result.assign_coords(wavelength=2.0 * np.pi / result["wavenumber"])
    slopes = [_measures.wide_slope(c.scale, c.value, c.count) for c in curves]
    return finish(
        result, surface, faces, "spectrum", slopes, started, {"window": window, "tile": tile},
        title="Power spectral density of a surface",
        references="Jacobs, Junge and Pastewka, Surface Topography: Metrology and Properties 5 (2017) 013001",
    )  # fmt: skip


@accounted(SUMMED)
def variogram(surface: xr.DataArray, *, max_lag: float | None = None) -> xr.Dataset:
    """Return the variogram: half the mean square height increment over all pairs of points at a lag.

    Parameters
    ----------
    surface : DataArray
        Heights in metres, dims (..., y, x) or (..., x); NaN where nothing was observed.
    max_lag : float, optional
        Largest lag in metres, up to the diagonal. Default: half the shorter extent. Few lags are summed in
        one pass, also over a surface that is not in memory (then the default is four spacings); many by
        transforms.

    Returns
    -------
    Dataset over `lag` (m)
        `variogram` (m2), `pair_count` and `local_slope`, which is 2 H for a self-affine surface. Pairs in all
        directions are pooled. Up to 4.5 spacings each distance is a lag of its own; beyond, they are pooled
        in rings as wide as the larger spacing. Pairs wrap around periodic axes, where
        no lag is longer than half the period.

    Raises
    ------
    InvalidInput
        An axis is not uniform, nothing was observed, or no lag is left.

    References
    ----------
    Matheron (1963), Economic Geology 58; with transforms and gaps: Marcotte (1996), Computers and
    Geosciences 22.
    """
    return _lag_curve("variogram", surface, max_lag, _measures.variogram, {"variogram": "value"})


@accounted(SUMMED)
def madogram(surface: xr.DataArray, *, max_lag: float | None = None) -> xr.Dataset:
    """Return the madogram: half the mean absolute height increment, along both axes.

    Parameters
    ----------
    surface : DataArray
        As for `variogram`.
    max_lag : float, optional
        Largest lag in metres; default a quarter of the shorter extent.

    Returns
    -------
    Dataset over `lag` (m)
        `madogram` (m), `pair_count` and `local_slope`, which is H for a self-affine surface. Five lags or so
        for each doubling.

    Raises
    ------
    InvalidInput
        An axis is not uniform, nothing was observed, or the longest lag is below one spacing.

    References
    ----------
    Gneiting, Sevcikova and Percival (2012), Statistical Science 27.
    """
    return _lag_curve("madogram", surface, max_lag, _measures.madogram, {"madogram": "value"})


@accounted(SUMMED)
def second_variogram(surface: xr.DataArray, *, max_lag: float | None = None) -> xr.Dataset:
    """Return the mean square second difference of the heights, along both axes.

    A tilt adds nothing to z(s - h) - 2 z(s) + z(s + h), and its mean square converges for every H < 1, where
    that of first differences does not.

    Parameters
    ----------
    surface : DataArray
        As for `variogram`.
    max_lag : float, optional
        Largest lag h in metres; default an eighth of the shorter extent.

    Returns
    -------
    Dataset over `lag` (m)
        `second_variogram` (m2), `pair_count` (of triples) and `local_slope`, which is 2 H for a self-affine
        surface.

    Raises
    ------
    InvalidInput
        An axis is not uniform, nothing was observed, or the longest lag is below one spacing.

    References
    ----------
    Chan and Wood (2000), Annals of Statistics 28; Zhu and Stein (2002), J. Agric. Biol. Environ. Stat. 7.
    """
    return _lag_curve(
        "second_variogram", surface, max_lag, _measures.second_variogram, {"second_variogram": "value"}
    )


@accounted(SUMMED)
def roughness_length(surface: xr.DataArray) -> xr.Dataset:
    """Return the mean rms height inside square windows, each about a plane of its own.

    Parameters
    ----------
    surface : DataArray
        Heights in metres, dims (..., y, x) or (..., x); windows with a NaN in them are left out.

    Returns
    -------
    Dataset over `window_size` (m)
        `roughness` (m), `pair_count` (of windows) and `local_slope`, which is H for a self-affine surface.
        Windows overlap by half; their edge grows by sqrt 2 from 4 points to a quarter of the face.

    Raises
    ------
    InvalidInput
        An axis is not uniform, nothing was observed, or an axis has fewer than 5 points.

    References
    ----------
    Malinverno (1990), Geophysical Research Letters 17.
    """
    return _window_curve(
        "roughness_length", surface, "window_size", {"roughness": "value"}, {}, "Roughness inside windows"
    )


@accounted(SUMMED)
def variation(surface: xr.DataArray) -> xr.Dataset:
    """Return the mean range of the heights over stretches of the rows and of the columns.

    The boxes that a profile meets in a stretch are as high as the range of the profile there: this is what
    box counting measures, without a grid and without a unit of height.

    Parameters
    ----------
    surface : DataArray
        Heights in metres, dims (..., y, x) or (..., x); stretches with a NaN in them are left out.

    Returns
    -------
    Dataset over `window_size` (m)
        `variation` (m), `pair_count` (of stretches) and `local_slope`, which is H for a self-affine surface.
        Lengths double from one spacing to half the face.

    Raises
    ------
    InvalidInput
        An axis is not uniform, or nothing was observed.

    Notes
    -----
    Over one spacing it is the mean absolute increment, twice the madogram. Hall and Wood (1993) take the
    difference of the two ends of a stretch for its range, over one and two spacings: that is
    ``estimate(surface, "madogram", scales=(dx, 2 * dx))``. The range sees more of the stretch and less of
    the heights between the points, so that its slope is too high where H is small.

    References
    ----------
    Dubuc, Quiniou, Roques-Carmes, Tricot and Zucker (1989), Physical Review A 39; Hall and Wood (1993),
    Biometrika 80.
    """
    return _window_curve(
        "variation", surface, "window_size", {"variation": "value"}, {}, "Range of heights over stretches"
    )


@accounted(SUMMED)
def cube_counts(surface: xr.DataArray, *, vertical_scale: float | str = "range") -> xr.Dataset:
    """Count the cubes that meet the surface, on average over all positions of their grid.

    The count depends on the unit of height: where heights are small against the cubes it is that of a
    plane, whatever the surface. `vertical_scale` says how heights were scaled, and is kept in the result.

    Parameters
    ----------
    surface : DataArray
        Heights in metres, dims (..., y, x) or (..., x); columns of cubes with a NaN in them are left out.
    vertical_scale : "range" or float
        "range" multiplies the heights so that their range is the extent of the face (the geometric mean of
        its edges); a number multiplies them by it, 1 being natural scale.

    Returns
    -------
    Dataset over `cube_size` (m)
        `cube_count` (not whole, being a mean over positions), `local_slope`, which is -D for a fractal
        surface, and `vertical_scale`, the factor on the heights. Edges double from one spacing to half the
        face.

    Raises
    ------
    InvalidInput
        An axis is not uniform, nothing was observed, or `vertical_scale` is not positive.

    Notes
    -----
    How much the unit matters: a fractional Brownian face of 512 x 512 points with H = 0.6 and an rms
    increment of a tenth of the spacing, D = 2.4, gives 2.00, 2.02, 2.14, 2.30 and 2.34 as its heights are
    multiplied by 0.1, 1, 10, 100 and 1000.

    Extremes of sampled heights miss what lies between the points, so that D is too low for rough surfaces,
    by 0.2 to 0.3 where H is small.

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998); Clarke (1986), Computers and Geosciences 12.
    """
    return _window_curve(
        "cube_counts",
        surface,
        "cube_size",
        {"cube_count": "value"},
        {"vertical_scale": vertical_scale},
        "Cube counts",
    )


@accounted(SUMMED)
def covering(surface: xr.DataArray, *, vertical_scale: float = 1.0) -> xr.Dataset:
    """Return the area of the triangulated surface against the edge of the triangles.

    Parameters
    ----------
    surface : DataArray
        Heights in metres, dims (..., y, x), or (..., x) for the length of a profile; cells with a NaN at
        a corner are left out.
    vertical_scale : float
        Multiplies the heights; 1 is natural scale. The area of a surface of small slopes hardly depends on
        the edge: its dimension by this method is then 2, and is 2 exactly for a plane.

    Returns
    -------
    Dataset over `cube_size` (m)
        `covering_area` (m2, of the nominal area; `covering_length`, m, of a profile), `local_slope`, which
        is 2 - D (1 - D of a profile), and `vertical_scale`. Edges double from one spacing to half the face.

    Raises
    ------
    InvalidInput
        An axis is not uniform, nothing was observed, or `vertical_scale` is not positive.

    References
    ----------
    Clarke (1986), Computers and Geosciences 12 (triangular prisms).
    """
    name = "covering_area" if "y" in getattr(surface, "dims", ()) else "covering_length"
    return _window_curve(
        "covering",
        surface,
        "cube_size",
        {name: "value"},
        {"vertical_scale": vertical_scale},
        "Area of the covering",
    )


def _lag_curve(
    name: str, surface: Any, max_lag: float | None, measure: Callable[..., Any], value: dict[str, str]
) -> xr.Dataset:
    with Problems(f"fractalcontact.dimensions.{name}") as problems:
        faces = read_faces(surface, problems, squares=True, taken=(*value, "lag", "pair_count", *ALL))
        longest = None if max_lag is None else problems.number("max_lag", max_lag, above=0)
        if faces and longest is not None:
            least = min(faces[0].grid.spacing)
            problems.require(
                longest >= least * (1 - 1e-9), "max_lag", f"at least one spacing, {least:g} m", longest
            )
    started = time.perf_counter()
    curves = [measure(face, longest) for face in faces]
    result = stack(surface, faces, "lag", curves, value, {"pair_count": "count"})
    slopes = [local_slope(c.scale, c.value) for c in curves]
    title = {
        "variogram": "Variogram",
        "madogram": "Madogram",
        "second_variogram": "Mean square second differences",
    }
    return finish(
        result,
        surface,
        faces,
        name,
        slopes,
        started,
        {"max_lag": max_lag},
        title=f"{title[name]} of a surface",
    )


def _window_curve(
    name: str, surface: Any, dim: str, value: dict[str, str], options: dict[str, Any], title: str
) -> xr.Dataset:
    with Problems(f"fractalcontact.dimensions.{name}") as problems:
        taken = (*value, dim, "pair_count", "vertical_scale", *ALL)
        faces = read_faces(surface, problems, smallest=_measures.SMALLEST[name], squares=True, taken=taken)
        scale = options.get("vertical_scale")
        if scale is not None and not (name == "cube_counts" and isinstance(scale, str) and scale == "range"):
            scale = problems.number("vertical_scale", scale, above=0, at_least=1e-50, at_most=1e50)
    started = time.perf_counter()
    arguments = () if scale is None else (scale,)
    curves = [_measures.MEASURES[name](face, *arguments) for face in faces]
    counted = {"pair_count": "count"} if name in ("roughness_length", "variation") else {}
    result = stack(surface, faces, dim, curves, value, counted)
    # over its first value, a constant curve has slope 0 to the last bit
    slopes = [local_slope(c.scale, c.value / (c.value[:1] if (c.value > 0).all() else 1.0)) for c in curves]
    return finish(result, surface, faces, name, slopes, started, options, title=f"{title} of a surface")
