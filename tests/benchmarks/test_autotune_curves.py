"""The curves that scenes choose from are written in the form of the shipped ones."""

import json
from pathlib import Path

from benchmarks import autotune_curves

import fractalcontact as fc

PACKAGE = Path(fc.__file__).parent


def test_curves_are_written_in_the_form_of_the_shipped_ones(tmp_path):
    autotune_curves.write(fc.accuracy.measure("contact", budget=1), tmp_path / "autotune_curves.json")
    curves = json.loads((tmp_path / "autotune_curves.json").read_text(encoding="utf-8"))
    (shipped_file,) = PACKAGE.glob("*/autotune_curves.json")
    shipped = json.loads(shipped_file.read_text(encoding="utf-8"))
    assert "rough, free body" in curves
    assert set(curves) <= set(shipped)
    for benchmark, methods in curves.items():
        assert set(methods) == set(shipped[benchmark])
        for method, curve in methods.items():
            assert list(curve) == list(shipped[benchmark][method])
            assert len({len(values) for values in curve.values()}) == 1
