"""Fixtures of the tests of studies."""

import math

import pytest


@pytest.fixture(autouse=True)
def wide_screen(monkeypatch):
    """Print tables without broken heads, whatever the terminal."""
    monkeypatch.setenv("COLUMNS", "200")


@pytest.fixture(autouse=True, scope="session")
def one_process():
    """Run the parts of studies in this process, where tests record their calls, however slow it is."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fractalcontact.scenes._executor.WORTH_A_COPY", math.inf)
        yield
