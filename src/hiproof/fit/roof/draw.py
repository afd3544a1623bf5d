"""Draw a roof exactly: the visible part of each plane, as convex fragments.

What a volume hides of another's plane is one convex polygon, because the lowest of its planes is
higher than that plane just where all of them are. So a roof is drawn by cutting convex polygons out
of convex polygons, and its corners are the places where a plane covers neither half a turn nor a
whole one.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ...compiled import compiled
from .tables import (
    FAR_M,
    N_SIDES,
    ONE_PLANE,
    VOLUME_COUNT,
    VOLUME_PLANES,
    Tables,
    add_line,
    find_lowest_plane,
    has_room,
    place_volume,
)

HIDDEN_M = 0.01  # A side reaches no further (m) below what hides it.
RING_CORNERS = 40  # Most corners of a fragment.
MOST_FRAGMENTS = 4000  # Most fragments of what is drawn at once.
PIECE_ROOM = 200  # Most fragments of one plane in one piece of the outline.
AROUND_M = 0.5  # What is drawn around a box (m): what lies in it is then as in the whole roof.
ON_LINE_M = 1e-9  # Distance (m) from a line of a place on it.
FRAGMENT_M2 = 1e-4  # Area (m2) of the smallest fragment.
ONE_PLACE_M = 0.01  # Corners nearer than this (m) are one.
STRAIGHT_RAD = 0.0175  # Angle (rad): a corner turns by more than a degree.
ONE_LEVEL_M = 0.03  # Corners of one place whose heights differ less (m) are one.
MOST_AT_PLACE = 64  # Most planes that meet in one place.
SEEN_STEP_M = 0.05  # Lower steps (m) are within what two strips differ by.
SHARED_BORDER_M = 0.1  # Shortest stretch (m) of border that two fragments share.

Drawing = namedtuple(
    "Drawing", "count rings sizes owners numbers boxes scratch halves pieces notes"
)
"""Room for fragments: `rings` (f, RING_CORNERS, 2) of `sizes` (f,) corners, each visible of the
volume and plane in `owners` (f, 2). `count` (1,) are in use. Equal planes have one of `numbers`
(v, VOLUME_PLANES). `boxes` (f, 4) are the extents of the fragments, the rest is scratch: `pieces`
are rings, of which `notes` hold the size and the volume before which nothing hides each.
"""


def make_drawing(volumes: int) -> Drawing:
    """Return room for the drawing of so many volumes."""
    return Drawing(
        np.zeros(1, np.int64),
        np.empty((MOST_FRAGMENTS, RING_CORNERS, 2)),
        np.empty(MOST_FRAGMENTS, np.int64),
        np.empty((MOST_FRAGMENTS, 2), np.int64),
        np.empty((volumes, VOLUME_PLANES), np.int64),
        np.empty((MOST_FRAGMENTS, 4)),
        np.empty((5, RING_CORNERS, 2)),
        np.empty((N_SIDES + VOLUME_PLANES, 3)),
        np.empty((2 * PIECE_ROOM, RING_CORNERS, 2)),
        np.empty((2 * PIECE_ROOM, 2), np.int64),
    )


@compiled
def cut(ring, size, a, b, c, room):
    """Keep of a convex ring what has a x + b y + c >= 0. Returns how many corners it has then.

    `room` is for a ring.
    """
    is_whole = True
    for i in range(size):
        is_whole &= a * ring[i, 0] + b * ring[i, 1] + c >= -ON_LINE_M
    if is_whole:
        return size
    count = 0
    x0, y0 = ring[size - 1, 0], ring[size - 1, 1]
    d0 = a * x0 + b * y0 + c
    for i in range(size):
        x1, y1 = ring[i, 0], ring[i, 1]
        d1 = a * x1 + b * y1 + c
        if (d0 > ON_LINE_M and d1 < -ON_LINE_M) or (d0 < -ON_LINE_M and d1 > ON_LINE_M):
            if count < RING_CORNERS:
                t = d0 / (d0 - d1)
                room[count, 0], room[count, 1] = x0 + t * (x1 - x0), y0 + t * (y1 - y0)
                count += 1
        if d1 >= -ON_LINE_M and count < RING_CORNERS:
            room[count, 0], room[count, 1] = x1, y1
            count += 1
        x0, y0, d0 = x1, y1, d1
    for i in range(count):
        ring[i, 0], ring[i, 1] = room[i, 0], room[i, 1]
    return count if count >= 3 else 0


@compiled
def measure_area(ring, size):
    total, x0, y0 = 0.0, ring[size - 1, 0], ring[size - 1, 1]
    for i in range(size):
        total += x0 * ring[i, 1] - ring[i, 0] * y0
        x0, y0 = ring[i, 0], ring[i, 1]
    return 0.5 * total


@compiled
def copy_ring(ring, size, out):
    for i in range(size):
        out[i, 0], out[i, 1] = ring[i, 0], ring[i, 1]


@compiled
def measure_box(ring, size):
    """Return the least and greatest x and y of a ring."""
    x0, x1, y0, y1 = FAR_M, -FAR_M, FAR_M, -FAR_M
    for i in range(size):
        x0, x1 = min(x0, ring[i, 0]), max(x1, ring[i, 0])
        y0, y1 = min(y0, ring[i, 1]), max(y1, ring[i, 1])
    return x0, x1, y0, y1


@compiled
def meets(box, x0, x1, y0, y1):
    """Return whether a box reaches into another."""
    return box[0] < x1 and box[1] > x0 and box[2] < y1 and box[3] > y0


@compiled
def is_near(box, other, reach):
    """Return whether a box lies no further than `reach` (m) from another."""
    return meets(box, other[0] - reach, other[1] + reach, other[2] - reach, other[3] + reach)


@compiled
def widen_box(box, other):
    box[0], box[1] = min(box[0], other[0]), max(box[1], other[1])
    box[2], box[3] = min(box[2], other[2]), max(box[3], other[3])


@compiled
def number_planes(roof, view, numbers):
    """Give equal planes of the volumes in `view` one number."""
    for m in range(len(view)):
        k = view[m]
        for p in range(roof.n_planes[k]):
            numbers[k, p] = k * VOLUME_PLANES + p
            is_new = True
            for n in range(m + 1):
                j = view[n]
                for q in range(roof.n_planes[j] if j != k else p):
                    if (
                        abs(roof.planes[j, q, 0] - roof.planes[k, p, 0]) < ONE_PLANE
                        and abs(roof.planes[j, q, 1] - roof.planes[k, p, 1]) < ONE_PLANE
                        and abs(roof.planes[j, q, 2] - roof.planes[k, p, 2]) < ONE_PLANE
                    ):
                        numbers[k, p] = numbers[j, q]
                        is_new = False
                        break
                if not is_new:
                    break


@compiled
def list_halves(roof, numbers, j, p, k, halves):
    """Set the half planes (h, 3) of what volume k hides of plane p of volume j.

    The first four are its sides, the others where its planes are higher. Of equal planes the first
    volume's is visible.
    """
    is_equal_hidden = 1.0 if k < j else -1.0
    for i in range(3):
        for h in range(N_SIDES):
            halves[h, i] = roof.half_planes[k, h, i]
        for q in range(roof.n_planes[k]):
            half = roof.planes[k, q, i] - roof.planes[j, p, i]
            if numbers[k, q] == numbers[j, p]:
                half = is_equal_hidden if i == 2 else 0.0
            halves[N_SIDES + q, i] = half


@compiled
def add_piece(pieces, notes, first, count, ring, size, floor):
    """Add a ring to the `count` pieces from `first` on if it is large enough. Returns how many."""
    if size == 0 or count >= PIECE_ROOM or measure_area(ring, size) < FRAGMENT_M2:
        return count
    t = first + count
    for i in range(size):
        pieces[t, i, 0], pieces[t, i, 1] = ring[i, 0], ring[i, 1]
    notes[t, 0], notes[t, 1] = size, floor
    return count + 1


@compiled
def subtract(box, halves, k, shows, pieces, notes, source, target, count, scratch):
    """Cut pieces along the half planes (h, 3) of what volume k, inside a `box`, hides.

    What is inside of all is left out, or `shows`: then nothing that came before k hides it. The
    pieces begin at `source`, the new ones at `target`. Returns how many these are.
    """
    kept, rest, other, room = 0, scratch[2], scratch[3], scratch[4]
    for t in range(source, source + count):
        ring, size, floor, left = pieces[t], notes[t, 0], notes[t, 1], 0
        x0, x1, y0, y1 = measure_box(ring, size)
        if k >= floor and meets(box, x0 + 1e-6, x1 - 1e-6, y0 + 1e-6, y1 - 1e-6):
            copy_ring(ring, size, rest)
            left = size
            for h in range(len(halves)):
                left = cut(rest, left, halves[h, 0], halves[h, 1], halves[h, 2], room)
                if left == 0:
                    break
        if left == 0 or measure_area(rest, left) < FRAGMENT_M2:
            kept = add_piece(pieces, notes, target, kept, ring, size, floor)
            continue
        if shows:
            kept = add_piece(pieces, notes, target, kept, rest, left, k)
        copy_ring(ring, size, rest)
        left = size
        for h in range(len(halves)):
            a, b, c = halves[h, 0], halves[h, 1], halves[h, 2]
            copy_ring(rest, left, other)
            outside = cut(other, left, -a, -b, -c, room)
            kept = add_piece(pieces, notes, target, kept, other, outside, floor)
            left = cut(rest, left, a, b, c, room)
    return kept


@compiled
def draw_plane(roof, drawing, view, j, p, part, size):
    """Add the visible fragments of plane p of volume j in a convex part of the outline."""
    numbers, halves, planes, scratch = drawing.numbers, drawing.halves, roof.planes, drawing.scratch
    pieces, notes, boxes, plan = drawing.pieces, drawing.notes, roof.boxes, scratch[1]
    copy_ring(part, size, plan)
    for q in range(roof.n_planes[j]):
        if q != p:
            if numbers[j, q] == numbers[j, p]:
                if q < p:
                    return
                continue
            a, b = planes[j, q, 0] - planes[j, p, 0], planes[j, q, 1] - planes[j, p, 1]
            size = cut(plan, size, a, b, planes[j, q, 2] - planes[j, p, 2], scratch[4])
            if size == 0:
                return
    source, target = 0, PIECE_ROOM
    count = add_piece(pieces, notes, source, 0, plan, size, j if roof.replaces[j] else 0)
    x0, x1, y0, y1 = measure_box(plan, size)
    for turn in range(2):  # first, what came before a volume that replaces can no longer hide
        for m in range(len(view)):
            k = view[m]
            replaces, is_later = roof.replaces[k] > 0, k > j
            if k == j or count == 0 or (turn == 0 and not (replaces and not is_later)):
                continue
            if not meets(boxes[k], x0, x1, y0, y1):
                continue
            list_halves(roof, numbers, j, p, k, halves)
            hides_all = turn == 0 or (replaces and is_later)
            of_k = halves[: N_SIDES if hides_all else N_SIDES + roof.n_planes[k]]
            count = subtract(
                boxes[k], of_k, k, turn == 0, pieces, notes, source, target, count, scratch
            )
            source, target = target, source
    for t in range(source, source + count):
        add_fragment(drawing, j, p, pieces[t], notes[t, 0])


@compiled
def add_fragment(drawing, j, p, ring, size):
    """Add a ring to the drawing, where plane p of volume j is visible."""
    f, boxes = drawing.count[0], drawing.boxes
    if f < MOST_FRAGMENTS:
        copy_ring(ring, size, drawing.rings[f])
        drawing.sizes[f] = size
        drawing.owners[f, 0], drawing.owners[f, 1] = j, p
        x0, x1, y0, y1 = measure_box(ring, size)
        boxes[f, 0], boxes[f, 1] = x0 - ONE_PLACE_M, x1 + ONE_PLACE_M
        boxes[f, 2], boxes[f, 3] = y0 - ONE_PLACE_M, y1 + ONE_PLACE_M
        drawing.count[0] = f + 1


@compiled
def cut_part(roof, k, site, part, plan, room):
    """Set the ring `plan` to what lies inside volume k's sides of a convex part of the outline.

    `room` is for a ring. Returns how many corners the plan has.
    """
    size = site.part_sizes[part]
    copy_ring(site.parts[part], size, plan)
    for s in range(N_SIDES):
        half = roof.half_planes[k, s]
        size = cut(plan, size, half[0], half[1], half[2], room)
        if size == 0:
            break
    return size


@compiled
def cut_box(ring, size, box, room):
    """Keep of a convex ring what lies in a box, and around it as far as a stretch of a step."""
    for side in range(4):
        sign = 1.0 if side % 2 == 0 else -1.0
        a, b = (sign, 0.0) if side < 2 else (0.0, sign)
        size = cut(ring, size, a, b, AROUND_M - sign * box[side], room) if size > 0 else 0
    return size


@compiled
def draw(roof, drawing, view, site, box):
    """Draw the volumes of `view` (m,) inside the outline, in a `box` (4,) and close around it."""
    drawing.count[0] = 0
    number_planes(roof, view, drawing.numbers)
    plan, room = drawing.scratch[0], drawing.scratch[4]
    for part in range(len(site.part_sizes)):
        bounds = site.part_boxes[part]
        if not meets(box, bounds[0], bounds[1], bounds[2], bounds[3]):
            continue
        for m in range(len(view)):
            j = view[m]
            if not meets(roof.boxes[j], bounds[0], bounds[1], bounds[2], bounds[3]):
                continue
            size = cut_part(roof, j, site, part, plan, room)
            size = cut_box(plan, size, box, room)
            if size == 0 or measure_area(plan, size) < FRAGMENT_M2:
                continue
            for p in range(roof.n_planes[j]):
                draw_plane(roof, drawing, view, j, p, plan, size)


def draw_whole_roof(roof: Tables, site) -> Drawing:
    """Return the drawing of a whole roof."""
    drawing = make_drawing(len(roof.sides))
    everywhere = np.array([-np.inf, np.inf, -np.inf, np.inf])
    draw(roof, drawing, np.arange(roof.counts[VOLUME_COUNT]), site, everywhere)
    return drawing


@compiled
def draw_in(roof, drawing):
    """Draw in the sides of a drawn roof's volumes that reach far below what hides them."""
    hidden = np.full((roof.counts[VOLUME_COUNT], N_SIDES), FAR_M)
    for f in range(drawing.count[0]):
        k = drawing.owners[f, 0]
        for s in range(N_SIDES):
            a, b, c = roof.half_planes[k, s]
            for i in range(drawing.sizes[f]):
                x, y = drawing.rings[f, i]
                hidden[k, s] = min(hidden[k, s], a * x + b * y + c)
    for k in range(len(hidden)):
        for s in range(N_SIDES):
            if HIDDEN_M < hidden[k, s] < 0.5 * FAR_M and has_room(roof):
                a, b, c = roof.half_planes[k, s]
                roof.sides[k, s] = add_line(roof, a, b, c - hidden[k, s] + HIDDEN_M)
        place_volume(roof, k)


