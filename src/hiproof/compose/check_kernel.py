"""The compiled tests behind `check_solid`.

Each finding is a row (code, face, other face or -1).

Faces are flattened: ring r has vertices `index[ring_start[r]:ring_start[r + 1]]`, face f the rings
`face_start[f]:face_start[f + 1]`, the outer one first. Polygons are tested in the projection along
the largest component of their normal, which only drops a coordinate and so moves nothing.
"""

from __future__ import annotations

import numpy as np

from ..compiled import compiled
from ..geometry.area_vectors import cross, dot, enclosed_volume, newell
from ..geometry.arrays import copy_row, measure_range, sort_order
from ..geometry.point_in_polygon import flips
from .bends import SURELY_FLAT_COSINE
from .joined import find_root, join

SAME_POINT_M = 1e-3  # m; val3dity's snap tolerance
ON_SEGMENT_M = 1e-9  # m; numerically on the segment
# vertices up to which all triples of a ring are looked at: they grow with the cube
MOST_VERTICES_IN_THREES = 40
# shorter than one: what is further apart along it is further apart in space
SKEW = np.array([0.43, 0.61, 0.67])


@compiled
def weld(vertices, tolerance):
    """Return for each vertex (n,) the lowest index of one within `tolerance`."""
    same = np.arange(len(vertices))
    # buildings are square to the axes: along none of them do so few vertices share a place
    along = SKEW[0] * vertices[:, 0] + SKEW[1] * vertices[:, 1] + SKEW[2] * vertices[:, 2]
    order = sort_order(along)
    for i in range(len(order)):
        v = order[i]
        for k in range(i - 1, -1, -1):
            w = order[k]
            if along[v] - along[w] >= tolerance:
                break
            d = vertices[v] - vertices[w]
            if d[0] * d[0] + d[1] * d[1] + d[2] * d[2] < tolerance * tolerance:
                join(same, v, w)
    for v in range(len(same)):
        same[v] = find_root(same, v)
    return same


@compiled
def cross2(a, b, c):
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


@compiled
def distance_to_segment(p, a, b):
    dx, dy = b[0] - a[0], b[1] - a[1]
    length2 = dx * dx + dy * dy
    t = (
        0.0
        if length2 == 0
        else min(1.0, max(0.0, ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / length2))
    )
    return np.hypot(p[0] - a[0] - t * dx, p[1] - a[1] - t * dy)


@compiled
def crosses(a, b, c, d):
    """Return whether the open segments ab and cd cross in one point."""
    left, right = cross2(a, b, c), cross2(a, b, d)
    if not ((left > 0 and right < 0) or (left < 0 and right > 0)):
        return False
    left, right = cross2(c, d, a), cross2(c, d, b)
    return (left > 0 and right < 0) or (left < 0 and right > 0)


@compiled
def is_inside_ring(p, flat, index, lower, upper):
    """Return whether the plan point p lies in the ring, by parity."""
    inside = False
    for k in range(lower, upper):
        a, b = flat[index[k]], flat[index[k + 1 if k + 1 < upper else lower]]
        if flips(a[0], a[1], b[0], b[1], p[0], p[1]):
            inside = not inside
    return inside


@compiled
def depth_in_face(p, flat, index, ring_start, first, last):
    """Return the distance of plan point p from a face's border.

    It is negative outside.
    """
    inside, nearest = False, np.inf
    for r in range(first, last):
        lower, upper = ring_start[r], ring_start[r + 1]
        if is_inside_ring(p, flat, index, lower, upper):
            inside = not inside
        for k in range(lower, upper):
            nearest = min(
                nearest,
                distance_to_segment(
                    p, flat[index[k]], flat[index[k + 1 if k + 1 < upper else lower]]
                ),
            )
    return nearest if inside else -nearest


@compiled
def segments_touch(a, b, c, d):
    """Return whether plan segments ab and cd cross or touch.

    They touch where an end of one lies on the other.
    """
    return (
        crosses(a, b, c, d)
        or min(distance_to_segment(c, a, b), distance_to_segment(d, a, b)) <= ON_SEGMENT_M
        or min(distance_to_segment(a, c, d), distance_to_segment(b, c, d)) <= ON_SEGMENT_M
    )


