"""numba's runtime, which counts references to arrays, as machine code.

numba compiles it in every process. That takes 30 MB, which LLVM never gives back.
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding as llvm
from numba.core.runtime import _nrt_python, rtsys

from .loading import Loaded


def is_started() -> bool:
    return rtsys._init


def compile_runtime(context: Any) -> tuple[bytes, bytes, list[str]]:
    """Start the runtime as numba does. Returns what `start` needs in another process."""
    rtsys.initialize(context)
    module = rtsys.library._get_module_for_linking()
    names = [function.name for function in module.functions if not function.is_declaration]
    codegen = context.codegen()
    return codegen._tm.emit_object(rtsys.library._final_module), module.as_bitcode(), names


def start(context: Any, machine_code: bytes, bitcode: bytes, names: list[str]) -> None:
    """Start the runtime with code that another process compiled."""
    for name, address in _nrt_python.c_helpers.items():
        llvm.add_symbol(name if name.startswith("_") else f"NRT_{name}", address)
    codegen = context.codegen()
    codegen._engine._defined_symbols.update(names)
    rtsys._library = Loaded(codegen, "nrt", machine_code, bitcode)
    rtsys._init = True
