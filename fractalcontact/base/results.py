"""Decorator of public functions: validation, run time, labels and provenance of their results.

    def _check(problems):
        problems.integer("connectivity", at_least=1, at_most=2)

    @public_result(title="Islands of contact", references="...", achieved_error="exact", check=_check)
    def islands(mask, *, connectivity=2):
        ...
        return xr.Dataset(variables, coords, attrs={"neighbours": 8})

The function returns plain variables and coordinates with names of `base.schema`. Attributes `comment`,
`reason` and `long_name` of a data variable are kept; the attributes of the Dataset or DataArray itself become
entries of its provenance, except `title` and `references`, which replace those of the decorator,
`parameters`, a dict that replaces recorded arguments (a default that depends on others, a path to
shorten), and `completeness`, which stays an attribute: it lists what a stopped run left out.

What a check has read of the arguments (options, a load) can be handed on: under `takes_checked` the function
takes what its check returns in front of the arguments of the call.

A problem that only the body finds is raised without the name of a function, by `base.validation.require` or
as an `InvalidInput`; the decorator adds the name of the one that was called.
"""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import wraps
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar, cast

import numpy as np
import xarray as xr

from fractalcontact.base.errors import ConvergenceWarning, InvalidInput, LoadedWarning, TooLittleMemory, warn
from fractalcontact.base.labelled import SPACING, SURFACE, usual_arguments
from fractalcontact.base.numbers import python_number
from fractalcontact.base.provenance import stamp, with_load_indexes
from fractalcontact.base.resources import (
    Estimate,
    Plane,
    bytes_on,
    has_blocks,
    loaded_bytes,
    plane_in,
    require_memory,
)
from fractalcontact.base.schema import STOP_REASONS, label
from fractalcontact.base.study import NO_REFERENCES
from fractalcontact.base.validation import Problems, did_you_mean

MASKS = ("mask", "masks", "valid")
P = ParamSpec("P")
R = TypeVar("R", xr.Dataset, xr.DataArray)
R_co = TypeVar("R_co", covariant=True)
ARRAYS = 32.0  # bytes for each cell of a call that declares nothing: four arrays
WORK = {"transforms": "pairs of transforms", "iterations": "iterations"}
NO_REASONS: Mapping[str, str] = {}


class PublicFunction(Protocol[P, R_co]):
    """A public function; its `validate` takes the same arguments and only checks them."""

    __name__: str
    __signature__: inspect.Signature
    memory: Estimate  # bytes at the peak

    def __call__(self, *arguments: P.args, **options: P.kwargs) -> R_co:
        """Compute the result."""

    def validate(self, *arguments: P.args, **options: P.kwargs) -> None:
        """Raise `InvalidInput` if the call would."""


def takes_checked(function: Callable[Concatenate[Any, P], R]) -> Callable[P, R]:
    """Declare that a function takes what its check returns as a first argument, which callers do not see."""
    signature = inspect.signature(function)
    parameters = list(signature.parameters.values())[1:]
    function.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    function.takes_checked = True  # type: ignore[attr-defined]
    return cast("Callable[P, R]", function)


