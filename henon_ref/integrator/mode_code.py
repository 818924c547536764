"""Machine code shared by modes with equal equations, with tapes whose constants distinguish them; code of resets."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.jit.native_module import NativeModule, source_hash
from henon_ref.kernel.library import ffi, kernel
from henon_ref.modes.equations import Guard, ModeTape, along
from henon_ref.modes.mode import Mode
from henon_ref.modes.resets import Jump, impact_of, jump_of
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.machine_code import Part, machine_code
from henon_ref.taylor.rules import RULES, IntegralOfProduct, IntegralOfQuotient
from henon_ref.taylor.tape import INFINITE, Tape, build_tape

if TYPE_CHECKING:
    from henon_ref.modes.decoupled_contacts import Entries, SwitchedEquations

MOST_WATCHED = 200
"""Largest number of operations of the guards beyond those of the field (such as a long expression whose extremes a
sweep locates) for which the code is fully optimized; for more, optimizing takes longer than most runs."""
LARGE_TAPE = 200
"""Number of operations above which the code consists of loops over equal operations
(:mod:`henon_ref.taylor.llvm.looped`), because the compile time of straight-line code grows quadratically. For 40 masses
with one contact (243 operations) loops compile in 2.2 s instead of 6.9 s and a run takes 1.07 times as long; for 4
blocks with friction (88) a run takes twice as long; for 16 blocks (388) equally long."""

MOST_IN_LANES = 100
"""Largest number of operations for which the code of several expansions at once is compiled: at an order of 16 this
takes 0.04 s for 9 operations and 0.14 s for 24."""
MOST_OPERATIONS = 200
"""Largest tape that compiled code evaluates in double-double; for larger tapes multiprecision is about as fast."""
_KINDS: dict[str, int] = {
    name[5:].lower(): number for name, number in ffi.typeof("enum tape_kind").relements.items()
} | {"square": kernel.TAPE_MUL}


@dataclass(frozen=True, eq=False)
class ModeCode:
    """Machine code of modes with equal equations."""

    expansion: ModeTape
    """Field and guards."""
    probe: ModeTape
    """Normal velocities on both sides of each surface."""
    code: NativeModule
    degree: int
    """Degree of states and guards if they are polynomials in time of at most the order; otherwise 0."""
    field_branches: bool
    """Whether the field contains operations with branch points."""
    guards_branch: tuple[bool, ...]
    """The same for each guard."""
    program: NDArray[np.int64] | None
    """Field and guards for evaluation in double-double, if compiled code supports them."""
    jumps: ModeTape | None = None
    """Maps of the system's resets, if compiled code applies them."""

    @property
    def tapes(self) -> tuple[ModeTape, ...]:
        """Tapes whose constants the compiled loop reads, in its order; their number is the same for all modes."""
        return (self.expansion, self.probe, *([] if self.jumps is None else [self.jumps]))

    def lanes(self, order: int) -> NativeModule | None:
        """Machine code ``lanes`` of several expansions at once; None if it would be too long to compile."""
        tape = self.expansion.tape
        return None if len(tape.nodes) > MOST_IN_LANES else machine_code(Part("lanes", (tape, len(tape.field), order)))

    @property
    def fields(self) -> dict[str, int]:
        """Values of the fields of a mode's record (``struct mode``) that depend on the code."""
        return {
            "expansion": self.code.address("expansion"),
            "step_end": self.code.address("closing"),
            "normal_velocities": self.code.address("probe"),
            "rounding": self.code.address("rounding"),
            "polynomial_degree": self.degree,
            "slopes": self.code.address("slopes"),
            "branches": int(self.field_branches or any(self.guards_branch)),
            "tape": 0 if self.program is None else self.program.ctypes.data,
            "guards_branch": int(any(self.guards_branch)),
        }


def common_mode_code(system: FilippovSystem, mode: Mode, order: int, passed: frozenset[int] = frozenset()) -> ModeCode:
    """Compile the code of all modes with the same equations as ``mode``; ModelError if the mode has no equations.

    ``passed``: surfaces whose normal velocity is taken in the mode, with other surfaces sliding.
    """
    key, equations = system.common_equations(mode)
    normals = {i: along(system.surfaces[i], system.states, equations.field) for i in passed}
    sides = _speeds(system, equations.guards, tuple(i for i, s in enumerate(mode) if s == 0), normals)
    if key == mode:  # these are its own
        sides = [speed.xreplace(system.entries(mode)) for speed in sides]
        entries: tuple[Entries, ...] = (({}, {}, {}),) * len(mode)
    else:
        entries = tuple(tuple({sign: sp.Integer(s)} for s in (-1, 0, 1)) for sign in system.signs)
    expansion = build_tape(system.states, equations.field, [g.expression for g in equations.guards])
    return _mode_code(system, order, expansion, build_tape(system.states, (), sides), entries)