@compiled
def is_simple_ring(flat, index, lower, upper):
    """Return whether a ring neither crosses, touches nor folds back on itself.

    Its vertices are already welded.
    """
    size = upper - lower
    for i in range(size):
        a, b = index[lower + i], index[lower + (i + 1) % size]
        c = index[lower + (i + 2) % size]
        if distance_to_segment(flat[c], flat[a], flat[b]) <= ON_SEGMENT_M:
            return False
        if distance_to_segment(flat[a], flat[b], flat[c]) <= ON_SEGMENT_M:
            return False
        west = min(flat[a, 0], flat[b, 0]) - ON_SEGMENT_M
        east = max(flat[a, 0], flat[b, 0]) + ON_SEGMENT_M
        south = min(flat[a, 1], flat[b, 1]) - ON_SEGMENT_M
        north = max(flat[a, 1], flat[b, 1]) + ON_SEGMENT_M
        for j in range(i + 2, size):
            if i == 0 and j == size - 1:
                continue
            c, d = index[lower + j], index[lower + j + 1 if j + 1 < size else lower]
            if (flat[c, 0] < west and flat[d, 0] < west) or (
                flat[c, 0] > east and flat[d, 0] > east
            ):
                continue
            if (flat[c, 1] < south and flat[d, 1] < south) or (
                flat[c, 1] > north and flat[d, 1] > north
            ):
                continue
            if a in (c, d) or b in (c, d) or segments_touch(flat[a], flat[b], flat[c], flat[d]):
                return False
    return True


@compiled
def are_same_ring(index, lower, upper, low2, high2):
    """Return whether two rings hold the same vertices."""
    if upper - lower != high2 - low2:
        return False
    for k in range(lower, upper):
        result = False
        for m in range(low2, high2):
            result = result or index[k] == index[m]
        if not result:
            return False
    return True


@compiled
def rings_meet(flat, index, lower, upper, low2, high2):
    """Return whether two rings cross, and in how many points they touch.

    Sharing a stretch counts as crossing.
    """
    touches = 0
    for k in range(lower, upper):
        a, b = flat[index[k]], flat[index[k + 1 if k + 1 < upper else lower]]
        on_other, middle_on_other = False, False
        middle = 0.5 * (a + b)
        for m in range(low2, high2):
            c, d = flat[index[m]], flat[index[m + 1 if m + 1 < high2 else low2]]
            if crosses(a, b, c, d):
                return True, touches
            on_other = on_other or distance_to_segment(a, c, d) <= ON_SEGMENT_M
            middle_on_other = middle_on_other or distance_to_segment(middle, c, d) <= ON_SEGMENT_M
            if distance_to_segment(c, a, b) <= ON_SEGMENT_M:
                gap = (
                    np.hypot(c[0] - a[0], c[1] - a[1]) > ON_SEGMENT_M
                    and np.hypot(c[0] - b[0], c[1] - b[1]) > ON_SEGMENT_M
                )
                touches += gap
        if on_other and middle_on_other:
            return True, touches
        touches += on_other
    return False, touches


@compiled
def is_ring_in_ring(flat, index, lower, upper, low2, high2):
    """Return whether the first ring lies in the second.

    Its first vertex or edge middle that is not on the second's border decides.
    """
    for k in range(lower, upper):
        a, b = flat[index[k]], flat[index[k + 1 if k + 1 < upper else lower]]
        for p in (a, 0.5 * (a + b)):
            nearest = np.inf
            for m in range(low2, high2):
                nearest = min(
                    nearest,
                    distance_to_segment(
                        p, flat[index[m]], flat[index[m + 1 if m + 1 < high2 else low2]]
                    ),
                )
            if nearest > ON_SEGMENT_M:
                return is_inside_ring(p, flat, index, low2, high2)
    return False


@compiled
def check_inner_rings(flat, index, ring_start, first, last, signed, result, count, f):
    """Find codes 201, 202, 205, 206, 207 and 208 of one face.

    `signed` are the rings' areas along the face's normal.
    """
    parent = np.arange(last - first)
    for r in range(first + 1, last):
        lower, upper = ring_start[r], ring_start[r + 1]
        code = 0
        for s in range(first, r):
            low2, high2 = ring_start[s], ring_start[s + 1]
            if are_same_ring(index, lower, upper, low2, high2):
                code = 202
                break
            meet, touches = rings_meet(flat, index, lower, upper, low2, high2)
            if meet:
                code = 201
                break
            if touches > 1 or (
                touches == 1 and find_root(parent, r - first) == find_root(parent, s - first)
            ):
                code = 205
                break
            if touches == 1:
                join(parent, r - first, s - first)
            if s == first and not is_ring_in_ring(flat, index, lower, upper, low2, high2):
                code = 206
                break
            if s > first and (
                is_ring_in_ring(flat, index, lower, upper, low2, high2)
                or is_ring_in_ring(flat, index, low2, high2, lower, upper)
            ):
                code = 207
                break
        if code == 0 and signed[r - first] > 0:
            code = 208
        if code:
            result[count, 0], result[count, 1], result[count, 2] = code, f, -1
            count += 1
    return count


