"""A model with overhangs: its roof over a larger outline, or its walls within it."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import shapely

from ..errors import CompositionError
from ..geometry.components import label_components
from ..geometry.outline_edges import FARTHEST_MITRE, OutlineEdges, list_outline_edges, make_strips
from ..geometry.rings import repair_polygons, subtract, unite, with_area
from ..model import GROUND, ROOF, Eaves, Model, Overhang, Piece, Roof, Solid
from ..model.overhang import ROOF_EDGE, WALLS
from ..settings import ComposeSettings, Settings
from .arrangement import GRID_M
from .check import Finding, check_solid
from .lids import to_grid
from .overhang import hang_over
from .settle import PLAN_DIGITS
from .solid import compose
from .underside import list_caps

CORNER_GAP_M = 0.002  # between corners of walls; rounding may part one corner by less


def set_walls_in(
    outline: shapely.Polygon, widths: np.ndarray, least_width_m: float
) -> shapely.Geometry:
    """Return areas of walls `widths` (n,) inside an outline, `least_width_m` apart at least."""
    strips = make_strips(list_outline_edges(outline), widths, side=-1.0)
    taken = [repair_polygons(shapely.polygons(strips[k])) for k in np.flatnonzero(widths)]
    rest = subtract(outline, shapely.union_all(taken))
    walls = tidy_walls(rest, outline, least_width_m)
    if walls.is_empty:
        raise CompositionError(
            "expected walls within the roof, got none; assume a shorter overhang"
        )
    return walls


def tidy_walls(
    walls: shapely.Geometry, outline: shapely.Polygon, least_width_m: float
) -> shapely.Geometry:
    """Return the areas within walls without narrow ones and narrow gaps."""
    half = least_width_m / 2
    wide = offset(offset(offset(walls, -half), least_width_m), -half)
    return with_area(shapely.simplify(shapely.intersection(wide, outline), CORNER_GAP_M))


def join_walls(
    walls: shapely.Geometry, loose: shapely.Geometry, width_m: float
) -> shapely.Geometry:
    """Return `walls` with what lies between loose roofs and others if grown by `width_m`."""
    joined = offset(offset(walls, width_m), -width_m)
    return shapely.union(walls, shapely.intersection(joined, offset(loose, width_m)))


def offset(area: shapely.Geometry, distance_m: float) -> shapely.Geometry:
    """Return an area whose border has moved outwards, with sharp corners."""
    return shapely.buffer(area, distance_m, join_style="mitre", mitre_limit=FARTHEST_MITRE)


def find_loose_roofs(solid: Solid) -> tuple[shapely.Geometry, shapely.Geometry]:
    """Return the plan of roofs on no walls, and of those on walls apart from others."""
    links = [
        (ring[0], vertex) for face in solid.faces for ring in face.rings for vertex in ring[1:]
    ]
    links += [(face.rings[0][0], ring[0]) for face in solid.faces for ring in face.rings[1:]]
    label = label_components(len(solid.vertices), np.array(links).T)
    grounds, roofs = (
        [(label[face.rings[0][0]], solid.project_face(face)) for face in solid.select_faces(kind)]
        for kind in (GROUND, ROOF)
    )
    largest, _ = max(grounds, key=lambda item: item[1].area)
    standing = {number for number, _ in grounds}
    hanging = [area for number, area in roofs if number not in standing]
    apart = [area for number, area in roofs if number in standing - {largest}]
    return shapely.union_all(hanging), shapely.union_all(apart)


PIECE_ENDS_M = 0.01  # a piece of the roof so near to an edge of the outline ends there
LEAST_STRETCH_M = 0.05  # of an edge that belongs to a piece; a shorter one is a corner
JUST_INSIDE_M = 0.02  # from the edge, where it is asked which piece is seen
UNSEEN_PIECE_M = 0.01  # below the roof, from which a piece is not seen
THICKNESS_SHARES = (1.0, 0.95, 0.9)  # of a roof's thickness, tried until the solid is valid


def add_eaves(model: Model, eaves: Eaves) -> Model:
    """Return the model with `eaves` in its LoD2.3; raises CompositionError if none is valid."""
    widths = np.zeros(len(list_outline_edges(model.roof.outline).starts))
    for overhang in eaves.overhangs:
        widths[overhang.edge] = overhang.length
    if not widths.any():
        return replace(model, eaves=replace(eaves, solid=None))
    try:
        solid = make_solid(model, eaves, widths)
    except shapely.GEOSException as error:
        raise CompositionError(
            f"expected overhangs that can be drawn, got: {error}; leave them out"
        ) from error
    return replace(model, eaves=replace(eaves, solid=solid))


def make_solid(model: Model, eaves: Eaves, widths: np.ndarray) -> Solid:
    """Return the solid (world) with overhangs of `widths` (n,) at the outline's edges."""
    origin = model.roof.frame.origin
    level = model.on_one_level
    local = Solid(np.round(level.vertices - origin, PLAN_DIGITS), level.faces)
    if eaves.footprint_kind == WALLS:
        options = model.compose or ComposeSettings()
        local = compose_over(widen_roof(model.roof, widths), local, options)
        solid, findings = close_solid(local, model, model.roof.outline, eaves.thickness)
    else:
        solid, findings = make_inner_solid(local, model, eaves, widths)
    if findings:
        raise CompositionError(
            "expected a valid solid with overhangs, got one that is none by ISO 19107 (code "
            f"{findings[0].code}); leave them out"
        )
    return solid.move(origin)


