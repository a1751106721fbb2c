"""Correlation dimension: how much of a set lies about each of its cells."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.provenance import stamp
from fractalcontact.base.scaling import local_slope
from fractalcontact.domains import _covers, _neighbours
from fractalcontact.domains._masks import assemble, box_sizes, read_mask

if TYPE_CHECKING:
    import xarray as xr

SOURCE = (
    "Grassberger and Procaccia, Physica D 9:189 (1983); Ohser, Math. Operationsforsch. Statist. 14:63 (1983) "
    "(correction for the edge)"
)


def correlation_dimension(
    mask: xr.DataArray,
    *,
    scales: Any = None,
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Correlation dimension of a set of cells, from the pairs of cells at every distance.

    The mean number of cells of the set in a square about one of them grows with the edge s as s^D. Pairs are
    counted by the transform, and each distance is made up for the pairs that the edges of the plane and
    unobserved cells keep out, so that a set that goes on beyond the edge loses nothing there.

    Parameters
    ----------
    mask : DataArray, dims (..., y, x)
        Boolean, or integer flags where contact means value > 0.
    scales : sequence of int, optional
        Edges of the squares in cells; by default the default sizes of `box_dimension`. A cell on the outline
        of a square of an even number of cells counts by its part inside.
    periodic : bool, optional
        Whether pairs reach over the edges; by default what the axes say. True is refused on a free axis.
    valid : DataArray of bool, dims (y, x) or those of the mask, optional
        Cells that were observed; only pairs of them count.

    Returns
    -------
    Dataset
        Over the leading dims of the mask: `correlation_dimension`, the least-squares slope of ln mass over
        ln s, all sizes alike; `ci_low` and `ci_high`, 2.5 standard deviations of the local slopes to either
        side (NaN for two sizes); `scale_min`, `scale_max` (cells); `coverage`; `null_dimension`, the same of
        as many cells thrown at random. Over `box_size` (cells; `box_length` in m) too: `mean_mass`;
        `local_slope`, d ln(mass)/d ln(box_size); `null_mass`.

    Raises
    ------
    InvalidInput
        The mask is not boolean or integer, its dims are not (..., y, x), a scale is not a whole number of
        cells between 1 and the shorter side, or `periodic` is True on a free axis.

    Notes
    -----
    NaN where the set is empty, with the reason in the attributes. Exactly 0 for one cell, 1 for a row or
    column that spans the mask, 2 for a full mask. D_2 of `generalised_dimensions` is the same quantity from
    boxes on one grid. The interval holds the dimension of 98 % of self-similar sets, curves and clusters that
    were placed and turned at random.
    """
    begin = time.perf_counter()
    with Problems("fractalcontact.domains.correlation_dimension") as problems:
        planes = read_mask(mask, problems, valid=valid, periodic=periodic)
        shape = planes.grid.shape
        sizes = box_sizes(scales, _covers.default_sizes(shape), problems, "scales", longest=min(shape))
    # one plane at a time: the transform has the threads
    mass = np.array(
        [
            _neighbours.mean_mass(cells, planes.valid_of(k), planes.grid, sizes)
            for k, cells in enumerate(planes.cells)
        ]
    )
    pairs = zip(planes.occupied, planes.observed, strict=True)
    dust = np.array([_neighbours.null_mass(*pair, sizes) for pair in pairs])
    dimension, half = _neighbours.fit(sizes, mass, 1.0)
    known = np.isfinite(dimension)
    variables = {
        "correlation_dimension": planes.variable(dimension),
        "ci_low": planes.variable(dimension - half),
        "ci_high": planes.variable(dimension + half),
        "scale_min": planes.variable(np.where(known, sizes.min(), np.nan)),
        "scale_max": planes.variable(np.where(known, sizes.max(), np.nan)),
        "coverage": planes.variable(planes.coverage),
        "null_dimension": planes.variable(_neighbours.fit(sizes, dust, 1.0)[0]),
        "mean_mass": planes.variable(mass, "box_size"),
        "local_slope": planes.variable(local_slope(sizes, mass), "box_size"),
        "null_mass": planes.variable(dust, "box_size"),
        "run_time": ((), time.perf_counter() - begin),
    }
    coords = {"box_size": ("box_size", sizes), "box_length": ("box_size", sizes * planes.side)}
    notes = _neighbours.notes("correlation_dimension", known, sizes.size, "square")
    notes["local_slope"] = {"long_name": "local dimension, d ln(mean_mass)/d ln(box_size)"}
    parameters = {"mask": mask, "scales": scales, "periodic": periodic, "valid": valid}
    return stamp(
        assemble(planes, variables, coords, notes=notes),
        "fractalcontact.domains.correlation_dimension",
        parameters,
        title="Correlation dimension",
        references=SOURCE,
    )