@compiled
def may_bend(vertices, index, lower, upper, normal):
    """Return whether three vertices of a face may span a bent triangle.

    Such a triangle is over 10 degrees off the face's `normal`.

    Where none do, no two triangles of any triangulation are over 20 degrees apart. Large faces are
    not asked.
    """
    if upper - lower > MOST_VERTICES_IN_THREES:
        return True
    for i in range(lower, upper - 2):
        p = vertices[index[i]]
        for j in range(i + 1, upper - 1):
            q = vertices[index[j]]
            ux, uy, uz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
            for k in range(j + 1, upper):
                r = vertices[index[k]]
                wx, wy, wz = r[0] - p[0], r[1] - p[1], r[2] - p[2]
                x, y, z = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
                along = x * normal[0] + y * normal[1] + z * normal[2]
                if abs(along) < SURELY_FLAT_COSINE * np.sqrt(x * x + y * y + z * z):
                    return True
    return False


@compiled
def ring_lengths_code(index, ring_start, first, last):
    """Return code 101 or 102 of the rings first to last, or 0.

    0 is for rings that have enough points and none twice in a row.
    """
    code = 101 if first == last else 0
    for r in range(first, last):
        lower, upper = ring_start[r], ring_start[r + 1]
        if upper - lower < 3:
            return 101
        for k in range(lower, upper):
            if index[k] == index[k + 1 if k + 1 < upper else lower]:
                code = 102
    return code


@compiled
def check_faces(vertices, index, ring_start, face_start, planarity):
    """Find ring and face codes other than 204.

    Returns the rows found, unit normals (f, 3), offsets (f,), flatness (f,), and may bend (f,).
    """
    faces = len(face_start) - 1
    normals, offsets, flatness = np.zeros((faces, 3)), np.zeros(faces), np.zeros(faces)
    risky = np.zeros(faces, np.bool_)
    result, count = np.empty((6 * len(index) + 6 * len(ring_start) + 64, 3), np.int64), 0
    flat = np.empty((len(vertices), 2))
    for f in range(faces):
        first, last = face_start[f], face_start[f + 1]
        code = ring_lengths_code(index, ring_start, first, last)
        area = (
            np.zeros(3)
            if code
            else newell(vertices, index, ring_start[first], ring_start[first + 1])
        )
        size = np.sqrt(dot(area, area))
        if code == 0 and size < 1e-7:
            code = 104
        if code:
            result[count, 0], result[count, 1], result[count, 2] = code, f, -1
            count += 1
            continue
        lower, upper = ring_start[first], ring_start[last]
        normal, offsets[f], flatness[f] = best_plane(vertices, index, lower, upper, area / size)
        copy_row(normals[f], normal)
        if flatness[f] > planarity:
            result[count, 0], result[count, 1], result[count, 2] = 203, f, -1
            count += 1
        else:
            risky[f] = upper - lower > 3 and may_bend(vertices, index, lower, upper, normals[f])
        project(flat, vertices, index, lower, upper, np.argmax(np.abs(normals[f])))
        simple = True
        for r in range(first, last):
            simple = simple and is_simple_ring(flat, index, ring_start[r], ring_start[r + 1])
        if not simple:
            result[count, 0], result[count, 1], result[count, 2] = 104, f, -1
            count += 1
        elif last - first > 1:
            signed = np.empty(last - first)
            for r in range(first, last):
                signed[r - first] = dot(
                    newell(vertices, index, ring_start[r], ring_start[r + 1]), normals[f]
                )
            count = check_inner_rings(
                flat, index, ring_start, first, last, signed, result, count, f
            )
    return result[:count].copy(), normals, offsets, flatness, risky


