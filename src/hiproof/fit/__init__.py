"""Fitting: one primitive to the points of one roof (single.py) by the likelihood or the paper's objective; compounds in compound/.

`fit_roof` is imported on first use, because it brings the compiler along.
"""

from __future__ import annotations


def __getattr__(name: str):
    if name == "fit_roof":
        from .single import fit_roof

        return fit_roof
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
