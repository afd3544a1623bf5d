"""The steps of `reconstruct`.

Every step takes values and returns values, and a failure becomes a status.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import shapely

from .errors import CompositionError, FitError, InputError
from .frames import LocalFrame
from .geometry.outline_edges import describe_sides, list_outline_edges
from .geometry.rings import repair_polygons
from .log import count_things
from .model import ROOF, Building, Fit, Footprint, Model, Part, Piece, Roof, Solid, as_xyz
from .read.plausible import is_plausible
from .settings import Settings
from .status import Doubt, Status

if TYPE_CHECKING:
    from .evaluate.metrics import Inner
    from .fit.align import Shift
    from .fit.site import Site
    from .read.terrain import Terrain

LIKELY = 0.05
"""A roof type less probable to the network is not fitted by the paper's objective."""

FEWEST_POINTS = 4
"""A roof plane and one point to doubt it; below that a building is a flat block."""

MOST_OUTLINE_VERTICES = 500
"""Of an outline that roofs are fitted over; the time grows with the square of them, and a building
has no more corners.
"""

PIECE_VERTICES = 64
"""Of an outline of thousands that are simplified at once: teeth take Douglas and Peucker the square
of them.
"""

SUNK_M = 0.2
"""Of ground above the lowest eave; less is how well both are known, where a roof comes down to the
ground.
"""

ASSUMED_WALL_M = 3.0
"""Height of the lowest wall where nothing is known of the terrain."""

WALLS_SEEN_M = 1.5
"""Of the lowest point below all of the roof, from which on walls are seen; a gutter or a bay hangs
less far down.
"""


@dataclass(frozen=True)
class Recognised:
    """The network's opinion.

    It has probabilities by roof type, empty without it, and a weight (n,) a point (1 roof, 0 not)
    for a fit of one primitive; a fit of several weighs all points alike.
    """

    weights: np.ndarray | None = None
    types: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Fitted:
    """Parts over an outline in the local frame, and the outcome of the fit.

    It says how they were chosen.
    """

    parts: tuple[Part, ...]
    outline: shapely.Polygon
    objective: float = math.nan
    types: dict[str, float] = field(default_factory=dict)
    status: Status = Status.MODELLED
    detail: str = ""


@dataclass(frozen=True)
class Ground:
    """The lower end of walls: its height, source and terrain line.

    The height is in the world, and the line runs along the outline. `known_share` is the share of
    the line's vertices whose height is known.
    """

    z: float
    source: str
    intersection: tuple[np.ndarray, ...] = ()
    known_share: float = 0.0


def refuse_other_kinds(footprint: object, terrain: object, settings: object) -> None:
    """Raise InputError for arguments of another kind, by their own names.

    What they hold may be anything.
    """
    if footprint is not None and not isinstance(footprint, (shapely.Geometry, Footprint)):
        raise InputError(
            f"expected a polygon of shapely as footprint, got {type(footprint).__name__}; make a "
            "shapely.Polygon of it"
        )
    if settings is not None and not isinstance(settings, Settings):
        raise InputError(
            f"expected hiproof.Settings as settings, got {type(settings).__name__}; make them by "
            "Settings.from_dict"
        )
    if terrain is not None and not hasattr(terrain, "height_at"):
        raise InputError(
            f"expected a terrain that answers height_at, got {type(terrain).__name__}; read a "
            "raster by hiproof.read_terrain"
        )


def fits_one(settings: Settings) -> bool:
    """Return whether one primitive is fitted to a building, as in the paper."""
    return settings.fit.parts == "one" or settings.fit.objective == "paper"


def asks_network(settings: Settings) -> bool:
    """Return whether the network is used.

    With `auto` it is only where one primitive is fitted to a building.
    """
    network = settings.segment.network
    return network == "always" or (network == "auto" and fits_one(settings))


