"""The smoothness and size of the surface of each point, which tell roofs and walls from leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.components import label_components
from ..geometry.thin import hashes

# m; clouds are thinned to one point in such a cube, so that a drone's cloud costs no more
VOXEL_M = 0.5
NEIGHBOURS = 12  # points that tell how smooth the surface around one is
SMOOTH_M = 0.1  # a plane with larger residuals is no surface, and a point farther off is not on it
SMOOTH_TURN_DEG = 10.0  # neighbours of one surface have planes that differ by less
LARGEST_M2 = 50.0  # surfaces of that size and larger are all alike


@dataclass(frozen=True)
class Surfaces:
    """Points thinned to one a voxel, (v, ...), and their surfaces.

    `voxel` (n,) is the voxel of each point given. `neighbours` (v, k) are the nearest voxels,
    itself first; `roughness_m` (v,) is the residual of the smoothest plane among those through a
    neighbour's neighbours, `normal` (v, 3) that plane's, `is_smooth` (v,) whether the voxel lies on
    it, and `extent_m2` (v,) the size of the surface that it belongs to.
    """

    voxel: np.ndarray
    xyz: np.ndarray
    neighbours: np.ndarray
    roughness_m: np.ndarray
    normal: np.ndarray
    is_smooth: np.ndarray
    own_m2: np.ndarray
    extent_m2: np.ndarray

    def around(self, values: np.ndarray) -> np.ndarray:
        """Return the mean (v,) of each voxel's neighbours' `values` (v,)."""
        return values[self.neighbours].mean(axis=1)


def find_surfaces(xyz: np.ndarray) -> Surfaces:
    """Find the surfaces on which points (n, 3), in world metres, lie.

    The order of the points does not matter.

    >>> x, y = np.meshgrid(np.arange(0, 8, 0.5), np.arange(0, 8, 0.5))
    >>> found = find_surfaces(np.column_stack([x.ravel(), y.ravel(), 0.5 * x.ravel()]))
    >>> bool(found.roughness_m.max() < 1e-6), bool(found.extent_m2.min() > 40)
    (True, True)
    """
    from scipy.spatial import cKDTree

    selection, voxel = thin_to_voxels(xyz)
    middles = xyz[selection] - np.floor(xyz.min(axis=0))
    k = min(NEIGHBOURS, len(middles))
    distance, neighbours = cKDTree(middles).query(middles, k=[*range(1, k + 1)])
    centre, normal, residual = fit_planes(middles[neighbours])
    best = neighbours[np.arange(len(middles)), residual[neighbours].argmin(axis=1)]
    centre, normal, residual = centre[best], normal[best], residual[best]
    plane_distances = np.abs(((middles - centre) * normal).sum(axis=1))
    own_m2 = np.clip(np.pi * distance[:, -1] ** 2 / k, VOXEL_M**2, 4.0)
    smooth = (residual < SMOOTH_M) & (plane_distances < SMOOTH_M)
    surface = connect_voxels(middles, normal, smooth, neighbours)
    extent = np.minimum(np.bincount(surface, own_m2)[surface], LARGEST_M2)
    return Surfaces(voxel, xyz[selection], neighbours, residual, normal, smooth, own_m2, extent)


def thin_to_voxels(xyz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Thin to one point a voxel, of the lowest hash: its index (v,), each point's voxel (n,)."""
    cell = np.floor(xyz / VOXEL_M).astype(np.int64)
    cell -= cell.min(axis=0)
    size = cell.max(axis=0) + 1
    key = (cell[:, 0] * size[1] + cell[:, 1]) * size[2] + cell[:, 2]
    _, voxel = np.unique(key, return_inverse=True)
    order = np.lexsort((hashes(xyz), voxel))
    return order[np.diff(voxel[order], prepend=-1) > 0], voxel


def fit_planes(groups: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fit planes to groups (v, k, 3): centre (v, 3), normal (v, 3) and residual (v,), 1 sigma."""
    centre = groups.mean(axis=1)
    offset = groups - centre[:, None]
    values, vectors = np.linalg.eigh(np.einsum("vki,vkj->vij", offset, offset) / groups.shape[1])
    return centre, vectors[:, :, 0], np.sqrt(np.maximum(values[:, 0], 0.0))


def connect_voxels(
    xyz: np.ndarray, normal: np.ndarray, smooth: np.ndarray, neighbours: np.ndarray
) -> np.ndarray:
    """Number surfaces: smooth neighbouring voxels (v,) that lie in each other's plane."""
    item, other = np.repeat(np.arange(len(xyz)), neighbours.shape[1]), neighbours.ravel()
    mask = smooth[item] & smooth[other]
    item, other = item[mask], other[mask]
    between = xyz[other] - xyz[item]
    same = np.abs((normal[item] * normal[other]).sum(axis=1)) > np.cos(np.radians(SMOOTH_TURN_DEG))
    for end in (item, other):
        same &= np.abs((between * normal[end]).sum(axis=1)) < SMOOTH_M
    return label_components(len(xyz), np.stack([item[same], other[same]]))
