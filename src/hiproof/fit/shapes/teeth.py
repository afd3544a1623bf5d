"""Unite rows of equal monopitches as saw-teeth ("shed").

Only the points beside a step as high as the tooth show where a tooth ends. That all teeth are alike
determines it better: planes of one slope so far apart have teeth so wide.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import shapely

from ...geometry.rings import intersect, join, subtract, unite, with_area
from ...model import Part, Piece
from ...primitives import get
from ...primitives.shed import TEETH
from .regions import exclude_parts, list_polygons, select_touching, unite_outlines
from .shown import absorb_slivers

SLOPE_ALIKE = 0.05  # Difference in slope (rise over run) within which teeth are alike.
HEIGHT_ALIKE_M = 0.25  # Difference in height (m) within which teeth are alike.
SIZE_ALIKE = 0.2  # Share of a size within which teeth, or the halves of a gambrel, are alike.
TURN_ALIKE_RAD = 0.03  # Angle (rad) within which teeth, or the halves of a gambrel, are parallel.
UNEVEN_M = 0.1  # Teeth whose heights differ by more (m), if they were equally wide, are not.
TOOTH_SHARE = 0.8  # Share of a tooth's area over which a part must be visible as it.
GRID_STEP_M = 0.4  # Distance (m) of the places at which that is sampled.
AT_WALL_M = 0.05  # A row ends at a wall of the roof within this distance (m).
AT_WALL = 0.5  # Share of the row's length that must be at the wall.
CRACK_M = 0.02  # Distance (m) between parts that are beside each other.


def unite_saw_teeth(parts: list[Part]) -> list[Part]:
    """Replace every row of equal monopitches by one saw-tooth ("shed")."""
    for row, other_parts in list_rows(parts):
        united = make_saw_tooth(row, other_parts)
        if united is not None:
            return unite_saw_teeth(united)
    return parts


def list_rows(parts: list[Part]) -> Iterator[tuple[list[Part], list[Part]]]:
    """Yield every row of equal monopitches, from the lowest v, and the other parts."""
    teeth = [part for part in parts if is_tooth(part)]
    while teeth:
        row = [teeth.pop(0)]
        grown = True
        while grown and len(row) < max(TEETH):
            neighbour = next(
                (
                    part
                    for part in teeth
                    if is_next_tooth(row[-1], part) or is_next_tooth(part, row[0])
                ),
                None,
            )
            grown = neighbour is not None
            if neighbour is not None:
                teeth = exclude_parts(teeth, [neighbour])
                row = [*row, neighbour] if is_next_tooth(row[-1], neighbour) else [neighbour, *row]
        row, other_parts = extend_row(row, exclude_parts(parts, row))
        if len(row) >= min(TEETH):
            yield row, other_parts


def extend_row(row: list[Part], other_parts: list[Part]) -> tuple[list[Part], list[Part]]:
    """Extend a row by parts that look like its next tooth although they are more.

    Also returns the other parts without these.
    """
    parts = [*row, *other_parts]
    for step in 1.0, -1.0:
        while len(row) < max(TEETH):
            place = make_next_tooth(row, row[-1] if step > 0.0 else row[0], step)
            part = next(
                (
                    p
                    for p in select_equal_heights(other_parts, place)
                    if is_visible_as(p, place, exclude_parts(parts, [p]))
                ),
                None,
            )
            if part is None:
                break
            tooth = raise_tooth(place, part)
            row = [*row, tooth] if step > 0.0 else [tooth, *row]
            other_parts = exclude_parts(other_parts, [part])
    return row, other_parts


def make_next_tooth(row: list[Part], last: Part, step: float) -> Part:
    """Make the tooth that would follow the `last` of a row, or precede it (`step` -1)."""
    across = (
        step
        * average_parameter(row, "width")
        * np.array([-math.sin(last.kappa), math.cos(last.kappa), 0.0])
    )
    return replace(
        last, pieces=(last.pieces[0].move(across),), translation=last.translation + across
    )


def select_equal_heights(parts: list[Part], tooth: Part) -> Iterator[Part]:
    """Select the parts that are about as high as a `tooth` in its middle."""
    middle = shapely.get_coordinates(shapely.point_on_surface(tooth.pieces[0].outline))
    target = tooth.height_at(middle)[0]
    there = select_touching(parts, shapely.Point(*middle))
    return (part for part in there if abs(part.height_at(middle)[0] - target) <= HEIGHT_ALIKE_M)


def is_visible_as(part: Part, tooth: Part, other_parts: list[Part]) -> bool:
    """Return whether what is visible of a part under others is the `tooth`.

    It is as high there nearly everywhere, and visible nowhere else.
    """
    xy = lay_places([part])
    z, target = part.height_at(xy), tooth.height_at(xy)
    touching = select_touching(other_parts, unite_outlines([part]))
    beneath = np.max([other.height_at(xy) for other in touching], axis=0, initial=-np.inf)
    shows = z > beneath + 1e-6
    alike = np.abs(z[shows] - target[shows]) < HEIGHT_ALIKE_M
    whole = alike.sum() * GRID_STEP_M**2 > TOOTH_SHARE * tooth.area
    return bool(whole and alike.sum() > TOOTH_SHARE * shows.sum())


def lay_places(parts: Iterable[Part]) -> np.ndarray:
    """Lay places (n, 2) on a grid over the box around all that parts cover."""
    x0, y0, x1, y1 = unite_outlines(parts).bounds
    return np.stack(
        np.meshgrid(np.arange(x0, x1, GRID_STEP_M), np.arange(y0, y1, GRID_STEP_M)), axis=-1
    ).reshape(-1, 2)


def average_parameter(row: list[Part], name: str) -> float:
    """Return the mean of a parameter of a row's teeth."""
    return float(np.mean([part.parameters[name] for part in row]))


