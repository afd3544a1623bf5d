"""Compiled functions made of what was kept of them, without a compiler."""

from __future__ import annotations

from typing import Any

import llvmlite.binding as llvm
from numba.core import compiler
from numba.core.codegen import CPUCodeLibrary, JITCodeLibrary

from .linking import Callee


class Loaded(JITCodeLibrary):
    """numba's library of a function that was compiled before.

    It has machine code as it is. What callers would copy of it is read when one is compiled.
    """

    _shared_module: Any

    def __init__(self, codegen: Any, name: str, machine_code: bytes, bitcode: bytes):
        super(CPUCodeLibrary, self).__init__(codegen, name)  # a LLVM module is only for compiling
        self._linking_libraries: list[Any] = []
        self._final_module = self._shared_module = None
        self.bitcode = bitcode
        codegen._engine._ee.add_object_file(llvm.ObjectFileRef.from_data(machine_code))
        self._finalized = self._disable_inspection = True

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None:
            self._shared_module = llvm.parse_bitcode(self.bitcode)
        return self._shared_module


def rebuild(
    context: Any, code: tuple, calls: tuple[Callee, ...], is_called_as: Callee | None
) -> Any:
    """Rebuild the result of compiling from what was kept of it, after what it calls."""
    for callee in calls:
        callee.load()
    (
        (name, _, selection),
        described,
        constants,
        signature,
        objectmode,
        lifted,
        _,
        _,
        environments,
    ) = code
    codegen = context.codegen()
    codegen._engine._defined_symbols.add(described.llvm_func_name)
    library = Loaded(codegen, name, *selection)
    library.calls, library.is_called_as = calls, is_called_as
    for environment in environments:
        codegen.set_env(environment.env_name, environment)
    return compiler.compile_result(
        target_context=context,
        typing_context=context.typing_context,
        library=library,
        environment=constants,
        entry_point=library,  # a key of numba's; what Python calls is made when it calls
        fndesc=described,
        signature=signature,
        objectmode=objectmode,
        lifted=lifted,
        type_annotation=None,
        referenced_envs=environments,
    )
