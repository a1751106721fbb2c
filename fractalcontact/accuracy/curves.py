"""The measured curves that scenes choose from: error and seconds of methods over their knobs, in one file.

The file is made by ``python tests/benchmarks/autotune_curves.py FILE``.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

FILE = Path(__file__).with_name("curves.json")


@dataclass(frozen=True)
class Curve:
    """Error and seconds of one method, knob by knob in the order of growing cost."""

    knob: tuple[float, ...]
    error: tuple[float, ...]
    seconds: tuple[float, ...]

    def at(self, knob: float) -> tuple[float, float]:
        """Return error and seconds at a knob: on straight lines of the logarithms, which go on."""
        place = np.log(knob)
        knots = np.log(self.knob)
        if knots.size == 1:
            return self.error[0], self.seconds[0]
        right = int(np.clip(np.searchsorted(knots, place), 1, knots.size - 1))
        part = (place - knots[right - 1]) / (knots[right] - knots[right - 1])
        told = [
            float(np.exp(np.log(one[right - 1]) + part * (np.log(one[right]) - np.log(one[right - 1]))))
            for one in (self.error, self.seconds)
        ]
        # beyond the last knob no error is promised to be less than what was seen
        return max(told[0], self.error[-1]) if place > knots[-1] else told[0], told[1]


@cache
def shipped() -> Mapping[str, Mapping[str, Curve]]:
    """Return the curves of the package: contest, then method."""
    whole = json.loads(FILE.read_text(encoding="utf-8"))
    return {
        contest: {
            name: Curve(*(tuple(one[key]) for key in ("knob", "error", "seconds")))
            for name, one in found.items()
        }
        for contest, found in whole.items()
    }
