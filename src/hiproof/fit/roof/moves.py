"""Propose moves of a roof, and apply one. Nothing here judges.

A move is a row (kind, a, b, c, d) of numbers. `list_moves` writes those that concern volumes in
question, `apply_move` changes a roof by one.
"""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from ..prices import LEAN_UNITS
from .draw import is_near, widen_box
from .ends import find_end, find_gable, find_plane, find_split
from .tables import (
    FAR_M,
    LINE_COUNT,
    N_SIDES,
    NO_UNKNOWN,
    UNKNOWN_COUNT,
    VOLUME_COUNT,
    VOLUME_PLANES,
    add_line,
    add_plane,
    add_unknown,
    copy_volume,
    cross_lines,
    drop_plane,
    find_lowest_plane,
    measure_middle,
    place_volume,
    read_line,
)

(
    LEAVE_OUT,  # volume a; if b, those around reach to where their planes rise from
    LEAVE_PLANE,  # plane b of volume a
    SHARE,  # unknown b becomes a, which keeps its value: points all around it hold it
    TO_OUTLINE,  # side b of volume a on line c of the outline
    TO_LINE,  # side b of volume a on line c of the roof
    RUN_ON,  # side b of volume a, by step c
    MERGE,  # volume b into a, whose planes then face as c says (0: as they do), with b's if d
    FACE,  # planes of volume a face as b says
    TURN,  # volume a replaces instead of joining, or joins
    GIVE_WALL,  # volume a a plane from line b of the outline, with slope c and height d of others
    LEVEL_EAVES,  # all sloping planes of volume a rise from its sides at one height, with one slope
    # if b, and from all walls that cut its corners off if c
    TILT,  # the level plane b of volume a rises from its side c, and one from across if d
    MAKE_LEVEL,  # plane b of volume a becomes level, and its only one if c
    ADD_BAY,  # a level volume over bay a of the outline
    ONE_PLANE,  # plane b of volume a becomes plane d of volume c
    COVER,  # side b of volume a on line c of the outline, with all planes from its walls' eaves,
    # and one more from that line, as at its other end, if d
    TO_EAVE,  # plane b of volume a rises from height c, and so does the side that it faces
    TO_POINTS,  # side b of volume a where points say that it ends, as it leans
    TAKE,  # plane d of volume c becomes one more of volume a, whose side b runs on if it is one
    END,  # volume a a plane from its side b, at the height of others if c
    SPLIT,  # volume a where its points begin to lie higher or lower beyond its side b
) = range(21)
MOVE_COLUMNS = 5  # Numbers of a move: its kind and four more.
# What to try of a volume. One whose unknowns are shared is where it was. A new one is not left out:
# the roof without it is known.
NO_MOVES, SHARES_ONLY, NEW_MOVES, ALL_MOVES = range(4)
# Planes face square to their sides, along the axis between two sides, or square to either.
FACE_SIDES, FACE_AXIS, FACE_FIRST, FACE_SECOND = 1, 2, 3, 4

NEIGHBOUR_M = 1.0  # Volumes so near each other (m) may have something in common.
SIDE_MOVE_M = 1.6  # Furthest (m) that the middle of a side moves to another line.
LINE_COSINE = 0.94  # Cosine of the angle between a side and the line to which it moves.
SAME_DIRECTION = 0.97  # The same of sides of volumes that merge.
FACING_COSINE = 0.9  # The same of a plane and the side that it faces.
ALIKE_COSINE = 0.7  # The same of a plane and one of another volume that may end it instead.
BESIDE_CORNER_M = 0.1  # Distance (m) outside a volume of the middle of a wall over its corner.
BESIDE_WALL_M = 0.3  # Distance (m) from the middle of a wall of a line that is meant to be its own.
# Least distance (m) of a side from the wall, or the line of its plane, to which it is drawn out.
COVER_M = 0.3
MOST_LINES = 7  # Most lines to which a side is moved.
RUN_ON_STEPS_M = (0.6, 1.5, 3.0)  # Distances (m) by which a side is run on.
SAME_FAR = 0.03  # The same of volumes that are not near each other.
MOST_ALIKE = 2  # Most unknowns, the next higher ones, that each may be one with.
ALIKE_SLOPES, ALIKE_HEIGHTS_M = 0.2, 0.7  # Unknowns (rise over run, m) nearer than this may be one.


