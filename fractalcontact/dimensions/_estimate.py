"""Hurst exponent and fractal dimension of a surface by any of the methods."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.grid import core_dims, read_grid
from fractalcontact.base.labelled import leading_coords
from fractalcontact.base.numbers import Array
from fractalcontact.base.resources import has_blocks, require_memory
from fractalcontact.base.results import announce_loading, public_result
from fractalcontact.base.study import joined_references
from fractalcontact.base.validation import Problems, word_tuple
from fractalcontact.dimensions._curve import fit
from fractalcontact.dimensions._increments import increments
from fractalcontact.dimensions._likelihood import likelihood
from fractalcontact.dimensions._methods import DEFAULT, METHODS, SYNONYMS
from fractalcontact.dimensions._records import Estimate, joined, undefined
from fractalcontact.dimensions._surface_input import (
    Scales,
    Surface,
    check_scales,
    check_surface,
    read_scales,
    read_surfaces,
)

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
_TEXTS = {"note": "note", "reason": "reason", "window_rule": "window"}  # string variables and their fields
_NAMES = (
    *_FIELDS,
    *_TEXTS,
    *("fractal_dimension", "fractal_dimension_low", "fractal_dimension_high"),
    *("topothesy", "run_time", "method", "increment_lag"),
)
IN_BLOCKS = ("increments", "variogram", DEFAULT)  # methods that read dask arrays block by block
# observed, by axes: intervals of profiles of 8 points and of maps of 3 x 9 were checked to hold (see tests)
FEWEST_POINTS = {1: 8, 2: 25}
ALL_HEIGHTS = 120.0  # bytes for each height of the others


def _check(problems: Problems) -> None:
    given = problems.given
    names = [DEFAULT]
    if given.methods is not None and problems.choices("methods", among=(*SYNONYMS, *METHODS)):
        names = [_row(name) for name in word_tuple(given.methods)]
        problems.require(bool(names), "methods", "at least one name")
    problems.number("noise", at_least=0.0, optional=True)
    is_number = given.psf is not None and problems.number("psf", at_least=0.0)
    is_valid = check_surface(problems, gaps=all(METHODS[name].gaps for name in names), reserved=_NAMES)
    if is_valid and is_number:
        extent = max(read_grid(given.surface, core_dims(given.surface)).extent)
        problems.number("psf", at_most=extent)
    check_scales(problems, is_valid=is_valid)


@public_result(
    title="Hurst exponent and fractal dimension of a surface",
    check=_check,
    in_blocks=True,
    memory=ALL_HEIGHTS,  # of the likelihood, 61 to 102 as measured, 169 beside gaps; others take less
)
def estimate(
    surface: xr.DataArray,
    methods: str | Sequence[str] | None = None,
    *,
    scales: tuple[float, float] | None = None,
    noise: float | None = None,
    psf: float | None = None,
) -> xr.Dataset:
    """Estimate the Hurst exponent and the fractal dimension of a surface, with a 95 % interval.

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., y, x), or (..., x) for a profile; NaN where missing (not for "spectrum").
    methods : str or sequence of str, optional
        Names of `fractalcontact.dimensions.methods()`, "default" ("likelihood"), which is the default, or
        "psd" ("spectrum").
    scales : (low, high), optional
        Lengths in m between which to fit: wavelengths, lags, or edges of windows or cubes. Default: the
        window of the method.
    noise : float, optional
        Rms height in m of the white measurement noise, 0 for none ("likelihood"; beside noise the other
        methods have no interval). By default it is estimated where the heights show it; with `scales`, 0.
    psf : float, optional
        Standard deviation in m of the Gaussian point spread function of the instrument, 0 for none
        ("likelihood" only). By default it is estimated where the heights show a blur; with `scales`, 0.

    Returns
    -------
    Dataset over the leading dims and `method`
        `hurst` (limited to 0 ... 1; `fitted_hurst` is not, but that of "likelihood" lies there, too) with
        `standard_error`, `ci_low` and `ci_high`;
        `fractal_dimension` (3 - hurst, of a profile 2 - hurst) with `fractal_dimension_low` and
        `fractal_dimension_high`; `scale_min`, `scale_max` (m) and `window_rule`, how they were chosen;
        `rms_increment` over `increment_lag` (m), `topothesy` (m), `noise_height`, `blur_spread` (m; NaN
        where not fitted), `misfit` (goodness of fit as z), `run_time` (s); `note`, remarks in words, and
        `reason`, why there is no interval.

    Raises
    ------
    InvalidInput
        Names, scales or axes are wrong, or a surface is entirely NaN.

    Notes
    -----
    Free edges: fractional Brownian heights. Periodic: a power-law spectrum between cut-offs. The interval
    is widened, with a note, where the surface fits neither. Of dask arrays "likelihood" reads at most the
    middle 4096 x 4096 points, "increments" and "variogram" read all in blocks; the others load all, or
    refuse to. Theory: page `theory_dimensions`; measured coverage and limits: page `estimator_accuracy`.
    Select a method with ``sel({"method": "spectrum"})``.

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
    if has_blocks(surface) and set(map(_row, names)) - set(IN_BLOCKS):
        where, size = "fractalcontact.dimensions.estimate", math.prod(surfaces[0].shape)
        needed = f"{size} heights at once; in blocks: {', '.join(IN_BLOCKS)}"
        require_memory(where, ALL_HEIGHTS * size, needed)
        announce_loading(where, {"surface": surface})
    estimates, times = [], np.zeros((len(surfaces), len(names)))
    for row, single in enumerate(surfaces):
        by_likelihood = cache(lambda single=single: _by_likelihood(single, window, noise, psf))
        too_few = _too_few_points(single)
        for column, name in enumerate(names):
            start = time.perf_counter()
            if too_few:
                record = undefined(too_few)
            elif _row(name) == DEFAULT:
                record = by_likelihood()  # "default" and "likelihood" share it
            elif name == "increments":
                record = increments(single, window, noise)
            else:
                record = fit(METHODS[_row(name)], single, window, noise)
            estimates.append(record.gridded(single.finest_scale).limited())
            times[row, column] = time.perf_counter() - start
    return _dataset(surface, surfaces, names, estimates, times)


