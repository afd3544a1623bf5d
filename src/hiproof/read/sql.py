"""Names in SQL, as SQLite, PostgreSQL and GDAL read them."""

from __future__ import annotations


def quote(name: str) -> str:
    """Quote the name of a table or a column.

    >>> print(quote('so "called"'))
    "so ""called\"""
    """
    return '"' + name.replace('"', '""') + '"'
