"""What every estimator returns, and how exponents outside the range of fractals are reported."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

STRANGE = 3.3  # departure from the model, in standard deviations, beyond which the interval is widened
CONSTANT = "a constant height has no Hurst exponent"
_NOISE = 1e-9  # rounding of a slope
NORMAL = 1.959963984540054  # 97.5 % of the normal distribution


@dataclass(frozen=True)
class Estimate:
    """Hurst exponent of one face by one method.

    Attributes
    ----------
    hurst : float
        As fitted; `limited` brings it into 0 ... 1.
    standard_error, low, high : float
        NaN where they would not be honest; `not_given` then tells why.
    scale_min, scale_max : float
        Window of the fit in m.
    increment : float
        Rms height increment over one x spacing, m.
    noise : float
        Rms height of white noise, m.
    misfit : float
        Departure from the model in standard deviations.
    window, not_given, note : str
        How the window was chosen, why there is no interval, and anything else to know.
    fitted : float
        The exponent before it was limited.
    """

    hurst: float
    standard_error: float = np.nan
    low: float = np.nan
    high: float = np.nan
    scale_min: float = np.nan
    scale_max: float = np.nan
    increment: float = np.nan
    noise: float = np.nan
    misfit: float = np.nan
    window: str = ""
    not_given: str = ""
    note: str = ""
    fitted: float = np.nan

    def limited(self) -> Estimate:
        """Limit the exponent and its interval to 0 ... 1, and say so; no interval if all of it is outside."""
        hurst = float(np.clip(self.hurst, 0.0, 1.0))
        low, high = float(np.clip(self.low, 0.0, 1.0)), float(np.clip(self.high, 0.0, 1.0))
        error, note, not_given = self.standard_error, self.note, self.not_given
        if self.low > 1.0 or self.high < 0.0:
            low = high = error = np.nan
            not_given = f"the fitted exponent, {self.hurst:.3f}, is that of no fractal: choose other scales"
        if self.hurst > 1.0 + _NOISE:
            note = _join(note, f"fitted {self.hurst:.3f}: smoother than a fractal surface, limited to 1")
        elif self.hurst < -_NOISE:
            note = _join(note, f"fitted {self.hurst:.3f}: rougher than a fractal surface, limited to 0")
        return replace(
            self,
            hurst=hurst,
            standard_error=error,
            low=low,
            high=high,
            note=note,
            not_given=not_given,
            fitted=self.hurst,
        )

    def topothesy(self, spacing: float) -> float:
        """Return the lag at which the rms increment equals the lag, in m; NaN at H = 1."""
        if not (self.increment > 0 and self.hurst < 1.0):
            return float("nan")
        # in logarithms: close to H = 1 the power is huge or tiny; a power of two takes the unit out
        part, unit = np.frexp(spacing)
        length = np.log(part) + np.log(self.increment / spacing) / (1.0 - self.hurst)
        within = abs(length) < 690.0 and abs(length + unit * np.log(2.0)) < 690.0
        return float(np.ldexp(np.exp(length), unit)) if within else float("nan")


def normal_interval(hurst: float, error: float) -> tuple[float, float]:
    """Return the 95 % interval of a normal estimate."""
    return hurst - NORMAL * error, hurst + NORMAL * error


def undefined(reason: str) -> Estimate:
    """Return an estimate that does not exist."""
    return Estimate(np.nan, not_given=reason, note=reason)


def plane() -> Estimate:
    """Return the limit that a plane is."""
    reason = "a plane: the limit H = 1, without scatter to make an interval from"
    return Estimate(1.0, not_given=reason, note=reason)


def _join(*parts: str) -> str:
    return "; ".join(part for part in parts if part)