def make_inner_solid(
    level: Solid, model: Model, eaves: Eaves, widths: np.ndarray
) -> tuple[Solid, tuple[Finding, ...]]:
    """Return the solid with walls inside the roof's outline, and its findings.

    Where it falls apart, roofs that hang loose keep their own walls and those that stand apart are
    joined to the others; if that is not enough, these keep their own walls too.
    """
    outline, options = model.roof.outline, model.compose or ComposeSettings()
    inside = set_walls_in(outline, widths, options.min_face_width_m)
    solid, findings = close_solid(level, model, inside, eaves.thickness)
    if findings:
        hanging, apart = find_loose_roofs(solid)
        loose = shapely.union(hanging, apart)
        for kept in (hanging, loose) if not loose.is_empty else ():
            walls = join_walls(shapely.union(inside, kept), loose, widths.max())
            walls = tidy_walls(walls, outline, options.min_face_width_m)
            solid, findings = close_solid(level, model, walls, eaves.thickness)
            if not findings:
                break
    return solid, findings


def close_solid(
    level: Solid, model: Model, walls: shapely.Geometry, thickness_m: float
) -> tuple[Solid, tuple[Finding, ...]]:
    """Return the solid over one level with walls and slabs, and its findings.

    All are in the roof's frame. Slabs get thinner where their undersides would touch a lower roof
    along a line.
    """
    options = model.compose or ComposeSettings()
    caps = list_caps(level, model.underside, options.ground_clearance_m)
    for cap, share in itertools.product(caps, THICKNESS_SHARES):
        thickness = round(share * thickness_m / GRID_M)
        solid = hang_over(level, model.underside, cap, to_grid(walls), thickness)
        findings = check_solid(solid, planarity_m=options.planarity_m)
        if not findings:
            break
    return solid, findings


def compose_over(roof: Roof, level: Solid, options: ComposeSettings) -> Solid:
    """Compose a wider roof on the ground of the solid over one level."""
    z_ground = find_ground(level)
    solid = compose(roof, z_ground, replace(Settings(), compose=options))
    if find_ground(solid) < z_ground - GRID_M:
        raise CompositionError(
            "expected overhangs over the ground, got some that reach down to it; leave them out"
        )
    return solid


def find_ground(solid: Solid) -> float:
    """Return the height on which a solid over one level stands."""
    return float(solid.vertices[solid.select_faces(GROUND)[0].rings[0][0], 2])


def widen_roof(roof: Roof, widths: np.ndarray) -> Roof:
    """Return the roof drawn out by `widths` (n,) (m) beyond the edges of its outline.

    Each piece goes on in its own planes beyond the stretches of edges at which it is seen.
    """
    edges = list_outline_edges(roof.outline)
    strips = make_strips(edges, widths)
    number_of = np.flatnonzero(widths)
    areas = [roof.outline, *repair_polygons(shapely.polygons(strips[number_of]))]
    area = unite(areas)
    if area.geom_type != "Polygon":
        raise CompositionError(
            "expected overhangs around one roof, got several areas; leave them out"
        )
    parts = tuple(
        replace(
            part,
            pieces=tuple(
                wider
                for piece in part.pieces
                for wider in widen_piece(piece, roof, edges, strips, number_of)
            ),
        )
        for part in roof.parts
    )
    return Roof(parts, area, roof.frame)


def widen_piece(
    piece: Piece, roof: Roof, edges: OutlineEdges, strips: np.ndarray, number_of: np.ndarray
) -> Iterable[Piece]:
    """Yield a piece with the strips that continue it."""
    near = shapely.buffer(piece.outline, PIECE_ENDS_M, join_style="mitre")
    added = []
    for k in number_of:
        for start, end in find_stretches(near, edges.starts[k], edges.ends[k]):
            if is_seen(piece, roof, edges, k, start, end):
                added.append(cut_strip(strips[k], start, end, roof.outline))
    if not added:
        yield piece
        return
    union = unite([repair_polygons(piece.outline), *added])
    for outline in shapely.get_parts(with_area(union)):
        yield Piece(outline, piece.planes)


def find_stretches(
    area: shapely.Geometry, start: np.ndarray, end: np.ndarray
) -> list[tuple[float, float]]:
    """Return the stretches of an edge in an area grown by PIECE_ENDS_M, as shares of length."""
    length = float(np.hypot(*(end - start)))
    shared = shapely.intersection(shapely.linestrings([start, end]), area)
    lines = [part for part in shapely.get_parts(shared) if part.geom_type == "LineString"]
    stretches = []
    for line in shapely.get_parts(shapely.line_merge(shapely.multilinestrings(lines))):
        along = sorted((shapely.get_coordinates(line) - start) @ (end - start) / length)
        first = 0.0 if along[0] <= PIECE_ENDS_M else along[0] + PIECE_ENDS_M
        last = length if along[-1] >= length - PIECE_ENDS_M else along[-1] - PIECE_ENDS_M
        if last - first >= min(LEAST_STRETCH_M, 0.5 * length):
            stretches.append((first / length, last / length))
    return stretches


