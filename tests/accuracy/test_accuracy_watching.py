"""A call that hangs, or takes its process down, is cut off; the others go on."""

import os
import signal
import time
from types import SimpleNamespace

import pytest

import fractalcontact as fc
from fractalcontact import cli
from fractalcontact.accuracy import watching
from fractalcontact.accuracy.catalogue import cases
from fractalcontact.accuracy.examination import examine
from fractalcontact.accuracy.watching import Lost, examine_apart, watched
from fractalcontact.base.signals import Stop


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


def test_a_stop_keeps_the_cases_that_are_done():
    stop = Stop()
    stop.number = signal.SIGINT
    assert list(examine_apart(["empty mask", "one cell"], stop=stop)) == ["empty mask"]


def test_the_findings_are_written_where_they_are_asked_for(tmp_path, monkeypatch, capsys, compliance):
    catalogue = {name: cases[name] for name in ("nothing observed", "one cell")}
    monkeypatch.setattr(fc, "accuracy", SimpleNamespace(cases=catalogue))
    assert cli.main(["accuracy", "--extreme", "-o", str(tmp_path / "out")]) == 0
    told = capsys.readouterr().out
    assert "0 failed" in told
    assert "extremes.nc" in told
    found = fc.open(tmp_path / "out" / "extremes.nc")
    assert set(found["case"].values) == set(catalogue)
    assert found["passed"].all()
    row = found["quantity"] == "domains.lacunarity.lacunarity"
    assert found["value"].values[row] == 1024.0
    assert found["expectation"].values[row] == "1024"
    assert f"{found.sizes['finding']} findings" in told
    assert not compliance(tmp_path / "out" / "extremes.nc")


def test_a_stopped_command_writes_what_it_has_beside_an_earlier_whole(tmp_path, monkeypatch):
    catalogue = {name: cases[name] for name in ("nothing observed", "one cell")}
    monkeypatch.setattr(fc, "accuracy", SimpleNamespace(cases=catalogue))
    done = {"nothing observed": examine(cases["nothing observed"])}

    def stopped(names, *, progress, stop):
        stop.number = signal.SIGINT
        return done

    (tmp_path / "extremes.nc").write_text("an earlier result", encoding="utf-8")
    monkeypatch.setattr(watching, "examine_apart", stopped)
    assert cli.main(["accuracy", "--extreme", "-o", str(tmp_path)]) == 128 + signal.SIGINT
    assert fc.open(tmp_path / "partial.nc").attrs["completeness"].endswith("missing: one cell")
    assert (tmp_path / "extremes.nc").read_text(encoding="utf-8") == "an earlier result"


@pytest.mark.parametrize(
    "words", [["contact", "--extreme"], ["--extreme", "--curves", "x.json"], ["--large"]]
)
def test_words_that_would_not_be_heard_are_refused(words, capsys):
    assert cli.main(["accuracy", *words]) == 2
    assert "expected" in capsys.readouterr().err
