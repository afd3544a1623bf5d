"""Keep docstrings as CONTRIBUTING.md asks: first one short imperative sentence, nothing twice."""

import ast

import pytest

from docstrings import LONGEST_LINE, find_fault, find_faulty_docstrings


def test_docstrings_begin_with_a_short_imperative_sentence_and_repeat_nothing():
    assert find_faulty_docstrings() == []


@pytest.mark.parametrize(
    ("text", "is_sound"),
    [
        ("Return the area.", True),
        ("Return the area.\n\nIt is in m2.", True),
        ("The area.", False),
        ("Whether it is large.", False),
        ("Return the area", False),
        ("Return the area of\nthe outline.", False),
        (f"Return {'x' * LONGEST_LINE}.", False),
        ("Return the area.\n\nIt is in m2.\n\nIt is\nin m2.", False),
    ],
)
def test_faults_are_found(text, is_sound):
    (function,) = ast.parse("def area(): ...").body
    assert (find_fault(function, text) == "") == is_sound


def test_values_are_described_by_nouns():
    (value,) = ast.parse("class Area: ...").body
    assert find_fault(value, "An area in m2.") == ""
