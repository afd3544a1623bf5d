"""The catalogue as arrays for the compiled core.

There is one row a variant, and the planes' formulas are a list of terms.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from ..primitives import CATALOGUE, Primitive
from ..primitives.algebra import formula
from ..primitives.contract import Vote
from .kernel import MAX_PLANES, SIZE, Tables

PLAN_LOW, PLAN_HIGH = (-np.inf, -np.inf, -np.inf, 0.6, 0.6), (np.inf, np.inf, np.inf, 150.0, 150.0)


@cache
def variants(names: tuple[str, ...] = tuple(CATALOGUE)) -> tuple[Primitive, ...]:
    """Return the fitted variants of the primitives `names`, in the tables' order.

    They vote or have starts. Those with more facets do not: they follow from the size.
    """
    return tuple(
        variant
        for name in names
        for variant in CATALOGUE[name].variants
        if variant.vote or variant.starts
    )


@cache
def tables(names: tuple[str, ...] = tuple(CATALOGUE)) -> Tables:
    """Return the term table of the variants of `names`.

    Raises ValueError for a shape with more planes than the core holds.
    """
    return tabulate(variants(names))


def tabulate(shapes: tuple[Primitive, ...]) -> Tables:
    """Return the term table of `shapes`, one row each."""
    if any(len(shape.planes) > MAX_PLANES for shape in shapes):
        raise ValueError(
            f"expected at most {MAX_PLANES} planes a primitive; raise kernel.MAX_PLANES for more"
        )
    factors, targets, powers, first_term = [], [], [], [0]
    for shape in shapes:
        for j, plane in enumerate(shape.planes):
            for coefficient, expression in enumerate(plane):
                for factor, power in formula(expression).terms:
                    factors.append(factor)
                    targets.append(3 * j + coefficient)
                    powers.append(power)
        first_term.append(len(factors))
    votes = [shape.vote or Vote(0, (), ()) for shape in shapes]
    return Tables(
        size=np.array([shape.theta_size for shape in shapes]),
        planes=np.array([len(shape.planes) for shape in shapes]),
        ends=list_ends(shapes),
        strips=np.array([shape.strips for shape in shapes]),
        first_term=np.array(first_term),
        factor=np.array(factors, float),
        target=np.array(targets),
        power=np.array(powers),
        turns=np.array([vote.turns for vote in votes]),
        slopes=pad_rows([vote.slopes for vote in votes]),
        shifts=pad_rows([vote.shifts for vote in votes]),
    )


def list_ends(shapes: tuple[Primitive, ...]) -> np.ndarray:
    """Return where the planes of each minimum end (T, k).

    The last is repeated where there are fewer.
    """
    rows = [np.cumsum(shape.minima or (len(shape.planes),)) for shape in shapes]
    longest = max(len(row) for row in rows)
    return np.array([np.pad(row, (0, longest - len(row)), "edge") for row in rows])


def pad_rows(rows: list[tuple[float, ...]]) -> np.ndarray:
    """Return `rows` as one array, NaN where a row is shorter than the longest."""
    result = np.full((len(rows), max(len(row) for row in rows)), np.nan)
    for k, row in enumerate(rows):
        result[k, : len(row)] = row
    return result


@cache
def bounds(names: tuple[str, ...] = tuple(CATALOGUE)) -> tuple[np.ndarray, np.ndarray]:
    """Return the box of theta for every variant: (low, high), each (T, 9).

    q0 is left to the data.
    """
    shapes = variants(names)
    lower, upper = np.full((len(shapes), SIZE), -np.inf), np.full((len(shapes), SIZE), np.inf)
    lower[:, : len(PLAN_LOW)], upper[:, : len(PLAN_HIGH)] = PLAN_LOW, PLAN_HIGH
    for t, shape in enumerate(shapes):
        for k, (smallest, largest) in enumerate(shape.bounds):
            lower[t, 6 + k], upper[t, 6 + k] = smallest, largest
    return lower, upper
