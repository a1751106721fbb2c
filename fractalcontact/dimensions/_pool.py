"""One exponent from several scans: their mean by random effects, or one that all have in common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.numbers import Array
from fractalcontact.base.regression import random_effects
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import NONE, Problems, Words
from fractalcontact.dimensions._estimate import estimate
from fractalcontact.dimensions._likelihood import likelihood
from fractalcontact.dimensions._spectral_posterior import joint_interval
from fractalcontact.dimensions._surface_input import read_surfaces

SOURCE = (
    "Paule and Mandel, J. Res. Natl. Bur. Stand. 87 (1982) 377-385; "
    "Hartung and Knapp, Statistics in Medicine 20 (2001) 3875-3889; "
    "Sidik and Jonkman, Statistics in Medicine 21 (2002) 3153-3159"
)
FEWER = "fewer than two scans have an interval"
ESTIMATES = "results of fractalcontact.dimensions.estimate, or one along `scan`"
SURFACES = "surfaces, whose likelihoods are multiplied"
DISAGREE = 1e-3  # probability of chi square from which on scans have no common exponent
NEEDED = ("hurst", "standard_error", "fractal_dimension", "scale_min", "scale_max")


def _check(problems: Problems) -> None:
    given = problems.given
    is_common = problems.choice("model", among=("random", "common")) and given.model == "common"
    expected = SURFACES if is_common else ESTIMATES
    several = _listed(given.scans)
    problems.require(bool(several), "scans", expected, NONE)
    for each in several:
        if not problems.require(_is_one(each, is_common), "scans", expected, Words(type(each).__name__)):
            continue
        if is_common:
            with problems.collect("scans: "):
                estimate.validate(each)
        elif problems.result("scans", each) and isinstance(given.method, str):
            problems.choice("method", among=[str(name) for name in each["method"].values])
    expected = "None (a common exponent is that of the likelihood)" if is_common else "a name"
    is_name = isinstance(given.method, str) and not is_common
    problems.require(given.method is None or is_name, "method", expected)


def _is_one(scan: Any, is_common: bool) -> bool:
    if is_common or not isinstance(scan, xr.Dataset):
        return is_common and isinstance(scan, xr.DataArray)
    return set(NEEDED) <= set(scan.variables) and scan.sizes.get("method", 0) > 0


def _listed(scans: Any) -> list[Any]:
    if isinstance(scans, Mapping) and not isinstance(scans, xr.Dataset):
        return list(scans.values())
    return list(scans) if isinstance(scans, (list, tuple)) else [scans]


@public_result(
    title="Hurst exponent and fractal dimension over several scans",
    references=SOURCE,
    achieved_error="that of the interval",
    check=_check,
    reasons=dict.fromkeys(("between_scans", "within_scans", "heterogeneity"), FEWER),
)
def pool(scans: Any, method: str | None = None, *, model: str = "random") -> xr.Dataset:
    """Pool the exponents of several scans into one with a 95 % interval (meta-analysis, surface twin).

    Each scan is fitted over the scales that it resolves, with an amplitude, a blur and a noise of its own.

    Parameters
    ----------
    scans : Dataset or DataArray, or sequence or mapping of them
        For "random", results of `fractalcontact.dimensions.estimate`: one for each scan, or one over `scan`
        (or any dims), as the group `dimensions` of a study of many scans. For "common", surfaces.
    method : str, optional
        The method to pool, for "random". Default: the first one.
    model : {"random", "common"}
        "random": exponents that scatter from scan to scan, of which the mean is asked (random effects). The
        scatter between scans is separated from the error within each; scans are weighted by their errors as
        far as they agree, and evenly where they scatter more than that. "common": one exponent for all, as of
        one surface at different resolutions, from a joint fit: the product of the likelihoods of all scans.

    Returns
    -------
    Dataset
        `hurst` with `ci_low` and `ci_high`, `fractal_dimension` with `fractal_dimension_low` and `_high`;
        `between_scans` and `within_scans`, standard deviations of the exponent between the scans and of the
        error within each (rms); `heterogeneity`, the share of the former in the sum of squares; `scan_count`;
        `scale_min` and `scale_max` (m), the scales that all fits together span; `reason`, why there is no
        interval: scans that scatter more than one exponent allows have none with "common".

    Raises
    ------
    InvalidInput
        `scans` are not what the model takes, or `method` is not among theirs.

    Notes
    -----
    Scans without an interval of their own are left out. "random": variance between scans by Paule and Mandel;
    interval by Hartung, Knapp, Sidik and Jonkman, whose factor is at least 1. "common": the nuisances of each
    scan are integrated out, the exponent has a flat prior. Both suppose that scans are independent: of one
    area at several resolutions, that their scales overlap little. Three resolutions of one surface (64 x 64
    points each, blur of 0.7 spacings, noise of 5 %), 200 draws each of H 0.3, 0.5 and 0.8: the common
    interval covers 0.945, 0.975 and 0.975 at a median width of 0.16 to 0.18; that of "random" always, at
    0.38 to 0.41. Errors that scans have in common are not averaged out: over 64 scans of 64 x 64 points with
    a blur of 0.7 and noise of 5 % "random" is 0.006 too high; 24 of 24 intervals hold H = 0.7.

    References
    ----------
    Paule and Mandel (1982), J. Res. Natl. Bur. Stand. 87; Hartung and Knapp (2001), Stat. Med. 20; Sidik and
    Jonkman (2002), Stat. Med. 21.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> fine = fc.surfaces.fbm((256, 256), 1e-6, hurst=0.7, rms_increment=1e-7, rng=1)
    >>> twin = [fine[::4, ::4], fine[:64, :64]]
    >>> pooled = fc.dimensions.pool(twin, model="common")
    >>> bool(pooled.ci_low < 0.7 < pooled.ci_high), int(pooled.scan_count)
    (True, 2)
    """
    found = _of_surfaces(_listed(scans)) if model == "common" else _of_results(_listed(scans), method)
    used = np.isfinite(found.hurst) & np.isfinite(found.error)
    hurst, error = found.hurst[used], found.error[used]
    wholes = np.unique(found.whole[used])
    with Problems("fractalcontact.dimensions.pool") as problems:
        problems.require(wholes.size <= 1, "scans", "all of surfaces or of profiles", Words("those of both"))
    whole = float(wholes[0]) if wholes.size else np.nan
    from scipy.special import chdtri

    random = random_effects(hurst, error)
    low, mean, high, reason = random.low, random.mean, random.high, FEWER if not used.any() else ""
    if model == "common" and used.any():
        low, mean, high, _ = joint_interval([found.posteriors[n] for n in np.flatnonzero(used)])
        low -= found.too_high[used].max()
        if float(np.sum(((hurst - mean) / error) ** 2)) > chdtri(hurst.size - 1, DISAGREE):
            low = high = np.nan
            reason = "the scans scatter more than one exponent allows: see the model 'random'"
    low, high = np.clip((low, high), 0.0, 1.0)
    return xr.Dataset(
        {
            "hurst": mean,
            "ci_low": low,
            "ci_high": high,
            "fractal_dimension": whole - mean,
            "fractal_dimension_low": whole - high,
            "fractal_dimension_high": whole - low,
            "between_scans": random.between,
            "within_scans": random.within,
            "heterogeneity": random.heterogeneity,
            "scan_count": random.count,
            "scale_min": found.scale_min[used].min(initial=np.inf) if used.any() else np.nan,
            "scale_max": found.scale_max[used].max(initial=0.0) if used.any() else np.nan,
            "reason": reason,
        }
    )


@dataclass(frozen=True)
class _Scans:
    """Exponents of the scans, their errors, 3 (of profiles 2), the scales of the fits.

    Of surfaces also the distribution of each exponent, and by how much gridding may have raised it.
    """

    hurst: Array
    error: Array
    whole: Array
    scale_min: Array
    scale_max: Array
    posteriors: list[Any]
    too_high: Array


def _of_results(results: list[xr.Dataset], method: str | None) -> _Scans:
    chosen = [each.isel(method=0) if method is None else each.sel({"method": method}) for each in results]

    def values(name: str) -> Array:
        return np.concatenate([np.asarray(each[name].values, dtype=float).ravel() for each in chosen])

    hurst = values("hurst")
    error, whole = values("standard_error"), np.rint(hurst + values("fractal_dimension"))
    return _Scans(hurst, error, whole, values("scale_min"), values("scale_max"), [], np.zeros(0))


def _of_surfaces(surfaces: list[xr.DataArray]) -> _Scans:
    singles = [single.middle() for surface in surfaces for single in read_surfaces(surface)]
    records = [likelihood(single, None, None) for single in singles]
    return _Scans(
        np.array([record.hurst for record in records]),
        np.array([record.standard_error for record in records]),
        np.array([1.0 + single.axes for single in singles]),
        np.array([record.scale_min for record in records]),
        np.array([record.scale_max for record in records]),
        [record.posterior for record in records],
        np.array([r.gridding_error(single.finest_scale) for r, single in zip(records, singles, strict=True)]),
    )
