"""Lines of pages fit. `python tests/prose.py` prints the words of pages and of their sentences."""

import re

import pytest

from prose import PAGES, ROOT, find_long_lines, split_sentences

MADE = {"attributes.md"}  # by `hiproof attributes`: its lines list files


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_lines_fit(page):
    assert page.name in MADE or find_long_lines(page.read_text(encoding="utf-8")) == []


def test_prose_is_told_from_code_and_tables():
    text = (
        "# A title\n\nOne two. Three four\nfive.\n\n- item one\n- item two\n\n"
        "| a | b |\n\n    code here\n"
    )
    assert split_sentences(text) == ["One two.", "Three four five.", "- item one", "- item two"]
    assert not re.search("code|title|\\|", " ".join(split_sentences(text)))