def switched_mode_code(system: FilippovSystem, equations: SwitchedEquations, order: int) -> ModeCode:
    """Compile one code for all modes, whatever surfaces slide."""
    slid = tuple(i for i in range(len(system.surfaces)) if i not in equations.crossed)
    sides = _speeds(system, equations.guards((1,) * len(system.surfaces)), slid)
    # Separate names keep each constant dependent on one entry only, even if several signs act together.
    names = {s: sp.Symbol(f"side_{i}", real=True) for i, s in enumerate(system.signs)}
    beside = {s: names[s] for i, s in enumerate(system.signs) if i in equations.crossed}
    expansion = _named_tape(system, equations.field, equations.outputs, equations.definitions, beside)
    probe = _named_tape(system, (), sides, (), names if equations.coupled else beside)
    return _mode_code(system, order, expansion, probe, equations.entries)


def _named_tape(
    system: FilippovSystem,
    field: Sequence[sp.Expr],
    outputs: Sequence[sp.Expr],
    definitions: Sequence[tuple[sp.Symbol, sp.Expr]],
    names: Mapping[sp.Symbol, sp.Symbol],
) -> Tape:
    """Build a tape of expressions in which some symbols are renamed."""
    if not names:
        return build_tape(system.states, field, outputs, definitions)
    field, outputs = ([e.xreplace(names) for e in part] for part in (field, outputs))
    defined = [(name, s) for s, name in names.items()] + [(s, e.xreplace(names)) for s, e in definitions]
    return build_tape(system.states, field, outputs, defined)


def _mode_code(
    system: FilippovSystem, order: int, expansion: Tape, probe: Tape, entries: tuple[Entries, ...]
) -> ModeCode:
    n, nodes = len(system.states), expansion.nodes
    degree = expansion.degree if expansion.degree <= order else 0
    field_branches = _has_branch_points(expansion, expansion.field)
    guards_branch = tuple(_has_branch_points(expansion, [row]) for row in expansion.outputs)
    large, not_watched = len(nodes) > LARGE_TAPE, len(nodes) <= len(expansion.needed(expansion.field)) + MOST_WATCHED
    loops = "looped " if large else ""
    parts = [
        Part(f"{loops}expansion", (expansion, n, order, "expansion")),
        Part(f"{loops}step end", (n, len(expansion.outputs), order, "closing")),
        Part(f"{loops}expansion", (probe, n, 0, "probe")),
        Part(f"{loops}expansion", (expansion, n, 1, "slopes", int(kernel.row_length(order)))),
        Part("rounding", (expansion, n, "rounding")),
    ]
    code = machine_code(*parts, optimised=large or not_watched, simplified=not_watched and not large)
    tapes = ModeTape(expansion, entries), ModeTape(probe, entries)
    program = tape_program(expansion)
    return ModeCode(*tapes, code, degree, field_branches, guards_branch, program)


def _has_branch_points(tape: Tape, rows: Iterable[int]) -> bool:
    """Return whether given nodes depend on an operation with branch points."""
    return any(tape.nodes[at].op in ("sqrt", "power", "asin", "acos") for at in tape.needed(rows))


def tape_program(tape: Tape) -> NDArray[np.int64] | None:
    """Encode a tape for evaluation in double-double (``struct tape`` of ``kernel.h``); None if not supported."""
    large = len(tape.field) + len(tape.outputs) > kernel.PAIR_ROWS or len(tape.nodes) > MOST_OPERATIONS
    if large or any(node.op not in _KINDS for node in tape.nodes):
        return None
    operations: list[int] = []
    for at, node in enumerate(tape.nodes):
        rule = RULES.get(node.op)
        first, second, sign, divides = (node.args[0], node.args[-1], 0, 0) if rule else (0, 0, 0, 0)
        if isinstance(rule, IntegralOfProduct | IntegralOfQuotient):
            second, sign, divides = rule.place(at, node.args), rule.sign, int(isinstance(rule, IntegralOfQuotient))
        operations += [_KINDS[node.op], first, second, *(*node.constants, 0, 0)[:2], sign, divides, node.degree]
    degree = tape.degree if tape.degree < INFINITE else 0
    head = len(tape.nodes), len(tape.constants), len(tape.field), len(tape.outputs), degree
    return np.array([*head, *operations, *tape.field, *tape.outputs], dtype=np.int64)


