"""References are counted only for what holds any, and not for arguments.

numba reads all fields of a variable in its code to count references to those that are arrays: nine
of an array, 180 of the search's scene, together a sixth of all instructions. It keeps numbers and
arguments in memory, counts arguments although whoever calls holds them, and clears numbers after
use. LLVM removes most of that again, for as much time as it took to write.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

from numba.core import compiler_machinery, ir, lowering, typed_passes
from numba.core.runtime.context import NRTContext

COUNTED: dict[Any, bool] = {}
"""Whether values of a type hold references."""


def is_counted(context: Any, kind: Any) -> bool:
    """Return whether values of a type hold references."""
    if kind not in COUNTED:
        COUNTED[kind] = context.data_model_manager[kind].contains_nrt_meminfo()
    return COUNTED[kind]


class References(NRTContext):
    """Count references as numba does, reading only fields that hold any."""

    def get_meminfos(self, builder: Any, ty: Any, val: Any) -> list[tuple]:
        """Return a type and a counter for each reference in a value."""
        if not is_counted(self._context, ty):
            return []
        model = self._context.data_model_manager[ty]
        counters = [(ty, model.get_nrt_meminfo(builder, val))] if model.has_nrt_meminfo() else []
        for kind, read in model.traverse(builder):
            if is_counted(self._context, kind):
                counters += self.get_meminfos(builder, kind, read(val))
        return counters


class Lower(lowering.Lower):
    """Translate to LLVM as numba does, with fewer places in memory.

    A number or an argument that is assigned at one place stands for its value.
    """

    def _find_singly_assigned_variable(self) -> None:
        """Find the variables without a place in memory, as numba asks for."""
        super()._find_singly_assigned_variable()
        assigns = [x for block in self.blocks.values() for x in block.find_insts(ir.Assign)]
        counts = Counter(assign.target.name for assign in assigns)
        single = {name for name, count in counts.items() if count == 1}
        self.arguments = {
            assign.target.name
            for assign in assigns
            if isinstance(assign.value, ir.Arg)
            and assign.target.name in single
            and self.typeof(assign.target.name) == self.typeof("arg." + assign.value.name)
        }
        numbers = {name for name in single if not is_counted(self.context, self.typeof(name))}
        self._singly_assigned_vars |= (numbers - self.list_undefined()) | self.arguments

    def list_undefined(self) -> set[str]:
        """List the variables that a block may read before they are assigned.

        A single assignment must dominate the block, and be translated sooner.
        """
        lifetime = self.func_ir.variable_lifetime
        dominators, usedefs = lifetime.cfg.dominators(), lifetime.usedefs
        names: set[str] = set()
        for place, reads in usedefs.usemap.items():
            dominating = [block for block in dominators[place] if block < place]
            names |= reads.difference(*(usedefs.defmap[block] for block in dominating))
        return names

    def lower_assign(self, ty: Any, inst: Any) -> Any:
        """Return the value that a statement assigns."""
        if inst.target.name in self.arguments:
            return self.fnargs[inst.value.index]
        return super().lower_assign(ty, inst)

    def delvar(self, name: str) -> None:
        """Count one reference less to a variable that is used no more."""
        if name in self.arguments:
            return
        if is_counted(self.context, self.typeof(name)):
            super().delvar(name)
        elif name not in self._blk_local_varmap:
            self._singly_assigned_vars.discard(name)


@compiler_machinery.register_pass(mutates_CFG=True, analysis_only=False)
class Lowering(typed_passes.NativeLowering):
    """Translate a function to LLVM and compile it, with what this file has."""

    _name = "hiproof_lowering"

    @property
    def lowering_class(self) -> type[Lower]:
        return Lower

    def run_pass(self, state: Any) -> bool:
        """Translate the function of a `state` of numba's compiler."""
        context = state.targetctx  # of this function alone
        context.nrt = References(context, context.enable_nrt)
        return bool(super().run_pass(state))
