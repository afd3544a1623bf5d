"""The ground under a cloud.

Openings of growing windows take away what stands on the ground, and the gaps are filled.

A simple morphological filter after Pingel, Clarke and McBride (An improved simple morphological
filter for the terrain classification of airborne LIDAR data, ISPRS Journal 77, 2013), with two
changes: a plane through all cells is taken away first, so that the upper border of a steep slope is
no step, and cells without points take no part instead of being filled before. The cloth filter's
packages were weighed and left: their answer for a place depends on the whole cloud.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from .cells import SquareCells

CELL_M = 1.0  # m; a car or a bush covers a few cells, a street is some wide
WINDOWS_M = (1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 11.0, 15.0, 20.0)  # half sides of the openings' windows
SLOPE = 0.15  # a rise above the opened surface of more than this much of the half side is no ground
PIT_M = 2.0  # a cell that lies so far below all around it is noise
NEAREST, LONE_SHARE = 20, 0.25  # cells around one, and the share as low that makes it no ground
# m below the middle of all heights, which no ground falls within a square: -9999 would tilt the
# plane under all
ABYSS_M = 500.0
PLANES = 3  # rounds of fitting the plane under all cells, each to the lower half of the last
SMOOTHINGS = 30  # passes of a mean over neighbours that smooth what fills a gap


@dataclass(frozen=True)
class GroundGrid:
    """Heights `z` (columns, rows) of the ground at cells' centres, the first from `corner` (2,)."""

    corner: np.ndarray
    z: np.ndarray
    cell_m: float

    def height_at(self, xy: np.ndarray) -> np.ndarray:
        """Return the height (n,) at `xy` (n, 2 or more), bilinear, beyond the border its own."""
        place = (np.asarray(xy, float)[:, :2] - self.corner) / self.cell_m - 0.5
        return scipy.ndimage.map_coordinates(self.z, place.T, order=1, mode="nearest")

    def slope_at(self, xy: np.ndarray) -> np.ndarray:
        """Return the steepness (n,), a ratio, of the cell that holds each of `xy`."""
        place = ((np.asarray(xy, float)[:, :2] - self.corner) / self.cell_m).astype(int)
        column, row = np.clip(place, 0, np.array(self.z.shape) - 1).T
        padded = np.pad(self.z, 1, mode="edge")
        along = (padded[2:, 1:-1] - padded[:-2, 1:-1]) / (2 * self.cell_m)
        across = (padded[1:-1, 2:] - padded[1:-1, :-2]) / (2 * self.cell_m)
        return np.hypot(along, across)[column, row]


def ground_grid(xyz: np.ndarray, cell_m: float = CELL_M) -> GroundGrid:
    """Find the ground under points (n, 3), n > 0, on the world's grid.

    Coordinates are world metres.

    >>> x, y = np.mgrid[0:40, 0:40] + 0.5
    >>> house = (abs(x - 20) < 5) & (abs(y - 20) < 4)
    >>> points = np.column_stack([x.ravel(), y.ravel(), np.where(house, 6.0, 0.0).ravel()])
    >>> float(ground_grid(points).height_at(np.array([[20.0, 20.0]]))[0])
    0.0
    """
    cells = SquareCells(xyz, cell_m)
    ground = remove_objects(cells.bottom(xyz[:, 2]), cell_m)
    return GroundGrid(np.array(cells.first) * cell_m, fill_gaps(ground), cell_m)


def bare_points(lowest: np.ndarray) -> np.ndarray:
    """Return the ground's points among (m, 3), which are at most one a cell."""
    lowest = lowest[~is_lone(lowest)]
    cells = SquareCells(lowest, CELL_M)
    ground = remove_objects(cells.bottom(lowest[:, 2]), CELL_M)
    return lowest[np.isfinite(ground).ravel()[cells.index]]


def is_lone(lowest: np.ndarray) -> np.ndarray:
    """Return whether few of the cells (m, 3) nearest to each lie as low: then it is noise.

    One such cell, where roofs leave no others around, would make objects of all ground.
    """
    if len(lowest) < NEAREST:
        return np.zeros(len(lowest), bool)
    near = scipy.spatial.KDTree(lowest[:, :2]).query(lowest[:, :2], NEAREST)[1]
    n_as_low = (lowest[near, 2] <= lowest[:, [2]] + PIT_M).sum(axis=1)
    return np.asarray(n_as_low <= LONE_SHARE * NEAREST)


def remove_objects(lowest: np.ndarray, cell_m: float) -> np.ndarray:
    """Replace lowest heights of cells (c, r) that are not the ground's by NaN."""
    lowest = np.where(lowest < np.nanmedian(lowest) - ABYSS_M, np.nan, lowest)
    level = lowest - fit_plane(lowest, cell_m)
    pit = -open_heights(-level, 1) - level > PIT_M
    level = np.where(pit, np.nan, level)
    mask, raised, previous = np.isfinite(level), np.zeros(level.shape, bool), level
    for half in WINDOWS_M:
        cells = max(1, round(half / cell_m))
        heights = open_heights(previous, cells)
        raised |= previous - heights > SLOPE * half
        previous = np.where(mask, heights, np.nan)
    return np.where(mask & ~raised, lowest, np.nan)


def fit_plane(z: np.ndarray, cell_m: float) -> np.ndarray:
    """Return heights at all cells of a plane through `z`, fitted twice to its lower half."""
    column, row = (index * cell_m for index in np.indices(z.shape))
    terms, mask = np.stack([column, row, np.ones(z.shape)], axis=-1), np.isfinite(z)
    for _ in range(PLANES):
        plane = terms @ np.linalg.lstsq(terms[mask], z[mask], rcond=None)[0]
        mask = mask & (z - plane <= np.median((z - plane)[mask]))
    return plane


def open_heights(z: np.ndarray, half: int) -> np.ndarray:
    """Return the opening of known cells of `z` by squares of 2 half + 1 cells, NaN left out."""
    mask, size = np.isfinite(z), 2 * half + 1
    eroded = scipy.ndimage.grey_erosion(
        np.where(mask, z, np.inf), size=size, mode="constant", cval=np.inf
    )
    return scipy.ndimage.grey_dilation(
        np.where(mask, eroded, -np.inf), size=size, mode="constant", cval=-np.inf
    )


def fill_gaps(z: np.ndarray) -> np.ndarray:
    """Fill unknown cells (NaN) of `z` with the nearest known height, smoothed, else with zero."""
    mask = np.isfinite(z)
    if not mask.any():
        return np.zeros(z.shape)
    nearest = scipy.ndimage.distance_transform_edt(
        ~mask, return_distances=False, return_indices=True
    )
    heights = z[tuple(nearest)]
    for _ in range(SMOOTHINGS):
        heights = np.where(mask, z, scipy.ndimage.uniform_filter(heights, 3, mode="nearest"))
    return heights
