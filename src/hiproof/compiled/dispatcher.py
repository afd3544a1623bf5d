"""Functions whose code is kept; the one file that uses numba beyond `njit`.

numba links a function's code into every caller's, where LLVM optimises all of it once more. Here a
caller of a large function refers to it by its symbol. So a function's symbol is the same in
whatever process it was compiled, and what a function calls is loaded before it. numba also makes a
wrapper for calls from Python, which unpacks each array of each argument. Here it is made for the
functions that Python calls.

What is used of numba, apart from names of its documentation:

- `CPUDispatcher`: its methods `get_call_template` (a compiled function asks what a call returns),
  `compile` (Python asks for what it calls) and `add_overload` are replaced;
- of a target's context `insert_user_function` and `remove_user_function`, which say what callers
  link; `create_cpython_wrapper` and `get_executable`, which make what Python calls;
- of a code library `serialize_using_object_code` and `unserialize_library`;
- `CompileResult._reduce` and `_rebuild`: what numba's own cache keeps of a function;
- `FunctionIdentity._unique_ids`: numba numbers the functions of its own library from 1 in every
  process, and the numbers are part of their symbols. Code of two processes would meet in a third
  with one symbol for two functions, so each compilation starts from a random number.
"""

from __future__ import annotations

import itertools
import uuid
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import llvmlite.binding as llvm
from numba import types
from numba.core import bytecode, compiler, sigutils, typing
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.compiler_lock import global_compiler_lock
from numba.core.cpu import CPUContext
from numba.core.registry import CPUDispatcher
from numba.core.runtime import rtsys

from . import news
from .borrow import borrow
from .kept import Kept, place_to_write
from .stamp import compute_stamp

LARGE = 80  # instructions; LLVM inlines fewer
EMPTY_MODULE = llvm.parse_assembly("").as_bitcode()  # what callers copy of a large function
OPTIONS = {
    "nopython": True,
    "error_model": "numpy",
    "boundscheck": None,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
}
NEEDED = (  # beyond what is used below at once
    CPUDispatcher.get_call_template,
    CPUDispatcher.add_overload,
    CPUContext.insert_user_function,
    CPUContext.remove_user_function,
    CPUContext.create_cpython_wrapper,
    CPUContext.get_executable,
    JITCodeLibrary.serialize_using_object_code,
    JITCPUCodegen.unserialize_library,
)
REDUCE, REBUILD = compiler.CompileResult._reduce, compiler.CompileResult._rebuild
COUNTER = bytecode.FunctionIdentity._unique_ids


class Callee(NamedTuple):
    """A large function that a caller's code refers to by its symbol."""

    module: str
    name: str
    args: tuple

    def load(self) -> None:
        """Have its code in this process, from disk or compiled."""
        getattr(import_module(self.module), self.name).load(self.args)


# The large functions that are called by those being compiled, the innermost last.
CALLS: list[dict[Callee, None]] = [{}]


class Compiler(compiler.Compiler):
    """numba's compiler, with symbols that hold the stamp of a function's sources."""

    def define_pipelines(self) -> list:
        identity = self.state.func_id
        identity.unique_id = compute_stamp(Path(identity.filename))
        identity.unique_name = f"{identity.func_qualname}${identity.unique_id}"
        return list(super().define_pipelines())


