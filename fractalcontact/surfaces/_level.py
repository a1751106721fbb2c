"""Removal of the mean, the mean plane or the mean quadric."""

from __future__ import annotations

import numpy as np
import xarray as xr

from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.regression import detrended
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.surfaces._height_stack import check_stack, height_stack, with_heights

POLYNOMIALS = ("mean", "plane", "quadric")


def _check(problems: Problems) -> None:
    check_stack(problems)
    problems.integer("order", at_least=0, at_most=2)


@public_result(title="Levelled surface", achieved_error="exact to rounding", check=_check, memory=34.0)
def level(surface: xr.DataArray, order: int = 1) -> xr.DataArray:
    """Remove the mean, the mean plane or the mean quadric.

    Parameters
    ----------
    surface : DataArray
        Heights in metres, dims (..., y, x) or (..., x). Missing points (NaN) are left out of the fit and
        stay missing.
    order : {0, 1, 2}
        Total degree of the least-squares polynomial that is removed: mean, plane, quadric.

    Returns
    -------
    DataArray
        `height` like the input, each plane levelled by itself. With order 1 or 2 the axes are no longer
        periodic, because opposite edges no longer match.

    Raises
    ------
    InvalidInput
        The observed points do not determine the polynomial: none, too few, or all on one line.

    Notes
    -----
    The fit uses orthogonal polynomials of the index, scaled heights and a second pass. An offset of 1e9 in
    heights or coordinates then costs no digits beyond those that the input has lost.

    Examples
    --------
    >>> import numpy as np
    >>> import fractalcontact as fc
    >>> tilted = fc.surfaces.from_array(0.1 * np.add.outer(np.arange(5.0), np.arange(6.0)), 1.0)
    >>> levelled = fc.surfaces.level(tilted)
    >>> float(abs(levelled).max()) < 1e-15
    True
    """
    stack = height_stack(surface)
    fits = [detrended(each, int(order)) if np.isfinite(each).any() else (each, False) for each in stack]
    failed = sum(not determined for _, determined in fits)
    if failed:
        where = "" if len(fits) == 1 else f" ({failed} of {len(fits)} planes)"
        expected = f"observed points that fix a {POLYNOMIALS[order]}"
        message = f"surface: expected {expected}, got too few of them{where}"
        raise InvalidInput("fractalcontact.surfaces.level", [message])
    levelled = with_heights(surface, np.stack([residual for residual, _ in fits]))
    if order > 0:
        for dim in {"y", "x"} & set(levelled.coords):
            levelled.coords[dim].attrs.pop("period", None)
    return levelled