def _by_likelihood(surface: Surface, window: Scales, noise: float | None, psf: float | None) -> Estimate:
    """Return the estimate of a surface, of one in blocks that of its middle."""
    middle = surface.middle()
    record = likelihood(middle, window, noise, psf)
    if middle is surface:
        return record
    text = f"of the middle {' x '.join(map(str, middle.grid.shape))} points"
    return replace(record, note=joined(text, record.note))


def _too_few_points(surface: Surface) -> str:
    """Return why a surface has too few points for an estimate; "" if it has enough."""
    if surface.is_lazy:
        return ""
    observed, least = int(np.count_nonzero(np.isfinite(surface.raw))), FEWEST_POINTS[surface.axes]
    return f"{observed} observed points, at least {least} are needed" if observed < least else ""


def _row(name: str) -> str:
    return SYNONYMS.get(name, name)


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
    for field in _FIELDS[1:]:
        data[field] = stacked([getattr(record, field) for record in estimates])
    for name, end in (("", "hurst"), ("_low", "ci_high"), ("_high", "ci_low")):
        data[f"fractal_dimension{name}"] = data[end][0], 1.0 + axes - data[end][1]
    for name, field in _TEXTS.items():
        texts = np.array([getattr(record, field) for record in estimates], dtype=str)
        data[name] = (*leading, "method"), texts.reshape(shape)
    data["topothesy"] = stacked([record.topothesy(spacing) for record in estimates])
    data["run_time"] = stacked(times)
    coords = leading_coords(surface, leading, taken=data)
    used = [METHODS[_row(name)].references for name in names]
    references = joined_references(*used)
    coords |= {"method": np.array(names, dtype=str), "increment_lag": spacing}
    return xr.Dataset(data, coords, {"default_method": DEFAULT, "references": references})
