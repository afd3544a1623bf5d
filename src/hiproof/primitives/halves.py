"""Halves of other roofs, such as that of one of two houses under one hip.

A cut through the middle of the whole roof makes the half. Its planes keep their slopes and are
given about the middle of the half. Lengths that the cut crosses are halved.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from .algebra import Formula, U, V, formula, q0, q1, q2
from .contract import BACK, LEFT, DerivedStart, Plane, Primitive, Shape, Sides, at_quarters
from .half_hip import PRIMITIVE as HALF_HIP
from .hip import PRIMITIVE as HIP
from .mansard import PRIMITIVE as MANSARD
from .truncated_gable import PRIMITIVE as TRUNCATED_GABLE

ALONG, ACROSS = 0, 1  # the axis that the cut halves
CROSSED = (("length", "ridge_length", "top_length"), ("width", "top_width"))
AXES = (("U", U), ("V", V))


def cut_half(whole: Primitive, axis: int, **own: Any) -> Primitive:
    """Return the half of `whole` beyond a cut across `axis`: at +u, or at -v."""
    selection = [k for k, side in enumerate(whole.sides) if side != (LEFT, BACK)[axis]]
    in_use = sorted({corner for k in selection for corner in whole.faces[k]})
    symbol, crossed = AXES[axis][0], CROSSED[axis]

    def double_extents(p: Mapping[str, float]) -> dict[str, float]:
        return {name: 2.0 * value if name in crossed else value for name, value in p.items()}

    def halve_extents(p: Mapping[str, float]) -> dict[str, float]:
        return {name: 0.5 * value if name in crossed else value for name, value in p.items()}

    def shape(p: Mapping[str, float]) -> Shape:
        half_width, half_length, *q = whole.shape(double_extents(p))
        return (
            (half_width, 0.5 * half_length, *q)
            if axis == ALONG
            else (0.5 * half_width, half_length, *q)
        )

    def of_member(member: Sides) -> tuple[float, ...]:
        half = member.half.copy()
        half[axis] *= 2.0
        return whole.from_member(member.resize(half))

    def typical(width: float, length: float, height: float) -> dict[str, float]:
        sizes = double_extents({"width": width, "length": length})
        return halve_extents(whole.typical(sizes["width"], sizes["length"], height))

    return replace(
        whole,
        measures={
            name: measure.with_multiple(symbol, 2.0) * (0.5 if name in crossed else 1.0)
            for name, measure in whole.measures.items()
        },
        eave=whole.eave.with_multiple(symbol, 2.0),
        planes=tuple(shift_plane_to_half(whole.plane_formulas[k], axis) for k in selection),
        shape=shape,
        corners=lambda p: cut_vertices(
            np.array(whole.corners(double_extents(p)), float)[in_use], axis, p[crossed[0]]
        ),
        faces=tuple(tuple(in_use.index(corner) for corner in whole.faces[k]) for k in selection),
        typical=typical,
        draw=lambda rng, width: halve_extents(
            whole.draw_parameters(rng, double_extents({"width": width})["width"])
        ),
        read_member=of_member,
        canonical=lambda theta: theta,
        half_turn_symmetric=False,
        vote=None,
        **own,
    )


def shift_plane_to_half(plane: tuple[Formula, ...], axis: int) -> Plane:
    """Return a plane over u, v about the half's middle.

    The half's middle lies half of its extent at +u, or at -v, of the whole's.
    """
    symbol, extent = AXES[axis]
    a, b, c = (formula(coefficient).with_multiple(symbol, 2.0) for coefficient in plane)
    return a, b, c + (a * extent if axis == ALONG else b * -extent)


def cut_vertices(vertices: np.ndarray, axis: int, extent: float) -> np.ndarray:
    """Return vertices (n, 3) of the whole about the half's middle.

    Those beyond the cut move straight across onto it.

    A face whose edges run across the cut is the half's face then; one that lies beyond is left
    without area.
    """
    sign = 1.0 if axis == ALONG else -1.0
    moved = vertices.copy()
    moved[:, axis] = sign * np.maximum(sign * vertices[:, axis], 0.0) - sign * 0.5 * extent
    return moved


SIDE_HIP = cut_half(  # a gable of which one end slopes too
    HIP,
    ALONG,
    name="side_hip",
    osm_shape="side_hipped",
    legend="hip",
    starts=(
        *at_quarters("gable", (q0, q1, 1.0), (0, 2)),
        *at_quarters("hip", (q0, q1, q2), (0, 2)),
    ),
)
SIDE_HALF_HIP = cut_half(  # a gable of which a small hip cuts one end
    HALF_HIP,
    ALONG,
    name="side_half_hip",
    osm_shape="side_half-hipped",
    legend="half hip",
    starts=at_quarters("gable", (q0, q1, 1.0, 0.5), (0, 2)),
)
HALF_MANSARD = cut_half(  # one slope up to a level top
    TRUNCATED_GABLE,
    ACROSS,
    name="half_mansard",
    osm_shape="saltbox",
    legend="mansard",
    starts=(
        DerivedStart("monopitch", (q0 + 0.2 * q1 * V, q1, 0.6)),
        *at_quarters("flat", (q0, 1.0, 0.15)),
    ),
)
SIDE_MANSARD = cut_half(  # three slopes up to a level top that reaches to the fourth side
    MANSARD,
    ALONG,
    name="side_mansard",
    osm_shape="mansard",
    legend="mansard",
    starts=(
        *at_quarters("gable", (q0 - 0.4 * q1 * V, q1, 1.0, 0.6), (0, 2)),
        *at_quarters("flat", (q0, 1.0, 1.0, 0.25)),
    ),
)
# two adjacent slopes up to a level top that reaches to the other two sides
CORNER_MANSARD = cut_half(
    SIDE_MANSARD,
    ACROSS,
    name="corner_mansard",
    osm_shape="mansard",
    legend="mansard",
    starts=(
        DerivedStart("corner", (q0 + q1 * V, q1, q2, 0.5)),
        *at_quarters("flat", (q0, 1.0, 1.0, 0.15)),
    ),
)