def refuse_without_network(settings: Settings) -> None:
    """Raise InputError where the network is to be asked and cannot be.

    Evidence alone names other types, and builds other roofs, in some buildings: what is installed
    must not decide that unsaid, so who wants it has to say so.
    """
    if asks_network(settings):
        from .segment.inference import import_onnxruntime

        import_onnxruntime(alternative="--network never to go by the points alone")


def start_building(footprint: shapely.Polygon | Footprint | None, id: str) -> Building:
    """Return the outcome to start from.

    It has the building's name, its footprint and its attributes.
    """
    if isinstance(footprint, Footprint):
        input_values = {
            "footprint": footprint.polygon,
            "attributes": footprint.attributes,
            "shift": footprint.shift,
        }
        return Building(footprint.id, Status.MODELLED, **input_values)
    if footprint is not None and footprint.geom_type != "Polygon":
        footprint = largest_polygon(footprint)  # of several a building has one, and files hold one
    return Building(id, Status.MODELLED, footprint=footprint)


def align_footprint(
    building: Building, points: np.ndarray, settings: Settings
) -> tuple[Building, shapely.Polygon | None, str]:
    """Shift the footprint onto its points, with a remark.

    Points are those in and around it. Returns the building with the shift, and the footprint there.

    It stays where it is unless the evidence is clear, or its shift is known. Of thousands of
    vertices it keeps those that matter.
    """
    footprint, simplified = without_needless_vertices(building.footprint)
    if footprint is None or not (math.isfinite(footprint.area) and footprint.area):
        return building, footprint, simplified
    if any(building.shift):
        return building, shapely.transform(footprint, lambda c: c + building.shift), simplified
    if settings.reconstruct.align == "off":
        return building, footprint, simplified
    from .fit.align import find_shift

    polygon = largest_polygon(footprint)
    origin = np.floor(polygon.bounds[:2])
    result = find_shift(
        finite(points[:, :2]) - origin, shapely.transform(polygon, lambda c: c - origin)
    )
    if result.is_clear:
        shift = (round(float(result.xy[0]), 3), round(float(result.xy[1]), 3))
        building = dataclasses.replace(building, shift=shift)
        footprint = shapely.transform(footprint, lambda c: c + shift)
    return building, footprint, "; ".join(filter(None, (simplified, shift_remark(result))))


def shift_remark(result: Shift, of_row: int = 1) -> str:
    """Return a remark on a moved footprint or a roof of another size.

    It moved alone or with a row of so many. The remark is empty where there is neither.
    """
    remarks = []
    if result.is_clear:
        error, row = (
            float(np.hypot(*result.sigma)),
            f" with the {of_row} of its row" if of_row > 1 else "",
        )
        remarks.append(
            f"its footprint was moved{row} by ({result.xy[0]:.2f}, {result.xy[1]:.2f}) m, within "
            f"{error:.2f} m, onto its roof"
        )
    if result.is_size_clear:
        reach = "reaches {:.1f} m beyond" if result.beyond > 0 else "stays {:.1f} m inside"
        remarks.append(
            f"its roof {reach.format(abs(result.beyond))} its footprint on every side that shows"
        )
    return "; ".join(remarks)


def usable(
    points: np.ndarray, footprint: shapely.Polygon | None
) -> tuple[np.ndarray, shapely.Polygon | None, Status]:
    """Return finite, distinct points inside the footprint, in one order.

    The order in which they came does not matter.
    """
    if footprint is not None:
        footprint = largest_polygon(footprint)
        if footprint.is_empty or not footprint.area >= 0.1:
            return np.zeros((0, 3)), None, Status.BAD_FOOTPRINT
    points = finite(points)
    if footprint is not None:
        points = compress_inside(points, footprint)
    points = distinct(points)
    if len(points) == 0:
        return points, footprint, Status.NO_POINTS
    if footprint is None and (len(points) < FEWEST_POINTS or on_a_line(points[:, :2])):
        return points, None, Status.NO_ROOF
    return points, footprint, Status.MODELLED


