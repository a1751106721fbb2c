"""The methods of `estimate`: names, descriptions, and what they require of a surface."""

from __future__ import annotations

from dataclasses import dataclass

DEFAULT = "likelihood"
_INCREMENTS = (
    "Chan and Wood, Annals of Statistics 28 (2000) 343-376; Zhu and Stein, Journal of Agricultural, "
    "Biological and Environmental Statistics 7 (2002) 24-44"
)
_CLARKE = "Clarke, Computers and Geosciences 12 (1986) 713-722"


@dataclass(frozen=True)
class Method:
    """Description of a method in one line, sources, whether it accepts gaps, smallest number of points."""

    description: str
    references: str
    gaps: bool = True
    smallest: int = 4


METHODS = {
    "likelihood": Method(
        "the default: maximum likelihood; exact fractional Brownian surfaces (free), power-law spectra with "
        "cut-offs (periodic); 95 % interval",
        "Whittle, Curve and periodogram smoothing, J. R. Stat. Soc. B 19 (1957) 38-63; Sykulski, Olhede, "
        "Guillaumin, Lilly and Early, The debiased Whittle likelihood, Biometrika 106 (2019) 251-266",
    ),
    "increments": Method(
        "closed form in one pass, first or second differences over 1, 2 and 4 spacings; fractional Brownian "
        "surfaces; 95 % interval",
        _INCREMENTS,
    ),
    "spectrum": Method(
        "slope of the radially averaged power spectral density, that of a free surface over the one expected "
        "under its window; squares; interval",
        "Jacobs, Junge and Pastewka, Surface Topography: Metrology and Properties 5 (2017) 013001",
        gaps=False,
    ),
    "variogram": Method(
        "slope of the mean square increment; fractional Brownian surfaces of H below 0.6; no interval",
        "Matheron, Economic Geology 58 (1963) 1246-1266; Marcotte, Computers and Geosciences 22 "
        "(1996) 1175-1186",
    ),
    "madogram": Method(
        "slope of the mean absolute increment; as the variogram, less sensitive to outliers; no interval",
        "Gneiting, Sevcikova and Percival, Statistical Science 27 (2012) 247-277",
    ),
    "second_variogram": Method(
        "slope of the mean square second difference; fractional Brownian surfaces of any H, tilted or not; "
        "no interval",
        _INCREMENTS,
    ),
    "roughness_length": Method(
        "growth of the rms height in windows about their planes, corrected for small windows; fractional "
        "Brownian surfaces; interval",
        "Malinverno, Geophysical Research Letters 17 (1990) 1953-1956",
        smallest=5,
    ),
    "variation": Method(
        "growth of the range of heights over segments of rows and columns; overestimates H by 0.05 "
        "to 0.25 where it is below 0.8; no interval",
        "Dubuc, Quiniou, Roques-Carmes, Tricot and Zucker, Physical Review A 39 (1989) 1500-1512; Hall and "
        "Wood, Biometrika 80 (1993) 246-252",
    ),
    "higuchi": Method(
        "growth of the mean absolute increment of profiles by Higuchi's lengths; interval for profiles",
        "Higuchi, Physica D 31 (1988) 277-283",
    ),
    "detrended_fluctuation": Method(
        "growth of the rms height of profiles about lines in windows (detrended fluctuation analysis), "
        "corrected for small windows; interval for profiles",
        "Peng, Buldyrev, Havlin, Simons, Stanley and Goldberger, Physical Review E 49 (1994) 1685-1689",
    ),
    "divider": Method(
        "slope of the length of profiles walked with dividers in natural scale (compass); gives a dimension "
        "of 1 for flat profiles and 1 / H for steep ones; no interval",
        "Mandelbrot, Science 156 (1967) 636-638; Brown, Geophysical Research Letters 14 (1987) 1095-1098",
    ),
    "cube_counts": Method(
        "slope of the number of cubes that meet the surface, heights scaled to the extent; "
        "overestimates H by 0.05 to 0.4; no interval",
        f"Falconer, Fractal Geometry (1990), ch. 3; {_CLARKE}",
    ),
    "covering": Method(
        "slope of the triangulated area in natural scale; gives a dimension of 2 for flat surfaces, and that "
        "of the surface only where slopes are far above 1; no interval",
        _CLARKE,
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