@compiled
def best_plane(vertices, index, lower, upper, normal):
    """Return the least-squares plane through index[lower:upper].

    It is (unit normal, offset, how far vertices lie off it).

    `normal` is about right and is turned to the best; that of the area goes far astray where a face
    is long and thin.
    """
    centre = np.zeros(3)
    for k in range(lower, upper):
        centre += vertices[index[k]]
    centre /= upper - lower
    perpendicular = np.zeros(3)
    perpendicular[np.argmin(np.abs(normal))] = 1.0
    u = cross(normal, perpendicular)
    u /= np.sqrt(dot(u, u))
    v = cross(normal, u)
    uu = uv = vv = ud = vd = 0.0
    for k in range(lower, upper):
        p = vertices[index[k]] - centre
        pu, pv, pd = dot(p, u), dot(p, v), dot(p, normal)
        uu, uv, vv, ud, vd = uu + pu * pu, uv + pu * pv, vv + pv * pv, ud + pu * pd, vd + pv * pd
    determinant = uu * vv - uv * uv
    if determinant > 1e-9 * uu * vv:
        normal = (
            normal
            - u * ((ud * vv - vd * uv) / determinant)
            - v * ((vd * uu - ud * uv) / determinant)
        )
        normal = normal / np.sqrt(dot(normal, normal))
    farthest = 0.0
    for k in range(lower, upper):
        farthest = max(farthest, abs(dot(vertices[index[k]] - centre, normal)))
    return normal, dot(centre, normal), farthest


@compiled
def largest_axes(normals):
    """Return for each normal (f, 3) the axis of its largest component."""
    axes = np.zeros(len(normals), np.int64)
    for f in range(len(normals)):
        axes[f] = np.argmax(np.abs(normals[f]))
    return axes


@compiled
def project(flat, vertices, index, lower, upper, axis):
    """Write the vertices without their coordinate along `axis` into flat (n, 2).

    They are index[lower:upper].
    """
    first, second = 1 if axis == 0 else 0, 1 if axis == 2 else 2
    for k in range(lower, upper):
        flat[index[k], 0], flat[index[k], 1] = vertices[index[k], first], vertices[index[k], second]


@compiled
def directed_edges(index, ring_start, face_start):
    """Return all directed edges sorted by their vertices.

    An edge (e, 4) is low vertex, high vertex, +1 or -1, and face.
    """
    edges = np.empty((len(index), 4), np.int64)
    count = 0
    for f in range(len(face_start) - 1):
        for r in range(face_start[f], face_start[f + 1]):
            lower, upper = ring_start[r], ring_start[r + 1]
            for k in range(lower, upper):
                a, b = index[k], index[k + 1 if k + 1 < upper else lower]
                edges[count, 0], edges[count, 1] = min(a, b), max(a, b)
                edges[count, 2], edges[count, 3] = 1 if a < b else -1, f
                count += 1
    highest = 0
    for k in index:
        highest = max(highest, k)
    key = 1.0 * edges[:, 0] * (highest + 1) + edges[:, 1]
    return edges[sort_order(key)]


@compiled
def check_edges(edges, faces, result, count):
    """Find codes 302, 303, 307 and 305.

    The first three want every edge twice, in opposite directions; 305 wants one component.
    """
    parent = np.arange(faces)
    start, clean = 0, True
    while start < len(edges):
        stop, balance = start, 0
        while (
            stop < len(edges)
            and edges[stop, 0] == edges[start, 0]
            and edges[stop, 1] == edges[start, 1]
        ):
            balance += edges[stop, 2]
            join(parent, edges[start, 3], edges[stop, 3])
            stop += 1
        uses = stop - start
        if uses != 2 or balance != 0:
            clean = False
            code = 302 if uses == 1 else 303 if uses > 2 else 307
            result[count, 0], result[count, 1] = code, edges[start, 3]
            result[count, 2] = edges[start + 1, 3] if uses > 1 else -1
            count += 1
        start = stop
    for f in range(faces):
        if find_root(parent, f) != 0:
            result[count, 0], result[count, 1], result[count, 2] = 305, f, -1
            return count + 1, False
    return count, clean


