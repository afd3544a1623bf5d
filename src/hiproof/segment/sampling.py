"""The parts of PointNet++ that choose, describe and group points, without any weights."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial import KDTree

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
    order, cover = farthest_points(xyz, count)
    surface = local_surfaces(xyz, order)
    middle = np.array([0.0, 0.0, np.median(xyz[:, 2])])
    xyz, spacing = xyz[order], math.log(max(cover[len(order) // 2], 1e-3))
    features = describe_points(xyz - middle, surface, spacing, count)
    levels = np.minimum([count, level1, level2, level3], len(order))
    radii = BALL_FACTOR * np.maximum(cover[levels[1:] - 1], 1e-3)
    groups = tuple(
        group_points(xyz, level, sources, group_size, radius)[0]
        for level, sources, radius in zip((level1, level2, level3), levels[:-1], radii, strict=True)
    )
    up1, distance1 = group_points(xyz, level1, levels[3], INTERPOLATED, np.inf)
    up2, distance2 = group_points(xyz, count, levels[1], INTERPOLATED, np.inf)
    shares = map(compute_inverse_shares, (distance1, distance2))
    weights = tuple(share.astype(np.float32) for share in shares)
    return order, features, groups, radii.astype(np.float32), (up1, up2), weights


def describe_points(xyz, surface, spacing, count):
    """Return features (count, 11) in own axes of points (s, 3) and `surface` (s, 7), repeated."""
    cosine, sine = find_canonical_axes(xyz[:, 0], xyz[:, 1], surface)
    turn = np.array([[cosine, -sine], [sine, cosine]])
    features = np.column_stack(
        [
            np.column_stack([xyz[:, :2] @ turn, xyz[:, 2]]) / POSITION_SCALE,
            surface[:, :2] @ turn,
            surface[:, 2],
            np.minimum(surface[:, 3] / 0.2, 5.0),
            np.clip(surface[:, 4] / 0.2, -5.0, 5.0),
            surface[:, 5:] @ turn,
            np.full(len(xyz), spacing),
        ]
    )
    return features[np.arange(count) % len(xyz)].astype(np.float32)


def farthest_points(xyz, count):
    """Sample points (n, 3) by the farthest first: a prefix is a coarser sample.

    The first is the farthest from the centroid, so that the order depends neither on the points'
    order nor on the frame. Returns `order` (min(count, n),), and after each choice `cover`, the
    largest distance (m) of any point to its nearest chosen one.
    """
    axes, count = np.ascontiguousarray(xyz.T), min(count, len(xyz))
    order, cover = np.empty(count, np.int64), np.empty(count)
    current = int(np.square(axes - axes.mean(axis=1)[:, None]).sum(axis=0).argmax())
    uncovered = np.full(len(xyz), np.inf)
    for k in range(count):
        order[k] = current
        distance = np.square(axes - axes[:, current : current + 1]).sum(axis=0)
        np.minimum(uncovered, distance, out=uncovered)
        current = int(uncovered.argmax())
        cover[k] = math.sqrt(uncovered[current])
    return order, cover


def local_surfaces(xyz, order, neighbours=SURFACE_NEIGHBOURS):
    """Describe the surface around each of `order` (s,) points of a cloud, as rows of seven.

    It follows from the nearest points: the upward normal of their plane (3), the roughness across
    it (m), the point's height above their mean along it (convexity, m), and the plan vector to
    their mean over their reach (2): long at the cloud's border. Points in one place or on a line
    have no plane: their normal would be a draw of the rounding, so call it vertical.
    """
    places = xyz[order]
    distances, nearest = find_nearest(xyz, places, min(neighbours, len(xyz)))
    around = xyz[nearest]
    means = around.mean(axis=1)
    off = around - means[:, None]
    values, vectors = np.linalg.eigh(off.swapaxes(1, 2) @ off / off.shape[1])
    normals = np.where(vectors[:, 2:, 0] < 0, -vectors[:, :, 0], vectors[:, :, 0])
    normals[values[:, 1] < 1e-6 * values[:, 2] + 1e-9] = (0.0, 0.0, 1.0)
    roughness = np.sqrt(np.maximum(values[:, 0], 0.0))
    convexity = ((places - means) * normals).sum(axis=1)
    towards = (means - places)[:, :2] / np.maximum(distances[:, -1:], 1e-6)
    return np.column_stack([normals, roughness, convexity, towards])


def find_nearest(sources, places, count, radius=np.inf):
    """Return distances (inf beyond the radius) and indices (p, count) of `sources` of (p, 3)."""
    bound = np.nextafter(radius, np.inf)
    return KDTree(sources).query(places, np.arange(count) + 1, distance_upper_bound=bound)


def find_canonical_axes(x, y, surface):
    """Return cosine and sine of the building's own direction in plan.

    The direction is in the full circle. Up to quarter turns it is the four-fold harmonic of the
    normals' azimuths (slopes and walls both point along a roof's axes; rough neighbourhoods, trees
    and edges, count less), re-weighted twice; then its first axis is the one along which the points
    spread more, and points to the side to which the roof falls more.
    """
    weight = (surface[:, 0] ** 2 + surface[:, 1] ** 2) * np.exp(-surface[:, 3] / 0.1)
    kappa, _ = find_harmonic(np.arctan2(surface[:, 1], surface[:, 0]), weight)
    cosine, sine = math.cos(kappa), math.sin(kappa)
    if np.var(cosine * y - sine * x) > np.var(cosine * x + sine * y):
        cosine, sine = -sine, cosine
    falls = surface[:, :2].sum(axis=0)
    along, across = cosine * falls[0] + sine * falls[1], cosine * falls[1] - sine * falls[0]
    if (along if abs(along) > abs(across) else across) < 0:
        cosine, sine = -cosine, -sine
    return cosine, sine


def find_harmonic(azimuth, weight, width=HARMONIC_WIDTH):
    """Return directions' (n,) four-fold harmonic (rad) and their share within `width` of it."""
    kappa, share = 0.0, 0.0
    for turn in range(3):
        aside = azimuth - kappa
        aside -= math.pi / 2 * np.round(aside / (math.pi / 2))
        nearby = weight * np.exp(-((aside / width) ** 2)) if turn else weight
        real, imaginary = nearby @ np.cos(4 * aside), nearby @ np.sin(4 * aside)
        kappa += math.atan2(imaginary, real) / 4
        share = math.hypot(real, imaginary) / (weight.sum() + 1e-9)
    return kappa, share