@compiled
def write_move(moves, count, kind, a, b, c, d):
    """Write one more move, if there is room. Returns the number of moves."""
    if count < len(moves):
        moves[count, 0], moves[count, 1], moves[count, 2] = kind, a, b
        moves[count, 3], moves[count, 4] = c, d
        count += 1
    return count


@compiled
def list_moves(roof, site, asked, moves):
    """Write the moves that are `asked` (v,) of volumes to `moves`. Returns their number."""
    count = 0
    for k in range(roof.counts[VOLUME_COUNT]):
        if asked[k] < NEW_MOVES or roof.n_planes[k] == 0:
            continue
        box = roof.boxes[k]
        for reach in range(2 if asked[k] == ALL_MOVES else 0):
            count = write_move(moves, count, LEAVE_OUT, k, reach, 0, 0)
        for p in range(roof.n_planes[k]):
            if roof.n_planes[k] > 1 and not site.keeps_shapes:
                count = write_move(moves, count, LEAVE_PLANE, k, p, 0, 0)
            if roof.slopes[k, p] >= 0:
                for alone in range(2 if roof.n_planes[k] > 1 else 1):
                    count = write_move(moves, count, MAKE_LEVEL, k, p, alone, 0)
                for q in range(roof.n_planes[k]):
                    if roof.slopes[k, q] >= 0 and roof.heights[k, q] != roof.heights[k, p]:
                        count = write_move(moves, count, TO_EAVE, k, p, roof.heights[k, q], 0)
            elif roof.n_planes[k] == 1 and not site.keeps_shapes:
                for s in range(N_SIDES):
                    for pair in range(1 + (s + 1) % 2):
                        count = write_move(moves, count, TILT, k, p, s, pair)
        for way in range(FACE_SIDES, FACE_SECOND + 1):
            count = write_move(moves, count, FACE, k, way, 0, 0)
        count = write_move(moves, count, TURN, k, 0, 0, 0)
        for s in range(0, N_SIDES, 2):
            count = write_move(moves, count, SPLIT, k, s, 0, 0)
        count = list_side_moves(roof, site, k, moves, count)
        count = list_new_planes(roof, site, k, moves, count)
        cuts = 0
        for m in range(len(site.lines)):
            cuts += int(cuts_corner(roof, k, site.lines[m]))
        for way in range(4 if cuts > 0 and not site.keeps_shapes else 2):
            count = write_move(moves, count, LEVEL_EAVES, k, way % 2, way // 2, 0)
        for j in range(roof.counts[VOLUME_COUNT]):
            if j == k or roof.n_planes[j] == 0 or (j > k and asked[j] == ALL_MOVES):
                continue
            if is_near(roof.boxes[j], box, NEIGHBOUR_M):
                count = list_merges(roof, site, j, k, moves, count)
                count = list_taken_planes(roof, site, j, k, moves, count)
                count = list_taken_planes(roof, site, k, j, moves, count)
    for bay in range(len(site.bay_heights) if count > 0 else 0):
        count = write_move(moves, count, ADD_BAY, bay, 0, 0, 0)
    return list_shares(roof, site, asked, moves, count)


@compiled
def list_merges(roof, site, j, k, moves, count):
    first, second, third = (
        roof.half_planes[j, 0],
        roof.half_planes[k, 0],
        roof.half_planes[k, 2],
    )
    along = abs(first[0] * second[0] + first[1] * second[1])
    across = abs(first[0] * third[0] + first[1] * third[1])
    if max(along, across) >= SAME_DIRECTION:
        for way in range(FACE_SIDES + 1):
            if not site.keeps_shapes or has_alike(roof, j, k):
                count = write_move(moves, count, MERGE, j, k, way, 1)
                count = write_move(moves, count, MERGE, k, j, way, 1)
        if roof.n_planes[j] != roof.n_planes[k] or not has_alike(roof, j, k):
            count = write_move(moves, count, MERGE, j, k, 0, 0)
            count = write_move(moves, count, MERGE, k, j, 0, 0)
        return count
    if has_alike(roof, j, k):
        count = write_move(moves, count, MERGE, j, k, 0, 0)
    if has_alike(roof, k, j):
        count = write_move(moves, count, MERGE, k, j, 0, 0)
    return count


@compiled
def list_taken_planes(roof, site, j, k, moves, count):
    """Write the planes of volume j that may stand for one of volume k, or end it."""
    x, y = find_centre(roof, k, site)
    top, _ = find_lowest_plane(roof, k, x, y)
    least = FACING_COSINE if site.keeps_shapes else ALIKE_COSINE
    has_room = roof.n_planes[k] < VOLUME_PLANES and not site.keeps_shapes
    for p in range(roof.n_planes[j]):
        if roof.slopes[j, p] < 0:
            continue
        a, b, _ = read_line(roof, roof.plane_lines[j, p])
        is_alike = False
        for q in range(roof.n_planes[k]):
            c, d, _ = read_line(roof, roof.plane_lines[k, q])
            if roof.slopes[k, q] >= 0 and a * c + b * d > least:
                is_alike |= a * c + b * d > FACING_COSINE
                is_one = roof.heights[j, p] == roof.heights[k, q]
                is_one &= roof.slopes[j, p] == roof.slopes[k, q]
                if not (is_one and roof.plane_lines[j, p] == roof.plane_lines[k, q]):
                    count = write_move(moves, count, ONE_PLANE, k, q, j, p)
        row = roof.planes[j, p]
        is_above = row[0] * x + row[1] * y + row[2] >= top
        if is_alike or not (is_above and has_room):
            continue
        best, most = 0, -1.0
        for s in range(N_SIDES):
            cosine = a * roof.half_planes[k, s, 0] + b * roof.half_planes[k, s, 1]
            best, most = (s, cosine) if cosine > most else (best, most)
        count = write_move(moves, count, TAKE, k, -1, j, p)
        count = write_move(moves, count, TAKE, k, best, j, p)
    return count


@compiled
def list_shares(roof, site, asked, moves, count):
    """Write the pairs of unknowns next to each other in value that are nearly alike."""
    n = roof.counts[UNKNOWN_COUNT]
    kinds, is_asked = np.zeros(n, np.int64), np.zeros(n, np.bool_)
    boxes = np.full((n, 4), np.inf)
    boxes[:, 1::2] = -np.inf
    for k in range(roof.counts[VOLUME_COUNT]):
        for p in range(roof.n_planes[k]):
            for kind in range(1, 3):
                u = roof.heights[k, p] if kind == 1 else roof.slopes[k, p]
                if u < 0:
                    continue
                widen_box(boxes[u], roof.boxes[k])
                kinds[u] = kind
                is_asked[u] |= asked[k] > NO_MOVES
    order = np.argsort(roof.values[:n], kind="mergesort")
    for i in range(n):
        found = 0
        for j in range(i + 1, n):
            a, b = min(order[i], order[j]), max(order[i], order[j])
            gap = roof.values[order[j]] - roof.values[order[i]]
            if gap >= ALIKE_HEIGHTS_M or found == MOST_ALIKE:
                break
            if kinds[a] == 0 or kinds[a] != kinds[b] or not (is_asked[a] or is_asked[b]):
                continue
            alike = ALIKE_HEIGHTS_M if kinds[a] == 1 else ALIKE_SLOPES
            if gap >= (alike if is_near(boxes[a], boxes[b], NEIGHBOUR_M) else SAME_FAR):
                continue
            found += 1
            is_first = measure_box_area(boxes[a]) > measure_box_area(boxes[b])
            count = write_move(
                moves, count, SHARE, a if is_first else b, b if is_first else a, 0, 0
            )
    return count


@compiled
def measure_box_area(box):
    return (box[1] - box[0]) * (box[3] - box[2])


@compiled
def list_side_moves(roof, site, k, moves, count):
    """Write lines on which the sides of volume k may lie, the nearest first, and run-ons."""
    near = np.empty((MOST_LINES, 3))
    for s in range(N_SIDES):
        x, y, length = measure_middle(roof, k, s, site.bounds)
        if length == 0.0:
            continue
        half, found = roof.half_planes[k, s], 0
        for m in range(len(site.lines)):
            line = site.lines[m]
            found = note_line(half, x, y, line[0], line[1], line[2], TO_OUTLINE, m + 1, near, found)
        for j in range(roof.counts[VOLUME_COUNT]):
            if j == k or roof.n_planes[j] == 0:
                continue
            if not is_near(roof.boxes[j], roof.boxes[k], NEIGHBOUR_M):
                continue
            for t in range(N_SIDES):
                line = roof.half_planes[j, t]
                signed = roof.sides[j, t]
                found = note_line(
                    half, x, y, line[0], line[1], line[2], TO_LINE, signed, near, found
                )
        for q in range(found):
            count = write_move(moves, count, int(near[q, 1]), k, s, int(near[q, 2]), 0)
        is_on_wall = find_wall(site, half[0], half[1], half[2]) >= 0
        if not is_on_wall:
            count = write_move(moves, count, TO_POINTS, k, s, 0, 0)
        for step in range(1 if is_on_wall else len(RUN_ON_STEPS_M)):
            count = write_move(moves, count, RUN_ON, k, s, step, 0)
        for m in range(len(site.lines)):
            line = site.lines[m]
            if (
                line[5] > 0.0
                and not site.keeps_shapes
                and half[0] * line[0] + half[1] * line[1] > LINE_COSINE
                and line[0] * x + line[1] * y + line[2] > COVER_M
            ):
                count = write_move(moves, count, COVER, k, s, m + 1, 0)
                count = write_move(moves, count, COVER, k, s, m + 1, 1)
    return count


@compiled
def note_line(half, x, y, a, b, c, kind, number, near, found):
    """Note a line that passes near the middle of a side, in the order of its distance."""
    cosine = half[0] * a + half[1] * b
    gap = a * x + b * y + c
    if abs(cosine) < LINE_COSINE or abs(gap) > SIDE_MOVE_M:
        return found
    if cosine < 0.0:
        number = -number
    if abs(gap) < 1e-4 and abs(cosine) > 1.0 - 1e-7:
        return found
    for q in range(found):
        if abs(near[q, 0] - abs(gap)) < 1e-4:
            return found
    place = found
    while place > 0 and near[place - 1, 0] > abs(gap):
        place -= 1
    if place >= len(near):
        return found
    for q in range(min(found, len(near) - 1), place, -1):
        near[q] = near[q - 1]
    near[place, 0], near[place, 1], near[place, 2] = abs(gap), kind, number
    return min(found + 1, len(near))


@compiled
def list_new_planes(roof, site, k, moves, count):
    """Write planes of volume k over walls that have none yet."""
    if roof.n_planes[k] >= VOLUME_PLANES or site.keeps_shapes:
        return count
    for s in range(N_SIDES):
        if not is_faced(roof, k, roof.half_planes[k, s, 0], roof.half_planes[k, s, 1]):
            for is_level in range(2):
                count = write_move(moves, count, END, k, s, is_level, 0)
    for p in range(roof.n_planes[k]):
        if roof.slopes[k, p] < 0:
            continue
        is_first = True
        for q in range(p):
            is_first &= (
                roof.slopes[k, q] != roof.slopes[k, p] or roof.heights[k, q] != roof.heights[k, p]
            )
        if not is_first:
            continue
        for m in range(len(site.lines)):
            if stands_in(roof, k, site.lines[m]):
                count = write_move(
                    moves, count, GIVE_WALL, k, m, roof.slopes[k, p], roof.heights[k, p]
                )
    return count


@compiled
def cuts_corner(roof, k, line):
    """Return whether a wall cuts a corner of volume k off, and has no plane yet."""
    for s in range(N_SIDES):
        half = roof.half_planes[k, s]
        if abs(half[0] * line[0] + half[1] * line[1]) > LINE_COSINE:
            return False
    return stands_in(roof, k, line)


@compiled
def stands_in(roof, k, line):
    """Return whether an edge of the outline stands in volume k, and has no plane yet."""
    if line[5] == 0.0 or is_faced(roof, k, line[0], line[1]):
        return False
    for s in range(N_SIDES):
        half = roof.half_planes[k, s]
        if half[0] * line[3] + half[1] * line[4] + half[2] < -BESIDE_CORNER_M:
            return False
    return True


@compiled
def is_faced(roof, k, a, b):
    """Return whether volume k has a plane that faces square to a line."""
    for p in range(roof.n_planes[k]):
        if roof.slopes[k, p] >= 0:
            c, d, _ = read_line(roof, roof.plane_lines[k, p])
            if a * c + b * d > FACING_COSINE:
                return True
    return False


@compiled
def apply_move(roof, move, site, changed):
    """Change a roof by a move, and set `changed` (v,) for the volumes that it touches.

    Returns whether the move is possible.
    """
    kind, a, b, c, d = move[0], move[1], move[2], move[3], move[4]
    changed[:] = False
    if kind == SHARE:
        return share(roof, a, b, changed)
    if kind == ADD_BAY:
        k = add_bay(roof, site, a)
        changed[k] = True
        place_volume(roof, k)
        return True
    if roof.n_planes[a] == 0:
        return False
    changed[a] = True
    is_possible = True
    if kind == LEAVE_OUT:
        roof.n_planes[a] = 0
        is_possible = b == 0 or spread(roof, a, changed)
    elif TO_OUTLINE <= kind <= RUN_ON:
        line = find_new_side(roof, kind, a, b, c, site)
        is_possible = line != 0
        roof.sides[a, b] = line if is_possible else roof.sides[a, b]
    elif kind == MERGE:
        is_possible, changed[b] = roof.n_planes[b] > 0, True
        if is_possible:
            merge(roof, a, b, site, d)
        if is_possible and c:  # the same merge, if no plane turns
            is_possible = face_planes(roof, a, c, site)
    elif kind == FACE:
        is_possible = face_planes(roof, a, b, site)
    elif kind == TURN:
        roof.replaces[a] = 1 - roof.replaces[a]
    elif kind == ONE_PLANE:
        is_possible = b < roof.n_planes[a] and d < roof.n_planes[c]
        if is_possible:
            roof.plane_lines[a, b], roof.heights[a, b] = roof.plane_lines[c, d], roof.heights[c, d]
            roof.slopes[a, b] = roof.slopes[c, d]
    elif kind == TAKE:
        is_possible = d < roof.n_planes[c]
        if is_possible:
            line, height, slope = roof.plane_lines[c, d], roof.heights[c, d], roof.slopes[c, d]
            add_plane(roof, a, line, height, slope)
        if b >= 0:
            roof.sides[a, b] = find_new_side(roof, RUN_ON, a, b, len(RUN_ON_STEPS_M) - 1, site)
    elif kind == TO_POINTS:
        d, e, f = find_end(roof, a, b, site, True)
        is_possible = d != 0.0 or e != 0.0
        if is_possible:
            roof.sides[a, b] = add_line(roof, d, e, f, LEAN_UNITS)
    elif kind == SPLIT:
        is_possible = split(roof, a, b, site, changed)
    elif kind == END:
        is_possible = end(roof, a, b, c, site)
    elif kind == COVER:
        is_possible = cover(roof, a, b, c, d, site)
    elif kind == LEVEL_EAVES:
        is_possible = level_eaves(roof, a, b, c, site)
    else:
        is_possible = change_plane(roof, move, site)
    place_volume(roof, a)
    return is_possible


@compiled
def end(roof, k, s, is_level, site):
    """Give volume k a plane from its side s, through points well below it.

    It may rise from a height of the volume's other planes (`is_level`). Returns whether it does.
    """
    height = roof.heights[k, 0]
    for p in range(1, roof.n_planes[k]):
        height = roof.heights[k, p] if roof.slopes[k, p] >= 0 else height
    start, slope = find_plane(roof, k, s, roof.values[height] if is_level else np.nan, site)
    if np.isnan(slope):
        return False
    height = height if is_level else add_unknown(roof, start)
    add_plane(roof, k, roof.sides[k, s], height, add_unknown(roof, slope))
    return True


@compiled
def split(roof, k, s, site, changed):
    """Split volume k where its points begin to lie higher or lower beyond side s."""
    place, rise = find_split(roof, k, s, site)
    if place <= 0.0:
        return False
    a, b, c = read_line(roof, roof.sides[k, s])
    line, new = add_line(roof, a, b, c - place), roof.counts[VOLUME_COUNT]
    roof.counts[VOLUME_COUNT] = new + 1
    copy_volume(roof, k, new)
    changed[new] = True
    roof.sides[new, s], roof.sides[k, s ^ 1] = line, -line
    for p in range(roof.n_planes[k]):
        height = roof.heights[k, p]
        if roof.heights[new, p] == height:  # else it is that of a plane before
            raised = add_unknown(roof, roof.values[height] + rise)
            for q in range(p, roof.n_planes[k]):
                if roof.heights[k, q] == height:
                    roof.heights[new, q] = raised
    place_volume(roof, new)
    return True


@compiled
def spread(roof, k, changed):
    """Let the volumes around volume k reach to where their planes rise from. Returns if any do."""
    has_changed = False
    for j in range(roof.counts[VOLUME_COUNT]):
        if roof.n_planes[j] == 0 or not is_near(roof.boxes[j], roof.boxes[k], NEIGHBOUR_M):
            continue
        for s in range(N_SIDES):
            a, b, c = read_line(roof, roof.sides[j, s])
            for p in range(roof.n_planes[j]):
                d, e, f = read_line(roof, roof.plane_lines[j, p])
                if roof.slopes[j, p] >= 0 and a * d + b * e > LINE_COSINE and f > c + COVER_M:
                    roof.sides[j, s] = roof.plane_lines[j, p]
                    has_changed = changed[j] = True
        place_volume(roof, j)
    return has_changed


@compiled
def find_new_side(roof, kind, k, s, number, site):
    """Return the line on which a move puts side s of volume k, 0 where that is no move."""
    if kind == TO_OUTLINE:
        line, sign = site.lines[abs(number) - 1], 1.0 if number > 0 else -1.0
        return add_line(roof, sign * line[0], sign * line[1], sign * line[2])
    if kind == TO_LINE:
        is_other = abs(number) <= roof.counts[LINE_COUNT] and roof.sides[k, s] != number
        return number if is_other else 0
    a, b, c = read_line(roof, roof.sides[k, s])
    return add_line(roof, a, b, c + RUN_ON_STEPS_M[number])


@compiled
def change_plane(roof, move, site):
    """Give, take, tilt or level one plane of a volume. Returns whether the move is possible."""
    kind, k, b, c, d = move[0], move[1], move[2], move[3], move[4]
    if kind == GIVE_WALL:
        line = site.lines[b]
        add_plane(roof, k, add_line(roof, line[0], line[1], line[2]), d, c)
        return True
    if b >= roof.n_planes[k]:
        return False
    is_level = roof.slopes[k, b] < 0
    if kind == LEAVE_PLANE and roof.n_planes[k] > 1:
        drop_plane(roof, k, b)
    elif kind == TILT and is_level:
        line, (x, y) = roof.sides[k, c], find_centre(roof, k, site)
        d, e, f = read_line(roof, line)
        if f > 0.5 * FAR_M:  # an end out of sight: it rises from its middle
            line = add_line(roof, d, e, -d * x - e * y)
        roof.heights[k, b] = add_unknown(roof, roof.values[roof.heights[k, b]])
        roof.plane_lines[k, b], roof.slopes[k, b] = line, add_unknown(roof, 0.0)
        if move[4]:
            height, slope = find_gable(roof, k, c, site)
            if np.isnan(slope):
                return False
            roof.values[roof.heights[k, b]], roof.values[roof.slopes[k, b]] = height, slope
            add_plane(roof, k, roof.sides[k, c ^ 1], roof.heights[k, b], roof.slopes[k, b])
    elif kind == TO_EAVE and not is_level:
        return put_on_eave(roof, k, b, c, site)
    elif kind == MAKE_LEVEL and not is_level:
        x, y = find_centre(roof, k, site)
        row = roof.planes[k, b]
        roof.heights[k, b] = add_unknown(roof, row[0] * x + row[1] * y + row[2])
        roof.slopes[k, b] = NO_UNKNOWN
        for p in range(roof.n_planes[k] - 1 if c else -1, -1, -1):
            if p != b:
                drop_plane(roof, k, p)
    else:
        return False
    return True


@compiled
def put_on_eave(roof, k, p, height, site):
    """Let plane p of volume k rise from where it has another's `height`, and its side lie there.

    It rises from a wall that is near there. What rises from a wall does not reach beyond it then.
    """
    slope = roof.values[roof.slopes[k, p]]
    a, b, c = read_line(roof, roof.plane_lines[k, p])
    if abs(slope) < ALIKE_SLOPES:
        return False
    out = (roof.values[roof.heights[k, p]] - roof.values[height]) / slope
    if out > 0.0 and find_wall(site, a, b, c) >= 0:
        return False
    c += out
    m = find_wall(site, a, b, c)
    if m >= 0:
        a, b, c = site.lines[m, 0], site.lines[m, 1], site.lines[m, 2]
    line = add_line(roof, a, b, c)
    for s in range(N_SIDES):
        d, e, _ = read_line(roof, roof.sides[k, s])
        if a * d + b * e > FACING_COSINE:
            roof.sides[k, s] = line
    roof.plane_lines[k, p], roof.heights[k, p] = line, height
    return True


@compiled
def find_wall(site, a, b, c):
    """Return the wall whose middle is near a line that faces as it does, -1 if none is."""
    for m in range(len(site.lines)):
        line = site.lines[m]
        is_near = abs(a * line[3] + b * line[4] + c) < BESIDE_WALL_M
        if line[5] > 0.0 and is_near and a * line[0] + b * line[1] > LINE_COSINE:
            return m
    return -1


@compiled
def find_centre(roof, k, site):
    """Return the centre of volume k's box inside the outline's."""
    box, bounds = roof.boxes[k], site.bounds
    return (
        0.5 * (max(box[0], bounds[0]) + min(box[1], bounds[1])),
        0.5 * (max(box[2], bounds[2]) + min(box[3], bounds[3])),
    )


@compiled
def add_bay(roof, site, bay):
    """Add a level volume over a bay, at its height. Returns its number."""
    k = roof.counts[VOLUME_COUNT]
    roof.counts[VOLUME_COUNT] = k + 1
    for s in range(N_SIDES):
        line = site.bays[bay, s]
        roof.sides[k, s] = add_line(roof, line[0], line[1], line[2])
    roof.n_planes[k], roof.replaces[k] = 0, 1
    add_plane(roof, k, roof.sides[k, 0], add_unknown(roof, site.bay_heights[bay]), NO_UNKNOWN)
    return k


@compiled
def share(roof, a, b, changed):
    """Let unknown `a`, which keeps its value, stand for `b`, too. Returns whether both are used."""
    is_used = False
    for k in range(roof.counts[VOLUME_COUNT]):
        for p in range(roof.n_planes[k]):
            is_used |= roof.heights[k, p] == a or roof.slopes[k, p] == a
            if roof.heights[k, p] == b:
                roof.heights[k, p] = a
                changed[k] = True
            if roof.slopes[k, p] == b:
                roof.slopes[k, p] = a
                changed[k] = True
        if changed[k]:
            place_volume(roof, k)
    return is_used and changed.any()


@compiled
def merge(roof, a, b, site, takes_planes):
    """Draw volume a out over b, perhaps with the planes that only b has, and leave b out."""
    for s in range(N_SIDES):
        half, best = roof.half_planes[a, s], 0
        for t in range(N_SIDES):
            other = roof.half_planes[b, t]
            if half[0] * other[0] + half[1] * other[1] > SAME_DIRECTION:
                best = roof.sides[b, t]
        if best == 0:
            best = run_over(roof, a, s, b)
        x, y, length = measure_middle(roof, a, s, site.bounds)
        e, f, g = read_line(roof, best)
        if length > 0.0 and e * x + f * y + g > 0.0:
            roof.sides[a, s] = best
    for p in range(roof.n_planes[b] if takes_planes else 0):
        if not has_alike_plane(roof, a, b, p):
            add_plane(roof, a, roof.plane_lines[b, p], roof.heights[b, p], roof.slopes[b, p])
    roof.n_planes[b] = 0


@compiled
def run_over(roof, a, s, b):
    """Return a line along side s of volume a that lies beyond all corners of volume b."""
    c, d, e = read_line(roof, roof.sides[a, s])
    beyond = 0.0
    for t in range(2):
        for u in range(2, N_SIDES):
            x, y = cross_lines(roof, roof.sides[b, t], roof.sides[b, u])
            beyond = min(beyond, c * x + d * y + e)
    return add_line(roof, c, d, e - beyond)


@compiled
def has_alike_plane(roof, a, b, p):
    """Return whether volume a has a plane that faces as plane p of volume b does."""
    if roof.slopes[b, p] >= 0:
        e, f, _ = read_line(roof, roof.plane_lines[b, p])
        return is_faced(roof, a, e, f)
    for q in range(roof.n_planes[a]):
        if roof.slopes[a, q] < 0:
            return True
    return False


@compiled
def has_alike(roof, a, b):
    """Return whether volume a has a plane alike for each of volume b."""
    for p in range(roof.n_planes[b]):
        if not has_alike_plane(roof, a, b, p):
            return False
    return True


@compiled
def face_planes(roof, k, way, site):
    """Turn the planes of volume k to the sides that they nearly face, or to the axis between two.

    A height that only this plane uses is that of the plane in the middle of the side. Returns
    whether anything changed.
    """
    has_changed = False
    for p in range(roof.n_planes[k]):
        if roof.slopes[k, p] < 0:
            continue
        c, d, _ = read_line(roof, roof.plane_lines[k, p])
        for s in range(N_SIDES):
            e, f, _ = read_line(roof, roof.sides[k, s])
            x, y, length = measure_middle(roof, k, s, site.bounds)
            if e * c + f * d <= FACING_COSINE or length == 0.0:
                continue
            line = roof.sides[k, s]
            if way != FACE_SIDES:
                g, h, _ = read_line(roof, roof.sides[k, s ^ 1])
                if e * g + f * h > -FACING_COSINE:
                    continue
                if way == FACE_AXIS:
                    norm = np.sqrt((e - g) ** 2 + (f - h) ** 2)
                    e, f = (e - g) / norm, (f - h) / norm
                elif (way == FACE_FIRST) == (s % 2 == 1):
                    e, f = -g, -h
                line = add_line(roof, e, f, -e * x - f * y)
            if line == roof.plane_lines[k, p]:
                continue
            if count_users(roof, roof.heights[k, p]) == 1:
                row = roof.planes[k, p]
                roof.values[roof.heights[k, p]] = row[0] * x + row[1] * y + row[2]
            roof.plane_lines[k, p] = line
            has_changed = True
            break
    return has_changed


@compiled
def level_eaves(roof, k, one_slope, walls, site):
    """Let all sloping planes of volume k rise from its sides at one height. Returns if any did."""
    face_planes(roof, k, FACE_SIDES, site)
    place_volume(roof, k)
    count = 0
    for p in range(roof.n_planes[k]):
        count += int(roof.slopes[k, p] >= 0)
    if count == 0 or (count == 1 and walls == 0):
        return False
    height, slope = choose_unknown(roof, k, roof.heights), choose_unknown(roof, k, roof.slopes)
    for p in range(roof.n_planes[k]):
        if roof.slopes[k, p] >= 0:
            roof.heights[k, p] = height
            roof.slopes[k, p] = slope if one_slope else roof.slopes[k, p]
    if walls:
        for m in range(len(site.lines)):
            line = site.lines[m]
            if cuts_corner(roof, k, line):
                signed = add_line(roof, line[0], line[1], line[2])
                add_plane(roof, k, signed, height, slope)
    return True


@compiled
def cover(roof, k, s, number, with_end, site):
    """Draw side s of volume k out to a wall, perhaps to end there as its other end does."""
    roof.sides[k, s] = find_new_side(roof, TO_OUTLINE, k, s, number, site)
    place_volume(roof, k)
    a, b, _ = read_line(roof, roof.sides[k, s])
    c, d, _ = read_line(roof, roof.sides[k, s ^ 1])
    if with_end and (is_faced(roof, k, a, b) or not is_faced(roof, k, c, d)):
        return False
    if not level_eaves(roof, k, 1, 1, site):
        return False
    for p in range(roof.n_planes[k] if with_end else 0):
        if roof.slopes[k, p] >= 0:
            add_plane(roof, k, roof.sides[k, s], roof.heights[k, p], roof.slopes[k, p])
            break
    return True


@compiled
def choose_unknown(roof, k, column):
    """Return the unknown that most planes use of those in a `column` of volume k's sloping planes.

    It is a new one with their mean if each is one plane's own.
    """
    chosen, most, total, count = -1, 1, 0.0, 0
    for p in range(roof.n_planes[k]):
        if roof.slopes[k, p] >= 0:
            users = count_users(roof, column[k, p])
            if users > most:
                chosen, most = column[k, p], users
            total += roof.values[column[k, p]]
            count += 1
    return chosen if chosen >= 0 else add_unknown(roof, total / count)


@compiled
def count_users(roof, u):
    """Count the planes that use an unknown."""
    count = 0
    for k in range(roof.counts[VOLUME_COUNT]):
        for p in range(roof.n_planes[k]):
            count += int(roof.heights[k, p] == u or roof.slopes[k, p] == u)
    return count
