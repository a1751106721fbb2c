"""A call that hangs, or takes its process down, is cut off; the others go on."""

import os
import time

import pytest

from fractalcontact.accuracy.catalogue import cases
from fractalcontact.accuracy.examination import examine
from fractalcontact.accuracy.watching import Lost, examine_apart, watched


def test_what_hangs_is_ended_and_the_next_is_served():
    start = time.monotonic()
    found = dict(watched(time.sleep, {600.0: 0.2, 0.0: 60.0}))
    assert isinstance(found[600.0], Lost)
    assert "hung" in found[600.0]
    assert found[0.0] is None
    assert time.monotonic() - start < 60


def test_what_ends_its_process_is_told():
    found = dict(watched(os._exit, {3: 60.0, 4: 60.0}))
    assert found == {3: "its process ended with code 3", 4: "its process ended with code 4"}


@pytest.mark.parametrize("name", ["empty mask"])
def test_a_case_is_examined_apart_as_here(name):
    (apart,) = examine_apart([name]).values()
    assert [(one.name, one.ok) for one in apart] == [(one.name, one.ok) for one in examine(cases[name])]
