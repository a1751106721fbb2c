"""Contact modulus and Poisson's ratio of a pair of elastic bodies."""

from __future__ import annotations

import math

from fractalcontact.base.validation import Problems


def effective_modulus(
    young: float, poisson: float, young2: float | None = None, poisson2: float | None = None
) -> float:
    """Contact modulus E* of a pair of elastic bodies, in Pa.

    1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2.

    Parameters
    ----------
    young, poisson : float
        Young's modulus (Pa) and Poisson's ratio of the first body; -1 < nu <= 0.5, where 0.5 is an
        incompressible body, such as rubber.
    young2, poisson2 : float, optional
        The same of the second body. Both or neither: without them the bodies are alike. One of the bodies may
        be rigid, ``young2=numpy.inf``, and then needs no Poisson's ratio.

    Returns
    -------
    float
        E* in Pa; half the plane-strain modulus E/(1 - nu^2) for two equal bodies, all of it against a rigid
        one.

    Raises
    ------
    InvalidInput
        A modulus is not positive, a Poisson's ratio is outside (-1, 0.5], one property of the second body
        is given without the other, or both bodies are rigid.

    References
    ----------
    Johnson, K. L. (1985) Contact Mechanics, eq. 3.32 and 4.20.

    Examples
    --------
    Concrete on concrete, and concrete under a rigid flat:

    >>> import fractalcontact as fc
    >>> round(fc.contact.effective_modulus(30e9, 0.2) / 1e9, 3)
    15.625
    >>> round(fc.contact.effective_modulus(30e9, 0.2, young2=float("inf")) / 1e9, 3)
    31.25
    """
    with Problems("fractalcontact.contact.effective_modulus") as problems:
        _check_pair(problems, young, poisson, young2, poisson2)
    first = _compliance(young, poisson)
    return 1.0 / (first + (first if young2 is None else _compliance(young2, poisson2)))


def effective_poisson(
    young: float, poisson: float, young2: float | None = None, poisson2: float | None = None
) -> float:
    """Poisson's ratio of two equal bodies that have the tangential and normal compliance of a pair.

    It is the mean of both, weighted by the compliance in shear, 2 (1 + nu)/E.

    Parameters
    ----------
    young, poisson, young2, poisson2 : float
        As for `effective_modulus`.

    Returns
    -------
    float
        For `partial_slip`; that of the elastic body where the other is rigid.

    Raises
    ------
    InvalidInput
        As for `effective_modulus`.

    Notes
    -----
    Elastic displacements along the surface follow from E* and this ratio alone. What it leaves out, as
    `partial_slip` does, is the slip that the pressure causes between dissimilar bodies.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> round(fc.contact.effective_poisson(30e9, 0.2, 60e9, 0.3), 4)
    0.2351
    """
    with Problems("fractalcontact.contact.effective_poisson") as problems:
        _check_pair(problems, young, poisson, young2, poisson2)
    if young2 is None:
        return float(poisson)
    bodies = [(young, poisson), (young2, poisson2)]
    elastic = [(float(modulus), float(ratio)) for modulus, ratio in bodies if ratio is not None]
    softest = min(modulus for modulus, _ in elastic)  # no compliance leaves the range of numbers
    weights = [softest / modulus * (1 + ratio) for modulus, ratio in elastic]
    ratios = [ratio for _, ratio in elastic]
    return sum(w * ratio for w, ratio in zip(weights, ratios, strict=True)) / sum(weights)


def _is_rigid(young: object) -> bool:
    return isinstance(young, (int, float)) and young == math.inf


def _check_pair(problems: Problems, young: object, poisson: object, young2: object, poisson2: object) -> None:
    _check_body(problems, "young", young, "poisson", poisson)
    if young2 is not None:
        _check_body(problems, "young2", young2, "poisson2", poisson2)
    elif poisson2 is not None:
        problems.add("poisson2", "a value with young2, or neither of them for two equal bodies", poisson2)
    elastic = not (_is_rigid(young) and (young2 is None or _is_rigid(young2)))
    problems.require(elastic, "young / young2", "one of the bodies to be elastic", "two rigid ones")


def _check_body(problems: Problems, name: str, young: object, ratio_name: str, poisson: object) -> None:
    if _is_rigid(young) and poisson is None:
        return
    if not _is_rigid(young):
        problems.number(name, young, above=0)
    if poisson is None:
        problems.add(ratio_name, f"a Poisson's ratio beside {name}", poisson)
    else:
        problems.number(ratio_name, poisson, above=-1, at_most=0.5)


def _compliance(young: float, poisson: float | None) -> float:
    """Return (1 - nu^2)/E of one body, in 1/Pa; zero for a rigid one."""
    if poisson is None:
        return 0.0
    ratio = float(poisson)
    return (1.0 - ratio) * (1.0 + ratio) / float(young)
