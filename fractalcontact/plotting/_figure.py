"""What all figures share: checked options, the end of their docstrings, and what a study needs for one."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, ParamSpec, TypeAlias, TypeVar

import numpy as np
import xarray as xr

from fractalcontact.base.numbers import is_real, real_numbers
from fractalcontact.base.validation import Problems, Words
from fractalcontact.plotting._units import UNITS_EXPECTED

P = ParamSpec("P")
R = TypeVar("R")
Test: TypeAlias = Callable[[Any], bool]
# of the data and of what stands beside them; returns Axes, or several
Drawing: TypeAlias = Callable[..., Any]


class StudyFigure(NamedTuple):
    """A figure of a study: its file, the group and the variable it is drawn from, the drawing and its needs.

    Without a variable it is drawn from any Dataset. The `dims` are longer than one; options of the drawing
    take the groups that `beside` names. Each module of figures ends with its own, and `_draw` has all.
    """

    file: str
    group: str
    variable: str
    draw: Drawing
    dims: tuple[str, ...] = ()
    beside: Mapping[str, str] = {}


# of options, where the docstring of a figure does not explain them itself
PARAGRAPHS = {
    "against": """against : str, optional
    Variable on the x axis: nominal_pressure, normal_force, closure or shear. Default: the load that was
    prescribed, or shear where the result has a single step.""",
    "shear": """shear : float, optional
    Shear displacement (m) of the load path; the nearest one is taken. Default: the middle one.""",
    "normal_force": """normal_force : float, optional
    Normal force (N) under which states along shear are shown; the nearest step is taken. Default: the last
    step.""",
    "reach": """reach : float, optional
    Largest shear displacement (m) to show.""",
    "units": """units : mapping of str to str, optional
    Unit of each variable by name, `{"closure": "mm"}` if the data have it. Default: a suitable prefix.""",
    "ax": """ax : Axes, optional
    Default: those of a new figure.""",
    "axes": """axes : array of Axes, Figure or SubFigure, optional
    The Axes of the panels, or a figure to make them in. Default: a new figure.""",
}
ENDING = """
Returns
-------
{returned}

Raises
------
InvalidInput
    A variable is missing, the result has a further dimension, or an option is not as described."""


def figure(function: Callable[P, R]) -> Callable[P, R]:
    """Check the options of a figure before anything is drawn, and complete its docstring at `{shared}`."""
    signature = inspect.signature(function)

    @functools.wraps(function)
    def wrapper(*arguments: P.args, **options: P.kwargs) -> R:
        where = f"fc.plotting.{function.__name__}"
        with Problems(where) as problems:
            for name, value in signature.bind(*arguments, **options).arguments.items():
                if value is not None or signature.parameters[name].default is not None:
                    expected, is_valid = OPTIONS.get(name, LABELLED)
                    shown = value if name in OPTIONS else Words(type(value).__name__)
                    problems.require(is_valid(value), name, expected, shown)
        with Problems(where):  # what is raised in the block names this function
            return function(*arguments, **options)

    if function.__doc__:
        text = inspect.cleandoc(function.__doc__)
        names = [name for name in PARAGRAPHS if name in signature.parameters and f"\n{name} :" not in text]
        ending = ENDING.replace("{returned}", "Axes" if "ax" in names else "array of Axes")
        wrapper.__doc__ = text.replace("{shared}", "\n".join([*(PARAGRAPHS[name] for name in names), ending]))
    return wrapper


def _is_axes(value: Any) -> bool:
    from matplotlib.axes import Axes

    return isinstance(value, Axes)


def _are_panels(value: Any) -> bool:
    from matplotlib.figure import FigureBase

    if isinstance(value, (list, tuple, np.ndarray)):
        return all(map(_is_axes, np.ravel(np.asarray(value, dtype=object))))
    return isinstance(value, FigureBase)


def _are_numbers(value: Any) -> bool:
    values = real_numbers(value) if isinstance(value, (list, tuple, np.ndarray)) else None
    return values is not None and np.ndim(value) == 1 and bool(np.isfinite(values).all())


def _is_number(value: Any) -> bool:
    return is_real(value) and _are_numbers([value])  # a labelled number would carry its dims into the figure


def _are_words(value: Any) -> bool:
    return isinstance(value, (list, tuple)) and all(isinstance(word, str) for word in value)


LABELLED: tuple[str, Test] = (
    "a labelled result (Dataset, DataArray or node of a DataTree)",
    lambda value: isinstance(value, (xr.DataArray, Mapping)),
)
# what is expected of an option, which has one meaning in all figures; any other argument is labelled data
OPTIONS: dict[str, tuple[str, Test]] = {
    **dict.fromkeys(("shear", "normal_force", "reach", "zoom", "truth"), ("one finite number", _is_number)),
    **dict.fromkeys(
        ("key", "log", "shaded", "maps"), ("True or False", lambda value: isinstance(value, (bool, np.bool_)))
    ),
    **dict.fromkeys(("against", "title", "band_name"), ("words", lambda value: isinstance(value, str))),
    "ax": ("an Axes, or None", _is_axes),
    "axes": ("a sequence of Axes, a Figure or SubFigure, or None", _are_panels),
    "band": ("two numbers", lambda value: _are_numbers(value) and len(value) == 2),
    "block": ("a DataArray with x and y", lambda value: isinstance(value, xr.DataArray)),
    "direction": (
        "a word or degrees anticlockwise from E",
        lambda value: isinstance(value, str) or _is_number(value),
    ),
    "marked": ("a sequence of numbers", _are_numbers),
    "panels": (
        "an integer >= 1",
        lambda value: is_real(value) and isinstance(value, (int, np.integer)) and bool(value >= 1),
    ),
    "units": UNITS_EXPECTED,
    "variable": (
        "the name of a variable, or several",
        lambda value: isinstance(value, str) or (_are_words(value) and bool(value)),
    ),
}