@compiled
def measure_cover(ring, size, x, y):
    """Return the angle (rad) that a convex ring covers around a place."""
    near = -1
    for i in range(size):
        if abs(ring[i, 0] - x) < ONE_PLACE_M and abs(ring[i, 1] - y) < ONE_PLACE_M:
            near = i
            break
    if near < 0:
        return measure_cover_beside(ring, size, x, y)
    before, after = near, near
    for _ in range(size):
        before = before - 1 if before > 0 else size - 1
        if abs(ring[before, 0] - x) >= ONE_PLACE_M or abs(ring[before, 1] - y) >= ONE_PLACE_M:
            break
    for _ in range(size):
        after = after + 1 if after + 1 < size else 0
        if abs(ring[after, 0] - x) >= ONE_PLACE_M or abs(ring[after, 1] - y) >= ONE_PLACE_M:
            break
    ux, uy = ring[before, 0] - x, ring[before, 1] - y
    vx, vy = ring[after, 0] - x, ring[after, 1] - y
    return abs(np.arctan2(vx * uy - vy * ux, ux * vx + uy * vy))


@compiled
def measure_cover_beside(ring, size, x, y):
    """Return a whole turn inside a ring, half a turn on its edge, and 0 outside."""
    x0, y0 = ring[size - 1, 0], ring[size - 1, 1]
    cover = 2.0 * np.pi
    for i in range(size):
        x1, y1 = ring[i, 0], ring[i, 1]
        ex, ey = x1 - x0, y1 - y0
        length = np.sqrt(ex * ex + ey * ey)
        if length > ON_LINE_M:
            depth = (ex * (y - y0) - ey * (x - x0)) / length
            if depth < -ONE_PLACE_M:
                return 0.0
            if depth < ONE_PLACE_M:
                cover = np.pi
        x0, y0 = x1, y1
    return cover


