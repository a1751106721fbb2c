"""Text tables: aligned columns, also without rows."""

from fractalcontact.base.tables import table


def test_columns_are_aligned():
    lines = table([("method", "error"), ("elimination", "1e-08"), ("fast", "")]).splitlines()
    assert lines[0].split() == ["method", "error"]
    assert lines[2].index("1e-08") == lines[0].index("error")
    assert lines[3] == "fast"


def test_numbers_keep_their_digits():
    assert "1.50" in table([("value",), ("1.50",)])


def test_table_without_rows_has_its_head():
    assert table([("method", "error")]).splitlines()[0].split() == ["method", "error"]
