"""The table of the estimators while it is being filled, and what a stopped run left of it."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base import rng as streams
from fractalcontact.base.checks import Problems
from fractalcontact.base.errors import UnreadableFile
from fractalcontact.base.netcdf import open as read
from fractalcontact.base.provenance import stamp
from fractalcontact.base.schema import label

if TYPE_CHECKING:
    import xarray as xr

Array = np.ndarray[Any, np.dtype[Any]]

WHERE = "fractalcontact.accuracy.estimators"
SHORTEST = 4.0  # spacings: the shortest wave of the band-limited family
FAMILIES = {
    "fbm": "exact fractional Brownian surface",
    "spectral": f"periodic surface, power law from the extent down to {SHORTEST:g} spacings",
}
DIMS = ("method", "family", "hurst", "size")
MEASURED = (
    "bias",
    "rms_error",
    "error_ratio",
    "error_ratio_low",
    "error_ratio_high",
    "interval_coverage",
    "interval_coverage_low",
    "interval_coverage_high",
    "interval_share",
    "run_time",
)
_STOPPED = "the run was stopped before this case"


class Bench:
    """What was measured of every method, over (method, family, hurst, size); NaN where it was not yet."""

    def __init__(
        self,
        methods: Sequence[str],
        families: Sequence[str],
        exponents: Array,
        sizes: Sequence[int],
        members: Sequence[int],
    ) -> None:
        self.coords: dict[str, Any] = {
            "method": list(methods),
            "family": list(families),
            "hurst": exponents,
            "size": list(sizes),
        }
        self.members = np.asarray(members)
        shape = tuple(len(values) for values in self.coords.values())
        self.columns: dict[str, Array] = {name: np.full(shape, np.nan) for name in MEASURED}
        self.least: Array = np.full(shape[1:], np.nan)
        self.started = time.perf_counter()

    def has(self, family: int, hurst: int, size: int) -> bool:
        """Tell whether a case is there."""
        return bool(np.isfinite(self.least[family, hurst, size]))

    def add(self, family: int, hurst: int, size: int, least: float, rows: Sequence[dict[str, float]]) -> None:
        """Put a case in, a row for each method."""
        self.least[family, hurst, size] = least
        for method, row in enumerate(rows):
            for name, value in row.items():
                self.columns[name][method, family, hurst, size] = value

    def table(self, entropy: dict[str, Any]) -> xr.Dataset:
        """Return what there is, labelled."""
        import xarray as xr

        result = label(
            xr.Dataset(
                {name: (DIMS, values) for name, values in self.columns.items()}
                | {"least_error": (DIMS[1:], self.least), "member_count": ("size", self.members)},
                coords=self.coords,
            )
        )
        families = [f"{name}: {FAMILIES[name]}" for name in self.coords["family"]]
        result["family"].attrs["comment"] = "; ".join(families)
        whole = bool(np.isfinite(self.least).all())
        for name in (*MEASURED, "least_error"):
            reasons = [] if whole else [_STOPPED]
            if name.startswith("interval_coverage"):
                reasons.append("the method gives no interval, because it has no honest one")
            elif name in ("bias", "rms_error") or name.startswith("error_ratio"):
                reasons.append("the method gave no exponent")
            if reasons:
                result[name].attrs["reason"] = f"NaN: {', or '.join(reasons)}"
        return stamp(
            result,
            WHERE,
            {"hurst": self.coords["hurst"], "sizes": self.coords["size"],
             "families": self.coords["family"], "methods": self.coords["method"]},
            title="Estimators of the Hurst exponent on surfaces of known exponent",
            references="Whittle, Curve and periodogram smoothing, J. R. Stat. Soc. B 19 (1957) 38-63",
            random=entropy,
            run_time=time.perf_counter() - self.started,
        )  # fmt: skip

    def resume(self, file: str | os.PathLike[str] | None, rng: streams.RNGLike) -> np.random.Generator:
        """Take over the cases of an unfinished file of the same call; return the stream to go on with."""
        kept = self._kept(file)
        if kept is None:
            return streams.generator(rng)
        begun = json.loads(kept.attrs["provenance"])["random"]
        source = streams.generator(begun if rng is None else rng)
        if streams.record(source) != begun:
            return source
        self.columns = {name: kept[name].values.copy() for name in MEASURED}
        self.least = kept["least_error"].values.copy()
        return source

    def _kept(self, file: str | os.PathLike[str] | None) -> xr.Dataset | None:
        """Return the table of a file, if it is one of these cases and not yet whole."""
        if file is None or not Path(file).is_file():
            return None
        try:
            kept = read(file)
            same = all(np.array_equal(kept[name].values, values) for name, values in self.coords.items())
            same = same and np.array_equal(kept["member_count"].values, self.members)
            unfinished = bool(kept["least_error"].isnull().any())
        except (UnreadableFile, KeyError, AttributeError, TypeError):
            return None
        return kept if same and unfinished else None


def check_name(file: Any, problems: Problems) -> None:
    """Check the name of the file, before anything is computed for it."""
    if file is None:
        return
    named = isinstance(file, (str, os.PathLike)) and Path(file).suffix == ".nc"
    problems.require(named, "keep", "a file name that ends in '.nc'", file)
