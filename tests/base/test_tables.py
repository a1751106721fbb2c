"""Text tables: aligned columns, also without rows."""

import pytest

from fractalcontact.base.tables import note, table


def test_columns_are_aligned():
    lines = table([("method", "error"), ("elimination", "1e-08"), ("fast", "")]).splitlines()
    assert lines[0].split() == ["method", "error"]
    assert lines[2].index("1e-08") == lines[0].index("error")
    assert lines[3] == "fast"


def test_numbers_keep_their_digits():
    assert "1.50" in table([("value",), ("1.50",)])


def test_table_without_rows_has_its_head():
    assert table([("method", "error")]).splitlines()[0].split() == ["method", "error"]


@pytest.mark.parametrize("width", [60, 80, 160])
def test_table_is_not_wider_than_asked_for(width):
    rows = [("stage", "needs", "reason"), ("figures", "all stored results", "figures are wanted " * 20)]
    text = table(rows, width)
    assert max(map(len, text.splitlines())) <= width
    assert text.count("wanted") == 20


def test_table_is_not_wider_than_the_screen(monkeypatch):
    rows = [("words",), ("many words " * 30,)]
    for columns in (40, 90):
        monkeypatch.setenv("COLUMNS", str(columns))
        assert columns - 15 < max(map(len, table(rows).splitlines())) <= columns


def test_narrow_table_is_the_same_at_any_width():
    rows = [("method", "error"), ("fast", "1e-08")]
    assert table(rows, 40) == table(rows, 400)


def test_column_without_words():
    assert [line.split() for line in table([("", "error"), ("", "1e-08")]).splitlines()[::2]] == [
        ["error"],
        ["1e-08"],
    ]
    assert table([("",), ("",)]).split() == ["--"]


def test_quantity_of_a_sentence_keeps_its_unit_at_the_end_of_a_line(monkeypatch):
    for width in range(30, 60):
        monkeypatch.setenv("COLUMNS", str(width))
        lines = [
            line.strip()
            for line in note("areas are up to 90 % above those at 1.5 MPa, and 300 µm apart").splitlines()
        ]
        assert all(line.startswith("areas") or line.split()[0] not in ("%", "MPa,", "µm") for line in lines)
        assert "\N{NO-BREAK SPACE}" not in "".join(lines)
