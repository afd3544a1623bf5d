"""Planes of a roof as formulas: sums of monomials in its shape parameters.

`q0 - q1 * V + q2 * U` builds a `Formula`, a sum of terms factor * V^a U^b q0^c q1^d q2^e q3^f with
integer (also negative) exponents. The compiled fit reads the terms, so that one kernel evaluates
the planes of every primitive, and their exact derivatives, without knowing any of them.
"""

from __future__ import annotations

import operator
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

SYMBOLS = ("V", "U", "q0", "q1", "q2", "q3")


@dataclass(frozen=True)
class Formula:
    """A sum of monomials: `terms` maps exponents of SYMBOLS to the factor.

    >>> (2 * V - q1 * V / q2).at((3.0, 0.0, 0.0, 1.0, 2.0, 0.0))
    4.5
    """

    terms: tuple[tuple[float, tuple[int, ...]], ...]

    def at(self, shape: Sequence[Any] | np.ndarray) -> Any:
        """Return the value at V, U, q0, q1, q2, q3: (6,), or arrays (m,) of these."""
        total: Any = 0.0
        for factor, powers in self.terms:
            value: Any = factor
            for size, power in zip(shape, powers, strict=True):
                if power:
                    value = value * (size if power == 1 else size**power)
            total = total + value
        return total

    def gradient(self, shape: Sequence[float] | np.ndarray) -> np.ndarray:
        """Return the derivatives (6,) with respect to SYMBOLS at `shape` (6,)."""
        return np.array([derivative.at(shape) for derivative in self.derivatives])

    @property
    def rises(self) -> bool:
        """Whether a sum of terms of one sign is positive where all symbols are."""
        return self.terms[0][0] > 0

    @cached_property
    def derivatives(self) -> tuple[Formula, ...]:
        """The six partial derivatives."""
        result = []
        for k in range(len(SYMBOLS)):
            lowered = ((f * p[k], p[:k] + (p[k] - 1,) + p[k + 1 :]) for f, p in self.terms if p[k])
            result.append(Formula(tuple(lowered)))
        return tuple(result)

    def __add__(self, other: Formula | float) -> Formula:
        return add_terms(self.terms + formula(other).terms)

    def __mul__(self, other: Formula | float) -> Formula:
        if not isinstance(other, Formula):
            number = float(other)
            return Formula(tuple((f * number, powers) for f, powers in self.terms if number))
        return add_terms(
            (factor * other_factor, tuple(map(operator.add, powers, other_powers)))
            for factor, powers in self.terms
            for other_factor, other_powers in other.terms
        )

    def __truediv__(self, other: Formula | float) -> Formula:
        """Divide by one monomial; a sum as the denominator raises ValueError."""
        (term,) = formula(other).terms
        return self * Formula(((1 / term[0], tuple(-power for power in term[1])),))

    def __neg__(self) -> Formula:
        return self * -1.0

    def __sub__(self, other: Formula | float) -> Formula:
        return self + -formula(other)

    def __rsub__(self, other: float) -> Formula:
        return formula(other) - self

    __radd__ = __add__
    __rmul__ = __mul__


def add_terms(terms: Iterable[tuple[float, tuple[int, ...]]]) -> Formula:
    """Add terms: those of the same exponents become one, or none where it is 0."""
    total: dict[tuple[int, ...], float] = {}
    for factor, powers in terms:
        total[powers] = total.get(powers, 0.0) + factor
    return Formula(tuple((factor, powers) for powers, factor in total.items() if factor))


def formula(value: Formula | float) -> Formula:
    """Convert `value` to a Formula; a number becomes a constant."""
    if isinstance(value, Formula):
        return value
    return Formula(((float(value), (0,) * len(SYMBOLS)),) if value else ())


V, U, q0, q1, q2, q3 = (
    Formula(((1.0, tuple(int(i == k) for i in range(len(SYMBOLS)))),)) for k in range(len(SYMBOLS))
)
