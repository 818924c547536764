"""Tables of a system's compiled modes, which the compiled loop reads.

The values of their constants at given parameters are kept separately (:mod:`henon_ref.integrator.constants`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.errors import ModelError
from henon_ref.integrator.mode_code import (
    ModeCode,
    NormalVelocities,
    bernstein_code,
    common_mode_code,
    jump_code,
    last_ends,
    normal_velocities,
    switched_mode_code,
)
from henon_ref.integrator.records import mode_dtype, packed, unpacked
from henon_ref.jit.native_module import NativeModule
from henon_ref.jit.processor_time import compiling
from henon_ref.kernel.library import kernel
from henon_ref.modes.contact_loops import guard_count
from henon_ref.modes.equations import Guard, ModeTape
from henon_ref.modes.kinks import continuous
from henon_ref.modes.mode import Mode, mode_number, replaced
from henon_ref.modes.sliding import EXHAUSTIVE
from henon_ref.modes.system import FilippovSystem
from henon_ref.precision import one_at_a_time

_KIND = {"surface": kernel.SURFACE, "release": kernel.RELEASE, "valid": kernel.VALID, "attracts": kernel.VALID}


@dataclass(frozen=True, eq=False)
class CompiledModes:
    """Immutable snapshot of the compiled modes."""

    records: NDArray[Any]
    """Shape (M,) of :func:`henon_ref.integrator.records.mode_dtype`."""
    sources: NDArray[np.int64]
    """Index of each constant of a mode in the constants of all modes, shape (M, tapes, K)."""
    constants: int
    """Number of constants of all modes."""


class ModeTable:
    """Table of compiled modes; a requested mode is compiled and appended. Thread-safe.

    If all modes share one set of equations, a mode is identified by a number instead of a row
    (:mod:`henon_ref.integrator.records`). The table then has three rows, for the modes in which all entries are equal,
    and the loop assembles every other mode from them.

    ModelError if the map of a reset contains a function that is not smooth.
    """

    def __init__(self, system: FilippovSystem, order: int) -> None:
        self.system, self.order = system, order
        self.modes: list[Mode] = []
        self.codes: list[ModeCode] = []
        """Mode and machine code of each row; append-only."""
        self.index: dict[Mode, int] = {}
        """Row of each compiled mode."""
        self.constants: list[sp.Expr] = []
        """Distinct constants of the tapes of all modes, in order of their first use; append-only."""
        self._numbers: dict[tuple[ModeTape, int, tuple[int, ...]], int] = {}
        """Tape, place in it, and entries of the surfaces on which the constant depends -> its number."""
        surfaces = len(system.surfaces)
        self._switched = system.switched
        self.contacts = surfaces if self._switched and not system.resets else 0
        """Number of entries of a mode if modes are identified by numbers; 0 if they are identified by rows."""
        self._jumps = jump_code(system)
        no_sources = np.zeros((0, 0, 0), dtype=np.int64)
        self.compiled = CompiledModes(np.zeros(0, dtype=mode_dtype(self.most_guards)), no_sources, 0)
        """Replaced as a whole by each new row. An older snapshot refers only to modes that it contains."""
        self._codes: dict[Mode | frozenset[int], ModeCode] = {}
        self._in_lanes: list[NativeModule] | None = None
        """Code of several expansions at once; None if it is not compiled."""
        if surfaces == 1:
            for mode in ((-1,), (1,), (0,)):
                self.row(mode)

    @cached_property
    def most_guards(self) -> int:
        """Largest number of guards of a mode."""
        system = self.system
        if self._switched:
            return len(self._switched.outputs)
        releases = sum(max(2, len(o.release)) for o in system.overrides.values())
        releases += guard_count(system.velocities, system.overrides)
        surfaces = len(system.surfaces)
        minors = 0 if self.decoupled else 2**surfaces - 1 if surfaces <= EXHAUSTIVE else surfaces + 1
        return 2 * surfaces + releases + minors + len(system.valid)

    def row(self, mode: Mode) -> int | None:
        """Return the row or number of a mode, compiling it if necessary; None if the mode has no equations."""
        if self.contacts:
            return packed(mode) if all(self._row(same) is not None for same in self._uniform) else None
        return self._row(mode)

    def compile_lanes(self) -> bool:
        """Compile the code of several expansions at once (``lanes`` of ``struct mode``), also for modes added later.

        Return whether some mode has such code. Runs in progress use it from their next step on.
        """
        if self._in_lanes is None:
            with one_at_a_time(), compiling():
                self._in_lanes = []
                self.compiled.records["mode"]["lanes"] = [self._lanes(code) for code in self.codes]
        return bool(self._in_lanes)

    def _lanes(self, code: ModeCode) -> int:
        """Return the address of this code of a mode, 0 if there is none."""
        made = None if self._in_lanes is None else code.lanes(self.order)
        if self._in_lanes is None or made is None:
            return 0
        self._in_lanes.append(made)
        return made.address("lanes")

    def knows(self, mode: Mode) -> bool:
        """Whether a mode is compiled."""
        return len(self.index) == len(self._uniform) if self.contacts else mode in self.index

    def mode(self, row: int) -> Mode:
        """Return the mode of a row or number."""
        return unpacked(row, self.contacts) if self.contacts else self.modes[row]

    @cached_property
    def _uniform(self) -> tuple[Mode, ...]:
        """The three modes whose entries are all -1, all 0 or all +1."""
        return tuple((entry,) * self.contacts for entry in (-1, 0, 1))

    def _row(self, mode: Mode) -> int | None:
        if mode not in self.index:
            with one_at_a_time():
                if mode not in self.index:  # another thread may have compiled it
                    try:
                        with compiling():
                            code = self._code(mode)
                    except ModelError:
                        return None
                    self._append(mode, code)
        return self.index[mode]

    def guards(self, mode: Mode) -> tuple[Guard, ...]:
        """Return the guards of a mode in the order of its row."""
        if self._switched:
            return self._switched.guards(mode)
        return self.system.equations(mode).guards

    def leads_to(self, row: int, place: int, entry: int) -> int:
        """Return the row of the mode that a guard leads to for this entry; -1 if the loop must not enter it."""
        return int(self.compiled.records["guards"]["mode_across" if entry else "mode_stuck"][row, place])

    def places(self, mode: Mode) -> Sequence[int]:
        """Return the index of each guard in :meth:`FilippovSystem.equations`; -1 if it has no counterpart there."""
        return self._switched.places(mode) if self._switched else range(len(self.guards(mode)))

    @cached_property
    def selects(self) -> bool:
        """Whether the compiled loop selects the mode at several surfaces by normal velocities."""
        system = self.system
        if self._switched and self.contacts:
            return self._switched.coupled
        return 1 < len(system.surfaces) <= kernel.MOST_SURFACES and not system.resets and _in_groups(system)

    @cached_property
    def decoupled(self) -> bool:
        """Whether no surface's normal velocity depends on the sign of another surface."""
        surfaces = range(len(self.system.surfaces))
        return all(len(self.system.together(i, surfaces)) == 1 for i in surfaces)

    @cached_property
    def owned(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Constants that depend on each contact: ends of its range, and places in a mode's row of constants."""
        tapes = self.codes[0].tapes
        length = self.compiled.sources.shape[2]
        own: list[list[int]] = [[] for _ in range(self.contacts)]
        for first, tape in zip(range(0, length * len(tapes), length), tapes, strict=True):
            for at, contacts in enumerate(tape.owners):
                for contact in contacts:  # at most one: see decoupled_contacts
                    own[contact] += [first + at, first + len(tape.owners) + at]
        places = [np.array(each, dtype=np.int64) for each in own]
        return np.cumsum(list(map(len, own)), dtype=np.int64), np.concatenate(places)

    @cached_property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """States, largest number of guards, order, contacts, and number of constants of a mode identified by a number
        (0 if modes are rows, or no mode has equations)."""
        there = self.contacts and self.row(self._uniform[0]) is not None
        numbers = self.compiled.sources[0].size if there else 0
        return len(self.system.states), self.most_guards, self.order, self.contacts, numbers

    @cached_property
    def normals(self) -> NormalVelocities | None:
        """Normal velocities of all surfaces; None if the compiled loop does not select modes."""
        if not self.selects:
            return None
        with one_at_a_time():
            return normal_velocities(self.system)

    def _code(self, mode: Mode) -> ModeCode:
        """Return the machine code of a mode, shared with all modes that have the same equations."""
        key = () if self._switched else self.system.common_equations(mode)[0]  # of all modes, or of some
        if key not in self._codes:
            code = (
                switched_mode_code(self.system, self._switched, self.order)
                if self._switched
                else common_mode_code(self.system, mode, self.order, self._passed(mode))
            )
            self._codes[key] = replace(code, jumps=self._jumps.tape) if self._jumps else code
        return self._codes[key]

    def _passed(self, mode: Mode) -> frozenset[int]:
        """Return sections whose crossing leaves the sliding surfaces that act on them sliding.

        (At a kink of a force sliding may end: a load at its limit may grow from there on.) If the compiled loop
        selects modes, it also decides the sections whose normal velocity contains no sliding sign.
        """
        system, sliding = self.system, [i for i, entry in enumerate(mode) if entry == 0]
        slid = {system.signs[i] for i in sliding}
        found, selects = set(), self.selects and not system.overrides
        for i in self.system.observed if sliding else ():
            selected = selects and slid.isdisjoint(system.normal_velocity(i).free_symbols)
            if mode[i] and not selected and len(system.in_play([i], sliding)) > 1:
                found.add(i)
        return frozenset(found)

    @cached_property
    def _kinks(self) -> frozenset[int]:
        """Surfaces that are always crossed: the field is continuous there, or their normal velocity has no sign."""
        system = self.system
        if self._switched:
            return self._switched.crossed
        if len(system.surfaces) == 1:
            return frozenset()
        normals = enumerate(map(system.normal_velocity, range(len(system.surfaces))))
        free = {i for i, normal in normals if normal.free_symbols.isdisjoint(system.signs)}
        return (continuous(system) | free | self.system.observed) - system.overrides.keys() - system.resets.keys()

    def _append(self, mode: Mode, code: ModeCode) -> None:
        before, own = self.compiled, self._sources(code.tapes, mode)
        shape = (len(self.modes) + 1, *map(max, before.sources.shape[1:], own.shape))
        records, sources = np.concatenate([before.records, self._record(mode, code)]), np.zeros(shape, dtype=np.int64)
        for part, row in ((before.sources, slice(0, -1)), (own[None], slice(-1, None))):  # padded with zeros
            sources[row, : part.shape[1], : part.shape[2]] = part
        self.modes.append(mode)
        self.codes.append(code)
        if not self.contacts:
            self._link_all(records["guards"], mode)
        self.compiled = CompiledModes(records, sources, len(self.constants))
        self.index[mode] = len(self.modes) - 1  # last: a mode in the index is in the tables

    def _sources(self, tapes: tuple[ModeTape, ...], mode: Mode) -> NDArray[np.int64]:
        """Return the places of a mode's constants in one row of all constants: a zero, then each as a pair of doubles.

        The result has the shape (tapes, K): for each tape the first doubles of the pairs, the second ones, and zeros.
        """
        found = np.zeros((len(tapes), max([1, *(2 * len(tape.tape.constants) for tape in tapes)])), dtype=np.int64)
        for row, tape in zip(found, tapes, strict=True):
            count = len(tape.tape.constants)
            row[:count] = [1 + 2 * self._number(tape, at, mode) for at in range(count)]
            row[count : 2 * count] = row[:count] + 1
        return found

    def _number(self, tape: ModeTape, at: int, mode: Mode) -> int:
        key = tape, at, tuple(mode[i] for i in tape.owners[at])
        if key not in self._numbers:
            self._numbers[key] = len(self.constants)
            self.constants.append(tape.constant(at, mode))
        return self._numbers[key]

    def _link_all(self, guards: NDArray[Any], mode: Mode) -> None:
        """Link the last row with the rows that differ from it in one entry."""
        last = len(self.modes) - 1
        for i, entry in enumerate(mode):
            for other in {-1, 0, 1} - {entry}:
                found = self.index.get(replaced(mode, i, other))
                if found is not None:
                    self._link(guards, last, i, other, found)
                    self._link(guards, found, i, entry, last)

    def _record(self, mode: Mode, code: ModeCode) -> NDArray[Any]:
        """Return a mode's row, shape (1,), with no links to other modes yet (of contacts: to the rows of entries)."""
        found = np.zeros(1, dtype=mode_dtype(self.most_guards))
        system, guards = self.system, self.guards(mode)
        if self._switched and self.contacts:  # the guards of a surface depend only on its own entry
            sliding, passed = [i for i in range(len(mode)) if i not in self._switched.crossed], frozenset[int]()
        else:
            sliding, passed = [i for i, s in enumerate(mode) if s == 0], self._passed(mode)
        own, records = found[0]["mode"], found[0]["guards"]
        for name, value in code.fields.items():
            own[name] = value
        own["lanes"] = self._lanes(code)
        if len(mode) <= kernel.MOST_SURFACES:  # the number fits into a machine integer
            own["number"], own["surfaces"] = mode_number(mode), len(mode)
        own["guards"], own["bernstein"] = len(guards), bernstein_code(self.order).address("bernstein")
        records["mode_across"] = records["mode_stuck"] = records["put_on"] = -1
        ends, solved = last_ends(guards), system.put_on(tuple(sliding))
        records["branches"][: len(code.guards_branch)] = code.guards_branch
        for record, guard in zip(records, guards, strict=False):
            surface = guard.kind == "surface"
            record["kind"] = kernel.VALID if guard.ends else _KIND[guard.kind]
            record["index"], record["valid"] = guard.index, guard.kind == "valid"
            record["rising_only"], record["held"] = guard.rising_only, guard.held
            record["hold_zone"] = surface and system.held_inside(guard.index)
            record["side"], record["to_sign"] = mode[guard.index] if surface else 0, guard.to_sign
            record["kink"] = surface and not guard.ends and guard.index in self._kinks
            resets = surface and guard.index in system.resets and mode[guard.index] > 0
            record["jump"] = self._jumps.address(mode, guard.index) if resets and self._jumps else 0
            together = system.decided_together(guard, mode, sliding) and guard.index not in passed
            coupled = kernel.COUPLED if together else kernel.UNCOUPLED
            record["coupled"] = kernel.RESETTING if resets else coupled
            if guard is ends.get(guard.index) and mode[guard.index] == 0:
                record["put_on"] = solved.get(guard.index, -1)
            # Filippov's release is tangent (h = h' = 0), an override's need not be; a lift-off has more zeros.
            if guard.kind == "release":
                tangent = 0 if guard.index in system.overrides and not system.rests(guard.index) else 2
                record["zeros_at_release"] = -max(tangent, 1) if guard.index in system.resets else tangent
            if self.contacts and guard.ends is None:
                record["mode_across"], record["mode_stuck"] = 1 + guard.to_sign, -1 if record["kink"] else 1
        return found

    def _link(self, guards: NDArray[Any], row: int, index: int, entry: int, target: int) -> None:
        """Link a mode's events on a surface to the mode in which the surface has this entry."""
        for g, guard in enumerate(self.guards(self.modes[row])):
            if guard.index != index:
                continue
            if guard.kind == "surface" and entry == 0:
                guards["mode_stuck"][row, g] = target
            if guard.ends is None and guard.to_sign == entry:
                guards["mode_across"][row, g] = target


def _in_groups(system: FilippovSystem) -> bool:
    """Whether compiled code decides static friction: no loops of contacts, and two limits at each contact."""
    ends = {i: sorted(end.to_sign for end in system.hold_guards(i)) for i in system.overrides}
    held = all(system.held_inside(i) and ends[i] == [-1, 1] for i in system.overrides)
    return held and not (system.overrides and system.has_loops)
