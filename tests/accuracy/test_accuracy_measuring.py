"""Error against run time: what is measured is true error, and the budget is kept."""

import dataclasses
import signal
import time

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.accuracy import measuring
from fractalcontact.accuracy.reporting import choice_table, curves_table
from fractalcontact.accuracy.trials.trial import Contest, Experiment
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.signals import Stop


@pytest.mark.parametrize("part", list(measuring.PARTS))
def test_each_part_is_measured_within_its_budget(part):
    start = time.perf_counter()
    tree = fc.accuracy.measure(part, budget=2)
    assert time.perf_counter() - start < 60
    data = tree[part].to_dataset()
    assert data["error"].dims == ("method", "setting")
    measured = np.isfinite(data["error"].values)
    assert measured.any(axis=1).all()
    assert (data["run_time"].values[measured] > 0).all()
    assert (data["memory"].values[measured] > 0).all()
    assert (data["first_run_time"].values[measured] >= data["run_time"].values[measured]).all()
    assert all(data[name].values.all() for name in ("truth", "error_meaning", "knob_name", "contest"))
    assert part in curves_table(tree)


def test_every_public_method_is_measured():
    names = {
        part: [one.method for c in measuring.contests(part) for one in c.experiments]
        for part in measuring.PARTS
    }
    for generator in ("fbm", "spectral", "midpoint", "weierstrass"):
        assert generator in names["surfaces"]
    assert set(fc.dimensions.methods()) <= set(names["dimensions"])
    assert all(len(set(found)) == len(found) for found in names.values())


# what measures a set, a flow or a face, and by what name its trial goes; the rest is no measure but a
# count, a map or a summary of these
TRIALS = {
    "domains": {
        "box_dimension": "box dimension",
        "correlation_dimension": "correlation dimension",
        "minkowski_dimension": "Minkowski dimension",
        "boundary_dimension": "boundary dimension",
        "generalised_dimensions": "generalised dimensions",
        "area_dimension": "area dimension",
        "lacunarity": "lacunarity",
        "islands": "islands",
        "percolation": "percolation",
    },
    "joints": {
        "transmissivity": "transmissivity",
        "dilatancy": "rigid dilatancy",
        "closure": "closure of the interface",
    },
}
UNMEASURED = {"box_counts", "describe", "evolution", "lineage"}  # of domains


def test_every_measure_of_a_domain_and_every_flow_has_a_trial():
    assert set(TRIALS["domains"]) | UNMEASURED == set(fc.domains.__all__)
    for part, words in TRIALS.items():
        measured = [one.method for c in measuring.contests(part) for one in c.experiments]
        for word in words.values():
            assert any(method.startswith(word) for method in measured), word


def test_islands_and_crossings_at_the_critical_coverage_are_the_known_ones():
    trials = {one.method: one for c in measuring.contests("domains") for one in c.experiments}
    for name, size, most in (("islands", 512, 0.05), ("percolation", 64, 0.19)):
        trial = trials[name]
        assert trial.error(trial.solve(trial.prepare(size)), size) < most


def stub(method, seconds, errors):
    """An experiment whose run times and errors are known."""
    return Experiment(
        method,
        range(len(errors)),
        int,
        lambda knob: time.sleep(seconds[knob]) or np.ones(1000 * (knob + 1)).sum(),
        lambda _, knob: errors[int(knob)],
    )


def test_frontier_memory_and_choice_of_known_methods(monkeypatch):
    quick = stub("quick", [0.01, 0.04], [0.1, 0.02])
    slow = stub("slow", [0.03, 0.08], [0.2, 0.05])
    fine = stub("fine", [0.06], [0.001])
    alone = stub("other", [0.01], [0.5])
    part = (Contest("one", "of it", "known", (quick, slow, fine)), Contest("two", "of it", "known", (alone,)))
    monkeypatch.setattr(measuring, "contests", lambda name: part)
    tree = fc.accuracy.measure("contact", budget=20)
    data = tree["contact"].to_dataset()
    for method, expected in {"quick": [1, 1], "slow": [0, 0], "fine": [1], "other": [1]}.items():
        row = data.sel({"method": method})
        assert row["on_frontier"].values[: len(expected)].tolist() == expected, method
    assert data["share_on_frontier"].values.tolist() == [1.0, 0.0, 1.0, 1.0]
    np.testing.assert_allclose(data["memory"].sel({"method": "quick"}), [8000, 16000], rtol=0.2)
    np.testing.assert_allclose(data["run_time"].sel({"method": "slow"}), [0.03, 0.08], rtol=0.3)
    lines = [line for line in choice_table(tree).splitlines() if "never worth choosing" in line]
    assert len(lines) == 1
    assert "slow" in lines[0]


def test_a_stopped_measuring_gives_what_it_has_and_says_what_is_missing(monkeypatch):
    stop = Stop()

    def last(_, knob):
        stop.number = signal.SIGINT
        return 0.1 / (knob + 1)

    one = stub("one", [0.01], [0.1])
    two = dataclasses.replace(stub("two", [0.01, 0.01], [0.1, 0.1]), error=last)
    part = (
        Contest("a", "of it", "known", (one, two)),
        Contest("b", "of it", "known", (stub("c", [0], [1]),)),
    )
    monkeypatch.setattr(measuring, "contests", lambda name: part)
    tree = fc.accuracy.measure(["contact", "joints"], budget=20, stop=stop)
    assert tree.attrs["completeness"] == "partial: the run was stopped; missing: c; one; two; c"
    assert list(tree.children) == ["contact"]
    assert tree["contact"]["method"].values.tolist() == ["one", "two"]
    assert tree["contact"]["error"].shape == (2, 1)
    assert "two" in curves_table(tree)


def test_what_is_given_is_compared_at_the_same_size_only():
    error = np.array([[0.4, 0.2, 0.1], [0.5, 0.3, np.nan]])
    seconds = np.array([[1.0, 2.0, 3.0], [2.5, 9.0, np.nan]])
    sizes = np.array([[8.0, 16.0, 32.0]] * 2)
    free = measuring.on_frontier(error, seconds, ["a", "a"], 0 * sizes)
    assert free.tolist() == [[True, True, True], [False, False, False]]
    seconds[1, 0] = 0.5
    given = measuring.on_frontier(error, seconds, ["a", "a"], sizes)
    assert given.tolist() == [[True, True, True], [True, False, False]]


def test_the_error_of_the_solver_falls_with_the_spacing():
    methods = {one.method: one for c in measuring.contests("contact") for one in c.experiments}

    def errors(name):
        one = methods[name]
        return [one.error(one.solve(one.prepare(knob)), knob) for knob in one.knobs[:2]]

    coarse, fine = errors("fast, square")
    assert fine < 0.5 * coarse
    assert methods["elimination, disc"].knobs[:2] == methods["fast, disc"].knobs[:2]
    np.testing.assert_allclose(errors("elimination, disc"), errors("fast, disc"), atol=1e-6)


def test_a_file_of_all_is_clean(tmp_path, compliance):
    tree = fc.accuracy.measure("joints", budget=1)
    tree["joints"].to_dataset().to_netcdf(tmp_path / "joints.nc")
    assert compliance(tmp_path / "joints.nc") == []
    fc.save(tree, tmp_path / "accuracy.nc")
    assert fc.open(tmp_path / "accuracy.nc")["joints"].to_dataset().identical(tree["joints"].to_dataset())


def test_unknown_parts_and_budgets_are_refused():
    with pytest.raises(InvalidInput, match="magic"):
        fc.accuracy.measure("magic")
    with pytest.raises(InvalidInput, match="budget"):
        fc.accuracy.measure("contact", budget=0)
