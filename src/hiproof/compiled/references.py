"""References are counted of what holds any.

numba reads all fields of a variable in its code to count references to those that are arrays: the
nine of an array, 180 of the search's scene, a quarter of all instructions that it writes. It also
deletes numbers. Here neither is written, and the machine code stays the same.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

from numba.core import compiler_machinery, ir, lowering, typed_passes
from numba.core.runtime.context import NRTContext

HOLD: dict[Any, bool] = {}
"""Which types hold references."""


def holds_references(context: Any, kind: Any) -> bool:
    if kind not in HOLD:
        HOLD[kind] = context.data_model_manager[kind].contains_nrt_meminfo()
    return HOLD[kind]


class References(NRTContext):
    """numba's counting of references, which reads only fields that hold any."""

    def get_meminfos(self, builder: Any, ty: Any, val: Any) -> list[tuple]:
        """Return a type and a counter for each reference in a value."""
        if not holds_references(self._context, ty):
            return []
        model = self._context.data_model_manager[ty]
        found = [(ty, model.get_nrt_meminfo(builder, val))] if model.has_nrt_meminfo() else []
        for kind, read in model.traverse(builder):
            if holds_references(self._context, kind):
                found += self.get_meminfos(builder, kind, read(val))
        return found


class Lower(lowering.Lower):
    """numba's lowering, with as few places in memory and counts of references as it can.

    A variable that has one value stands for this value, without a place in memory. Arguments are
    not counted: who calls holds them.
    """

    def _find_singly_assigned_variable(self) -> None:
        """Find the variables without a place in memory, which numba asks for."""
        super()._find_singly_assigned_variable()
        assigned = [x for block in self.blocks.values() for x in block.find_insts(ir.Assign)]
        counts = Counter(assign.target.name for assign in assigned)
        once = [assign for assign in assigned if counts[assign.target.name] == 1]
        self.arguments = {
            assign.target.name
            for assign in once
            if isinstance(assign.value, ir.Arg)
            and self.typeof(assign.target.name) == self.typeof("arg." + assign.value.name)
        }
        plain = {name for name, count in counts.items() if count == 1 and not self.counts(name)}
        self._singly_assigned_vars |= (plain - self.list_undefined()) | self.arguments

    def list_undefined(self) -> set[str]:
        """List the variables that a block may read before the one that sets them."""
        lifetime = self.func_ir.variable_lifetime
        dominators, usedefs = lifetime.cfg.dominators(), lifetime.usedefs
        names: set[str] = set()
        for place, used in usedefs.usemap.items():
            earlier = [b for b in dominators[place] if b < place]
            names |= used.difference(*(usedefs.defmap[block] for block in earlier))
        return names

    def counts(self, name: str) -> bool:
        return holds_references(self.context, self.typeof(name))

    def lower_assign(self, ty: Any, inst: Any) -> Any:
        """Return the value that a statement assigns."""
        if inst.target.name in self.arguments:
            return self.fnargs[inst.value.index]
        return super().lower_assign(ty, inst)

    def delvar(self, name: str) -> None:
        """Delete a variable where numba says so."""
        if name in self.arguments:
            return
        if self.counts(name):
            super().delvar(name)
        elif name not in self._blk_local_varmap:
            self._singly_assigned_vars.discard(name)


@compiler_machinery.register_pass(mutates_CFG=True, analysis_only=False)
class Lowering(typed_passes.NativeLowering):
    """numba's pass from types to LLVM, with what this file has."""

    _name = "hiproof_lowering"

    @property
    def lowering_class(self) -> type[Lower]:
        return Lower

    def run_pass(self, state: Any) -> bool:
        """Write a function's code for LLVM and compile it."""
        context = state.targetctx  # this function's alone
        context.nrt = References(context, context.enable_nrt)
        return bool(super().run_pass(state))
