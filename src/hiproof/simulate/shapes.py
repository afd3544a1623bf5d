"""Roof shapes as pieces: plan rectangles in the roof's own (u, v) axes with the planes whose lower envelope is the
roof.

u runs along the ridge, v across it, the rectangle is `length` x `width` about the origin and the lowest eave is at 0.
"""

from __future__ import annotations

import math

import numpy as np
import shapely

from ..model import Part, Piece

ROOF_TYPES = (
    "flat",
    "monopitch",
    "gable",
    "hip",
    "half_hip",
    "pyramid",
    "mansard",
    "shed",
    "asymmetric_gable",
    "gambrel",
)


def _along(height: float, half: float, run: float) -> list[tuple[float, float, float]]:
    """Two planes that rise from 0 at |u| = half to `height` after `run`."""
    slope = height / run
    return [(slope, 0.0, slope * half), (-slope, 0.0, slope * half)]


def _across(height: float, half: float, run: float) -> list[tuple[float, float, float]]:
    """Two planes that rise from 0 at |v| = half to `height` after `run`."""
    slope = height / run
    return [(0.0, slope, slope * half), (0.0, -slope, slope * half)]


def planes_of(type: str, p: dict[str, float]) -> np.ndarray:
    """Planes (k, 3), z = a u + b v + c, of one convex `type` with parameters `p` (all types but the shed)."""
    U, V, h = p["length"] / 2, p["width"] / 2, p.get("height", 0.0)
    if type == "flat":
        planes = [(0.0, 0.0, 0.0)]
    elif type == "monopitch":
        planes = [(0.0, h / (2 * V), h / 2)]
    elif type == "gable":
        planes = _across(h, V, V)
    elif type == "hip":
        planes = _across(h, V, V) + _along(h, U, p["hip_run"])
    elif type == "half_hip":
        ends = _along(h - p["hip_height"], U, p["hip_run"])
        planes = _across(h, V, V) + [(a, b, c + p["hip_height"]) for a, b, c in ends]
    elif type == "pyramid":
        planes = _across(h, V, V) + _along(h, U, U)
    elif type == "mansard":
        planes = [*_across(h, V, p["inset"]), *_along(h, U, p["inset"]), (0.0, 0.0, h)]
    elif type == "asymmetric_gable":
        ridge, eave = p["ridge_offset"], p["eave_difference"]
        left, right = h / (V + ridge), (h - eave) / (V - ridge)
        planes = [(0.0, left, left * V), (0.0, -right, eave + right * V)]
    else:
        run, knee = p["knee_run"], p["knee_height"]
        upper = [(a, b, c + knee) for a, b, c in _across(h - knee, V - run, V - run)]
        planes = _across(knee, V, run) + upper
    return np.array(planes)


def rectangle(length: float, width: float, u: float = 0.0, v: float = 0.0) -> np.ndarray:
    """Corners (4, 2), counter-clockwise, of a `length` x `width` rectangle about (u, v)."""
    return np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (length / 2, width / 2) + (u, v)


def placed(corners: np.ndarray, planes: np.ndarray, kappa: float, translation: np.ndarray) -> Piece:
    """The piece turned by `kappa` about Z, then moved by `translation` (3,)."""
    cosine, sine = math.cos(kappa), math.sin(kappa)
    rotation = np.array([(cosine, -sine), (sine, cosine)])
    outline = shapely.Polygon(corners @ rotation.T + translation[:2])
    gradient = planes[:, :2] @ rotation.T
    offset = planes[:, 2] + translation[2] - gradient @ translation[:2]
    return Piece(outline, np.column_stack([gradient, offset]))


def make_part(type: str, parameters: dict[str, float], kappa: float, translation: np.ndarray) -> Part:
    """One primitive as a model Part. A shed's teeth lie side by side along u, each a slope rising with u."""
    translation = np.asarray(translation, float)
    length, width = parameters["length"], parameters["width"]
    if type != "shed":
        pieces = (placed(rectangle(length, width), planes_of(type, parameters), kappa, translation),)
    else:
        teeth = int(parameters["teeth"])
        tooth = length / teeth
        slope = parameters["height"] / tooth
        starts = -length / 2 + tooth * np.arange(teeth)
        pieces = tuple(
            placed(
                rectangle(tooth, width, start + tooth / 2),
                np.array([(slope, 0.0, -slope * start)]),
                kappa,
                translation,
            )
            for start in starts
        )
    return Part(type, pieces, parameters, kappa, translation)
