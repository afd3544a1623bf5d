"""Measure the prose of a Markdown page: its words, its sentences, its long lines.

usage: python tests/prose.py [PAGE ...]
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
FRONT_PAGES = (
    "README",
    "ARCHITECTURE",
    "CONTRIBUTING",
    "CHANGELOG",
    "SECURITY",
    "benchmarks/RESULTS",
)
PAGES = [
    *(ROOT / f"{name}.md" for name in FRONT_PAGES),
    *sorted((ROOT / "docs").rglob("*.md")),
]
COLUMNS = 100  # of a line, tables and links that cannot be broken apart


def extract_prose(text: str) -> str:
    """The running text of a page, without code, tables, headings and the targets of links."""
    text = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    lines = [
        line
        for line in text.splitlines()
        if not re.match(r"\||#|!\[|:::", line) and not (line.startswith("    ") and line.strip())
    ]
    return re.sub(r"\]\([^)]*\)", "]", "\n".join(lines))


def split_sentences(text: str) -> list[str]:
    """The sentences of a page. A list item ends one, with or without a full stop."""
    blocks = re.split(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.) )", extract_prose(text))
    joined = [" ".join(block.split()) for block in blocks]
    results = [
        part for block in joined for part in re.split(r"(?<=[.!?:])\s+(?=[A-Z`*\[(])", block)
    ]
    return [part for part in results if len(part.split()) > 1]


def count_words(text: str) -> np.ndarray:
    """Words of each sentence of a page (n,)."""
    return np.array([len(part.split()) for part in split_sentences(text)] or [0])


def find_long_lines(text: str) -> list[str]:
    """Lines over COLUMNS outside of tables, but for those that are one unbreakable link."""
    outside = (line for line in text.splitlines() if not line.startswith("|"))
    return [line for line in outside if len(line) > COLUMNS and " " in line.strip()]


def main(pages: list[Path]) -> None:
    for page in pages:
        text = page.read_text(encoding="utf-8")
        words = count_words(text)
        print(
            f"{page.relative_to(ROOT)}: {len(text.split())} words; a sentence {words.mean():.1f} in"
            f" the mean, {np.percentile(words, 90):.0f} at p90, {words.max()} at most;"
            f" {len(find_long_lines(text))} long lines"
        )


if __name__ == "__main__":
    main([Path(name).resolve() for name in sys.argv[1:]] or PAGES)
