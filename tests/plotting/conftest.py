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
