"""Compiled modes of one system: the tables that the mode loop reads. What they hold at parameter values is apart from
them (:mod:`henon_ref.integrator.constants`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.errors import ModelError
from henon_ref.integrator.mode_code import (
    DistinctConstants,
    ModeCode,
    NormalVelocities,
    bernstein_code,
    common_mode_code,
    normal_velocities,
    switched_mode_code,
)
from henon_ref.integrator.records import mode_dtype, packed, unpacked
from henon_ref.jit.processor_time import compiling
from henon_ref.kernel.shared import kernel
from henon_ref.modes.contact_loops import guard_count
from henon_ref.modes.equations import Guard
from henon_ref.modes.kinks import continuous
from henon_ref.modes.mode import Mode, mode_number, replaced
from henon_ref.modes.sliding import EXHAUSTIVE
from henon_ref.modes.system import FilippovSystem
from henon_ref.precision import one_at_a_time

if TYPE_CHECKING:
    from henon_ref.integrator.jump_code import JumpCode

ALL: Mode = ()
"""What machine code goes by that all modes have in common."""
_KIND = {"surface": kernel.SURFACE, "release": kernel.RELEASE, "valid": kernel.VALID, "attracts": kernel.VALID}


@dataclass(frozen=True, eq=False)
class CompiledModes:
    """The modes that are compiled at one time: tables that nobody changes any more."""

    records: NDArray[Any]
    """Shape (M,) of :func:`henon_ref.integrator.records.mode_dtype`."""
    sources: NDArray[np.int64]
    """(M, tapes, K): where each number of a mode's rows of constants is found among those of all modes."""
    constants: int
    """How many constants these are."""


