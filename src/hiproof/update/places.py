"""Places that changed as parameters.jsonl holds them.

Roofs are brought into one frame for that.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import shapely

from ..frames import LocalFrame
from ..model import Building, Roof
from ..parametric.building import build
from ..status import ChangeKind, Status
from ..write.parameters import outline_record
from .cells import measure_residuals
from .ground import Ground
from .judge import OVER_GROUND_M, ChangeVerdict
from .kinds import Difference

DIFFERENCE_DIGITS = 4  # of differences: tenths of a millimetre
PLACE_DIGITS = 3  # of the outlines of places: millimetres

BETTER_SHARE = 1 / 3
"""Least share of the contradicting points that a new roof has to explain. Where a side was lost,
less than all of it is cut out of the outline, so that some ground lies under the new roof, too."""

NEAR_M, WELL_SHARE = 0.2, 0.6
"""Distance (m) from a roof within which it explains a point, and least share of the points that a
new roof has to explain: of usual roofs nine in ten are."""


def explains(new: Roof, old: Roof, verdict: ChangeVerdict) -> bool:
    """Return whether the new roof explains the new points better, and well.

    It has to explain points that contradict the earlier one. Both roofs are in one frame.
    """
    c = verdict.comparison
    members = [cluster.members for cluster in verdict.clusters]
    chosen = np.isin(c.number, np.concatenate(members)) if members else c.number >= 0
    is_near = [measure_distances(roof, c.points, verdict.ground) <= NEAR_M for roof in (new, old)]
    share, share_before = (float(np.mean(near[chosen])) for near in is_near)
    return share >= max(BETTER_SHARE, share_before) and float(np.mean(is_near[0])) >= WELL_SHARE


def measure_distances(roof: Roof, points: np.ndarray, ground: Ground) -> np.ndarray:
    """Return the vertical distances (n,) of points (n, 3) from a roof.

    Beside the roof they are those from the ground: points on it have none.
    """
    result = np.abs(measure_residuals(roof, points))
    is_low = points[:, 2] - ground.height_at(points) < OVER_GROUND_M
    beside = np.where(is_low, 0.0, np.inf)
    return np.where(np.isfinite(result), result, beside)


def move_to_frame(roof: Roof, target: Roof) -> Roof:
    """Return the roof with its parts in the frame of `target`."""
    shift = roof.frame.origin - target.frame.origin
    parts = tuple(
        dataclasses.replace(
            part,
            translation=part.translation + shift,
            pieces=tuple(piece.move(shift) for piece in part.pieces),
        )
        for part in roof.parts
    )
    return Roof(parts, shapely.transform(roof.outline, lambda xy: xy + shift[:2]), target.frame)


def end_building(earlier: Building) -> Building:
    """Return the building without its model: its ground lies bare."""
    outline = earlier.roof.world_outline
    return Building(
        earlier.id,
        Status.NO_BUILDING,
        f"{Status.NO_BUILDING.value}; it was demolished",
        footprint=outline,
        attributes=earlier.attributes,
    )


def end_model(record: dict[str, Any], survey: str) -> list[dict[str, Any]]:
    """Return the history of an earlier object, and its own model at the end.

    `survey` is the date of the survey that no longer shows it. An object without a model adds
    nothing.
    """
    change = record.get("change") or {}
    history = list(change.get("history", []))
    if not record.get("parts"):
        return history
    earlier = build(record)
    outline = earlier.roof.world_outline
    rounded = shapely.transform(outline, lambda xy: np.round(xy, PLACE_DIGITS))
    ended = {
        "id": earlier.id,
        "valid_from": change.get("valid_from"),
        "valid_to": survey,
        "type": earlier.type,
        "z_ground": earlier.z_ground,
        "z_top": round_length(earlier.solid.vertices[:, 2].max()),
        "outline": outline_record(rounded),
        "origin": record["origin"],
        "parts": record["parts"],
    }
    return [*history, ended]


def demolish(earlier: Building) -> Difference:
    """Return the place that a demolished building leaves, in the roof's frame."""
    outline = earlier.roof.outline
    height = earlier.z_ground - float(np.median(earlier.solid.vertices[:, 2]))
    return Difference(ChangeKind.DEMOLISHED, outline.area, outline, difference_m=height)


def place_new(new: Building, was_bare: bool) -> list[dict[str, Any]]:
    """Return the place of a new building, where its ground was bare before."""
    if not was_bare:
        return []
    area = new.roof.world_outline
    height = float(np.median(new.solid.vertices[:, 2]) - new.z_ground)
    return record_places([Difference(ChangeKind.BUILT, area.area, area, (-1, 0), height)])


def record_places(
    places: list[Difference], frame: LocalFrame | None = None
) -> list[dict[str, Any]]:
    """Return places that changed as parameters.jsonl holds them.

    `frame` is that of their outlines, None for the world.
    """
    result = []
    for place in places:
        area = place.place if frame is None else shapely.transform(place.place, frame.to_world)
        polygons = [g for g in shapely.get_parts(area) if g.geom_type == "Polygon"]
        rounded = [shapely.transform(g, lambda xy: np.round(xy, PLACE_DIGITS)) for g in polygons]
        result.append(
            {
                "kind": place.kind.code,
                "difference": round_length(place.difference_m),
                "sigma": round_length(place.sigma_m),
                "area": round_length(place.area_m2),
                "parts": [None if part < 0 else part for part in place.parts],
                "outlines": [outline_record(polygon) for polygon in rounded],
            }
        )
    return result


def round_length(value: float) -> float | None:
    """Round a length for a record, None where it is unknown."""
    return round(float(value), DIFFERENCE_DIGITS) if math.isfinite(value) else None
