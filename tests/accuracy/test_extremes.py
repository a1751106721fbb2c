"""All extreme cases in a child process: a case that hangs or crashes is reported, the others go on."""

import os
import signal
import subprocess
import sys
import time
from functools import partial

import pytest

import fractalcontact as fc
from fractalcontact import cli
from fractalcontact.accuracy import Case
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.signals import Stop

TWO = ["nothing observed", "one cell"]


def call(name, make, time_limit=60.0):
    return Case(name, "", "call", make, {"part.call.value": 1.0}, time_limit=time_limit)


@pytest.fixture(scope="module")
def two():
    return fc.accuracy.extremes(TWO)


def test_hanging_and_crashing_cases_are_reported_and_the_next_is_examined():
    cases = [
        call("hangs", partial(time.sleep, 600.0), time_limit=0.2),
        call("crashes", partial(os._exit, 3)),
        call("crashes again", partial(os._exit, 4)),
        "a mask of one cell",
    ]
    start = time.monotonic()
    results = fc.accuracy.extremes(cases)
    assert time.monotonic() - start < 60
    outcomes = dict(zip(results["case"].values, results["outcome"].values, strict=True))
    assert outcomes["hangs"] == "hung: ended after 0.2 s"
    assert outcomes["crashes"] == "its process ended with code 3"
    assert outcomes["crashes again"] == "its process ended with code 4"
    failed = set(results["case"].values[~results["passed"].values])
    assert failed == {"hangs", "crashes", "crashes again"}
    assert set(results["case"].values) - failed == {"a mask of one cell"}


def test_script_without_a_guard_is_told(tmp_path):
    (tmp_path / "script.py").write_text("import fractalcontact as fc\nfc.accuracy.extremes('one cell')\n")
    words = [sys.executable, str(tmp_path / "script.py")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.stderr.splitlines()[-1].startswith("fractalcontact.base.errors.FractalContactError")
    assert 'if __name__ == "__main__"' in done.stderr.splitlines()[-1]


def test_child_process_gives_the_results_of_examine(two):
    apart = two.isel(result=two["case"].values == "one cell")
    here = fc.accuracy.examine(fc.accuracy.cases["one cell"])
    assert apart["quantity"].values.tolist() == [result.name for result in here]
    assert apart["passed"].values.tolist() == [result.passed for result in here]


def test_stop_keeps_the_cases_that_are_done():
    stop = Stop()
    stop.number = signal.SIGINT
    results = fc.accuracy.extremes(["empty mask", "one cell"], stop=stop)
    assert set(results["case"].values) == {"empty mask"}
    assert results.attrs["completeness"].endswith("missing: one cell")


def test_unknown_case_is_refused():
    with pytest.raises(InvalidInput, match="did you mean 'one cell'"):
        fc.accuracy.extremes("one cel")


def test_command_writes_the_results(tmp_path, monkeypatch, capsys, compliance, two):
    monkeypatch.setattr(fc.accuracy, "extremes", lambda names, **_: two)
    assert cli.main(["accuracy", "--extreme", *TWO, "-o", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr().out
    assert "0 failed" in printed
    assert "extremes.nc" in printed
    results = fc.open(tmp_path / "out" / "extremes.nc")
    assert set(results["case"].values) == set(TWO)
    assert results["passed"].all()
    row = results["quantity"] == "domains.lacunarity.lacunarity"
    assert results["value"].values[row] == 1024.0
    assert results["expectation"].values[row] == "1024"
    assert f"{results.sizes['result']} results" in printed
    assert not compliance(tmp_path / "out" / "extremes.nc")


def test_stopped_command_writes_beside_an_earlier_result(tmp_path, monkeypatch, two):
    def stopped(names, *, stop, **_):
        stop.number = signal.SIGINT
        return two.assign_attrs(completeness="partial: the run was stopped; missing: one row")

    (tmp_path / "extremes.nc").write_text("an earlier result", encoding="utf-8")
    monkeypatch.setattr(fc.accuracy, "extremes", stopped)
    assert cli.main(["accuracy", "--extreme", "-o", str(tmp_path)]) == 128 + signal.SIGINT
    assert fc.open(tmp_path / "partial.nc").attrs["completeness"].endswith("missing: one row")
    assert (tmp_path / "extremes.nc").read_text(encoding="utf-8") == "an earlier result"


@pytest.mark.parametrize("words", [["contact", "--extreme"], ["--large"]])
def test_options_without_effect_are_refused(words, capsys):
    assert cli.main(["accuracy", *words]) == 2
    assert "expected" in capsys.readouterr().err
