"""Size effect of the strength of a joint, from the dimensions of its contact domain and its surface."""

from __future__ import annotations

from collections.abc import Sequence

import xarray as xr

from fractalcontact.base.numbers import Array, float_array
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.joints._criteria import POSITIVE, size_factors


def _check(problems: Problems) -> None:
    given = problems.given
    problems.numbers("size_ratio", **POSITIVE)
    is_number = problems.number("contact_dimension", at_least=0, at_most=2)
    lowest = float(given.contact_dimension) if is_number else 0.0
    problems.number("roughness_dimension", at_least=lowest, at_most=2)


@public_result(
    title="size effect of a joint",
    references=(
        "Carpinteri and Paggi (2009), Chaos, Solitons and Fractals 39:540; Borri-Brunetto, Carpinteri and "
        "Chiaia (1999), Int. J. Fracture 95:221"
    ),
    achieved_error="that of the dimensions",
    check=_check,
)
def size_effect(
    size_ratio: float | Sequence[float] | Array, *, contact_dimension: float, roughness_dimension: float = 2.0
) -> xr.Dataset:
    """Return the factors by which the strength of a joint changes with its size.

    With a contact domain of dimension D_s and a rough surface whose resistant section has the dimension D_r:
    shear strength ~ size^(D_s - 2), friction coefficient ~ size^(D_s - D_r), fracture energy
    ~ size^(D_s - 1).

    Parameters
    ----------
    size_ratio : float or sequence of float
        Ratio of the sizes, above 0.
    contact_dimension : float
        D_s, 0 to 2, for example the box dimension of the contact domain over a stated window.
    roughness_dimension : float
        D_r, contact_dimension to 2.

    Returns
    -------
    Dataset over size_ratio
        strength_factor, friction_factor, fracture_energy_factor.

    Raises
    ------
    InvalidInput
        A number is outside its bounds.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> factors = fc.joints.size_effect(4.0, contact_dimension=1.5)
    >>> factors.strength_factor.item(), factors.fracture_energy_factor.item()
    (0.5, 2.0)
    """
    ratio = float_array(size_ratio)
    factors = size_factors(ratio, float(contact_dimension), float(roughness_dimension))
    return xr.Dataset(
        {name: ("size_ratio", values) for name, values in factors.items()}, {"size_ratio": ratio}
    )
