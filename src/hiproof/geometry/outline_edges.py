"""The edges of an outline, counted along its rings, and strips beside them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

PARALLEL = 1e-3  # sine of the angle below which two lines have no corner
FARTHEST_MITRE = (
    3.0  # distance of a mitred corner by the wider strip's width; a farther one is a spike
)

SHORTEST_SIDE_M = 0.05  # of a side that is worth a word
COMPASS_POINTS = (
    "east",
    "north-east",
    "north",
    "north-west",
    "west",
    "south-west",
    "south",
    "south-east",
)


class OutlineEdges(NamedTuple):
    """The edges (n,) of a polygon, the outer ring first, in the order of its rings.

    Each has its `starts` and `ends` (n, 2), the `normals` (n, 2) that point out of the polygon, and
    the numbers (n,) of the edge before it and after it on its ring.
    """

    starts: np.ndarray
    ends: np.ndarray
    normals: np.ndarray
    previous: np.ndarray
    following: np.ndarray

    @property
    def lengths(self) -> np.ndarray:
        return np.hypot(*(self.ends - self.starts).T)


def list_outline_edges(outline: shapely.Polygon) -> OutlineEdges:
    """List the edges of a polygon.

    >>> edges = list_outline_edges(shapely.Polygon([(0, 0), (4, 0), (4, 3), (0, 3)]))
    >>> edges.normals[0].tolist(), edges.lengths.tolist()
    ([0.0, -1.0], [4.0, 3.0, 4.0, 3.0])
    """
    starts, ends, normals, previous, following = [], [], [], [], []
    count = 0
    for ring in (outline.exterior, *outline.interiors):
        xy = shapely.get_coordinates(ring)
        along = np.diff(xy, axis=0)
        is_left = shapely.is_ccw(ring) == (count == 0)  # of the ring lies the polygon
        across = np.column_stack([along[:, 1], -along[:, 0]]) * (1.0 if is_left else -1.0)
        numbers = count + np.arange(len(along))
        starts.append(xy[:-1])
        ends.append(xy[1:])
        normals.append(across / np.maximum(np.hypot(*along.T), 1e-12)[:, None] + 0.0)
        previous.append(np.roll(numbers, 1))
        following.append(np.roll(numbers, -1))
        count += len(along)
    return OutlineEdges(
        *(np.concatenate(values) for values in (starts, ends, normals, previous, following))
    )


def describe_sides(edges: OutlineEdges, lengths: np.ndarray) -> str:
    """Describe stretches of edges, `lengths` (n,) in metres, by where they face.

    The longest come first, those of a few centimetres are left out.

    >>> edges = list_outline_edges(shapely.Polygon([(0, 0), (4, 0), (4, 3), (0, 3)]))
    >>> describe_sides(edges, np.array([4.0, 0.0, 0.0, 3.0]))
    '4.0 m to the south and 3.0 m to the west'
    """
    octant = np.rint(np.arctan2(edges.normals[:, 1], edges.normals[:, 0]) / (np.pi / 4))
    metres = np.bincount(octant.astype(int) % len(COMPASS_POINTS), lengths, len(COMPASS_POINTS))
    order = np.argsort(-metres, kind="stable")
    texts = [
        f"{metres[k]:.1f} m to the {COMPASS_POINTS[k]}"
        for k in order.tolist()
        if metres[k] >= SHORTEST_SIDE_M
    ]
    return " and ".join([", ".join(texts[:-1]), texts[-1]] if len(texts) > 1 else texts)


def make_strips(edges: OutlineEdges, widths: np.ndarray, side: float = 1.0) -> np.ndarray:
    """Return the strips beside edges, as rings.

    A ring (n, 4, 2) is the edge's start, its end, and both moved outwards. Strips have `widths`
    (n,), and lie outside the polygon, with a `side` of -1 inside. Where a gap opens at a corner
    between two strips, both reach to their mitre.
    """
    normals = side * edges.normals
    along = edges.ends - edges.starts
    reach = normals * widths[:, None]
    outer_starts = edges.starts + reach
    outer_ends = edges.ends + reach
    for number in np.flatnonzero(widths > 0.0):
        for other, sign, outer in (
            (edges.previous[number], 1.0, outer_starts),
            (edges.following[number], -1.0, outer_ends),
        ):
            if sign * (normals[other] @ along[number]) < 0.0:  # a gap opens
                both = np.array([normals[number], normals[other]])
                mitre = find_mitre(both, widths[[number, other]])
                if mitre is not None:
                    corner = edges.starts if sign > 0.0 else edges.ends
                    outer[number] = corner[number] + mitre
    return np.stack([edges.starts, edges.ends, outer_ends, outer_starts], axis=1)


def find_mitre(normals: np.ndarray, widths: np.ndarray) -> np.ndarray | None:
    """Return where lines at `widths` (2,) along `normals` (2, 2) cross, None if far away."""
    if abs(normals[0, 0] * normals[1, 1] - normals[0, 1] * normals[1, 0]) < PARALLEL:
        return None
    mitre = np.linalg.solve(normals, widths)
    return mitre if np.hypot(*mitre) <= FARTHEST_MITRE * widths.max() else None
