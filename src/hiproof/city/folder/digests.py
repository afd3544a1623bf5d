"""Digests of buildings: where the digest is the same, the texts of a building are.

A building's answer depends on the building alone, so what a run knows of it still holds where its
footprints, its overrides, the choice of buildings or the work tiles changed.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from typing import Any

from ..plan.work_plan import WorkPlan, encode_passages


def list_buildings(
    plan: WorkPlan, overrides: dict[int, dict[str, Any]]
) -> Iterator[tuple[int, str, bytes]]:
    """Yield the position, the work tile and the digest of each building of a plan.

    `overrides` are those of its buildings by position.
    """
    common = [plan.settings.to_dict(), plan.crs_wkt, plan.translate.tolist(), plan.around_m]
    shared = make_digest(common).hex()
    for tile, members in plan.tiles.items():
        for index in members:
            yield index, tile, digest_building(plan, index, shared, overrides.get(index))


def digest_building(
    plan: WorkPlan, index: int, shared: str, override: dict[str, Any] | None
) -> bytes:
    """Return a digest of what a building's texts depend on, but for the points.

    `shared` is that of what all texts of the plan have in common.
    """
    job = plan.jobs[index]
    row = plan.outlines.row(index) if plan.moves_rows else []
    neighbours = plan.outlines.select_near(index, plan.beyond_m) if plan.beyond_m else []
    inputs = [
        shared,
        job.id,
        job.area.wkb_hex,
        job.footprint.attributes if job.footprint else None,
        plan.list_names(job),
        [polygon.wkb_hex for polygon in row],
        encode_passages(job),
        [polygon.wkb_hex for polygon in neighbours],
        override,
    ]
    return make_digest(inputs)


def make_digest(values: list) -> bytes:
    text = json.dumps(values, sort_keys=True, default=str)
    return hashlib.blake2b(text.encode(), digest_size=16).digest()
