"""Machine code of the maps of resets, for the jumps that compiled code decides (``kernel/jump.c``)."""

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
    """All maps; one tape for all modes, as no map holds signs."""
    code: NativeModule
    jumps: Mapping[int, Jump]
    """Of the surfaces that reset the state."""

    def address(self, mode: Mode, index: int) -> int:
        """Address of the map of a surface that a mode reaches; 0 where Python has to decide what follows.

        That is so where the jump leaves the state on another surface that the mode slides on, or a body at rest on one,
        and where the speed of an impact depends on other surfaces' signs.
        """
        jump, impact = self.jumps[index], impact_of(self.system, index)
        stays = any(entry == 0 and j in jump.kept for j, entry in enumerate(mode))
        if stays or (impact and impact.speed.has(*self.system.signs)):
            return 0
        return self.code.address(f"jump_{index}")


def jump_code(system: FilippovSystem) -> JumpCode | None:
    """The code of a system's maps; None where it has none, or more surfaces than numbers of modes are for.

    A map's function (:func:`henon_ref.taylor.llvm.expansion.values_ir`) takes the state before, and behind it what
    rounding has lost of that. It puts the new values of the states that it moves, what is lost of them to first order
    (the map's derivative times what was lost before), the values of the surfaces whose functions it changes, and the
    part of the speed that the impact leaves (1 where that is none).
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
    return JumpCode(system, ModeTape(tape, ()), machine_code(parts), jumps)


def _carried(value: sp.Expr, states: tuple[sp.Symbol, ...], lost: tuple[sp.Symbol, ...]) -> sp.Expr:
    """A function's derivative along what rounding has lost of the states."""
    moving = value.free_symbols
    return sp.Add(*(sp.diff(value, x) * low for x, low in zip(states, lost, strict=True) if x in moving))
