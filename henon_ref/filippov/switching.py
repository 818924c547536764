"""What follows an event: the one mode whose own field keeps it, found by trying the candidates.

A mode is *consistent* at a point when its field leads into it: every surface in slip is left on the mode's
side (first non-zero derivative of h), and on every sliding surface the equivalent sign stays inside
[-1, 1] and the two fields point at the surface. One consistent mode: the future is unique. Several: it is
not (repelling sliding, a spontaneous switch), and we say so. See Filippov (1988), Sec. 2.10, and Dieci
and Lopez, *J. Comput. Appl. Math.* 236 (2012) 3967-3991.

A surface whose sliding is overridden with ``entry: inside`` is held wherever every release guard is positive
just after the point (first non-zero derivative; one that stays at zero holds); no slip starts on it there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import product
from typing import Any

import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.filippov.decision import Decision, ended, explained, with_entries, without_indeterminate
from henon_ref.filippov.derivatives import leading, leading_sign, rate_of, scaled
from henon_ref.filippov.equations import Guard, ModeEquations
from henon_ref.filippov.exact_numbers import exact_sign
from henon_ref.filippov.modes import Mode, mode_text, replaced
from henon_ref.filippov.staying import staying_mode
from henon_ref.filippov.system import FilippovSystem
from henon_ref.precision import one_at_a_time
from henon_ref.taylor.series import expand
from henon_ref.taylor.tape import TIME, Tape, build_tape

ORDER = 8
"""Derivatives looked at before a contact counts as one that never separates."""
ZERO = 1e-13
"""Relative size below which a derivative counts as zero (a tangency within it cannot be told in double)."""
OTHERS = (1e-11, 1e-15, 0.0)
"""What is tried in its place where no mode fits: rounding may be larger, or the derivative as small."""
EXHAUSTIVE = 4
"""With at most this many surfaces in play all candidate modes are tried; beyond, they are searched."""


class _Point:
    """What has been worked out at one point, by mode."""

    def __init__(self, place: tuple[float, ...]) -> None:
        self.place = place
        self.series: dict[Mode, tuple[list[list[float]], float]] = {}
        self.normals: dict[Mode, list[float]] = {}


_NOWHERE = _Point(())
"""Before a run has asked for anything."""


ModeWithTape = tuple[ModeEquations, Tape]


def mode_with_tape(system: FilippovSystem, mode: Mode) -> ModeWithTape | None:
    """Equations of a mode, and its field and guards as a tape; None where it has none."""
    try:
        equations = system.equations(mode)
    except ModelError:
        return None
    return equations, build_tape(system.states, equations.field, [g.expression for g in equations.guards])


class Switching:
    """Decides the modes of one system in double precision (tapes are made once a mode and kept), from any thread.

    What belongs to the numbers and not to the rule is a method of its own: ``_number`` to ``_attracts_by``.

    Parameters
    ----------
    system : FilippovSystem
    values : FilippovSystem, optional
        The same with values of its parameters, where ``system`` has none.
    """

    def __init__(self, system: FilippovSystem, values: FilippovSystem | None = None) -> None:
        self.system = system
        self._numeric = (values or system).numeric
        self._tapes: dict[Mode, tuple[ModeEquations, Tape, list[Any]] | None] = {}
        self._holds: dict[tuple[Mode, int], Callable[..., list[Any]] | None] = {}
        self.forget()
        normals = [system.normal_velocity(i) for i in range(len(system.surfaces))]
        self._normals = self._function([*system.states, *system.signs], normals)

    def _number(self, expression: sp.Expr) -> Any:
        """A constant of the equations."""
        return float(expression)

    def _function(self, names: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> Callable[..., list[Any]]:
        """(t, *names) -> values of expressions."""
        values = [self._numeric(e) for e in expressions]
        found: Callable[..., list[Any]] = sp.lambdify([TIME, *names], values, "math", cse=True)
        return found

    def _series(self, tape: Tape, numbers: Sequence[Any], t: Any, x: Sequence[Any]) -> tuple[list[list[Any]], float]:
        """Taylor coefficients of a tape's outputs from a point, and a rate that makes them comparable.

        ZeroDivisionError, ValueError or OverflowError where they are not finite.
        """
        states, outputs = expand(tape, numbers, t, x, ORDER)
        return outputs, rate_of(states, outputs)

    def _motion(self, tape: Tape, numbers: Sequence[Any], t: Any, x: Sequence[Any]) -> list[list[Any]]:
        """Taylor coefficients of a mode's states from a point."""
        return expand(tape, numbers, t, x, ORDER)[0]

    def _equal(self, one: Sequence[Any], other: Sequence[Any]) -> bool:
        """Whether the coefficients of a state are the same, but for rounding."""
        rate = rate_of([one, other])
        pairs = list(zip(scaled(one, rate), scaled(other, rate), strict=True))
        largest = max(abs(c) for pair in pairs for c in pair)
        return all(abs(a - b) <= ZERO * largest for a, b in pairs)

    def _leading(self, series: Sequence[Any], first: int, rate: float, size: float, zero: float) -> int | None:
        """Index of the first coefficient from ``first`` on that is not zero, or None."""
        return leading(series, first, rate, size, zero)

    def _sign(self, series: Sequence[Any], first: int, rate: float, size: float, zero: float) -> int:
        """Sign of that coefficient; 0 if there is none."""
        k = self._leading(series, first, rate, size, zero)
        return 0 if k is None else (1 if series[k] > 0 else -1)

    def _holds_by(self, tape: Tape, numbers: Sequence[Any], ends: Sequence[int], t: Any, x: Any, zero: float) -> bool:
        """Whether these outputs of a tape, the ends of a hold zone, are positive just after a point (or stay zero).

        A load at one end of the hold zone is small against its distance to the other; then its derivatives decide.
        """
        states, outputs = expand(tape, numbers, t, x, ORDER)
        ways = [outputs[end] for end in ends]
        rate = rate_of(states, ways)
        width = max(abs(value) for c in ways for value in scaled(c, rate))
        return all(c[0] > 0 if abs(c[0]) > zero * width else leading_sign(c, 1, rate, 0.0, zero) >= 0 for c in ways)

    def _attracts_by(self, below: Any, above: Any) -> bool:
        """Whether normal velocities below and above a surface point at it, or along it."""
        zero = ZERO * (abs(below) + abs(above))
        return bool(below >= -zero and above <= zero)

    def forget(self) -> None:
        """What has been worked out at a point is not kept for the next one who comes there."""
        self._point = _NOWHERE

    def initial_mode(
        self, start: sp.Expr, initial: Sequence[sp.Expr], given: Mapping[int, int] | None = None
    ) -> Decision:
        """Mode at the start, decided from exact numbers.

        Parameters
        ----------
        start, initial
            Exact time and state.
        given : mapping, optional
            Surface -> entry, for surfaces the start lies on; taken as it is.
        """
        surfaces, valid = self.signs_at(start, initial)
        return self.mode_by_signs(float(start), [float(v) for v in initial], surfaces, valid, given or {})

    def signs_at(self, start: sp.Expr, initial: Sequence[sp.Expr]) -> tuple[list[int], list[int]]:
        """Signs of the surfaces, and of the ``valid`` expressions, at a point in exact numbers."""
        at = {TIME: start, **dict(zip(self.system.states, initial, strict=True))}
        surfaces, valid = (
            [exact_sign(self._numeric(e).xreplace(at)) for e in expressions]
            for expressions in (self.system.surfaces, self.system.valid)
        )
        return surfaces, valid

    def mode_by_signs(
        self, t: float, x: list[float], surfaces: Sequence[int], valid: Sequence[int], given: Mapping[int, int]
    ) -> Decision:
        """Mode at a start where the surfaces, and the ``valid`` expressions, have these signs."""
        system = self.system
        mode: list[int] = []
        active: list[int] = []
        for i, exact in enumerate(surfaces):
            sign = exact
            if i in given and sign in (0, given[i]):
                sign = given[i]
            elif i in given:
                return Decision(
                    "invalid", None, f"the start is off the surface of {system.signs[i]}: its mode is {sign:+d}"
                )
            elif sign == 0:
                active.append(i)
            mode.append(sign)
        edges = []
        for i, (expression, sign) in enumerate(zip(system.valid, valid, strict=True)):
            if sign < 0:
                return Decision("invalid", None, f"the model does not hold at the start: {expression} < 0")
            if sign == 0:
                edges.append(i)
        settled = Decision("unique", tuple(mode))
        decision = self._decide(t, x, tuple(mode), tuple(active)) if active else self._attracting(t, x, settled)
        refused = self._rising(t, x, decision.mode, edges) if edges and decision.mode is not None else None
        return refused or decision

    def _rising(self, t: float, x: Sequence[float], mode: Mode, edges: Sequence[int]) -> Decision | None:
        """Why a run in a mode cannot begin where some ``valid`` expressions are zero; None where they all rise."""
        try:
            orders = self.contact_orders(t, x, mode, (), edges)
        except (ZeroDivisionError, ValueError, OverflowError):
            return Decision("none", None, "a derivative is not finite at the start, where a valid expression is 0")
        for i, order in enumerate(orders[-len(self.system.valid) :]):  # their guards come last
            if i in edges and not order:
                return Decision("invalid", None, f"{self.system.valid[i]} is 0 at the start and does not rise")
        return None

    def after_event(
        self, t: float, x: Sequence[float], mode: Mode, hits: Sequence[Guard], *, zero: float = ZERO
    ) -> Decision:
        """Mode after the guards ``hits`` of ``mode`` fell to zero at (t, x).

        The states of the surfaces hit are taken to be on them, whatever rounding says. ``zero`` is the relative
        size below which a derivative counts as zero.
        """
        refused = ended(self.system, mode, hits, _digits(t))
        if refused is not None:
            return refused
        if len(hits) == 1 and hits[0].kind == "release":
            # The equivalent sign reaches +-1 continuously, so the field does not jump and nothing else changes.
            return self._attracting(t, x, Decision("unique", replaced(mode, hits[0].index, hits[0].to_sign)))
        sliding = [i for i, s in enumerate(mode) if s == 0]
        active = {i for g in hits for i in self.system.together(g.index, sliding)}
        return self._decide(t, list(x), mode, tuple(sorted(active)), zero)

    def contact_orders(
        self,
        t: float,
        x: Sequence[float],
        mode: Mode,
        active: Iterable[int],
        edges: Iterable[int] = (),
        *,
        zero: float = ZERO,
    ) -> list[int]:
        """Known zeros of each guard of a mode at (t, x): how often the surfaces in ``active`` are touched.

        For a surface just left: 1 where it is left with a speed, 2 where tangentially, and so on; 0 for
        guards of other surfaces and where nothing is zero. The same for the ``valid`` expressions in ``edges``,
        which are zero at the start; 0 for one that falls, or stays zero.
        """
        made = self._equations(mode)
        if made is None:
            return []
        outputs, rate = self._expanded(mode, t, x)
        active, edges = set(active), set(edges)
        orders = []
        for guard, series in zip(made[0].guards, outputs, strict=True):
            first = 1 if guard.kind == "surface" else 0
            if guard.kind == "valid" and guard.index in edges:
                found = self._leading(series, 1, rate, 0.0, zero)
                orders.append(found if found is not None and series[found] > 0.0 else 0)
            elif guard.ends or guard.index not in active or guard.rising_only:
                orders.append(0)
            else:
                found = self._leading(series, first, rate, self._size(t, x, mode, guard.index), zero)
                orders.append(found if found is not None else first)
        return orders

    def _decide(self, t: float, x: list[float], mode: Mode, active: tuple[int, ...], zero: float = ZERO) -> Decision:
        """Try with what rounding may have made of a zero first; then, where no mode fits, with more and with less."""
        decision = self._decided(t, x, mode, active, zero)
        for other in OTHERS:
            if decision.status == "none" and (other < zero or zero == ZERO):
                decision = self._decided(t, x, mode, active, other)
        if decision.status == "none" and len(active) <= EXHAUSTIVE:
            staying, same = partial(self._staying, t, x, active=active, zero=zero), partial(self._same_motion, t, x)
            decision = staying_mode(self.system, mode, active, staying, same, f"at t = {_digits(t)}") or decision
        if decision.mode is None:
            return explained(decision, self.system, mode, active)
        return self._attracting(t, x, decision)

    def _attracting(self, t: float, x: Sequence[float], decision: Decision) -> Decision:
        """A decision for a mode, unless that slides on an intersection which is not sure to attract."""
        mode = decision.mode
        made = None if mode is None else self._equations(mode)
        if mode is None or made is None or all(g.kind != "attracts" for g in made[0].guards):
            return decision
        outputs, rate = self._expanded(mode, t, x)
        falling = [
            guard
            for guard, series in zip(made[0].guards, outputs, strict=True)
            if guard.kind == "attracts" and self._sign(series, 0, rate, 0.0, ZERO) <= 0
        ]
        return ended(self.system, mode, falling, _digits(t)) or decision

    def _decided(self, t: float, x: list[float], mode: Mode, active: tuple[int, ...], zero: float) -> Decision:
        if len(active) > EXHAUSTIVE:
            return self._search(t, x, mode, active, zero)
        found = [
            candidate
            for choice in product((-1, 0, 1), repeat=len(active))
            if self._violations(t, x, candidate := with_entries(mode, active, choice), active, zero) == ()
        ]
        if len(found) > 1:
            found = without_indeterminate(found, active, lambda mode, i: self._indeterminate(t, x, mode, i, zero))
        if len(found) == 1:
            return Decision("unique", found[0])
        names = self.system.sign_names
        if not found:
            return Decision("none", None, f"no mode is consistent at t = {_digits(t)}, x = {[float(v) for v in x]}")
        modes = " or ".join(mode_text(m, names) for m in found)
        return Decision("nonunique", None, f"the future is not unique at t = {_digits(t)}: {modes}")

    def _indeterminate(self, t: float, x: Sequence[float], mode: Mode, index: int, zero: float) -> bool:
        """Whether no end of a slide on a surface is anything but zero, so far as its derivatives tell."""
        made = self._equations(mode)
        assert made is not None
        outputs, rate = self._expanded(mode, t, x)
        size = self._size(t, x, mode, index)
        ends = [c for g, c in zip(made[0].guards, outputs, strict=True) if g.kind == "release" and g.index == index]
        return index not in self.system.overrides and all(not self._sign(c, 0, rate, size, zero) for c in ends)

    def _search(self, t: float, x: list[float], mode: Mode, active: tuple[int, ...], zero: float) -> Decision:
        """Start from sliding on all that attract; let go what cannot be held, hold what comes back, to the end."""
        candidate = with_entries(mode, active, (0,) * len(active))
        if self._equations(candidate) is None:  # a surface that no sign acts on cannot be slid on
            candidate = with_entries(mode, active, [self._way(t, x, mode, i) for i in active])
        for _ in range(4 * len(active)):
            broken = self._violations(t, x, candidate, active, zero)
            if broken is None:
                return Decision("none", None, f"sliding on all of {active} at t = {_digits(t)} has no equations")
            if not broken:
                return Decision("unique", candidate)
            for guard in broken:
                candidate = replaced(candidate, guard.index, guard.to_sign if guard.kind == "release" else 0)
        count = len(active)
        return Decision("none", None, f"no consistent mode found at t = {_digits(t)} with {count} surfaces in play")

    def _equations(self, mode: Mode) -> tuple[ModeEquations, Tape, list[Any]] | None:
        if mode not in self._tapes:
            with one_at_a_time():
                made = self._tape(mode)
                self._tapes[mode] = None if made is None else (*made, self._constants(made[1]))
        return self._tapes[mode]

    def _tape(self, mode: Mode) -> ModeWithTape | None:
        """Equations of a mode and their tape; None where it has none."""
        return mode_with_tape(self.system, mode)

    def _constants(self, tape: Tape) -> list[Any]:
        """Constants of a tape."""
        return [self._number(self._numeric(c)) for c in tape.constants]

    def _expanded(self, mode: Mode, t: float, x: Sequence[float]) -> tuple[list[list[float]], float]:
        """Series of a mode's guards from a point, and their rate; those of the last point are kept."""
        kept = self._at(t, x).series
        if mode not in kept:
            made = self._equations(mode)
            assert made is not None
            kept[mode] = self._series(made[1], made[2], t, x)
        return kept[mode]

    def _at(self, t: float, x: Sequence[float]) -> _Point:
        """What is known at a point; that of the last one is kept, for one event asks for it several times."""
        place, point = (t, *x), self._point
        if place != point.place:
            self._point = point = _Point(place)
        return point  # not what the attribute holds by now: another thread may be at another point

    def _violations(
        self, t: float, x: Sequence[float], mode: Mode, active: Iterable[int], zero: float
    ) -> tuple[Guard, ...] | None:
        """Guards of the mode that do not hold just after (t, x); None where the mode has no equations."""
        made = self._equations(mode)
        if made is None:
            return None
        try:
            outputs, rate = self._expanded(mode, t, x)
        except (ZeroDivisionError, ValueError, OverflowError):
            return None
        active = set(active)
        broken: list[Guard] = []
        for guard, series in zip(made[0].guards, outputs, strict=True):
            if guard.ends or guard.index not in active:
                continue
            if guard.index in self.system.overrides:
                sticks = self._sticks(t, x, mode, guard.index, zero)
                # Where entry is decided by the hold zone, no slip starts inside it.
                refused = not sticks if guard.kind == "release" else sticks and self.system.held_inside(guard.index)
                if refused and guard.kind == "release" and len(active) > EXHAUSTIVE:  # a search goes where it leads
                    refused = self._sign(series, 0, rate, self._size(t, x, mode, guard.index), zero) < 0
                if refused:
                    broken.append(guard)
                if refused or guard.kind == "release":
                    continue
            first = 1 if guard.kind == "surface" else 0
            size = self._size(t, x, mode, guard.index)
            head = self._sign(series, first, rate, size, zero)
            # A surface that is never left is no slip; an equivalent sign that stays at its limit still holds.
            if head < 0 or (head == 0 and guard.kind == "surface"):
                broken.append(guard)
        return tuple(broken)

    def _staying(
        self, t: float, x: Sequence[float], mode: Mode, active: Iterable[int], zero: float
    ) -> frozenset[int] | None:
        """Surfaces that a slip does not leave, where nothing else keeps the mode out; else None."""
        broken = self._violations(t, x, mode, active, zero)
        if broken is None:
            return None
        kept = {
            guard.index for guard in broken if guard.kind == "surface" and self.stays(t, x, mode, guard.index, zero)
        }
        return frozenset(kept) if len(kept) == len(broken) else None

    def _same_motion(self, t: float, x: Sequence[float], first: Mode, second: Mode) -> bool:
        """Whether two modes that have equations have the same motion, so far as its derivatives tell."""
        made = [self._equations(mode) for mode in (first, second)]
        motions = [self._motion(own[1], own[2], t, x) for own in made if own is not None]
        return all(self._equal(one, other) for one, other in zip(*motions, strict=True))

    def stays(self, t: float, x: Sequence[float], mode: Mode, index: int, zero: float = ZERO) -> bool:
        """Whether a slip stays on a surface, so far as its derivatives tell, at a point that is on it."""
        made = self._equations(mode)
        assert made is not None
        outputs, rate = self._expanded(mode, t, x)
        own = [c for g, c in zip(made[0].guards, outputs, strict=True) if g.kind == "surface" and g.index == index]
        return not any(self._sign(c, 1, rate, self._size(t, x, mode, index), zero) for c in own)

    def _sticks(self, t: float, x: Sequence[float], mode: Mode, index: int, zero: float) -> bool:
        """Whether a surface whose sliding is overridden is slid on from here."""
        if not self.system.held_inside(index):
            return self._attracts(t, x, mode, index)
        made = self._equations(replaced(mode, index, 0))
        if made is None:  # beside another sliding surface it has no equations: no derivatives, but the load is there
            values = self._hold_values(mode, index)
            # A load that depends on how another surface slides is not known: no slip is told from a stick there.
            return values is None or all(value > 0 for value in values(t, *x))
        equations, tape, numbers = made
        ends = [k for k, g in enumerate(equations.guards) if g.kind == "release" and g.index == index]
        try:
            return self._holds_by(tape, numbers, ends, t, x, zero)
        except (ZeroDivisionError, ValueError, OverflowError):
            return False

    def _hold_values(self, mode: Mode, index: int) -> Callable[..., list[float]] | None:
        """(t, *x) -> release guards of an override beside a mode's slips; None where they hold another sign."""
        key = replaced(mode, index, 0), index
        if key not in self._holds:
            with one_at_a_time():
                guards = [g.expression for g in self.system.hold_guards(index, mode)]
                known = not any(g.has(*self.system.signs) for g in guards)
                self._holds[key] = self._function(self.system.states, guards) if known else None
        return self._holds[key]

    def _both_sides(self, t: float, x: Sequence[float], mode: Mode, index: int) -> tuple[float, float]:
        """dh/dt of a surface below and above it (signs of the mode elsewhere)."""
        kept = self._at(t, x).normals
        sides = [replaced(mode, index, -1), replaced(mode, index, 1)]
        for side in sides:
            if side not in kept:
                kept[side] = self._normals(t, *x, *side)
        return kept[sides[0]][index], kept[sides[1]][index]

    def _way(self, t: float, x: Sequence[float], mode: Mode, index: int) -> int:
        """Where a surface is left to by the signs of the mode elsewhere; 0 where it attracts or it cannot be told."""
        try:
            below, above = self._both_sides(t, x, mode, index)
        except (ZeroDivisionError, ValueError, OverflowError):
            return 0
        return 1 if below > 0 and above > 0 else -1 if below < 0 and above < 0 else 0

    def _attracts(self, t: float, x: Sequence[float], mode: Mode, index: int) -> bool:
        return self._attracts_by(*self._both_sides(t, x, mode, index))

    def _size(self, t: float, x: Sequence[float], mode: Mode, index: int) -> float:
        """What dh/dt is small or large against."""
        try:
            below, above = self._both_sides(t, x, mode, index)
        except (ZeroDivisionError, ValueError, OverflowError):
            return 0.0
        return abs(below) + abs(above)


def _digits(t: Any) -> str:
    """A time as messages have it."""
    return f"{float(t):.17g}"
