"""Scenes for usual questions to a measured surface, as text to run or to start from."""

from __future__ import annotations

import importlib.resources
import json
import math
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fractalcontact.base.errors import FractalContactError, FractalContactWarning, InvalidInput, warn
from fractalcontact.base.files import files_of, is_pattern
from fractalcontact.base.grid import read_grid
from fractalcontact.base.study import provenance_of
from fractalcontact.base.units import quantity_text
from fractalcontact.base.validation import Problems
from fractalcontact.scenes._scene import OF_SURFACE

if TYPE_CHECKING:
    import xarray as xr
    from jinja2 import Template

Files = str | os.PathLike[str] | Sequence[str | os.PathLike[str]]

WHERE = "fractalcontact.scenes.template"
QUESTIONS = ("roughness", "contact", "joint")


def template(
    question: str,
    scan: Files,
    upper: Files | None = None,
    *,
    young: float | None = None,
    poisson: float = 0.2,
    folder: str | os.PathLike[str] = ".",
    level: int | None = None,
    despike: bool = False,
    register: bool = True,
    turn_upper: str | None = None,
    basic_friction_angle: float | None = None,
    wall_strength: float | None = None,
    surface: xr.DataArray | None = None,
    **reading: Any,
) -> str:
    """Return a scene that answers a usual question to a measured surface.

    Parameters
    ----------
    question : {"roughness", "contact", "joint"}
        Dimension with its interval, roughness coefficient (JRC) and directional roughness; contact of the
        surface with a flat under growing pressure; or closure, dilatancy and leakage of two faces.
    scan, upper : path-like, or list of them
        Files of the surface, and of the second face of a joint. Of many scans a list, or a pattern
        (``"scans/*.sur"``); faces are paired by what the wildcards of their patterns stand for.
    young, poisson : float
        Young's modulus (Pa) and Poisson's ratio of both bodies, for "contact" and "joint".
    folder : path-like
        Folder of the scene; the files are named relative to it.
    level : int, optional
        Degree of the polynomial that is removed from a single face; 0 keeps its tilt. Default: 1, the mean
        plane, unless the surface is periodic, or a cloud of points, which is gridded above its own plane. The
        faces of a joint are never levelled one by one.
    despike : bool
        Remove spikes from the surfaces, see `fractalcontact.surfaces.despike`.
    register : bool
        Of a joint: move the upper face into mated position. False: leave the faces as they were scanned.
    turn_upper : {"x", "y"}, optional
        Of a joint: turn an upper body that was scanned face up over about this axis.
    basic_friction_angle, wall_strength : float, optional
        Of a joint: friction angle of smooth faces (degree) and compressive strength of its walls, JCS (Pa).
        With both the scene computes the strength, by the criteria and by a shear test with wear, and the
        datasheet.
    surface : DataArray, optional
        The heights of `scan`, where they have been read already.
    **reading
        Arguments of `fractalcontact.surfaces.read` for both files: spacing, units, plane ...

    Returns
    -------
    str
        TOML. Loads and shears are chosen from the size and the slope of the surface, which is read for that;
        of many scans from the first that can be read.

    Warns
    -----
    FractalContactWarning
        The points of a face are too far apart for its JRC, which is left out. A face with an edge below 5 mm
        has no JRC either, without a warning.

    Raises
    ------
    InvalidInput
        An unknown question, no modulus or no second face where it is needed, or a profile.
    UnreadableFile
        The file cannot be read.

    Examples
    --------
    >>> import tempfile
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.7, rms_increment=1e-5, rng=1)
    >>> path = fc.save(surface, tempfile.mkdtemp() + "/scan.nc")
    >>> print(fc.scenes.template("roughness", path, folder=path.parent).partition("[want]")[0])
    title = "Roughness of scan.nc"
    <BLANKLINE>
    [surface]
    read = "scan.nc"
    level = 1
    <BLANKLINE>
    <BLANKLINE>
    """
    options = {key: value for key, value in reading.items() if value is not None}
    with Problems(WHERE) as problems:
        is_known = problems.choice("question", question, QUESTIONS)
        is_pressed, is_joint = not is_known or question != "roughness", is_known and question == "joint"
        problems.path("folder", folder, what="the path of a folder")
        _check_files("scan", scan, problems)
        problems.boolean("despike", despike)
        problems.integer("level", level, at_least=0, at_most=2, optional=True)
        if is_joint:
            problems.require(level is None, "level", "a single face, not those of a joint", level)
            problems.choice("turn_upper", turn_upper, ("x", "y"), optional=True)
            problems.number("basic_friction_angle", basic_friction_angle, at_least=0, below=90, optional=True)
            problems.number("wall_strength", wall_strength, above=0, optional=True)
            needed = basic_friction_angle is not None or wall_strength is None
            expected = "a friction angle (--friction-angle) beside the strength of the walls (--jcs)"
            problems.require(needed, "wall_strength", expected, wall_strength)
        if is_pressed:
            problems.number("young", young, above=0)
            problems.boolean("register", register)
            problems.number("poisson", poisson, above=-1, at_most=0.5)
        if is_joint:
            _check_files("upper", upper, problems)
        if surface is not None:
            problems.surface("surface", surface, finite=False, smallest=1, leading=True)
    surface = _first_surface(scan, options) if surface is None else surface
    facts = _facts(surface)
    if despike:
        options["despike"] = True
    if is_pressed and (despike or facts["missing"]):
        options["fill"] = True
    if not is_joint and (level is not None or not (facts["periodic"] or facts["in_plane"])):
        options["level"] = 1 if level is None else level
    faces, names = {"surface": _file_table(scan, folder, options)}, [_words(scan)]
    material: dict[str, float | None] = {"young": young, "poisson": poisson} if is_pressed else {}
    if is_joint:
        if facts["of_points"]:  # the second face on the plane and the cells of the first
            options.pop("spacing", None)
            options["plane"] = OF_SURFACE
        faces["upper"] = _file_table(upper or "", folder, options)
        names.append(_words(upper or ""))
        # true pressures beyond the strength of the walls are named
        material |= {"basic_friction_angle": basic_friction_angle, "yield_pressure": wall_strength}
        values = _travel(facts)
    else:
        values = _loads(_slope(surface, options), young, poisson) if is_pressed else _roughness(facts)
    return packaged_template("question.toml.jinja", keep_trailing_newline=True).render(
        question=question,
        title=f"{question.capitalize()} of {' and '.join(dict.fromkeys(names))}",
        faces=faces,
        material={key: float(value) for key, value in material.items() if value is not None},
        turn_upper=turn_upper,
        register=register,
        **values,
    )


