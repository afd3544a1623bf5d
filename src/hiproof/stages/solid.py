"""The solid of a roof, with terrain, passages, installations and overhangs."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import shapely

from ..errors import CompositionError
from ..geometry.outline_edges import describe_sides, list_outline_edges
from ..geometry.rings import unite
from ..model import Building, Footprint, Roof, Solid
from ..read.plausible import HIGHEST_BUILDING_M
from ..settings import Settings
from ..status import Doubt, Status
from .fit import Fitted, flat
from .ground import Ground
from .outline import largest_polygon
from .points import finite
from .remarks import add_remark


def solid_or_simpler(
    roof: Roof, points: np.ndarray, ground: Ground, fitted: Fitted, settings: Settings
) -> tuple[Roof, Solid | None, Fitted]:
    """Return the rounded roof and its checked solid, in the local frame.

    Where it cannot become a valid one that can be read again, parts that fail are given up, and in
    the end all are, for a flat block.
    """
    from ..compose import compose, compose_simpler
    from ..compose.readable import compose_readable
    from ..compose.settle import settled_roof

    roof, z_ground = settled_roof(roof), ground.z - roof.frame.origin[2]
    try:
        return roof, compose_readable(roof, z_ground, settings), fitted
    except CompositionError as error:
        failure = error
    try:
        simpler, solid, given_up = compose_simpler(roof, z_ground, points, failure, settings)
        detail = f"{Status.SIMPLIFIED.value}: {given_up} ({failure})"
        return (
            simpler,
            solid,
            dataclasses.replace(
                fitted, parts=simpler.parts, status=Status.SIMPLIFIED, detail=detail
            ),
        )
    except CompositionError as error:
        text = f"{Status.SIMPLIFIED.value}: a flat block ({error})"
    fitted = flat(points, roof.outline, Status.SIMPLIFIED, text)
    roof = settled_roof(dataclasses.replace(roof, parts=fitted.parts))
    try:
        return roof, compose(roof, z_ground, settings), fitted
    except CompositionError as error:
        return (
            roof,
            None,
            dataclasses.replace(fitted, status=Status.BAD_FOOTPRINT, detail=str(error)),
        )


def reach_terrain(building: Building, ground: Ground, settings: Settings) -> Building:
    """Return the building with walls down to the terrain if so set; a remark if not."""
    if building.built is None or settings.reconstruct.walls == "level":
        return building
    if not ground.intersection:
        return add_remark(building, "its walls end at one level, for no terrain is known")
    from ..compose.underside import add_underside
    from ..model import Underside

    origin = building.roof.frame.origin
    underside = Underside(terrain=tuple(line - origin for line in ground.intersection))
    try:
        finished = dataclasses.replace(building, built=add_underside(building.model, underside))
    except CompositionError as error:
        return add_remark(building, f"its walls end at one level ({error})")
    share = 1.0 - ground.known_share
    level = f"its walls end at one level along {100 * share:.0f} % of its outline"
    return add_remark(finished, f"{level}, for no terrain is known there" if share else "")


def list_passages(
    footprint: shapely.Geometry | Footprint | None, shift: tuple[float, float]
) -> list[tuple[shapely.Polygon, float]]:
    """Return the passages of a footprint, moved with it by `shift`."""
    if not isinstance(footprint, Footprint):
        return []
    return [
        (shapely.transform(polygon, lambda xy: xy + shift), clearance)
        for polygon, clearance in footprint.passages
    ]


def open_passages(
    building: Building, ground: Ground, footprint: shapely.Geometry | Footprint | None
) -> Building:
    """Return the building with its footprint's passages; a remark says which are not."""
    passages = list_passages(footprint, building.shift)
    if building.built is None or not passages:
        return building
    from ..compose.settle import PLAN_DIGITS, round_number, settled_outline
    from ..compose.underside import add_passage

    frame, model = building.roof.frame, building.model
    for polygon, clearance in passages:
        outline = settled_outline(largest_polygon(shapely.transform(polygon, frame.to_local)))
        ceiling = round_number(ground.z + min(clearance, HIGHEST_BUILDING_M), PLAN_DIGITS)
        try:
            model = add_passage(model, outline, ceiling)
        except CompositionError as error:
            building = add_remark(building, f"a passage was left out ({error})")
    return dataclasses.replace(building, built=model)


def add_installations(building: Building, points: np.ndarray, settings: Settings) -> Building:
    """Return the building with objects on its roof if so set; `points` in its frame."""
    if building.built is None or not settings.reconstruct.installations:
        return building
    from ..fit.installations import find_installations

    found = find_installations(building.roof, points)
    return dataclasses.replace(
        building, built=dataclasses.replace(building.model, installations=found)
    )


def add_overhangs(
    building: Building,
    points: np.ndarray,
    neighbours: Sequence[shapely.Geometry],
    settings: Settings,
) -> Building:
    """Return the building with its overhangs (LoD2.3), where settings ask for them.

    Its `points` (n, 3), also those around it, and the outlines of its `neighbours` are in the
    world. A remark says where overhangs were left out, and why.
    """
    if building.built is None or "2.3" not in settings.write.lods:
        return building
    from ..compose.eaves import add_valid_eaves, measure_left_out
    from ..fit.overhang import find_eaves

    frame = building.roof.frame
    area = unite([shapely.transform(n, frame.to_local) for n in neighbours])
    eaves, behind_neighbours = find_eaves(
        building, frame.to_local(finite(points)), area, settings.reconstruct
    )
    model, reason = add_valid_eaves(building.model, eaves)
    edges = list_outline_edges(building.roof.outline)
    sides = [
        f"along {text} ({why})"
        for lengths, why in (
            (behind_neighbours, "a neighbour stands there"),
            (measure_left_out(model, eaves), reason),
        )
        if (text := describe_sides(edges, lengths))
    ]
    remark = f"its {Doubt.OVERHANGS_LEFT_OUT.value} {' and '.join(sides)}"
    return add_remark(dataclasses.replace(building, built=model), remark if sides else "")
