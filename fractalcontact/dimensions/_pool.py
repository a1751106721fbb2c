"""One exponent from several scans: random effects over the estimates of each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.random_effects import random_effects
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import NONE, Problems, Words

SOURCE = (
    "Paule and Mandel, J. Res. Natl. Bur. Stand. 87 (1982) 377-385; "
    "Hartung and Knapp, Statistics in Medicine 20 (2001) 3875-3889; "
    "Sidik and Jonkman, Statistics in Medicine 21 (2002) 3153-3159"
)
FEWER = "fewer than two scans have an interval"
NEEDED = ("hurst", "standard_error", "fractal_dimension", "scale_min", "scale_max")


def _check(problems: Problems) -> None:
    given = problems.given
    several = list(given.estimates.values()) if _is_mapping(given.estimates) else given.estimates
    results = several if isinstance(several, (list, tuple)) else [several]
    expected = "results of fractalcontact.dimensions.estimate, or one along `scan`"
    problems.require(bool(results), "estimates", expected, NONE)
    for each in results:
        is_result = (
            isinstance(each, xr.Dataset)
            and set(NEEDED) <= set(each.variables)
            and each.sizes.get("method", 0) > 0
        )
        got = Words(type(each).__name__)
        if problems.require(is_result, "estimates", expected, got) and isinstance(given.method, str):
            problems.choice("method", among=[str(name) for name in each["method"].values])
    problems.require(given.method is None or isinstance(given.method, str), "method", "a name")


def _is_mapping(estimates: Any) -> bool:
    return isinstance(estimates, Mapping) and not isinstance(estimates, xr.Dataset)


@public_result(
    title="Hurst exponent and fractal dimension over several scans",
    references=SOURCE,
    achieved_error="that of the interval",
    check=_check,
    reasons=dict.fromkeys(("between_scans", "within_scans", "heterogeneity"), FEWER),
)
def pool(estimates: Any, method: str | None = None) -> xr.Dataset:
    """Pool the exponents of several scans into one with a 95 % interval (random-effects meta-analysis).

    Each scan is fitted over the scales that it resolves. The scatter between scans is separated from the
    error within each: scans of one surface at different resolutions (a digital surface twin) are weighted by
    their errors as far as they agree, and evenly where they scatter more than that.

    Parameters
    ----------
    estimates : Dataset, or sequence or mapping of Datasets
        From `fractalcontact.dimensions.estimate`: one for each scan, or one over `scan` (or any dims), as the
        group `dimensions` of a study of many scans.
    method : str, optional
        The method to pool. Default: the first one.

    Returns
    -------
    Dataset
        `hurst` with `ci_low` and `ci_high`, `fractal_dimension` with `fractal_dimension_low` and `_high`;
        `between_scans` and `within_scans`, standard deviations of the exponent between the scans and of the
        error within each (rms); `heterogeneity`, the share of the former in the sum of squares; `scan_count`;
        `scale_min` and `scale_max` (m), the scales that all fits together span.

    Raises
    ------
    InvalidInput
        `estimates` are no results of `estimate`, or `method` is not among theirs.

    Notes
    -----
    Scans without an interval (`reason` states why) are left out. Variance between scans: Paule and Mandel;
    interval: Hartung, Knapp, Sidik and Jonkman, whose factor is at least 1. It supposes that scans are
    independent: of one area at several resolutions, that their scales overlap little.

    References
    ----------
    Paule and Mandel (1982), J. Res. Natl. Bur. Stand. 87; Hartung and Knapp (2001), Stat. Med. 20; Sidik and
    Jonkman (2002), Stat. Med. 21.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> scans = [fc.surfaces.fbm((64, 64), 1e-4, hurst=0.7, rms_increment=1e-6, rng=n) for n in range(4)]
    >>> pooled = fc.dimensions.pool([fc.dimensions.estimate(scan, "increments") for scan in scans])
    >>> bool(pooled.ci_low < 0.7 < pooled.ci_high), int(pooled.scan_count)
    (True, 4)
    """
    several = list(estimates.values()) if _is_mapping(estimates) else estimates
    results = [each if method is None else each.sel({"method": [method]}) for each in _listed(several)]
    first = [each.isel(method=0) for each in results]

    def values(name: str) -> np.ndarray[Any, Any]:
        return np.concatenate([np.asarray(each[name].values, dtype=float).ravel() for each in first])

    hurst, error = values("hurst"), values("standard_error")
    found = random_effects(hurst, error)
    low, high = np.clip((found.low, found.high), 0.0, 1.0)
    used = np.isfinite(hurst) & np.isfinite(error)
    wholes = np.unique(np.rint(hurst + values("fractal_dimension"))[used])  # 3 of surfaces, 2 of profiles
    with Problems("fractalcontact.dimensions.pool") as problems:
        expected = "those of surfaces or of profiles"
        problems.require(wholes.size <= 1, "estimates", expected, Words("those of both"))
    whole = float(wholes[0]) if wholes.size else np.nan
    ends = (values("scale_min")[used], values("scale_max")[used])
    return xr.Dataset(
        {
            "hurst": found.mean,
            "ci_low": low,
            "ci_high": high,
            "fractal_dimension": whole - found.mean,
            "fractal_dimension_low": whole - high,
            "fractal_dimension_high": whole - low,
            "between_scans": found.between,
            "within_scans": found.within,
            "heterogeneity": found.heterogeneity,
            "scan_count": found.count,
            "scale_min": ends[0].min(initial=np.inf) if used.any() else np.nan,
            "scale_max": ends[1].max(initial=0.0) if used.any() else np.nan,
        }
    )


def _listed(estimates: Any) -> list[xr.Dataset]:
    return list(estimates) if isinstance(estimates, (list, tuple)) else [estimates]
