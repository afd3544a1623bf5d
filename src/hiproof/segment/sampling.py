"""Arrangement of a cloud.

These parts of PointNet++ choose, describe and group points; they carry no weights. Loops over all
points are compiled.
"""

from __future__ import annotations

import math

import numpy as np

from ..compiled import compiled

POINT_FEATURES = (
    "x",
    "y",
    "z",
    "normal_x",
    "normal_y",
    "normal_z",
    "roughness",
    "convexity",
    "offset_x",
    "offset_y",
    "spacing",
)
# m that positions are divided by: an ordinary house lies within 1
POSITION_SCALE = (10.0, 10.0, 5.0)
SURFACE_NEIGHBOURS = 10  # points that tell a point's normal and roughness
BALL_FACTOR = 2.0  # radius of a neighbourhood over the spacing of its level's points
INTERPOLATED = 3  # points that a feature is carried back from, as in PointNet++
# rad; slopes further off the peak say nothing of the building's axes
HARMONIC_WIDTH = math.radians(12.0)


def arrange_cloud(xyz, count, level1, level2, level3, group_size):
    """Return all that the network needs of a cloud `xyz` (n, 3).

    It is in metres about an origin near it, n >= 1.

    `count` points are chosen, of which each level keeps a prefix; where n is smaller, they repeat
    from the start. Returns the `order` of the choice (min(count, n),), indices into `xyz`;
    `features` (count, 11) float32, named by FEATURES; `groups` of the three levels, (level,
    group_size) indices into the level above; their `radii` (3,) float32, metres; and for the way
    back (level1, 3) indices into level 3 and (count, 3) into level 1, with their weights.
    """
    x, y, z = (np.ascontiguousarray(axis) for axis in xyz.T)
    order, cover, nearest, reach = farthest_points(x, y, z, count)
    result = len(order)
    surface = local_surfaces(x, y, z, order, nearest, reach)
    middle, spacing = np.median(z), math.log(max(cover[result // 2], 1e-3))
    x, y, z = x[order], y[order], z[order]
    features = describe_points(x, y, z - middle, surface, spacing, count)
    balls = BALL_FACTOR * np.maximum(cover, 1e-3)
    radius1, radius2, radius3 = (
        balls[min(level1, result) - 1],
        balls[min(level2, result) - 1],
        balls[min(level3, result) - 1],
    )
    groups = (
        group_points(x, y, z, level1, min(count, result), group_size, radius1)[0],
        group_points(x, y, z, level2, min(level1, result), group_size, radius2)[0],
        group_points(x, y, z, level3, min(level2, result), group_size, radius3)[0],
    )
    up1, distance1 = group_points(x, y, z, level1, min(level3, result), INTERPOLATED, np.inf)
    up2, distance2 = group_points(x, y, z, count, min(level1, result), INTERPOLATED, np.inf)
    weights = compute_inverse_shares(distance1), compute_inverse_shares(distance2)
    radii = np.array([radius1, radius2, radius3], np.float32)
    return order, features, groups, radii, (up1, up2), weights


def describe_points(x, y, z, surface, spacing, count):
    """Return features (count, 11) of points in the building's own axes.

    There are points (s,) and their `surface` (s, 7), repeated to `count`.
    """
    cosine, sine = find_canonical_axes(x, y, surface)
    turn = np.array([[cosine, -sine], [sine, cosine]])
    features = np.column_stack(
        [
            np.column_stack([np.column_stack([x, y]) @ turn, z]) / POSITION_SCALE,
            surface[:, :2] @ turn,
            surface[:, 2],
            np.minimum(surface[:, 3] / 0.2, 5.0),
            np.clip(surface[:, 4] / 0.2, -5.0, 5.0),
            surface[:, 5:] @ turn,
            np.full(len(x), spacing),
        ]
    )
    return features[np.arange(count) % len(x)].astype(np.float32)


@compiled
def farthest_points(x, y, z, count):
    """Sample n points by the farthest first: a prefix is a coarser sample.

    The first is the farthest from the centroid, so that the order depends neither on the points'
    order nor on the frame. Returns `order` (min(count, n),); `cover`, the largest distance of any
    point to its nearest chosen one after each choice (metres); and, as the distances from each
    choice are known anyway, the indices `nearest` of its SURFACE_NEIGHBOURS nearest points, itself
    among them, with `reach`, the distance of the farthest of these.
    """
    n = len(x)
    count, keep = min(count, n), min(SURFACE_NEIGHBOURS, n)
    order, cover = np.empty(count, np.int64), np.empty(count)
    nearest, reach = np.empty((count, keep), np.int64), np.empty(count)
    distance = (x - x.mean()) ** 2 + (y - y.mean()) ** 2 + (z - z.mean()) ** 2
    current = int(np.argmax(distance))
    uncovered = np.full(n, np.inf)
    bits = uncovered.view(np.int64)  # numbers that are not negative sort like their bits
    shortest = np.empty(keep)
    for k in range(count):
        order[k] = current
        farthest = cover_points(x, y, z, current, distance, uncovered, bits)
        shortest[:] = np.inf
        last = np.inf
        # Clouds often come sorted by place: from the point outwards few others are nearer than the
        # last one kept.
        for start, stop, step in ((current, n, 1), (current - 1, -1, -1)):
            for i in range(start, stop, step):
                if distance[i] < last:
                    insert(shortest, nearest[k], keep - 1, distance[i], i)
                    last = shortest[keep - 1]
        current = 0
        while bits[current] < farthest:
            current += 1
        cover[k], reach[k] = math.sqrt(uncovered[current]), math.sqrt(last)
    return order, cover, nearest, reach


@compiled
def cover_points(x, y, z, current, distance, uncovered, bits):
    """Write squared distances of all points from the `current` one.

    They go into `distance`, and into `uncovered` those from the nearest chosen one, the largest of
    whose `bits` are returned: LLVM compares several integers at a time, but not floats.
    """
    cx, cy, cz = x[current], y[current], z[current]
    for i in range(len(x)):
        distance[i] = (x[i] - cx) ** 2 + (y[i] - cy) ** 2 + (z[i] - cz) ** 2
    for i in range(len(x)):
        uncovered[i] = uncovered[i] if uncovered[i] < distance[i] else distance[i]
    farthest = bits[0]
    for i in range(len(x)):
        farthest = max(farthest, bits[i])
    return farthest


@compiled
def insert(shortest, indices, place, distance, index):
    """Insert `distance` and `index` into their ascending lists.

    Lists have place + 1 entries, and the last is pushed out.
    """
    while place > 0 and shortest[place - 1] > distance:
        shortest[place], indices[place] = shortest[place - 1], indices[place - 1]
        place -= 1
    shortest[place], indices[place] = distance, index


@compiled
def local_surfaces(x, y, z, order, nearest, reach):
    """Describe the surface around each of `order` (s,), as rows of seven.

    It follows from the `nearest` (s, k) points.

    The upward normal of their plane (3), the roughness across it (m), the point's height above
    their mean along it (convexity, m), and the plan vector to their mean over their `reach` (2):
    long at the cloud's border.
    """
    surface = np.empty((len(order), 7))
    for s in range(len(order)):
        i, k = order[s], nearest.shape[1]
        mx, my, mz = 0.0, 0.0, 0.0
        for j in nearest[s]:
            mx, my, mz = mx + x[j] / k, my + y[j] / k, mz + z[j] / k
        xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for j in nearest[s]:
            dx, dy, dz = x[j] - mx, y[j] - my, z[j] - mz
            xx, xy, xz = xx + dx * dx / k, xy + dx * dy / k, xz + dx * dz / k
            yy, yz, zz = yy + dy * dy / k, yz + dy * dz / k, zz + dz * dz / k
        nx, ny, nz, variance = plane_normal(xx, xy, xz, yy, yz, zz)
        surface[s, 0], surface[s, 1], surface[s, 2] = nx, ny, nz
        surface[s, 3] = math.sqrt(max(variance, 0.0))
        surface[s, 4] = (x[i] - mx) * nx + (y[i] - my) * ny + (z[i] - mz) * nz
        surface[s, 5], surface[s, 6] = (
            (mx - x[i]) / max(reach[s], 1e-6),
            (my - y[i]) / max(reach[s], 1e-6),
        )
    return surface


@compiled
def plane_normal(xx, xy, xz, yy, yz, zz):
    """Return the upward unit normal of a covariance, and its eigenvalue.

    They belong to the smallest eigenvalue (Smith 1961).

    Points in one place or on a line have no plane: their normal would be a draw of the rounding, so
    call it vertical.
    """
    mean = (xx + yy + zz) / 3
    perpendicular = xy * xy + xz * xz + yz * yz
    scale = math.sqrt(
        ((xx - mean) ** 2 + (yy - mean) ** 2 + (zz - mean) ** 2 + 2 * perpendicular) / 6
    )
    if scale < 1e-12:
        return 0.0, 0.0, 1.0, mean
    a, b, c = (xx - mean) / scale, (yy - mean) / scale, (zz - mean) / scale
    d, e, f = xy / scale, xz / scale, yz / scale
    half = (a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e)) / 2
    angle = math.acos(min(max(half, -1.0), 1.0)) / 3
    largest = mean + 2 * scale * math.cos(angle)
    smallest = mean + 2 * scale * math.cos(angle + 2 * math.pi / 3)
    if 3 * mean - largest - smallest < 1e-6 * largest + 1e-9:
        return 0.0, 0.0, 1.0, max(smallest, 0.0)
    # The eigenvector is normal to the rows of C - smallest: the longest of their cross products is
    # the surest.
    a, b, c = xx - smallest, yy - smallest, zz - smallest
    best, nx, ny, nz = 0.0, 0.0, 0.0, 1.0
    for ux, uy, uz in (
        (xy * yz - xz * b, xz * xy - a * yz, a * b - xy * xy),
        (xy * c - xz * yz, xz * xz - a * c, a * yz - xy * xz),
        (b * c - yz * yz, yz * xz - xy * c, xy * yz - b * xz),
    ):
        length = math.sqrt(ux * ux + uy * uy + uz * uz)
        if length > best:
            best, nx, ny, nz = length, ux / length, uy / length, uz / length
    if nz < 0:
        nx, ny, nz = -nx, -ny, -nz
    across = xx * nx + xy * ny + xz * nz, xy * nx + yy * ny + yz * nz, xz * nx + yz * ny + zz * nz
    return nx, ny, nz, across[0] * nx + across[1] * ny + across[2] * nz


def find_canonical_axes(x, y, surface):
    """Return cosine and sine of the building's own direction in plan.

    The direction is in the full circle.

    Up to quarter turns it is the four-fold harmonic of the normals' azimuths (slopes and walls both
    point along a roof's axes; rough neighbourhoods, trees and edges, count less), re-weighted
    twice; then its first axis is the one along which the points spread more, and points to the side
    to which the roof falls more.
    """
    weight = (surface[:, 0] ** 2 + surface[:, 1] ** 2) * np.exp(-surface[:, 3] / 0.1)
    azimuth, kappa = np.arctan2(surface[:, 1], surface[:, 0]), 0.0
    for turn in range(3):
        aside = azimuth - kappa
        aside -= math.pi / 2 * np.round(aside / (math.pi / 2))
        nearby = weight * np.exp(-((aside / HARMONIC_WIDTH) ** 2)) if turn else weight
        real, imaginary = nearby @ np.cos(4 * aside), nearby @ np.sin(4 * aside)
        kappa += math.atan2(imaginary, real) / 4
    cosine, sine = math.cos(kappa), math.sin(kappa)
    if np.var(cosine * y - sine * x) > np.var(cosine * x + sine * y):
        cosine, sine = -sine, cosine
    falls = surface[:, :2].sum(axis=0)
    along, across = cosine * falls[0] + sine * falls[1], cosine * falls[1] - sine * falls[0]
    if (along if abs(along) > abs(across) else across) < 0:
        cosine, sine = -cosine, -sine
    return cosine, sine


@compiled
def group_points(x, y, z, centres, sources, count, radius):
    """Group points: the nearest `count` within `radius` of each centre.

    Sources are the first `sources` points. Centres are the first `centres`, which repeat from the
    start where the points end. Returns indices and distances (centres, count).

    Missing neighbours repeat the nearest one, which a maximum over the group does not notice. Every
    ball must hold a source, as it does where the centres are among them.
    """
    indices, distances = np.zeros((centres, count), np.int64), np.empty((centres, count))
    distance, shortest = np.empty(sources), np.empty(count)
    for s in range(centres):
        cx, cy, cz = x[s % len(x)], y[s % len(x)], z[s % len(x)]
        for m in range(sources):
            distance[m] = (x[m] - cx) ** 2 + (y[m] - cy) ** 2 + (z[m] - cz) ** 2
        shortest[:] = np.inf
        last = np.nextafter(radius * radius, np.inf)
        for m in range(sources):
            if distance[m] < last:
                insert(shortest, indices[s], count - 1, distance[m], m)
                last = min(last, shortest[count - 1])
        for k in range(count):
            if shortest[k] == np.inf:
                shortest[k], indices[s, k] = shortest[0], indices[s, 0]
            distances[s, k] = math.sqrt(shortest[k])
    return indices, distances


def compute_inverse_shares(distances):
    """Return inverse-distance weights (s, k) with a sum of 1."""
    weights = 1.0 / (distances + 1e-3)
    return (weights / weights.sum(axis=1, keepdims=True)).astype(np.float32)


def thin_to_grid(xyz, count, chunk=500_000):
    """Return the indices of one point a grid cell.

    The cell is chosen so that about `count` or fewer of `xyz` (n, 3) remain.

    Works in pieces of `chunk` points, so that memory beyond the input is bounded. Clouds of `count`
    points or fewer are kept whole.
    """
    n = len(xyz)
    if n <= count:
        return np.arange(n)
    smallest = xyz.min(axis=0)
    extent = np.maximum(xyz.max(axis=0) - smallest, 1e-6)
    cell = max(np.sqrt(extent[0] * extent[1] / count), extent.max() / 1e6)
    while True:
        selection = thin_to_cells(xyz, smallest, cell, chunk)
        if len(selection) <= count:
            return selection
        cell *= max(1.1, np.sqrt(len(selection) / count))


def thin_to_cells(xyz, lower, cell, chunk):
    """Return indices of the first point in each cube of side `cell`, ascending."""
    visited = np.empty(0, np.int64)
    selection = []
    for start in range(0, len(xyz), chunk):
        steps = np.floor((xyz[start : start + chunk] - lower) / cell).astype(np.int64)
        keys, first = np.unique(
            (steps[:, 0] << 42) + (steps[:, 1] << 21) + steps[:, 2], return_index=True
        )
        new = ~np.isin(keys, visited, assume_unique=True)
        visited = np.union1d(visited, keys[new])
        selection.append(start + first[new])
    return np.sort(np.concatenate(selection))