@compiled
def check_umbrellas(index, ring_start, face_start, result, count):
    """Find code 303 where faces around a vertex form more than one fan.

    Only for shells whose edges are all paired.

    A vertex in which two rings of one face touch is not asked: which corners adjoin there is not
    told by the rings.
    """
    corners = len(index)
    parent = np.arange(corners)
    face_of = np.empty(corners, np.int64)
    previous, following = np.empty(corners, np.int64), np.empty(corners, np.int64)
    for f in range(len(face_start) - 1):
        for r in range(face_start[f], face_start[f + 1]):
            lower, upper = ring_start[r], ring_start[r + 1]
            for k in range(lower, upper):
                face_of[k] = f
                previous[k], following[k] = (
                    k - 1 if k > lower else upper - 1,
                    k + 1 if k + 1 < upper else lower,
                )
    by_vertex = sort_order(1.0 * index)
    start = 0
    while start < corners:
        stop = start
        while stop < corners and index[by_vertex[stop]] == index[by_vertex[start]]:
            stop += 1
        for i in range(start, stop):
            k = by_vertex[i]
            for j in range(start, stop):
                m = by_vertex[j]
                if index[following[k]] == index[previous[m]]:
                    join(parent, k, m)
        root = find_root(parent, by_vertex[start])
        touching = False
        for i in range(start + 1, stop):  # corners at a vertex come in the order of their faces
            touching = touching or face_of[by_vertex[i]] == face_of[by_vertex[i - 1]]
        for i in range(start + 1, stop):
            if not touching and find_root(parent, by_vertex[i]) != root:
                result[count, 0], result[count, 1], result[count, 2] = (
                    303,
                    face_of[by_vertex[i]],
                    face_of[by_vertex[start]],
                )
                count += 1
                break
        start = stop
    return count


@compiled
def holds_vertex(index, lower, upper, v):
    for k in range(lower, upper):
        if index[k] == v:
            return True
    return False


@compiled
def holds_edge(index, lower, upper, a, b):
    """Return whether the ring index[lower:upper] has the edge ab or ba."""
    for k in range(lower, upper):
        following = index[k + 1 if k + 1 < upper else lower]
        if (index[k] == a and following == b) or (index[k] == b and following == a):
            return True
    return False


@compiled
def measure_above(vertices, v, normal, offset):
    """Return the height of vertex v over a plane."""
    return (
        vertices[v, 0] * normal[0]
        + vertices[v, 1] * normal[1]
        + vertices[v, 2] * normal[2]
        - offset
    )


@compiled
def is_outside(vertices, a, b, lower, upper, slack):
    """Return whether the edge from a to b lies beyond one side of a box."""
    for axis in range(3):
        p, q = vertices[a, axis], vertices[b, axis]
        if min(p, q) > upper[axis] + slack or max(p, q) < lower[axis] - slack:
            return True
    return False


@compiled
def edges_pierce(
    vertices, index, ring_start, face_start, f, g, normal, offset, lower, upper, flat, slack
):
    """Return whether an edge of face g pierces face f.

    Shared vertices do not count.

    `normal` and `offset` are those of f, `lower` and `upper` its box; `slack` is how far off its
    plane counts.
    """
    first, last = face_start[f], face_start[f + 1]
    begin, end = ring_start[first], ring_start[last]
    for r in range(face_start[g], face_start[g + 1]):
        for k in range(ring_start[r], ring_start[r + 1]):
            a, b = index[k], index[k + 1 if k + 1 < ring_start[r + 1] else ring_start[r]]
            if is_outside(vertices, a, b, lower, upper, slack):
                continue
            da = measure_above(vertices, a, normal, offset)
            db = measure_above(vertices, b, normal, offset)
            if min(da, db) > slack or max(da, db) < -slack:
                continue
            lands = abs(da) <= slack and not holds_vertex(index, begin, end, a)
            if (
                lands
                and depth_in_face(flat[a], flat, index, ring_start, first, last) > -ON_SEGMENT_M
            ):
                return True
            if abs(da) <= slack and abs(db) <= slack:
                if lies_across(flat, index, ring_start, first, last, a, b, slack):
                    return True
            elif (da > slack and db < -slack) or (da < -slack and db > slack):
                t = da / (da - db)
                if (
                    depth_in_face(
                        flat[a] + t * (flat[b] - flat[a]), flat, index, ring_start, first, last
                    )
                    > slack
                ):
                    return True
    return False


