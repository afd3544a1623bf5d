"""Tuples that Python gives to compiled functions, which hand each other the address.

A function that takes a tuple gets each number of each array (some hundred for a roof), and counts a
reference to each array. In small functions, as the search of roofs has, that took a third of the
time. So of tuples with names compiled code gets the address: whoever calls keeps them until it
returns. A part of one of their arrays must be copied before it is returned to Python.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_cast,
    lower_getattr_generic,
    models,
    register_model,
    unbox,
)


class Borrowed(types.Type):
    """The address of a tuple of the type `rows`."""

    def __init__(self, rows: types.BaseNamedTuple):
        self.rows = rows
        super().__init__(f"Borrowed({rows})")

    def find_field(self, name: str) -> tuple[int, types.Type]:
        """Return the number of a field, and the type that reading it gives."""
        number = self.rows.fields.index(name)
        return number, borrow(self.rows.types[number])

    def can_convert_to(self, typingctx: Any, other: types.Type) -> Conversion | None:
        """Say that a name may stand for it, and for such a tuple that compiled code made."""
        return Conversion.safe if other == self.rows else None


@register_model(Borrowed)
class BorrowedModel(models.PrimitiveModel):
    """An address."""

    def __init__(self, manager: Any, kind: Borrowed):
        rows = manager.lookup(kind.rows).get_value_type()
        super().__init__(manager, kind, rows.as_pointer())


def borrow(kind: types.Type) -> types.Type:
    """Return the type that compiled code gets for what Python gives: few numbers stay a tuple."""
    has_names = isinstance(kind, types.BaseNamedTuple)
    return Borrowed(kind) if has_names and any(map(has_arrays, kind.types)) else kind


def has_arrays(kind: types.Type) -> bool:
    return isinstance(kind, types.Array) or borrow(kind) is not kind


@unbox(Borrowed)
def take_address(kind, rows, c):
    native = c.unbox(kind.rows, rows)
    address = cgutils.alloca_once_value(c.builder, native.value)

    def give_back() -> None:
        if native.cleanup is not None:
            native.cleanup()
        c.context.nrt.decref(c.builder, kind.rows, native.value)

    return NativeValue(address, is_error=native.is_error, cleanup=give_back)


@infer_getattr
class BorrowedFields(AttributeTemplate):
    """Fields of a borrowed tuple."""

    key = Borrowed

    def generic_resolve(self, kind: Borrowed, name: str) -> types.Type:
        return kind.find_field(name)[1]


@lower_getattr_generic(Borrowed)
def read_field(context, builder, kind, address, name):
    number, field = kind.find_field(name)
    place = cgutils.gep_inbounds(builder, address, 0, number)
    return place if isinstance(field, Borrowed) else read(context, builder, place, field)


@lower_cast(Borrowed, types.BaseNamedTuple)
def read_rows(context, builder, kind, rows, address):
    return read(context, builder, address, rows)


def read(context, builder, place, kind):
    """Read a value; nobody counts references to its arrays: they have no owner."""
    value = load(builder, place, context.get_value_type(kind))
    return drop_owners(context, builder, kind, value)


def drop_owners(context, builder, kind, value):
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value)
        array.meminfo = array.meminfo.type(None)  # a null pointer
        return array._getvalue()
    for k, inner in enumerate(kind.types if isinstance(kind, types.BaseTuple) else ()):
        part = drop_owners(context, builder, inner, builder.extract_value(value, k))
        value = builder.insert_value(value, part, k)
    return value


def load(builder: ir.IRBuilder, place: Any, kind: ir.Type) -> Any:
    """Load a value number by number, each of which stays what it is."""
    if isinstance(kind, ir.Aggregate):
        value = ir.Constant(kind, ir.Undefined)
        for k, inner in enumerate(kind.elements):
            part = load(builder, cgutils.gep_inbounds(builder, place, 0, k), inner)
            value = builder.insert_value(value, part, k)
        return value
    number = builder.load(place)
    number.set_metadata("invariant.load", builder.module.add_metadata([]))
    return number
