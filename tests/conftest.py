"""Options and fixtures that every test may use."""

import copy
import datetime
import functools
import gc
import inspect
import os
import re
from pathlib import Path

import pytest

# Tests run on as many processes as there are processors: further threads of OpenBLAS would only wait for each
# other, and burn a processor while they do. Set before NumPy is imported, and inherited by every process.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

DATA = "FRACTALCONTACT_DATA"
STRICT = "FRACTALCONTACT_STRICT_SKIPS"
# programs that are used where they are installed, and are never required: other solvers, a browser
NOT_REQUIRED = ("tamaas", "ContactMechanics", "aspher", "Chromium")


def pytest_addoption(parser):
    parser.addoption(
        "--strict-skips",
        action="store_true",
        default=bool(os.environ.get(STRICT)),
        help=f"fail every test that is skipped for a missing library or missing data (or set {STRICT}=1)",
    )
    parser.addoption("--seed", type=int, default=int(f"{datetime.date.today():%Y%m%d}"), help="of tests/fuzz")
    more = "draw N times as many damaged calls, files and scenes"
    parser.addoption("--fuzz", type=int, default=1, metavar="N", help=more)


def pytest_report_header(config):
    """Print the seed at the head of a run."""
    return f"tests/fuzz: --seed={config.getoption('--seed')}"


def _fail_if_skipped(report, config):
    """Turn a skip into a failure, in strict mode."""
    if report.skipped and config.getoption("--strict-skips") and not hasattr(report, "wasxfail"):
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
        if not any(name in reason for name in NOT_REQUIRED):
            report.outcome = "failed"
            report.longrepr = f"skipped, which strict mode does not allow: {reason}"
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    return _fail_if_skipped((yield), item.config)


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector):
    return _fail_if_skipped((yield), collector.config)


@pytest.hookimpl(wrapper=True)
def pytest_collection(session):
    """Collect without the garbage collector, and leave the tests and libraries out of its later passes.

    They live to the end; to go through their half a million objects again and again took a tenth of the time.
    So do the caches that tests fill: with the usual 700 objects between passes these take 8 % of the tests of
    figures, with 20 000 half of that.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(20_000)
        gc.enable()


@pytest.fixture(scope="session")
def measured():
    """Return the folder of measured surfaces; skip where the machine has none."""
    folder = os.environ.get(DATA)
    if not folder:
        pytest.skip(f"{DATA} is not set: no measured surfaces on this machine")
    return Path(folder)


def _remembering(function):
    """Return a function or method of a dataset that keeps its result for the last one it was called with."""
    last = [None, None]

    def remember(*owner_and_dataset):
        if last[0] is not owner_and_dataset[-1]:
            last[:] = owner_and_dataset[-1], function(*owner_and_dataset)
        return copy.copy(last[1])

    return remember


PRESSURE_AS_HEIGHT = re.compile(r"recommended order .* nominal_pressure \(Z\), y \(U\), x \(U\)", re.DOTALL)


@pytest.fixture(scope="session")
def compliance():
    """Return a function that lists the findings of the CF checker for a flat file."""
    import warnings
    from importlib.util import find_spec

    if find_spec("compliance_checker") is None:
        pytest.skip("could not import 'compliance_checker': the files are not checked against CF")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from compliance_checker.runner import CheckSuite

        CheckSuite.load_all_available_checkers()
        from compliance_checker.cf import util
        from compliance_checker.cf.cf_base import CFBaseCheck

    # the checker looks for the axes of a file thousands of times, and reads its table of names for each file
    for name, function in inspect.getmembers(util, inspect.isfunction):
        if name.startswith("get_") and len(inspect.signature(function).parameters) == 1:
            setattr(util, name, _remembering(function))
    for name in ("ancillary", "coord", "geophysical"):  # looked for again wherever there are none
        name = f"_find_{name}_vars"
        setattr(CFBaseCheck, name, _remembering(getattr(CFBaseCheck, name)))
    util.StandardNameTable = functools.cache(util.StandardNameTable)

    def findings(path):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            suite = CheckSuite()
            dataset = suite.load_dataset(str(path))
            groups, errors = suite.run_all(dataset, ["cf:1.11"], [])["cf:1.11"]
            dataset.close()
        assert not errors
        messages = [message for group in groups for message in _messages(group)]
        # the checker takes any coordinate in Pa for a vertical axis, and knows x and y of a plane without a
        # map projection as no axes at all: it then recommends another order of the dims
        return [text for text in messages if not PRESSURE_AS_HEIGHT.search(text)]

    def _messages(group):
        value = group.value
        passed = value[0] == value[1] if isinstance(value, tuple) else bool(value)
        return [] if passed else list(group.msgs or [group.name])

    return findings
