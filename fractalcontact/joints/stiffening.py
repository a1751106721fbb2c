"""Laws that describe how a joint closes: exponential, hyperbolic, and its stiffness."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.coords import leading_coords
from fractalcontact.base.provenance import accounted, stamp
from fractalcontact.base.schema import label
from fractalcontact.joints import _laws

if TYPE_CHECKING:
    import xarray as xr

WHERE = "fractalcontact.joints.closure_laws"
REFERENCES = (
    "Persson, B. N. J., Relation between interfacial separation and load, Phys. Rev. Lett. 99 (2007); "
    "Bandis, S. C., Lumsden, A. C. and Barton, N. R., Fundamentals of rock joint deformation, Int. J. Rock "
    "Mech. Min. Sci. 20 (1983)"
)
FEW = "NaN where fewer than three loading steps have a force, or the interface does not close"
NONE = "NaN where there is no force, where a branch of the path has one step only, or nothing closes"
FITS = ("closure_length", "reference_pressure", "exponential_misfit", "initial_stiffness",
        "greatest_closure", "hyperbolic_misfit")  # fmt: skip


@accounted()
def closure_laws(closure: xr.Dataset) -> xr.Dataset:
    """Fit the named laws of closure to a computed one, and take its stiffness.

    The exponential law p = p0 exp(w_int / l) is that of self-affine elastic faces under moderate pressure;
    their stiffness is p / l. The hyperbola w_int = p Vm / (Kni Vm + p) was found on rock joints, which yield:
    fitted to elastic faces it describes and proves nothing. Compare the two misfits.

    Parameters
    ----------
    closure : Dataset
        From `fractalcontact.joints.closure`: interface_closure (m) and nominal_pressure (Pa) over (...,
        step).

    Returns
    -------
    Dataset
        Over (...): closure_length l (m) and reference_pressure p0 (Pa) of the exponential law;
        initial_stiffness Kni (Pa/m) and greatest_closure Vm (m, infinite for a straight line) of the
        hyperbola; exponential_misfit and hyperbolic_misfit (m, rms difference of the closures). Both are
        fitted by least squares of the closure to the first loading, up to the greatest force. Over
        (..., step): stiffness dp/dw_int (Pa/m), from neighbouring steps on the same branch of the path,
        exact for the exponential law. NaN with the `reason` where there is nothing to fit.

    Raises
    ------
    InvalidInput
        The Dataset is of another kind.

    References
    ----------
    Persson (2007), Phys. Rev. Lett. 99:125502; Bandis, Lumsden and Barton (1983), Int. J. Rock Mech. Min.
    Sci. 20:249.
    """
    import xarray as xr

    with Problems(WHERE) as problems:
        _check(closure, problems)
    inner = closure["interface_closure"].transpose(..., "step")
    pressure = closure["nominal_pressure"].broadcast_like(inner).transpose(*inner.dims)
    shape = inner.shape[:-1]
    curves = inner.values.reshape(-1, inner.shape[-1]), pressure.values.reshape(-1, inner.shape[-1])
    fits, stiffness = [], []
    for w, p in zip(*curves, strict=True):
        fits.append(_laws.exponential(p, w) + _laws.hyperbola(p, w))
        stiffness.append(_laws.stiffness(p, w))
    columns = np.reshape(fits, (*shape, len(FITS)))
    found: dict[str, Any] = {name: (inner.dims[:-1], columns[..., i]) for i, name in enumerate(FITS)}
    found["stiffness"] = inner.dims, np.reshape(stiffness, inner.shape)
    result = xr.Dataset(found, leading_coords(closure, inner.dims, taken=found))
    parameters = {"closure": closure}
    result = stamp(label(result), WHERE, parameters, title="laws of closure", references=REFERENCES)
    for name, variable in result.data_vars.items():
        if np.isnan(variable.values).any():
            result[name].attrs["reason"] = NONE if name == "stiffness" else FEW
    return result


def _check(closure: Any, problems: Problems) -> None:
    import xarray as xr

    expected = "the Dataset of fractalcontact.joints.closure"
    if not isinstance(closure, xr.Dataset):
        problems.add("closure", expected, type(closure).__name__)
        return
    names = ("interface_closure", "nominal_pressure")
    absent = [name for name in names if name not in closure.variables or "step" not in closure[name].dims]
    problems.require(not absent, "closure", expected, f"no {', '.join(absent)} over step")
