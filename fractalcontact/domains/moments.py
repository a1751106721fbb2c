"""Generalised dimensions: how unevenly a measure, or a set, is spread over boxes of every size."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.provenance import stamp
from fractalcontact.domains import _covers
from fractalcontact.domains._masks import EXPECTED, Array, Planes, assemble, box_sizes, read_mask

if TYPE_CHECKING:
    import xarray as xr

ORDERS = (0.0, 1.0, 2.0, 3.0, 4.0)
LARGEST = 1e4  # order of a moment: beyond it only the largest box counts
ROUNDING = 1e-14  # no interval is narrower
SOURCE = (
    "Hentschel and Procaccia, Physica D 8:435 (1983); Halsey et al., Phys. Rev. A 33:1141 (1986); "
    "Chhabra and Jensen, Phys. Rev. Lett. 62:1327 (1989)"
)


def generalised_dimensions(
    mask: xr.DataArray,
    q: Any = ORDERS,
    *,
    scales: Any = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Generalised (Renyi) dimensions D_q of a set, or of a measure such as the contact pressure.

    With mu the share of the measure in each box of size s, tau(q) is the slope of ln sum(mu^q) over ln s
    and D_q = tau(q) / (q - 1); at q = 1 it is the slope of sum(mu ln mu), from the entropy and not from a
    limit. D_0 is the box dimension on one grid, D_1 that of information, D_2 that of correlation.

    Parameters
    ----------
    mask : DataArray, dims (..., y, x)
        A set: boolean, or integer flags (contact where value > 0), every cell of which weighs alike. Or a
        measure: finite numbers, none negative.
    q : number or sequence, optional
        Orders of the moment. Negative ones look at the emptiest boxes and need a measure that fills its
        boxes well.
    scales : sequence of int, optional
        Edges of the boxes in cells; by default the powers of two up to the geometric mean of the cell and
        the extent (at least to 8). The grid starts at the first cell; boxes cut by the far edges count.
    valid : DataArray of bool, dims (y, x) or those of the mask, optional
        Cells that were observed. A box of which the share f was observed counts f times, with its measure
        over f: unobserved cells are taken to be as the others of their box.

    Returns
    -------
    Dataset
        Over the leading dims and `moment_order`: `generalised_dimension`, with `ci_low` and `ci_high`, two
        standard deviations of the local slopes to either side; `mass_exponent` tau(q);
        `singularity_strength` alpha(q) and `singularity_spectrum` f = q alpha - tau, from the means that
        the moment itself weighs. Over the leading dims: `scale_min`, `scale_max` (cells). All are NaN for
        an empty plane.

    Raises
    ------
    InvalidInput
        The values are negative, NaN or infinite, dims are not (..., y, x), or a scale is not a whole number
        of cells up to the extent.
    """
    begin = time.perf_counter()
    with Problems("fractalcontact.domains.generalised_dimensions") as problems:
        orders = problems.numbers("q", q, at_least=-LARGEST, at_most=LARGEST)
        planes, measure = _read(mask, valid, problems)
        shape = planes.grid.shape
        default = 2 ** np.arange(
            _covers.default_sizes(shape).max(initial=1).item().bit_length(), dtype=np.int64
        )
        sizes = box_sizes(scales, default, problems, "scales", longest=max(shape))
    fits = [_moments(plane, planes.valid_of(k), orders, sizes) for k, plane in enumerate(measure)]
    known = np.array([np.isfinite(fit[0]).any() for fit in fits])
    dimension, half, exponent, strength, spectrum = np.moveaxis(np.array(fits), 1, 0)
    variables = {
        "generalised_dimension": planes.variable(dimension, "moment_order"),
        "ci_low": planes.variable(dimension - half, "moment_order"),
        "ci_high": planes.variable(dimension + half, "moment_order"),
        "mass_exponent": planes.variable(exponent, "moment_order"),
        "singularity_strength": planes.variable(strength, "moment_order"),
        "singularity_spectrum": planes.variable(spectrum, "moment_order"),
        "scale_min": planes.variable(np.where(known, sizes.min(), np.nan)),
        "scale_max": planes.variable(np.where(known, sizes.max(), np.nan)),
        "run_time": ((), time.perf_counter() - begin),
    }
    dataset = assemble(
        planes, variables, {"moment_order": ("moment_order", orders)}, notes=_notes(known, sizes)
    )
    return stamp(
        dataset,
        "fractalcontact.domains.generalised_dimensions",
        {"mask": mask, "q": orders, "scales": scales, "valid": valid},
        title="Generalised dimensions",
        references=SOURCE,
    )


