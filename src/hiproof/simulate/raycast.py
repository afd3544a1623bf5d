"""Compiled laser beams: the first surface that a beam meets on its way down.

A beam is written by height: p(z) = (x0 + sx z, y0 + sy z, z), so that a body bounded by half-spaces
n . p <= d is entered at the lowest of the heights its upward-facing sides allow and left at the
highest of the others. Three kinds of body: convex ones (roof pieces, chimneys, neighbours),
triangles (any solid read from a file), and crowns of trees that let part of the light through.
"""

from __future__ import annotations

import numpy as np

from ..compiled import compiled


@compiled
def cast_convex(xy0, slope, halfspaces, starts, discs, z_hit, face):
    """Raise `z_hit` (n,) to the entry height where a body lies above it.

    Bodies are convex.

    `face` (n,) gets its side.

    Beams are `xy0` (n, 2) at z = 0 and `slope` (n, 2) = (dx/dz, dy/dz). Body b has the rows
    starts[b]:starts[b+1] of `halfspaces` (k, 4) = (nx, ny, nz, d), and no beam hits it that passes
    by its disc, `discs` (b, 4) = (x, y, z, radius). Both outputs are changed in place; `face` is a
    row of `halfspaces`.
    """
    for i in range(len(xy0)):
        x0, y0, sx, sy = xy0[i, 0], xy0[i, 1], slope[i, 0], slope[i, 1]
        for b in range(len(starts) - 1):
            aside_x = x0 + sx * discs[b, 2] - discs[b, 0]
            aside_y = y0 + sy * discs[b, 2] - discs[b, 1]
            if aside_x * aside_x + aside_y * aside_y > discs[b, 3] * discs[b, 3]:
                continue
            z_in, z_out, side = np.inf, -np.inf, -1
            for k in range(starts[b], starts[b + 1]):
                climb = halfspaces[k, 0] * sx + halfspaces[k, 1] * sy + halfspaces[k, 2]
                room = halfspaces[k, 3] - halfspaces[k, 0] * x0 - halfspaces[k, 1] * y0
                if climb > 1e-12:
                    if room / climb < z_in:
                        z_in, side = room / climb, k
                elif climb < -1e-12:
                    z_out = max(z_out, room / climb)
                elif room < 0.0:
                    z_in = -np.inf
                if z_in <= z_out or z_in <= z_hit[i]:
                    side = -1
                    break
            if side >= 0 and z_in > z_hit[i] and z_in > z_out:
                z_hit[i], face[i] = z_in, side


@compiled
def cast_triangles(xy0, slope, triangles, z_hit, face):
    """Raise `z_hit` where one of `triangles` (m, 3, 3) lies above it.

    `face` gets the triangle's index.

    Each corner is carried along the beam to z = 0, where the beam is a point: its barycentric
    weights give the height.
    """
    for i in range(len(xy0)):
        x0, y0, sx, sy = xy0[i, 0], xy0[i, 1], slope[i, 0], slope[i, 1]
        for t in range(len(triangles)):
            za, zb, zc = triangles[t, 0, 2], triangles[t, 1, 2], triangles[t, 2, 2]
            if max(za, zb, zc) <= z_hit[i]:
                continue
            ax, ay = triangles[t, 0, 0] - sx * za - x0, triangles[t, 0, 1] - sy * za - y0
            bx, by = triangles[t, 1, 0] - sx * zb - x0, triangles[t, 1, 1] - sy * zb - y0
            cx, cy = triangles[t, 2, 0] - sx * zc - x0, triangles[t, 2, 1] - sy * zc - y0
            wa, wb, wc = bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx
            total = wa + wb + wc
            inside = (wa >= 0 and wb >= 0 and wc >= 0) or (wa <= 0 and wb <= 0 and wc <= 0)
            if inside and abs(total) > 1e-12:
                z = (wa * za + wb * zb + wc * zc) / total
                if z > z_hit[i]:
                    z_hit[i], face[i] = z, t


@compiled
def cast_crowns(xy0, slope, crowns, free_path, z_crown):
    """Raise `z_crown` (n,) to where a tree's crown catches a beam.

    It is caught after `free_path` (n,) metres of leaves.

    `crowns` (t, 5) = (x, y, z of the centre, horizontal and vertical half axes) of upright
    ellipsoids. A beam whose way through a crown is shorter than its free path comes out below, so
    the ground and the roof under a tree are thinned, not hidden.
    """
    for i in range(len(xy0)):
        for t in range(len(crowns)):
            x, y = xy0[i, 0] - crowns[t, 0], xy0[i, 1] - crowns[t, 1]
            sx, sy, r, h = slope[i, 0], slope[i, 1], crowns[t, 3], crowns[t, 4]
            aside_x, aside_y = x + sx * crowns[t, 2], y + sy * crowns[t, 2]
            if aside_x * aside_x + aside_y * aside_y > (r + h) * (r + h):
                continue
            a = (sx * sx + sy * sy) / (r * r) + 1.0 / (h * h)
            b = (x * sx + y * sy) / (r * r) - crowns[t, 2] / (h * h)
            c = (x * x + y * y) / (r * r) + crowns[t, 2] ** 2 / (h * h) - 1.0
            root = b * b - a * c
            if root > 0.0:
                z_top, through = (-b + np.sqrt(root)) / a, 2.0 * np.sqrt(root) / a
                stretch = np.sqrt(1.0 + sx * sx + sy * sy)
                if through * stretch > free_path[i]:
                    z_crown[i] = max(z_crown[i], z_top - free_path[i] / stretch)


@compiled
def cast_waves(xy0, slope, waves, base):
    """Return the heights (n,) at which the beams meet a wavy terrain.

    It is z = base + sum of amplitude sin(kx x + ky y + phase).

    `waves` (w, 4) = (kx, ky, phase, amplitude). Three Newton steps from the base reach far less
    than a millimetre, as the terrain's slope and curvature are small.
    """
    z = np.full(len(xy0), base)
    for i in range(len(xy0)):
        for _ in range(3):
            x, y = xy0[i, 0] + slope[i, 0] * z[i], xy0[i, 1] + slope[i, 1] * z[i]
            above, climb = z[i] - base, 1.0
            for w in range(len(waves)):
                kx, ky, phase, amplitude = waves[w, 0], waves[w, 1], waves[w, 2], waves[w, 3]
                angle = kx * x + ky * y + phase
                above -= amplitude * np.sin(angle)
                climb -= amplitude * np.cos(angle) * (kx * slope[i, 0] + ky * slope[i, 1])
            step = above / climb
            z[i] -= step
            if abs(step) < 0.05:
                break
    return z
