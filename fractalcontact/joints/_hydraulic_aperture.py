"""Hydraulic aperture of a joint that is known by a few numbers only."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.numbers import Array
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.joints._criteria import HYDRAULIC_APERTURE, LARGEST_JRC, POSITIVE

BOUNDS: dict[str, dict[str, Any]] = {
    "aperture": POSITIVE,
    "roughness_coefficient": {"above": 0, "at_most": LARGEST_JRC},
    "spread": {"at_least": 0, "at_most": POSITIVE["at_most"]},
    # few spots: the next term of the series of (1 - c)/(1 + c), 2 c^2, is then 13 % of E^3
    "contact_fraction": {"at_least": 0, "at_most": 0.25},
}


def _check(problems: Problems) -> None:
    given = problems.given
    others = {name: getattr(given, name) for name in BOUNDS if name != "aperture"}
    for name, bounds in BOUNDS.items():
        any_shape = isinstance(getattr(given, name), xr.DataArray)
        problems.numbers(name, **bounds, optional=name in others, any_shape=any_shape)
    if problems.choice("model", among=HYDRAULIC_APERTURE):
        for name, value in others.items():
            if name in HYDRAULIC_APERTURE[given.model].needs:
                problems.require(value is not None, name, f"a value for {given.model!r}")
            else:
                problems.require(value is None, name, f"nothing with {given.model!r}")
    if problems.messages:
        return
    arrays = [_labelled(value) for value in (given.aperture, *others.values()) if value is not None]
    lengths = {array.size for array in arrays if array.dims == ("point",)}
    if problems.require(len(lengths) < 2, "aperture", "arrays of one shape, or numbers", sorted(lengths)):
        spread = given.spread if given.model == "zimmerman_bodvarsson" else 0.0
        variation = float((_labelled(spread) / _labelled(given.aperture)).max())
        # the next term of the series of s/E, 1.9 (s/E)^4, is then 12 % of E^3
        is_small = variation <= 0.5
        problems.require(is_small, "spread", "at most 0.5 of the aperture", f"{variation:.3g} of it")


@public_result(
    title="hydraulic aperture of a joint",
    references=(
        "Barton, Bandis and Bakhtar (1985), Int. J. Rock Mech. Min. Sci. 22:121; Renshaw (1995), J. Geophys. "
        "Res. 100:24629; Zimmerman and Bodvarsson (1996), Transp. Porous Media 23:1; Walsh (1981), Int. J. "
        "Rock Mech. Min. Sci. 18:429"
    ),
    achieved_error="that of the relation, see page theory_joints",
    check=_check,
)
def hydraulic_aperture(
    aperture: float | Sequence[float] | Array | xr.DataArray,
    *,
    model: str = "barton_bandis",
    roughness_coefficient: float | None = None,
    spread: float | Sequence[float] | Array | xr.DataArray | None = None,
    contact_fraction: float | Sequence[float] | Array | xr.DataArray | None = None,
) -> xr.Dataset:
    """Return the hydraulic aperture e of a joint from its mechanical aperture E by a published relation.

    For a joint that is known by a few numbers only. Where the gap is known cell by cell, solve the flow:
    `transmissivity`.

    Parameters
    ----------
    aperture : float, sequence of float or DataArray
        Mean mechanical aperture E, m; of "zimmerman_bodvarsson" and "lognormal" that of the open part.
    model : {"barton_bandis", "lognormal", "zimmerman_bodvarsson", "walsh"}
        e = E^2/JRC^2.5 in micrometres, at most E (Barton, Bandis and Bakhtar 1985);
        e = E/sqrt(1 + s^2/E^2), exact in the mean for lognormal apertures (Renshaw 1995);
        e^3 = E^3 (1 - 1.5 s^2/E^2)(1 - 2 c) (Zimmerman and Bodvarsson 1996);
        e^3 = E^3 (1 - c)/(1 + c), plates with few round spots of contact (Walsh 1981).
    roughness_coefficient : float, optional
        Joint roughness coefficient JRC, above 0 to 20; for "barton_bandis" alone.
    spread : float, sequence of float or DataArray, optional
        Standard deviation s of the aperture of the open part, m; for "lognormal" and "zimmerman_bodvarsson".
    contact_fraction : float, sequence of float or DataArray, optional
        Share c of the area in contact, for "zimmerman_bodvarsson" and "walsh".

    Returns
    -------
    Dataset
        hydraulic_aperture, m, and transmissivity, its cube over 12, m3; over the dims of the arguments, or
        `point` of a sequence. Also the aperture.

    Raises
    ------
    InvalidInput
        An argument is outside its bounds, does not belong to the model or is missing. Bounds: c up to 0.25
        in both models that take it; s up to E/2 for "zimmerman_bodvarsson", a series, the next term of which
        is then about 12 % of E^3.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> result = fc.joints.hydraulic_aperture([200e-6, 500e-6], roughness_coefficient=10)
    >>> (result.hydraulic_aperture * 1e6).values.round(1).tolist()  # alike from 10^2.5 = 316 micrometres on
    [126.5, 500.0]
    """
    given = {
        "roughness_coefficient": roughness_coefficient,
        "spread": spread,
        "contact_fraction": contact_fraction,
    }
    mechanical = _labelled(aperture)
    formula, needs = HYDRAULIC_APERTURE[model]
    hydraulic = formula(mechanical, *(_labelled(given[name]) for name in needs))
    return xr.Dataset(
        {
            "aperture": mechanical,
            "hydraulic_aperture": hydraulic.drop_attrs(),
            "transmissivity": hydraulic.drop_attrs() ** 3 / 12.0,
        }
    )


def _labelled(value: Any) -> xr.DataArray:
    """Return a number, a sequence over `point`, or labelled numbers as they are."""
    if isinstance(value, xr.DataArray):
        return value.astype(np.float64)
    values = np.asarray(value, dtype=np.float64)
    return xr.DataArray(values, dims=("point",)[: values.ndim])