def compress_inside(points: np.ndarray, area: shapely.Geometry) -> np.ndarray:
    """Return the points (n, 3) inside an area or on its border."""
    from .geometry.point_in_polygon import find_inside

    return points.compress(find_inside(area, points[:, 0], points[:, 1]), axis=0)


def largest_polygon(geometry: shapely.Geometry) -> shapely.Polygon:
    """Return the largest polygon of a geometry, made valid.

    It is empty where there is none.
    """
    geometry = geometry if geometry.is_valid else repair_polygons(geometry)
    if geometry.geom_type == "Polygon":
        return geometry
    polygons = [g for g in shapely.get_parts(geometry) if g.geom_type == "Polygon"]
    return max(polygons, key=lambda polygon: polygon.area, default=shapely.Polygon())


def finite(points: np.ndarray) -> np.ndarray:
    """Return the points (n, 2 or 3) with coordinates of this Earth.

    They are numbers; what stands for no value may be 3.4e38.
    """
    is_usable = is_plausible(points)
    return points if is_usable.all() else points[is_usable]


def distinct(points: np.ndarray) -> np.ndarray:
    """Sort points (n, 3) by x, y, z, without repeats.

    The same set gives the same array.
    """
    # complex numbers are in order by x, then by y
    plan = np.ascontiguousarray(points[:, :2]).view(complex)[:, 0]
    order = np.argsort(plan)
    if (plan[order[1:]] != plan[order[:-1]]).all():  # none over another, as nearly always
        return points.take(order, axis=0)
    points = points[np.lexsort(points.T[::-1])]
    differs = points[1:] != points[:-1]
    return (
        points[np.r_[True, differs[:, 0] | differs[:, 1] | differs[:, 2]]]
        if len(points)
        else points
    )


def on_a_line(xy: np.ndarray, width_m: float = 0.05) -> bool:
    """Return whether plan points (n, 2) lie in a strip too narrow for a roof."""
    across = np.linalg.svd(xy - xy.mean(axis=0), full_matrices=False)[2][-1]
    return bool(np.ptp((xy - xy.mean(axis=0)) @ across) < width_m)


def to_local(outline: shapely.Polygon | None, frame: LocalFrame) -> shapely.Polygon | None:
    return None if outline is None else shapely.transform(outline, frame.to_local)


def without_needless_vertices(
    outline: shapely.Polygon | None,
) -> tuple[shapely.Polygon | None, str]:
    """Return the outline to fit over, and what was left out.

    Of more than MOST_OUTLINE_VERTICES those within 1 cm of the line between their neighbours
    (Douglas and Peucker) go, or within 2, 4, 8 cm, ... until no more are left, and with them
    courtyards narrower than that.
    """
    if outline is None or (count := shapely.get_num_coordinates(outline)) <= MOST_OUTLINE_VERTICES:
        return outline, ""
    whole = largest_polygon(outline)
    simple, tolerance_m = whole, 0.005
    while shapely.get_num_coordinates(simple) > MOST_OUTLINE_VERTICES:
        tolerance_m *= 2
        courtyards = [
            ring for ring in whole.interiors if shapely.Polygon(ring).area > tolerance_m**2
        ]
        simple = largest_polygon(
            simplify_outline(shapely.Polygon(whole.exterior, courtyards), tolerance_m)
        )
    remainder = shapely.get_num_coordinates(simple)
    apart_m = shapely.distance(
        shapely.points(shapely.get_coordinates(whole.exterior)), simple.exterior
    ).max()
    if len(simple.interiors) < len(whole.interiors):
        apart_m = max(apart_m, tolerance_m)
    return (
        simple,
        f"its outline of {count} vertices was simplified to {remainder}, within {apart_m:.2g} m",
    )


