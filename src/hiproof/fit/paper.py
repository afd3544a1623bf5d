"""The objective of Li, Zhang and Shan (2020), as published.

It is the reference for the likelihood.

J = J1 + beta J2, with J1 the mean distance of the points to the nearest plane of the primitive, and
J2 = 1 - IoU of its plan outline with the alpha shape of the points. The planes come from an SVD of
each surface's centred vertices, the start from the minimum bounding box, the minimum from SciPy's
L-BFGS-B with its numeric gradient. Nothing is added to make it faster or more robust. Where the
paper is silent: the box is tried with either side as the width (the lower J at the start is taken),
and of several roof types that with the smallest J is chosen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely

from ..errors import FitError
from ..frames import LocalFrame
from ..geometry.alpha_shape import SPACINGS, alpha_shape, default_radius
from ..model import Fit
from ..primitives import Primitive, get
from ..primitives.contract import place_vertices
from ..settings import Settings

BETA = 0.1  # weight of the outline in the objective, the paper's own
ALPHA_SPACINGS = 4.0
"""Radius of the alpha shape in point spacings, which the paper does not give: of 1.5, 2.5 and 4
this comes closest to its figures.
"""
SMALLEST_M = 0.1  # m; no length of a roof is smaller
PAPER_TYPES = ("flat", "monopitch", "gable", "hip", "half_hip", "pyramid", "mansard", "shed")
"""Those that the paper names, tried where none are asked for."""
IMPROPER = 1.0
"""Added to J where the vertices form no roof (a ridge longer than the eaves): larger than any
difference of J2.
"""


def fit_paper(
    points: np.ndarray,
    types: Sequence[str] | None = None,
    outline: shapely.Polygon | None = None,
    settings: Settings | None = None,
) -> Fit:
    """Fit one of `types` to `points` (n, 3), in metres, in any frame.

    The default is those of the settings, else the paper's.

    `outline` (same frame) takes the place of the alpha shape. In the outcome `value` is J; `bics`
    hold J by type, which plays BIC's role here, and there are no standard deviations. Raises
    FitError when the points span no area.
    """
    points = np.asarray(points, float)
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < 4:
        raise FitError(f"expected at least 4 finite points to fit a roof to, got {len(points)}")
    frame = LocalFrame.around(points)
    xyz = frame.to_local(points)
    boundary = (
        observed_outline(xyz[:, :2])
        if outline is None
        else shapely.transform(outline, frame.to_local)
    )
    names = types or (settings or Settings()).fit.types or PAPER_TYPES
    candidates = [best_variant(get(name), xyz, boundary) for name in names]
    values = {fitted.shape.name: fitted.value for fitted in candidates}
    return min(candidates, key=lambda fitted: fitted.value).outcome(xyz, frame, values)


def observed_outline(xy: np.ndarray) -> shapely.Polygon:
    """Return the paper's B, the alpha shape of `xy` (n, 2).

    Raises FitError for points that span no area.
    """
    return alpha_shape(xy, default_radius(xy) * ALPHA_SPACINGS / SPACINGS)


class PaperFit:
    """One primitive (with its tooth count) during its fit.

    theta = (theta_p..., kappa, T_L).
    """

    def __init__(self, shape: Primitive, xyz: np.ndarray, boundary: shapely.Polygon) -> None:
        self.shape, self.xyz, self.boundary = shape, xyz, boundary
        self.names = tuple(name for name in shape.parameters if name != "teeth")
        self.fixed = {"teeth": float(shape.strips)} if "teeth" in shape.parameters else {}
        self.evaluations = 0
        self.theta = min(self.box_starts(), key=self.objective)
        self.value = math.inf

    def box_starts(self) -> list[np.ndarray]:
        """Return theta of the minimum bounding box with its sides in every role.

        There are two, or four where a half turn matters.
        """
        corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(self.boundary))[:4]
        lower, upper = np.percentile(self.xyz[:, 2], (0, 100))
        side = corners[1] - corners[0]
        lengths = np.linalg.norm(side), np.linalg.norm(corners[3] - corners[0])
        starts = []
        for quarter in range(2 if self.shape.half_turn_symmetric else 4):
            length, width = float(lengths[quarter % 2]), float(lengths[1 - quarter % 2])
            theta_p = self.shape.typical(width, length, max(upper - lower, SMALLEST_M))
            kappa = math.atan2(side[1], side[0]) + quarter * math.pi / 2
            starts.append(
                np.array([*(theta_p[n] for n in self.names), kappa, *corners.mean(axis=0), lower])
            )
        return starts

    def bounds(self) -> list[tuple[float | None, float | None]]:
        sizes: list[tuple[float | None, float | None]] = [
            (None if name in self.shape.signed else SMALLEST_M, None) for name in self.names
        ]
        return sizes + [(None, None)] * 4

    def theta_p(self, theta: np.ndarray) -> dict[str, float]:
        return dict(zip(self.names, map(float, theta), strict=False)) | self.fixed

    def vertices(self, theta: np.ndarray) -> np.ndarray:
        """Return the vertices by equation 9 without T_G: R_kappa S + T_L."""
        return place_vertices(self.shape.vertices(self.theta_p(theta)), theta[-4], theta[-3:])

    def objective(self, theta: np.ndarray) -> float:
        """Return J at `theta`."""
        self.evaluations += 1
        vertices = self.vertices(theta)
        j1 = np.abs(plane_distances(self.xyz, vertices, self.shape.faces)).min(axis=0).mean()
        improper = 0.0 if self.is_roof(theta) else IMPROPER
        return float(j1 + BETA * outline_misfit(vertices, self.boundary) + improper)

    def is_roof(self, theta: np.ndarray) -> bool:
        """Return whether derived slopes and fractions lie within the bounds.

        They follow from theta_p; bounds are the primitive's.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            try:
                shape = self.shape.to_theta(self.theta_p(theta))[6:]
            except ZeroDivisionError:
                return False
        return all(
            lower <= q <= upper for q, (lower, upper) in zip(shape, self.shape.bounds, strict=False)
        )

    def minimise(self) -> PaperFit:
        """Minimise from the start to the nearest minimum."""
        from scipy.optimize import minimize

        result = minimize(self.objective, self.theta, method="L-BFGS-B", bounds=self.bounds())
        self.theta, self.value = result.x, float(result.fun)
        return self

    def outcome(self, xyz: np.ndarray, frame: LocalFrame, values: dict[str, float]) -> Fit:
        """Return the fit with canonical parameters, in the frame of the points."""
        if not self.is_roof(self.theta):
            raise FitError(
                f"expected points of the roof type {self.shape.name}, got no such roof from them; "
                "try other types"
            )
        theta = self.shape.canonical_theta(
            self.shape.to_theta(self.theta_p(self.theta), self.theta[-4], self.theta[-3:])
        )
        theta_p, kappa, translation = self.shape.from_theta(theta)
        vertices = place_vertices(self.shape.vertices(theta_p), kappa, translation)
        distances = np.abs(plane_distances(xyz, vertices, self.shape.faces)).min(axis=0)
        return Fit(
            type=self.shape.name,
            parameters=theta_p,
            kappa=kappa,
            translation=translation,
            global_translation=frame.origin,
            sigma={},
            objective="paper",
            value=self.value,
            bic=self.value,
            bics=values,
            points_used=len(xyz),
            noise_m=float(np.sqrt(np.mean(distances**2))),
            outlier_share=0.0,
            evaluations=self.evaluations,
            part=self.shape.part(theta),
            vertices=frame.to_world(vertices),
            faces=self.shape.faces,
        )