def is_seen(
    piece: Piece, roof: Roof, edges: OutlineEdges, number: int, start: float, end: float
) -> bool:
    """Return whether a piece is the roof anywhere just inside a stretch of an edge."""
    share = start + (end - start) * np.linspace(0.05, 0.95, 7)
    xy = edges.starts[number] + share[:, None] * (edges.ends[number] - edges.starts[number])
    xy = xy - JUST_INSIDE_M * edges.normals[number]
    highest = roof.height_at(xy)
    return bool(~(piece.height_at(xy) < highest - UNSEEN_PIECE_M).all())


def cut_strip(
    strip: np.ndarray, start: float, end: float, outline: shapely.Polygon
) -> shapely.Geometry:
    """Return what lies beyond a stretch of an edge in its strip (4, 2), outside the outline."""
    a, b, outer_b, outer_a = strip
    across = (outer_a - a) - ((outer_a - a) @ (b - a)) / ((b - a) @ (b - a)) * (b - a)
    corners = [
        a + start * (b - a),
        a + end * (b - a),
        outer_b if end == 1.0 else a + end * (b - a) + across,
        outer_a if start == 0.0 else a + start * (b - a) + across,
    ]
    polygon = repair_polygons(shapely.polygons(corners))  # mitres at a short edge may cross
    return subtract(polygon, outline)


# Most solids that are made of one building: five overhangs of thirty can fail. Each takes a tenth
# of a second where a building has 44 edges.
MOST_TRIALS = 50
NO_ROOM = "the roof is too narrow for walls farther in"


def add_valid_eaves(model: Model, eaves: Eaves) -> tuple[Model, str]:
    """Return the model with as many `eaves` as are valid, long ones first; why not, second."""
    try:
        return add_eaves(model, eaves), NO_ROOM
    except CompositionError as error:
        reason = str(error)
    lengths = list_outline_edges(model.roof.outline).lengths
    longest_first = sorted(eaves.overhangs, key=lambda item: -lengths[item.edge])
    kept = keep_valid(model, eaves, longest_first)
    return add_eaves(model, select_overhangs(eaves, kept)), reason


def keep_valid(model: Model, eaves: Eaves, wanted: list[Overhang]) -> list[Overhang]:
    """Return as many of the `wanted` overhangs as make a valid solid together.

    With all of them there is none. They are tried in halves, and halves of those that fail, at most
    MOST_TRIALS times. What is not tried then is left out.
    """
    kept: list[Overhang] = []
    groups, trials = split_in_halves(wanted), 0
    while groups and trials < MOST_TRIALS:
        part = groups.pop(0)
        is_all = len(kept) + len(part) == len(wanted)
        trials += not is_all
        if not is_all and is_valid(model, select_overhangs(eaves, [*kept, *part])):
            kept += part
        else:
            groups = split_in_halves(part) + groups
    return kept


def split_in_halves(overhangs: list[Overhang]) -> list[list[Overhang]]:
    """Return the two halves of several overhangs, nothing of one."""
    half = len(overhangs) // 2
    return [overhangs[:half], overhangs[half:]] if half else []


def is_valid(model: Model, eaves: Eaves) -> bool:
    """Return whether a model with `eaves` has a valid solid."""
    try:
        add_eaves(model, eaves)
    except CompositionError:
        return False
    return True


def select_overhangs(eaves: Eaves, overhangs: Sequence[Overhang]) -> Eaves:
    """Return eaves with some of their overhangs, in the order of edges."""
    return replace(eaves, overhangs=tuple(sorted(overhangs, key=lambda item: item.edge)))


def measure_left_out(model: Model, wanted: Eaves) -> np.ndarray:
    """Measure along how much (n,) of each edge a wanted overhang is missing."""
    edges = list_outline_edges(model.roof.outline)
    result = np.zeros(len(edges.starts))
    numbers = [item.edge for item in wanted.overhangs]
    result[numbers] = edges.lengths[numbers]
    if model.eaves is None or model.eaves.solid is None:
        return result
    made = [item.edge for item in model.eaves.overhangs]
    result[made] = 0.0
    if wanted.footprint_kind == ROOF_EDGE:
        solid = model.eaves.solid.move(-model.roof.frame.origin)
        ground = shapely.union_all([solid.project_face(f) for f in solid.select_faces(GROUND)])
        near = shapely.buffer(shapely.boundary(ground), PIECE_ENDS_M)
        lines = shapely.linestrings(np.stack([edges.starts, edges.ends], axis=1)[made])
        shared = shapely.length(shapely.intersection(lines, near))
        result[made] = np.where(shared > LEAST_STRETCH_M, shared, 0.0)
    return result