class ModeTable:
    """Grows a row for each mode that is asked for, from any thread.

    Where all modes have one set of equations a mode is no row but a number (:mod:`henon_ref.integrator.records`): the
    table has three rows, of the modes in which every entry is the same, and the loop puts all others together from
    these.

    Parameters
    ----------
    system : FilippovSystem
    order : int
        Order of the Taylor expansion.

    Attributes
    ----------
    modes, codes : list
        Of each row its mode and machine code. They only grow.
    index : dict
        Row of each mode that is compiled.
    constants : DistinctConstants
        Those of all modes.
    contacts : int
        How many contacts' entries a mode is, a number; 0 where it is a row.
    compiled : CompiledModes
        Replaced by larger tables with each row; who reads the old ones is led to no mode that they have not.

    Raises
    ------
    ModelError
        Where the map of a reset has a function that is not smooth.
    """

    def __init__(self, system: FilippovSystem, order: int) -> None:
        self.system, self.order = system, order
        self.modes: list[Mode] = []
        self.codes: list[ModeCode] = []
        self.index: dict[Mode, int] = {}
        self.constants = DistinctConstants()
        surfaces = len(system.surfaces)
        self._switched = system.switched
        self.contacts = surfaces if self._switched and not system.resets else 0
        self._jumps = _jump_code(system) if system.resets else None
        no_sources = np.zeros((0, 0, 0), dtype=np.int64)
        self.compiled = CompiledModes(np.zeros(0, dtype=mode_dtype(self.most_guards)), no_sources, 0)
        self._codes: dict[Mode | frozenset[int], ModeCode] = {}
        self._guards: dict[Mode, tuple[Guard, ...]] = {}
        if surfaces == 1:
            for mode in ((-1,), (1,), (0,)):
                self.row(mode)

    @cached_property
    def most_guards(self) -> int:
        """Guards of the largest mode."""
        system = self.system
        if self._switched:
            return len(self._switched.outputs)
        releases = sum(max(2, len(o.release)) for o in system.overrides.values())
        releases += guard_count(system.velocities, system.overrides)
        surfaces = len(system.surfaces)
        minors = 0 if self.decoupled else 2**surfaces - 1 if surfaces <= EXHAUSTIVE else surfaces + 1
        return 2 * surfaces + releases + minors + len(system.valid)

    def row(self, mode: Mode) -> int | None:
        """Row of a mode, compiled on first sight, or its number; None where the mode has no equations."""
        if self.contacts:
            return packed(mode) if all(self._row(same) is not None for same in self._uniform) else None
        return self._row(mode)

    def known(self, mode: Mode) -> int | None:
        """The same for a mode that is compiled; None where it is not."""
        if self.contacts:
            return packed(mode) if len(self.index) == len(self._uniform) else None
        return self.index.get(mode)

    def mode(self, row: int) -> Mode:
        """The mode of a row, or of a number."""
        return unpacked(row, self.contacts) if self.contacts else self.modes[row]

    @cached_property
    def _uniform(self) -> tuple[Mode, ...]:
        """The modes in which all entries are -1, 0 or +1."""
        return tuple((entry,) * self.contacts for entry in (-1, 0, 1))

    def _row(self, mode: Mode) -> int | None:
        if mode not in self.index:
            with one_at_a_time():
                if mode not in self.index:  # another thread may have been at it
                    try:
                        with compiling():
                            code = self._code(mode)
                    except ModelError:
                        return None
                    self._append(mode, code)
        return self.index[mode]

    def guards(self, mode: Mode) -> tuple[Guard, ...]:
        """Guards of a mode in the order of its row."""
        if self._switched:
            return self._switched.guards(mode)
        if mode not in self._guards:
            self._guards[mode] = self.system.equations(mode).guards
        return self._guards[mode]

    def leads_to(self, row: int, place: int, entry: int) -> int:
        """Row of the mode behind a guard, in which its surface has this entry; -1 where the loop is not to go there."""
        return int(self.compiled.records["guards"]["mode_across" if entry else "mode_stuck"][row, place])

    def places(self, mode: Mode) -> Sequence[int]:
        """Where each of them stands in :meth:`FilippovSystem.equations`; -1 where it has no counterpart there."""
        return self._switched.places(mode) if self._switched else range(len(self.guards(mode)))

    @cached_property
    def selects(self) -> bool:
        """Whether the compiled loop decides by normal velocities what becomes of several surfaces."""
        system = self.system
        if self._switched and self.contacts:
            return self._switched.coupled
        return 1 < len(system.surfaces) <= kernel.MOST_SURFACES and not system.resets and _in_groups(system)

    @cached_property
    def decoupled(self) -> bool:
        """Whether no surface's normal velocity has the sign of another one in it."""
        surfaces = range(len(self.system.surfaces))
        return all(len(self.system.together(i, surfaces)) == 1 for i in surfaces)

    @cached_property
    def owned(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Which constants are those of each contact: where its places end, and places in a mode's row of constants."""
        tapes = self.codes[0].tapes
        length = self.compiled.sources.shape[2]
        own: list[list[int]] = [[] for _ in range(self.contacts)]
        for first, tape in zip(range(0, length * len(tapes), length), tapes, strict=True):
            for at, contacts in enumerate(tape.owners):
                for contact in contacts:  # one at most: see decoupled_contacts
                    own[contact] += [first + at, first + len(tape.owners) + at]
        places = [np.array(each, dtype=np.int64) for each in own]
        return np.cumsum(list(map(len, own)), dtype=np.int64), np.concatenate(places)

    @cached_property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """States, guards of the largest mode, order, contacts, and numbers in the constants of a mode of contacts (0 if
        it is a row, or none has equations)."""
        there = self.contacts and self.row(self._uniform[0]) is not None
        numbers = self.compiled.sources[0].size if there else 0
        return len(self.system.states), self.most_guards, self.order, self.contacts, numbers

    @cached_property
    def normals(self) -> NormalVelocities | None:
        """Normal velocities of all surfaces; None where the compiled loop does not decide by them."""
        if not self.selects:
            return None
        with one_at_a_time():
            return normal_velocities(self.system)

    def _code(self, mode: Mode) -> ModeCode:
        """Machine code of a mode, which it has in common with those that have its equations, or with all."""
        key = ALL if self._switched else self.system.common_equations(mode)[0]
        if key not in self._codes:
            code = (
                switched_mode_code(self.system, self._switched, self.order)
                if self._switched
                else common_mode_code(self.system, mode, self.order, self._passed(mode))
            )
            self._codes[key] = replace(code, jumps=self._jumps.tape) if self._jumps else code
        return self._codes[key]

    def _passed(self, mode: Mode) -> frozenset[int]:
        """Sections that are crossed while others slide which act on them: what slides goes on.

        (At a kink of a force it need not: a load that is at its limit may grow from there on.) Where the compiled loop
        selects modes it decides those as well whose normal velocity holds no sign that slides.
        """
        system, sliding = self.system, [i for i, entry in enumerate(mode) if entry == 0]
        slid = {system.signs[i] for i in sliding}
        found, selects = set(), self.selects and not system.overrides
        for i in self._sections if sliding else ():
            selected = selects and slid.isdisjoint(system.normal_velocity(i).free_symbols)
            if mode[i] and not selected and len(system.in_play([i], sliding)) > 1:
                found.add(i)
        return frozenset(found)

    @cached_property
    def _kinks(self) -> frozenset[int]:
        """Surfaces that are crossed whatever else happens: the field is continuous there, or forces change no speed."""
        system = self.system
        if self._switched:
            return self._switched.crossed
        if len(system.surfaces) == 1:
            return frozenset()
        normals = enumerate(map(system.normal_velocity, range(len(system.surfaces))))
        free = {i for i, normal in normals if normal.free_symbols.isdisjoint(system.signs)}
        return (continuous(system) | free | self._sections) - system.overrides.keys() - system.resets.keys()

    @cached_property
    def _sections(self) -> frozenset[int]:
        """Surfaces whose signs no force holds, and at which nothing happens."""
        overrides, resets = self.system.overrides, self.system.resets
        forces = [*self.system.field]
        for own in overrides.values():
            forces += [*own.field, *(end.when for end in own.release)]
        used = set().union(*(force.free_symbols for force in set(forces)))
        unused = (i for i, sign in enumerate(self.system.signs) if sign not in used)
        return frozenset(unused) - overrides.keys() - resets.keys()

    def _append(self, mode: Mode, code: ModeCode) -> None:
        before, own = self.compiled, self.constants.sources(code.tapes, mode)
        shape = (len(self.modes) + 1, *map(max, before.sources.shape[1:], own.shape))
        records, sources = np.concatenate([before.records, self._record(mode, code)]), np.zeros(shape, dtype=np.int64)
        for part, row in ((before.sources, slice(0, -1)), (own[None], slice(-1, None))):  # padded with zeros
            sources[row, : part.shape[1], : part.shape[2]] = part
        self.modes.append(mode)
        self.codes.append(code)
        if not self.contacts:
            self._link_all(records["guards"], mode)
        self.compiled = CompiledModes(records, sources, len(self.constants.expressions))
        self.index[mode] = len(self.modes) - 1  # whoever finds it there finds the tables that have it

    def _link_all(self, guards: NDArray[Any], mode: Mode) -> None:
        """Link the last row with those that one event leads to, or from."""
        last = len(self.modes) - 1
        for i, entry in enumerate(mode):
            for other in {-1, 0, 1} - {entry}:
                found = self.index.get(replaced(mode, i, other))
                if found is not None:
                    self._link(guards, last, i, other, found)
                    self._link(guards, found, i, entry, last)

    def _record(self, mode: Mode, code: ModeCode) -> NDArray[Any]:
        """A mode's row, shape (1,): it leads to no other mode yet; of contacts, to the rows of their entries."""
        found = np.zeros(1, dtype=mode_dtype(self.most_guards))
        system, guards = self.system, self.guards(mode)
        if self._switched and self.contacts:  # the guards of a surface are those of its own entry alone
            sliding, passed = [i for i in range(len(mode)) if i not in self._switched.crossed], frozenset[int]()
        else:
            sliding, passed = [i for i, s in enumerate(mode) if s == 0], self._passed(mode)
        own, records = found[0]["mode"], found[0]["guards"]
        for name, value in code.fields.items():
            own[name] = value
        own["number"], own["surfaces"] = _number(mode), len(mode) if len(mode) <= kernel.MOST_SURFACES else 0
        own["guards"], own["bernstein"] = len(guards), bernstein_code(self.order).address("bernstein")
        records["mode_across"] = records["mode_stuck"] = -1
        records["branches"][: len(code.guards_branch)] = code.guards_branch
        for record, guard in zip(records, guards, strict=False):
            surface = guard.kind == "surface"
            record["kind"] = kernel.VALID if guard.ends else _KIND[guard.kind]
            record["index"], record["valid"] = guard.index, guard.kind == "valid"
            record["rising_only"] = guard.rising_only
            record["hold_zone"] = surface and system.held_inside(guard.index)
            record["side"], record["to_sign"] = mode[guard.index] if surface else 0, guard.to_sign
            record["kink"] = surface and not guard.ends and guard.index in self._kinks
            resets = surface and guard.index in system.resets and mode[guard.index] > 0
            record["jump"] = self._jumps.address(mode, guard.index) if resets and self._jumps else 0
            together = system.decided_together(guard, sliding) and guard.index not in passed
            coupled = kernel.COUPLED if together else kernel.UNCOUPLED
            record["coupled"] = kernel.RESETTING if resets else coupled
            # Filippov's release is tangent (h = h' = 0), an override's need not be, a body lifts off with more zeros.
            if guard.kind == "release":
                tangent = 0 if guard.index in system.overrides else 2
                record["zeros_at_release"] = -1 if guard.index in system.resets else tangent
            if self.contacts and guard.ends is None:
                record["mode_across"], record["mode_stuck"] = 1 + guard.to_sign, -1 if record["kink"] else 1
        return found

    def _link(self, guards: NDArray[Any], row: int, index: int, entry: int, target: int) -> None:
        """Lead the events of a mode on one surface to the mode in which that has another entry."""
        for g, guard in enumerate(self.guards(self.modes[row])):
            if guard.index != index:
                continue
            if guard.kind == "surface" and entry == 0:
                guards["mode_stuck"][row, g] = target
            if guard.ends is None and guard.to_sign == entry:
                guards["mode_across"][row, g] = target


def _jump_code(system: FilippovSystem) -> JumpCode | None:
    from henon_ref.integrator.jump_code import jump_code  # few systems have resets

    return jump_code(system)


def _number(mode: Mode) -> int:
    """A mode's number; 0 where an integer of the machine holds none."""
    return mode_number(mode) if len(mode) <= kernel.MOST_SURFACES else 0


def _in_groups(system: FilippovSystem) -> bool:
    """Whether what has static friction is decided by compiled code: contacts in no loop, each held up to two limits."""
    held = all(system.held_inside(i) and _two_ends(system, i) for i in system.overrides)
    return held and not (system.overrides and system.has_loops)


def _two_ends(system: FilippovSystem, index: int) -> bool:
    return sorted(end.to_sign for end in system.hold_guards(index)) == [-1, 1]