def raise_tooth(tooth: Part, part: Part) -> Part:
    """Return the `tooth` over what a part covers of it, as high as that part."""
    (piece,) = tooth.pieces
    margin_area = shapely.buffer(
        piece.outline, SIZE_ALIKE * tooth.parameters["width"], join_style="mitre"
    )
    outline = with_area(shapely.intersection(unite_outlines([part]), margin_area))
    middle = shapely.get_coordinates(
        shapely.point_on_surface(shapely.intersection(outline, piece.outline))
    )
    rise = np.array([0.0, 0.0, float((part.height_at(middle) - piece.height_at(middle))[0])])
    pieces = tuple(Piece(polygon, piece.planes + rise) for polygon in list_polygons(outline))
    return replace(tooth, pieces=pieces, translation=tooth.translation + rise)


def is_tooth(part: Part) -> bool:
    return part.type == "monopitch" and len(part.pieces) == 1 and "height" in part.parameters


def is_next_tooth(tooth: Part, next_tooth: Part) -> bool:
    """Return whether `next_tooth` follows `tooth` in a row.

    It is like it, and lies right behind its upper edge, as high there as that was before.
    """
    size, other_size = tooth.parameters, next_tooth.parameters
    turn = math.remainder(next_tooth.kappa - tooth.kappa, 2.0 * math.pi)
    slopes = [p["height"] / p["width"] for p in (size, other_size)]
    same_size = all(
        abs(size[name] - other_size[name]) < SIZE_ALIKE * max(size[name], other_size[name])
        for name in ("width", "length")
    )
    step = next_tooth.translation - tooth.translation
    across = np.array([-math.sin(tooth.kappa), math.cos(tooth.kappa)]) @ step[:2]
    along = np.array([math.cos(tooth.kappa), math.sin(tooth.kappa)]) @ step[:2]
    spacing = 0.5 * (size["width"] + other_size["width"])
    rise = step[2] + 0.5 * (other_size["height"] - size["height"]) - slopes[0] * (across - spacing)
    return (
        abs(turn) < TURN_ALIKE_RAD
        and abs(slopes[0] - slopes[1]) < SLOPE_ALIKE
        and same_size
        and abs(rise) < HEIGHT_ALIKE_M
        and abs(across - spacing) < SIZE_ALIKE * spacing
        and abs(along) < SIZE_ALIKE * size["length"]
    )


@dataclass(frozen=True)
class RowFrame:
    """The place of a row of teeth.

    u along the teeth and v across them are `axes` (2, 2) about `origin` (2,). Teeth reach from
    `left` to `right` along u. The row was visible from `first` to `last` along v, and covers
    `covered`. `roof` is all that is roofed, and `walls` its border: cracks between parts are none.
    """

    origin: np.ndarray
    axes: np.ndarray
    left: float
    right: float
    first: float
    last: float
    covered: shapely.Geometry
    roof: shapely.Geometry
    walls: shapely.Geometry

    def make_strip(self, foot: float, top: float) -> shapely.Polygon:
        """Return the strip from v = `foot` to `top`, as long as the teeth.

        It is empty if `top` is not above `foot`.
        """
        box = shapely.box(self.left, foot, self.right, top) if top > foot else shapely.Polygon()
        return shapely.transform(box, lambda uv: uv @ self.axes + self.origin)

    def is_wall(self, place: float) -> bool:
        """Return whether the roof's outline runs along v = `place`."""
        along = shapely.intersection(
            self.walls, self.make_strip(place - AT_WALL_M, place + AT_WALL_M)
        )
        return along.length > AT_WALL * (self.right - self.left)


def frame_row(row: list[Part], other_parts: list[Part]) -> RowFrame:
    """Return the place of a row of teeth among the other parts."""
    origin, kappa = row[0].translation[:2], row[0].kappa
    axes = np.array([[math.cos(kappa), math.sin(kappa)], [-math.sin(kappa), math.cos(kappa)]])
    covered, others_area = (unite_outlines(group) for group in (row, other_parts))
    uv = (shapely.get_coordinates(covered) - origin) @ axes.T
    (left, first), (right, last) = uv.min(axis=0).tolist(), uv.max(axis=0).tolist()
    roof = shapely.MultiPolygon(list_polygons(join(covered, others_area)))
    walls = shapely.buffer(roof, CRACK_M, join_style="mitre").boundary
    return RowFrame(origin, axes, left, right, first, last, covered, roof, walls)


