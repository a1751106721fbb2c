import importlib.util
from pathlib import Path

import pytest


def _load():
    spec = importlib.util.spec_from_file_location(
        "plotting_synthetic", Path(__file__).with_name("synthetic.py")
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def made():
    """The makers of synthetic results, as a module."""
    return _load()


@pytest.fixture(scope="session")
def whole_study(made):
    """A whole synthetic study; not to be changed by a test."""
    return made.study()
