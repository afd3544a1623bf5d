"""Laser beams: the first surface that a beam meets on its way down.

A beam is written by height: p(z) = (x0 + sx z, y0 + sy z, z), so that a body bounded by half-spaces
n . p <= d is entered at the lowest of the heights its upward-facing sides allow and left at the
highest of the others. Three kinds of body: convex ones (roof pieces, chimneys, neighbours),
triangles (any solid read from a file), and crowns of trees that let part of the light through.

Beams are `xy0` (n, 2) at z = 0 and `slope` (n, 2) = (dx/dz, dy/dz).
"""

from __future__ import annotations

import numpy as np

LEAST_CLIMB = 1e-12  # least climb of a beam out of a half-space; with less it runs along the side


def select_passing(
    xy0: np.ndarray, slope: np.ndarray, centre: np.ndarray, radius: float
) -> np.ndarray:
    """Return the beams (k,) that pass a `centre` (3,) within so far in plan, at its height."""
    aside = xy0 + slope * centre[2] - centre[:2]
    return np.flatnonzero((aside**2).sum(axis=1) <= radius**2)


def cast_convex(
    xy0: np.ndarray,
    slope: np.ndarray,
    halfspaces: np.ndarray,
    starts: np.ndarray,
    discs: np.ndarray,
    z_hit: np.ndarray,
    face: np.ndarray,
) -> None:
    """Raise `z_hit` (n,) to the entry height where a convex body lies above it.

    `face` (n,) gets its side. Body b has the rows starts[b]:starts[b+1] of `halfspaces` (k, 4) =
    (nx, ny, nz, d), and no beam hits it that passes by its disc, `discs` (b, 4) = (x, y, z,
    radius). Both outputs are changed in place; `face` is a row of `halfspaces`.
    """
    for body, disc in enumerate(discs):
        near = select_passing(xy0, slope, disc[:3], disc[3])
        rows = halfspaces[starts[body] : starts[body + 1]]
        if not len(near) or not len(rows):
            continue
        climb = slope[near] @ rows[:, :2].T + rows[:, 2]
        room = rows[:, 3] - xy0[near] @ rows[:, :2].T
        with np.errstate(divide="ignore", invalid="ignore"):
            heights = room / climb
        entries = np.where(climb > LEAST_CLIMB, heights, np.inf)
        z_in, side = entries.min(axis=1), entries.argmin(axis=1)
        z_out = np.where(climb < -LEAST_CLIMB, heights, -np.inf).max(axis=1)
        is_beside = ((np.abs(climb) <= LEAST_CLIMB) & (room < 0.0)).any(axis=1)
        hits = np.isfinite(z_in) & (z_in > z_out) & (z_in > z_hit[near]) & ~is_beside
        z_hit[near[hits]], face[near[hits]] = z_in[hits], starts[body] + side[hits]


def cast_triangles(
    xy0: np.ndarray,
    slope: np.ndarray,
    triangles: np.ndarray,
    z_hit: np.ndarray,
    face: np.ndarray,
    first: int,
) -> None:
    """Raise `z_hit` where one of `triangles` (m, 3, 3) lies above it.

    `face` gets the triangle's number, from `first` on. Each corner is carried along the beam to
    z = 0, where the beam is a point: its barycentric weights give the height.
    """
    steepest = np.hypot(*slope.T).max(initial=0.0)
    for number, corners in enumerate(triangles, first):
        middle = corners.mean(axis=0)
        # a corner lies as far aside as its height carries it along the beam
        off = np.abs(corners - middle)
        reach = (np.hypot(off[:, 0], off[:, 1]) + steepest * off[:, 2]).max()
        near = select_passing(xy0, slope, middle, reach)
        a, b, c = (corner[:2] - slope[near] * corner[2] - xy0[near] for corner in corners)
        pairs = ((b, c), (c, a), (a, b))
        weights = np.stack([p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0] for p, q in pairs])
        total = weights.sum(axis=0)
        is_inside = (weights >= 0).all(axis=0) | (weights <= 0).all(axis=0)
        near, weights, total = (
            v[..., is_inside & (np.abs(total) > 1e-12)] for v in (near, weights, total)
        )
        z = corners[:, 2] @ weights / total
        hits = z > z_hit[near]
        z_hit[near[hits]], face[near[hits]] = z[hits], number


def cast_crowns(
    xy0: np.ndarray,
    slope: np.ndarray,
    crowns: np.ndarray,
    free_path: np.ndarray,
    z_crown: np.ndarray,
) -> None:
    """Raise `z_crown` (n,) to where a tree's crown catches a beam after `free_path` (n,) metres.

    `crowns` (t, 5) = (x, y, z of the centre, horizontal and vertical half axes) of upright
    ellipsoids. A beam whose way through a crown is shorter than its free path comes out below, so
    the ground and the roof under a tree are thinned, not hidden.
    """
    for *centre, r, h in crowns:
        near = select_passing(xy0, slope, np.array(centre), r + h)
        xy, lean, path = xy0[near] - centre[:2], slope[near], free_path[near]
        a = (lean**2).sum(axis=1) / r**2 + 1.0 / h**2
        b = (xy * lean).sum(axis=1) / r**2 - centre[2] / h**2
        c = (xy**2).sum(axis=1) / r**2 + centre[2] ** 2 / h**2 - 1.0
        root = np.sqrt(np.maximum(b * b - a * c, 0.0))
        stretch = np.sqrt(1.0 + (lean**2).sum(axis=1))
        is_caught = 2.0 * root / a * stretch > path
        caught = (-b + root) / a - path / stretch
        z_crown[near[is_caught]] = np.maximum(z_crown[near], caught)[is_caught]


def cast_waves(xy0: np.ndarray, slope: np.ndarray, waves: np.ndarray, base: float) -> np.ndarray:
    """Return the heights (n,) at which the beams meet a wavy terrain.

    It is z = base + sum of amplitude sin(kx x + ky y + phase). `waves` (w, 4) = (kx, ky, phase,
    amplitude). Three Newton steps from the base reach far less than a millimetre, as the terrain's
    slope and curvature are small.
    """
    z = np.full(len(xy0), base)
    for _ in range(3):
        angle = (xy0 + slope * z[:, None]) @ waves[:, :2].T + waves[:, 2]
        above = z - base - np.sin(angle) @ waves[:, 3]
        climb = 1.0 - ((slope @ waves[:, :2].T) * np.cos(angle)) @ waves[:, 3]
        z = z - above / climb
    return z
