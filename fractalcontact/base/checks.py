"""Checking arguments: every problem is collected, and all are raised at once.

    with Problems("fc.contact.press") as problems:
        modulus = problems.number("contact_modulus", contact_modulus, above=0)
        problems.choice("method", method, ("fast", "elimination"))

leaves the block with valid values, or raises one `InvalidInput` that names everything wrong.
Inside the block a value that failed its check is a harmless stand-in, never to be used after it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextvars import ContextVar
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base import validation
from fractalcontact.base.errors import InvalidInput

if TYPE_CHECKING:
    import xarray as xr


LARGEST_WHOLE = 1 << 53  # beyond it a double knows no neighbours


_depth: ContextVar[int | None] = ContextVar("depth", default=None)  # of blocks in what is rehearsed


class _Checked(BaseException):
    """A call has passed its checks, and need go no further."""


def rehearse(function: Callable[..., Any], *arguments: Any, **options: Any) -> None:
    """Call a function as far as its checks and no further; raise what they raise.

    Raises
    ------
    InvalidInput
        What is wrong with the call.
    """
    if hasattr(function, "validate"):  # see `base.results.public_result`
        function.validate(*arguments, **options)
        return
    depth = _depth.set(0)
    try:
        function(*arguments, **options)
    except _Checked:
        pass
    finally:
        _depth.reset(depth)


class Problems(validation.Problems):
    """Collects what is wrong with a call; raises it all on leaving the `with` block."""

    def __init__(self, where: str, error: type[InvalidInput] = InvalidInput) -> None:
        self.where = where
        self.error = error
        self.messages: list[str] = []

    def __enter__(self) -> Problems:
        if (depth := _depth.get()) is not None:
            _depth.set(depth + 1)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if (depth := _depth.get()) is not None:
            _depth.set(depth - 1)
        if isinstance(value, InvalidInput):
            self.messages.extend(p for p in value.problems if p not in self.messages)
            raise self.error(self.where, self.messages) from value
        if kind is None and self.messages:
            raise self.error(self.where, self.messages)
        if kind is None and depth == 1:
            raise _Checked

    def add(self, argument: str, expected: str, got: object) -> None:
        """Note that `argument` should have been `expected` and was `got`."""
        self.messages.append(f"{argument}: expected {expected}, got {_shown(got)}")

    def require(self, condition: bool, argument: str, expected: str, got: object) -> bool:
        """Note a problem unless `condition` holds; return the condition."""
        if not condition:
            self.add(argument, expected, got)
        return bool(condition)

    def number(  # type: ignore[override]
        self,
        argument: str,
        value: Any,
        *,
        above: float | None = None,
        at_least: float | None = None,
        below: float | None = None,
        at_most: float | None = None,
    ) -> float:
        """One finite real number inside the given bounds."""
        values = self.numbers(argument, value, above=above, at_least=at_least, below=below, at_most=at_most)
        axes = axes_of(value)
        if values.size != 1 or axes != 0:
            if axes != 0:
                self.add(argument, "one number", value)
            return 1.0
        return float(values[0])

    def numbers(  # type: ignore[override]
        self,
        argument: str,
        value: Any,
        *,
        above: float | None = None,
        at_least: float | None = None,
        below: float | None = None,
        at_most: float | None = None,
    ) -> np.ndarray:
        """Return one or several finite real numbers inside the bounds as a 1-D float64 array."""
        expected = _interval(above, at_least, below, at_most)
        try:
            if isinstance(value, (bool, str, bytes)) or np.iscomplexobj(value):
                raise TypeError
            values = np.atleast_1d(np.asarray(value, dtype=np.float64))
        except (TypeError, ValueError, OverflowError):
            self.add(argument, expected, value)
            return np.ones(1)
        if values.ndim > 1:
            self.add(argument, "a number or a 1-D sequence", f"an array of shape {values.shape}")
            return np.ones(1)
        if values.size == 0:
            self.add(argument, expected, "an empty sequence")
            return np.ones(1)
        good = np.isfinite(values)
        good &= True if above is None else values > above
        good &= True if at_least is None else values >= at_least
        good &= True if below is None else values < below
        good &= True if at_most is None else values <= at_most
        if not good.all():
            self.add(argument, expected, values[~good][0] if values.size > 1 else values[0])
        return np.where(good, values, _stand_in(above, at_least, below, at_most))

    def integer(  # type: ignore[override]
        self, argument: str, value: Any, *, at_least: int | None = None, at_most: int | None = None
    ) -> int:
        """One whole number inside the given bounds."""
        whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
        inside = whole and (at_least is None or value >= at_least) and (at_most is None or value <= at_most)
        inside = inside and abs(value) < LARGEST_WHOLE
        if not inside:
            self.add(argument, _interval(None, at_least, None, at_most, what="a whole number"), value)
            return at_least if at_least is not None else 1
        return int(value)

    def choice(self, argument: str, value: Any, allowed: Iterable[str]) -> Any:  # type: ignore[override]
        """One of the allowed words; the first of them stands in for a wrong one."""
        words = tuple(allowed)
        if not isinstance(value, str) or value not in words:
            self.add(argument, f"one of {', '.join(map(repr, words))}{meant(value, words)}", value)
            return words[0]
        return value

    def choices(self, argument: str, value: Any, allowed: Iterable[str]) -> tuple[str, ...]:  # type: ignore[override]
        """One word or a sequence of words, each of them allowed, without repetition."""
        words = tuple(allowed)
        given = (value,) if isinstance(value, str) else value
        if not isinstance(given, (Sequence, np.ndarray)) or axes_of(given) != 1:
            self.add(argument, f"a sequence out of {', '.join(map(repr, words))}", value)
            return words[:1]
        for word in given:
            allowed_words = f"words out of {', '.join(map(repr, words))}{meant(word, words)}"
            self.require(word in words, argument, allowed_words, word)
        return tuple(dict.fromkeys(str(word) for word in given if word in words))

    def exactly_one(self, **options: object) -> str:  # type: ignore[override]
        """Return the one option that is not None."""
        given = [name for name, value in options.items() if value is not None]
        if len(given) != 1:
            self.add(" / ".join(options), "exactly one of them", given if given else "none")
            return next(iter(options))
        return given[0]

    def finite(self, argument: str, array: xr.DataArray | np.ndarray, *, remedy: str = "") -> bool:
        """All values finite; otherwise say how many are not."""
        values = np.asarray(array)
        missing = values.size - int(np.count_nonzero(np.isfinite(values)))
        expected = "finite values" + (f" ({remedy})" if remedy else "")
        return self.require(missing == 0, argument, expected, f"{missing} of {values.size} NaN or infinite")


def axes_of(value: Any) -> int | None:
    """Return how many axes a value has, 0 for one alone; None for a sequence whose rows are not alike."""
    try:
        return np.ndim(value)
    except ValueError:
        return None


def meant(word: object, words: Iterable[str]) -> str:
    """Return the one of the words that comes near a wrong one, as a question; nothing if none does."""
    from difflib import get_close_matches

    near = get_close_matches(word, tuple(words), n=1) if isinstance(word, str) else []
    return f" (did you mean {near[0]!r}?)" if near else ""


def _stand_in(
    above: float | None, at_least: float | None, below: float | None, at_most: float | None
) -> float:
    """Return a number inside the bounds."""
    if at_least is not None or at_most is not None:
        return float(at_most if at_least is None else at_least)  # type: ignore[arg-type]
    if above is not None and below is not None:
        return above + 0.5 * (below - above)
    return 1.0 if above is below is None else above + 1.0 if above is not None else below - 1.0  # type: ignore[operator]


def _interval(
    above: float | None,
    at_least: float | None,
    below: float | None,
    at_most: float | None,
    what: str = "a finite number",
) -> str:
    bounds = [
        f"{sign} {bound:g}"
        for sign, bound in ((">", above), (">=", at_least), ("<", below), ("<=", at_most))
        if bound is not None
    ]
    return " ".join([what, " and ".join(bounds)]).strip()


def _shown(value: object) -> str:
    """Return a short, one-line rendering for an error message."""
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape} and type {value.dtype}"
    if type(value).__module__.startswith("xarray"):
        return f"a {type(value).__name__} with dims {tuple(getattr(value, 'dims', ()))}"
    if isinstance(value, (np.floating, np.integer, np.bool_)):
        value = value.item()
    text = value if isinstance(value, str) and " " in value else repr(value)
    return text if len(text) <= 120 else text[:117] + "..."