def simplify_outline(polygon: shapely.Polygon, tolerance_m: float) -> shapely.Polygon:
    """Simplify a polygon by Douglas and Peucker.

    Their time grows with the square of the vertices, so thousands go piece by piece.
    """
    rings = []
    for ring in (polygon.exterior, *polygon.interiors):
        previous, xy = math.inf, shapely.get_coordinates(ring)
        while MOST_OUTLINE_VERTICES < len(xy) < 0.9 * previous:
            previous, xy = len(xy), simplified_in_pieces(xy, tolerance_m)
        rings.append(xy)
    outer, *holes = [ring if len(ring) >= 4 else None for ring in rings]
    if outer is None:
        return polygon
    rough = shapely.Polygon(outer, [hole for hole in holes if hole is not None])
    if shapely.get_num_coordinates(rough) > 2 * MOST_OUTLINE_VERTICES:
        return rough
    return shapely.simplify(rough, tolerance_m, preserve_topology=False)


def simplified_in_pieces(xy: np.ndarray, tolerance_m: float) -> np.ndarray:
    """Simplify a ring's coordinates (n, 2) in pieces of PIECE_VERTICES edges."""
    ends = np.append(np.arange(0, len(xy) - 2, PIECE_VERTICES), len(xy) - 1)
    vertices = np.concatenate(
        [np.arange(first, last + 1) for first, last in itertools.pairwise(ends)]
    )
    pieces = shapely.linestrings(
        xy[vertices], indices=np.repeat(np.arange(len(ends) - 1), np.diff(ends) + 1)
    )
    simple, piece = shapely.get_coordinates(
        shapely.simplify(pieces, tolerance_m, preserve_topology=False), return_index=True
    )
    # each piece begins where the one before it ends
    return simple[np.append(piece[1:] == piece[:-1], True)]


def look_at_ground(
    points: np.ndarray,
    outline: shapely.Polygon | None,
    ground: np.ndarray | None,
    frame: LocalFrame,
    terrain: Terrain | None,
    settings: Settings,
) -> Site:
    """Remove bare ground from points and outline, both in the local frame.

    The result may be that nothing stands there.
    """
    from .fit.site import Site, look_at_ground

    if outline is None or (terrain is None and ground is None):
        return Site(points, outline)
    ground = np.zeros((0, 3)) if ground is None else frame.to_local(finite(ground))
    return look_at_ground(points, outline, ground, frame, terrain, settings)


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


def recognise(points: np.ndarray, settings: Settings) -> Recognised:
    """Ask the network for its opinion of the points (paper section 3.1).

    There is none where nobody heeds or asks for it, or it cannot tell.
    """
    if not asks_network(settings):
        return Recognised()
    from .segment import segment

    try:
        result = segment(points, settings)
    except FitError:
        return Recognised()
    return Recognised(result.weights if fits_one(settings) else None, result.types)


def fit(
    points: np.ndarray, outline: shapely.Polygon | None, recognised: Recognised, settings: Settings
) -> Fitted:
    """Fit roof parts to the points.

    It is one primitive (the paper's case) or as many as the evidence pays for.
    """
    if len(points) < FEWEST_POINTS:
        return flat(points, outline, Status.FLAT_FALLBACK)
    road = fit_one if fits_one(settings) else fit_several
    try:
        return road(points, outline, recognised, settings)
    except FitError as error:
        if outline is None:
            return Fitted((), shapely.Polygon(), status=Status.NO_ROOF, detail=str(error))
        return flat(points, outline, Status.FLAT_FALLBACK, str(error))


def fit_several(
    points: np.ndarray, outline: shapely.Polygon | None, recognised: Recognised, settings: Settings
) -> Fitted:
    """Fit as many volumes as the evidence pays for.

    The network's opinion of the whole building does not matter to them.
    """
    from .fit.union import fit_building

    building = fit_building(points, outline, settings)
    return Fitted(
        building.roof_parts,
        building.outline,
        building.objective,
        detail=last_resort(building.roof_parts, settings),
    )


