"""The methods of `estimate` in one table: what each measures, over which scales, and what it requires.

A method other than the likelihood and the closed form of increments is a curve over scale whose slope gives
H. A new one is a module with the curve, and a row here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

DEFAULT = "likelihood"
SYNONYMS = {"default": DEFAULT, "psd": "spectrum"}
_CLARKE = "Clarke, Computers and Geosciences 12 (1986) 713-722"


@dataclass(frozen=True)
class Window:
    """Default scales of a fit, for surfaces of at least `points` along their shorter side.

    From `shortest` coarse spacings to `share` of the shorter extent, and to at least `least` spacings;
    `periodic`: for surfaces with a periodic axis only.
    """

    shortest: float
    share: float
    least: float = 0.0
    points: int = 0
    periodic: bool = False

    @property
    def rule(self) -> str:
        """The window in words."""
        ends = [f"1/{1 / self.share:g} of the extent"] if self.share else []
        ends += [f"{self.least:g} spacings"] if self.least else []
        unit = "spacing" if self.shortest == 1 else "spacings"
        first = f"{self.shortest:g} {unit} to " if self.shortest else "up to "
        return first + (f"the larger of {' and '.join(ends)}" if len(ends) > 1 else ends[0])


@dataclass(frozen=True)
class Method:
    """A row of the table.

    Attributes
    ----------
    description, references : str
        One line on what it does and for which surfaces; sources.
    curve : str
        ``module.function`` of this subpackage, imported when it is used: ``curve(surface, window)`` returns a
        `Curve` of the scales in the window.
    slope : tuple of float
        (a, b, c): the slope of the curve in log-log scale is a H + b axes + c.
    windows : tuple of Window
        The first whose number of points the surface has is used.
    expected : str
        ``expected(surface, curve, hurst)``: the curve expected of a surface of exponent H up to a factor,
        where it is not a power law.
    covariance : str
        ``covariance(surface, curve, hurst)``: covariance of the logarithms of the curve, or the reason why
        it is not known. Without it there is no interval.
    gaps : bool
        Whether points may be missing.
    ignores_plane : bool
        Whether the curve does not change when a plane is added.
    natural_scale : bool
        Whether heights count as lengths, as with cubes and dividers: the slope then depends on their unit.
    """

    description: str
    references: str
    curve: str = ""
    slope: tuple[float, float, float] = (1.0, 0.0, 0.0)
    windows: tuple[Window, ...] = ()
    expected: str = ""
    covariance: str = ""
    gaps: bool = True
    ignores_plane: bool = False
    natural_scale: bool = False


def function(place: str) -> Callable[..., Any]:
    """Return a function that a row names; modules are imported when used, so that `methods` stays fast."""
    module, name = place.split(".")
    found: Callable[..., Any] = getattr(import_module(f"fractalcontact.dimensions.{module}"), name)
    return found


# Windows: the short end leaves out what sampling changes (aliases of a spectrum, extremes between the
# points), the long end scales of which the surface holds too few for a mean. Lags end at 4 spacings: longer
# ones add scatter and no information on a fractional Brownian surface (Zhu and Stein 2002). A periodic
# surface has no waves shorter than 2 spacings: its increments grow as lag^H from about 4 on only.
_LAGS = (Window(4, 1 / 16, points=128, periodic=True), Window(0, 0, 4))
_CUBES = (Window(1, 1 / 4, 4),)

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
        "Chan and Wood, Annals of Statistics 28 (2000) 343-376; Zhu and Stein, Journal of Agricultural, "
        "Biological and Environmental Statistics 7 (2002) 24-44",
    ),
    "spectrum": Method(
        "slope of the radially averaged power spectral density, that of a free surface over the one expected "
        "under its window; interval",
        "Jacobs, Junge and Pastewka, Surface Topography: Metrology and Properties 5 (2017) 013001",
        curve="_spectrum.band_curve",
        slope=(-2.0, -1.0, 0.0),
        windows=(Window(4, 1 / 4, points=32), Window(2, 1 / 2)),
        expected="_spectrum.expected_bands",
        covariance="_spectrum.band_covariance",
        gaps=False,
        ignores_plane=True,
    ),
    "variogram": Method(
        "slope of the mean square increment; fractional Brownian surfaces of H below 0.6; no interval",
        "Matheron, Economic Geology 58 (1963) 1246-1266; Marcotte, Computers and Geosciences 22 "
        "(1996) 1175-1186",
        curve="_variogram.variogram_curve",
        slope=(2.0, 0.0, 0.0),
        windows=_LAGS,
    ),
    "madogram": Method(
        "slope of the mean absolute increment (structure function of order one); as the variogram, less "
        "sensitive to outliers; no interval",
        "Gneiting, Sevcikova and Percival, Statistical Science 27 (2012) 247-277",
        curve="_variogram.madogram_curve",
        windows=_LAGS,
    ),
    "roughness_length": Method(
        "growth of the rms height in windows about their planes, corrected for small windows; fractional "
        "Brownian surfaces; interval",
        "Malinverno, Geophysical Research Letters 17 (1990) 1953-1956",
        curve="_roughness_length.roughness_length_curve",
        windows=(Window(8, 1 / 8, points=128), Window(4, 1 / 2)),
        expected="_roughness_length.expected_roughness",
        covariance="_roughness_length.roughness_covariance",
        ignores_plane=True,
    ),
    "variation": Method(
        "growth of the range of heights over segments of rows and columns; overestimates H by 0.05 "
        "to 0.25 where it is below 0.8; no interval",
        "Dubuc, Quiniou, Roques-Carmes, Tricot and Zucker, Physical Review A 39 (1989) 1500-1512; Hall and "
        "Wood, Biometrika 80 (1993) 246-252",
        curve="_variation.variation_curve",
        windows=(Window(8, 1 / 4, points=64), *_CUBES),
    ),
    "higuchi": Method(
        "growth of the mean absolute increment of profiles by Higuchi's lengths; interval for profiles",
        "Higuchi, Physica D 31 (1988) 277-283",
        curve="_profile_lengths.higuchi_curve",
        slope=(1.0, 0.0, -2.0),
        windows=(Window(1, 1 / 16, 4),),
        covariance="_profile_lengths.higuchi_covariance",
    ),
    "detrended_fluctuation": Method(
        "growth of the rms height of profiles about lines in windows (detrended fluctuation analysis), "
        "corrected for small windows; interval for profiles",
        "Peng, Buldyrev, Havlin, Simons, Stanley and Goldberger, Physical Review E 49 (1994) 1685-1689",
        curve="_roughness_length.detrended_fluctuation_curve",
        windows=(Window(8, 1 / 8, points=128), Window(4, 1 / 4)),
        expected="_roughness_length.expected_roughness",
        covariance="_roughness_length.fluctuation_covariance",
        ignores_plane=True,
    ),
    "divider": Method(
        "slope of the length of profiles walked with dividers in natural scale (compass); gives a dimension "
        "of 1 for flat profiles and 1 / H for steep ones; no interval",
        "Mandelbrot, Science 156 (1967) 636-638; Brown, Geophysical Research Letters 14 (1987) 1095-1098",
        curve="_profile_lengths.divider_curve",
        slope=(1.0, 0.0, -1.0),
        windows=(Window(1, 1 / 8, 2),),
        natural_scale=True,
    ),
    "cube_counts": Method(
        "slope of the number of cubes that meet the surface, heights scaled to the extent; "
        "overestimates H by 0.05 to 0.4; no interval",
        f"Falconer, Fractal Geometry (1990), ch. 3; {_CLARKE}",
        curve="_cube_counts.cube_count_curve",
        slope=(1.0, -1.0, -1.0),
        windows=_CUBES,
        natural_scale=True,
    ),
    "covering": Method(
        "slope of the triangulated area in natural scale; gives a dimension of 2 for flat surfaces, and that "
        "of the surface only where slopes are far above 1; no interval",
        _CLARKE,
        curve="_cube_counts.covering_curve",
        slope=(1.0, 0.0, -1.0),
        windows=_CUBES,
        natural_scale=True,
    ),
}


def methods() -> dict[str, str]:
    """Return the methods of `estimate`: name, and one line on what it does and for which surfaces.

    Returns
    -------
    dict
        From name to description; the first is the default. "95 % interval" at the end means that the
        interval holds the true exponent in 95 of 100 surfaces of the family that is named; "interval", that
        it follows from the covariance of the curve, with the coverage on page `estimator_accuracy`.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> [name for name, line in fc.dimensions.methods().items() if line.endswith("95 % interval")]
    ['likelihood', 'increments']
    """
    return {name: method.description for name, method in METHODS.items()}
