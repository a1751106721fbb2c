"""Argument validation: all problems of a call are collected and raised in one error.

    with Problems("fractalcontact.contact.press") as problems:
        problems.number("contact_modulus", contact_modulus, above=0)
        problems.choice("method", method, ("fast", "elimination"))

A check returns True or False and converts nothing. At the end of the block one `InvalidInput` lists every
problem; if there is none, all values are valid. A check that needs valid values depends on the others:

        if problems.surface("surface", surface) and problems.number("lag", lag, above=0):
            problems.require(lag < extent, "lag", f"less than {extent:g} m", lag)

The check of a public function (see `base.results`) finds the arguments of the call in `problems.given`, and a
check without a value takes that of the argument:

    def _check(problems):
        problems.number("contact_modulus", above=0)
        problems.choice("method", among=("fast", "elimination"))
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from os import R_OK, PathLike, access, fsencode, fspath
from pathlib import Path
from types import SimpleNamespace, TracebackType
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from fractalcontact.base.errors import InvalidInput, TooLittleMemory, UnreadableFile, problem_text
from fractalcontact.base.numbers import is_real, number_of_axes, real_numbers

if TYPE_CHECKING:
    import xarray as xr

    from fractalcontact.base.grid import Grid

T = TypeVar("T")
# bounds of numbers, in the order of their words
COMPARISONS = {
    "above": (">", np.greater),
    "at_least": (">=", np.greater_equal),
    "below": ("<", np.less),
    "at_most": ("<=", np.less_equal),
}
LARGEST_INTEGER = 1 << 53  # larger integers are not all representable as float64


class Words(str):
    """A description of what was given, which an error message shows without quotation marks."""


NONE = Words("none")  # where a value is missing
GIVEN = Words("the argument of the call")  # in place of a value to check


class Problems:
    """Collects the problems of a call and raises them all on leaving the `with` block.

    Parameters
    ----------
    where : str
        Public name of the function that is called, or the file that is read.
    error : type, default InvalidInput
        The exception to raise.
    arguments : mapping, optional
        The arguments of the call, by name.

    Attributes
    ----------
    given : namespace
        The arguments of the call.
    messages : list of str
        One line for each problem, so far.
    arguments : list of str
        The arguments that `add` noted, so far.
    """

    def __init__(
        self, where: str, error: type[InvalidInput] = InvalidInput, arguments: Mapping[str, Any] | None = None
    ) -> None:
        self.where = where
        self.error = error
        self.given = SimpleNamespace(**(arguments or {}))
        self.messages: list[str] = []
        self.arguments: list[str] = []

    def __enter__(self) -> Problems:
        return self

    def __exit__(
        self, error_type: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if isinstance(value, InvalidInput) and not isinstance(value, TooLittleMemory):
            self._extend(value.problems)
            raise self.error(self.where, self.messages) from value
        if error_type is None and self.messages:
            raise self.error(self.where, self.messages)

    def add(self, argument: str, expected: str, got: object = GIVEN) -> None:
        """Note that `argument` should have been `expected` and was `got`."""
        got = self._value(argument, got)
        self.note(argument, problem_text(argument, expected, _shown(got)))

    def note(self, argument: str, message: str) -> None:
        """Note a problem of an argument in words that are ready."""
        self.arguments.append(argument)
        self._extend([message])

    @contextmanager
    def collect(self, prefix: str = "") -> Iterator[None]:
        """Collect the problems of an `InvalidInput` raised in the block, and continue after it.

        Use it around the construction of options that validate themselves, so that the problems of several
        are raised together.
        """
        try:
            yield
        except InvalidInput as error:
            self._extend(f"{prefix}{line}" for line in error.problems)

    def construct(self, constructor: Callable[..., T], *arguments: Any, **options: Any) -> T | None:
        """Return what `constructor` makes of the arguments; None if it has problems, which are collected."""
        with self.collect():
            return constructor(*arguments, **options)
        return None

    def _extend(self, lines: Iterable[str]) -> None:
        self.messages.extend(line for line in lines if line not in self.messages)

    def _value(self, argument: str, value: Any) -> Any:
        """Return a value to check: that of the argument of the call unless there is another."""
        return getattr(self.given, argument) if value is GIVEN else value

    def require(self, condition: bool, argument: str, expected: str, got: object = GIVEN) -> bool:
        """Note a problem unless `condition` holds; return the condition."""
        if not condition:
            self.add(argument, expected, got)
        return bool(condition)

    def number(self, argument: str, value: Any = GIVEN, *, optional: bool = False, **bounds: Any) -> bool:
        """Check for one finite real number inside the bounds; `optional` allows None.

        The bounds are `above`, `at_least`, `below` and `at_most`.
        """
        value = self._value(argument, value)
        if value is None and optional:
            return True
        if number_of_axes(value) != 0:
            self.add(argument, "one number", value)
            return False
        return self.numbers(argument, value, **bounds)

    def numbers(
        self,
        argument: str,
        value: Any = GIVEN,
        *,
        optional: bool = False,
        integral: bool = False,
        any_shape: bool = False,
        **bounds: float | None,
    ) -> bool:
        """Check for one or several finite real numbers inside the bounds; `float_array` converts them.

        With `integral` they must be integers, of any numeric type; `any_shape` allows several dims.
        """
        value = self._value(argument, value)
        if value is None and optional:
            return True
        expected = _interval("a finite number", **bounds)
        values = real_numbers(value)
        if values is None or values.size == 0:
            self.add(argument, expected, value if values is None else "an empty sequence")
            return False
        if values.ndim > 1 and not any_shape:
            self.add(argument, "a number or a 1-D sequence", f"an array of shape {values.shape}")
            return False
        good = np.isfinite(values)
        for name, bound in bounds.items():
            good &= True if bound is None else COMPARISONS[name][1](values, bound)
        if not good.all():
            self.add(argument, expected, values[~good][0])
        if integral:
            fractional = np.isfinite(values) & (values != np.rint(values))
            if fractional.any():
                self.add(argument, "integers", values[fractional][0])
            good &= ~fractional
        return bool(good.all())

    def integer(
        self,
        argument: str,
        value: Any = GIVEN,
        *,
        at_least: int | None = None,
        at_most: int | None = None,
        optional: bool = False,
    ) -> bool:
        """Check for one integer inside the bounds; `optional` allows None."""
        value = self._value(argument, value)
        if value is None and optional:
            return True
        inside = False
        if is_real(value) and isinstance(value, (int, np.integer)):
            low = -LARGEST_INTEGER if at_least is None else at_least
            high = LARGEST_INTEGER if at_most is None else at_most
            inside = low <= int(value) <= high
            at_most = high if int(value) > high else at_most
        return self.require(
            inside, argument, _interval("an integer", at_least=at_least, at_most=at_most), value
        )

    def boolean(self, argument: str, value: Any = GIVEN, *, optional: bool = False) -> bool:
        """Check for True or False; `optional` allows None."""
        value = self._value(argument, value)
        valid = isinstance(value, (bool, np.bool_)) or (optional and value is None)
        return self.require(valid, argument, "None, True or False" if optional else "True or False", value)

    def choice(
        self, argument: str, value: Any = GIVEN, among: Iterable[str] = (), *, optional: bool = False
    ) -> bool:
        """Check for one of the allowed words; `optional` allows None."""
        value, words = self._value(argument, value), tuple(among)
        valid = (isinstance(value, str) and value in words) or (optional and value is None)
        if valid:
            return True
        return self.require(False, argument, f"one of {_quoted(words)}{did_you_mean(value, words)}", value)

    def choices(
        self, argument: str, value: Any = GIVEN, among: Iterable[str] = (), *, optional: bool = False
    ) -> bool:
        """Check for one word or a sequence of words, each of them allowed; `word_tuple` converts them."""
        value, words = self._value(argument, value), tuple(among)
        if value is None and optional:
            return True
        if not isinstance(value, (str, list, tuple)) and not (
            isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in "UO"
        ):
            self.add(argument, f"a sequence of any of {_quoted(words)}", value)
            return False
        wrong = [word for word in word_list(value) if not isinstance(word, str) or word not in words]
        for word in wrong:
            self.add(argument, f"any of {_quoted(words)}{did_you_mean(word, words)}", word)
        return not wrong

    def exactly_one(self, **options: object) -> bool:
        """Check that one of the options is given and the others are None; `given_option` returns it."""
        names = [name for name, value in options.items() if value is not None]
        return self.require(len(names) == 1, " / ".join(options), "exactly one of them", names or NONE)

    def finite(self, argument: str, array: xr.DataArray | np.ndarray, *, remedy: str = "") -> bool:
        """Check that all values are finite; otherwise report how many are not."""
        from fractalcontact.base.grid import missing_faults  # loads xarray

        return self._add_all(missing_faults(np.asarray(array), argument, remedy))

    def not_infinite(self, argument: str, values: np.ndarray, what: str = "heights") -> bool:
        """Check that values are finite, or missing (NaN, masked); otherwise report how many are infinite."""
        infinite = int(np.count_nonzero(np.ma.filled(np.isinf(values), False)))
        expected = f"finite {what}, or NaN where missing"
        return self.require(infinite == 0, argument, expected, f"{infinite} infinite")

    def path(self, argument: str, value: Any = GIVEN, *, what: str = "the path of a file") -> bool:
        """Check for the path of a file: text or a `pathlib.Path` that a file system can hold."""
        value = self._value(argument, value)
        text = fspath(value) if isinstance(value, PathLike) else value
        if not isinstance(text, str) or text == "" or "\0" in text:
            return self.require(False, argument, what, value)
        try:
            name = fsencode(text)
        except UnicodeEncodeError:
            return self.require(False, argument, f"{what}, in letters that Unicode has", ascii(text))
        longest = max(map(len, name.split(b"/")))
        fits = longest <= 255 and len(name) < 4096  # what file systems hold (NAME_MAX, PATH_MAX)
        return self.require(fits, argument, "names of at most 255 bytes", f"{longest} bytes")

    def file(self, argument: str, value: Any = GIVEN) -> bool:
        """Check for the path of a regular file that may be read; a device or a pipe is none."""
        value = self._value(argument, value)
        if not self.path(argument, value):
            return False
        what = "an existing file"
        name = Path(value).name
        try:
            is_file, is_folder = Path(value).is_file(), Path(value).is_dir()
        except OSError as error:  # a folder on the way may not be searched
            return self.require(False, argument, what, Words(f"{name!r}: {error.strerror}"))
        if not self.require(is_file, argument, what, Words(f"the folder {name!r}") if is_folder else name):
            return False
        may_read = access(value, R_OK)
        got = Words(f"{name!r}: no permission to read it")
        return self.require(may_read, argument, f"{what} that may be read", got)

    def surface(self, argument: str, value: Any = GIVEN, **options: Any) -> bool:
        """Check for heights in metres on a uniform grid; `base.grid.read_grid` then reads the grid.

        The options are those of `base.grid.surface_faults`.
        """
        from fractalcontact.base.grid import surface_faults  # loads xarray

        return self._add_all(surface_faults(self._value(argument, value), argument, **options))

    def grid(self, argument: str, value: Any = GIVEN, *, dims: Sequence[str] = ("y", "x")) -> bool:
        """Check that `dims` are the last dims of a DataArray and have uniform coordinates in metres."""
        from fractalcontact.base.grid import grid_faults  # loads xarray

        return self._add_all(grid_faults(self._value(argument, value), argument, dims))

    def tree(self, argument: str, value: Any = GIVEN) -> bool:
        """Check for the DataTree of a study."""
        expected = "a DataTree, from fractalcontact.scenes.run or fractalcontact.open"
        value = self._value(argument, value)
        return self.require(hasattr(value, "subtree"), argument, expected, value)

    def result(self, argument: str, value: Any = GIVEN) -> bool:
        """Check that a labelled result has the dims, types and units of the schema."""
        from fractalcontact.base.grid import result_faults  # loads xarray

        return self._add_all(result_faults(self._value(argument, value), argument))

    def _add_all(self, faults: Iterable[tuple[str, str, object]]) -> bool:
        """Note every fault; return whether there is none."""
        before = len(self.messages)
        for fault in faults:
            self.add(*fault)
        return len(self.messages) == before

    def periodic(self, grid: Grid, value: Any = GIVEN) -> bool:
        """Check the argument `periodic` (None, True, False); `base.grid.periodic_axes` then applies it.

        A periodic axis may be declared free, never the reverse; True therefore needs every axis to be
        periodic, except where the array has no coordinates.
        """
        value = self._value("periodic", value)
        if not self.boolean("periodic", value, optional=True):
            return False
        allowed = not value or not grid.has_coordinates or all(grid.periodic)
        expected = "periodic axes (attribute `period` of x and y equal to n * spacing)"
        return self.require(allowed, "periodic", expected, value)


def require(condition: bool, argument: str, expected: str, got: object = NONE) -> None:
    """Raise `InvalidInput` unless `condition` holds; `public_result` names the function that was called."""
    with Problems("") as problems:
        problems.require(condition, argument, expected, got)


@contextmanager
def reading(where: str, path: str | PathLike[str]) -> Iterator[None]:
    """Raise `UnreadableFile` for an error of the file system in the block: no permission, a bad disk."""
    try:
        yield
    except OSError as error:
        message = f"path: {Path(path).name!r} cannot be read: {error.strerror or error}"
        raise UnreadableFile(where, [message]) from error


@contextmanager
def writing(where: str, argument: str, path: str | PathLike[str]) -> Iterator[None]:
    """Raise `InvalidInput` for an error of the file system in the block: a file in the way, a full disk."""
    try:
        yield
    except OSError as error:
        message = f"{argument}: {Path(path).name!r} cannot be written here: {error.strerror or error}"
        raise InvalidInput(where, [message]) from error


def word_list(value: Any) -> list[Any]:
    """Return one word, or a sequence of words, as a list."""
    return [value] if isinstance(value, str) else list(value)


def word_tuple(value: Any) -> tuple[str, ...]:
    """Return words that passed `Problems.choices`, without repetition; none for None."""
    return () if value is None else tuple(dict.fromkeys(str(word) for word in word_list(value)))


def given_option(**options: Any) -> tuple[str, Any]:
    """Return name and value of the one option that is not None (see `Problems.exactly_one`)."""
    return next((name, value) for name, value in options.items() if value is not None)


def did_you_mean(word: object, words: Iterable[str]) -> str:
    """Return a question that names the allowed word nearest to a wrong one, or nothing."""
    near = get_close_matches(word, tuple(words), n=1) if isinstance(word, str) else []
    return f" (did you mean {near[0]!r}?)" if near and near[0] != word else ""


def _interval(what: str, **bounds: float | None) -> str:
    """Return what is expected between bounds, in words."""
    limits = [(sign, bounds[name]) for name, (sign, _) in COMPARISONS.items() if bounds.get(name) is not None]
    return " ".join([what, " and ".join(f"{sign} {bound:g}" for sign, bound in limits)]).strip()


def _quoted(words: Iterable[str]) -> str:
    return ", ".join(map(repr, words))


def _shown(value: object) -> str:
    """Return a short, one-line rendering for an error message."""
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape} and type {value.dtype}"
    if type(value).__module__.startswith("xarray"):
        return f"a {type(value).__name__} with dims {tuple(getattr(value, 'dims', ()))}"
    if isinstance(value, (np.floating, np.integer, np.bool_)):
        value = value.item()
    in_words = isinstance(value, Words) or (isinstance(value, str) and " " in value)
    try:
        text = str(value) if in_words else repr(value)
    except Exception:  # more than 4300 digits, lists nested too deeply, an object that cannot be shown
        return f"a value of type {type(value).__name__} that cannot be shown"
    text = " ".join(text.encode("utf-8", "backslashreplace").decode().split())
    return text if len(text) <= 120 else text[:117] + "..."  # about a line
