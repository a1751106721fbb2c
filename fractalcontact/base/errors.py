"""The exceptions and warnings of the package, one class for each cause."""

from collections.abc import Sequence


class FractalContactError(Exception):
    """Anything this package raises on purpose."""


class InvalidInput(FractalContactError, ValueError):
    """The call cannot be carried out as asked; lists every problem found.

    Attributes
    ----------
    where : str
        The public name that was called, or the file that was read.
    problems : tuple of str
        One line for each problem: the argument, what was expected, what came.
    """

    def __init__(self, where: str, problems: Sequence[str]) -> None:
        self.where = where
        self.problems = tuple(problems)
        super().__init__(where, self.problems)

    def __str__(self) -> str:
        """Put each problem on a line of its own."""
        return "\n".join(
            [f"{self.where}: {_count(len(self.problems))}", *(f"  - {p}" for p in self.problems)]
        )


class UnreadableFile(InvalidInput):
    """A file is corrupt, of an unknown format, or lacks what is needed to read it in metres."""


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
        super().__init__(purpose, library, extra)  # all of them, for a copy is made from these

    def __str__(self) -> str:
        """Say what is missing, and how to come by it."""
        purpose, library, extra = self.args
        return f"{purpose} needs {library}: pip install 'fractalcontact[{extra}]'"


class FractalContactWarning(UserWarning):
    """A result is given, and the caller should know something about it."""


class ScaleWarning(FractalContactWarning):
    """The size or the heights of a surface are implausible for the instrument: check its units."""


class ConvergenceWarning(FractalContactWarning):
    """At least one step stopped before its tolerance was met; `converged` says which."""


def _count(number: int) -> str:
    return "1 problem" if number == 1 else f"{number} problems"
