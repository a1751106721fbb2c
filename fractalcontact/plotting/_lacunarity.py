"""Gliding-box lacunarity of a contact domain."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fractalcontact.plotting import _style
from fractalcontact.plotting._box_size_curves import draw_size_curves
from fractalcontact.plotting._inputs import require_dims, result_of
from fractalcontact.plotting._units import shown_in

if TYPE_CHECKING:
    from fractalcontact.plotting._style import AxesArray, Panels
    from fractalcontact.plotting._units import Units


@_style.checked
def lacunarity(
    result: Any,
    *,
    shear: float | None = None,
    normal_force: float | None = None,
    units: Units | None = None,
    axes: Panels | None = None,
) -> AxesArray:
    r"""Draw gliding-box lacunarity against box size, for increasing load and for increasing shear.

    Dashed lines show the random null: randomly placed cells of equal coverage. At most six curves are drawn.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.domains.lacunarity` over (shear, step, box_size), or without shear or step.
    shear : float, optional
        Shear displacement (m) of the panel of increasing load; the nearest one is taken. Default: the
        middle one.
    normal_force : float, optional
        Normal force (N) of the panel of increasing shear; the nearest step is taken. Default: the last step.
    units : mapping of str to str, optional
        Unit of each variable by name, `{"closure": "mm"}` if the data have it. Default: a suitable prefix.
    axes : array of Axes, Figure or SubFigure, optional
        The Axes of the panels, or a figure to make them in. There is one for each of the
        dims that is longer than one. Default: a new figure.

    Returns
    -------
    array of Axes

    Raises
    ------
    InvalidInput
        A variable is missing, or the result has a further dimension.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> import numpy as np
    >>> mask = fc.surfaces.from_array(np.random.default_rng(1).random((32, 32)), 1e-3) > 0.7
    >>> result = fc.domains.lacunarity(mask, box_sizes=[1, 2, 4, 8])
    >>> (ax,) = fc.plotting.lacunarity(result)
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    box size (mm) | lacunarity $\Lambda$
    """
    result = shown_in(result, units, "lacunarity")
    data = result_of(result, "lacunarity", ("lacunarity",), ("shear", "step"))
    require_dims(data, "lacunarity", {"lacunarity": "box_size"})
    return draw_size_curves(data, shear, normal_force, axes, "lacunarity", "null_lacunarity")