def best_variant(shape: Primitive, xyz: np.ndarray, boundary: shapely.Polygon) -> PaperFit:
    """Fit a primitive; of a saw-tooth, with the best tooth count.

    The best has the smallest J.
    """
    fits = [PaperFit(variant, xyz, boundary).minimise() for variant in shape.variants]
    return min(fits, key=lambda fitted: fitted.value)


def plane_distances(
    xyz: np.ndarray, vertices: np.ndarray, faces: Sequence[Sequence[int]]
) -> np.ndarray:
    """Return signed distances (faces, n) of points to each face's plane.

    Planes come from an SVD of the face's centred vertices.
    """
    distances = np.empty((len(faces), len(xyz)))
    for row, face in zip(distances, faces, strict=True):
        corners = vertices[list(face)]
        centre = corners.mean(axis=0)
        normal = np.linalg.svd(corners - centre)[2][2]
        np.matmul(xyz, normal, out=row)
        row -= centre @ normal
    return distances


def outline_misfit(vertices: np.ndarray, boundary: shapely.Polygon) -> float:
    """Return J2 = 1 - IoU of `boundary` and the vertices' plan outline.

    All primitives are convex in plan.
    """
    outline = shapely.convex_hull(shapely.multipoints(vertices[:, :2]))
    common = shapely.intersection(outline, boundary).area
    return 1.0 - common / (outline.area + boundary.area - common)
