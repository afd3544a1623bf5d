"""Matching of fitted parts to true ones.

It says whether a part's type is right, and how large its errors are in sigmas.

Parts are compared by what shows of them: the part on top at points of the plan, in the truth and in
the fit. A true part is found where a fitted one, each of them taken once, has at least half of the
points that either of the two has.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import shapely
from scipy.optimize import linear_sum_assignment

from hiproof.model import Part, Piece

FOUND_IOU, HIDDEN_SLACK_M, SAME = 0.5, 0.02, 1e-6
ONE_END_LESS = {"hip": "side_hip", "half_hip": "side_half_hip", "mansard": "side_mansard"}
ALONG = ("length", "ridge_length", "t_x", "t_y")
"""What cannot be known of a part whose end runs on under another."""


def merge_alike(parts: Sequence[Part]) -> list[Part]:
    """Merge neighbours that nothing distinguishes; their place along a row is NaN."""
    parts = list(parts)
    for k in range(len(parts) - 1, 0, -1):
        united = merge_parts(parts[k - 1], parts[k])
        if united is not None:
            parts[k - 1 : k + 1] = [united]
    return parts


def merge_parts(a: Part, b: Part) -> Part | None:
    """Merge two parts of the same planes side by side, or return None."""
    if (
        a.type != b.type
        or len(a.pieces) > 1
        or a.pieces[0].planes.shape != b.pieces[0].planes.shape
    ):
        return None
    outline = a.pieces[0].outline.union(b.pieces[0].outline.buffer(SAME, join_style="mitre"))
    rectangle = outline.minimum_rotated_rectangle
    if rectangle.area - a.area - b.area > 1e-3 or not np.allclose(
        a.pieces[0].planes, b.pieces[0].planes, atol=SAME
    ):
        return None
    sides = np.hypot(*np.diff(shapely.get_coordinates(rectangle)[:3], axis=0).T)
    shared = {
        name: value
        for name, value in a.parameters.items()
        if abs(value - b.parameters.get(name, math.inf)) < SAME
    }
    for side in ("length", "width"):
        if side in shared and np.abs(sides - shared[side]).min() > 1e-3:
            del shared[side]
    place = np.array([np.nan, np.nan, a.translation[2]])
    return dataclasses.replace(
        a, pieces=(Piece(rectangle, a.pieces[0].planes),), parameters=shared, translation=place
    )


def match_parts(truth: Sequence[Part], fit: Sequence[Part], xy: np.ndarray) -> list[int]:
    """Return for each true part the index of the fitted one at places (n, 2), or -1."""
    tops = [np.argmax([part.height_at(xy) for part in parts], axis=0) for parts in (truth, fit)]
    common = np.zeros((len(truth), len(fit)))
    np.add.at(common, tuple(tops), 1.0)
    iou = common / np.maximum(common.sum(axis=1, keepdims=True) + common.sum(axis=0) - common, 1.0)
    matches = [-1] * len(truth)
    for i, j in zip(*linear_sum_assignment(-iou), strict=True):
        if iou[i, j] >= FOUND_IOU:
            matches[i] = int(j)
    return matches


def has_hidden_end(part: Part, other_parts: Sequence[Part]) -> bool:
    """Return whether an end of the length of `part` lies under or in other roofs."""
    if "length" not in part.parameters or len(part.pieces) > 1 or not other_parts:
        return False
    along = np.array([math.cos(part.kappa), math.sin(part.kappa)])
    ring = shapely.get_coordinates(part.pieces[0].outline)[:-1]
    for sign in (-1, 1):
        corners = ring[np.argsort(-sign * (ring @ along))[:2]] - sign * 0.01 * along
        xy = corners[0] + np.linspace(0.02, 0.98, 9)[:, None] * (corners[1] - corners[0])
        heights = np.max([other.height_at(xy) for other in other_parts], axis=0)
        if (part.pieces[0].height_at(xy) <= heights + HIDDEN_SLACK_M).all():
            return True
    return False


def list_right_types(part: Part, hidden: bool) -> set[str]:
    """Return the right types of a true part: any for a hidden end, gables of equal slopes."""
    types = {part.type} | (
        {ONE_END_LESS[part.type]} if hidden and part.type in ONE_END_LESS else set()
    )
    slopes = np.hypot(*part.pieces[0].planes[:, :2].T)
    return types | (
        {"gable"} if part.type == "asymmetric_gable" and np.ptp(slopes) < 0.01 else set()
    )


def compute_sigma_errors(truth: Part, fit: Part, hidden: bool) -> dict[str, float]:
    """Return error over standard deviation of common parameters.

    They are of every parameter that both parts of one type have; none where they are turned against
    each other, none along a part whose end is hidden, none of what the footprint gives (a sigma of
    0).
    """
    turn = math.remainder(fit.kappa - truth.kappa, math.pi)
    if fit.type != truth.type or abs(turn) > 0.3:
        return {}
    gaps = {
        name: fit.parameters[name] - truth.parameters[name]
        for name in truth.parameters
        if name in fit.parameters
    }
    gaps |= dict(zip(("t_x", "t_y", "t_z"), fit.translation - truth.translation, strict=True)) | {
        "kappa": turn
    }
    ratios = {
        name: gap / fit.sigma[name] for name, gap in gaps.items() if fit.sigma.get(name, 0.0) > 0
    }
    return {
        n: float(r) for n, r in ratios.items() if math.isfinite(r) and not (hidden and n in ALONG)
    }
