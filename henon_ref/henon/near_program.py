"""What a closer look works with: each mode as a program in quad-double, and room for its expansion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.henon.compiled import quad_double, speeds
from henon_ref.henon.near import ORDER
from henon_ref.henon.program import program
from henon_ref.henon.quadseries import WIDTH
from henon_ref.henon.registers import L_NUMBERS, L_OPERATIONS, L_PLACED, L_ROWS, L_SIZE
from henon_ref.henon.window import HALVINGS
from henon_ref.model.modes import Mode
from henon_ref.model.system import FilippovSystem
from henon_ref.processor_time import compiling
from henon_ref.taylor.tape import build_tape


class NearPrograms:
    """Programs of one system's modes, made when they are first needed, and kept.

    Parameters
    ----------
    system : FilippovSystem
    places : callable
        Where the guards of a mode's table stand in :meth:`FilippovSystem.equations`.
    """

    def __init__(self, system: FilippovSystem, places: Callable[[Mode], Sequence[int]]) -> None:
        self.system, self._places = system, places
        self._made: dict[Mode, tuple[NDArray[Any], ...]] = {}

    def address(self, mode: Mode) -> int:
        """Where it is in memory what :func:`henon_ref.henon.near.look_near` works with in a mode."""
        if mode not in self._made:
            with compiling():
                arrays = self._arrays(mode)
            self._made[mode] = (_register(*arrays), *arrays)
        return int(self._made[mode][0].ctypes.data)

    def _arrays(self, mode: Mode) -> tuple[NDArray[Any], ...]:
        """Codes, constants and places; room for coefficients in two doubles, and in four, for sizes and for work."""
        system, equations = self.system, self.system.equations(mode)
        signs = {sign: sp.Integer(s) for sign, s in zip(system.signs, mode, strict=True)}
        sides = [speed.xreplace(signs) for speed in speeds(system, equations.guards)]
        tape = build_tape(system.states, equations.field, [*(g.expression for g in equations.guards), *sides])
        codes, constants, field, outputs, rows = program(tape, [quad_double(system.numeric(c)) for c in tape.constants])
        places = np.concatenate([np.array(self._places(mode), dtype=np.int64), field, outputs])
        shapes = [(rows, ORDER + 1), (rows, ORDER + 1), (rows, WIDTH), (2, rows), (4 + HALVINGS, ORDER + 1)]
        return codes, constants, places, *(np.zeros(shape) for shape in shapes)


def _register(*arrays: NDArray[Any]) -> NDArray[np.int64]:
    """Where they are, and how long those are whose length the mode tells (see :mod:`henon_ref.henon.registers`)."""
    made = np.zeros(L_SIZE, dtype=np.int64)
    made[: len(arrays)] = [array.ctypes.data for array in arrays]
    codes, constants, places, high = arrays[:4]
    made[[L_OPERATIONS, L_NUMBERS, L_PLACED, L_ROWS]] = len(codes), len(constants), len(places), len(high)
    return made
