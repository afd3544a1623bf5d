"""The plane-based baseline: RANSAC plane after plane (pyransac3d).

The paper's Figure 8 compares with it.

The library draws from Python's global generator, which is seeded here so that a run can be
repeated.
"""

from __future__ import annotations

import random
from dataclasses import dataclass

import numpy as np
import shapely

from hiproof.errors import HiproofError

THRESHOLD_M = 0.2
"""Inlier distance; the usual one for airborne clouds, a little under twice the simulated noise."""

MIN_POINTS = 10
MIN_SHARE = 0.04
ITERATIONS = 300
MOST_PLANES = 12
STEEPEST = 0.2
"""Least vertical component of a roof's unit normal: steeper planes are walls."""


@dataclass(frozen=True)
class DetectedPlane:
    """A plane normal . x + offset = 0 with its inliers.

    The unit `normal` points up.

    `inliers` index the points given.
    """

    normal: np.ndarray
    offset: float
    inliers: np.ndarray

    def polygon(self, points: np.ndarray) -> np.ndarray:
        """Return the convex hull (m, 3) of the inliers, laid into the plane."""
        hull = shapely.convex_hull(shapely.multipoints(points[self.inliers, :2]))
        xy = shapely.get_coordinates(hull)
        xy = xy[:-1] if len(xy) > 3 else np.repeat(xy[:1], 3, axis=0)
        z = -(xy @ self.normal[:2] + self.offset) / self.normal[2]
        return np.column_stack([xy, z])


def is_available() -> bool:
    import importlib.util

    return importlib.util.find_spec("pyransac3d") is not None


def detect_planes(
    points: np.ndarray, threshold_m: float = THRESHOLD_M, seed: int = 0
) -> list[DetectedPlane]:
    """Detect planes of `points` (n, 3) until too few points are left.

    The one with the most inliers comes first.

    Each plane is refitted to its inliers by least squares. Raises HiproofError without pyransac3d.
    """
    if not is_available():
        raise HiproofError(
            "expected the package pyransac3d for the RANSAC baseline; pip install "
            "'hiproof[experiments]'"
        )
    import pyransac3d

    random.seed(seed)
    min_points = max(MIN_POINTS, int(MIN_SHARE * len(points)))
    remaining, planes = np.arange(len(points)), []
    for _ in range(MOST_PLANES):
        if len(remaining) < max(min_points, 3):
            break
        _, selection = pyransac3d.Plane().fit(
            points[remaining], thresh=threshold_m, maxIteration=ITERATIONS
        )
        inliers = remaining[selection]
        if len(inliers) < min_points:
            break
        normal, offset = fit_least_squares_plane(points[inliers])
        remaining = np.setdiff1d(remaining, inliers)
        if normal[2] > STEEPEST:
            planes.append(DetectedPlane(normal, offset, inliers))
    return planes


def fit_least_squares_plane(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Return unit normal and offset of the plane nearest to `points` (n, 3).

    The normal points up.
    """
    centre = points.mean(axis=0)
    normal = np.linalg.eigh((points - centre).T @ (points - centre))[1][:, 0]
    normal = normal if normal[2] >= 0 else -normal
    return normal, -float(normal @ centre)


def match_faces(
    planes: list[DetectedPlane],
    faces: list[np.ndarray],
    angle_deg: float = 10.0,
    distance_m: float = 0.3,
) -> tuple[int, int]:
    """Return how many true faces are found, and how many planes are wrong.

    True `faces` (rings (m, 3)) have a plane of their direction and height; wrong ones are planes of
    no face.

    A plane that doubles a face already found is wrong too.
    """
    matched: set[int] = set()
    wrong = 0
    for plane in planes:
        best = None
        for i, face in enumerate(faces):
            normal, _ = fit_least_squares_plane(face)
            angle = np.degrees(np.arccos(np.clip(normal @ plane.normal, -1, 1)))
            distance = abs(face.mean(axis=0) @ plane.normal + plane.offset)
            if angle < angle_deg and distance < distance_m and (best is None or angle < best[0]):
                best = (angle, i)
        if best is None or best[1] in matched:
            wrong += 1
        else:
            matched.add(best[1])
    return len(matched), wrong
