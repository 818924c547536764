"""Compiled modes of one system: machine code, constants and the tables the mode loop reads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.errors import ModelError
from henon_ref.filippov.attraction import EXHAUSTIVE
from henon_ref.filippov.decoupled_contacts import SwitchedEquations, switched_equations
from henon_ref.filippov.equations import Guard
from henon_ref.filippov.modes import Mode, replaced
from henon_ref.filippov.system import FilippovSystem
from henon_ref.henon.state import (
    G_MODE_ACROSS,
    G_MODE_STUCK,
    RELEASE,
    SURFACE,
    T_BERNSTEIN,
    T_EXPANSION,
    T_GUARDS,
    T_NORMAL_VELOCITIES,
    T_POLYNOMIAL_DEGREE,
    T_SIZE,
    T_SLOPES,
    T_STEP_END,
    VALID,
)
from henon_ref.jit.ir_writer import declarations, row_length
from henon_ref.jit.native_module import NativeModule
from henon_ref.jit.processor_time import compiling
from henon_ref.roots.bernstein import bernstein_code
from henon_ref.taylor.llvm.expansion import expansion_ir
from henon_ref.taylor.llvm.step_end import step_end_ir
from henon_ref.taylor.tape import Tape, build_tape

SURFACES = 8
"""With more surfaces than these no table holds the row of every mode."""
SHAPES = 3
"""With more surfaces than these, all modes share one machine code where their contacts allow it."""
BRANCHING = frozenset({"sqrt", "power", "asin", "acos"})
"""Operations with branch points."""
_KIND = {"surface": SURFACE, "release": RELEASE, "valid": VALID, "attracts": VALID}


def double_double(number: sp.Expr) -> tuple[float, float]:
    """An exact number as the nearest double and what that leaves, rounded again.

    Raises
    ------
    ModelError
        If it is not a finite real number.
    """
    rest = sp.N(number, 50)
    if not rest.is_number or not rest.is_real or not rest.is_finite:
        raise ModelError(f"not a finite real number: {number}")
    high = float(rest)
    return high, float(rest - sp.Float(high, 50))


@dataclass(frozen=True)
class _Shape:
    """Machine code that several modes share: those with one set of sliding surfaces, or all with switches."""

    expansion: Tape
    probe: Tape
    code: NativeModule
    degree: int
    """Degree of states and guards where by their form they are polynomials in time, up to the order; else 0."""
    has_branch_points: bool
    """Whether there may be branch points."""

    @property
    def entries(self) -> list[int]:
        """Addresses of expansion, closing and probe; degree; address of slopes for the wary, else 0."""
        slopes = self.code.address("slopes") if self.has_branch_points else 0
        return [*(self.code.address(name) for name in ("expansion", "closing", "probe")), self.degree, slopes]


def _shape(
    system: FilippovSystem, order: int, field: Sequence[sp.Expr], outputs: Sequence[sp.Expr], sides: Sequence[sp.Expr]
) -> _Shape:
    n = len(system.states)
    expansion, probe = build_tape(system.states, field, outputs), build_tape(system.states, (), sides)
    nodes = expansion.nodes
    degrees = [*(nodes[row].degree + 1 for row in expansion.field), *(nodes[row].degree for row in expansion.outputs)]
    degree = max(degrees) if max(degrees) <= order else 0
    has_branch_points = degree == 0 and any(node.op in BRANCHING for node in nodes)
    code = NativeModule(
        declarations()
        + expansion_ir(expansion, n, order, "expansion")
        + step_end_ir(n, len(outputs), order, "closing")
        + expansion_ir(probe, n, 0, "probe")
        + (expansion_ir(expansion, n, 1, "slopes", row_length(order)) if has_branch_points else "")
    )
    return _Shape(expansion, probe, code, degree, has_branch_points)


@dataclass
class ModeTable:
    """Grows a row in every table for each mode that is asked for.

    Parameters
    ----------
    system : FilippovSystem
    order : int
        Order of the Taylor expansion.
    """

    system: FilippovSystem
    order: int
    modes: tuple[Mode, ...] = ()
    index: dict[Mode, int] = field(default_factory=dict)
    tables: NDArray[np.int64] = field(init=False)
    numbers: NDArray[np.float64] = field(init=False)
    signs: NDArray[np.int64] = field(init=False)
    """(M, surfaces): the entries of each row's mode."""
    rows: NDArray[np.int64] = field(init=False)
    """Row of every mode, written in base 3; -1 where not compiled yet, empty where modes are not decided by it."""
    _shapes: dict[frozenset[int], _Shape] = field(default_factory=dict)
    _guards: dict[Mode, tuple[Guard, ...]] = field(default_factory=dict)
    _switched: SwitchedModes | None = field(init=False)

    def __post_init__(self) -> None:
        self.tables = np.zeros((0, 1 + self.most_guards, T_SIZE), dtype=np.int64)
        self.numbers = np.zeros((0, 2, 1))
        surfaces = len(self.system.surfaces)
        self.signs = np.zeros((0, surfaces), dtype=np.int64)
        equations = switched_equations(self.system) if surfaces > SHAPES else None
        self._switched = None if equations is None else SwitchedModes(equations, self.order)
        several = 1 < surfaces <= SURFACES and not self.system.overrides
        self.rows = np.full(3**surfaces if several else 0, -1, dtype=np.int64)
        if len(self.system.surfaces) == 1:
            for mode in ((-1,), (1,), (0,)):
                self.row(mode)

    @property
    def most_guards(self) -> int:
        """Guards of the largest mode."""
        system = self.system
        releases = sum(max(2, len(o.release)) for o in system.overrides.values())
        surfaces = len(system.surfaces)
        minors = 0 if self.decoupled else 2**surfaces - 1 if surfaces <= EXHAUSTIVE else surfaces + 1
        return 2 * surfaces + releases + minors + len(system.valid)

    def row(self, mode: Mode) -> int | None:
        """Row of a mode, compiled on first sight; None where the mode has no equations."""
        if mode not in self.index:
            try:
                with compiling():
                    made = self._switched.row(mode) if self._switched else self._own_row(mode)
            except ModelError:
                return None
            row = len(self.modes)
            self.modes = (*self.modes, mode)
            self.index[mode] = row
            self._append(mode, *made)
            # Where it may not attract, compiled code does not settle on it.
            if self.rows.size and all(g.kind != "attracts" for g in self.guards(mode)):
                self.rows[sum((s + 1) * 3**i for i, s in enumerate(mode))] = row
            if not self._switched:
                self._link()
        return self.index[mode]

    def guards(self, mode: Mode) -> tuple[Guard, ...]:
        """Guards of a mode in the order of its row."""
        if mode not in self._guards:
            switched = self._switched
            self._guards[mode] = switched.equations.guards(mode) if switched else self.system.equations(mode).guards
        return self._guards[mode]

    def places(self, mode: Mode) -> Sequence[int]:
        """Where each of them stands in :meth:`FilippovSystem.equations`; -1 where it has no counterpart there."""
        return self._switched.equations.places(mode) if self._switched else range(len(self.guards(mode)))

    @cached_property
    def decoupled(self) -> bool:
        """Whether no surface's normal velocity has the sign of another one in it."""
        surfaces = range(len(self.system.surfaces))
        return all(len(self.system.together(i, surfaces)) == 1 for i in surfaces)

    @cached_property
    def normals(self) -> tuple[int, NDArray[np.float64]]:
        """Address of the normal velocities of all surfaces, in states and signs, and its constants."""
        system = self.system
        if not self.rows.size:
            return 0, np.zeros(1)
        inputs = (*system.states, *system.signs)
        tape = build_tape(inputs, (), [system.normal_velocity(i) for i in range(len(system.surfaces))])
        self._normals_code = NativeModule(declarations() + expansion_ir(tape, len(inputs), 0, "normals"))
        return self._normals_code.address("normals"), np.array([*self._numbers(tape, {}), 0.0])

    def _own_row(self, mode: Mode) -> tuple[list[int], list[float], list[float]]:
        """Entries and constants of a mode on the machine code of its sliding surfaces."""
        system = self.system
        sliding = frozenset(i for i, s in enumerate(mode) if s == 0)
        if sliding not in self._shapes:
            equations = system.shared_equations(sliding)
            outputs = [g.expression for g in equations.guards]
            self._shapes[sliding] = _shape(
                system, self.order, equations.field, outputs, speeds(system, equations.guards)
            )
        shape = self._shapes[sliding]
        signs = {system.signs[i]: sp.Integer(s) for i, s in enumerate(mode)}
        return shape.entries, self._numbers(shape.expansion, signs), self._numbers(shape.probe, signs)

    def _append(self, mode: Mode, entries: list[int], constants: Sequence[float], probes: Sequence[float]) -> None:
        row = self.index[mode]
        numbers = np.zeros((2, max(len(constants), len(probes), 1)))
        numbers[0, : len(constants)], numbers[1, : len(probes)] = constants, probes
        self.numbers = _with_row(self.numbers, row, numbers)
        self.signs = _with_row(self.signs, row, np.array(mode))
        layout = np.zeros(self.tables.shape[1:], dtype=np.int64)
        layout[1:, [G_MODE_ACROSS, G_MODE_STUCK]] = -1
        guards, system = self.guards(mode), self.system
        sliding = [i for i, s in enumerate(mode) if s == 0]
        layout[0, T_GUARDS] = len(guards)
        layout[0, [T_EXPANSION, T_STEP_END, T_NORMAL_VELOCITIES, T_POLYNOMIAL_DEGREE, T_SLOPES]] = entries
        layout[0, T_BERNSTEIN] = bernstein_code(self.order).address("bernstein")
        for g, guard in enumerate(guards):
            surface = guard.kind == "surface"
            inside_hold_zone = surface and system.held_inside(guard.index)
            acting = surface and len(system.together(guard.index, sliding)) > 1
            layout[1 + g, :G_MODE_ACROSS] = _KIND[guard.kind], guard.index, guard.rising_only, inside_hold_zone, acting
            if guard.kind == "release":
                # Filippov's release is tangent (h = h' = 0); an override's need not be: 0, to be measured.
                layout[1 + g, G_MODE_STUCK] = 0 if guard.index in system.overrides else 2
        self.tables = _with_row(self.tables, row, layout)

    def _numbers(self, tape: Tape, signs: dict[sp.Symbol, sp.Expr]) -> list[float]:
        """Constants rounded to double, then what the rounding lost."""
        pairs = [double_double(self.system.numeric(c.xreplace(signs))) for c in tape.constants]
        return [p[0] for p in pairs] + [p[1] for p in pairs]

    def _link(self) -> None:
        """Fill the table of what follows an event, for the modes there are."""
        for row, mode in enumerate(self.modes):
            for g, guard in enumerate(self.system.equations(mode).guards):
                if guard.kind == "surface":
                    self.tables[row, 1 + g, G_MODE_STUCK] = self.index.get(replaced(mode, guard.index, 0), -1)
                if guard.ends is None:
                    after = replaced(mode, guard.index, guard.to_sign)
                    self.tables[row, 1 + g, G_MODE_ACROSS] = self.index.get(after, -1)


