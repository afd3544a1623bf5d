"""Estimate how far a building's points lie beside its outline.

Clouds lie some centimetres beside their outlines. Then planes that rise from walls at one height
seem to rise at several, and their hips and valleys end beside the outline's corners. Two numbers
that all planes share say so: with the points moved back, equal eaves are equal.
"""

from __future__ import annotations

import numpy as np

from .tables import VOLUME_COUNT, Tables, read_line

ON_WALL_M = 0.05  # A line that passes so near (m) the middle of a wall is the wall's.
ONE_DIRECTION = 0.999  # Cosine of the angle up to which two lines have one direction.
EQUAL_EAVES_M = 0.05  # Eaves that differ more (m) than this count less and less.
ROUNDS = 10  # Rounds of weighting eaves by how far they differ.
HELD = 0.05  # Weight of the wish not to move what eaves do not determine.
FURTHEST_M = 0.12  # Clouds lie a decimetre beside their outlines: further off (m), eaves differ.
SEEN_M = 0.01  # Shorter shifts (m) change nothing.


def estimate_shift(roof: Tables, site) -> np.ndarray:
    """Return how far (m, (2,)) points lie beside the outline, if their eaves are to be level.

    Each volume's planes that rise from walls are to do so at one height. Zero where eaves do not
    say, or would have the points too far away.
    """
    rows = list_eaves(roof, site)
    if len(rows) < 2:
        return np.zeros(2)
    owners, eaves, toward = rows[:, 0], rows[:, 1], rows[:, 2:]
    shift, weights = np.zeros(2), np.ones(len(rows))
    groups = [owners == k for k in np.unique(owners)]
    for _ in range(ROUNDS):
        level, lean = eaves.copy(), toward.copy()
        for of_one in groups:
            share = weights[of_one] / weights[of_one].sum()
            level[of_one] -= share @ eaves[of_one]
            lean[of_one] -= share @ toward[of_one]
        normal = (lean.T * weights) @ lean + HELD * np.eye(2)
        shift = np.linalg.solve(normal, -(lean.T * weights) @ level)
        weights = 1.0 / (1.0 + ((level + lean @ shift) / EQUAL_EAVES_M) ** 2)
    length = np.hypot(*shift)
    return shift if SEEN_M < length < FURTHEST_M else np.zeros(2)


def list_eaves(roof: Tables, site) -> np.ndarray:
    """List the eaves (e, 4) on walls: the volume, the height (m), and the rise towards x and y."""
    rows = []
    edges = site.lines[site.lines[:, 5] > 0]
    for k in range(roof.counts[VOLUME_COUNT]):
        for p in np.flatnonzero(roof.slopes[k, : roof.n_planes[k]] >= 0).tolist():
            line, plane = np.array(read_line(roof, roof.plane_lines[k, p])), roof.planes[k, p]
            is_on = np.abs(edges[:, 3:5] @ line[:2] + line[2]) < ON_WALL_M
            is_on &= edges[:, :2] @ line[:2] > ONE_DIRECTION
            if is_on.any():
                rows.append([k, plane @ [*edges[is_on][0, 3:5], 1.0], *plane[:2]])
    return np.array(rows).reshape(-1, 4)
