"""Multifractal analysis: generalised dimensions of a measure, or of a set, from its moments over boxes."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.numbers import float_array
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.domains import _masks, _scaling_fit
from fractalcontact.domains._aligned_boxes import joined_boxes
from fractalcontact.domains._masks import Array

SOURCE = (
    "Hentschel and Procaccia, Physica D 8:435 (1983); Halsey et al., Phys. Rev. A 33:1141 (1986); "
    "Chhabra and Jensen, Phys. Rev. Lett. 62:1327 (1989)"
)


def _check(problems: Problems) -> None:
    problems.numbers("q", at_least=-1e4, at_most=1e4)  # beyond it only the largest box counts
    _masks.check_box_sizes(problems, max(_masks.plane_shape(_masks.check_measure(problems))))


@public_result(title="Generalised dimensions", references=SOURCE, check=_check)
def generalised_dimensions(
    mask: xr.DataArray,
    q: Any = (0.0, 1.0, 2.0, 3.0, 4.0),  # support, entropy, pairs, and two that the largest boxes rule
    *,
    box_sizes: Any = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Generalised (Renyi) dimensions D_q of a set, or of a measure such as the contact pressure.

    With mu the share of the measure in each box of size s, tau(q) is the slope of ln sum(mu^q) over ln s
    and D_q = tau(q) / (q - 1); at q = 1 it is the slope of sum(mu ln mu), the entropy. D_0 is the box
    dimension on one grid, D_1 the information dimension, D_2 the correlation dimension.

    Parameters
    ----------
    mask : DataArray, dims (..., y, x)
        A set: boolean, or integer flags (contact where value > 0), every cell with the same weight. Or a
        measure: finite numbers, none negative.
    q : number or sequence, optional
        Orders of the moment. Negative ones emphasise the emptiest boxes and need a measure that fills its
        boxes well.
    box_sizes : sequence of int, optional
        Edges of the boxes in cells; by default the powers of two up to the geometric mean of the cell and
        the extent (at least to 8). The grid starts at the first cell; boxes cut by the far edges count.
    valid : DataArray of bool, dims (y, x) or those of the mask, optional
        Observed cells. A box of which the share f was observed counts f times, with its measure over f.

    Returns
    -------
    Dataset
        Over the leading dims and `moment_order`: `generalised_dimension`, with `ci_low` and `ci_high`, two
        standard deviations of the local slopes to either side; `mass_exponent` tau(q);
        `singularity_strength` alpha(q) and `singularity_spectrum` f = q alpha - tau (Chhabra and Jensen).
        Over the leading dims: `scale_min`, `scale_max` (cells). All are NaN for an empty plane.

    Raises
    ------
    InvalidInput
        The measure is negative, NaN or infinite, or another argument is not as described.

    Examples
    --------
    A multiplicative cascade of four weights:

    >>> import numpy as np, xarray as xr, fractalcontact as fc
    >>> weights, measure = np.array([[0.1, 0.2], [0.3, 0.4]]), np.ones((1, 1))
    >>> for _ in range(6):
    ...     measure = np.kron(measure, weights)
    >>> result = fc.domains.generalised_dimensions(xr.DataArray(measure, dims=("y", "x")), [0, 2])
    >>> result.generalised_dimension.values.round(4).tolist()
    [2.0, 1.737]
    >>> round(float(-np.log2((weights**2).sum())), 4)  # D_2
    1.737
    """
    orders = float_array(q)
    planes = _masks.read_planes(_masks.support_of(mask), valid=valid)
    field = _masks.measure_of(mask, planes)
    measures = planes.cells.astype(float) if field is None else field
    default = 2 ** np.arange(
        _scaling_fit.default_sizes(planes.grid.shape).max(initial=1).item().bit_length(), dtype=np.int64
    )
    sizes = _masks.read_box_sizes(box_sizes, default)
    fits = [_fit_moments(measure, planes.valid_of(k), orders, sizes) for k, measure in enumerate(measures)]
    has_value = np.array([np.isfinite(fit[0]).any() for fit in fits])
    dimension, half_width, tau, alpha, f = np.moveaxis(np.array(fits), 1, 0)
    variables = {
        "generalised_dimension": planes.variable(dimension, "moment_order"),
        "ci_low": planes.variable(dimension - half_width, "moment_order"),
        "ci_high": planes.variable(dimension + half_width, "moment_order"),
        "mass_exponent": planes.variable(tau, "moment_order"),
        "singularity_strength": planes.variable(alpha, "moment_order"),
        "singularity_spectrum": planes.variable(f, "moment_order"),
        "scale_min": planes.variable(np.where(has_value, sizes.min(), np.nan)),
        "scale_max": planes.variable(np.where(has_value, sizes.max(), np.nan)),
    }
    coords = {"moment_order": ("moment_order", orders)}
    return planes.dataset(variables, coords, notes=_notes(has_value, sizes))


