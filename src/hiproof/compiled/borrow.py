"""Borrow the arrays of a tuple: compiled code does not count references to them.

Each function that takes a tuple of arrays counts one reference more to each, and one less where it
returns. In small functions of inner loops that took a quarter of a roof's fit.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.extending import intrinsic, overload


def borrow(rows: Any) -> Any:
    """Return a tuple with the same arrays, which whoever calls keeps alive.

    >>> borrow((1, 2))
    (1, 2)
    """
    return rows


@overload(borrow)
def compile_borrow(rows):
    return lambda rows: drop_owners(rows)


@intrinsic
def drop_owners(_, rows):
    """Take what owns its memory from each array of a tuple, and of tuples in it."""

    def build(context, builder, signature, args):
        return drop(context, builder, signature.args[0], args[0])

    return rows(rows), build


def drop(context, builder, kind, value):
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value)
        array.meminfo = array.meminfo.type(None)  # a null pointer
        return array._getvalue()
    for k, inner in enumerate(kind.types if isinstance(kind, types.BaseTuple) else ()):
        part = drop(context, builder, inner, builder.extract_value(value, k))
        value = builder.insert_value(value, part, k)
    return value