@compiled
def list_places(drawing, box):
    """Return the distinct places (n,), (n,) in a `box` where fragments have corners."""
    total = 0
    for f in range(drawing.count[0]):
        total += drawing.sizes[f]
    xs, ys, count = np.empty(total), np.empty(total), 0
    for f in range(drawing.count[0]):
        for i in range(drawing.sizes[f]):
            x, y = drawing.rings[f, i, 0], drawing.rings[f, i, 1]
            if box[0] < x < box[1] and box[2] < y < box[3]:
                xs[count], ys[count] = x, y
                count += 1
    xs, ys = xs[:count], ys[:count]
    order, is_used, kept = np.argsort(xs, kind="mergesort"), np.zeros(count, np.bool_), 0
    out_x, out_y = np.empty(count), np.empty(count)
    for s in range(count):
        i = order[s]
        if is_used[i]:
            continue
        t = s
        while t < count and xs[order[t]] < xs[i] + ONE_PLACE_M:
            if abs(ys[order[t]] - ys[i]) < ONE_PLACE_M:
                is_used[order[t]] = True
            t += 1
        out_x[kept], out_y[kept] = xs[i], ys[i]
        kept += 1
    return out_x[:kept], out_y[:kept]


@compiled
def list_corners(roof, drawing, box):
    """Return the places (n, 2) of a drawn roof's corners in a `box` (4,), one for each level."""
    xs, ys = list_places(drawing, box)
    out, total, levels = np.empty((len(xs), 2)), 0, np.empty(MOST_AT_PLACE)
    room = np.empty(MOST_AT_PLACE, np.int64), np.empty(MOST_AT_PLACE), np.empty(MOST_AT_PLACE)
    for i in range(len(xs)):
        count = find_levels(roof, drawing, xs[i], ys[i], levels, room)
        while total + count > len(out):
            out = np.concatenate((out, np.empty_like(out)))
        out[total : total + count, 0], out[total : total + count, 1] = xs[i], ys[i]
        total += count
    return out[:total]


