"""A building's cloud arranged for the network: canonical frame, local features, farthest-point levels, neighbourhoods.

All of it is free of weights, shared by training and inference, and follows the points under rotation about Z: the
frame's direction is the four-fold harmonic of the local normals' azimuths, known up to quarter turns, over which the
network itself averages.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from .sampling import ball_neighbours, farthest_point_order, thin_to_grid

FEATURES = (
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
TURNED_PAIRS = ((0, 1), (3, 4), (8, 9))
POSITION_SCALE = (10.0, 10.0, 5.0)
NORMAL_NEIGHBOURS = 10
BALL_FACTOR = 2.0
INTERPOLATED = 3


@dataclass(frozen=True)
class Layout:
    """Sizes of the network's input: `points` kept of a cloud, points of each `levels`, `neighbours` in a group."""

    points: int = 256
    levels: tuple[int, int, int] = (128, 64, 16)
    neighbours: int = 12
    thinned: int = 4096


@dataclass(frozen=True)
class Arrangement:
    """One cloud as the network takes it; N points, level sizes S1, S2, S3, K neighbours.

    `chosen` (N,) indices into the cloud, repeated where it has fewer than N points; `features` (N, 11) float32;
    `groups` per level (S, K) indices into the level above; `radii` (3,) metres; `up_indices`, `up_weights` (S1, 3) into
    level 3 and (N, 3) into level 1: inverse-distance interpolation; `sampled` the number of distinct points.
    """

    chosen: np.ndarray
    features: np.ndarray
    groups: tuple[np.ndarray, ...]
    radii: np.ndarray
    up_indices: tuple[np.ndarray, np.ndarray]
    up_weights: tuple[np.ndarray, np.ndarray]
    sampled: int


def arrange(xyz: np.ndarray, layout: Layout) -> Arrangement:
    """Arrange a building's cloud `xyz` (n, 3), metres in any frame, n >= 1 finite points, for the network."""
    thinned = thin_to_grid(xyz, layout.thinned)
    local = xyz[thinned] - xyz[thinned].mean(axis=0)
    surface = local_surface(local)
    kappa = canonical_direction(surface)
    order, cover = farthest_point_order(local, layout.points)
    sampled = len(order)
    chosen = np.resize(order, layout.points)
    position = rotated(local[chosen], -kappa)
    position[:, 2] -= np.median(local[:, 2])
    features = np.empty((layout.points, len(FEATURES)), np.float32)
    features[:, :3] = position / POSITION_SCALE
    features[:, 3:6] = rotated(surface.normals[chosen], -kappa)
    features[:, 6] = np.minimum(surface.roughness[chosen] / 0.2, 5.0)
    features[:, 7] = np.clip(surface.convexity[chosen] / 0.2, -5.0, 5.0)
    features[:, 8:10] = rotated(surface.offset[chosen], -kappa)[:, :2]
    features[:, 10] = np.log(max(cover[sampled // 2], 1e-3))
    groups, radii, ups, weights = neighbourhoods(position, sampled, cover, layout)
    return Arrangement(thinned[chosen], features, groups, radii, ups, weights, sampled)


def neighbourhoods(position, sampled, cover, layout):
    """Ball groups of each level in the one above, and the interpolation back; repeated points join no group."""
    groups, radii = [], []
    sizes = (layout.points, *layout.levels)
    for above, size in pairwise(sizes):
        radius = BALL_FACTOR * max(cover[min(size, sampled) - 1], cover[min(above, sampled) - 1], 1e-3)
        index, _ = ball_neighbours(position[:size], position[: min(above, sampled)], layout.neighbours, radius)
        groups.append(index)
        radii.append(radius)
    ups, weights = [], []
    for target, source in ((sizes[1], sizes[3]), (sizes[0], sizes[1])):
        index, distance = ball_neighbours(position[:target], position[: min(source, sampled)], INTERPOLATED, np.inf)
        weight = 1.0 / (distance + 1e-3)
        ups.append(index)
        weights.append((weight / weight.sum(axis=1, keepdims=True)).astype(np.float32))
    return tuple(groups), np.array(radii, np.float32), tuple(ups), tuple(weights)


@dataclass(frozen=True)
class LocalSurface:
    """What each point's neighbourhood says, all (n, ...): upward `normals`, `roughness` (m) across the surface, the
    point's height above the neighbours' mean along the normal (`convexity`, m), and `offset`, the vector to the
    neighbours' centroid over the neighbourhood's radius (long at the cloud's border)."""

    normals: np.ndarray
    roughness: np.ndarray
    convexity: np.ndarray
    offset: np.ndarray


def local_surface(xyz: np.ndarray, count: int = NORMAL_NEIGHBOURS) -> LocalSurface:
    """Principal components of each point's `count` nearest neighbours in `xyz` (n, 3), the point itself among them."""
    from scipy.spatial import cKDTree

    distance, index = cKDTree(xyz).query(xyz, k=min(count, len(xyz)))
    distance, index = distance.reshape(len(xyz), -1), index.reshape(len(xyz), -1)
    neighbours = xyz[index]
    mean = neighbours.mean(axis=1)
    centred = neighbours - mean[:, None]
    values, vectors = np.linalg.eigh(np.swapaxes(centred, 1, 2) @ centred / index.shape[1])
    normals = vectors[:, :, 0] * np.where(vectors[:, 2, :1] < 0, -1.0, 1.0)
    # Points in one place or on a line have no plane: their normal would be a draw of the solver, so call it vertical.
    normals[values[:, 1] < 1e-6 * values[:, 2] + 1e-9] = (0.0, 0.0, 1.0)
    roughness = np.sqrt(np.maximum(values[:, 0], 0.0))
    convexity = ((xyz - mean) * normals).sum(axis=1)
    return LocalSurface(normals, roughness, convexity, (mean - xyz) / np.maximum(distance[:, -1:], 1e-6))


def canonical_direction(surface: LocalSurface) -> float:
    """Rotation kappa in (-pi/4, pi/4] of the building's axes: four-fold harmonic of the normals' azimuths, reweighted.

    Slopes and walls both point along a roof's axes; rough neighbourhoods (trees, edges) count less.
    """
    weight = (surface.normals[:, :2] ** 2).sum(axis=1) * np.exp(-surface.roughness / 0.1)
    azimuth = np.arctan2(surface.normals[:, 1], surface.normals[:, 0])
    kappa = np.angle((weight * np.exp(4j * azimuth)).sum()) / 4
    for _ in range(2):
        aside = np.angle(np.exp(4j * (azimuth - kappa))) / 4
        near = weight * np.exp(-((aside / np.radians(12.0)) ** 2))
        kappa += np.angle((near * np.exp(4j * aside)).sum()) / 4
    return float(np.angle(np.exp(4j * kappa)) / 4)


def rotated(vectors: np.ndarray, angle: float) -> np.ndarray:
    """`vectors` (n, 3) turned about Z by `angle` (rad, counter-clockwise)."""
    c, s = np.cos(angle), np.sin(angle)
    return vectors @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
