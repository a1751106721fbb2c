"""The methods of `estimate`: names, descriptions, and what they require of a surface."""

from __future__ import annotations

from dataclasses import dataclass

DEFAULT = "likelihood"


@dataclass(frozen=True)
class Method:
    """Description of a method in one line, whether it accepts gaps, and its smallest number of points."""

    description: str
    gaps: bool = True
    smallest: int = 4


METHODS = {
    "likelihood": Method(
        "the default: maximum likelihood; exact fractional Brownian surfaces (free), power-law spectra with "
        "cut-offs (periodic); 95 % interval"
    ),
    "increments": Method(
        "closed form in one pass, first or second differences over 1, 2 and 4 spacings; fractional Brownian "
        "surfaces; 95 % interval"
    ),
    "spectrum": Method(
        "slope of the radially averaged power spectral density; periodic surfaces, too low on rough free "
        "ones; no interval",
        gaps=False,
    ),
    "variogram": Method(
        "slope of the mean square increment; fractional Brownian surfaces of H below 0.6; no interval"
    ),
    "madogram": Method(
        "slope of the mean absolute increment; as the variogram, less sensitive to outliers; no interval"
    ),
    "second_variogram": Method(
        "slope of the mean square second difference; fractional Brownian surfaces of any H, tilted or not; "
        "no interval"
    ),
    "roughness_length": Method(
        "growth of the rms height in windows about their planes, corrected for small windows; fractional "
        "Brownian surfaces; no interval",
        smallest=5,
    ),
    "variation": Method(
        "growth of the range of heights over segments of rows and columns; H too high by 0.05 to 0.25 where "
        "it is below 0.8; no interval"
    ),
    "cube_counts": Method(
        "slope of the number of cubes that meet the surface, heights scaled to the extent; H too high by "
        "0.05 to 0.4; no interval"
    ),
    "covering": Method(
        "slope of the triangulated area in natural scale; 2 for flat surfaces, the dimension only where "
        "slopes are far above 1; no interval"
    ),
}


def methods() -> dict[str, str]:
    """Return the methods of `estimate`: name, and one line on what it does and for which surfaces.

    Returns
    -------
    dict
        From name to description; the first is the default. "95 % interval" at the end means that the
        coverage was validated: the interval holds the true exponent in 95 of 100 surfaces of the family
        that is named.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> [name for name, line in fc.dimensions.methods().items() if line.endswith("95 % interval")]
    ['likelihood', 'increments']
    """
    return {name: method.description for name, method in METHODS.items()}
