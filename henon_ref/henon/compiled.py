"""Compiled modes of one system: machine code, constants and the tables the mode loop reads."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.errors import ModelError
from henon_ref.henon.codegen import closing_ir, declarations, expansion_ir
from henon_ref.henon.kernel import RELEASE, SURFACE, VALID
from henon_ref.henon.machine import MachineCode
from henon_ref.model.modes import Mode, replaced
from henon_ref.model.system import FilippovSystem, ModeEquations
from henon_ref.taylor.tape import Tape, build_tape

SURFACES = 8
"""With more surfaces than these no table holds the row of every mode."""
_KIND = {"surface": SURFACE, "release": RELEASE, "valid": VALID}


def double_double(number: sp.Expr) -> tuple[float, float]:
    """An exact number as the nearest double and what that leaves, rounded again.

    Raises
    ------
    ModelError
        If it is not a finite real number.
    """
    value = sp.N(number, 50)
    if not value.is_number or not value.is_real or not value.is_finite:
        raise ModelError(f"not a finite real number: {number}")
    high = float(value)
    return high, float(value - sp.Float(high, 60))


@dataclass(frozen=True)
class _Shape:
    """What all modes with one set of sliding surfaces share."""

    equations: ModeEquations
    expansion: Tape
    probe: Tape
    code: MachineCode


@dataclass
class CompiledSystem:
    """Grows a row in every table for each mode that is asked for.

    Parameters
    ----------
    system : FilippovSystem
    order : int
        Order of the Taylor expansion.
    """

    system: FilippovSystem
    order: int
    modes: list[Mode] = field(default_factory=list)
    index: dict[Mode, int] = field(default_factory=dict)
    addresses: NDArray[np.int64] = field(init=False)
    constants: NDArray[np.float64] = field(init=False)
    probes: NDArray[np.float64] = field(init=False)
    layouts: NDArray[np.int64] = field(init=False)
    targets: NDArray[np.int64] = field(init=False)
    signs: NDArray[np.int64] = field(init=False)
    """(M, surfaces): the entries of each row's mode."""
    rows: NDArray[np.int64] = field(init=False)
    """Row of every mode, written in base 3; -1 where not compiled yet, empty where modes are not decided by it."""
    _shapes: dict[frozenset[int], _Shape] = field(default_factory=dict)

    def __post_init__(self) -> None:
        guards = self.most_guards
        self.addresses = np.zeros((0, 3), dtype=np.int64)
        self.constants = np.zeros((0, 1))
        self.probes = np.zeros((0, 1))
        self.layouts = np.zeros((0, 1 + guards, 4), dtype=np.int64)
        self.targets = np.zeros((0, guards, 2), dtype=np.int64)
        surfaces = len(self.system.surfaces)
        self.signs = np.zeros((0, surfaces), dtype=np.int64)
        several = 1 < surfaces <= SURFACES and not self.system.overrides
        self.rows = np.full(3**surfaces if several else 0, -1, dtype=np.int64)
        if len(self.system.surfaces) == 1:
            for mode in ((-1,), (1,), (0,)):
                self.compile(mode)

    @property
    def most_guards(self) -> int:
        """Guards of the largest mode."""
        system = self.system
        releases = sum(max(2, len(o.release)) for o in system.overrides.values())
        return 2 * len(system.surfaces) + releases + len(system.valid)

    def compile(self, mode: Mode) -> int | None:
        """Row of a mode, compiled on first sight; None where the mode has no equations."""
        if mode not in self.index:
            try:
                shape = self._shape(frozenset(i for i, s in enumerate(mode) if s == 0))
            except ModelError:
                return None
            row = len(self.modes)
            self.modes.append(mode)
            self.index[mode] = row
            self._append(mode, shape)
            self.signs = np.vstack([self.signs, np.array([mode], dtype=np.int64)])
            if self.rows.size:
                self.rows[sum((s + 1) * 3**i for i, s in enumerate(mode))] = row
            self._link()
        return self.index[mode]

    @cached_property
    def normals(self) -> tuple[int, NDArray[np.float64]]:
        """Address of the normal velocities of all surfaces, in states and signs, and its constants."""
        system = self.system
        if not self.rows.size:
            return 0, np.zeros(1)
        inputs = (*system.states, *system.signs)
        tape = build_tape(inputs, (), [system.normal_velocity(i) for i in range(len(system.surfaces))])
        self._normals_code = MachineCode(declarations() + expansion_ir(tape, len(inputs), 0, "normals"))
        return self._normals_code.address("normals"), np.array([*self._numbers(tape, {}), 0.0])

    def _shape(self, sliding: frozenset[int]) -> _Shape:
        if sliding not in self._shapes:
            system = self.system
            equations = system.shared_equations(sliding)
            expansion = build_tape(system.states, equations.field, [g.expression for g in equations.guards])
            probe = build_tape(system.states, (), _speeds(system, equations))
            n = len(system.states)
            code = MachineCode(
                declarations()
                + expansion_ir(expansion, n, self.order, "expansion")
                + closing_ir(n, len(equations.guards), self.order, "closing")
                + expansion_ir(probe, n, 0, "probe")
            )
            self._shapes[sliding] = _Shape(equations, expansion, probe, code)
        return self._shapes[sliding]

    def _append(self, mode: Mode, shape: _Shape) -> None:
        signs = {self.system.signs[i]: sp.Integer(s) for i, s in enumerate(mode)}
        addresses = [shape.code.address(name) for name in ("expansion", "closing", "probe")]
        self.addresses = np.vstack([self.addresses, [addresses]])
        self.constants = _stacked(self.constants, self._numbers(shape.expansion, signs))
        self.probes = _stacked(self.probes, self._numbers(shape.probe, signs))
        layout = np.zeros((1, *self.layouts.shape[1:]), dtype=np.int64)
        layout[0, 0] = len(shape.equations.guards), sum(s == 0 for s in mode), 0, 0
        for g, guard in enumerate(shape.equations.guards):
            held = guard.kind == "surface" and self.system.held_inside(guard.index)
            layout[0, 1 + g] = _KIND[guard.kind], guard.index, guard.rising_only, held
        self.layouts = np.vstack([self.layouts, layout])
        self.targets = np.vstack([self.targets, np.full((1, *self.targets.shape[1:]), -1, dtype=np.int64)])

    def _numbers(self, tape: Tape, signs: dict[sp.Symbol, sp.Expr]) -> list[float]:
        """Constants rounded to double, then what the rounding lost."""
        pairs = [double_double(self.system.numeric(c.xreplace(signs))) for c in tape.constants]
        return [p[0] for p in pairs] + [p[1] for p in pairs]

    def _link(self) -> None:
        """Fill the table of what follows an event, for the modes there are."""
        for row, mode in enumerate(self.modes):
            for g, guard in enumerate(self.system.equations(mode).guards):
                if guard.kind == "surface":
                    after = (replaced(mode, guard.index, guard.to_sign), replaced(mode, guard.index, 0))
                    self.targets[row, g] = [self.index.get(m, -1) for m in after]
                elif guard.kind == "release":
                    to = self.index.get(replaced(mode, guard.index, guard.to_sign), -1)
                    # Filippov's release is tangent (h = h' = 0); an override's need not be: 0, to be measured.
                    self.targets[row, g] = [to, 0 if guard.index in self.system.overrides else 2]


def _speeds(system: FilippovSystem, equations: ModeEquations) -> list[sp.Expr]:
    """For every guard on a surface: speed towards it on this side, speed away from it on the other."""
    speeds: list[sp.Expr] = []
    for guard in equations.guards:
        if guard.kind == "surface":
            sign = system.signs[guard.index]
            normal = system.normal_velocity(guard.index)
            speeds += [-sign * normal, -sign * normal.xreplace({sign: -sign})]
        else:
            speeds += [sp.Integer(0), sp.Integer(0)]
    return speeds


def _stacked(table: NDArray[np.float64], row: list[float]) -> NDArray[np.float64]:
    """The table with one more row, wide enough for it."""
    width = max(table.shape[1], len(row))
    wider = np.zeros((table.shape[0] + 1, width))
    wider[:-1, : table.shape[1]] = table
    wider[-1, : len(row)] = row
    return wider
