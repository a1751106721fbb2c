"""The benchmarks of asv: their configuration names the suite, and every one of them can be called."""

import importlib
import inspect
import json
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parent
KINDS = ("time_", "timeraw_", "peakmem_", "track_")
LONG = ("Study", "Estimate", "PeakMemory", "Generate", "Closure")  # `asv run --quick` runs these


def benchmarks():
    for module in ("main_calls", "commands"):
        for name, group in inspect.getmembers(importlib.import_module(f"benchmarks.suite.{module}")):
            methods = (
                [each for each in dir(group) if each.startswith(KINDS)] if inspect.isclass(group) else []
            )
            for method in methods:
                yield pytest.param(group, method, id=f"{name}.{method}")


def test_configuration_names_the_suite_and_the_repository():
    settings = json.loads((FOLDER / "asv.conf.json").read_text(encoding="utf-8"))
    assert (FOLDER / settings["benchmark_dir"] / "main_calls.py").is_file()
    assert (FOLDER / settings["repo"] / "pyproject.toml").is_file()


def test_peak_memory_and_the_study_are_covered():
    names = {parameter.id for parameter in benchmarks()}
    assert {"PeakMemory.peakmem_press", "PeakMemory.peakmem_estimate"} <= names
    assert {"Study.time_cold", "Study.time_warm", "Start.time_version", "Estimate.time_estimate"} <= names


@pytest.mark.parametrize(
    ("group", "method"), [each for each in benchmarks() if each.values[0].__name__ not in LONG]
)
def test_a_benchmark_runs(group, method):
    benchmark = group()
    arguments = [group.params[-1]] if hasattr(group, "params") else []
    if hasattr(benchmark, "setup"):
        benchmark.setup(*arguments)
    result = getattr(benchmark, method)(*arguments)
    if method.startswith("timeraw_"):
        compile(result, method, "exec")
    if method.startswith("track_"):
        assert 0.5 < result < 3.7  # pairs of a step over those of the normal solution
