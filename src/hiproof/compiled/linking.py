"""Large functions are called by other compiled functions, not copied into them.

numba links a function's code into every caller's, where LLVM optimises all of it once more. Of what
is too large to be inlined nothing comes of that but time: here a caller gets an empty module in its
place, and the address when it is loaded. So a function's symbol has to be the same in whatever
process it was compiled (its stamp is in it), and what a function calls has to be loaded before it.
Functions are compiled with the passes of numba that they need.
"""

from __future__ import annotations

import itertools
import uuid
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any, NamedTuple

import llvmlite.binding as llvm
from numba.core import (
    bytecode,
    compiler,
    compiler_machinery,
    typed_passes,
    types,
    untyped_passes,
)

from . import references
from .typing_memory import Remembering

# numba numbers the functions of its own library from 1 in every process, and the numbers stand in
# their symbols: code that two processes kept would meet in a third with one symbol for two
# functions.
bytecode.FunctionIdentity._unique_ids = itertools.count(uuid.uuid4().int >> 80)

# What numba does to functions without closures, generators, objects and literal arguments.
PASSES = (
    untyped_passes.TranslateByteCode,
    untyped_passes.FixupArgs,
    untyped_passes.IRProcessing,
    untyped_passes.GenericRewrites,
    untyped_passes.ReconstructSSA,
    typed_passes.NopythonTypeInference,
    typed_passes.PreLowerStripPhis,
    typed_passes.NopythonRewrites,
    typed_passes.IRLegalization,
    references.Lowering,
    typed_passes.NoPythonBackend,
)

LARGE = 80  # instructions; LLVM inlines fewer


class Callee(NamedTuple):
    """A large function that a caller's code refers to by its symbol."""

    module: str
    name: str
    signature: Any

    def load(self) -> None:
        """Have its code in this process, from disk or compiled."""
        getattr(import_module(self.module), self.name).load(self.signature)


def make_pipeline(stamp: str) -> type[compiler.Compiler]:
    """Make numba's compiler for functions of a source file.

    The file's `stamp` is part of their symbols.
    """

    class Stamped(compiler.Compiler):
        def compile_extra(self, function: Callable) -> Any:
            self.state.func_id = identity = bytecode.FunctionIdentity.from_function(function)
            identity.unique_id = stamp
            identity.unique_name = f"{identity.func_qualname}${stamp}"
            compiler.ExtractByteCode().run_pass(self.state)
            self.state.lifted, self.state.lifted_from = (), None
            self.state.type_annotation = ""  # is for people who look into numba
            self.state.typingctx = Remembering(self.state.typingctx, self.state.flags)
            return self._compile_bytecode()

        def define_pipelines(self) -> list[compiler_machinery.PassManager]:
            passes = compiler_machinery.PassManager("plain")
            for step in PASSES:
                passes.add_pass(step, step.__name__)
            passes.finalize()
            return [passes]

    return Stamped


def without_literals(args: tuple, kws: dict) -> tuple[tuple, dict]:
    """Drop constants from the types of a call.

    So nothing is compiled apart for them.
    """
    names = {name: types.unliteral(kind) for name, kind in kws.items()}
    return tuple(map(types.unliteral, args)), names


def settle(result: Any, function: Callable, signature: Any) -> None:
    """Record which large functions the code of a compiled `result` calls.

    If it is large itself, callers will call it instead of copying it.
    """
    library = result.library
    library.calls, library.is_called_as = tuple(dict.fromkeys(called_by(library))), None
    if is_large(library.get_function(result.fndesc.mangled_name)):
        library.is_called_as = Callee(function.__module__, function.__qualname__, signature)
        library._shared_module = llvm.parse_assembly(
            str(library.codegen._create_empty_module(library.name))
        )


def links(result: Any) -> tuple[tuple[Callee, ...], Callee | None]:
    """Return what has to be kept of a settled result beside its code."""
    return result.library.calls, result.library.is_called_as


def called_by(library: Any) -> Iterator[Callee]:
    """Yield the large functions to which a library's code refers.

    It refers to them by itself or in what was copied into it.
    """
    for linked in library._linking_libraries:
        callee = getattr(linked, "is_called_as", None)
        yield from getattr(linked, "calls", ()) if callee is None else (callee,)


def is_large(function: Any) -> bool:
    instructions = (1 for block in function.blocks for _ in block.instructions)
    return next(itertools.islice(instructions, LARGE, None), None) is not None
