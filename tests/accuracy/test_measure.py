"""Error against run time: what is measured is true error, the budget is kept, the Pareto front is right."""

import dataclasses
import signal
import time

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.accuracy import Benchmark, Method
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.signals import Stop

SLOWEST = "Hurst exponent under noise", "Hurst exponent by direction"
PARTS = ("surfaces", "dimensions", "contact", "domains", "joints")


def methods_of(part):
    return {method.name: method for b in fc.accuracy.benchmarks(part) for method in b.methods}


@pytest.fixture(scope="module")
def measured():
    """Return the result of each part, measured once with a small budget."""
    results = {}

    def measure(part, left_out=()):
        if (part, left_out) not in results:
            chosen = [each for each in fc.accuracy.benchmarks(part) if each.name not in left_out]
            start = time.process_time()  # unlike the time of the clock the same beside other processes
            tree = fc.accuracy.measure({part: chosen}, budget=0.1)
            assert time.process_time() - start < 60
            results[part, left_out] = tree
        return results[part, left_out]

    return measure


@pytest.mark.parametrize(
    ("part", "left_out"),
    [
        # methods under noise and by direction are two thirds of the time; others are measured alike
        *((part, SLOWEST if part == "dimensions" else ()) for part in PARTS),
        pytest.param("dimensions", (), marks=pytest.mark.slow),
    ],
)
def test_each_part_is_measured_within_its_budget(part, left_out, measured):
    tree = measured(part, left_out)
    data = tree[part].to_dataset()
    assert data["error"].dims == ("method", "setting")
    finite = np.isfinite(data["error"].values)
    assert finite.any(axis=1).all()
    assert (data["run_time"].values[finite] > 0).all()
    assert (data["memory"].values[finite] > 0).all()
    assert (data["first_run_time"].values[finite] >= data["run_time"].values[finite]).all()
    assert all(data[key].values.all() for key in ("truth", "error_meaning", "parameter_name", "benchmark"))
    assert data["on_pareto_front"].values.any()
    assert not data["on_pareto_front"].values[~finite].any()
    assert part in fc.accuracy.summary(tree)


def test_every_public_method_is_measured():
    assert {"fbm", "spectral", "midpoint", "weierstrass"} <= set(methods_of("surfaces"))
    assert set(fc.dimensions.methods()) <= set(methods_of("dimensions"))
    for part in PARTS:
        assert len(methods_of(part)) == sum(len(b.methods) for b in fc.accuracy.benchmarks(part))


