"""Types of calls with numbers, found once a process.

numba looks through all templates of `+` or `max` at every place where one stands, which took a
tenth of the time to compile.
"""

from __future__ import annotations

from typing import Any

from numba.core import types, typing


class Remembering(typing.Context):
    """Remember what calls of functions with numbers return.

    This is numba's typing context for functions that are compiled with the same `options`.
    """

    __slots__ = ("original", "signatures")  # not in the dictionary, which is that of numba's own

    def __init__(self, context: typing.Context, options: Any):
        object.__setattr__(self, "__dict__", context.__dict__)
        self.original = context
        self.signatures = SIGNATURES.setdefault(options, {})

    def __eq__(self, other: object) -> bool:
        """Return whether both are one context of numba, which compiles by it."""
        return getattr(other, "original", other) is self.original

    def __hash__(self) -> int:
        return hash(self.original)

    def resolve_function_type(self, func: Any, args: tuple, kws: dict) -> Any:
        """Return the signature of a call, from memory where all arguments are numbers."""
        if kws or not isinstance(func, types.Function) or not all(map(is_number, args)):
            return super().resolve_function_type(func, args, kws)
        key = func, tuple(args)
        if key not in self.signatures:
            signature = super().resolve_function_type(func, args, kws)
            self.signatures[key] = signature, func.get_impl_key(signature)
        signature, implementation = self.signatures[key]
        func._impl_keys[signature.args] = implementation  # the one for these options
        return signature


SIGNATURES: dict[Any, dict[tuple, tuple]] = {}
"""Signatures and their implementations, by options, function and types of arguments."""


def is_number(kind: types.Type) -> bool:
    return isinstance(types.unliteral(kind), types.Number | types.Boolean)
