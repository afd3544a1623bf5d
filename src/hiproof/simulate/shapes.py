"""Roof parts placed in plan, and the small boxes that stand on roofs.

Boxes are flat or gabled.
"""

from __future__ import annotations

import math

import numpy as np
import shapely

from ..model import Part, Piece
from ..primitives import CATALOGUE

NOT_ROOF = -1  # label of what is no roof, as in segment
ROOF_TYPES = (
    *("flat", "monopitch", "gable", "hip", "half_hip"),
    *("pyramid", "mansard", "shed", "asymmetric_gable", "gambrel"),
)
"""The types of whole roofs: what a building made up at random has where none is named, and what the
network tells apart.
"""


def find_label(type: str | None) -> int:
    """Return the label of a roof type's points, its catalogue place, or NOT_ROOF."""
    return list(CATALOGUE).index(type) if type in CATALOGUE else NOT_ROOF


def make_part(
    type: str, parameters: dict[str, float], kappa: float, translation: np.ndarray
) -> Part:
    """Return one primitive, turned by `kappa` about Z and moved.

    It has theta_p `parameters`, its eave at the height of `translation` (3,); the parameters it
    carries are the canonical ones of its surface.
    """
    primitive = CATALOGUE[type].variant(parameters)
    return primitive.part(
        primitive.canonical_theta(primitive.to_theta(parameters, kappa, translation))
    )


def box(
    xy: np.ndarray, size: tuple[float, float], z_top: float, kappa: float, rise: float = 0.0
) -> Piece:
    """Return a block about `xy` turned by `kappa`, flat, or a gable with `rise`, at `z_top`."""
    cosine, sine = math.cos(kappa), math.sin(kappa)
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (size[0] / 2, size[1] / 2)
    outline = shapely.Polygon(corners @ np.array([(cosine, sine), (-sine, cosine)]) + xy)
    across, slope = np.array([-sine, cosine]), 2 * rise / size[1]
    signs = np.array([1.0, -1.0]) if rise else np.array([0.0])
    gradient = signs[:, None] * slope * across
    return Piece(outline, np.column_stack([gradient, z_top - gradient @ xy]))