def public_result(
    *,
    title: str,
    references: str = NO_REFERENCES,
    achieved_error: str | None = None,
    check: Callable[[Problems], object] | None = None,
    error: type[InvalidInput] = InvalidInput,
    in_blocks: bool = False,
    memory: Estimate = ARRAYS,
    reasons: Mapping[str, str] = NO_REASONS,
    path_figure: str = "",
) -> Callable[[Callable[P, R]], PublicFunction[P, R]]:
    """Return a decorator that validates the call of a public function and labels its result.

    Parameters
    ----------
    title : str
        Title of the result, in a few words.
    references : str
        The sources of the method; the function may replace them where they depend on its arguments.
    achieved_error : str, optional
        The error in words, for a result without a number for it.
    check : callable, optional
        Called as ``check(problems)`` before the function, with a `Problems` that has every argument, defaults
        included; its problems are raised together.
    error : type, default InvalidInput
        The exception that lists the problems.
    in_blocks : bool
        The function reads dask arrays block by block, or returns one. Any other warns that it loads them.
    memory : float or callable
        Bytes that a call takes at its peak beyond its arguments: for each cell of its largest array, or
        ``memory(plane, arguments)`` (see `base.resources`). More than may be taken is refused beforehand.
    reasons : mapping
        Why a variable of the result has NaN, by name, where the function does not state it itself.
    path_figure : str
        Variables with a space between them, of one unit, that `plotting.draw` draws along the path of load or
        shear; an attribute of the result.
    """

    def decorate(function: Callable[P, R]) -> PublicFunction[P, R]:
        signature: inspect.Signature = inspect.signature(function)
        name = public_name(function)
        hands_on = hasattr(function, "takes_checked")
        takes_spacing: bool = SURFACE in signature.parameters and SPACING not in signature.parameters

        def checked(arguments: Any, options: dict[str, Any]) -> tuple[inspect.BoundArguments, Any, str]:
            """Return the arguments of a valid call, what its check has read, what was done to the surface."""
            spacing = options.pop(SPACING, None) if takes_spacing else None
            bound = _bound(name, signature, arguments, options, [SPACING] if takes_spacing else [])
            given = bound.arguments
            done = usual_arguments(name, given, spacing)
            given.update({key: python_number(value) for key, value in given.items()})
            loaded = loaded_bytes(given)
            if loaded and not in_blocks:
                require_memory(name, loaded, _size_of(given))
            with Problems(name, error, given) as problems:
                read = None if check is None else check(problems)
            # a dask array that is read in blocks does not count
            plane = None if in_blocks and loaded else plane_in(given)
            needed = bytes_on(memory, plane or Plane((0, 0)), given)  # beyond its arguments
            require_memory(name, needed, _size_of(given))
            return bound, read, done

        def labelled(result: R, given: dict[str, Any], done: str, seconds: float) -> R:
            """Return the result with its labels, the reasons of its NaN, and its provenance."""
            entries: dict[str, Any] = {"title": title, "references": references, "run_time": seconds}
            entries |= {} if achieved_error is None else {"achieved_error": achieved_error}
            entries |= result.attrs
            kept = {"completeness": entries.pop("completeness", None), "path_figure": path_figure or None}
            result.attrs = {key: value for key, value in kept.items() if value is not None}
            if isinstance(result, xr.Dataset):
                result = result if "run_time" in result.variables else _with_run_time(result, seconds)
            result = label(result)
            give_reasons(result, reasons)
            result = stamp(result, name, given | entries.pop("parameters", {}), **entries)
            if done:
                result.attrs["history"] += f" (surface: {done})"
            return with_load_indexes(result)

        @wraps(function)
        def call(*arguments: P.args, **options: P.kwargs) -> R:
            start = time.perf_counter()
            with _named_errors(name):
                bound, read, done = checked(arguments, options)
                if not in_blocks:
                    announce_loading(name, bound.arguments)
                result = function(*((read,) if hands_on else ()), *bound.args, **bound.kwargs)
            _warn_unconverged(name, result)
            return labelled(result, bound.arguments, done, time.perf_counter() - start)

        def validate(*arguments: P.args, **options: P.kwargs) -> None:
            with _named_errors(name):
                checked(arguments, options)

        public = cast("PublicFunction[P, R]", call)
        public.validate = validate  # type: ignore[method-assign]
        public.memory = memory
        return public

    return decorate


def _bound(
    name: str, signature: inspect.Signature, arguments: Any, options: dict[str, Any], further: Sequence[str]
) -> inspect.BoundArguments:
    """Return the arguments of a call with all defaults; of a wrong word the error names the nearest argument.

    `further` are arguments that the function does not have itself.
    """
    try:
        bound = signature.bind(*arguments, **options)
    except TypeError as cause:
        names = [*signature.parameters, *further]
        listed = f" (its arguments are {', '.join(names)})"
        wrong = [word for word in options if word not in names]
        hints = [f"{word!r} is no argument{did_you_mean(word, names) or listed}" for word in wrong]
        raise TypeError(f"{name}: {'; '.join(hints) or cause}") from None
    bound.apply_defaults()
    return bound


