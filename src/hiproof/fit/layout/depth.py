"""Tell how deep inside an outline places lie, from a raster."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import shapely

from ...geometry.rings import ring_edges
from .plan import measure_depth

# Depth (m) inside the outline from which on a roof is visible. Nearer, an edge that ends a little
# early reveals what lies below.
VISIBLE_DEPTH_M = 0.1
DEPTH_CELL_M = 0.2  # Size (m) of a cell of the outline's depth.
# Most cells a side of the raster of depth: 500 m. Of longer roofs, what is narrower than a cell is
# taken for hidden.
MOST_DEPTH_CELLS = 2500


class DepthRaster(NamedTuple):
    """Signed depth (a, b) inside an outline, with a node every `pitch` metres from u, v on."""

    depth: np.ndarray
    u: float
    v: float
    pitch: float

    def measure(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the depth (n,) of places: that of the nearest nodes."""
        i = np.round((u - self.u) / self.pitch).astype(int)
        j = np.round((v - self.v) / self.pitch).astype(int)
        rows, columns = self.depth.shape
        return self.depth[np.clip(i, 0, rows - 1), np.clip(j, 0, columns - 1)]

    def list_nodes(self, least_depth: float = 0.0) -> np.ndarray:
        """Return the nodes (2, n) that deep inside the outline."""
        i, j = np.nonzero(self.depth >= least_depth)
        return np.array([self.u + i * self.pitch, self.v + j * self.pitch])

    def cut(self, u0: float, u1: float, v0: float, v1: float) -> DepthRaster:
        """Return the raster in a box. No place is deeper than its distance from the border."""
        p = self.pitch
        i0, j0 = (max(math.floor((x - start) / p), 0) for x, start in ((u0, self.u), (v0, self.v)))
        i1, j1 = math.ceil((u1 - self.u) / p) + 1, math.ceil((v1 - self.v) / p) + 1
        depth = self.depth[i0:i1, j0:j1]
        u, v = (
            start + (first + np.arange(count)) * p
            for start, first, count in zip((self.u, self.v), (i0, j0), depth.shape, strict=True)
        )
        border_u, border_v = np.minimum(u - u0, u1 - u), np.minimum(v - v0, v1 - v)
        depth = np.minimum(np.minimum(depth, border_u[:, None]), border_v)
        return DepthRaster(depth, self.u + i0 * p, self.v + j0 * p, p)


def make_depth_raster(outline: shapely.Polygon) -> DepthRaster:
    """Make the raster of an outline in the plan's axes."""
    u0, v0, u1, v1 = outline.bounds
    pitch = max(DEPTH_CELL_M, max(u1 - u0, v1 - v0) / MOST_DEPTH_CELLS)
    u, v = np.arange(u0, u1 + pitch, pitch), np.arange(v0, v1 + pitch, pitch)
    depth = measure_depth(np.repeat(u, len(v)), np.tile(v, len(u)), *ring_edges(outline))
    return DepthRaster(depth.reshape(len(u), len(v)), u0, v0, pitch)
