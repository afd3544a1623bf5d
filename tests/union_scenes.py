"""Generate scenes and volumes for the laws of the union's search."""

import math
from dataclasses import replace

import numpy as np
import shapely

from hiproof.fit.candidates.volumes import (
    COLUMNS,
    DIRECTION,
    LEAN0,
    LEVEL,
    N_PLANES,
    N_SIDES,
    OFFSET0,
    REPLACES,
    SLOPE0,
    TIE,
    U0,
    U1,
    V0,
    V1,
    equalise_slopes,
)
from hiproof.fit.layout.plan import lay_out_plan
from hiproof.fit.layout.scene import open_window
from hiproof.fit.layout.whole import lay_out_whole
from hiproof.primitives.family import GENERAL_SHAPES, Member
from hiproof.settings import Settings

OUTLINES = (
    shapely.box(-6.0, -4.0, 6.0, 4.0),
    shapely.Polygon([(-7, -5), (7, -5), (7, 1), (0, 1), (0, 6), (-7, 6)]),
    shapely.Polygon([(-6, -4), (5, -4), (7.5, 2), (3, 4), (-6, 4)]),
)


def draw_volume(rng, replacing=0.2):
    """Draw a row (COLUMNS,) with a rectangle, planes, a ridge above its middle, and a tie."""
    row = np.zeros(COLUMNS)
    row[DIRECTION] = rng.integers(2)
    u, v = np.sort(rng.uniform(-7.0, 7.0, (2, 2)), axis=1) + [[-0.5, 0.5]]
    row[U0], row[U1], row[V0], row[V1] = *u, *v
    row[OFFSET0 : OFFSET0 + N_PLANES] = np.inf
    is_chosen = rng.random(N_PLANES) < 0.5
    is_chosen[rng.integers(N_PLANES)] = True
    for k in np.nonzero(is_chosen)[0]:
        row[OFFSET0 + k] = rng.uniform(-1.0, 2.0)
        if k < LEVEL:
            row[SLOPE0 + k] = rng.uniform(0.1, 1.2)
            row[LEAN0 + k] = rng.choice([0.0, rng.uniform(-0.3, 0.3)])
            lower = u[0] if k == 0 else -u[1] if k == 1 else v[0] if k == 2 else -v[1]
            row[OFFSET0 + k] -= row[SLOPE0 + k] * lower
    row[TIE], row[REPLACES] = rng.integers(3), float(rng.random() < replacing)
    equalise_slopes(row)
    return row


def draw_volumes(rng, most_volumes=5, replacing=0.2):
    """Draw a level base and random volumes: rows (k, COLUMNS)."""
    base = np.r_[np.zeros(OFFSET0), [np.inf] * LEVEL, -1.0, np.zeros(COLUMNS - OFFSET0 - N_PLANES)]
    base[U0 : V1 + 1] = -1e4, 1e4, -1e4, 1e4
    return np.vstack(
        [base, *[draw_volume(rng, replacing) for _ in range(rng.integers(1, most_volumes + 1))]]
    )


def compute_heights(volumes, U, V):
    """Return heights of the roof and visible volumes at U, V (directions, n) by definition."""
    z, top = np.full(U.shape[1], -np.inf), np.zeros(U.shape[1], int)
    for k, row in enumerate(volumes):
        u, v = U[int(row[DIRECTION])], V[int(row[DIRECTION])]
        offset = row[OFFSET0 : OFFSET0 + N_PLANES, None]
        slope = row[SLOPE0 : SLOPE0 + N_SIDES, None]
        rise = np.array([u, -u, v, -v]) + row[LEAN0 : LEAN0 + N_SIDES, None] * [v, v, u, u]
        h = np.min(
            [*(offset[:LEVEL] + slope * rise), np.broadcast_to(offset[LEVEL], u.shape)], axis=0
        )
        shows = (
            (row[U0] <= u)
            & (u <= row[U1])
            & (row[V0] <= v)
            & (v <= row[V1])
            & ((h > z) | (row[REPLACES] > 0))
        )
        z, top = np.where(shows, h, z), np.where(shows, k, top)
    return z, top


