"""Units of length and their conversion to metres."""

from __future__ import annotations

from typing import Any

# units per metre, or metres per unit: whichever is an integer, so that the conversion rounds only once
PER_METRE = {"dm": 1e1, "cm": 1e2, "mm": 1e3, "um": 1e6, "nm": 1e9, "angstrom": 1e10, "pm": 1e12}
METRES = {"m": 1.0, "km": 1e3, "inch": 0.0254}
SPELLINGS = {
    "\u00b5m": "um",  # the micro sign
    "\u03bcm": "um",  # the Greek letter
    "micron": "um",
    "microns": "um",
    "micrometer": "um",
    "micrometre": "um",
    "millimeter": "mm",
    "millimetre": "mm",
    "nanometer": "nm",
    "nanometre": "nm",
    "meter": "m",
    "metre": "m",
    "\u212b": "angstrom",  # the Angstrom sign
    "\u00c5": "angstrom",  # the letter
    "Angstrom": "angstrom",
    "A": "angstrom",
    "in": "inch",
    "inches": "inch",
}
UNITS = (*METRES, *PER_METRE, *SPELLINGS)


def in_metres(values: Any, units: str) -> Any:
    """Convert values from `units`, one of UNITS, to metres."""
    name = SPELLINGS.get(units, units)
    if name in METRES:
        return values if name == "m" else values * METRES[name]
    return values / PER_METRE[name]