def _fit_moments(measure: Array, valid: Array | None, orders: Array, sizes: Array) -> Array:
    """Return dimension, half-width, tau, alpha and f of one plane, (5, orders)."""
    total = float(np.max(measure))
    if total == 0.0 or sizes.size < 2:
        return np.full((5, orders.size), np.nan)
    masses = joined_boxes(measure / total, sizes, np.add)
    areas = joined_boxes(np.ones(measure.shape), sizes, np.add)
    observed = areas if valid is None else joined_boxes(valid.astype(float), sizes, np.add)
    log_partition, mean_log_mu = np.empty((2, orders.size, sizes.size))
    for place, mass in enumerate(masses):
        occupied = mass > 0
        weight = np.ones(1) if valid is None else (next(observed) / next(areas))[occupied]
        share = mass[occupied]
        log_mu = np.log(share / share.sum() / weight)
        log_partition[:, place], mean_log_mu[:, place] = _moments(log_mu, weight, orders)
    tau, tau_spread = _scaling_fit.fit_line(np.log(sizes), log_partition)
    alpha, alpha_spread = _scaling_fit.fit_line(np.log(sizes), mean_log_mu)  # Chhabra and Jensen (1989)
    is_one = orders == 1.0  # D_1 = alpha(1), the slope of the entropy
    q_less_1 = np.where(is_one, 1.0, orders - 1.0)
    dimension = np.where(is_one, alpha, tau / q_less_1)
    half_width = _scaling_fit.ROUNDING + 2.0 * np.where(is_one, alpha_spread, tau_spread / np.abs(q_less_1))
    return np.stack([dimension, half_width, tau, alpha, orders * alpha - tau])


def _moments(log_mu: Array, weight: Array, orders: Array) -> tuple[Array, Array]:
    """Return ln sum(weight mu^q), and the mean of ln mu with the same weights, for every order.

    The largest exponent is taken out of the sum, so that large orders do not underflow.
    """
    log_partition, mean_log_mu = np.empty((2, orders.size))
    for place, q in enumerate(orders):
        log_terms = q * log_mu
        largest = log_terms.max()
        terms = weight * np.exp(log_terms - largest)
        log_partition[place] = largest + np.log(terms.sum())
        mean_log_mu[place] = (terms * log_mu).sum() / terms.sum()
    return log_partition, mean_log_mu


def _notes(has_value: Array, sizes: Array) -> dict[str, dict[str, str]]:
    interval = "interval of the generalised dimension (two standard deviations of the local slopes)"
    notes = {
        **_scaling_fit.interval_notes(interval),
        **_scaling_fit.window_notes("smallest box of the fit", "largest box of the fit"),
    }
    if not has_value.all():
        reason = "one size of box gives no slope" if sizes.size < 2 else "where the plane is empty"
        notes["generalised_dimension"] = {"comment": f"NaN: {reason} ({int((~has_value).sum())} planes)"}
    return notes
