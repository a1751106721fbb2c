from pathlib import Path

import plotting_synthetic
import pytest


@pytest.fixture(scope="session")
def study():
    """A complete synthetic study; tests must not change it."""
    return plotting_synthetic.study()


@pytest.fixture(autouse=True, scope="module")
def one_process():
    """Draw the figures of a study in this process: a copy of it is made for few of them only."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FRACTALCONTACT_THREADS", "1")
        yield


@pytest.fixture(autouse=True)
def _style_of_the_files():
    """Draw in the style of the files; close what pyplot keeps."""
    from matplotlib import pyplot as plt

    with plt.style.context("fractalcontact.plotting.report"):
        yield
    plt.close("all")


@pytest.fixture
def empty_files(monkeypatch):
    """Write the files of figures empty: neither are panels arranged, nor are pixels drawn."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    monkeypatch.setattr(FigureCanvasAgg, "print_png", lambda _, path, **options: Path(path).touch())
    monkeypatch.setattr(ConstrainedLayoutEngine, "execute", lambda _, figure: None)
