"""Machine code of tapes: written and compiled the first time, then read from the disk by what it is made from.

The programs that write it (:mod:`henon_ref.taylor.llvm`) are loaded only where something is to be compiled.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from henon_ref.jit.native_module import NativeModule, source_hash
from henon_ref.taylor.tape import Tape

KEPT = 64
"""Pieces of machine code that are remembered by what they are made from, for systems that are made anew."""
SOURCES = ("taylor/*.py", "taylor/llvm/*.py", "jit/*.py", "kernel/kernel.h")
"""What the code depends on, apart from tapes."""


class Part(NamedTuple):
    """One function of a piece of code."""

    kind: str
    """A key of :func:`_writers`."""
    arguments: tuple[Any, ...]
    """Of the function there."""

    @property
    def key(self) -> str:
        """Everything that its code depends on: of a tape how many constants it has, not which."""
        known = ((a.nodes, len(a.constants), a.field, a.outputs) if isinstance(a, Tape) else a for a in self.arguments)
        return repr((self.kind, *known))


def machine_code(parts: Sequence[Part], *, optimised: bool = True, simplified: bool | None = None) -> NativeModule:
    """The code of some functions; the same for equal ones.

    Parameters
    ----------
    parts : sequence of Part
    optimised, simplified
        See :class:`henon_ref.jit.native_module.NativeModule`.
    """
    return _machine_code(_Recipe("\n".join(part.key for part in parts), tuple(parts)), optimised, simplified)


class _Recipe:
    """Some parts, which are equal where their key is."""

    def __init__(self, key: str, parts: tuple[Part, ...]) -> None:
        self.key, self.parts = key, parts

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Recipe) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)

    def written(self) -> str:
        """LLVM IR."""
        from henon_ref.jit.ir_writer import declarations

        writers = _writers()
        return declarations() + "".join(writers[part.kind](*part.arguments) for part in self.parts)


@lru_cache(maxsize=KEPT)
def _machine_code(recipe: _Recipe, optimised: bool, simplified: bool | None) -> NativeModule:
    key = f"{source_hash(*SOURCES)}\n{recipe.key}"
    return NativeModule(recipe.written, optimised=optimised, simplified=simplified, key=key)


def _writers() -> dict[str, Any]:
    """What writes each kind of part."""
    from henon_ref.taylor.llvm.expansion import expansion_ir, values_ir
    from henon_ref.taylor.llvm.looped import looped_expansion_ir
    from henon_ref.taylor.llvm.rounding import rounding_ir
    from henon_ref.taylor.llvm.step_end import looped_step_end_ir, step_end_ir

    return {
        "expansion": expansion_ir,
        "looped expansion": looped_expansion_ir,
        "step end": step_end_ir,
        "looped step end": looped_step_end_ir,
        "rounding": rounding_ir,
        "values": values_ir,
    }