def last_resort(parts: tuple[Part, ...], settings: Settings) -> str:
    """Return a sentence where parts became flat against the settings.

    Only other types were requested. It is empty otherwise.
    """
    types = settings.fit.types
    flat = sum(part.type == "flat" for part in parts)
    if not types or "flat" in types or not flat:
        return ""
    return (
        f"{flat} of {count_things(len(parts), 'part')} made flat: none of the types asked for "
        f"({', '.join(types)}) explains the points there"
    )


def fit_one(
    points: np.ndarray, outline: shapely.Polygon | None, recognised: Recognised, settings: Settings
) -> Fitted:
    """Fit one primitive to the whole building (paper section 3.2)."""
    from .fit import fit_roof
    from .segment import choose_most_probable

    def fit(types: tuple[str, ...]) -> Fit:
        allowed = settings.replace(
            {"fit": {"types": types or candidates(recognised.types, settings)}}
        )
        return fit_roof(points, outline, allowed, weights=recognised.weights)

    result, types = choose_most_probable(fit, recognised.types)
    shift = result.global_translation
    part = dataclasses.replace(
        result.part,
        translation=result.part.translation + shift,
        pieces=tuple(p.move(shift) for p in result.part.pieces),
    )
    outline = (
        shapely.union_all([piece.outline for piece in part.pieces]) if outline is None else outline
    )
    return Fitted((part,), outline, result.value, types)


def candidates(recognised: dict[str, float], settings: Settings) -> tuple[str, ...]:
    """Return the types to fit by one primitive, empty for all.

    They are those requested, and by the paper's objective only what the network sees.

    So the paper has it (section 3.1), and a fit by its objective takes half a second a type.

    >>> paper = Settings.from_dict({"fit": {"objective": "paper"}})
    >>> candidates({"gable": 0.9, "hip": 0.08, "shed": 0.02}, paper)
    ('gable', 'hip')
    """
    types = tuple(settings.fit.types)
    if settings.fit.objective != "paper":
        return types
    likely = [
        name
        for name, share in recognised.items()
        if share >= LIKELY and name in (types or recognised)
    ]
    return tuple(likely) or types


