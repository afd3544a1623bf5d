"""Laws of the documentation's language: short pages, short sentences, lines that fit."""

import re

import numpy as np
import pytest

from prose import PAGES, ROOT, count_words, find_long_lines, split_sentences

MOST_WORDS = {"README.md": 700, "ARCHITECTURE.md": 900, "CHANGELOG.md": 400}
LONGEST_SENTENCE = 40  # words
MADE = {"attributes.md"}  # by `hiproof attributes`: its lines list files
README_MEAN, README_P90, P90 = 16, 26, 28  # words of a sentence

every_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))


@pytest.mark.parametrize("name", MOST_WORDS)
def test_a_front_page_is_short(name):
    assert len((ROOT / name).read_text(encoding="utf-8").split()) <= MOST_WORDS[name]


@every_page
def test_no_sentence_is_long(page):
    text = page.read_text(encoding="utf-8")
    assert [part for part in split_sentences(text) if len(part.split()) > LONGEST_SENTENCE] == []


@every_page
def test_lines_fit(page):
    assert page.name in MADE or find_long_lines(page.read_text(encoding="utf-8")) == []


def test_the_readme_is_short_in_the_mean():
    counts = count_words((ROOT / "README.md").read_text(encoding="utf-8"))
    assert counts.mean() <= README_MEAN and np.percentile(counts, 90) <= README_P90


@every_page
def test_nine_sentences_in_ten_are_short(page):
    counts = count_words(page.read_text(encoding="utf-8"))
    assert page.name in MADE or np.percentile(counts, 90) <= P90


def test_prose_is_told_from_code_and_tables():
    text = (
        "# A title\n\nOne two. Three four\nfive.\n\n- item one\n- item two\n\n"
        "| a | b |\n\n    code here\n"
    )
    assert split_sentences(text) == ["One two.", "Three four five.", "- item one", "- item two"]
    assert not re.search("code|title|\\|", " ".join(split_sentences(text)))
