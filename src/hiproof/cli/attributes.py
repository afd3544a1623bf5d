"""`hiproof attributes`: every attribute and table of a run's files, with unit and meaning."""

from __future__ import annotations


def run() -> int:
    from ..write.attribute_list import attributes_text

    print(attributes_text(), end="")
    return 0