def _with_run_time(result: xr.Dataset, seconds: float) -> xr.Dataset:
    """Return a result with its run time; `assign`, which aligns all coordinates, takes half as long again."""
    data = {name: each for name, each in result.variables.items() if name not in result.coords}
    return xr.Dataset({**data, "run_time": seconds}, result.coords, result.attrs)


def _warn_unconverged(name: str, result: xr.Dataset | xr.DataArray, most: int = 5) -> None:
    """Warn of the values that `converged` marks: where the first are, why, and how far they came."""
    if not isinstance(result, xr.Dataset) or "converged" not in result or result["converged"].values.all():
        return
    converged = result["converged"]
    failed, shown = np.argwhere(~converged.values), []
    for index in failed[:most].tolist():
        where = dict(zip(converged.dims, index, strict=True))
        at = result.isel(where)
        values = {dim: at[dim].item() if dim in at.coords else i for dim, i in where.items()}
        places = [f"{dim} {v:g}" if isinstance(v, float) else f"{dim} {v}" for dim, v in values.items()]
        reason = converged.attrs.get("reason", "")
        if "stop_reason" in at:
            reason = list(STOP_REASONS)[int(at["stop_reason"])]
        work = next((f"after {int(at[unit])} {words}" for unit, words in WORK.items() if unit in at), "")
        error = f"(residual {float(at['residual']):.2g})" if "residual" in at else ""
        place = f"{', '.join(places)}: " if places else ""
        shown.append(place + " ".join(filter(None, [reason, work, error])))
    more = f"; and {len(failed) - most} more" if len(failed) > most else ""
    warn(f"{name}: not converged: {'; '.join(shown)}{more}", ConvergenceWarning)


def announce_loading(name: str, arguments: Mapping[str, Any]) -> None:
    """Warn that a function loads the dask arrays among its arguments; masks are read block by block."""
    for argument, value in arguments.items():
        if argument in MASKS or not isinstance(value, (xr.DataArray, xr.Dataset)) or not has_blocks(value):
            continue
        message = (
            f"{name}: the dask arrays of `{argument}` are loaded into memory, {value.nbytes / 1e6:.3g} MB"
        )
        warn(message, LoadedWarning)


def _size_of(arguments: Mapping[str, Any]) -> str:
    """Return the size of a call in words: the shape that it is given, or that of its array."""
    shape, plane = arguments.get("shape"), plane_in(arguments)
    if shape is None and plane is not None:
        shape = plane.shape if plane.planes == 1 else (plane.planes, *plane.shape)
    if shape is None:
        return "this call"
    members = f"{arguments['members']} members of " if arguments.get("members") else ""
    return f"{members}a shape of {' x '.join(map(str, np.ravel(shape)))} points"


@contextmanager
def _named_errors(name: str) -> Iterator[None]:
    """Name the function in the errors of the block that have no name; put a MemoryError into words."""
    try:
        yield
    except InvalidInput as error:
        error.where = error.where or name
        raise
    except MemoryError as error:
        got = str(error) or "a request that the system refused"
        raise TooLittleMemory.of(name, "memory", "enough for this call", got) from error


def public_name(function: Callable[..., Any]) -> str:
    """Return the name under which users call a function of a private module."""
    parts = [part for part in function.__module__.split(".") if not part.startswith("_")]
    return ".".join([*parts, function.__qualname__])