def speeds(system: FilippovSystem, guards: Sequence[Guard]) -> list[sp.Expr]:
    """For every guard on a surface: speed towards it on this side, speed away from it on the other."""
    found: list[sp.Expr] = []
    for guard in guards:
        if guard.kind == "surface":
            sign = system.signs[guard.index]
            normal = system.normal_velocity(guard.index)
            found += [-sign * normal, -sign * normal.xreplace({sign: -sign})]
        else:
            found += [sp.Integer(0), sp.Integer(0)]
    return found


def _with_row(table: NDArray[Any], row: int, new: NDArray[Any]) -> NDArray[Any]:
    """The table with one more row written; room for more, and longer ones, where it has none left."""
    if row == len(table) or new.shape[-1] > table.shape[-1]:
        wide = max(new.shape[-1], table.shape[-1])
        larger = np.zeros((max(2 * row, 4), *table.shape[1:-1], wide), dtype=table.dtype)
        larger[:row, ..., : table.shape[-1]] = table[:row]
        table = larger
    table[row, ..., : new.shape[-1]] = new
    return table


class SwitchedModes:
    """Rows of all modes on one machine code, from tables of what each surface's entry makes of each constant."""

    def __init__(self, equations: SwitchedEquations, order: int) -> None:
        self.equations = equations
        system = equations.system
        sides = speeds(system, equations.guards((1,) * len(system.surfaces)))
        shape = _shape(system, order, equations.field, equations.outputs, sides)
        self._code = shape.code
        self._entries = shape.entries
        self._tables = self._table(shape.expansion), self._table(shape.probe)

    def row(self, mode: Mode) -> tuple[list[int], list[float], list[float]]:
        """Entries and constants of a mode."""
        entries = np.array([*mode, 0])
        found = []
        for owner, values in self._tables:
            pairs = values[entries[owner] + 1, np.arange(len(owner))]
            found.append(pairs.T.ravel().tolist())
        return self._entries, found[0], found[1]

    def _table(self, tape: Tape) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Surface that each constant depends on (-1: none), and its two doubles for the entries -1, 0 and +1."""
        equations = self.equations
        owner = np.full(len(tape.constants), -1)
        values = np.zeros((3, len(tape.constants), 2))
        for at, constant in enumerate(tape.constants):
            owners = {equations.owner[s] for s in constant.free_symbols if s in equations.owner}
            for i in owners:  # one at most: each surface's switches stand in its own rate and guards alone
                owner[at] = i
            for entry in (-1, 0, 1):
                put = equations.switches[owner[at]].values(entry) if owners else {}
                values[entry + 1, at] = double_double(equations.system.numeric(constant.xreplace(put)))
        return owner, values
