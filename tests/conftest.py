"""What every test may ask for."""

import os
from pathlib import Path

import pytest

DATA = "FRACTALCONTACT_DATA"


@pytest.fixture(scope="session")
def measured():
    """Return the folder of measured surfaces; skip where the machine has none."""
    folder = os.environ.get(DATA)
    if not folder:
        pytest.skip(f"{DATA} is not set: no measured surfaces on this machine")
    return Path(folder)


@pytest.fixture(scope="session")
def compliance():
    """Return a function that gives the findings of the CF checker for a flat file."""
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from compliance_checker.runner import CheckSuite

        CheckSuite.load_all_available_checkers()

    def findings(path):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            suite = CheckSuite()
            dataset = suite.load_dataset(str(path))
            groups, errors = suite.run_all(dataset, ["cf:1.11"], [])["cf:1.11"]
            dataset.close()
        assert not errors
        return [message for group in groups for message in _messages(group)]

    def _messages(group):
        value = group.value
        passed = value[0] == value[1] if isinstance(value, tuple) else bool(value)
        return [] if passed else list(group.msgs or [group.name])

    return findings
