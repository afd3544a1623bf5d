"""What the page shows of a building: its mesh, parts with handles, numbers, points' heights."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from ..errors import HiproofError
from ..model import Building
from ..parametric.change import measure_rise, with_sizes
from ..write.meshes.triangles import pack_values, solid_mesh
from ..write.parameters import building_record, number

MOST_PAGE_POINTS = 4000  # points drawn of a building, at most
PAGE_FIGURES = ("points", "share_within_20cm", "unexplained_area_m2", "rmse", "p95", "density")


def describe_building(building: Building, points: np.ndarray) -> dict[str, Any]:
    """Return the building and the `points` (n, 3) drawn as JSON about its roof's origin."""
    parts = building_record(building)["parts"]
    roof = building.roof
    local = roof.frame.to_local(points)
    quality = dataclasses.asdict(building.quality)
    return {
        "parts": parts,
        "origin": roof.frame.origin.tolist(),
        "handles": [place_handles(part) for part in parts],
        "type": building.type,
        "status": building.status.code,
        "detail": building.detail,
        "figures": {
            **{name: number(quality[name], 4) for name in PAGE_FIGURES},
            "volume_m3": number(building.solid.volume, 1),
            "ridge_height": number(building.solid.vertices[:, 2].max(), 3),
            "z_ground": number(building.z_ground, 3),
        },
        "mesh": make_mesh(building),
        "gaps": pack_values(
            np.nan_to_num(local[:, 2] - roof.height_at(local[:, :2]), nan=9.0), "<f4"
        ),
    }


def select_points(points: np.ndarray) -> np.ndarray:
    """Return an even selection (m, 3) of the points, as many as the page draws."""
    return points[:: max(1, -(-len(points) // MOST_PAGE_POINTS))]


def place_handles(part: dict[str, Any]) -> dict[str, Any]:
    """Return a part's handles about the origin: its rectangle, its eave and its ridge."""
    try:
        sized = with_sizes(part)
        width, length = (sized["parameters"][name] for name in ("width", "length"))
        rise = measure_rise(part)
    except (HiproofError, KeyError, ZeroDivisionError):  # a shape of somebody's own has no handles
        return {}
    x, y, z = sized["position"]
    turn = math.radians(sized.get("rotation") or 0.0)
    return {
        "place": [x, y],
        "turn": turn,
        "width": width,
        "length": length,
        "eave": z,
        "ridge": z + rise,
    }


def make_mesh(building: Building) -> dict[str, str]:
    """Return triangles about the origin, the part of each (-1: a wall), and roof edges."""
    mesh = solid_mesh(building.solid.move(-building.roof.frame.origin))
    return {
        "corners": pack_values(mesh.corners, "<f4"),
        "part": pack_values(mesh.part, "<i4"),
        "edges": pack_values(mesh.edges, "<f4"),
    }