def _speeds(
    system: FilippovSystem,
    guards: Sequence[Guard],
    sliding: tuple[int, ...],
    normals: Mapping[int, sp.Expr] | None = None,
) -> list[sp.Expr]:
    """Return, for every guard on a surface, the speed towards it on this side and away from it on the other.

    For the last guard that ends a slide, instead: the distance of the state that it determines from the surface.
    ``normals``: normal velocities of some surfaces while other surfaces slide.
    """
    found: list[sp.Expr] = []
    ends, solved = last_ends(guards), system.put_on(sliding)
    for guard in guards:
        if guard.index in solved and guard is ends.get(guard.index):
            h, x = system.surfaces[guard.index], system.states[solved[guard.index]]
            found += [h / system.constant_slope(h, x), sp.Integer(0)]
        elif guard.kind == "surface":
            sign = system.signs[guard.index]
            normal = (normals or {}).get(guard.index, system.normal_velocity(guard.index))
            found += [-sign * normal, -sign * normal.xreplace({sign: -sign})]
        else:
            found += [sp.Integer(0), sp.Integer(0)]
    return found


def last_ends(guards: Sequence[Guard]) -> dict[int, Guard]:
    """Return the last of the guards that end the slide on each surface."""
    return {guard.index: guard for guard in guards if guard.kind == "release"}


@cache
def bernstein_code(order: int) -> NativeModule:
    """Compile the function ``bernstein`` of an order (:mod:`henon_ref.taylor.llvm.step`)."""

    def written() -> str:
        from henon_ref.jit.ir_writer import declarations  # needed only for compiling
        from henon_ref.taylor.llvm.step import bernstein_ir

        return declarations() + bernstein_ir(order, "bernstein")

    sources = source_hash("taylor/llvm/step.py", "jit/*.py", "kernel/kernel.h")
    return NativeModule(written, key=f"{sources} bernstein {order}")


@dataclass(frozen=True, eq=False)
class NormalVelocities:
    """Normal velocities of all surfaces in states and signs; for static friction see :func:`_of_contacts`."""

    tape: Tape
    address: int
    code: NativeModule
    contacts: NDArray[np.int64] | None
    """Properties of each contact (bits of ``enum contact``), shape (surfaces,); None without static friction."""
    beside: NDArray[np.int64]
    """Whether two surfaces interact, shape (surfaces, surfaces)."""


def normal_velocities(system: FilippovSystem) -> NormalVelocities:
    """Build and compile the normal velocities of all surfaces."""
    surfaces = range(len(system.surfaces))
    inputs, outputs = (*system.states, *system.signs), [system.normal_velocity(i) for i in surfaces]
    contacts = None
    if system.overrides or system.switched is not None:
        loads, outputs = _of_contacts(system)
        inputs = (*inputs, *loads)
        contacts = np.array([_known_of(system, i) for i in surfaces], dtype=np.int64)
    tape = build_tape(inputs, (), outputs)
    code = machine_code(Part("expansion", (tape, len(inputs), 0, "normals")))
    beside = np.array([[j in system.together(i, (i, j)) for j in surfaces] for i in surfaces], dtype=np.int64)
    return NormalVelocities(tape, code.address("normals"), code, contacts, beside)


def _of_contacts(system: FilippovSystem) -> tuple[list[sp.Symbol], list[sp.Expr]]:
    """Return symbols for the loads of all contacts, and expressions for ``henon_ref/kernel/contact_group.c``.

    These are the normal velocities in states, signs and loads, followed by four numbers per surface: the ends of its
    hold zone towards +1 and -1, its inertia, and the change of its normal velocity by friction
    (:mod:`henon_ref.modes.held_groups`).
    """
    loads = [sp.Symbol(f"load_{i}", real=True) for i in range(len(system.signs))]
    pushes = {i: own.push for i, own in system.overrides.items() if own.push}
    field = tuple(
        sp.Add(rate, *(push[k] * loads[i] for i, push in pushes.items())) for k, rate in enumerate(system.field)
    )
    numbers: list[sp.Expr] = []
    for i, sign in enumerate(system.signs):
        own, speed = system.overrides.get(i), system.normal_velocity(i)
        ends = {1: sp.S.Zero, -1: sp.S.Zero}
        if own:
            ends = {guard.to_sign: guard.expression for guard in system.hold_guards(i)}
        inertia = sp.S.One if own is None or own.inertia is None else own.inertia
        friction = speed.xreplace({sign: sp.S.Zero}) - speed.xreplace({sign: sp.S.One}) if own else sp.S.One
        numbers += [ends[1], ends[-1], inertia, friction]
    return loads, [*(along(h, system.states, field) for h in system.surfaces), *numbers]


def _known_of(system: FilippovSystem, index: int) -> int:
    own = system.overrides.get(index)
    if own is None:
        if system.switched is not None and index in system.switched.crossed:
            return int(kernel.SECTION)
        moved = not system.normal_velocity(index).free_symbols.isdisjoint(system.signs)
        return 0 if moved else int(kernel.SECTION)
    return kernel.FIXED | (own.inertia is not None) * kernel.KNOWN_INERTIA | bool(own.push) * kernel.BY_LOAD


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
        new = [j for j in range(len(system.surfaces)) if jump.side(j, 0) is None]
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