_EMPTY = "NaN where the set is empty, or the mask is too small"
_FIT = "no power law was fitted"
_OF_STATES = (
    *("spot_size", "gap_size", "domain_dimension", "excess_dimension", "clustering", "integral_range"),
    *("gap_size_ratio", "domain_dimension_change", "excess_dimension_change", "clustering_ratio"),
    *("integral_range_ratio", "lacunarity_ratio", "pair_correlation_length"),
)
_NAMES: dict[str, tuple[str, ...]] = {
    "NaN where the state has none, see signature_flag and reason, or has no state before it": (
        *(f"{name}{end}" for name in _OF_STATES for end in ("", "_low", "_high")),
        *("local_dimension_min", "local_dimension_max", "spots_dimension", "median_cells"),
        *("hit_fraction", "spots_fraction"),
    ),
    "NaN where no window of ratio 4 fits into the mask": ("window_low", "window_high"),
    "NaN where a mask is empty, or cells or ratios of spacings do not allow one": ("stationary_exponent",),
    f"NaN where {_FIT}: the set or the surface is empty, flat or too small": (
        *("scale_min", "scale_max", "fitted_hurst", "fractal_dimension", "singularity_strength"),
        *("singularity_spectrum", "mass_exponent"),
    ),
    f"NaN where the method gives no amplitude, or {_FIT}": ("rms_increment", "topothesy"),
    f"NaN where the method has no model of noise, or {_FIT}": ("noise_height",),
    f"NaN where the method has no model of blur, or {_FIT}": ("blur_spread",),
    f"NaN where the method has no test of its model, or {_FIT}": ("misfit",),
    "NaN where no run of octaves has one exponent": ("window_hurst", "window_ci_low", "window_ci_high"),
    "NaN where the heights do not vary, or too few are observed": ("hurst",),
    "NaN where no interval with tested coverage can be given": ("standard_error",),
    "NaN where too few heights are observed at this scale": (
        *("covering_area", "cube_count", "roughness", "madogram", "variogram", "second_variogram"),
        *("variation", "fluctuation", "divider_length", "higuchi_length"),
    ),
    "NaN where nothing was observed": ("coverage", "box_measure"),
    "NaN where the set is empty": (
        *("total_perimeter", "largest_island", "mean_island_area", "largest_length", "mean_island_length"),
    ),
    _EMPTY: (
        *("null_dimension", "null_spread", "mean_mass", "null_mass", "minkowski_null_dimension"),
        *("correlation_null_dimension", "lacunarity", "null_lacunarity", "normalised_lacunarity"),
    ),
    f"{_EMPTY}, or the method gives no interval": ("lacunarity_low", "lacunarity_high"),
    "NaN where a value is not positive, or stands alone": (
        *("box_local_slope", "minkowski_local_slope", "correlation_local_slope"),
    ),
    "NaN beyond the travel towards a direction": ("structure_function",),
    "NaN beyond the travel towards a direction, or where the heights of a face do not vary": ("correlation",),
    "NaN where periodic bodies stick everywhere: they move together as rigid bodies": (
        "tangential_stiffness",
    ),
    "NaN where a face has no line without gaps that is long enough to measure it": ("interpolation_error",),
    "NaN where the joint roughness coefficient is negative or missing": ("scaled_roughness_coefficient",),
    "NaN where no rotation was fitted, or too few tiles hold observed heights": ("rotation_error",),
    "NaN where the faces do not overlap, or a height is missing": ("aperture",),
    "NaN where the dilatancy is missing": ("dilatancy_angle", "friction_angle"),
    "NaN as in the data given": ("shear", "azimuth", "closure", "normal_force", "nominal_pressure"),
}
# why a number is missing, where the function states no reason itself
REASONS = {name: reason for reason, names in _NAMES.items() for name in names}


def give_reasons(result: xr.Dataset | xr.DataArray, own: Mapping[str, str]) -> None:
    """Set the attribute `reason` of every variable or coordinate with NaN that states none, in place.

    `own` are the reasons of the function that made the result; they go before those of this module.
    """
    reasons = {**REASONS, **own}
    variables = result.variables if isinstance(result, xr.Dataset) else result.coords.variables
    for name in variables.keys() & reasons.keys():
        variable = variables[name]
        stated = "reason" in variable.attrs or "NaN" in variable.attrs.get("comment", "")
        if variable.dtype.kind == "f" and not stated and np.isnan(variable.values).any():
            variable.attrs["reason"] = reasons[str(name)]
