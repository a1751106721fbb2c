"""Fixtures of the tests of studies."""

import pytest


@pytest.fixture(autouse=True)
def wide_screen(monkeypatch):
    """Print tables without broken heads, whatever the terminal."""
    monkeypatch.setenv("COLUMNS", "200")
