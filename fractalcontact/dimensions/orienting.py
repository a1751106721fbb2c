"""How rough a face is in each direction, and whether the directions differ by more than chance."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base import schema
from fractalcontact.base.checks import Problems
from fractalcontact.base.coords import leading_coords
from fractalcontact.base.provenance import stamp
from fractalcontact.dimensions import _rays
from fractalcontact.dimensions._faces import read_faces, read_scales
from fractalcontact.dimensions._turning import Turned, sectored, turned

if TYPE_CHECKING:
    import xarray as xr

Array = np.ndarray[Any, np.dtype[Any]]

SMALLEST = 16
_ALONG = {
    "hurst": "hurst",
    "fitted_hurst": "fitted",
    "standard_error": "standard_error",
    "ci_low": "low",
    "ci_high": "high",
    "rms_increment": "increment",
}


def directions(
    surface: xr.DataArray,
    azimuth: float | Sequence[float] | None = None,
    *,
    scales: tuple[float, float] | None = None,
) -> xr.Dataset:
    """Estimate exponent, increment and topothesy along each direction, and test isotropy.

    Parameters
    ----------
    surface : DataArray
        Heights in metres, dims (..., y, x), at least 16 points along each axis. NaN marks missing points,
        which are left out.
    azimuth : float or sequence of float, optional
        Directions in degrees, E = 0, anticlockwise; a direction and its opposite are the same. Default: eight
        over the half-circle.
    scales : (low, high), optional
        Lengths in metres: lags of a face with free edges, wavelengths of a periodic one and of the tests.
        Default: the shortest lags, or the band of the spectrum.

    Returns
    -------
    Dataset over the leading dims and `azimuth` (degree, ascending, 0 ... 180)
        hurst, standard_error, ci_low, ci_high, fitted_hurst : as of `estimate`, along each direction.
        rms_increment, topothesy : height increment over `increment_lag`, one x spacing, along the direction,
        and the lag at which it equals the lag (m).
        isotropy_p_value : how likely an isotropic surface shows as much of a difference between directions.
        Below .05 the face is told from an isotropic one, at that risk of an error.
        anisotropy_ratio, anisotropy_ratio_low, anisotropy_ratio_high, anisotropy_azimuth :
        correlations are `anisotropy_ratio` times as long along
        `anisotropy_azimuth` as across it (`fractalcontact.surfaces.spectral` names them so), with its 95 %
        interval; the azimuth means nothing where that begins at 1. NaN where the exponent (of a periodic
        face: one more) is below .05 or within three standard errors of 0, for heights without correlation
        have no stretch; where ridges run on (the azimuth is then theirs); and where a face is smoother than
        a fractal one.
        anisotropy_p_value : how likely a stretch of an isotropic surface shows as much of a difference beyond
        the stretch. A small one tells two exponents, ridges, or a sum f(x) + g(y).
        The attribute `reason` of each of these and of hurst, and the attribute `not_given` of ci_low and
        ci_high, say why a number is missing.

    Raises
    ------
    InvalidInput
        A profile, wrong axes or scales, a face too small or of nothing but NaN.

    Notes
    -----
    Exponents: a face with free edges is measured by second differences over 1, 2 and 4 steps of the lattice
    along each direction; `azimuth` is that of the nearest direction of the lattice, and the interval is that
    of a stretched fractional Brownian surface, edges and gaps counted. Where the exponent changes with the
    lag, the interval also holds those of the shorter and of the longer lags; where no stretch explains the
    face (`anisotropy_p_value` below .001), or ridges run on, there is none. A periodic face is measured by
    the waves of its band that run within 11 degrees of the direction: where two exponents H_x and H_y were
    built in, with the harmonic mean H, the waves along x fall off with the exponent H_x (1 + 1/H) - 1.

    Tests: of a periodic face, the modes over the mean of their ring of wavevectors are held against the
    second and fourth harmonics of the direction, in level and in slope (chi square with 8 degrees of
    freedom, 6 beyond a stretch). The spectrum may have any form. A face with free edges is tapered and
    tested by its waves from 6 spacings to a third of the extent; its second differences are tested in the
    same way where they follow a power law of the lag, and the smaller chance counts twice. They are tested
    alone where heights are missing or fewer than about 90 points stand along an edge, from 25 points on.

    Measured on faces without a lay, 150 to 600 of each kind, which leaves .018 to .009 of scatter on a share
    of .95 or of .05: the share of 95 % intervals that hold the exponent, over all directions; of faces below
    .05 in the test of isotropy; and of intervals of the stretch that begin at 1.

    =======================================  =============  ==========  ==========
    faces                                    exponent       isotropy    stretch
    =======================================  =============  ==========  ==========
    free, 32 to 192 points, H .05 to .95     .942 to .967   .02 to .05  .94 to .98
    free, 40 by 80, spacings 2 : 1, H .9     .948           .04         .96
    gaps, 10 and 30 %, points and blocks     .946 to .952   .04 to .07  .94 to .96
    periodic, 64 to 112 points, H .95        .949           .05         .96
    the same, H .05 and .1                   .982           .05         .95
    stretched by 1.2 and 2, free, 80 points  .952 to .958               .96 to .98
    noise, 10 % of the variogram at lag 1    .77            .05         .91
    =======================================  =============  ==========  ==========

    The last column of the stretched faces is the share of intervals that hold the stretch. The exponent of
    a periodic face ends at 0, so that intervals near it hold it more often. Noise lowers the exponent of the
    shortest lags: by .045 along the axes here, where .47 of the intervals hold it. Choose `scales` beyond
    the noise.

    How often the test of isotropy falls below .05 at 64, 128 and 256 points along an edge (40 to 60 faces, 10
    to 15 of the largest): stretch 2, always; stretch 1.2 at H .7, free 1, .93, 1, periodic .85, 1, 1; two
    exponents .4 and .8, always (and beyond a stretch, in at least .65 of them); ridges as rough as the face
    they run over, always, those of .3 of its increments .33, .95, 1, those of .1 never.

    Memory: at 2048 by 2048 points, beyond the heights, 32 bytes a point (free), 17 (gaps) and 218 (periodic).
    A face that is not in memory is read whole.

    References
    ----------
    Davies and Hall (1999), Journal of the Royal Statistical Society B 61; Chan and Wood (2000), Annals of
    Statistics 28; for stretched surfaces: Richard (2018), Journal of Mathematical Imaging and Vision 60.
    """
    import xarray as xr

    with Problems("fractalcontact.dimensions.directions") as problems:
        asked = None if azimuth is None else np.unique(np.mod(problems.numbers("azimuth", azimuth), 180.0))
        faces = read_faces(surface, problems, smallest=SMALLEST, profile=False, taken=_RESULTS)
        window = read_scales(problems, scales, faces)
    started = time.perf_counter()
    periodic = all(faces[0].grid.periodic) and all(face.complete for face in faces)
    rays = [] if periodic else _unique(_rays.rays(asked, faces[0].plane_steps))
    at = (
        (np.arange(_rays.DIRECTIONS) * 180.0 / _rays.DIRECTIONS if asked is None else asked)
        if periodic
        else np.array([ray.azimuth for ray in rays])
    )
    found = [sectored(face, at, window) if periodic else turned(face, rays, window) for face in faces]
    outer = surface.dims[: surface.ndim - 2]
    shape = [surface.sizes[dim] for dim in outer]
    dims = (*outer, "azimuth")
    data: dict[str, Any] = {
        name: (dims, np.reshape([[getattr(e, key) for e in one.estimates] for one in found], (*shape, -1)))
        for name, key in _ALONG.items()
    }
    spacing = faces[0].spacing[1]
    data["topothesy"] = (
        dims,
        np.reshape([[e.topothesy(spacing) for e in one.estimates] for one in found], (*shape, -1)),
    )
    for name, key in _OVERALL.items():
        values = [np.nan if one.isotropy is None else getattr(one.isotropy, key) for one in found]
        data[name] = (outer, np.reshape(values, shape))
    data["run_time"] = time.perf_counter() - started
    coords: dict[str, Any] = dict(leading_coords(surface, outer, taken=data))
    coords |= {"azimuth": at, "increment_lag": spacing}
    result = schema.label(xr.Dataset(data, coords=coords))
    _explain(result, found)
    return stamp(
        result,
        "fractalcontact.dimensions.directions",
        {"surface": surface, "azimuth": azimuth, "scales": window},
        title="Roughness by direction",
        references="Davies and Hall, Fractal analysis of surface roughness by using spatial data, Journal "
        "of the Royal Statistical Society B 61 (1999) 3-37",
    )


_OVERALL = {
    "isotropy_p_value": "p_value",
    "anisotropy_ratio": "stretch",
    "anisotropy_ratio_low": "low",
    "anisotropy_ratio_high": "high",
    "anisotropy_azimuth": "azimuth",
    "anisotropy_p_value": "stretched_p_value",
}
_RESULTS = (*_ALONG, *_OVERALL, "topothesy", "run_time", "azimuth", "increment_lag")


def _unique(rays: Sequence[_rays.Ray]) -> list[_rays.Ray]:
    return sorted(set(rays), key=lambda ray: ray.azimuth)


def _explain(result: xr.Dataset, found: Sequence[Turned]) -> None:
    """Write down why numbers are missing."""
    reasons = list(dict.fromkeys(e.not_given for one in found for e in one.estimates if e.not_given))
    for name in ("standard_error", "ci_low", "ci_high"):
        result[name].attrs["not_given"] = "; ".join(reasons)
    notes = list(dict.fromkeys(e.note for one in found for e in one.estimates if e.note))
    result["hurst"].attrs["reason"] = "; ".join(notes)
    overall = "; ".join(dict.fromkeys(one.note for one in found if one.note))
    for name in _OVERALL:
        result[name].attrs["reason"] = overall
