"""The 2D alpha shape: an outline of points that follows their concave bays.

A bay is kept where it is wider than the radius.

Edelsbrunner, Kirkpatrick and Seidel (1983): the triangles of the Delaunay triangulation whose
circumradius is below alpha. Its boundary lies inside the true outline by about half the spacing of
the points.
"""

from __future__ import annotations

import numpy as np
import shapely

from ..errors import FitError

# Default radius in point spacings: below 2 the shapes of sparse uniform points fall apart, above 3
# bays fill up.
SPACINGS = 2.5


def default_radius(xy: np.ndarray) -> float:
    """Return 2.5 mean spacings (m) of points `xy` (n, 2) if spread over their convex hull."""
    # one line through all: many points would be as many geometries
    hull_area = shapely.convex_hull(shapely.linestrings(xy)).area if len(xy) > 2 else 0.0
    return SPACINGS * float(np.sqrt(hull_area / max(len(xy), 1)))


def alpha_shape(
    xy: np.ndarray, radius: float | None = None, holes: bool = False
) -> shapely.Polygon:
    """Return the outline of points `xy` (n, 2) by the alpha shape.

    The outline is the largest component of the alpha shape of `radius` metres, with its holes
    filled or kept. Raises FitError for points that span no area.

    >>> grid = np.stack(np.meshgrid(np.arange(5.0), np.arange(3.0)), axis=-1).reshape(-1, 2)
    >>> alpha_shape(grid, 1.0).area
    8.0
    """
    from scipy.spatial import Delaunay, QhullError

    xy = np.asarray(xy, float).reshape(-1, 2)
    origin = np.floor(xy.mean(axis=0)) if len(xy) else np.zeros(2)
    xy = xy - origin  # far from the origin rounding turns triangles over
    try:
        mesh = Delaunay(xy)
    except (QhullError, ValueError) as error:
        raise FitError(
            f"expected points that span an area, got {len(xy)} in one place or on one line"
        ) from error
    radius = default_radius(xy) if radius is None else radius
    mask = circumradii(xy[mesh.simplices]) < radius
    if not mask.any():
        raise FitError(
            f"expected a radius that joins neighbouring points, got {radius:.3g} m; try a larger "
            "one"
        )
    outside = np.where(mesh.neighbors < 0, True, ~mask[mesh.neighbors])
    triangle, opposite = np.nonzero(mask[:, None] & outside)
    sides = xy[
        mesh.simplices[
            triangle[:, None], np.stack([(opposite + 1) % 3, (opposite + 2) % 3], axis=1)
        ]
    ]
    shape = shapely.build_area(shapely.multilinestrings(sides))
    largest = max(shapely.get_parts(shape), key=lambda polygon: polygon.area)
    return shapely.transform(
        largest if holes else shapely.Polygon(largest.exterior), lambda corners: corners + origin
    )


def circumradii(triangles: np.ndarray) -> np.ndarray:
    """Return the circumradii (n,) of `triangles` (n, 3, 2)."""
    a, b, c = (
        np.hypot(*(triangles[:, i] - triangles[:, j]).T) for i, j in ((1, 2), (0, 2), (0, 1))
    )
    half = (a + b + c) / 2
    area = np.sqrt(np.maximum(half * (half - a) * (half - b) * (half - c), 1e-18))
    return a * b * c / (4 * area)
