"""Units: lengths in metres, and numbers beside units with the SI prefix that suits them and few digits."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.base.numbers import Array

# units per metre, or metres per unit: whichever is an integer, so that the conversion rounds only once
PER_METRE = {"dm": 1e1, "cm": 1e2, "mm": 1e3, "um": 1e6, "nm": 1e9, "angstrom": 1e10, "pm": 1e12}
METRES = {"m": 1.0, "km": 1e3, "inch": 0.0254}
_SPELLINGS = {
    # the micro sign, the Greek letter
    "um": ("\u00b5m", "\u03bcm", "micron", "microns", "micrometer", "micrometre"),
    "mm": ("millimeter", "millimetre"),
    "nm": ("nanometer", "nanometre"),
    "m": ("meter", "metre"),
    "angstrom": ("\u212b", "\u00c5", "Angstrom", "A"),  # the Angstrom sign, the letter
    "inch": ("in", "inches"),
}
SPELLINGS = {word: unit for unit, words in _SPELLINGS.items() for word in words}
UNITS = (*METRES, *PER_METRE, *SPELLINGS)
PREFIXES = {
    18: "E", 15: "P", 12: "T", 9: "G", 6: "M", 3: "k", 0: "", -3: "m", -6: "µ", -9: "n", -12: "p", -15: "f"
}  # fmt: skip
ROUNDING = {"m": 1e-15, "degree": 1e-9}  # what is less is the rounding of a result that is zero
PREFIXED = re.compile(r"^(m|N|Pa|J|s|m2|m3|byte)$")
PRESSURE = re.compile(r"^\s*([-+.\deE]+)\s*([kMG]?)(Pa)?\s*$")
LENGTH = re.compile(r"^\s*([-+.\d]+(?:[eE][-+]?\d+)?)\s*(.*?)\s*$")
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def in_metres(values: Any, units: str) -> Any:
    """Convert values from `units`, one of UNITS, to metres."""
    name = SPELLINGS.get(units, units)
    if name in METRES:
        return values if name == "m" else values * METRES[name]
    return values / PER_METRE[name]


@dataclass(frozen=True)
class Scale:
    """A conversion for display: shown value = value / factor, in `unit`."""

    factor: float
    unit: str

    def __call__(self, values: Any) -> Array:
        """Return the values to show."""
        return np.asarray(values, dtype=np.float64) / self.factor

    def label(self, text: str) -> str:
        """Return `text` with the unit after it."""
        return f"{text} ({self.unit})" if self.unit else text

    def text(self, value: Any, digits: int = 3) -> str:
        """Return one value with its unit."""
        shown = float(value) / self.factor
        return f"{number(shown, digits)} {self.unit}".rstrip() if np.isfinite(shown) else "-"


# the units of stiffness in practice: of a joint, for its area, and of a body
STIFFNESSES = {"Pa m-1": Scale(1e9, "MPa/mm"), "N m-1": Scale(1e6, "kN/mm")}


def scale_for(units: str, values: Any) -> Scale:
    """Return the scale for values in `units`: a prefix for those in `PREFIXED`, see also `STIFFNESSES`."""
    if units in ("", "1"):
        return Scale(1.0, "")
    if units == "degree":
        return Scale(1.0, "°")
    if units in STIFFNESSES:
        return STIFFNESSES[units]
    if not PREFIXED.match(units):
        return Scale(1.0, raise_exponents(units))
    power = int(units[-1]) if units[-1].isdigit() else 1
    sizes = np.abs(np.asarray(values, dtype=np.float64))
    largest = float(sizes[np.isfinite(sizes)].max(initial=0.0))
    if largest == 0:
        return Scale(1.0, raise_exponents(units))
    # the largest value is at least .5 of the shown units, .05 m2, .005 m3: 0.2 mm2, not 200 000 um2
    smallest = 0.5 * 0.1 ** (power - 1)
    fitting = [e for e in PREFIXES if largest >= smallest * 10.0 ** (e * power)]
    exponent = max(fitting) if fitting else min(PREFIXES)
    if units == "s":
        exponent = min(exponent, 0)
    return Scale(10.0 ** (exponent * power), PREFIXES[exponent] + raise_exponents(units))


def named_scale(units: str, shown: str) -> Scale | None:
    """Return the scale that shows values in `units` as `shown`, None where it is no multiple of them.

    Examples
    --------
    >>> named_scale("m", "mm"), named_scale("m2", "mm2"), named_scale("1", "%"), named_scale("m", "N")
    (Scale(factor=0.001, unit='mm'), Scale(factor=1e-06, unit='mm²'), Scale(factor=0.01, unit='%'), None)
    >>> named_scale("Pa m-1", "MPa/mm")
    Scale(factor=1000000000.0, unit='MPa/mm')
    """
    if "/" in shown and (quotient := re.fullmatch(r"(\S+) (\S+)-1", units)):
        over, per = map(named_scale, quotient.groups(), shown.split("/", 1))
        return Scale(over.factor / per.factor, f"{over.unit}/{per.unit}") if over and per else None
    if units in ("", "1"):
        return {"": Scale(1.0, ""), "1": Scale(1.0, ""), "%": Scale(0.01, "%")}.get(shown)
    unit, wanted = raise_exponents(units), raise_exponents(shown).replace("u", "µ", int(shown[:1] == "u"))
    if wanted == unit or (units == "degree" and shown == "°"):
        return Scale(1.0, "°" if units == "degree" else unit)
    if (units, shown) == ("degree", "rad"):
        return Scale(180 / np.pi, "rad")
    power = int(units[-1]) if units[-1].isdigit() else 1
    for exponent, prefix in PREFIXES.items():
        if PREFIXED.match(units) and prefix + unit == wanted:
            return Scale(10.0 ** (exponent * power), wanted)
    return None


def raise_exponents(units: str) -> str:
    """Return UDUNITS text with raised exponents: `Pa m-1` becomes `Pa m⁻¹`; `byte` becomes `B`."""
    if units == "byte":
        return "B"
    return re.sub(r"(?<=[A-Za-z])(-?\d+)", lambda match: match.group().translate(SUPERSCRIPT), units)


def without_rounding(values: Any, units: str) -> Array:
    """Return values with zeros for those of `ROUNDING`.

    Examples
    --------
    >>> without_rounding([3e-20, 3e-12, float("nan")], "m")
    array([0.e+00, 3.e-12,    nan])
    """
    values = np.asarray(values, dtype=np.float64)
    return np.where(np.abs(values) < ROUNDING.get(units, 0.0), 0.0, values)


def quantity_text(value: Any, units: str, digits: int = 3) -> str:
    """Return one value with its unit and SI prefix, "-" where there is none.

    Examples
    --------
    >>> quantity_text(1e6, "Pa"), quantity_text(-2.4e-5, "m"), quantity_text(999.9, "N")
    ('1 MPa', '-24 µm', '1 kN')
    """
    value = without_rounding(value, units)
    return scale_for(units, value).text(value, digits)


def span(values: Any, text: Callable[[float], str]) -> str:
    """Return the least and the greatest of some values as text, once where both read alike.

    Examples
    --------
    >>> span([3.0, 1.0, 2.0], lambda value: f"{value:g}"), span([3.0, 3.1], lambda value: f"{value:.0f}")
    ('1 to 3', '3')
    """
    return " to ".join(dict.fromkeys(text(float(end)) for end in (np.min(values), np.max(values))))


def pascals(text: str) -> float | None:
    """Return a pressure in Pa that is written as a number or with its unit; None for other words.

    Examples
    --------
    >>> pascals("30 GPa"), pascals("2e6"), pascals("30 GN")
    (30000000000.0, 2000000.0, None)
    """
    parts = PRESSURE.match(text)
    powers = {prefix: power for power, prefix in PREFIXES.items()}
    try:
        return float(parts[1]) * 10.0 ** powers[parts[2]] if parts else None
    except ValueError:
        return None


def metres(text: str) -> float | None:
    """Return a length in metres that is written as a number or with its unit; None for other words.

    Examples
    --------
    >>> metres("0.3 mm"), metres("2e-6"), metres("1.5e3nm"), metres("30 GPa")
    (0.0003, 2e-06, 1.5e-06, None)
    """
    parts = LENGTH.match(text)
    unit = (parts[2] or "m") if parts else ""
    if not parts or unit not in UNITS:
        return None
    try:
        return float(in_metres(float(parts[1]), unit))
    except ValueError:
        return None


def number(value: float, digits: int = 3) -> str:
    """Return a number with so many digits, without an exponent where it is between 1e-4 and 1e7.

    Examples
    --------
    >>> number(1234567.0), number(-0.0), number(0.12345), number(2.5e-9)
    ('1230000', '0', '0.123', '2.5e-09')
    """
    text = f"{value:.{digits}g}"
    if "e" in text and 1e-4 <= abs(value) < 1e7:  # up to 7 digits are read more easily than a power
        text = f"{float(text):.0f}"
    return "0" if text == "-0" else text


def fixed(value: float, decimals: int, *, sign: bool = False) -> str:
    """Return a number with so many decimals, and zero without a sign.

    Examples
    --------
    >>> fixed(-0.001, 2), fixed(-0.006, 2), fixed(0.02, 1, sign=True), fixed(0.02, 2, sign=True)
    ('0.00', '-0.01', '0.0', '+0.02')
    """
    text = f"{value:+.{decimals}f}" if sign else f"{value:.{decimals}f}"
    return text if text.strip("+-0.") else text.lstrip("+-")


def jrc_text(value: float, decimals: int = 1) -> str:
    """Return a joint roughness coefficient; words for one below its scale.

    Examples
    --------
    >>> jrc_text(11.62), jrc_text(-75.1)
    ('11.6', 'below 0')
    """
    return "below 0" if value < 0 else fixed(value, decimals)
