"""Benchmarks are run seldom, and by hand: what moves in the package must not leave one behind
unnoticed.
"""

import importlib
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "benchmarks"
NAMES = sorted(path.stem for path in FOLDER.glob("*.py") if not path.stem.startswith("__"))


@pytest.mark.parametrize("name", NAMES)
def test_all_that_a_benchmark_imports_is_there(name):
    assert importlib.import_module(f"benchmarks.{name}").__doc__
