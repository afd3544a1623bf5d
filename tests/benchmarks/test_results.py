"""Figures are kept as they were printed, the page of figures shows what is kept, and every
benchmark can be imported.
"""

import importlib
from pathlib import Path
from pkgutil import resolve_name

import pytest
from benchmarks.budget import STAGES, Clock, refuse_incomplete

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


FOLDER = Path(__file__).parents[2] / "benchmarks"
NAMES = sorted(path.stem for path in FOLDER.glob("*.py") if not path.stem.startswith("__"))


@pytest.mark.parametrize("name", NAMES)
def test_all_that_a_benchmark_imports_is_there(name):
    assert importlib.import_module(f"benchmarks.{name}").__doc__


def test_a_stage_does_not_count_the_stages_inside_it():
    new = 0.0

    def work(seconds):
        nonlocal new
        new += seconds

    clock = Clock(lambda: new)
    inner = clock.time_stage("inner", lambda: work(2.0))

    def outer():
        work(1.0)
        inner()
        inner()

    clock.time_stage("outer", outer)()
    assert clock.seconds == {"inner": 4.0, "outer": 1.0}
    assert sum(clock.seconds.values()) == new


@pytest.mark.parametrize("place", STAGES.values(), ids=STAGES)
def test_every_stage_is_a_function_of_a_run(place):
    assert callable(resolve_name(place))


def test_a_budget_that_misses_a_twentieth_of_the_time_is_refused():
    clock = Clock()
    clock.seconds["fit"] = 9.6
    refuse_incomplete(clock, 10.0)
    with pytest.raises(SystemExit, match="within 5%"):
        refuse_incomplete(clock, 11.0)
