"""Remarks on a building, in its detail."""

from __future__ import annotations

import dataclasses

from ..model import Building
from ..status import Doubt


def add_remark(building: Building, remark: str) -> Building:
    """Add a remark to a building's detail."""
    return (
        dataclasses.replace(
            building, detail=f"{building.detail or building.status.value}; {remark}"
        )
        if remark
        else building
    )


def without_doubt(detail: str, doubt: Doubt) -> str:
    """Remove the remark of a doubt that no longer holds from a detail."""
    return "; ".join(remark for remark in detail.split("; ") if doubt.value not in remark)
