"""Figures are kept as they were printed, and the page of figures shows what is kept."""

from pathlib import Path

import pytest

from benchmarks import results, tables

PAGE = Path(results.__file__).with_name("RESULTS.md")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "FIGURES", tmp_path)
    monkeypatch.setattr("sys.argv", ["benchmarks/delft.py", "--record", "--shares", "1"])
    return tmp_path


def measure(share: float, is_kept: bool = True) -> None:
    with tables.FigureTable(is_kept, "share of points", "within 0.2 m") as table:
        table.add("1", share)


def test_the_page_is_that_of_the_kept_figures():
    assert PAGE.read_text(encoding="utf-8") == results.make_page(results.read_figures())


def test_a_table_is_kept_in_place_of_the_one_by_the_same_arguments(folder, monkeypatch):
    measure(0.93)
    measure(0.94)
    monkeypatch.setattr("sys.argv", ["benchmarks/delft.py"])
    measure(0.95)
    kept = results.read_figures(folder)["delft"]["tables"]
    assert [(table["arguments"], table["rows"]) for table in kept] == [
        ("--shares 1", [["1", "0.94"]]),
        ("", [["1", "0.95"]]),
    ]
    page = results.make_page(results.read_figures(folder))
    assert "| `--shares 1` | 1 | 0.94 |" in page and "|  | 1 | 0.95 |" in page


def test_a_table_that_failed_or_is_not_to_be_kept_is_not(folder):
    measure(0.93, is_kept=False)
    with pytest.raises(ZeroDivisionError):
        measure(1 / 0)
    with pytest.raises(ValueError, match="no figure"), tables.FigureTable(True, "share"):
        raise ValueError("no figure")
    assert not list(folder.iterdir())


def test_only_named_columns_are_shown_and_another_day_is_named():
    table = {"arguments": "", "date": "2026-01-01", "commit": "a", "machine": "b"}
    old = {**table, "columns": ["x", "y"], "rows": [["1", "2"]]}
    new = {**old, "date": "2026-01-02", "arguments": "--fast"}
    page = results.make_page({"delft": {"tables": [old, new], "show": ["y"], "notes": ["So."]}})
    assert "| 2026-01-01 | 2 |" in page and "| `--fast` | 2 |" in page and "So." in page
