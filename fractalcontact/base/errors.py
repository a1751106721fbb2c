"""Exceptions and warnings of the package, one class for each cause."""

import importlib.util
import inspect
import warnings
from collections.abc import Sequence
from typing import Self


class FractalContactError(Exception):
    """Base class of all exceptions of the package."""


class InvalidInput(FractalContactError, ValueError):
    """An argument or a file is invalid; lists every problem.

    Attributes
    ----------
    where : str
        The public name that was called, or the file that was read; empty until `base.results` knows it.
    problems : tuple of str
        One line for each problem: the argument, what was expected, what was given.
    """

    def __init__(self, where: str, problems: Sequence[str]) -> None:
        self.where = where
        self.problems = tuple(problems)
        super().__init__(where, self.problems)

    @classmethod
    def of(cls, where: str, argument: str, expected: str, got: object) -> Self:
        """Return the error of a single problem."""
        return cls(where, [problem_text(argument, expected, got)])

    def __reduce__(self) -> tuple[type[Exception], tuple[str, Sequence[str]]]:
        """Return what pickle makes the error again from, in another process."""
        return type(self), (self.where, self.problems)

    def __str__(self) -> str:
        """Return a line for each problem."""
        count = len(self.problems)
        head = f"{self.where}: {count} problem{'s' * (count != 1)}"
        return "\n".join([head, *(f"  - {problem}" for problem in self.problems)])


def problem_text(argument: str, expected: str, got: object) -> str:
    """Return what a problem of an argument, or of a file, is called in every error."""
    return f"{argument}: expected {expected}, got {got}"


class UnreadableFile(InvalidInput):
    """A file is corrupt, of an unknown format, or does not state its units or size."""


class TooLittleMemory(InvalidInput, MemoryError):
    """A call or a study needs more memory than this process may take; nothing was computed."""


class MissingExtra(FractalContactError, ImportError):
    """An optional library is needed and is not installed.

    Parameters
    ----------
    purpose : str
        What the library is needed for.
    library, extra : str
        The library, and the extra of this package that installs it.
    """

    def __init__(self, purpose: str, library: str, extra: str) -> None:
        super().__init__(purpose, library, extra)  # pickle rebuilds the error from all of them

    def __str__(self) -> str:
        """Return what is missing and how to install it."""
        purpose, library, extra = self.args
        return f"{purpose} needs {library}: pip install 'fractalcontact[{extra}]'"


def require_library(purpose: str, library: str, extra: str) -> None:
    """Raise `MissingExtra` unless an optional library is installed."""
    if importlib.util.find_spec(library) is None:
        raise MissingExtra(purpose, library, extra)


class FractalContactWarning(UserWarning):
    """Base class of all warnings of the package."""


class ScaleWarning(FractalContactWarning):
    """Size or heights of a surface are implausible for its instrument: check the units."""


class ConvergenceWarning(FractalContactWarning):
    """At least one load step did not reach its tolerance; see the variable `converged`."""


class SmallStrainWarning(FractalContactWarning):
    """The slopes of a pressed surface are beyond small strains; see the variable `rms_slope`."""


class AnisotropyWarning(FractalContactWarning):
    """A method for isotropic contacts is used on one with a lay; see the variable `superposition_error`."""


class LoadedWarning(FractalContactWarning):
    """A dask array is loaded into memory by a function that needs all of it."""


def warn(message: str, category: type[FractalContactWarning]) -> None:
    """Warn at the line of the caller's own code, the nearest one outside this package."""
    frame, level = inspect.currentframe(), 1
    while frame is not None and frame.f_globals.get("__name__", "").startswith("fractalcontact."):
        frame, level = frame.f_back, level + 1
    warnings.warn(message, category, stacklevel=level)
