"""A number is changed in a module's text and nowhere else."""

import pytest
from benchmarks.constants import change_value

TEXT = '"""Größen."""\nMOST, LEAST_M = 7, 0.5  # größer\nNAMES = ("a",)\nTILE_M = 250.0\n'


@pytest.mark.parametrize(
    ("name", "factor", "new_value"),
    [("MOST", 2.0, "14, 0.5"), ("LEAST_M", 0.5, "7, 0.25"), ("TILE_M", 2.0, "500.0")],
)
def test_one_number_is_changed(name, factor, new_value):
    text = change_value(TEXT, name, factor)
    assert new_value in text and len(text.splitlines()) == len(TEXT.splitlines())
    assert change_value(TEXT, name, 1.0) == TEXT


@pytest.mark.parametrize("name", ["NAMES", "OTHER"])
def test_what_is_no_number_is_refused(name):
    with pytest.raises(SystemExit, match=f"got {name}"):
        change_value(TEXT, name, 2.0)
