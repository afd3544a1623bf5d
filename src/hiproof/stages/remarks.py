"""Remarks on a building, in its detail."""

from __future__ import annotations

import dataclasses

from ..model import Building
from ..status import Grade


def add_remark(building: Building, *remarks: str) -> Building:
    """Add remarks to a building's detail; empty ones are none."""
    if not any(remarks):
        return building
    detail = "; ".join(filter(None, (building.detail or building.status.value, *remarks)))
    return dataclasses.replace(building, detail=detail)


def add_finding(building: Building, finding: str) -> Building:
    """Add a remark that speaks against a model, which then is fair at best."""
    grade = Grade.FAIR if building.grade is Grade.GOOD else building.grade
    return add_remark(dataclasses.replace(building, grade=grade), finding)
