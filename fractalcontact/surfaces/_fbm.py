"""Exact fractional Brownian surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.numbers import Array
from fractalcontact.base.resources import require_memory
from fractalcontact.base.results import public_result
from fractalcontact.base.rng import RNGLike
from fractalcontact.base.schema import HURST_RANGE
from fractalcontact.base.validation import Problems
from fractalcontact.surfaces import _from_array
from fractalcontact.surfaces._circulant import draw, embed, torus_shape

STEIN = (
    "Stein, Fast and exact simulation of fractional Brownian surfaces, "
    "Journal of Computational and Graphical Statistics 11 (2002) 587-599"
)


def _check(problems: Problems) -> None:
    _from_array.check_axes(problems)
    problems.number("hurst", **HURST_RANGE)
    _from_array.check_length(problems, "rms_increment")
    _from_array.check_length(problems, "lag", optional=True)
    _from_array.check_ensemble(problems)


# the torus of the covariance has 3.9 times as many points an edge as the surface; 2.5 times below H = 0.8
@public_result(title="Fractional Brownian surface", references=STEIN, check=_check, memory=70.0)
def fbm(
    shape: int | Sequence[int],
    spacing: float | Sequence[float],
    *,
    hurst: float,
    rms_increment: float,
    lag: float | None = None,
    members: int | None = None,
    rng: RNGLike = None,
) -> xr.DataArray:
    """Return an exact fractional Brownian surface.

    Every increment has mean square E[(z(a) - z(b))^2] = rms_increment^2 (|a - b| / lag)^(2 hurst), in every
    direction and at every distance; the fractal dimension is 3 - hurst. There is no cut-off, and the surface
    is not periodic. It is the reference for estimators of the dimension.

    Parameters
    ----------
    shape : (ny, nx), or int
        Points along each axis, at least 3; one number makes a profile with dim x.
    spacing : float, or (y, x)
        Distance between points in metres.
    hurst : float
        Hurst exponent, 0.01 to 0.99.
    rms_increment : float
        Root mean square height difference in metres of two points `lag` apart.
    lag : float, optional
        In metres; default: the x spacing.
    members : int, optional
        Number of independent surfaces, along a dim `member`. Member i is the same for any number of them.
    rng : None, int, SeedSequence, BitGenerator or Generator
        Random stream (SPEC 7), or `json.loads(surface.attrs["provenance"])["random"]` of an earlier surface.

    Returns
    -------
    DataArray
        `height` with dims ([member,] y, x) in metres; the first point (smallest y and x) has height 0. The
        provenance has the torus, its smallest eigenvalue over the largest, and the clipped fraction.

    Raises
    ------
    InvalidInput
        An argument is out of range, or the torus does not fit into memory.

    Notes
    -----
    Size of the torus and memory: see the documentation, "Theory: surfaces".

    References
    ----------
    Stein (2002), Journal of Computational and Graphical Statistics 11, 587-599.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((256, 256), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1)
    >>> increment = surface.diff("x")
    >>> print(f"{float((increment**2).mean() ** 0.5):.0e} m")
    1e-06 m
    """
    sizes, steps = _from_array.sizes_and_steps(shape, spacing)
    (ny, nx), (dy, dx) = (1, *sizes)[-2:], (1.0, *steps)[-2:]  # a profile has ny = 1 and dy = 1
    torus = torus_shape((ny, nx), (dy, dx), float(hurst))
    # of a long surface it has far more points than `memory` counts; its quadrant is transformed
    require_memory(
        "fractalcontact.surfaces.fbm", 4.0 * torus[0] * torus[1], f"a torus of {torus[0]} x {torus[1]}"
    )
    embedding = embed((ny, nx), (dy, dx), float(hurst))
    lag = dx if lag is None else float(lag)
    lag_over_diagonal = lag / (dx / embedding.step[1])
    scale = float(rms_increment) * (np.sqrt(0.5) * lag_over_diagonal ** -float(hurst))
    clipped = max(embedding.clipped, np.finfo(float).eps)
    entries = {
        "torus": embedding.torus,
        "smallest_eigenvalue": embedding.smallest,
        "clipped_fraction": embedding.clipped,
        "achieved_error": f"{clipped:.1e} of the covariances",
        "parameters": {"lag": lag},
    }

    def draw_heights(stream: np.random.Generator) -> tuple[Array, dict[str, Any]]:
        heights = draw(embedding, stream)
        heights -= heights[0, 0]
        heights *= scale
        return heights.reshape(sizes), entries

    return _from_array.draw_ensemble(draw_heights, steps, members=members, rng=rng)