@cache
def packaged_template(file: str, **options: bool) -> Template:
    """Return a template of this package, which takes longer to compile than to render."""
    from jinja2 import Environment  # here: a study without a folder renders nothing

    environment = Environment(trim_blocks=True, lstrip_blocks=True, **options)  # type: ignore[arg-type]
    environment.filters["toml"] = _toml
    path = importlib.resources.files("fractalcontact.scenes").joinpath(file)
    return environment.from_string(path.read_text(encoding="utf-8"))


def _files(scan: Files) -> list[Path]:
    """Return the files of a pattern, or of one or several scans."""
    if isinstance(scan, str) and is_pattern(scan):
        return [Path(each) for each in files_of(scan).values()]
    return [Path(each) for each in _names(scan)]


def _names(scan: Files) -> list[str | os.PathLike[str]]:
    return list(scan) if isinstance(scan, (list, tuple)) else [scan]  # type: ignore[list-item]


def _check_files(argument: str, scan: Any, problems: Problems) -> None:
    """Note files that do not exist."""
    valid = [problems.path(argument, each) for each in _names(scan)]
    if not all(valid):
        return
    files = _files(scan)
    problems.require(bool(files), argument, "files", scan)
    for file in files:
        problems.require(file.is_file(), argument, "an existing file", file.name)


def _words(scan: Files) -> str:
    """Return the name of a file, or of the folder of many."""
    files = _files(scan)
    several = len(files) > 1 or is_pattern(str(scan))
    folder = Path(os.path.commonpath([file.resolve().parent for file in files])).name
    return f"the scans in {folder}" if several else files[0].name


