"""Record of one estimate of the Hurst exponent, with its limits to the range of fractals."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from fractalcontact.base.units import quantity_text
from fractalcontact.dimensions._spectral_posterior import Posterior

SIGNIFICANT = 3.3  # |z| beyond which a misfit widens the interval: one in a thousand by chance
CONSTANT = "a constant height has no Hurst exponent"
NORMAL = 1.959963984540054  # 97.5 % quantile of the normal distribution
GRIDDING = 0.035  # largest error of H from the finest scale of a gridded surface on, as measured
_ROUNDING = 1e-9  # rounding of a slope


@dataclass(frozen=True)
class Estimate:
    """Hurst exponent of one surface by one method.

    Attributes
    ----------
    hurst : float
        As fitted; `limited` brings it into 0 ... 1.
    standard_error, ci_low, ci_high : float
        NaN where no validated interval exists; `reason` then states why.
    scale_min, scale_max : float
        Window of the fit, m.
    rms_increment : float
        Rms height increment over one x spacing, m.
    noise_height : float
        Rms height of white noise, m.
    blur_spread : float
        Standard deviation of the point spread function, m.
    misfit : float
        Goodness of fit: z of the change of the exponent with scale.
    window, reason, note : str
        How the window was chosen, why there is no interval, other remarks.
    fitted_hurst : float
        The exponent before it was limited.
    posterior : Posterior, optional
        Distribution of the exponent, of the method "likelihood".
    """

    hurst: float
    standard_error: float = np.nan
    ci_low: float = np.nan
    ci_high: float = np.nan
    scale_min: float = np.nan
    scale_max: float = np.nan
    rms_increment: float = np.nan
    noise_height: float = np.nan
    blur_spread: float = np.nan
    misfit: float = np.nan
    window: str = ""
    reason: str = ""
    note: str = ""
    fitted_hurst: float = np.nan
    posterior: Posterior | None = field(default=None, repr=False, compare=False)

    def without_interval(self, reason: str) -> Estimate:
        """Return the estimate without its standard error and interval."""
        return replace(self, standard_error=np.nan, ci_low=np.nan, ci_high=np.nan, reason=reason)

    def gridding_error(self, finest: float) -> float:
        """Return by how much gridding may have raised the exponent, 0 without a `finest` scale.

        Linear interpolation lowers the power at a wavelength w by a factor of about exp(-5 (d / w)^2), d the
        distance of the points, an eighth of `finest`. A fit of the modes from w on then finds H too high by
        an amount proportional to (d / w)^2; at `finest` 0.02 to 0.034 was measured, for jittered and for
        random points of even and uneven density, H 0.3 to 0.9.
        """
        return GRIDDING * (finest / self.scale_min) ** 2 if self.scale_min > 0 else np.nan

    def gridded(self, finest: float) -> Estimate:
        """Widen the interval by what gridding may have done to the power of the window; not without one."""
        excess = self.gridding_error(finest)
        if not excess > 0.0:  # all points were measured, or nothing was fitted
            return self
        text = (
            f"gridded from points that resolve waves from {quantity_text(finest, 'm')} on, eight point "
            f"distances: H may be too high by {excess:.2g}"
        )
        text += ", which the interval holds" if np.isfinite(self.ci_low) else ""
        return replace(self, ci_low=self.ci_low - excess, note=joined(self.note, text))

    def limited(self) -> Estimate:
        """Limit exponent and interval to 0 ... 1, with a note; no interval if all of it lies outside."""
        if not np.isfinite(self.hurst):
            return replace(self, fitted_hurst=np.nan)
        hurst, low, high = (float(np.clip(h, 0.0, 1.0)) for h in (self.hurst, self.ci_low, self.ci_high))
        limited = replace(self, hurst=hurst, ci_low=low, ci_high=high, fitted_hurst=self.hurst)
        if self.ci_low > 1.0 or self.ci_high < 0.0:
            reason = f"the fitted exponent, {self.hurst:.3f}, is that of no fractal: choose other scales"
            limited = limited.without_interval(reason)
        if -_ROUNDING <= self.hurst <= 1.0 + _ROUNDING:
            return limited
        side = "smoother" if self.hurst > 1.0 else "rougher"
        note = f"fitted {self.hurst:.3f}: {side} than a fractal surface, limited to {hurst:.0f}"
        return replace(limited, note=joined(self.note, note))

    def topothesy(self, spacing: float) -> float:
        """Return the lag in m at which the rms increment equals the lag; NaN at H = 1."""
        if not (self.rms_increment > 0 and self.hurst < 1.0):
            return float("nan")
        # near H = 1 the power over- or underflows: logarithms, with the power of two of the unit split off
        mantissa, exponent = np.frexp(spacing)
        logarithm = np.log(mantissa) + np.log(self.rms_increment / spacing) / (1.0 - self.hurst)
        is_finite = abs(logarithm) < 690.0 and abs(logarithm + exponent * np.log(2.0)) < 690.0
        return float(np.ldexp(np.exp(logarithm), exponent)) if is_finite else float("nan")


def normal_interval(hurst: float, error: float) -> tuple[float, float]:
    """Return the 95 % interval of a normal estimate."""
    return hurst - NORMAL * error, hurst + NORMAL * error


def undefined(reason: str) -> Estimate:
    """Return the record of an estimate that does not exist."""
    return Estimate(np.nan, reason=reason, note=reason)


def plane() -> Estimate:
    """Return the estimate for a plane, the limit H = 1."""
    reason = "a plane: the limit H = 1, without scatter to make an interval from"
    return Estimate(1.0, reason=reason, note=reason)


def smooth() -> Estimate:
    """Return the estimate for a surface without short waves, the limit H = 1."""
    reason = "smoother than a fractal surface: the edges hold most of the power of its waves; the limit H = 1"
    return Estimate(1.0, reason=reason, note=reason)


def joined(*notes: str) -> str:
    """Join the notes that are not empty."""
    return "; ".join(note for note in notes if note)