@compiled
def find_levels(roof, drawing, x, y, levels, room):
    """Set the heights of the corners at a place of a drawn roof. Returns their number.

    There is `room` for the planes that meet there, the angles that they cover, and their heights.
    """
    planes, covers, heights = room
    met, count = 0, 0
    for f in range(drawing.count[0]):
        if not (
            drawing.boxes[f, 0] <= x <= drawing.boxes[f, 1]
            and drawing.boxes[f, 2] <= y <= drawing.boxes[f, 3]
        ):
            continue
        cover = measure_cover(drawing.rings[f], drawing.sizes[f], x, y)
        if cover == 0.0:
            continue
        k, p = drawing.owners[f, 0], drawing.owners[f, 1]
        number, place = drawing.numbers[k, p], 0
        while place < met and planes[place] != number:
            place += 1
        if place < met:
            covers[place] += cover
        elif met < MOST_AT_PLACE:
            planes[met], covers[met] = number, cover
            row = roof.planes[k, p]
            heights[met] = row[0] * x + row[1] * y + row[2]
            met += 1
    for place in range(met):
        turn = covers[place] % np.pi
        if min(turn, np.pi - turn) < STRAIGHT_RAD:
            continue
        is_new = True
        for level in range(count):
            is_new = is_new and abs(levels[level] - heights[place]) >= ONE_LEVEL_M
        if is_new:
            levels[count] = heights[place]
            count += 1
    return count


