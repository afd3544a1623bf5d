"""One half of a roof: what stands on one side of a cut through its middle, such as one of a pair of houses under one hipped roof.

A plane of the whole stands in the half as it stood, seen from the half's own middle; lengths that the cut crosses are halved.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from .algebra import Formula, U, V, formula
from .contract import BACK, LEFT, Plane, Primitive, Shape, Sides

ALONG, ACROSS = 0, 1  # the axis that the cut halves
CROSSED = (("length", "ridge_length", "top_length"), ("width", "top_width"))
EXTENT = (("U", U), ("V", V))


def right_half(whole: Primitive, **own: Any) -> Primitive:
    """The end at +u of the roof `whole`, with what is its `own`: name, codes, starts, colour."""
    return half_of(whole, ALONG, **own)


def front_half(whole: Primitive, **own: Any) -> Primitive:
    """The side at -v of the roof `whole`, with what is its `own`: name, codes, starts, colour."""
    return half_of(whole, ACROSS, **own)


def half_of(whole: Primitive, axis: int, **own: Any) -> Primitive:
    """The half of `whole` beyond a cut across `axis`: at +u, or at -v."""
    kept = [k for k, side in enumerate(whole.sides) if side != (LEFT, BACK)[axis]]
    used = sorted({corner for k in kept for corner in whole.faces[k]})
    symbol, crossed = EXTENT[axis][0], CROSSED[axis]

    def doubled(p: Mapping[str, float]) -> dict[str, float]:
        return {name: 2.0 * value if name in crossed else value for name, value in p.items()}

    def halved(p: Mapping[str, float]) -> dict[str, float]:
        return {name: 0.5 * value if name in crossed else value for name, value in p.items()}

    def shape(p: Mapping[str, float]) -> Shape:
        half_width, half_length, *q = whole.shape(doubled(p))
        return (half_width, 0.5 * half_length, *q) if axis == ALONG else (0.5 * half_width, half_length, *q)

    def of_member(member: Sides) -> tuple[float, ...]:
        half = member.half.copy()
        half[axis] *= 2.0
        return whole.from_member(member.over(half))

    def typical(width: float, length: float, height: float) -> dict[str, float]:
        sizes = doubled({"width": width, "length": length})
        return halved(whole.typical(sizes["width"], sizes["length"], height))

    return replace(
        whole,
        measures={
            name: measure.with_multiple(symbol, 2.0) * (0.5 if name in crossed else 1.0)
            for name, measure in whole.measures.items()
        },
        eave=whole.eave.with_multiple(symbol, 2.0),
        planes=tuple(seen_from_the_half(whole.plane_formulas[k], axis) for k in kept),
        shape=shape,
        corners=lambda p: cut(np.array(whole.corners(doubled(p)), float)[used], axis, p[crossed[0]]),
        faces=tuple(tuple(used.index(corner) for corner in whole.faces[k]) for k in kept),
        typical=typical,
        draw=lambda rng, width: halved(whole.drawn(rng, doubled({"width": width})["width"])),
        of_member=of_member,
        canonical=lambda theta: theta,
        half_turn_symmetric=False,
        vote=None,
        **own,
    )


def seen_from_the_half(plane: tuple[Formula, ...], axis: int) -> Plane:
    """The plane over u, v about the half's middle, which lies half of its extent at +u, or -v, of the whole's."""
    symbol, extent = EXTENT[axis]
    a, b, c = (formula(coefficient).with_multiple(symbol, 2.0) for coefficient in plane)
    return a, b, c + (a * extent if axis == ALONG else b * -extent)


def cut(vertices: np.ndarray, axis: int, extent: float) -> np.ndarray:
    """Vertices (n, 3) of the whole about the half's middle, those beyond the cut moved onto it, straight across.

    A face whose edges run across the cut is the half's face then; one that lies beyond is left without area.
    """
    sign = 1.0 if axis == ALONG else -1.0
    moved = vertices.copy()
    moved[:, axis] = sign * np.maximum(sign * vertices[:, axis], 0.0) - sign * 0.5 * extent
    return moved