def lay_out_scene(points, outline, angles, types=()):
    """Return a building in directions at `angles` (rad), and the scene of all its points.

    A unit is three points, and a point 0.25 m off the roof is unexplained.
    """
    plan = lay_out_plan(points, outline)
    turn = np.column_stack([np.cos(angles), np.sin(angles)])
    compound = {"tolerance_m": 0.25, "evidence_points": 3.0}
    settings = Settings.from_dict({"compound": compound}).compound
    whole = replace(lay_out_whole(plan, outline, settings, types), turn=turn)
    return whole, open_window(whole, whole.box, len(points))


def draw_scene(rng, volumes=None, count=250, types=()):
    """Draw points near the roof of `volumes`, or level ground, a tenth of them astray."""
    outline = OUTLINES[rng.integers(len(OUTLINES))]
    x0, y0, x1, y1 = outline.bounds
    xy = rng.uniform((x0, y0), (x1, y1), (2 * count, 2))
    xy = xy[shapely.contains_xy(outline, *xy.T)][:count]
    angles = [0.0, math.radians(rng.uniform(15.0, 75.0))]
    points = np.column_stack([xy, np.zeros(len(xy))])
    _, scene = lay_out_scene(points, outline, angles, types)
    z = (
        compute_heights(volumes, scene.U, scene.V)[0]
        if volumes is not None
        else np.zeros(scene.U.shape[1])
    )
    z = (
        z
        + rng.normal(0.0, 0.03, len(z))
        + (rng.random(len(z)) < 0.1) * rng.normal(0.0, 1.0, len(z))
    )
    lower, upper = z.min() - 0.3, z.max() + 0.3
    return scene._replace(z=z, low=lower, high=upper)


def draw_member(rng, shape, regular=False, skewed=False):
    """Draw a member of the family called `shape` (or a kin of it). Its ridge is along its own u. A
    `regular` one has one eave and one slope, as most roofs have. The planes of a `skewed` one face
    a little off the axes.
    """
    top, sides = next(
        (has_top, sides)
        for (has_top, _, _), (name, sides) in GENERAL_SHAPES.items()
        if name == shape
    )
    sides, half = list(sides), np.array([rng.uniform(6.0, 8.0), rng.uniform(3.5, 5.0)])
    eaves, slopes, leans = np.full(4, np.inf), np.zeros(4), np.zeros(4)
    eaves[sides] = rng.uniform(3.0, 6.0) + (0.0 if regular else rng.uniform(0.0, 0.4, len(sides)))
    slopes[sides] = rng.uniform(0.5, 0.9) * (
        np.ones(len(sides)) if regular else rng.uniform(0.9, 1.1, len(sides))
    )
    if skewed:
        leans[sides] = rng.uniform(-0.1, 0.1, len(sides))
    reach = half[1] * slopes[sides].min() if sides else 0.0
    height = (
        (eaves[sides].max() + rng.uniform(0.4, 0.6) * reach if sides else rng.uniform(3.0, 6.0))
        if top
        else math.inf
    )
    return Member(
        rng.uniform(-3.1, 3.1), rng.normal(0.0, 30.0, 2), half, eaves, slopes, height, leans
    )


def list_corners(member):
    """Return the plan (4, 2) of a member, counterclockwise."""
    c, s = math.cos(member.kappa), math.sin(member.kappa)
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * member.half
    return corners @ np.array([[c, s], [-s, c]]) + member.centre


def compute_lowest(planes, xy):
    """Return heights (n,) of the min of planes (k, 3) at `xy` (n, 2)."""
    return (xy @ planes[:, :2].T + planes[:, 2]).min(axis=1)


def search_all_rectangles(gain):
    """Return the largest sum of `gain` (nu, nv) over all rectangles of its cells."""
    nu, nv = gain.shape
    return max(
        gain[a:b, c:d].sum()
        for a in range(nu)
        for b in range(a + 1, nu + 1)
        for c in range(nv)
        for d in range(c + 1, nv + 1)
    )
