"""The data of the report's page: plain values and packed float32 about a local origin."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from ..status import Change, Status
from ..write.attribute_list import OWN
from ..write.colours import GRADE_COLOURS, NO_MODEL, STATUS_COLOURS, SURVEY_COLOURS, page_colours
from ..write.meshes.triangles import pack_values, solid_mesh
from .evaluation import TEXT_COLUMNS
from .metrics import plan_outline, psd
from .models import BuildingModel
from .run import EvaluatedRun

UNCHANGED = Change.UNCHANGED.code
POINTS_PER_BUILDING = 150  # points drawn of a building; enough to see where a roof is wrong
MOST_REPORT_POINTS = 600_000  # points in the page, 7 MB: what a browser still opens at once


def report_data(run: EvaluatedRun, outlines: Sequence[shapely.Geometry | None]) -> dict[str, Any]:
    """Return the page's data for JSON; `outlines` are world polygons, None if unknown."""
    origin = scene_origin(run, outlines)
    buildings = [building_data(run, i, outlines[i], origin) for i in range(len(run.models))]
    types = sorted(
        {name for model in run.models for name in (model.roof_type, *model.part_types.values())}
    )
    return {
        "buildings": buildings,
        "colours": page_colours()
        | {"status": STATUS_COLOURS, "quality": GRADE_COLOURS, "surveys": SURVEY_COLOURS},
        "types": types,
        "mesh": mesh_data(run, types, origin),
        "points": point_data(run, origin),
    }


def scene_origin(run: EvaluatedRun, outlines: Sequence[shapely.Geometry | None]) -> np.ndarray:
    """Return a whole-metre corner (3,) below everything, so that float32 keeps millimetres."""
    corners = [model.solid.vertices.min(axis=0) for model in run.models if model.solid is not None]
    corners += [
        np.array([*outline.bounds[:2], np.inf]) for outline in outlines if outline is not None
    ]
    smallest = np.min(corners, axis=0) if corners else np.zeros(3)
    return np.where(np.isfinite(smallest), np.floor(smallest), 0.0)


def building_data(
    run: EvaluatedRun, index: int, outline: shapely.Geometry | None, origin: np.ndarray
) -> dict[str, Any]:
    """Return what the page shows of a building, residuals by points, else the model's own."""
    model, figures, is_update = run.models[index], run.figures[index], "update" in run.record
    status = Status.__members__.get(model.status.upper())
    residual: Any = figures.quality.psd_mean
    if not np.isfinite(residual):
        residual = model.attributes.get("hiproof_psd_mean")
    measured = {name: value for name, value in figures.row().items() if name not in TEXT_COLUMNS}
    return {
        "id": model.id,
        "type": model.roof_type,
        "status": model.status if model.status in STATUS_COLOURS else NO_MODEL,
        "quality": model.grade,
        "outcome": status.value if status else model.status,
        "residual": finite(residual),
        "sun": finite(mean_sun(model)),
        "change": model.attributes.get(f"{OWN}change") or (UNCHANGED if is_update else None),
        "measured": {
            name: finite(value) for name, value in measured.items() if finite(value) is not None
        },
        "attributes": {
            name: finite(value) for name, value in model.attributes.items() if value is not None
        },
        "rings": outline_rings(outline, origin),
    }


def mean_sun(model: BuildingModel) -> float | None:
    """Return the irradiation (kWh/m2) of a roof in a year, None where it is unknown."""
    values = model.attributes
    areas = [values.get(f"{OWN}{kind}_roof_area_m2") for kind in ("flat", "sloped")]
    area = sum(value for value in areas if isinstance(value, (int, float)))
    total = values.get(f"{OWN}roof_sun_kwh")
    return total / area if isinstance(total, (int, float)) and area > 0 else None


def finite(value: Any) -> Any:
    """Convert `value` to one of JSON: a rounded number, None for NaN, else text."""
    if isinstance(value, (bool, str, int)) or value is None:
        return value
    if isinstance(value, (float, np.floating)):
        return round(float(value), 4) if np.isfinite(value) else None
    return str(value)


def outline_rings(outline: shapely.Geometry | None, origin: np.ndarray) -> list[list[float]]:
    """Return rings of (multi)polygons as flat x, y lists about the origin, to the centimetre."""
    if outline is None:
        return []
    rings = [
        ring
        for polygon in shapely.get_parts(outline)
        for ring in (polygon.exterior, *polygon.interiors)
    ]
    return [
        np.round(shapely.get_coordinates(ring) - origin[:2], 2).ravel().tolist() for ring in rings
    ]


def mesh_data(run: EvaluatedRun, types: list[str], origin: np.ndarray) -> dict[str, str]:
    """Return triangles of roofs and walls, and roof edges.

    They are corners (t, 3, 3), building (t,), `roof_places` (t,), the sun (t,), and edges
    (e, 2, 3).
    """
    meshes = [
        (k, model, solid_mesh(model.solid.move(-origin)))
        for k, model in enumerate(run.models)
        if model.solid is not None
    ]
    # -1 where unknown; nothing in a run without the sun
    suns = [
        np.nan_to_num(np.array(model.suns)[mesh.face], nan=-1.0)
        if model.suns
        else np.full(len(mesh.face), -1.0)
        for _, model, mesh in meshes
    ]
    return {
        "corners": pack_all([mesh.corners for *_, mesh in meshes], "<f4"),
        "owner": pack_all([np.full(len(mesh.part), k) for k, _, mesh in meshes], "<u4"),
        "roof": pack_all([roof_places(model, m.part, types) for _, model, m in meshes], "u1"),
        "sun": pack_all(suns, "<f4") if any(model.suns for model in run.models) else "",
        "edges": pack_all([mesh.edges for *_, mesh in meshes], "<f4"),
    }


def pack_all(arrays: Sequence[Any], kind: str) -> str:
    """Pack arrays one after the other, nothing where there are none."""
    return pack_values(np.concatenate(arrays), kind) if arrays else ""


def roof_places(model: BuildingModel, part: np.ndarray, types: list[str]) -> list[int]:
    """Return each triangle's roof type as its place among `types`, from 1 on, 0 for walls."""
    return [
        0 if k < 0 else 1 + types.index(model.part_types.get(k, model.roof_type))
        for k in part.tolist()
    ]


def point_data(run: EvaluatedRun, origin: np.ndarray) -> dict[str, str]:
    """Return every k-th point (n, 3) of each building with its distance to the roof (n,)."""
    largest = max(1, min(POINTS_PER_BUILDING, MOST_REPORT_POINTS // max(len(run.models), 1)))
    places, distances = [], []
    for model, points in zip(run.models, run.points, strict=True):
        points = points[:: max(1, -(-len(points) // largest))]
        places.append(points - origin)
        distances.append(
            psd(model.solid, points) if model.solid is not None else np.full(len(points), np.inf)
        )
    nearness = [np.nan_to_num(values, posinf=9.0) for values in distances]
    return {"places": pack_all(places, "<f4"), "distances": pack_all(nearness, "<f4")}


def places_on_map(run: EvaluatedRun) -> list[shapely.Geometry | None]:
    """Return every model's plan outline, its footprint without a solid, None without either."""
    footprints = run.footprints or (None,) * len(run.models)
    return [
        plan_outline(model.solid) if model.solid is not None else footprint
        for model, footprint in zip(run.models, footprints, strict=True)
    ]
