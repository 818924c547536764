"""Machine code of tapes, compiled once and cached on disk under a key of its inputs.

The code generators (:mod:`henon_ref.taylor.llvm`) are imported only if something has to be compiled.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

from henon_ref.jit.native_module import NativeModule, source_hash
from henon_ref.taylor.tape import Tape


@dataclass(frozen=True, eq=False)
class Part:
    """One function of a native module; parts with equal keys are equal."""

    kind: str
    """Key of :func:`_writers`."""
    arguments: tuple[Any, ...]

    @cached_property
    def key(self) -> str:
        """Everything that the code depends on; of a tape's constants their number, not their values."""
        known = ((a.nodes, len(a.constants), a.field, a.outputs) if isinstance(a, Tape) else a for a in self.arguments)
        return repr((self.kind, *known))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Part) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)


@lru_cache(maxsize=64)  # for systems that are built again
def machine_code(*parts: Part, optimised: bool = True, simplified: bool | None = None) -> NativeModule:
    """Return the native module of some functions; equal parts give the same module.

    ``optimised``, ``simplified``: see :class:`henon_ref.jit.native_module.NativeModule`.
    """

    def written() -> str:
        from henon_ref.jit.ir_writer import declarations

        writers = _writers()
        return declarations() + "".join(writers[part.kind](*part.arguments) for part in parts)

    sources = source_hash("taylor/*.py", "taylor/llvm/*.py", "jit/*.py", "kernel/kernel.h")
    key = "\n".join([sources, *(part.key for part in parts)])
    return NativeModule(written, optimised=optimised, simplified=simplified, key=key)


def _writers() -> dict[str, Any]:
    from henon_ref.taylor.llvm.expansion import expansion_ir, lanes_expansion_ir, values_ir
    from henon_ref.taylor.llvm.looped import looped_expansion_ir
    from henon_ref.taylor.llvm.rounding import rounding_ir
    from henon_ref.taylor.llvm.step import looped_step_end_ir, step_end_ir

    return {
        "expansion": expansion_ir,
        "looped expansion": looped_expansion_ir,
        "lanes": lanes_expansion_ir,
        "step end": step_end_ir,
        "looped step end": looped_step_end_ir,
        "rounding": rounding_ir,
        "values": values_ir,
    }
