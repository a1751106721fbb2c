"""Exact fractional Brownian surfaces."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.rng import RNGLike
from fractalcontact.surfaces import _arguments, _embedding

if TYPE_CHECKING:
    import xarray as xr

STEIN = (
    "Stein, Fast and exact simulation of fractional Brownian surfaces, "
    "Journal of Computational and Graphical Statistics 11 (2002) 587-599"
)


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
    direction and at every distance inside the surface; the fractal dimension is 3 - hurst. Nothing is cut
    off at long or short wavelengths, and the surface is not periodic.

    Parameters
    ----------
    shape : (ny, nx), or int
        Points along each axis, at least 3; one number makes a profile with dim x.
    spacing : float, or (y, x)
        Distance between points in metres.
    hurst : float
        Hurst exponent, .01 to .99.
    rms_increment : float
        Root mean square height difference in metres of two points `lag` apart.
    lag : float, optional
        In metres; default: the x spacing.
    members : int, optional
        Return this many independent surfaces along a dim `member`. Member i has a random stream of its own
        and does not depend on how many there are.
    rng : None, int, SeedSequence, BitGenerator or Generator
        Random stream (SPEC 7); its record is kept, and `json.loads(surface.attrs["provenance"])["random"]`
        given here makes the same surface again.

    Returns
    -------
    DataArray
        `height` with dims ([member,] y, x) in metres. As in the definition of the process, the first point
        (smallest y and x) has height 0; nothing else is removed. The provenance tells the torus used, its
        smallest eigenvalue over the largest, and the fraction that was below zero by rounding and clipped.

    Raises
    ------
    InvalidInput
        An argument is out of range.

    Notes
    -----
    Intrinsic embedding of Stein (2002): a stationary field on a torus plus a random plane. The torus has
    R times the diagonal plus the extent along each axis, R = 1 up to hurst = .75 and 2 above; for a square
    of n x n points that is 2.42 n or 3.83 n. Memory: about 5 (R = 1) or 9 (R = 2) arrays of n x n numbers.
    A torus side counts the diagonal in spacings of its own axis, so unequal spacings or a slender shape
    cost more; what does not fit into the memory of the machine is refused.

    References
    ----------
    Stein (2002), Fast and exact simulation of fractional Brownian surfaces, Journal of Computational and
    Graphical Statistics 11, 587-599.
    """
    with Problems("fractalcontact.surfaces.fbm") as problems:
        sizes = _arguments.plane_shape(problems, shape)
        steps = _arguments.plane_spacing(problems, spacing, len(sizes))
        exponent = problems.number("hurst", hurst, at_least=0.01, at_most=0.99)
        increment = _arguments.length(problems, "rms_increment", rms_increment)
        distance = steps[-1] if lag is None else _arguments.length(problems, "lag", lag)
        count = None if members is None else problems.integer("members", members, at_least=1)
        plane = (1, *sizes)[-2:]
        plane_steps = (1.0, *steps)[-2:]
        if not problems.found:
            _require_memory(problems, plane, plane_steps, exponent)
    embedding = _embedding.embed((plane[0], plane[1]), (plane_steps[0], plane_steps[1]), exponent)
    lag_over_diagonal = distance / (plane_steps[1] / embedding.step[1])
    scale = increment * (np.sqrt(0.5) * lag_over_diagonal**-exponent)

    def one(stream: np.random.Generator) -> _arguments.Made:
        heights = _embedding.draw(embedding, stream)
        heights -= heights[0, 0]
        heights *= scale
        facts = {
            "torus": embedding.torus,
            "smallest_eigenvalue": embedding.smallest,
            "clipped_fraction": embedding.clipped,
            "achieved_error": f"{max(embedding.clipped, np.finfo(float).eps):.1e} of the covariances",
        }
        return heights.reshape(sizes), facts

    return _arguments.make(
        one,
        rng,
        count,
        steps,
        call="fbm",
        parameters={
            "shape": sizes,
            "spacing": steps,
            "hurst": exponent,
            "rms_increment": increment,
            "lag": distance,
        },
        title="Fractional Brownian surface",
        references=STEIN,
    )


def _require_memory(problems: Problems, shape: Sequence[int], spacing: Sequence[float], hurst: float) -> None:
    """Note a problem where the torus is larger than the machine."""
    present = _memory()
    torus = _embedding.torus_of((shape[0], shape[1]), (spacing[0], spacing[1]), hurst)
    needed = 8.0 * (0.5 * torus[0] * torus[1] + shape[0] * torus[1] + shape[0] * shape[1])
    if needed > present:
        size = f"{torus[0]} x {torus[1]} points, {needed / 2**30:.3g} GiB"
        problems.add("shape / spacing", f"a torus that fits into {present / 2**30:.3g} GiB of memory", size)


def _memory() -> float:
    """Return the bytes of memory of this machine; infinity where it does not tell."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return math.inf
