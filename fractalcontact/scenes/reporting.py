"""The summary of a study, for the screen: main figures, errors reached, run times."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.text import table

if TYPE_CHECKING:
    from collections.abc import Iterable

    import xarray as xr


def summary(tree: xr.DataTree) -> str:
    """Return the main figures of a study with the errors reached and the run time of every stage."""
    parts = [
        str(tree.attrs.get("title", tree.name or "result")),
        _dimensions(tree),
        _contact(tree),
        _faces(tree),
        _closure(tree),
        _dilatancy(tree),
        _friction(tree),
        _domains(tree),
        stage_table(tree),
    ]
    return "\n\n".join(part for part in parts if part)


def contents(result: xr.DataTree | xr.Dataset | xr.DataArray) -> str:
    """Return what a file holds: its groups and variables, then the stages with their errors and times."""
    import xarray as xr

    if isinstance(result, xr.DataTree):
        groups = {node.path: node.to_dataset(inherit=False) for node in result.subtree}
    else:
        groups = {"/": result.to_dataset() if isinstance(result, xr.DataArray) else result}
    lines = [str(result.attrs[key]) for key in ("title", "source", "completeness") if key in result.attrs]
    for path, dataset in groups.items():
        if dataset.variables:
            lines += ["", path, *_variable_lines(dataset), *_reason_lines(dataset)]
    stages = stage_table(result)
    return "\n".join(lines) + (f"\n\n{stages}" if stages else "")


def stage_table(result: Any) -> str:
    """Return the stages of a study: seconds, origin, and what each says of its accuracy."""
    entry = _entry(result)
    stages = entry.get("stages", {})
    if not stages:
        return _single_entry(entry)
    rows = [("stage", "seconds", "achieved")]
    for name, facts in stages.items():
        told = {key: value for key, value in facts.items() if key not in ("run_time", "origin")}
        note = "" if facts.get("origin") == "computed" else f" ({facts.get('origin')})"
        rows.append((name, f"{facts['run_time']:.2f}", ", ".join(_told(told)) + note))
    rows.append(("total", f"{sum(facts['run_time'] for facts in stages.values()):.2f}", ""))
    return table(rows)


def _entry(result: Any) -> dict[str, Any]:
    """Return the provenance of a result, empty for a file of another origin."""
    try:
        entry = json.loads(result.attrs.get("provenance", "{}"))
    except (TypeError, ValueError):
        return {}
    return entry if isinstance(entry, dict) else {}


def _single_entry(entry: dict[str, Any]) -> str:
    told = {key: entry[key] for key in ("call", "run_time", "residual", "iterations") if key in entry}
    return ", ".join(f"{key} {value}" for key, value in told.items())


def _told(facts: dict[str, Any]) -> Iterable[str]:
    for key, value in facts.items():
        word = key.replace("_", " ")
        if isinstance(value, list):
            yield f"{word} " + " ".join("-" if v is None or v != v else f"{v:.4f}" for v in value)
        elif isinstance(value, bool):
            yield word if value else f"not {word}"
        else:
            yield f"{word} {value:.2g}" if isinstance(value, float) else f"{word} {value}"


def _variable_lines(dataset: xr.Dataset) -> Iterable[str]:
    for name, variable in dataset.variables.items():
        dims = ", ".join(f"{dim} {size}" for dim, size in variable.sizes.items())
        units = variable.attrs.get("units", "")
        yield f"  {name!s:<28} ({dims})  {variable.attrs.get('long_name', '')}" + (
            f" [{units}]" if units else ""
        )


def _reason_lines(dataset: xr.Dataset) -> Iterable[str]:
    for name, variable in dataset.variables.items():
        for key in ("note", "not_given"):
            if key in variable.attrs:
                for methods, reason in _reasons(dataset[name], key).items():
                    yield f"    {name}, {methods}: {reason}"


def _group(tree: xr.DataTree, path: str) -> xr.Dataset | None:
    try:
        node: Any = tree[path]
    except KeyError:
        return None
    return node.to_dataset() if node.has_data else None


def _dimensions(tree: xr.DataTree) -> str:
    found = _group(tree, "dimensions")
    if found is None or "method" not in found.dims:
        return ""
    rows = [("fractal dimension", "D", "95 % interval of D", "scales", "departure from the model")]
    for method in found["method"].values:
        one = found.sel({"method": method})
        low, high, dimension, hurst = (
            float(one[k]) for k in ("ci_low", "ci_high", "fractal_dimension", "hurst")
        )
        misfit, top = float(one["misfit"]), dimension + hurst
        rows.append(
            (
                str(method),
                f"{dimension:.3f}",
                f"{top - high:.3f} ... {top - low:.3f}" if np.isfinite(low) else "none",
                f"{length(one['scale_min'])} ... {length(one['scale_max'])}",
                f"{abs(misfit):.1f} standard deviations" if np.isfinite(misfit) else "",
            )
        )
    notes = _reasons(found["hurst"], "note") | _reasons(found["ci_low"], "not_given")
    return "\n".join([table(rows), *(f"  {method}: {reason}" for method, reason in notes.items() if reason)])


def _reasons(variable: xr.DataArray, key: str) -> dict[str, str]:
    """Return the reasons that a variable gives, by method; one for several methods is told once."""
    reasons: dict[str, list[str]] = {}
    for method, reason in json.loads(variable.attrs.get(key, "{}")).items():
        reasons.setdefault(str(reason), []).append(method)
    return {", ".join(methods): reason for reason, methods in reasons.items()}


def length(value: Any) -> str:
    """Return a length in the unit in which it reads well."""
    metres = float(value)
    for factor, unit in ((1e3, "km"), (1.0, "m"), (1e-3, "mm"), (1e-6, "um")):
        if abs(metres) >= factor:
            return f"{metres / factor:.3g} {unit}"
    return f"{metres * 1e9:.3g} nm" if metres == metres else "-"


def _contact(tree: xr.DataTree) -> str:
    found = _group(tree, "contact")
    if found is None:
        return ""
    rows = [("contact", "nominal pressure", "closure", "area", "corrected")]
    for step in range(found.sizes["step"]):
        one = found.isel(step=step)
        rows.append(
            (
                f"step {step}",
                f"{float(one['nominal_pressure']):.3g} Pa",
                length(one["closure"]),
                f"{float(one['contact_fraction']) * 100:.3g} %",
                f"{float(one['corrected_contact_fraction']) * 100:.3g} %",
            )
        )
    return table(rows)


def _faces(tree: xr.DataTree) -> str:
    found, lower = _group(tree, "joints/faces"), _group(tree, "surfaces")
    if found is None or "mismatch" not in found:
        return ""
    told = [
        f"mated position: shift {length(found['shift_x'])} along x and {length(found['shift_y'])} along y, "
        f"turn {float(found['rotation']):.3g} degree",
        f"mismatch {length(found['mismatch'])} rms, correlation {float(found['correlation']):.3f}",
    ]
    if lower is not None and "height" in lower:
        opening = found["height"] - lower["height"]
        told.append(
            f"opening {length(opening.mean())} on average, from {length(opening.min())} (overlap if negative)"
        )
    return "\n".join(told)


def _closure(tree: xr.DataTree) -> str:
    found = _group(tree, "joints/closure")
    if found is None:
        return ""
    last = found.isel(step=-1)
    rows = [("closure at shear", "force", "closure", "of the interface", "area", "corrected")]
    for shear in np.atleast_1d(last["shear"].values):
        one = last.sel(shear=shear) if "shear" in last.dims else last
        rows.append(
            (
                f"{shear * 1e3:.3g} mm",
                f"{float(one['normal_force']) / 1e3:.3g} kN",
                f"{float(one['closure']) * 1e6:.4g} um",
                f"{float(one['interface_closure']) * 1e6:.4g} um",
                f"{float(one['contact_fraction']) * 100:.3g} %",
                f"{float(one['corrected_contact_fraction']) * 100:.3g} %",
            )
        )
    return table(rows)


def _dilatancy(tree: xr.DataTree) -> str:
    rigid = _group(tree, "joints/rigid_dilatancy")
    if rigid is None:
        return ""
    rows = [("rigid dilatancy", "at shear", "dilatancy", "mean slope")]
    last = rigid.isel(shear=-1)
    for direction in np.atleast_1d(rigid["direction"].values):
        one = last.sel(direction=direction) if "direction" in last.dims else last
        rows.append(
            (
                str(direction),
                f"{float(one['shear']) * 1e3:.3g} mm",
                f"{float(one['rigid_dilatancy']) * 1e3:.3g} mm",
                f"{float(one['mean_slope']):+.4f}" if "mean_slope" in one else "",
            )
        )
    return table(rows)


def _friction(tree: xr.DataTree) -> str:
    found = _group(tree, "joints/friction")
    if found is None or "peak_shear_strength" not in found:
        return ""
    rows = [("peak shear strength", "nominal pressure", "strength", "friction angle", "at shear")]
    for direction in found["direction"].values:
        for step in range(found.sizes["step"]):
            one = found.sel(direction=direction).isel(step=step)
            strength = float(one["peak_shear_strength"])
            rows.append(
                (
                    str(direction),
                    f"{float(one['nominal_pressure']) / 1e6:.3g} MPa",
                    f"{strength / 1e6:.4g} MPa" if np.isfinite(strength) else "none: the faces lock",
                    f"{float(one['peak_friction_angle']):.1f} degree",
                    f"{float(one['peak_shear']) * 1e3:.3g} mm",
                )
            )
    return table(rows)


def _domains(tree: xr.DataTree) -> str:
    found = _group(tree, "domains/box_dimension")
    if found is None:
        return ""
    rows = [("contact domain", "box dimension", "interval", "of a random dust", "differs")]
    last = found.isel(step=-1) if "step" in found.dims else found
    for shear in np.atleast_1d(last["shear"].values) if "shear" in last.coords else [None]:
        one = last.sel(shear=shear) if shear is not None and "shear" in last.dims else last
        place = "last step" if shear is None else f"last step, {float(shear) * 1e3:.3g} mm"
        low, high = float(one["ci_low"]), float(one["ci_high"])
        rows.append(
            (
                place,
                f"{float(one['box_dimension']):.2f}",
                f"{low:.2f} ... {high:.2f}" if np.isfinite(low) else "none",
                f"{float(one['dust_dimension']):.2f}",
                "yes" if bool(one["differs_from_dust"]) else "no",
            )
        )
    return table(rows)
