"""Wrappers of compiled functions, compiled only when Python calls them.

numba makes a wrapper for every function. It unpacks each array of each argument, which took a
third of the time to compile. Most functions are only called by other compiled functions, and need
none.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import llvmlite.binding as llvm
from numba.core import sigutils, typing
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher

from .kept import Kept
from .linking import make_pipeline, without_literals


class Dispatcher(CPUDispatcher):
    """numba's dispatcher of a function whose code is `kept`."""

    _cache: Kept

    def __init__(self, function: Callable, kept: Kept, options: dict[str, Any]):
        options = {"nopython": True, "boundscheck": None, "no_cpython_wrapper": True} | options
        super().__init__(function, targetoptions=options, pipeline_class=make_pipeline(kept.stamp))
        self._cache = kept
        self.entries: dict[tuple, Any] = {}

    def load(self, signature: Any) -> None:
        """Load the function's code for compiled callers, from disk or compiled."""
        args = tuple(sigutils.normalize_signature(signature)[0])
        with global_compiler_lock:
            if args in self.overloads:
                return
            result = self._cache.load(signature, self.targetctx)
            if result is None:
                super().compile(signature)
                return
            self.targetctx.insert_user_function(result.entry_point, result.fndesc, [result.library])
            self.add_overload(result)
            self._cache_hits[signature] += 1

    def get_call_template(self, args: tuple, kws: dict) -> tuple:
        """Answer numba's question, when it compiles a caller, what a call returns."""
        python_signature, args = self._compiler.fold_argument_types(*without_literals(args, kws))
        self.load(tuple(args))
        name = self.py_func.__name__
        template = typing.make_concrete_template(name, name, self.nopython_signatures)
        return template, python_signature, args, {}

    def add_overload(self, result: Any) -> None:
        """Let compiled functions call the code; Python finds it with its wrapper only."""
        self.overloads[tuple(result.signature.args)] = result

    def compile(self, sig: Any) -> Any:
        """Return what Python calls for arguments of these types."""
        args = tuple(sigutils.normalize_signature(sig)[0])
        with global_compiler_lock:
            if args not in self.entries:
                self.load(sig)
                self.entries[args] = self.make_entry(sig, self.overloads[args])
                self._insert([kind._code for kind in args], self.entries[args], False)
            return self.entries[args]

    def make_entry(self, signature: Any, result: Any) -> Any:
        """Make the entry of a function for calls from Python.

        Its wrapper is read from disk or compiled.
        """
        context = self.targetctx.subtarget(enable_nrt=self.targetoptions.get("_nrt", True))
        described, environment = result.fndesc, result.environment
        if wrapper := self._cache.load_wrapper(signature, context):
            environment.consts[:], machine_code = wrapper
            codegen = context.codegen()
            codegen._engine._ee.add_object_file(llvm.ObjectFileRef.from_data(machine_code))
            codegen._engine._defined_symbols.add(described.llvm_cpython_wrapper_name)
            return context.get_executable(result.library, described, environment)
        context.refresh()
        library = context.codegen().create_library(described.llvm_cpython_wrapper_name)
        library.enable_object_caching()
        with context.push_code_library(library):
            context.create_cpython_wrapper(library, described, environment, None)
        entry = context.get_executable(library, described, environment)
        self._cache.save_wrapper(signature, context, library, environment.consts)
        return entry