@compiled
def compute_height(roof, view, x, y, reach):
    """Return the height of the roof over a place, the volume and the plane; -inf where none is.

    Sides reach so far (m) beyond themselves.
    """
    height, volume, plane = -np.inf, -1, -1
    boxes, halves = roof.boxes, roof.half_planes
    for m in range(len(view)):
        k = view[m]
        if x < boxes[k, 0] - reach or x > boxes[k, 1] + reach:
            continue
        if y < boxes[k, 2] - reach or y > boxes[k, 3] + reach:
            continue
        is_inside = True
        for s in range(N_SIDES):
            is_inside &= halves[k, s, 0] * x + halves[k, s, 1] * y + halves[k, s, 2] >= -reach
        if not is_inside:
            continue
        lowest, lowest_plane = find_lowest_plane(roof, k, x, y)
        if roof.replaces[k] or lowest > height:
            height, volume, plane = lowest, k, lowest_plane
    return height, volume, plane


@compiled
def compute_heights(roof, view, x, y, reach, heights, volumes):
    """Set heights and volumes (n,) to what `compute_height` says of places x, y (n,).

    Each step is taken for all places at once, so that a processor takes it for several together.
    """
    heights[:], volumes[:] = -np.inf, -1
    room, ascends = np.empty(len(x)), True
    for i in range(1, len(x)):
        ascends &= x[i - 1] <= x[i]
    for m in range(len(view)):
        k, first, last = view[m], 0, len(x)
        x0, x1 = roof.boxes[k, 0] - reach, roof.boxes[k, 1] + reach
        y0, y1 = roof.boxes[k, 2] - reach, roof.boxes[k, 3] + reach
        if ascends:
            first, last = np.searchsorted(x, x0), np.searchsorted(x, x1, "right")
        u, v, z = x[first:last], y[first:last], room[first:last]
        z[:] = np.inf
        for p in range(roof.n_planes[k]):
            row = roof.planes[k, p]
            a, b, c = row[0], row[1], row[2]
            for i in range(len(z)):
                height = a * u[i] + b * v[i] + c
                z[i] = height if height < z[i] else z[i]
        for i in range(len(z)):
            is_in_box = (u[i] >= x0) & (u[i] <= x1) & (v[i] >= y0) & (v[i] <= y1)
            z[i] = z[i] if is_in_box else -np.inf
        for s in range(N_SIDES):
            half = roof.half_planes[k, s]
            a, b, c = half[0], half[1], half[2]
            for i in range(len(z)):
                z[i] = z[i] if a * u[i] + b * v[i] + c >= -reach else -np.inf
        highest, owners, replaces = heights[first:last], volumes[first:last], roof.replaces[k] > 0
        for i in range(len(z)):
            is_seen = (z[i] > highest[i]) | (replaces & (z[i] > -np.inf))
            highest[i] = z[i] if is_seen else highest[i]
            owners[i] = k if is_seen else owners[i]