@compiled
def lies_across(flat, index, ring_start, first, last, a, b, slack):
    """Return whether edge ab, in the plane of a face, runs through its inside."""
    p, q = flat[a], flat[b]
    for r in range(first, last):
        if holds_edge(index, ring_start[r], ring_start[r + 1], a, b):
            return False
    for r in range(first, last):
        lower, upper = ring_start[r], ring_start[r + 1]
        for k in range(lower, upper):
            c, d = index[k], index[k + 1 if k + 1 < upper else lower]
            if c in (a, b) or d in (a, b):
                continue
            if crosses(p, q, flat[c], flat[d]):
                return True
    return depth_in_face(0.5 * (p + q), flat, index, ring_start, first, last) > slack


@compiled
def face_boxes(vertices, index, ring_start, face_start):
    """Return the lowest and highest corner (f, 3) of each face's box."""
    faces = len(face_start) - 1
    low_box, high_box = np.full((faces, 3), np.inf), np.full((faces, 3), -np.inf)
    for f in range(faces):
        for k in range(ring_start[face_start[f]], ring_start[face_start[f + 1]]):
            for axis in range(3):
                place = vertices[index[k], axis]
                low_box[f, axis] = min(low_box[f, axis], place)
                high_box[f, axis] = max(high_box[f, axis], place)
    return low_box, high_box


@compiled
def sweep_axis(low_box, high_box):
    """Return the axis along which faces are shortest against the whole.

    Sweeping along it meets the fewest pairs.
    """
    best, minimum = 0, np.inf
    for axis in range(3):
        lowest, highest, total = np.inf, -np.inf, 0.0
        for f in range(len(low_box)):
            lowest, highest = min(lowest, low_box[f, axis]), max(highest, high_box[f, axis])
            total += high_box[f, axis] - low_box[f, axis]
        overlaps = total / (highest - lowest) if highest > lowest else np.inf
        if overlaps < minimum:
            best, minimum = axis, overlaps
    return best


@compiled
def check_intersections(
    vertices, index, ring_start, face_start, normals, offsets, flatness, result, count
):
    """Find code 306: faces that meet elsewhere than at shared edges or vertices.

    Only those whose boxes meet are compared.
    """
    low_box, high_box = face_boxes(vertices, index, ring_start, face_start)
    slack = flatness + 2e-4
    widest, axis = measure_range(slack)[1], sweep_axis(low_box, high_box)
    order = sort_order(low_box[:, axis].copy())
    axis_of = largest_axes(normals)
    flat = np.empty((len(vertices), 2))
    for i in range(len(order)):
        for j in range(i + 1, len(order)):
            f, g = order[i], order[j]
            if low_box[g, axis] > high_box[f, axis] + widest:
                break
            for item, other in ((f, g), (g, f)):
                lower, upper = low_box[item], high_box[item]
                if count == len(result) or are_apart(
                    lower, upper, low_box[other], high_box[other], slack[item]
                ):
                    continue
                for face in (item, other):
                    begin, end = ring_start[face_start[face]], ring_start[face_start[face + 1]]
                    project(flat, vertices, index, begin, end, axis_of[item])
                if edges_pierce(
                    vertices,
                    index,
                    ring_start,
                    face_start,
                    item,
                    other,
                    normals[item],
                    offsets[item],
                    lower,
                    upper,
                    flat,
                    slack[item],
                ):
                    result[count, 0], result[count, 1], result[count, 2] = 306, item, other
                    count += 1
    return count


@compiled
def are_apart(lower, upper, low2, high2, slack):
    """Return whether two boxes are further apart than `slack` along an axis."""
    for axis in range(3):
        if low2[axis] > upper[axis] + slack or lower[axis] > high2[axis] + slack:
            return True
    return False


@compiled
def check_shell(vertices, index, ring_start, face_start, normals, offsets, flatness):
    """Return the findings (k, 3) of a shell of sound faces.

    Their planes are those that `check_faces` returned.
    """
    faces = len(face_start) - 1
    result = np.empty((6 * len(index) + 6 * len(ring_start) + 64, 3), np.int64)
    if faces < 4:
        result[0, 0], result[0, 1], result[0, 2] = 301, -1, -1
        return result[:1]
    edges = directed_edges(index, ring_start, face_start)
    count, clean = check_edges(edges, faces, result, 0)
    if clean:
        count = check_umbrellas(index, ring_start, face_start, result, count)
    count = check_intersections(
        vertices, index, ring_start, face_start, normals, offsets, flatness, result, count
    )
    if count == 0 and enclosed_volume(vertices, index, ring_start, face_start) <= 0:
        result[0, 0], result[0, 1], result[0, 2] = 405, -1, -1
        return result[:1]
    return result[:count]
