import plotting_synthetic
import pytest


@pytest.fixture(scope="session")
def study():
    """A complete synthetic study; tests must not change it."""
    return plotting_synthetic.study()
