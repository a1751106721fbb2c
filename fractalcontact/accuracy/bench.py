"""The bench of the estimators: bias, error over the least possible one, coverage and time of each."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.accuracy import _bounds
from fractalcontact.accuracy._keeping import FAMILIES, SHORTEST, WHERE, Bench, check_name
from fractalcontact.base import rng as streams
from fractalcontact.base.checks import Problems
from fractalcontact.base.netcdf import save
from fractalcontact.base.progress import track

if TYPE_CHECKING:
    import xarray as xr

Array = np.ndarray[Any, np.dtype[Any]]

SPACING, HEIGHT = 1e-4, 1e-6
_BATCH = 1 << 22  # points made at a time
_POINTS = 25600  # members times points along an edge, unless members are given
_LEVEL = 0.95


def estimators(
    hurst: float | Sequence[float] = (0.1, 0.3, 0.5, 0.7, 0.9),
    sizes: int | Sequence[int] = (64, 256, 1024),
    families: str | Sequence[str] = ("fbm", "spectral"),
    methods: str | Sequence[str] | None = None,
    *,
    members: int | Sequence[int] | None = None,
    rng: streams.RNGLike = None,
    keep: str | os.PathLike[str] | None = None,
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
        to 4 spacings. A method is right on one of them and need not be on the other.
    methods : str or sequence of str, optional
        Out of `fractalcontact.dimensions.methods()`. Default: all of them.
    members : int or sequence of int, optional
        Surfaces for each exponent and family, one number or one for each size. Default: 25600 over the size
        (400, 100 and 25), which tells a coverage of 95 % to within 1, 2 and 4 %.
    rng : None, int, SeedSequence, BitGenerator or Generator
        Random stream (SPEC 7); its entropy is kept in the provenance.
    keep : path-like, optional
        NetCDF file that is written anew after every case, so that a run that is stopped loses no more than
        the case at hand: the same call goes on from there. A file that is finished, or of another call, is
        replaced.
    progress : bool
        Show a bar.

    Returns
    -------
    Dataset over (method, family, hurst, size)
        bias, rms_error : of the exponent.
        least_error : the Cramer-Rao bound of the family, over (family, hurst, size).
        error_ratio, error_ratio_low, error_ratio_high : rms error over the bound, with its 95 % interval.
        interval_coverage, interval_coverage_low, interval_coverage_high : share of the 95 % intervals
        that hold the true exponent, with its 95 % interval; NaN for a method that gives none.
        interval_share : share of the surfaces that were given an interval.
        run_time : median of one estimate (s), on the threads of this run.
        member_count : over `size`.

    Raises
    ------
    InvalidInput
        A name is unknown or a number out of range.

    References
    ----------
    The bound of fractional Brownian surfaces is that of Whittle's information, 2 / var(d ln f / dH) over
    the number of points; of a power law it is that of its modes.
    """
    from fractalcontact import dimensions

    known = dimensions.methods()
    with Problems(WHERE) as problems:
        exponents = np.unique(problems.numbers("hurst", hurst, at_least=0.01, at_most=0.99))
        edges = sorted({problems.integer("sizes", n, at_least=16) for n in np.atleast_1d(sizes).tolist()})
        kinds = problems.choices("families", families, FAMILIES)
        names = tuple(known) if methods is None else problems.choices("methods", methods, known)
        problems.require(bool(kinds and names), "families / methods", "at least one of each", "none")
        counts = _counts(problems, members, edges)
        check_name(keep, problems)
    bench = Bench(names, kinds, exponents, edges, counts)
    source = bench.resume(keep, rng)
    entropy = streams.record(source)
    cells = [(k, h, n) for n in range(len(edges)) for k in range(len(kinds)) for h in range(exponents.size)]
    # a stream for each cell, whatever else is asked for in the same run
    streamed = list(zip(cells, source.spawn(len(cells)), strict=True))
    for (k, h, n), stream in track(streamed, progress, "estimators", unit="case"):
        if bench.has(k, h, n):
            continue
        truth, edge = float(exponents[h]), edges[n]
        least = _bound(kinds[k], truth, edge)
        found = _sample(kinds[k], truth, edge, counts[n], names, stream)
        rows = [_judged(truth, least, *(part[:, m] for part in found)) for m in range(len(names))]
        bench.add(k, h, n, least, rows)
        if keep is not None:
            save(bench.table(entropy), keep)
    return bench.table(entropy)


def _counts(problems: Problems, members: Any, edges: Sequence[int]) -> list[int]:
    if members is None:
        return [max(10, _POINTS // edge) for edge in edges]
    given = [problems.integer("members", one, at_least=2) for one in np.atleast_1d(members).tolist()]
    if len(given) not in (1, len(edges)):
        problems.add("members", f"one number, or one for each of the {len(edges)} sizes", members)
    return given if len(given) == len(edges) else given[:1] * len(edges)


def _bound(family: str, hurst: float, n: int) -> float:
    if family == "fbm":
        return _bounds.fractional_brownian(hurst, n)
    return _bounds.band_limited((n, n), SHORTEST, float(n))


def _make(family: str) -> Callable[..., xr.DataArray]:
    from fractalcontact import surfaces

    if family == "fbm":
        return lambda n, h, **more: surfaces.fbm((n, n), SPACING, hurst=h, rms_increment=HEIGHT, **more)
    return lambda n, h, **more: surfaces.spectral(
        (n, n), SPACING, hurst=h, rms_height=10 * HEIGHT, short_cutoff=SHORTEST * SPACING, **more
    )


def _sample(
    family: str, hurst: float, n: int, count: int, names: Sequence[str], stream: np.random.Generator
) -> tuple[Array, Array, Array, Array]:
    """Return exponent, lower end, upper end and seconds: (members, methods) each."""
    from fractalcontact import dimensions

    make = _make(family)
    batch = max(1, min(count, _BATCH // (n * n)))
    parts = []
    for start in range(0, count, batch):
        faces = make(n, hurst, members=min(batch, count - start), rng=stream)
        found = dimensions.estimate(faces, list(names))
        parts.append(np.stack([found[name].values for name in ("hurst", "ci_low", "ci_high", "run_time")]))
    whole = np.concatenate(parts, axis=1)
    return whole[0], whole[1], whole[2], whole[3]


def _judged(
    truth: float, least: float, values: Array, low: Array, high: Array, seconds: Array
) -> dict[str, float]:
    """Return what one method did with the surfaces of one case."""
    from scipy.stats import binomtest, chi2

    judged = {"run_time": float(np.median(seconds))}
    errors = values[np.isfinite(values)] - truth
    if errors.size:
        rms = float(np.sqrt(np.mean(errors**2)))
        # the interval is that of Gaussian errors
        ends = np.sqrt(errors.size / chi2.ppf([0.5 + _LEVEL / 2, 0.5 - _LEVEL / 2], errors.size))
        judged |= {
            "bias": float(errors.mean()),
            "rms_error": rms,
            "error_ratio": rms / least,
            "error_ratio_low": rms / least * float(ends[0]),
            "error_ratio_high": rms / least * float(ends[1]),
        }
    given = np.isfinite(low) & np.isfinite(high)
    judged["interval_share"] = float(given.mean())
    if given.any():
        hits = int(np.count_nonzero((low <= truth) & (truth <= high)))
        interval = binomtest(hits, int(given.sum())).proportion_ci(_LEVEL)
        judged |= {
            "interval_coverage": hits / int(given.sum()),
            "interval_coverage_low": float(interval.low),
            "interval_coverage_high": float(interval.high),
        }
    return judged