def group_points(xyz, centres, sources, count, radius):
    """Group points: the nearest `count` within `radius` of each centre.

    Sources are the first `sources` points. Centres are the first `centres`, which repeat from the
    start where the points end. Returns indices and distances (centres, count). Missing neighbours
    repeat the nearest one, which a maximum over the group does not notice. Every ball must hold a
    source, as it does where the centres are among them.
    """
    places = xyz[np.arange(centres) % len(xyz)]
    distances, indices = find_nearest(xyz[:sources], places, count, radius)
    is_found = np.isfinite(distances)
    return tuple(np.where(is_found, found, found[:, :1]) for found in (indices, distances))


def compute_inverse_shares(distances):
    """Return inverse-distance weights (s, k) with a sum of 1."""
    weights = 1.0 / (distances + 1e-3)
    return weights / weights.sum(axis=1, keepdims=True)


def thin_to_grid(xyz, count, chunk=500_000):
    """Return the indices of one point a grid cell.

    The cell is chosen so that about `count` or fewer of `xyz` (n, 3) remain. Works in pieces of
    `chunk` points, so that memory beyond the input is bounded. Clouds of `count` points or fewer
    are kept whole.
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
        keys, first = np.unique(steps @ (1 << 42, 1 << 21, 1), return_index=True)
        new = ~np.isin(keys, visited, assume_unique=True)
        visited = np.union1d(visited, keys[new])
        selection.append(start + first[new])
    return np.sort(np.concatenate(selection))