def _first_surface(scan: Files, options: Mapping[str, Any]) -> xr.DataArray:
    """Return the first surface that can be read."""
    from fractalcontact import surfaces

    *files, last = _files(scan)
    for file in files:
        with suppress(FractalContactError):
            return surfaces.read(file, **options)
    return surfaces.read(last, **options)


def _facts(surface: xr.DataArray) -> dict[str, Any]:
    """Return spacing and extent of a surface, and whether it has gaps."""
    if surface.ndim > 2:
        raise InvalidInput.of(WHERE, "scan", "one surface", f"a stack with dims {surface.dims}")
    if "y" not in surface.dims:
        got = "a profile: see fractalcontact.dimensions.estimate"
        raise InvalidInput.of(WHERE, "scan", "a surface", got)
    grid = read_grid(surface)
    return {
        "spacing": max(grid.spacing),
        "cell": grid.spacing[1],  # along x, in which joints are sheared
        "extent": min(grid.extent),
        "missing": bool(surface.isnull().any()),
        "periodic": any(grid.periodic),
        "of_points": "gridding" in provenance_of(surface),
        "in_plane": provenance_of(surface).get("plane") == "best fit",
    }


def _file_table(scan: Files, folder: str | os.PathLike[str], options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the table that reads a file, or several."""
    start = Path(folder).resolve()
    paths = [Path(os.path.relpath(Path(name).resolve(), start)).as_posix() for name in _names(scan)]
    return {"read": paths if isinstance(scan, (list, tuple)) else paths[0], **options}


def _roughness(facts: Mapping[str, Any], lag: float = 0.508e-3) -> dict[str, Any]:
    """Return whether the points resolve JRC, and warn where those of a long face do not.

    Tse and Cruden read profiles every .508 mm; a long face has ten such intervals.
    """
    is_long, spacing = facts["extent"] >= 10 * lag, facts["spacing"]
    if is_long and spacing > lag:
        readings, distance = quantity_text(lag, "m"), quantity_text(spacing, "m")
        message = (
            f"JRC is left out: its readings are {readings} apart, and the points of this face {distance}"
        )
        warn(message, FractalContactWarning)
    return {"has_jrc": is_long and spacing <= lag}


def _slope(surface: xr.DataArray, options: Mapping[str, Any]) -> float:
    """Return the rms slope of a surface as the scene presses it: without spikes and tilt that it removes."""
    from fractalcontact import surfaces

    if options.get("despike"):
        surface = surfaces.despike(surface)
    if options.get("level"):
        surface = surfaces.level(surface, options["level"])
    return float(surfaces.describe(surface)["rms_slope"])


def _loads(slope: float, young: Any, poisson: float) -> dict[str, Any]:
    """Return the ends of the path of the load on a flat: true contact of a thousandth and of a fifth."""
    # a fraction of true contact needs about half of it times modulus and rms slope (Bush; Persson)
    modulus = 0.5 * float(young) / (1.0 - poisson**2)
    unit = 0.5 * modulus * max(slope, 1e-12)  # of a flat surface: above 0
    return {"first": _rounded(1e-3 * unit), "last": _rounded(0.2 * unit)}


def _travel(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Return the block of a joint, its shears, and the range of its travel."""
    block = facts["spacing"] * math.floor(0.6 * facts["extent"] / facts["spacing"])
    step = facts["cell"]
    # a block in the middle can slide by .2 of the extent either way, farther than .15
    farthest = step * math.floor(0.15 * facts["extent"] / step)
    shears = [0.0, *(_rounded(step * max(1, round(share * farthest / step))) for share in (0.1, 0.3, 1.0))]
    return {
        "block": _rounded(block),
        "shears": sorted(set(shears)),
        "farthest": _rounded(farthest),
        "step": _rounded(max(step, farthest / 60)),  # 60 points cost milliseconds
    }


def _rounded(value: float) -> float:
    return float(f"{value:.9g}")


def _toml(value: Any) -> str:
    """Return a value as TOML."""
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_toml, value))}]"
    return json.dumps(value)
