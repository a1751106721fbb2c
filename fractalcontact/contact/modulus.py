"""Contact modulus of a pair of elastic bodies."""

from __future__ import annotations

from fractalcontact.base.checks import Problems


def effective_modulus(
    young: float, poisson: float, young2: float | None = None, poisson2: float | None = None
) -> float:
    """Contact modulus E* of a pair of bodies, in Pa.

    1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2.

    Parameters
    ----------
    young, poisson : float
        Young's modulus (Pa) and Poisson's ratio of the first body; -1 < nu <= 0.5.
    young2, poisson2 : float, optional
        The same of the second body; what is left out is that of the first, so that two equal bodies need
        to be named once. ``young2=numpy.inf`` is a rigid second body.

    Returns
    -------
    float
        E* in Pa; half the plane-strain modulus E/(1 - nu^2) for two equal bodies.

    Raises
    ------
    InvalidInput
        A modulus is not positive, or a Poisson's ratio is outside (-1, 0.5].

    References
    ----------
    Johnson, K. L. (1985) Contact Mechanics, eq. 3.32 and 4.20.
    """
    with Problems("fractalcontact.contact.effective_modulus") as problems:
        first = problems.number("young", young, above=0)
        nu1 = problems.number("poisson", poisson, above=-1, at_most=0.5)
        nu2 = nu1 if poisson2 is None else problems.number("poisson2", poisson2, above=-1, at_most=0.5)
        rigid = isinstance(young2, (int, float)) and young2 == float("inf")
        if young2 is None or rigid:
            second = first
        else:
            second = problems.number("young2", young2, above=0)
    if rigid:
        return first / (1.0 - nu1 * nu1)
    if nu1 == nu2 and first == second:
        return first / (2.0 * (1.0 - nu1 * nu1))
    return 1.0 / ((1.0 - nu1 * nu1) / first + (1.0 - nu2 * nu2) / second)
