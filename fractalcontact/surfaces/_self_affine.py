"""Closed forms of the self-affine power spectrum: moments, autocorrelation and profile spectrum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fractalcontact.base.numbers import Array
from fractalcontact.base.spectra import Moments
from fractalcontact.base.validation import Problems


@dataclass(frozen=True)
class SelfAffine:
    """Closed forms of the self-affine spectrum with a plateau (Persson 2005; Jacobs et al. 2017).

    C(q) = plateau for 2 pi/long_cutoff <= q < 2 pi/rolloff, then it falls as
    plateau (q rolloff / 2 pi)^(-2 - 2 hurst) up to q = 2 pi/short_cutoff, and nothing outside.

    Attributes
    ----------
    hurst : float
        0 to 1.
    long_cutoff, rolloff, short_cutoff : float
        Wavelengths in metres, long_cutoff >= rolloff >= short_cutoff.
    plateau : float
        C at the roll-off, in m4.

    Raises
    ------
    InvalidInput
        An attribute is out of range, or the wavelengths are in another order.

    References
    ----------
    Jacobs, Junge and Pastewka (2017), Surface Topography: Metrology and Properties 5, 013001.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> spectrum = fc.surfaces.SelfAffine.scaled(0.8, 1e-4, 2e-5, 1e-6, rms_height=1e-6)
    >>> print(f"{spectrum.moments().rms_slope:.3f}")
    0.736
    """

    hurst: float
    long_cutoff: float
    rolloff: float
    short_cutoff: float
    plateau: float = 1.0

    def __post_init__(self) -> None:
        """Check the attributes."""
        with Problems("fractalcontact.surfaces.SelfAffine") as problems:
            problems.number("hurst", self.hurst, at_least=0, at_most=1)
            problems.number("plateau", self.plateau, at_least=0)
            names = ("long_cutoff", "rolloff", "short_cutoff")
            valid = [problems.number(name, getattr(self, name), above=0) for name in names]
            if all(valid):
                lengths = [float(getattr(self, name)) for name in names]
                expected = "long_cutoff >= rolloff >= short_cutoff"
                problems.require(lengths[0] >= lengths[1] >= lengths[2], "wavelengths", expected, lengths)

    @classmethod
    def scaled(
        cls,
        hurst: float,
        long_cutoff: float,
        rolloff: float,
        short_cutoff: float,
        *,
        rms_height: float | None = None,
        rms_slope: float | None = None,
    ) -> SelfAffine:
        """Return the spectrum with this rms height (m), else this rms slope, else a plateau of 1 m4."""
        unit = cls(hurst, long_cutoff, rolloff, short_cutoff)
        with Problems("fractalcontact.surfaces.SelfAffine.scaled") as problems:
            problems.number("rms_height", rms_height, at_least=0, optional=True)
            problems.number("rms_slope", rms_slope, at_least=0, optional=True)
            ends = [float(long_cutoff), float(short_cutoff)]
            problems.require(ends[0] > ends[1], "wavelengths", "long_cutoff > short_cutoff", ends)
        if rms_height is not None:
            plateau = rms_height**2 / unit.moment(0)
        elif rms_slope is not None:
            plateau = rms_slope**2 / unit.moment(2)
        else:
            plateau = 1.0
        return cls(hurst, long_cutoff, rolloff, short_cutoff, plateau)

    def psd(self, q: Array) -> Array:
        """Return C(q) in m4; q in rad m-1."""
        q = np.asarray(q, dtype=np.float64)
        low, corner, high = self._wavenumbers()
        with np.errstate(divide="ignore"):
            tail = (np.maximum(q, corner) / corner) ** (-2.0 - 2.0 * self.hurst)
        return np.where((q >= low) & (q <= high), self.plateau * tail, 0.0)

    def moment(self, order: float) -> float:
        """Return the integral of q^order C(q) q dq / (2 pi)."""
        low, corner, high = self._wavenumbers()
        flat = _power_integral(order + 1.0, low, corner)
        tail = _power_integral(order - 1.0 - 2.0 * self.hurst, corner, high) * corner ** (
            2.0 + 2.0 * self.hurst
        )
        return float(self.plateau * (flat + tail) / (2.0 * np.pi))

    def moments(self) -> Moments:
        """Return the mean squares of height, gradient and Laplacian.

        The result has their roots too, rms_height (m), rms_slope and rms_curvature (m-1, of the mean
        curvature, half the Laplacian), and nayak, the parameter m0 m4 / m2^2.
        """
        return Moments(self.moment(0), self.moment(2), self.moment(4))

    def autocorrelation(self, lag: Array | float) -> Array:
        """Return the mean product of heights about their mean (m2) at distances `lag` (m), any shape.

        The integral of C(q) J0(q lag) q dq / (2 pi), in closed form: Bessel functions over the plateau, and
        the integral of x^(-1 - 2 hurst) J0(x) over the power law.
        """
        from scipy.special import j1

        lag = np.abs(np.asarray(lag, dtype=np.float64))
        low, corner, high = self._wavenumbers()
        # below this lag the result differs from the mean square height by less than rounding
        apart = lag > 1e-9 / high
        r = np.where(apart, lag, 1.0 / high)
        flat = (corner * j1(corner * r) - low * j1(low * r)) / r
        power = -1.0 - 2.0 * self.hurst
        tail = _bessel_integral(power, corner * r) - _bessel_integral(power, high * r)
        sums = flat + tail * r ** (2.0 * self.hurst) * corner ** (2.0 + 2.0 * self.hurst)
        return np.where(apart, self.plateau * sums / (2.0 * np.pi), self.moment(0))

    def profile_psd(self, q: Array | float) -> Array:
        """Return the spectrum of the profiles (m3) at wavenumbers `q` along them (rad m-1), any shape.

        The integral of C over the wavenumber across, over 2 pi; it falls as q^(-1 - 2 hurst). Its integral
        dq / (2 pi) over both signs is the mean square height.
        """
        from scipy.special import beta, betainc

        low, corner, high = self._wavenumbers()
        q = np.abs(np.asarray(q, dtype=np.float64))
        inside = np.minimum(q, high)
        flat = np.sqrt(np.maximum(corner**2 - inside**2, 0.0)) - np.sqrt(np.maximum(low**2 - inside**2, 0.0))
        rise = 2.0 + 2.0 * self.hurst
        # with t = (q / q')^2 the power law is an incomplete beta function
        along = np.maximum(inside, 1e-6 * low)
        ends = [np.minimum((along / edge) ** 2, 1.0) for edge in (corner, high)]
        parts = [betainc(self.hurst + 0.5, 0.5, end) for end in ends]
        tail = 0.5 * beta(self.hurst + 0.5, 0.5) * (parts[0] - parts[1]) * along * (corner / along) ** rise
        return np.asarray(self.plateau / np.pi * (flat + tail) * (q < high))

    def _wavenumbers(self) -> tuple[float, float, float]:
        return tuple(2.0 * np.pi / length for length in (self.long_cutoff, self.rolloff, self.short_cutoff))  # type: ignore[return-value]


def _bessel_integral(power: float, start: Array, near: float = 6.0, far: float = 40.0) -> Array:
    """Return the integral of x^power J0(x) from `start` (above 0) to infinity, power < 1/2.

    Power series up to `near`, quadrature to `far`, asymptotic series beyond. It is exact to 4e-12; with 10
    and 40 to 6e-11, with 6 and 20 to 7e-5 (powers -1.2 to -3, from .01 to 35).
    """
    nodes, weights = np.polynomial.legendre.leggauss(60)  # 40 and 80 change it by 1e-11

    def between(first: Array) -> Array:
        """Return the integral up to `far` by quadrature, over at most three waves."""
        from scipy.special import j0

        half = 0.5 * (far - first)
        x = first[..., None] + half[..., None] * (nodes + 1.0)
        return np.asarray(half * np.sum(weights * x**power * j0(x), axis=-1))

    beyond = _bessel_tail(power, np.maximum(start, far))
    middle = between(np.clip(start, near, far))
    total = beyond + middle
    first = np.minimum(start, near)
    factor = 1.0
    for k in range(40):  # power series of J0, of which 20 terms give the same to rounding
        exponent = power + 2 * k + 1.0
        if abs(exponent) < 1e-12:  # 1e-15 and 1e-9 gave the same bits
            term = np.log(near / first)
        else:
            term = (near**exponent - first**exponent) / exponent
        total = total + factor * term
        factor *= -0.25 / (k + 1) ** 2
    return np.asarray(total)


def _bessel_tail(power: float, start: Array) -> Array:
    """Return the integral to infinity by repeated partial integration, exact to rounding from 40 on."""
    from scipy.special import j0, j1

    total, factor = np.zeros_like(start), 1.0
    for k in range(12):  # 8 terms change it by 1e-10, 16 by 1e-12
        s = 2 * k - power
        total += factor * ((s + 1.0) * start ** (-s - 1.0) * j0(start) - start**-s * j1(start))
        factor *= -((s + 1.0) ** 2)
    return total


def _power_integral(power: float, low: float, high: float) -> float:
    """Return the integral of q^power from low to high, without loss as power nears -1."""
    exponent = power + 1.0
    span = np.log(high / low)
    growth = span if exponent == 0.0 else np.expm1(exponent * span) / exponent
    return float(low**exponent * growth)
