"""A surface with free edges as it is estimated: its heights, their cosine modes, and what is asked for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from fractalcontact.dimensions import _mode_blocks, _whittle
from fractalcontact.dimensions._block_modes import BlockModes
from fractalcontact.dimensions._cosine_modes import (
    Lattice,
    expected_power,
    mode_power,
    wavelengths,
    wavenumber_ratio,
)
from fractalcontact.dimensions._gapped_modes import PROBES, GappedModes
from fractalcontact.dimensions._harmonic_interpolation import Filling
from fractalcontact.dimensions._heterogeneity import seam_cells
from fractalcontact.dimensions._increment_moments import Moments
from fractalcontact.dimensions._increments import closed_form
from fractalcontact.dimensions._mode_blocks import Frame
from fractalcontact.dimensions._restored_power import MOST_MISSING, restored_power
from fractalcontact.dimensions._surface_input import Scales, Surface, between
from fractalcontact.dimensions._unknown_filter import is_filtered_locally

Array = np.ndarray[Any, np.dtype[Any]]

FREE_WINDOW = "all modes that vary along both axes"
LARGE = 1 << 20  # points of a surface beyond which modes are taken in blocks
_LARGE_GAPPED = 1 << 17  # the same of a surface with gaps
_ROUNDING = 1e-26  # relative rounding of the mean square in transforms
_FORM = 0.75  # share of the squared modes in a product x y from which on it is a form, no roughness
_LEVELLED = 0.4  # power of the longest waves along lines over that of shorter ones, if lines were levelled
_ALONG, _ACROSS = 6, 16  # waves along a line that are as strong, and those across them from which on they are
_LEAST_WAVES = 48  # across the lines
_SMALL_GAPS = 0.05  # share of the cells of a gridded surface
_FEW_POINTS = 1 << 13  # points up to which all probes are taken
_SLIGHT = 0.01  # share of missing points for which one probe is enough
_MODERATE = 0.15  # the same for two, and for the error of a surface of fewer points
_SMALL = 1 << 13  # modes up to which the error beside gaps is that of their covariance


@dataclass(frozen=True)
class FreeModes:
    """Cosine modes of a surface with free edges under fractional Brownian heights (a `_whittle.Modes`).

    Attributes
    ----------
    lattice : Lattice
    chosen : ndarray of bool, shape (ny - 1, nx - 1)
        The modes that are fitted.
    power, order, sector : ndarray, shape (modes,)
        Squared mode, wavelength, and whether the wave runs steeper along y than along x.
    gapped : GappedModes, optional
        The effect of missing points; None if there are none.
    """

    lattice: Lattice
    chosen: Array
    power: Array
    order: Array
    sector: Array
    gapped: GappedModes | None = None

    @classmethod
    def of(
        cls,
        heights: Array,
        lattice: Lattice,
        chosen: Array,
        pilot: float,
        power: Array | None = None,
        filling: Filling | None = None,
    ) -> FreeModes:
        """Transform a surface.

        `pilot` is an exponent near its own; `power` are its modes if complete, `filling` that of its gaps,
        if they are at hand.
        """
        observed = np.isfinite(heights)
        order, sector = wavelengths(lattice)[chosen], wavenumber_ratio(lattice)[chosen] > 1.0
        if observed.all():
            power = mode_power(heights) if power is None else power
            return cls(lattice, chosen, power[chosen], order, sector)
        gapped = GappedModes(lattice, observed, pilot, _probes(observed), filling)
        return cls(lattice, chosen, gapped.power(heights)[chosen], order, sector, gapped)

    def scatter(self, fit: _whittle.WhittleFit) -> float:
        """Return z of the flatness; 0 with gaps, whose effect on it is only estimated."""
        if self.gapped is not None:
            return 0.0
        return _whittle.flatness(self.power / fit.total, _whittle.CHI_SQUARE)

    def part(self, chosen: Array) -> FreeModes:
        """Return some of the modes; the effect of slight gaps on so few is below their scatter."""
        of_lattice = np.zeros_like(self.chosen)
        of_lattice[self.chosen] = chosen
        is_slight = self.gapped is not None and self.gapped.missing < _SLIGHT
        return replace(
            self,
            chosen=of_lattice,
            power=self.power[chosen],
            order=self.order[chosen],
            sector=self.sector[chosen],
            gapped=None if is_slight else self.gapped,
        )

    def fit(self, start: float, noise: bool) -> _whittle.WhittleFit:
        """Fit from a pilot estimate; with noise from two starts, of which the better end is returned."""

        def model(hurst: float) -> Array:
            return expected_power(self.lattice, hurst)[self.chosen]

        gaps: _whittle.Excess | None = None
        white = None
        if self.gapped is not None:
            gapped = self.gapped
            gaps = lambda hursts: [part[self.chosen] for part in gapped.excess(*hursts)]  # noqa: E731
            white = gapped.white_excess()[self.chosen] if noise else None
        return _whittle.fit_from_starts(self.power, model, start, noise, gaps=gaps, white_excess=white)

    @property
    def count(self) -> None:
        """None: every mode counts once."""

    @property
    def number(self) -> float:
        """Number of modes."""
        return float(self.power.size)

    def is_uneven(self, inside: Array, hurst: float) -> bool:
        """Return whether few waves of some modes carry more than their share."""
        expected = expected_power(self.lattice, hurst)[self.chosen][inside]
        return _whittle.flatness(self.power[inside] / expected, _whittle.CHI_SQUARE) < -_whittle.UNEVEN

    def error(self, fit: _whittle.WhittleFit) -> float:
        """Return the standard error of H, with the correlation of the modes at edges and gaps.

        Without gaps the full covariance of the modes, on lattices of 24 to 64 points, raises that of
        independent modes by 1 to 3 %, nearly independent of the size. Moderate gaps raise it as the lower
        number of points does, to within 3 %, and the probes by up to 3 %. With large gaps it is estimated by
        the sandwich formula: inverse bread, covariance of the score, inverse bread.
        """
        missing = 0.0 if self.gapped is None else self.gapped.missing
        if self.gapped is None or (missing < _MODERATE and self.chosen.size > _SMALL):
            correlation = 1.01 + 0.02 * float(np.clip(fit.hurst, 0.0, 1.0)) + min(0.03, missing)
            return fit.standard_error * correlation / float(np.sqrt(1.0 - missing))
        reference = self.gapped.reference_power()
        rows = np.zeros((len(fit.columns), *reference.shape))
        rows[:, self.chosen] = fit.columns / fit.total * reference[self.chosen]
        meat = 0.25 * self.gapped.score_covariance(rows, fit.hurst, fit.noise / fit.amplitude)
        bread = np.linalg.inv(fit.bread)
        square = float((bread @ meat @ bread.T)[1, 1])
        return float(np.sqrt(square)) if square > 0 else float("nan")


SurfaceModes = FreeModes | BlockModes


@dataclass(frozen=True)
class FreeEdges:
    """Heights with free edges, and what is asked for.

    Attributes
    ----------
    surface : Surface
    heights : ndarray, shape (ny, nx)
        Without the rows and columns at the border where nothing was observed.
    power : ndarray, optional
        Squared cosine modes of the complete surface; None with gaps, unless they were restored.
    share : ndarray, optional
        Information of each restored mode over that of one of a complete surface; None without gaps.
    filling : Filling, optional
        Interpolation over the gaps, where it is at hand.
    scales, noise
        As in `fractalcontact.dimensions.estimate`.
    spread : float, optional
        That of a known blur, in spacings of x.
    pilot : float
        First estimate of H.
    """

    surface: Surface
    heights: Array
    power: Array | None
    scales: Scales
    noise: bool
    spread: float | None
    pilot: float
    share: Array | None = None
    filling: Filling | None = None

    @property
    def is_default(self) -> bool:
        """Whether nothing is known of the window, the instrument, or the points that were gridded."""
        is_asked = self.scales is not None or self.spread is not None or self.noise
        return not (is_asked or self.surface.finest_scale)

    @cached_property
    def has_seams(self) -> bool:
        """Whether the complete heights have seams, as between tiles that were put together."""
        return bool(self.share is None and self.power is not None and seam_cells(self.heights).any())

    @cached_property
    def is_filtered_locally(self) -> bool:
        """Whether neighbours differ by a distribution of another form than distant heights."""
        return is_filtered_locally(self.heights)

    @property
    def is_large(self) -> bool:
        """Whether the modes beside gaps are taken in blocks."""
        return self.heights.size >= _LARGE_GAPPED

    @cached_property
    def frame(self) -> Frame:
        """Blocks of the modes, with the information that is left beside gaps."""
        frame = _mode_blocks.frame(self.heights.shape, self.surface.plane_spacing)
        return frame if self.share is None else frame.weakened(self.share)

    def restored(self) -> FreeEdges:
        """Return the surface with the power that its modes would have without gaps, if these are few."""
        is_sparse = np.mean(np.isnan(self.heights)) > MOST_MISSING
        if self.power is not None or self.surface.finest_scale or is_sparse:
            return self
        lattice = Lattice.of((self.heights.shape[0], self.heights.shape[1]), self.surface.plane_spacing)
        filling = Filling(np.isfinite(self.heights), lattice.spacing)
        power, share = restored_power(self.heights, lattice, self.pilot, filling)
        return replace(self, power=power, share=share, filling=filling)

    def modes(self) -> SurfaceModes:
        """Return the modes of the window; those of a large surface in blocks."""
        heights, spacing = self.heights, self.surface.plane_spacing
        power = self.power if self.share is None else None
        dx = self.surface.spacing[1]
        window = None if self.scales is None else (self.scales[0] / dx, self.scales[1] / dx)
        if power is not None and heights.size > LARGE:
            return BlockModes.of(power, spacing, window)
        if power is None and self.is_large:
            return BlockModes.of_gapped(heights, spacing, window, self.pilot, self.filling)
        lattice = Lattice.of((heights.shape[0], heights.shape[1]), spacing)
        chosen = between(wavelengths(lattice), window)
        return FreeModes.of(heights, lattice, chosen, self.pilot, power, self.filling)


def _probes(observed: Array) -> int:
    """Return how many probes keep the scatter of the estimate within 3 % of that without them."""
    missing = float(np.mean(~observed))
    if observed.size <= _FEW_POINTS:
        return PROBES
    return 1 if missing < _SLIGHT else 2 if missing < _MODERATE else 4


def without_form(heights: Array, power: Array) -> tuple[Array, Array, str]:
    """Return heights and modes without a product x y, as an oblique cylinder or a saddle has, and a note.

    What depends on x or on y alone is in no mode. `heights` are complete.
    """
    y, x = (np.linspace(-1.0, 1.0, n) for n in heights.shape)
    norm = float((y @ y) * (x @ x))
    level = float(np.einsum("i,ij,j", y, heights, x)) / norm
    share = level**2 * norm / max(float(power.sum()), 1e-300)
    if share < _FORM:
        return heights, power, ""
    flat = heights - level * y[:, None] * x
    note = (
        f"a twist, the product x y, holds {100.0 * share:.0f} % of the mean square height and is removed, as "
        "`surfaces.level` of order 2 does"
    )
    return flat, mode_power(flat), note


def without_levelling(power: Array, spacing: tuple[float, float], hurst: float) -> tuple[Array, str]:
    """Return the modes of a surface whose rows, or columns, were levelled one by one, and a note.

    A line or parabola subtracted from each row takes the longest waves along the rows, and no others. The
    next ones replace them, times the ratio that they have on a surface of the exponent `hurst`.
    """
    for axis, name in ((1, "rows"), (0, "columns")):
        lines = power if axis == 1 else power.T
        if lines.shape[0] < _ACROSS + _LEAST_WAVES or lines.shape[1] <= _ALONG:
            continue
        rows = lines[_ACROSS:, : 3 * _ALONG]
        # over the shorter waves of the same row: each row then counts the same in a steep spectrum
        shorter = rows[:, _ALONG:].mean(axis=1, keepdims=True)
        shares = np.divide(rows[:, :_ALONG], shorter, out=np.ones((len(rows), _ALONG)), where=shorter > 0.0)
        taken = int(np.argmin(shares.mean(axis=0) < _LEVELLED))
        if 0 < taken < _ALONG:
            lattice = Lattice.of((power.shape[0] + 1, power.shape[1] + 1), spacing)
            expected = expected_power(lattice, hurst)
            expected = expected if axis == 1 else expected.T
            lines = lines.copy()
            next_one = lines[:, taken] / expected[:, taken]
            lines[:, :taken] = next_one[:, None] * expected[:, :taken]
            return (lines if axis == 1 else lines.T), f"the {name} were levelled one by one"
    return power, ""


def is_separable(power: Array, heights: Array) -> bool:
    """Return whether no mode that varies along both axes is above rounding."""
    centred = heights - heights.mean()
    return float(power.sum()) <= _ROUNDING * float(np.sum(centred * centred))


def without_offsets(heights: Array) -> Array:
    """Subtract an offset of each row and each column, which the modes are insensitive to."""
    if np.isnan(heights).any():
        return heights
    return np.asarray(heights - heights.mean(axis=0) - heights.mean(axis=1, keepdims=True) + heights.mean())


def first_exponent(moments: Moments, spacing: tuple[float, float]) -> float:
    """Return a first estimate of H."""
    hurst = closed_form(moments, spacing, error=False).hurst
    return float(np.clip(hurst, 0.03, 0.98)) if np.isfinite(hurst) else 0.5


def without_small_gaps(heights: Array, spacing: tuple[float, float], most: float = _SMALL_GAPS) -> Array:
    """Fill the gaps of a gridded surface by harmonic interpolation, unless they are many.

    The model of the gaps has the short waves that gridding has removed; with it one fit in six of surfaces
    of H 0.9 did not converge. Only waves longer than most gaps are used. Nearest heights would meet in steps
    inside a larger hole, whose power falls as that of H = 0.5: with a hole of 3 % of the area they lowered H
    from 0.9 to 0.84.
    """
    observed = np.isfinite(heights)
    if not 0 < np.count_nonzero(~observed) <= most * heights.size:
        return heights
    return Filling(observed, spacing)(heights - heights[observed].mean())


def cropped(heights: Array) -> Array:
    """Remove the rows and columns at the border where nothing was observed."""
    observed = np.isfinite(heights)
    rows, columns = np.flatnonzero(observed.any(axis=1)), np.flatnonzero(observed.any(axis=0))
    return heights[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