# functions that measure a set, a flow or a joint, and the first words of the name of their method; the others
# count, map or summarise
MEASURES = {
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
UNMEASURED = {  # of domains; the content of dyadic squares is exact (tests/domains/test_hausdorff_content.py)
    *("box_counts", "describe", "evolution", "hausdorff_content", "lineage", "read_mask", "signature"),
}


def test_every_public_analysis_of_domains_and_joints_is_measured():
    assert set(MEASURES["domains"]) | UNMEASURED == set(fc.domains.__all__)
    for part, names in MEASURES.items():
        for name in names.values():
            assert any(method.startswith(name) for method in methods_of(part)), name


def rms_error(method, parameter):
    result = method.solve(method.prepare(parameter))
    return float(np.sqrt(np.mean(np.square(method.errors(result, parameter)))))


def test_islands_and_crossings_at_the_critical_coverage_match_percolation_theory():
    methods = methods_of("domains")
    assert rms_error(methods["islands"], 512) < 0.05
    assert rms_error(methods["percolation"], 64) < 0.19


def test_error_of_the_solver_falls_with_the_spacing():
    methods = methods_of("contact")

    def errors(name):
        return [rms_error(methods[name], parameter) for parameter in methods[name].parameters[:2]]

    coarse, fine = errors("fast, square")
    assert fine < 0.5 * coarse
    assert methods["elimination, disc"].parameters[:2] == methods["fast, disc"].parameters[:2]
    np.testing.assert_allclose(errors("elimination, disc"), errors("fast, disc"), atol=1e-6)


def stub(name, seconds, errors):
    """Return a method whose run times and errors are known, one or several errors for each setting."""
    return Method(
        name,
        range(len(errors)),
        int,
        lambda k: time.sleep(seconds[k]) or np.ones(1000 * (k + 1)).sum(),
        lambda _, k: errors[int(k)],
    )


def measure_stubs(*methods, budget=20.0, **options):
    tree = fc.accuracy.measure({"part": [Benchmark("of it", "", "known", methods, **options)]}, budget=budget)
    return tree["part"].to_dataset()


def test_front_and_memory_of_known_methods():
    quick = stub("quick", [0.01, 0.04], [0.1, 0.02])
    slow = stub("slow", [0.03, 0.08], [0.2, 0.05])
    fine = stub("fine", [0.06], [0.001])
    alone = stub("other", [0.01], [0.5])
    benchmarks = Benchmark("a", "", "known", (quick, slow, fine)), Benchmark("b", "", "known", (alone,))
    tree = fc.accuracy.measure({"contact": benchmarks}, budget=20)
    data = tree["contact"].to_dataset()
    for method, expected in {"quick": [1, 1], "slow": [0, 0], "fine": [1, 0], "other": [1, 0]}.items():
        assert data.sel({"method": method})["on_pareto_front"].values.tolist() == expected, method
    np.testing.assert_allclose(data["memory"].sel({"method": "quick"}), [8000, 16000], rtol=0.2)
    np.testing.assert_allclose(data["run_time"].sel({"method": "slow"}), [0.03, 0.08], rtol=0.3)
    stars = [line.split()[0] for line in fc.accuracy.summary(tree).splitlines() if line.endswith("*")]
    assert stars == ["quick", "quick", "fine", "other"]


def test_random_errors_are_those_of_all_replicates():
    errors = np.random.default_rng(1).normal(size=12)
    data = measure_stubs(stub("random", [0.01], [errors]))
    assert data["error"].item() == pytest.approx(np.sqrt(np.mean(errors**2)))


def test_small_budget_measures_every_method_once():
    flat = stub("flat", [0.01, 0.02, 0.04], [0.1, 0.09, 0.08])
    steep = stub("steep", [0.02, 0.03, 0.05], [0.2, 0.15, 0.001])
    small, large = (np.isfinite(measure_stubs(flat, steep, budget=b)["error"]) for b in (0.05, 20.0))
    assert small.values.tolist() == [[True], [True]]
    assert large.values.all()


def test_inputs_given_are_compared_at_equal_size_only():
    first = stub("first", [0.01, 0.02, 0.03], [0.4, 0.2, 0.1])
    late = stub("second", [0.03, 0.06], [0.5, 0.3])
    early = stub("second", [0.004, 0.06], [0.5, 0.3])
    assert measure_stubs(first, late)["on_pareto_front"].values.tolist() == [[True] * 3, [False] * 3]
    at_equal_size = measure_stubs(first, early, equal_parameters=True)
    assert at_equal_size["on_pareto_front"].values.tolist() == [[True] * 3, [True, False, False]]


def test_stopped_measurement_keeps_its_results_and_names_the_missing_methods():
    stop = Stop()

    def errors_and_stop(_, parameter):
        stop.number = signal.SIGINT
        return 0.1 / (parameter + 1)

    first = stub("one", [0.01], [0.1])
    second = dataclasses.replace(stub("two", [0.01, 0.01], [0.1, 0.1]), errors=errors_and_stop)
    part = Benchmark("a", "", "known", (first, second)), Benchmark("b", "", "known", (stub("c", [0], [1]),))
    tree = fc.accuracy.measure({"contact": part, "joints": part}, budget=20, stop=stop)
    assert tree.attrs["completeness"] == "partial: the run was stopped; missing: c; one; two; c"
    assert list(tree.children) == ["contact"]
    assert tree["contact"]["method"].values.tolist() == ["one", "two"]
    assert tree["contact"]["error"].shape == (2, 1)
    assert "two" in fc.accuracy.summary(tree)


def test_file_is_cf_compliant_and_round_trips(tmp_path, compliance, measured):
    tree = measured("joints")
    tree["joints"].to_dataset().to_netcdf(tmp_path / "joints.nc")
    assert compliance(tmp_path / "joints.nc") == []
    fc.save(tree, tmp_path / "accuracy.nc")
    assert fc.open(tmp_path / "accuracy.nc")["joints"].to_dataset().identical(tree["joints"].to_dataset())


def test_unknown_parts_and_budgets_are_refused():
    with pytest.raises(InvalidInput, match="magic"):
        fc.accuracy.measure("magic")
    with pytest.raises(InvalidInput, match="budget"):
        fc.accuracy.measure("contact", budget=0)
    for parts in ({"mine": 3}, {"mine": ["sphere"]}):
        with pytest.raises(InvalidInput, match="sequences of Benchmark"):
            fc.accuracy.measure(parts)
