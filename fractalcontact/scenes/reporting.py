"""The summary of a study, for the screen: main figures, errors reached, run times."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.outline import Outline, outline
from fractalcontact.base.tables import table
from fractalcontact.scenes.statements import paper_table

if TYPE_CHECKING:
    import xarray as xr


def summary(tree: xr.DataTree) -> str:
    """Return the main figures of a study with the errors reached and the run time of every stage.

    Of an ensemble the figures are those of the first member.
    """
    tree = first_member(tree)
    parts = [
        str(tree.attrs.get("title", tree.name or "result")),
        _picked(tree),
        _dimensions(tree),
        _contact(tree),
        _faces(tree),
        _closure(tree),
        _dilatancy(tree),
        _friction(tree),
        _domains(tree),
        paper_table(tree),
        stage_table(tree),
    ]
    return "\n\n".join(part for part in parts if part)


def first_member(tree: xr.DataTree) -> xr.DataTree:
    """Return the results of the first member of an ensemble; of a single study all."""
    first: xr.DataTree = tree.map_over_datasets(lambda one: one.isel(member=0, missing_dims="ignore"))
    first.attrs = dict(tree.attrs)
    return first


def contents(path: str | os.PathLike[str]) -> str:
    """Return what a file holds: its groups and variables, then the stages with their errors and times.

    Raises
    ------
    UnreadableFile
        There is no such file, or it is not complete.
    """
    groups = outline(path, _tells_error)
    root = groups["/"]
    told = ("title", "source", "completeness", "picked")
    lines = [str(root.attrs[key]) for key in told if key in root.attrs]
    for place, group in groups.items():
        if group.variables:
            lines += ["", place, *_variable_lines(group), *_reason_lines(group), *_achieved_lines(group)]
    for place, group in groups.items():
        stages = stage_table(group)
        if stages and (place == "/" or not root.attrs.get("provenance")):
            lines += ["", stages]
    return "\n".join(lines)


def stage_table(result: Any) -> str:
    """Return the stages of a study: seconds, origin, and what each says of its accuracy."""
    entry = _entry(result)
    stages = entry.get("stages", {})
    if not stages or not _are_stages(stages):
        return _single_entry(entry)
    rows = [("stage", "seconds", "achieved")]
    for name, facts in stages.items():
        told = {key: value for key, value in facts.items() if key not in ("run_time", "origin")}
        note = "" if facts.get("origin") == "computed" else f" ({facts.get('origin')})"
        rows.append((name, f"{facts['run_time']:.2f}", ", ".join(_told(told)) + note))
    rows.append(("total", f"{sum(facts['run_time'] for facts in stages.values()):.2f}", ""))
    return table(rows)


def _are_stages(stages: Any) -> bool:
    """Say whether they are stages as a study writes them, and not something of the same name."""
    return isinstance(stages, dict) and all(
        isinstance(facts, dict) and isinstance(facts.get("run_time"), (int, float))
        for facts in stages.values()
    )


def _entry(result: Any) -> dict[str, Any]:
    """Return the provenance of a result, empty for a file of another origin."""
    try:
        entry = json.loads(result.attrs.get("provenance", "{}"))
    except (TypeError, ValueError):
        return {}
    return entry if isinstance(entry, dict) else {}


_ORIGIN = ("parameters", "version", "fft", "threads", "random", "stages")


def _single_entry(entry: dict[str, Any]) -> str:
    """Return the call of a single result with its run time and its achieved errors."""
    told = {key: value for key, value in entry.items() if key not in _ORIGIN and value is not None}
    return ", ".join(f"{key.replace('_', ' ')} {_short(value)}" for key, value in told.items())


def _short(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _told(facts: dict[str, Any]) -> Iterable[str]:
    for key, value in facts.items():
        word = key.replace("_", " ")
        if isinstance(value, list):
            yield f"{word} " + " ".join("-" if v is None or v != v else f"{v:.4f}" for v in value)
        elif isinstance(value, bool):
            yield word if value else f"not {word}"
        else:
            yield f"{word} {value:.2g}" if isinstance(value, float) else f"{word} {value}"


def _variable_lines(group: Outline) -> Iterable[str]:
    for name, (sizes, attributes) in group.variables.items():
        dims = ", ".join(f"{dim} {size}" for dim, size in sizes.items())
        units = attributes.get("units", "")
        yield f"  {name:<28} ({dims})  {attributes.get('long_name', '')}" + (f" [{units}]" if units else "")


def _tells_error(name: str) -> bool:
    ends = ("_error", "_low", "_high", "misfit")
    return name in ("run_time", "residual", "converged") or name.endswith(ends)


def _achieved_lines(group: Outline) -> Iterable[str]:
    """Yield the achieved errors of a group and its run time, each from the least to the greatest."""
    for name, numbers in group.numbers.items():
        values: np.ndarray[Any, Any] = np.ravel(np.ma.filled(np.ma.asarray(numbers, dtype=float), np.nan))
        known = values[np.isfinite(values)]
        word = name.replace("_", " ")
        if name == "converged":
            yield f"    converged: {int(known.sum())} of {values.size}"
        elif known.size == 0:
            yield f"    {word}: not given"
        elif name == "run_time":
            yield f"    {word}: {known.sum():.3g} s"
        else:
            ends = dict.fromkeys(f"{value:.3g}" for value in (known.min(), known.max()))
            yield f"    {word}: {' ... '.join(ends)}"


def _reason_lines(group: Outline) -> Iterable[str]:
    for name, (_, attributes) in group.variables.items():
        for key in ("comment", "reason"):
            for methods, reason in _reasons(attributes, key).items():
                yield f"    {name}, {methods}: {reason}"


def _group(tree: xr.DataTree, path: str) -> xr.Dataset | None:
    try:
        node: Any = tree[path]
    except KeyError:
        return None
    return node.to_dataset() if node.has_data else None


def _picked(tree: xr.DataTree) -> str:
    return "\n".join(f"picked: {one}" for one in str(tree.attrs.get("picked", "")).split("; ") if one)


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
    notes = _reasons(found["hurst"].attrs, "comment") | _reasons(found["ci_low"].attrs, "reason")
    return "\n".join([table(rows), *(f"  {method}: {reason}" for method, reason in notes.items() if reason)])


def _reasons(attributes: Mapping[Any, Any], key: str) -> dict[str, str]:
    """Return the reasons that a variable gives, by method; one for several methods is told once."""
    try:
        given = json.loads(attributes.get(key, "{}"))
    except (TypeError, ValueError):
        return {}
    reasons: dict[str, list[str]] = {}
    for method, reason in given.items() if isinstance(given, dict) else ():
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
                f"{float(one['null_dimension']):.2f}",
                "yes" if bool(one["differs_from_random"]) else "no",
            )
        )
    return table(rows)