def flat(points: np.ndarray, outline: shapely.Polygon, status: Status, detail: str = "") -> Fitted:
    """Return a flat roof at the median height, the last fallback."""
    # the upper median: what strays lies below a roof
    height = float(np.sort(points[:, 2])[len(points) // 2])
    part = Part(
        "flat",
        (Piece(outline, np.array([[0.0, 0.0, height]])),),
        {},
        0.0,
        np.array([0.0, 0.0, height]),
    )
    return Fitted((part,), outline, status=status, detail=detail or status.value)


def find_ground(
    outline: shapely.Polygon,
    points: np.ndarray,
    frame: LocalFrame,
    terrain: Terrain | None,
    roof: Roof | None = None,
    walls: str = "level",
) -> Ground:
    """Find z_min, and the terrain's line around the outline.

    It is the lowest terrain under the roof's eave vertices (paper section 3.3).

    Where no terrain is known it is assumed as low as a low wall's foot, or as the lowest points of
    the walls that are seen below `roof`. `walls` are those of the settings: where they follow the
    terrain, a line of which a part is unknown runs at z_min there.
    """
    from .compose import terrain_intersection
    from .compose.settle import PLAN_DIGITS, round_number

    if terrain is not None:
        corners = np.concatenate(
            [np.asarray(ring.coords)[:, :2] for ring in (outline.exterior, *outline.interiors)]
        )
        heights, source = query_terrain(terrain, frame.to_world(corners))
        if np.isfinite(heights).any():
            z = round_number(np.nanmin(heights), PLAN_DIGITS)
            unknown: list[np.ndarray] = []

            def height_at(xy: np.ndarray) -> np.ndarray:
                heights = terrain.height_at(frame.to_world(xy)) - frame.origin[2]
                unknown.append(np.isnan(heights))
                return (
                    np.where(unknown[-1], z - frame.origin[2], heights)
                    if walls == "terrain"
                    else heights
                )

            lines = terrain_intersection(outline, height_at, z - frame.origin[2])
            rounded = tuple(np.round(frame.to_world(line), PLAN_DIGITS) for line in lines)
            return Ground(z, source, rounded, 1.0 - float(np.concatenate(unknown).mean()))
    assumed, source = assume_ground(points, roof)
    return Ground(round_number(assumed + frame.origin[2], PLAN_DIGITS), source)


def assume_ground(points: np.ndarray, roof: Roof | None) -> tuple[float, str]:
    """Return an assumed ground height, and the reason for it.

    It is in the frame of the points (n, 3), where nothing else gives it.
    """
    lowest, usual = float(points[:, 2].min()), f"assumed {ASSUMED_WALL_M:g} m below"
    eave = math.inf if roof is None else find_lowest_over(points, roof)
    if not math.isfinite(eave) or lowest >= eave - WALLS_SEEN_M:
        return lowest - ASSUMED_WALL_M, f"{usual} the lowest point"
    foot = find_second_lowest(points)
    return (
        (foot, "assumed at the foot of its walls")
        if foot < eave - ASSUMED_WALL_M
        else (eave - ASSUMED_WALL_M, f"{usual} its roof")
    )


def find_lowest_over(points: np.ndarray, roof: Roof) -> float:
    """Return the lowest height of the roof over the points (n, 3).

    It is in the roof's frame.
    """
    return float(np.nanmin(roof.height_at(points[:, :2]), initial=math.inf))


def find_second_lowest(points: np.ndarray) -> float:
    """Return the second lowest height of the points (n, 3).

    A single lowest one may be noise.
    """
    return float(np.partition(points[:, 2], 1)[1]) if len(points) > 1 else float(points[0, 2])


def query_terrain(terrain: Terrain, xy_world: np.ndarray) -> tuple[np.ndarray, str]:
    """Return terrain heights (n,) at `xy_world` (n, 2), and their source.

    It is the source that answered first.
    """
    if hasattr(terrain, "heights_and_sources"):
        heights, sources = terrain.heights_and_sources(xy_world)
        return heights, sources[0] if sources else terrain.source
    return terrain.height_at(xy_world), terrain.source


def solid_or_simpler(
    roof: Roof, points: np.ndarray, ground: Ground, fitted: Fitted, settings: Settings
) -> tuple[Roof, Solid | None, Fitted]:
    """Return the rounded roof and its checked solid, in the local frame.

    Where it cannot become a valid one that can be read again, parts that fail are given up, and in
    the end all are, for a flat block.
    """
    from .compose import compose, compose_simpler
    from .compose.readable import compose_readable
    from .compose.settle import settled_roof

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


def judge(
    building: Building,
    roof: Roof,
    solid: Solid | None,
    points: np.ndarray,
    fitted: Fitted,
    ground: Ground,
    settings: Settings,
    unused: np.ndarray | None = None,
) -> Building:
    """Return the finished building, in the world's frame.

    It has quality measured on its solid, an honest status, the verdict and doubts.
    """
    from .compose.settle import round_building
    from .evaluate.metrics import quality, well_inside

    if solid is None:
        return dataclasses.replace(building, status=fitted.status, detail=fitted.detail)
    inner = well_inside(points, roof.outline)
    measured = dataclasses.replace(
        building,
        status=fitted.status,
        detail=fitted.detail,
        built=Model(roof, solid.move(roof.frame.origin), settings.compose),
        quality=quality(solid, points, roof.outline, inner),
        z_ground=ground.z,
        ground_source=ground.source,
        terrain_intersection=ground.intersection,
        objective=fitted.objective,
        types=fitted.types,
    )
    return add_cautions(
        grade_building(round_building(measured), points, select_unused(roof, unused)), points, inner
    )


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
    """Return the building with the passages of its footprint below it.

    A remark says which were left out, and why.
    """
    passages = list_passages(footprint, building.shift)
    if building.built is None or not passages:
        return building
    from .compose.finish import add_passage
    from .compose.settle import PLAN_DIGITS, round_number, settled_outline

    frame, model = building.roof.frame, building.model
    for polygon, clearance in passages:
        outline = settled_outline(largest_polygon(shapely.transform(polygon, frame.to_local)))
        ceiling = round_number(ground.z + clearance, PLAN_DIGITS)
        try:
            model = add_passage(model, outline, ceiling)
        except CompositionError as error:
            building = add_remark(building, f"a passage was left out ({error})")
    return dataclasses.replace(building, built=model)


def reach_terrain(building: Building, ground: Ground, settings: Settings) -> Building:
    """Return the building with walls down to the terrain, where settings say so.

    A remark says where they end at one level all the same.
    """
    if building.built is None or settings.reconstruct.walls == "level":
        return building
    if not ground.intersection:
        return add_remark(building, "its walls end at one level, for no terrain is known")
    from .compose.finish import add_underside
    from .model import Underside

    origin = building.roof.frame.origin
    underside = Underside(terrain=tuple(line - origin for line in ground.intersection))
    try:
        finished = dataclasses.replace(building, built=add_underside(building.model, underside))
    except CompositionError as error:
        return add_remark(building, f"its walls end at one level ({error})")
    share = 1.0 - ground.known_share
    level = f"its walls end at one level along {100 * share:.0f} % of its outline"
    return add_remark(finished, f"{level}, for no terrain is known there" if share else "")


def add_installations(building: Building, points: np.ndarray, settings: Settings) -> Building:
    """Return the building with the objects on its roof, where settings say so.

    Its `points` (n, 3) are in the roof's frame.
    """
    if building.built is None or not settings.reconstruct.installations:
        return building
    from .fit.installations import find_installations

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
    from .compose.valid_eaves import add_valid_eaves, measure_left_out
    from .fit.overhang import find_eaves

    frame = building.roof.frame
    area = shapely.union_all([shapely.transform(n, frame.to_local) for n in neighbours])
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


def select_unused(roof: Roof, unused: np.ndarray | None) -> np.ndarray:
    """Return the `unused` points inside a roof's outline, in its frame.

    They are world points (m, 3), and have to be finite.
    """
    if unused is None:
        return np.zeros((0, 3))
    local = roof.frame.to_local(finite(as_xyz(unused)))
    return compress_inside(local, roof.outline)


def grade_building(
    building: Building, points: np.ndarray, unused: np.ndarray | None = None
) -> Building:
    """Add the verdict on a building's model.

    It is by its `points` (n, 3), in the roof's frame, and by those that its fit left `unused` (m,
    3).
    """
    from .evaluate.verdict import judge_model

    grade, reasons = judge_model(building.model, points, unused)
    return add_remark(dataclasses.replace(building, grade=grade), "; ".join(reasons))


def add_cautions(building: Building, points: np.ndarray, inner: Inner) -> Building:
    """Add doubts about a building to its detail.

    They are ground above its eaves and, by its points (n, 3), in the roof's frame, and those well
    `inner`, two surfaces one over the other.
    """
    from .evaluate.layers import find_second_surface

    roof = [
        building.solid.vertices[list(ring), 2]
        for face in building.solid.select_faces(ROOF)
        for ring in face.rings
    ]
    sunk = building.z_ground - float(np.concatenate(roof).min())
    if sunk > SUNK_M:
        building = add_remark(
            building,
            f"the ground ({building.ground_source}) lies {sunk:.1f} "
            f"{Doubt.GROUND_ABOVE_EAVES.value}: heights of other kinds",
        )
    share, apart_m = find_second_surface(points, building.roof, inner)
    if share:
        building = add_remark(
            building,
            f"over {100 * share:.0f} % of its area {Doubt.TWO_SURFACES.value}, {apart_m:.2f} m "
            "apart: two flights, two "
            "dates, glass or leaves; use a cloud of one",
        )
    return building
