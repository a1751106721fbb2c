"""Damaged calls, files and scenes are drawn with the seed of the day, so that every day tries others.

The head of a run prints the seed, and so does a failure; `--seed=N` repeats it. `--fuzz=300` draws so many
times as many.
"""

import random

import pytest


@pytest.fixture(autouse=True, scope="module")
def own_folder(tmp_path_factory):
    """Run in a folder of their own: damaged calls may write files under any name."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("calls"))
        yield


@pytest.fixture
def draw(request):
    """Return a function that makes a check many times, each with a choice from lists of its own."""
    seed, more = (request.config.getoption(name) for name in ("--seed", "--fuzz"))

    def drawn(check, *, times):
        for number in range(times * more):
            try:
                check(random.Random(f"{seed}, {number}").choice)
            except BaseException as error:
                error.add_note(f"repeat it with --seed={seed}: draw {number}")
                raise

    return drawn
