"""The areas in which the parts of a roof show from above.

The areas are the plan of the parts' surfaces. They do not overlap, and together they make up the
outline.

A surface that several parts have in common, for they lie in one plane, names one of them: it is cut
along their outlines.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate, chain

import numpy as np
import shapely

from ..geometry.rings import intersect, repair_polygons, subtract, unite
from .roof import Part, Roof
from .solid import ROOF, Face, Solid

# equal planes differ by micrometres, and composing moves a vertex by a millimetre
SAME_PLANE_M = 0.005
GRID_M = 1e-4  # on which solids are composed, so that areas have no corners of their own
AREA_DIGITS = 4  # of areas in square metres, as the tables of parts round them
# of what one part has of a common surface; less is a sliver between outlines that miss one another
SURFACE_SLIVER_M2 = 0.05


def unite_visible_pieces(
    roof: Roof, visible: Sequence[Sequence[shapely.Geometry]]
) -> list[shapely.Geometry]:
    """Return each part's visible area in world coordinates, empty for a hidden part."""
    united = [unite(pieces, GRID_M) for pieces in visible]
    return shapely.transform(np.array(united, object), roof.frame.to_world).tolist()


def measure_visible_pieces(visible: Sequence[Sequence[shapely.Geometry]]) -> tuple[float, ...]:
    """Return each part's visible plan area (m2), rounded so that equal parts' are equal."""
    return tuple(round(float(shapely.area(pieces).sum()), AREA_DIGITS) for pieces in visible)


def compute_visible_pieces(roof: Roof, solid: Solid) -> list[list[shapely.Geometry]]:
    """Return each part's visible pieces, which do not overlap, in the roof's local frame."""
    local = solid.move(-roof.frame.origin)
    visible: list[list[shapely.Geometry]] = [[] for _ in roof.parts]
    faces = local.select_faces(ROOF)
    for face, neighbours in zip(
        faces, parts_in_plane(faces, local.vertices, list_planes(roof)), strict=True
    ):
        remainder = local.project_face(face)
        for other in neighbours:
            remainder, others_own = share_surface(
                remainder, unite_outlines(roof.parts[face.part]), unite_outlines(roof.parts[other])
            )
            visible[other].append(others_own)
        visible[face.part].append(remainder)
    return visible


def list_planes(roof: Roof) -> np.ndarray:
    """Return all planes (k, 4): the part's number, then a, b, c of z = a x + b y + c."""
    parts = enumerate(roof.parts)
    return np.array(
        [
            (number, *plane)
            for number, part in parts
            for piece in part.pieces
            for plane in piece.planes
        ]
    ).reshape(-1, 4)


def parts_in_plane(
    faces: Sequence[Face], vertices: np.ndarray, planes: np.ndarray
) -> list[list[int]]:
    """Return for each face the other parts with a plane in which its `vertices` lie."""
    if not faces or len(set(planes[:, 0].tolist())) < 2:
        return [[] for _ in faces]
    of_faces = [[vertex for ring in face.rings for vertex in ring] for face in faces]
    corners = vertices[list(chain.from_iterable(of_faces))]
    off = np.abs(corners[:, :2] @ planes[:, 1:3].T + planes[:, 3] - corners[:, 2:])
    lies_in = np.maximum.reduceat(off, [0, *accumulate(map(len, of_faces[:-1]))]) < SAME_PLANE_M
    return [
        sorted(set(planes[plane_mask, 0].astype(int).tolist()) - {f.part})
        for f, plane_mask in zip(faces, lies_in, strict=True)
    ]


def share_surface(
    area: shapely.Geometry, drawn_area: shapely.Geometry, other: shapely.Geometry
) -> tuple[shapely.Geometry, shapely.Geometry]:
    """Divide `area` between the part drawn as `drawn_area` and another part.

    Returns what remains, and what goes to the part drawn as `other`: the area where that part alone
    is drawn, and slivers beside it.
    """
    slivers = without_slivers(subtract(area, drawn_area, GRID_M))
    others_own = without_slivers(intersect(slivers, other, GRID_M))
    if others_own.is_empty:
        return area, others_own
    remainder = without_slivers(subtract(area, others_own, GRID_M))
    return remainder, without_slivers(subtract(area, remainder, GRID_M), least_m2=0.0)


def without_slivers(
    area: shapely.Geometry, least_m2: float = SURFACE_SLIVER_M2
) -> shapely.Geometry:
    """Return polygons of at least `least_m2`, without lines that others shrank to."""
    pieces = shapely.get_parts(area)
    polygons = shapely.get_dimensions(pieces) == 2
    return shapely.multipolygons(pieces[polygons & (shapely.area(pieces) >= least_m2)])


def unite_outlines(part: Part) -> shapely.Geometry:
    """Return a part's outlines, which may touch themselves, as one area without spikes."""
    return shapely.union_all(repair_polygons([piece.outline for piece in part.pieces]))