@compiled
def join_fragments(roof, drawing):
    """Return for each fragment (f,) the first one that no step keeps apart from it."""
    count = drawing.count[0]
    first = np.arange(count)
    for f in range(count):
        box = drawing.boxes[f]
        for g in range(f + 1, count):
            if first[f] == first[g] or not meets(drawing.boxes[g], box[0], box[1], box[2], box[3]):
                continue
            if are_continuous(roof, drawing, f, g):
                old, new = max(first[f], first[g]), min(first[f], first[g])
                for h in range(count):
                    if first[h] == old:
                        first[h] = new
    return first


@compiled
def are_continuous(roof, drawing, f, g):
    """Return whether two fragments share a stretch of border on which they are at one height."""
    row = roof.planes[drawing.owners[f, 0], drawing.owners[f, 1]]
    other = roof.planes[drawing.owners[g, 0], drawing.owners[g, 1]]
    ring, size = drawing.rings[f], drawing.sizes[f]
    x0, y0 = ring[size - 1, 0], ring[size - 1, 1]
    for i in range(size):
        x1, y1 = ring[i, 0], ring[i, 1]
        length = np.sqrt((x1 - x0) ** 2 + (y1 - y0) ** 2)
        if length > SHARED_BORDER_M:
            a, b = (x1 - x0) / length, (y1 - y0) / length
            low, high = find_overlap(drawing.rings[g], drawing.sizes[g], x0, y0, a, b, length)
            if high - low > SHARED_BORDER_M:
                t = 0.5 * (low + high)
                x, y = x0 + t * a, y0 + t * b
                step = row[0] * x + row[1] * y + row[2] - other[0] * x - other[1] * y - other[2]
                if abs(step) < SEEN_STEP_M:
                    return True
        x0, y0 = x1, y1
    return False


@compiled
def find_overlap(ring, size, x, y, a, b, length):
    """Return the stretch of a segment from x, y along a, b that an edge of a ring covers."""
    u, v = ring[size - 1, 0], ring[size - 1, 1]
    for i in range(size):
        p, q = ring[i, 0], ring[i, 1]
        if (
            abs(a * (v - y) - b * (u - x)) < ONE_PLACE_M
            and abs(a * (q - y) - b * (p - x)) < ONE_PLACE_M
        ):
            s, t = a * (u - x) + b * (v - y), a * (p - x) + b * (q - y)
            low, high = max(min(s, t), 0.0), min(max(s, t), length)
            if high - low > SHARED_BORDER_M:
                return low, high
        u, v = p, q
    return 0.0, 0.0
