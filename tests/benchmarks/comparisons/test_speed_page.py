"""The tables of the page of speed are those of the measured runs."""

import csv
from pathlib import Path

from benchmarks.comparisons import speed_page

PAGE = Path(__file__).resolve().parents[3] / "gallery" / "speed.rst"


def test_tables_of_the_page_are_those_of_the_measured_runs():
    text = PAGE.read_text(encoding="utf-8")
    for name, (head, lines) in speed_page.tables().items():
        assert f":file: speed/{name}.csv" in text
        with (PAGE.parent / "speed" / f"{name}.csv").open(encoding="utf-8", newline="") as stream:
            assert list(csv.reader(stream)) == [head, *lines]


def test_a_ratio_compares_the_loads_that_both_have_solved():
    runs = [
        {"solver": "fractalcontact", "loads": 0.01, "seconds": 1.0},
        {"solver": "fractalcontact", "loads": 0.01, "seconds": 2.0},
        {"solver": "fractalcontact", "loads": 0.03, "seconds": 1.0},
        {"solver": "aspher nested", "loads": 0.01, "seconds": 8.0},
        {"solver": "aspher precond", "loads": 0.01, "seconds": 4.0},
    ]
    assert speed_page.total_ratio(runs, "ASPHER") == 4.0
    assert speed_page.total_ratio(runs[:3], "ASPHER") != speed_page.total_ratio(runs[:3], "ASPHER")
