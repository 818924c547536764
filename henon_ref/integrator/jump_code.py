"""Machine code of the maps of resets, for jumps in the compiled loop (``kernel/jump.c``)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import sympy as sp

from henon_ref.jit.native_module import NativeModule
from henon_ref.kernel.shared import kernel
from henon_ref.modes.equations import ModeTape
from henon_ref.modes.mode import Mode
from henon_ref.modes.resets import Jump, impact_of, jump_of
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.machine_code import Part, machine_code
from henon_ref.taylor.tape import build_tape


@dataclass(frozen=True, eq=False)
class JumpCode:
    """Machine code of the maps of a system's resets."""

    system: FilippovSystem
    tape: ModeTape
    """Tape of all maps; maps contain no signs, so that all modes share it."""
    code: NativeModule
    jumps: Mapping[int, Jump]
    """Jumps by surface."""

    def address(self, mode: Mode, index: int) -> int:
        """Return the address of a surface's map in a mode; 0 if Python must decide the mode after the jump.

        Python decides if the jump leaves the state on another surface with sliding, or if the speed of an impact
        depends on signs of other surfaces.
        """
        jump, impact = self.jumps[index], impact_of(self.system, index)
        stays = any(entry == 0 and j in jump.kept for j, entry in enumerate(mode))
        if stays or (impact and impact.speed.has(*self.system.signs)):
            return 0
        return self.code.address(f"jump_{index}")


def jump_code(system: FilippovSystem) -> JumpCode | None:
    """Return the code of a system's maps; None if it has no resets, or too many surfaces for numbered modes.

    The function of a map (:func:`henon_ref.taylor.llvm.expansion.values_ir`) takes the state before the jump and its
    rounding error. It writes the new values of the states that the map changes, their rounding errors to first order
    (the derivative of the map times the rounding errors before), the values of the surfaces that change, and the
    restitution ratio of an impact (1 if the reset is not an impact).
    """
    if not system.resets or len(system.surfaces) > kernel.MOST_SURFACES:
        return None
    n, jumps = len(system.states), {i: jump_of(system, i) for i in sorted(system.resets)}
    lost = tuple(sp.Symbol(f"lost of {x.name}", real=True) for x in system.states)
    outputs: list[sp.Expr] = []
    places: dict[int, list[int]] = {}
    for i, jump in jumps.items():
        outputs += [jump.states[k] for k in jump.moved]
        outputs += [_carried(jump.states[k], system.states, lost) for k in jump.moved]
        new = [j for j in range(len(system.surfaces)) if j not in jump.kept]
        outputs += [jump.guards[j] for j in new]
        impact = impact_of(system, i)
        outputs += [sp.Integer(1) if impact is None or impact.refusal else impact.ratio]
        places[i] = [*jump.moved, *(n + k for k in jump.moved), *(2 * n + j for j in new), 2 * n + len(system.surfaces)]
    tape = build_tape((*system.states, *lost), (), outputs)
    parts, first = [], 0
    for i, own in places.items():
        parts.append(Part("values", (tape.part(range(first, first + len(own))), 2 * n, f"jump_{i}", own)))
        first += len(own)
    return JumpCode(system, ModeTape(tape, ()), machine_code(*parts), jumps)


def _carried(value: sp.Expr, states: tuple[sp.Symbol, ...], lost: tuple[sp.Symbol, ...]) -> sp.Expr:
    """Return the directional derivative of a function along the rounding errors of the states."""
    moving = value.free_symbols
    return sp.Add(*(sp.diff(value, x) * low for x, low in zip(states, lost, strict=True) if x in moving))