def make_saw_tooth(row: list[Part], other_parts: list[Part]) -> list[Part] | None:
    """Return the other parts and one shed of the row.

    Returns None if some of its teeth are wider than others, or if their planes imply other teeth
    than were visible. What a tooth reaches further than it was visible, it takes from the others.
    What it reaches less, it leaves them.
    """
    other_parts, splinters = separate_splinters(row, other_parts)
    ground = frame_row([*row, *splinters], other_parts)
    centres = (np.array([part.translation[:2] for part in row]) - ground.origin) @ ground.axes.T
    slopes = np.array([part.parameters["height"] / part.parameters["width"] for part in row])
    heights = np.array([part.translation[2] + 0.5 * part.parameters["height"] for part in row])
    breaks = lay_out_teeth(centres[:, 1] - heights / slopes.mean(), ground)
    heights = heights + slopes * (0.5 * (breaks[:-1] + breaks[1:]) - centres[:, 1])
    length, width, seen_wide = (
        average_parameter(row, "length"),
        float(breaks[-1] - breaks[0]),
        average_parameter(row, "width"),
    )
    # Planes that hardly slope imply teeth of another width than was visible, or of a negative one.
    if np.ptp(heights) > UNEVEN_M or abs(width / len(row) - seen_wide) > SIZE_ALIKE * seen_wide:
        return None
    rise = float(slopes.mean() * width / len(row))
    parameters = {"width": width, "length": length, "height": rise, "teeth": float(len(row))}
    centre = np.array([centres[:, 0].mean(), breaks[0] + 0.5 * width]) @ ground.axes + ground.origin
    translation = np.array([*centre, heights.mean() - 0.5 * rise])
    shape = get("shed").variant(parameters)
    whole = shape.part(shape.to_theta(parameters, row[0].kappa, translation))
    shed = replace(whole, pieces=cut_teeth(whole.pieces, breaks, ground))
    remainder = subtract(ground.covered, ground.make_strip(breaks[0], breaks[-1]))
    left_over = replace(
        shed,
        pieces=tuple(Piece(polygon, shed.pieces[0].planes) for polygon in list_polygons(remainder)),
    )
    if not left_over.pieces:
        return [*other_parts, shed]
    absorbed = absorb_slivers(other_parts, left_over, math.inf)
    # If no other part lies beside it, the outermost teeth reach as far as the row did.
    return (
        [*absorbed, shed]
        if absorbed is not None
        else absorb_slivers([*other_parts, shed], left_over, math.inf)
    )


def separate_splinters(row: list[Part], other_parts: list[Part]) -> tuple[list[Part], list[Part]]:
    """Separate narrow strips between the teeth from the other parts.

    They are what a scanner saw of a tooth's wall.
    """
    covered = unite_outlines(row)
    narrow = SIZE_ALIKE * min(part.parameters["width"] for part in row)
    closed_area = shapely.buffer(
        shapely.buffer(covered, narrow, join_style="mitre"), -narrow, join_style="mitre"
    )
    splinters = [
        part
        for part in other_parts
        if part.parameters.get("width", math.inf) < narrow
        and all(
            shapely.intersection(closed_area, p.outline).area > TOOTH_SHARE * p.outline.area
            for p in part.pieces
        )
    ]
    return exclude_parts(other_parts, splinters), splinters


def lay_out_teeth(feet: np.ndarray, ground: RowFrame) -> np.ndarray:
    """Return where the teeth of a row begin and the last one ends (n + 1,).

    They are v in metres, all equally wide. The teeth's planes would be at height 0 at `feet` (n,).
    Ends at walls are those of the outline.
    """
    count, first, last = len(feet), ground.first, ground.last
    numbers = np.arange(count) - 0.5 * (count - 1)
    width = float(numbers @ feet / (numbers @ numbers))
    starts, ends = ground.is_wall(first), ground.is_wall(last)
    if starts and ends:
        width = (last - first) / count
    start = (
        first if starts else last - count * width if ends else 0.5 * (first + last - count * width)
    )
    return start + width * np.arange(count + 1)


def cut_teeth(pieces: tuple[Piece, ...], breaks: np.ndarray, ground: RowFrame) -> tuple[Piece, ...]:
    """Cut the pieces of a saw-tooth, a tooth each.

    They lie over what its row covers and where it reaches further.
    """
    further = [
        ground.make_strip(breaks[0], ground.first),
        ground.make_strip(ground.last, breaks[-1]),
    ]
    extension = with_area(shapely.intersection(ground.roof, unite(further)))
    row_area = join(ground.covered, extension)
    strips = [ground.make_strip(foot, top) for foot, top in pairwise(breaks.tolist())]
    return tuple(
        Piece(polygon, piece.planes)
        for strip, piece in zip(strips, pieces, strict=True)
        for polygon in list_polygons(intersect(row_area, strip))
    )
