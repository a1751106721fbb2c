"""The summary of a study for the screen: main results, achieved errors, run times."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.tables import table
from fractalcontact.scenes._caveats import caveats, group_of
from fractalcontact.scenes._contents import note, reasons, stage_table
from fractalcontact.scenes._paper import paper_table


def summary(tree: xr.DataTree) -> str:
    r"""Return the main results of a study with the achieved errors and the run time of every stage.

    Of an ensemble, the results are those of the first member. A study whose scene says ``paper = true`` is
    compared with the paper of 1998.

    Parameters
    ----------
    tree : DataTree
        From `fractalcontact.scenes.run` or `fractalcontact.open`.

    Returns
    -------
    str

    Examples
    --------
    >>> import fractalcontact as fc
    >>> result = fc.scenes.run("rigid_sliding", progress=False)
    >>> print("\n".join(fc.scenes.summary(result).splitlines()[2:5]))
    rigid dilatancy    shear    dilatancy    mean slope
    -----------------  -------  -----------  ------------
    E                  10 mm    1.15 mm      +0.0264
    """
    tree = first_member(tree)
    sections = [
        str(tree.attrs.get("title", tree.name or "result")),
        _selected(tree),
        _dimensions(tree),
        _contact(tree),
        _mated_position(tree),
        _closure(tree),
        _dilatancy(tree),
        _friction(tree),
        _contact_set(tree),
        "\n".join(note(caveat) for caveat in caveats(tree)),
        paper_table(tree) if compares_with_paper(tree) else "",
        stage_table(tree),
    ]
    return "\n\n".join(section for section in sections if section)


def first_member(tree: xr.DataTree) -> xr.DataTree:
    """Return the results of the first member of an ensemble; of a single study all."""
    first: xr.DataTree = tree.map_over_datasets(lambda dataset: dataset.isel(member=0, missing_dims="ignore"))
    first.attrs = dict(tree.attrs)
    return first


def compares_with_paper(tree: xr.DataTree) -> bool:
    """Return whether the scene of a study says ``paper = true``."""
    try:
        scene = json.loads(tree.attrs["provenance"])["parameters"]["scene"]
    except (KeyError, TypeError, ValueError):
        return False
    return isinstance(scene, dict) and scene.get("paper") is True


def length(value: Any) -> str:
    """Return a length in metres with the prefix that suits it."""
    metres = float(value)
    if not np.isfinite(metres):
        return "-"
    for factor, unit in ((1e3, "km"), (1.0, "m"), (1e-3, "mm"), (1e-6, "um")):
        if abs(metres) >= factor:
            return f"{metres / factor:.3g} {unit}"
    return f"{metres * 1e9:.3g} nm"


def _percent(value: Any) -> str:
    return f"{float(value) * 100:.3g} %"


def _selected(tree: xr.DataTree) -> str:
    return "\n".join(
        f"selected: {choice}" for choice in str(tree.attrs.get("selected", "")).split("; ") if choice
    )


def _dimensions(tree: xr.DataTree) -> str:
    estimates = group_of(tree, "dimensions")
    if estimates is None or "method" not in estimates.dims:
        return ""
    rows = [("fractal dimension", "D", "95 % interval of D", "range of scales", "goodness of fit")]
    for method in estimates["method"].values:
        estimate = estimates.sel({"method": method})
        low, high, dimension, hurst = (
            float(estimate[name]) for name in ("ci_low", "ci_high", "fractal_dimension", "hurst")
        )
        misfit, largest = float(estimate["misfit"]), dimension + hurst
        rows.append(
            (
                str(method),
                f"{dimension:.3f}",
                f"{largest - high:.3f} ... {largest - low:.3f}" if np.isfinite(low) else "none",
                f"{length(estimate['scale_min'])} ... {length(estimate['scale_max'])}",
                f"z = {abs(misfit):.1f}" if np.isfinite(misfit) else "",
            )
        )
    remarks = reasons(estimates["hurst"].attrs, "comment") | reasons(estimates["ci_low"].attrs, "reason")
    return "\n".join([table(rows), *(note(f"{names}: {reason}") for names, reason in remarks.items())])


def _contact(tree: xr.DataTree) -> str:
    contact = group_of(tree, "contact")
    if contact is None:
        return ""
    rows = [("step", "nominal pressure", "closure", "contact area", "area, perimeter-corrected")]
    for step in range(contact.sizes["step"]):
        state = contact.isel(step=step)
        rows.append(
            (
                str(step),
                f"{float(state['nominal_pressure']):.3g} Pa",
                length(state["closure"]),
                _percent(state["contact_fraction"]),
                _percent(state["corrected_contact_fraction"]),
            )
        )
    return table(rows)


def _mated_position(tree: xr.DataTree) -> str:
    upper, lower = group_of(tree, "joints/faces"), group_of(tree, "surfaces")
    if upper is None or "mismatch" not in upper:
        return ""
    lines = [
        f"mated position: shift {length(upper['shift_x'])} along x and {length(upper['shift_y'])} along y, "
        f"rotation {float(upper['rotation']):.3g} degree",
        f"mismatch {length(upper['mismatch'])} rms, correlation {float(upper['correlation']):.3f}",
    ]
    if lower is not None and "height" in lower:
        aperture = upper["height"] - lower["height"]
        lines.append(
            f"aperture: mean {length(aperture.mean())}, smallest {length(aperture.min())} (negative: overlap)"
        )
    return "\n".join(lines)


def _closure(tree: xr.DataTree) -> str:
    closure = group_of(tree, "joints/closure")
    if closure is None:
        return ""
    last = closure.isel(step=-1)
    rows = [
        (
            "closure at shear",
            "normal force",
            "closure",
            "interface closure",
            "contact area",
            "area, perimeter-corrected",
        )
    ]
    for shear in np.atleast_1d(last["shear"].values):
        state = last.sel(shear=shear) if "shear" in last.dims else last
        rows.append(
            (
                f"{shear * 1e3:.3g} mm",
                f"{float(state['normal_force']) / 1e3:.3g} kN",
                f"{float(state['closure']) * 1e6:.4g} um",
                f"{float(state['interface_closure']) * 1e6:.4g} um",
                _percent(state["contact_fraction"]),
                _percent(state["corrected_contact_fraction"]),
            )
        )
    return table(rows)


def _dilatancy(tree: xr.DataTree) -> str:
    rigid = group_of(tree, "joints/rigid_dilatancy")
    if rigid is None:
        return ""
    rows = [("rigid dilatancy", "shear", "dilatancy", "mean slope")]
    last = rigid.isel(shear=-1)
    for direction in np.atleast_1d(rigid["direction"].values):
        state = last.sel(direction=direction) if "direction" in last.dims else last
        rows.append(
            (
                str(direction),
                f"{float(state['shear']) * 1e3:.3g} mm",
                f"{float(state['rigid_dilatancy']) * 1e3:.3g} mm",
                f"{float(state['mean_slope']):+.4f}" if "mean_slope" in state else "",
            )
        )
    return table(rows)


def _friction(tree: xr.DataTree) -> str:
    friction = group_of(tree, "joints/friction")
    if friction is None or "peak_shear_strength" not in friction:
        return ""
    over = float(friction["peak_distance"]) * 1e3
    column = f"from shear, over {over:.3g} mm"
    rows = [("peak shear strength", "nominal pressure", "strength", "friction angle", column)]
    for direction in friction["direction"].values:
        for step in range(friction.sizes["step"]):
            state = friction.sel(direction=direction).isel(step=step)
            strength = float(state["peak_shear_strength"])
            rows.append(
                (
                    str(direction),
                    f"{float(state['nominal_pressure']) / 1e6:.3g} MPa",
                    f"{strength / 1e6:.4g} MPa" if np.isfinite(strength) else "none: the faces lock",
                    f"{float(state['peak_friction_angle']):.1f} degree" if np.isfinite(strength) else "",
                    f"{float(state['peak_shear']) * 1e3:.3g} mm" if np.isfinite(strength) else "",
                )
            )
    comment = friction["peak_friction_angle"].attrs.get("comment")
    return table(rows) + (f"\nThe peak friction angle {comment}." if comment else "")


def _contact_set(tree: xr.DataTree) -> str:
    boxes = group_of(tree, "domains/box_dimension")
    if boxes is None:
        return ""
    rows = [
        ("contact domain, last step", "box dimension", "95 % interval", "random null", "differs from null")
    ]
    last = boxes.isel(step=-1) if "step" in boxes.dims else boxes
    for shear in np.atleast_1d(last["shear"].values) if "shear" in last.coords else [None]:
        state = last.sel(shear=shear) if shear is not None and "shear" in last.dims else last
        low, high = float(state["ci_low"]), float(state["ci_high"])
        rows.append(
            (
                "" if shear is None else f"shear {float(shear) * 1e3:.3g} mm",
                f"{float(state['box_dimension']):.2f}",
                f"{low:.2f} ... {high:.2f}" if np.isfinite(low) else "none",
                f"{float(state['null_dimension']):.2f}",
                "yes" if bool(state["differs_from_random"]) else "no",
            )
        )
    return table(rows)