def _read(mask: Any, valid: Any, problems: Problems) -> tuple[Planes, Array]:
    """Return the planes where the measure is not zero, and the measure, (planes, ny, nx) float64."""
    import xarray as xr

    measure = f"{EXPECTED}; or finite numbers, none negative"
    if not isinstance(mask, xr.DataArray) or mask.dtype.kind not in "biuf":
        problems.add("mask", measure, mask)
        mask = xr.DataArray(np.zeros((1, 1), bool), dims=("y", "x"))
    values = mask.values
    wrong = values.size - int(np.count_nonzero(np.isfinite(values) & (values >= 0)))
    if mask.dtype.kind == "f" and wrong:
        problems.add("mask", measure, f"{wrong} of {values.size} NaN, infinite or negative")
    planes = read_mask(mask > 0, problems, valid=valid)
    numbers = values.reshape(planes.cells.shape) if values.size == planes.cells.size else planes.cells
    # what was not observed is 0 in the cells
    return planes, np.asarray(numbers * planes.cells if mask.dtype.kind == "f" else planes.cells, np.float64)


def _moments(measure: Array, valid: Array | None, orders: Array, sizes: Array) -> Array:
    """Return dimension, half-width, tau, alpha and f of one plane, (5, orders)."""
    total = float(np.max(measure))
    if total == 0.0 or sizes.size < 2:
        return np.full((5, orders.size), np.nan)
    levels = {1: measure / total}
    seen = {1: np.ones(1) if valid is None else valid.astype(float)}
    partition, strength = np.empty((orders.size, sizes.size)), np.empty((orders.size, sizes.size))
    for place, size in enumerate(sizes.tolist()):
        finest = max(known for known in levels if size % known == 0)
        levels[size] = _gather(levels[finest], size // finest)
        held = levels[size] > 0
        share, part = levels[size][held], np.ones(1)
        if valid is not None:
            seen[size] = _gather(seen[finest], size // finest)
            part = (seen[size] / _gather(np.ones(measure.shape), size))[held]
        partition[:, place], strength[:, place] = _weigh(np.log(share / share.sum() / part), part, orders)
    x = np.log(sizes)
    exponent, spread, _ = _covers.line(x, partition)
    alpha, alpha_spread, _ = _covers.line(x, strength)
    middle = orders == 1.0
    below = np.where(middle, 1.0, orders - 1.0)
    dimension = np.where(middle, alpha, exponent / below)
    half = ROUNDING + 2.0 * np.where(middle, alpha_spread, spread / np.abs(below))
    return np.stack([dimension, half, exponent, alpha, orders * alpha - exponent])


def _gather(plane: Array, factor: int) -> Array:
    if factor == 1:
        return plane
    ny, nx = plane.shape
    rows = np.add.reduceat(plane, np.arange(0, ny, factor), axis=0)
    return np.asarray(np.add.reduceat(rows, np.arange(0, nx, factor), axis=1))


def _weigh(logs: Array, part: Array, orders: Array) -> tuple[Array, Array]:
    """Return ln sum(part mu^q), and the mean of ln mu weighed alike, for every order; safe for large ones."""
    partition, strength = np.empty(orders.size), np.empty(orders.size)
    for place, order in enumerate(orders):
        scaled = order * logs
        top = scaled.max()
        weight = part * np.exp(scaled - top)
        partition[place] = top + np.log(weight.sum())
        strength[place] = (weight * logs).sum() / weight.sum()
    return partition, strength


def _notes(known: Array, sizes: Array) -> dict[str, dict[str, str]]:
    interval = "generalised dimension (two standard deviations of the local slopes)"
    notes = {
        "ci_low": {"long_name": f"lower end of the interval of the {interval}"},
        "ci_high": {"long_name": f"upper end of the interval of the {interval}"},
        "scale_min": {"units": "1", "long_name": "smallest box of the fit, in cells"},
        "scale_max": {"units": "1", "long_name": "largest box of the fit, in cells"},
    }
    if not known.all():
        reason = "one size of box gives no slope" if sizes.size < 2 else "where the plane is empty"
        notes["generalised_dimension"] = {"comment": f"NaN: {reason} ({int((~known).sum())} planes)"}
    return notes
