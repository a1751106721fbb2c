"""Fixtures of the tests of studies."""

import pytest
from matplotlib.figure import Figure


@pytest.fixture(autouse=True)
def wide_screen(monkeypatch):
    """Print tables without broken heads, whatever the terminal."""
    monkeypatch.setenv("COLUMNS", "200")


@pytest.fixture(autouse=True, scope="module")
def empty_figures():
    """Write the files of the figures without their content, which `tests/plotting` tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fractalcontact.plotting._draw._draw_row", lambda row, tree: Figure((1.0, 1.0)))
        patch.setattr("fractalcontact.plotting._draw.draw_with_band", lambda drawings, members: drawings[0]())
        yield


@pytest.fixture(autouse=True, scope="module")
def one_process():
    """Run the parts of studies in this process, where tests record their calls, however slow it is."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FRACTALCONTACT_THREADS", "1")
        yield
