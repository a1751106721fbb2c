"""Benchmark of the estimators of the Hurst exponent: bias, error, coverage and time."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.ndimage import gaussian_filter
from scipy.special import gamma, kv
from scipy.stats import binomtest, chi2

from fractalcontact import dimensions, surfaces
from fractalcontact.accuracy._cramer_rao import band_bound, brownian_bound, rolloff_bound
from fractalcontact.base import rng as streams
from fractalcontact.base.errors import UnreadableFile
from fractalcontact.base.netcdf import open as read
from fractalcontact.base.netcdf import save
from fractalcontact.base.numbers import Array, float_array
from fractalcontact.base.provenance import stamp
from fractalcontact.base.results import public_result
from fractalcontact.base.schema import HURST_RANGE, label
from fractalcontact.base.signals import track
from fractalcontact.base.study import provenance_of
from fractalcontact.base.validation import NONE, Problems, word_tuple

Stream = np.random.Generator

WHERE = "fractalcontact.accuracy.estimators"
TITLE = "Estimators of the Hurst exponent on surfaces of known exponent"
REFERENCES = "Whittle, Curve and periodogram smoothing, J. R. Stat. Soc. B 19 (1957) 38-63"
SHORTEST = 4.0  # spacings: shortest wave of the band-limited family, twice that which the grid can hold
# edge over the wavelength of the corner of the roll-off: the covariance at the extent is then rounding, 1e-21
# (see `matern`); with 4 it would be 6e-11
ROLLOFF = 8.0
SPACING, HEIGHT = 1e-4, 1e-6  # m: no result depends on them

DIMS = ("method", "family", "hurst", "size")
SAME = (*DIMS, "member_count", "blur", "relative_noise", "marks")
MEASURED = (
    "bias",
    "rms_error",
    "error_ratio",
    "error_ratio_low",
    "error_ratio_high",
    "interval_coverage",
    "interval_coverage_low",
    "interval_coverage_high",
    "interval_share",
    "run_time",
)


def _check(problems: Problems) -> None:
    given = problems.given
    for name in ("blur", "relative_noise", "marks"):
        problems.number(name, at_least=0.0)
    problems.boolean("progress")
    problems.numbers("hurst", **HURST_RANGE)
    has_sizes = problems.numbers("sizes", at_least=16, integral=True)
    chosen = problems.choices("families", among=FAMILIES)
    if problems.choices("methods", among=dimensions.methods(), optional=True) and chosen:
        some = bool(word_tuple(given.families)) and (given.methods is None or bool(word_tuple(given.methods)))
        problems.require(some, "families / methods", "at least one of each", NONE)
    has_members = problems.numbers("members", at_least=2, integral=True, optional=True)
    if has_members and has_sizes and given.members is not None:
        counts = float_array(given.members)
        lengths = 1, len(np.unique(given.sizes))
        expected = f"one number, or one for each of the {lengths[1]} sizes"
        problems.require(len(counts) in lengths, "members", expected)
    if given.file is not None:
        named = isinstance(given.file, (str, os.PathLike)) and Path(given.file).suffix == ".nc"
        problems.require(named, "file", "a file name that ends in '.nc'")


@public_result(title=TITLE, references=REFERENCES, check=_check)
def estimators(
    hurst: float | Sequence[float] = (0.1, 0.3, 0.5, 0.7, 0.9),
    sizes: int | Sequence[int] = (64, 256, 1024),
    families: str | Sequence[str] = ("fbm", "spectral"),
    methods: str | Sequence[str] | None = None,
    *,
    members: int | Sequence[int] | None = None,
    blur: float = 0.0,
    relative_noise: float = 0.0,
    marks: float = 0.0,
    rng: streams.RNGLike = None,
    file: str | os.PathLike[str] | None = None,
    progress: bool = False,
) -> xr.Dataset:
    """Measure every estimator of the Hurst exponent on surfaces whose exponent is known.

    Parameters
    ----------
    hurst : float or sequence of float
        Exponents, .01 to .99.
    sizes : int or sequence of int
        Points along an edge, at least 16.
    families : str or sequence of str
        "fbm": exact fractional Brownian surfaces; "spectral": periodic ones, a power law from the extent down
        to 4 spacings; "crop": a free quarter of periodic ones, a power law down to the spacing; "matern":
        exact samples of the Matern covariance, a slow roll-off with a corner at waves of an eighth of the
        edge; "profile": exact fractional Brownian profiles. A method that is right on one of them may be
        wrong on another.
    methods : str or sequence of str, optional
        Out of `fractalcontact.dimensions.methods()`. Default: all of them.
    members : int or sequence of int, optional
        Surfaces for each exponent and family, one number or one for each size. Default: 25600 over the size
        (400, 100 and 25), which gives a coverage of 95 % to within 1, 2 and 4 %.
    blur : float
        Spread, in spacings, of a Gaussian filter of the free surfaces, which goes on beyond their edges.
    relative_noise : float
        Rms height of white noise added to them, over the rms increment before the blur.
    marks : float
        Amplitude of an oblique wave of seven spacings added to them, over the same.
    rng : None, int, SeedSequence, BitGenerator or Generator
        Random stream; its entropy is kept in the provenance.
    file : path-like, optional
        NetCDF file that is written anew after every case. After a stop the same call continues from it. A
        file that is finished, or of another call, is replaced.
    progress : bool
        Show a progress bar.

    Returns
    -------
    Dataset over (method, family, hurst, size)
        bias, rms_error; error_ratio: rms error over the Cramer-Rao bound `least_error`, that of a large
        surface (the exact one is smaller: .91 of it at 64 points and H = .9, .63 at 16), with blur that of
        the modes on which its squared transfer function is above one half; interval_coverage: share of
        the 95 % intervals that hold the true exponent (NaN for a method without intervals), both with their
        95 % interval (_low, _high); interval_share: share of the surfaces with an interval; run_time: median
        of one estimate (s); member_count.

    Raises
    ------
    InvalidInput
        A name is unknown or a number out of range.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> table = fc.accuracy.estimators(0.5, 32, "fbm", "increments", members=20, rng=1)
    >>> print(table["error_ratio"].dims, bool(abs(table["bias"].item()) < 0.05))
    ('method', 'family', 'hurst', 'size') True
    """
    exponents = np.unique(float_array(hurst))
    edges = sorted({int(size) for size in np.atleast_1d(sizes).tolist()})
    kinds = word_tuple(families)
    names = word_tuple(methods) or tuple(dimensions.methods())
    counts = _counts(members, edges, np.atleast_1d(sizes).tolist())
    defects = {"blur": float(blur), "relative_noise": float(relative_noise), "marks": float(marks)}
    table = _empty_table(names, kinds, exponents, edges, counts).assign_coords(defects)
    table, source = _resume(table, file, rng)
    entropy = streams.record(source)
    places = [(k, h, n) for n in range(len(edges)) for k in range(len(kinds)) for h in range(exponents.size)]
    # every case has a stream of its own, by its place in the run
    cases = list(zip(places, source.spawn(len(places)), strict=True))
    for place, stream in track(cases, progress, "estimators", unit="case"):
        if np.isfinite(table["least_error"].values[place]):
            continue
        k, h, n = place
        truth, size = float(exponents[h]), edges[n]
        family = FAMILIES[kinds[k]]
        bound = family.bound(truth, size, defects["blur"])
        samples = _sample(family, truth, size, counts[n], names, defects, stream)
        table["least_error"].values[place] = bound
        for row, sample in enumerate(np.moveaxis(samples, -1, 0)):
            for name, value in _scores(truth, bound, *sample).items():
                table[name].values[(row, *place)] = value
        if file is not None:
            save(_checkpoint(table, entropy), file)
    return _with_reasons(table).assign_attrs(random=entropy)


def _counts(members: int | Sequence[int] | None, edges: Sequence[int], given: Sequence[int]) -> list[int]:
    """Return the surfaces of each edge; `members` are in the order of the sizes as `given`."""
    if members is None:
        return [max(10, 25600 // size) for size in edges]  # coverage to within 1, 2, 4 % at 64, 256, 1024
    counts = [int(count) for count in np.atleast_1d(members).tolist()]
    if len(counts) == 1:
        return counts * len(edges)
    order = list(dict.fromkeys(int(size) for size in given))  # without repetitions
    return [counts[order.index(size)] for size in edges]


def _brownian(axes: int, hurst: float, _: int, wide: int, count: int, stream: Stream) -> xr.DataArray:
    shape = (wide,) * axes
    return surfaces.fbm(shape, SPACING, hurst=hurst, rms_increment=HEIGHT, members=count, rng=stream)


def _crop(hurst: float, n: int, wide: int, count: int, stream: Stream) -> xr.DataArray:
    options: dict[str, Any] = {"hurst": hurst, "members": count, "rng": stream}
    periodic = surfaces.spectral((n + wide,) * 2, SPACING, rms_height=HEIGHT, **options)
    steps = np.diff(periodic.values, axis=-1)
    result = (periodic * (HEIGHT / np.sqrt(np.mean(steps**2)))).isel(y=slice(wide), x=slice(wide))
    return surfaces.from_array(result.values, SPACING)


def _rolled_off(hurst: float, n: int, wide: int, count: int, stream: Stream) -> xr.DataArray:
    return surfaces.from_array(HEIGHT * matern((wide, wide), hurst, n / ROLLOFF, count, stream), SPACING)


def _band(hurst: float, n: int, _: int, count: int, stream: Stream) -> xr.DataArray:
    options: dict[str, Any] = {"hurst": hurst, "members": count, "rng": stream}
    height, cutoff = 10 * HEIGHT, SHORTEST * SPACING
    return surfaces.spectral((n, n), SPACING, rms_height=height, short_cutoff=cutoff, **options)


@dataclass(frozen=True)
class Family:
    """Surfaces of known exponent.

    Attributes
    ----------
    words : str
    make : function
        Of the exponent, points along an edge, and along one with a margin at both ends, the number of
        surfaces, and the random stream.
    bound : function
        The Cramer-Rao bound, of the exponent, points along an edge, and the spread of a blur in spacings.
    is_free : bool
        Not periodic: they can be blurred beyond their edges, and get noise and marks.
    """

    words: str
    make: Callable[[float, int, int, int, Stream], xr.DataArray]
    bound: Callable[[float, int, float], float]
    is_free: bool = True


FAMILIES = {
    "fbm": Family("exact fractional Brownian surface", partial(_brownian, 2), brownian_bound),
    "crop": Family(
        "free part of a periodic surface of twice the edge, power law down to the spacing, no aliases",
        _crop,
        partial(brownian_bound, aliases=False),
    ),
    "matern": Family(
        "exact surface of the Matern covariance, a slow roll-off from an eighth of the edge on",
        _rolled_off,
        lambda hurst, n, blur: rolloff_bound(hurst, n, n / ROLLOFF, blur),
    ),
    "profile": Family(
        "exact fractional Brownian profile", partial(_brownian, 1), partial(brownian_bound, axes=1)
    ),
    "spectral": Family(
        f"periodic surface, power law from the extent down to {SHORTEST:g} spacings",
        _band,
        lambda _, n, __: band_bound((n, n), SHORTEST, float(n)),
        is_free=False,
    ),
}


def _surfaces(
    family: Family, hurst: float, n: int, count: int, defects: dict[str, float], stream: Stream
) -> xr.DataArray:
    """Return surfaces of a family; free ones are made with a margin, blurred, and get noise and marks."""
    if not family.is_free:
        return family.make(hurst, n, n, count, stream)
    margin = int(np.ceil(5.0 * defects["blur"]))  # the Gaussian filter of SciPy ends at 4 spreads
    result = family.make(hurst, n, n + 2 * margin, count, stream)
    if margin:
        spread = (0.0, *[defects["blur"]] * (result.ndim - 1))
        result = result.copy(data=gaussian_filter(result.values, spread))
    result = result.isel({axis: slice(margin, margin + n) for axis in result.dims[1:]})
    if defects["relative_noise"]:
        scatter = stream.standard_normal(result.shape)
        result = result + defects["relative_noise"] * HEIGHT * scatter
    if defects["marks"]:
        azimuth = 0.5  # radian: oblique to both axes
        along = np.cos(azimuth) * result.x + (np.sin(azimuth) * result.y if "y" in result.dims else 0.0)
        waves = np.cos(2.0 * np.pi / 7.0 / SPACING * along).transpose(*result.dims[1:])  # 7 spacings long
        result = result + defects["marks"] * HEIGHT * waves
    return result


def matern(shape: tuple[int, ...], hurst: float, corner: float, count: int, stream: Stream) -> Array:
    """Return `count` surfaces of unit rms increment with the spectrum (q^2 + q_0^2)^(-1 - H).

    `corner` is the wavelength of q_0 in spacings. Exact by circulant embedding: the covariance has fallen to
    rounding at the extent. Dietrich and Newsam (1997), SIAM J. Sci. Comput. 18.
    """
    y, x = (np.minimum(np.arange(2 * n), 2 * n - np.arange(2 * n)) for n in shape)
    lag = 2.0 * np.pi / corner * np.hypot(y[:, None], x)
    covariance = 2.0 ** (hurst - 1.0) * gamma(hurst) * np.ones(lag.shape)
    apart = lag > 0.0
    covariance[apart] = lag[apart] ** hurst * kv(hurst, lag[apart])
    covariance /= 2.0 * (covariance[0, 0] - covariance[0, 1])
    power = np.maximum(np.fft.fft2(covariance).real, 0.0)
    result = np.empty((count, *shape))
    for heights in result:
        embedded = np.fft.ifft2(np.fft.fft2(stream.standard_normal(lag.shape)) * np.sqrt(power)).real
        heights[...] = embedded[: shape[0], : shape[1]]
    return result


def _sample(
    family: Family,
    hurst: float,
    n: int,
    count: int,
    methods: Sequence[str],
    defects: dict[str, float],
    stream: Stream,
) -> Array:
    """Return exponent, lower end, upper end and seconds of every estimate, (4, members, methods)."""
    batch = max(1, min(count, (1 << 22) // (n * n)))  # heights of 32 MB at a time
    parts = []
    for start in range(0, count, batch):
        ensemble = _surfaces(family, hurst, n, min(batch, count - start), defects, stream)
        estimates = dimensions.estimate(ensemble, list(methods))
        parts.append(
            np.stack([estimates[name].values for name in ("hurst", "ci_low", "ci_high", "run_time")])
        )
    return np.concatenate(parts, axis=1)


def _scores(
    truth: float, bound: float, exponents: Array, low: Array, high: Array, seconds: Array, level: float = 0.95
) -> dict[str, float]:
    """Return bias, error, coverage and time of one method on the surfaces of one case.

    `level` is that of the intervals of error and coverage.
    """
    scores = {"run_time": float(np.median(seconds))}
    errors = exponents[np.isfinite(exponents)] - truth
    if errors.size:
        rms = float(np.sqrt(np.mean(errors**2)))
        # the interval is that of Gaussian errors
        ends = np.sqrt(errors.size / chi2.ppf([0.5 + level / 2, 0.5 - level / 2], errors.size))
        scores |= {
            "bias": float(errors.mean()),
            "rms_error": rms,
            "error_ratio": rms / bound,
            "error_ratio_low": rms / bound * float(ends[0]),
            "error_ratio_high": rms / bound * float(ends[1]),
        }
    has_interval = np.isfinite(low) & np.isfinite(high)
    scores["interval_share"] = float(has_interval.mean())
    if has_interval.any():
        hits, count = int(np.count_nonzero((low <= truth) & (truth <= high))), int(has_interval.sum())
        interval = binomtest(hits, count).proportion_ci(level)
        scores |= {
            "interval_coverage": hits / count,
            "interval_coverage_low": float(interval.low),
            "interval_coverage_high": float(interval.high),
        }
    return scores


# ---------------------------------------------------------------------------------------------------------
# The table while it is being filled, and what a stopped run left of it


def _empty_table(
    methods: Sequence[str],
    families: Sequence[str],
    exponents: Array,
    sizes: Sequence[int],
    members: Sequence[int],
) -> xr.Dataset:
    shape = len(methods), len(families), exponents.size, len(sizes)
    coords = {"method": list(methods), "family": list(families), "hurst": exponents, "size": list(sizes)}
    columns = {name: (DIMS, np.full(shape, np.nan)) for name in MEASURED}
    bounds = {"least_error": (DIMS[1:], np.full(shape[1:], np.nan))}
    table = xr.Dataset(columns | bounds | {"member_count": ("size", np.asarray(members))}, coords=coords)
    table["least_error"].attrs["comment"] = "; ".join(f"{name}: {FAMILIES[name].words}" for name in families)
    return table


def _with_reasons(table: xr.Dataset) -> xr.Dataset:
    """State for every variable why values are missing."""
    stopped = bool(table["least_error"].isnull().any())
    for name in (*MEASURED, "least_error"):
        reasons = ["the run was stopped before this case"] if stopped else []
        if name.startswith("interval_coverage"):
            reasons.append("the method gives no interval, because none was validated")
        elif name in ("bias", "rms_error") or name.startswith("error_ratio"):
            reasons.append("the method gave no exponent")
        if reasons:
            table[name].attrs["reason"] = f"NaN: {', or '.join(reasons)}"
    return table


def _checkpoint(table: xr.Dataset, entropy: dict[str, Any]) -> xr.Dataset:
    """Return the table as far as it is filled, labelled, with the random stream to continue with."""
    parameters = {str(name): coordinate.values for name, coordinate in table.coords.items()}
    labelled = label(_with_reasons(table.copy()))
    return stamp(labelled, WHERE, parameters, title=TITLE, references=REFERENCES, random=entropy)


def _resume(
    empty: xr.Dataset, file: str | os.PathLike[str] | None, rng: streams.RNGLike
) -> tuple[xr.Dataset, np.random.Generator]:
    """Return the table of an unfinished file of the same call, or the empty one; and the random stream."""
    unfinished = _unfinished(empty, file)
    if unfinished is None:
        return empty, streams.generator(rng)
    entropy = provenance_of(unfinished)["random"]
    source = streams.generator(entropy if rng is None else rng)
    if streams.record(source) != entropy:
        return empty, source
    values = {
        name: (unfinished[name].dims, unfinished[name].values.copy()) for name in (*MEASURED, "least_error")
    }
    return empty.assign(values), source


def _unfinished(empty: xr.Dataset, file: str | os.PathLike[str] | None) -> xr.Dataset | None:
    """Return the table of a file, if it is one of the same cases and not finished."""
    if file is None or not Path(file).is_file():
        return None
    try:
        table: xr.Dataset = read(file)
        same = all(np.array_equal(table[name].values, empty[name].values) for name in SAME)
        stopped = bool(table["least_error"].isnull().any())
    except (UnreadableFile, KeyError, AttributeError, TypeError):
        return None
    return table if same and stopped else None