class Dispatcher(CPUDispatcher):
    """numba's dispatcher of a function whose code is kept."""

    def __init__(self, function: Callable):
        super().__init__(function, targetoptions=OPTIONS, pipeline_class=Compiler)
        file = Path(function.__code__.co_filename)
        self.kept = Kept(file, function.__qualname__, compute_stamp(file))
        self.entries: dict[tuple, Any] = {}
        self.callees: dict[tuple, tuple[Callee, ...]] = {}

    def load(self, args: tuple) -> None:
        """Load the code for compiled callers, from disk or compiled."""
        with global_compiler_lock:
            if args not in self.overloads and not self.read(args):
                self.compile_code(args)
            news.ready.add(f"{self.py_func.__module__}.{self.py_func.__qualname__}")

    def read(self, args: tuple) -> bool:
        """Load the code from disk; return whether it was there."""
        rtsys.initialize(self.targetctx)
        for is_large, callees, code in self.kept.read("", self.key(args)):
            for callee in callees:
                callee.load()
            try:
                result = REBUILD(self.targetctx, *code)
            except Exception:  # damaged inside
                continue
            self.insert(result, is_large, callees)
            return True
        return False

    def compile_code(self, args: tuple) -> None:
        """Compile the function, and keep its code."""
        place_to_write(self.kept.folders)  # warns before it takes minutes
        news.tell()
        bytecode.FunctionIdentity._unique_ids = itertools.count(uuid.uuid4().int >> 80)
        CALLS.append({})
        try:
            super().compile(args)
        finally:
            callees = tuple(CALLS.pop())
        result = self.overloads[args]
        function = result.library.get_function(result.fndesc.mangled_name)
        is_large = sum(1 for block in function.blocks for _ in block.instructions) >= LARGE
        self.targetctx.remove_user_function(result.entry_point)
        self.insert(result, is_large, callees)
        if not result.library.has_dynamic_globals:  # addresses of this process: not to be kept
            (*library, (machine_code, bitcode)), *rest = REDUCE(result._replace(type_annotation=""))
            code = (*library, (machine_code, EMPTY_MODULE if is_large else bitcode)), *rest
            self.kept.write("", self.key(args), is_large, callees, code)
        news.tell()

    def insert(self, result: Any, is_large: bool, callees: tuple[Callee, ...]) -> None:
        """Let compiled functions call the code: by its symbol, or by copying it."""
        libraries = [] if is_large else [result.library]
        self.targetctx.insert_user_function(result.entry_point, result.fndesc, libraries)
        args = tuple(result.signature.args)
        self.overloads[args] = result
        function = self.py_func
        itself = Callee(function.__module__, function.__qualname__, args)
        self.callees[args] = (itself,) if is_large else callees

    def key(self, args: tuple) -> tuple:
        """Return what code is kept for: types of arguments, and the processor."""
        return args, self.targetctx.codegen().magic_tuple()

    def get_call_template(self, args: tuple, kws: dict) -> tuple:
        """Tell numba what a call returns; constants in it have nothing compiled apart."""
        args = tuple(map(types.unliteral, args))
        kws = {name: types.unliteral(kind) for name, kind in kws.items()}
        python_signature, args = self.fold_argument_types(args, kws)
        self.load(tuple(args))
        CALLS[-1].update(dict.fromkeys(self.callees[tuple(args)]))
        name = self.py_func.__name__
        template = typing.make_concrete_template(name, name, self.nopython_signatures)
        return template, python_signature, args, {}

    def add_overload(self, result: Any) -> None:
        """Let only compiled functions find what was compiled, which has no wrapper."""
        self.overloads[tuple(result.signature.args)] = result

    def compile(self, signature: Any) -> Any:
        """Return what Python calls for arguments of these types."""
        args = tuple(sigutils.normalize_signature(signature)[0])
        with global_compiler_lock:
            if args not in self.entries:
                taken = tuple(map(borrow, args))
                self.load(taken)
                result = self.overloads[taken]
                self.entries[args] = self.make_entry(taken, result)
                given = typing.signature(result.signature.return_type, *args)
                super().add_overload(
                    result._replace(entry_point=self.entries[args], signature=given)
                )
                del self.overloads[args]
                self.overloads[taken] = result
            return self.entries[args]

    def make_entry(self, args: tuple, result: Any) -> Any:
        """Return the entry for calls from Python, with its wrapper."""
        context = self.targetctx.subtarget(enable_nrt=True)
        described, environment = result.fndesc, result.environment
        for constants, code in self.kept.read("-python", self.key(args)):
            library = context.codegen().unserialize_library(code)
            environment.consts[:] = constants
            return context.get_executable(library, described, environment)
        context.refresh()
        library = context.codegen().create_library(described.llvm_cpython_wrapper_name)
        library.enable_object_caching()
        with context.push_code_library(library):
            context.create_cpython_wrapper(library, described, environment, None)
        entry = context.get_executable(library, described, environment)
        if not library.has_dynamic_globals:
            code = library.serialize_using_object_code()
            self.kept.write("-python", self.key(args), environment.consts, code)
        return entry
