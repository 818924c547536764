"""Enclosure of a set of solutions, propagated step by step through the modes with its derivative by the start."""

from __future__ import annotations

from collections.abc import Sequence
from math import log2

from flint import arb, arb_mat

from henon_ref.enclosure.balls import enclose
from henon_ref.enclosure.consistency import Entry
from henon_ref.enclosure.enclosure import Curve, Expansion, PointSet, Tail, UndecidedError, diagonal, expand
from henon_ref.enclosure.event import Hit, first_fall, guard_curve, guard_text
from henon_ref.enclosure.impacts import Accumulation, ProvenMaps, Rest
from henon_ref.enclosure.mode_selection import entry_after, entry_after_jump, entry_at_rest
from henon_ref.enclosure.model import ModeModel, SystemModel
from henon_ref.modes.equations import Guard, gradient
from henon_ref.modes.mode import Mode, replaced
from henon_ref.modes.resets import REMAINING, Jump, impact_of, resetting, time_to_rest
from henon_ref.precision import working_precision


class ValidatedFlow:
    """A set of points (t, x) that validated steps propagate.

    ``bits`` is the working precision of ``flint.ctx`` whenever a method is called, ``unit`` the initial time unit, a
    power of two. ``span``: length of the run [s], the scale on which accumulating impacts are detected; 0 disables the
    detection. ``sharp``: derivatives are accurate to all digits, not only enough to propagate a radius.
    """

    def __init__(
        self,
        model: SystemModel,
        points: PointSet,
        entry: Entry,
        bits: int,
        *,
        unit: float = 1.0,
        span: float = 0.0,
        sharp: bool = False,
    ) -> None:
        self.model, self.points, self.unit, self.sharp = model, points, unit, sharp
        self.bits, self.order = bits, max(14, round(0.38 * bits))  # at this order, steps are cheapest
        self.tangent_bits, self.tangent_order = (bits, self.order) if sharp else (64, 16)
        self.derivative = diagonal([1] * len(points.centre))
        """Encloses the derivative of the present (t, x) by the initial (t, x), with saltation at the events."""
        self.span = span
        self._accumulating: int | None = None
        """Surface whose impacts are near their limit and are no longer recorded."""
        self.steps = 0
        self.done = False
        """Whether the horizon is reached."""
        self.enter(entry)

    def enter(self, entry: Entry) -> None:
        self.mode = entry.mode
        self.zeros = entry.zeros
        self.armed = [not g.rising_only for g in self.model.mode(entry.mode).guards]

    def step(self, horizon: arb) -> Hit | None:
        """Take one step: to its end, to the next event (its new mode is then entered), or to the horizon.

        Return the event, if any; :attr:`done` is then True if the horizon is reached.
        """
        self.steps += 1
        made = self.model.mode(self.mode)
        names = self.model.system.sign_names
        flow, tangent, reach = self._expansions(made)
        self.points = self.points.scaled([self.unit * reach, *flow.sizes[: len(flow.states)]])
        remaining = (horizon - self.points.hull()[0]) / arb(self.unit)
        left = float(remaining.upper()) * (1 + 2.0**-50)
        curves = self._guards(made, flow, tangent)
        watched = [(c, a, guard_text(g, names)) for c, a, g in zip(curves, self.armed, made.guards, strict=True)]
        try:
            hit, armed = first_fall(watched, reach, left)
        except UndecidedError as stop:
            at = self.points.centre[0] + arb(self.unit) * arb(stop.place or 0.0)
            raise UndecidedError(f"{stop.reason}, near t = {at.str(12, radius=False)}", stop.kind) from stop
        if hit is not None and not hit[1] < remaining:
            if not hit[1] > remaining:
                raise UndecidedError(f"{watched[hit[0]][2]} falls at the horizon itself", "tie")
            hit = None
        if hit is None:
            self.armed, self.zeros = armed, (0,) * len(armed)
            self.done = left < reach
            self._advance(flow, tangent, reach, horizon if self.done else None)
            self._follow_unit(flow, left)
            return None
        result = self._land(made, flow, tangent, *hit)
        self._follow_unit(flow, left)
        return result

    def _follow_unit(self, flow: Expansion, left: float) -> None:
        """Set the time unit to the size of the last disc, but at most to about twice the remaining time."""
        self.unit *= 2.0 ** round(min(log2(flow.radius), log2(left) + 1 if left > 0 else 0.0))

    def _expansions(self, made: ModeModel) -> tuple[Expansion, Expansion, float]:
        """Expand the centre's solution, and the variational equations over the set; third: the step valid for both."""
        centre, hull = self.points.centre, self.points.hull()
        flow = expand(made.flow, centre[0], centre[1:], self.order, self.unit)
        self.unit = flow.unit
        reach = flow.reach(self.bits)
        size = len(hull)
        start = [arb(int(j == i + 1)) for j in range(size) for i in range(size - 1)]
        disc = flow.radius if self.sharp else 4.0 * reach
        with working_precision(self.tangent_bits):
            box = [b + 0 for b in hull]
            tangent = expand(made.tangent, box[0], [*box[1:], *start], self.tangent_order, self.unit, disc)
            if self.sharp:
                reach = min(reach, tangent.reach(self.bits))
        return flow, tangent, min(reach, tangent.radius / 2)

    def _derivative(self, tangent: Expansion, s: arb) -> list[list[arb]]:
        """Rows of the derivative of (t, x) by the initial (t, x) at a time on the step."""
        size = len(self.points.centre)
        with working_precision(self.tangent_bits):
            values = [tangent.state(i).at(s) for i in range(len(tangent.states))]
        rows = [[values[(j + 1) * (size - 1) + i] for j in range(size)] for i in range(size - 1)]
        return [[arb(int(j == 0)) for j in range(size)], *rows]

    def _guards(self, made: ModeModel, flow: Expansion, tangent: Expansion) -> list[Curve]:
        """Enclose every guard over the set, divided by its exact zeros at the start of the step."""
        return [
            guard_curve(flow.outputs[i], *self._stray(tangent, i, flow.output_tail(i)), self.zeros[i])
            for i in range(len(made.guards))
        ]

    def _stray(self, tangent: Expansion, guard: int, own: Tail) -> tuple[list[arb], list[Tail]]:
        """Deviations of a guard's coefficients over the set from those of the centre, and the guard's remainders."""
        size = len(self.points.centre)
        first = guard * size
        offsets = [h - c for h, c in zip(self.points.hull(), self.points.centre, strict=True)]
        with working_precision(self.tangent_bits):
            columns = tangent.outputs[first : first + size]
            rows = arb_mat([[c[k] for c in columns] for k in range(tangent.order + 1)])
            stray = self.points.deviations(rows)
            bound = sum((arb(tangent.output_tails[first + j]) * abs(o) for j, o in enumerate(offsets)), arb(0)).upper()
        return stray, [own, Tail(tangent.order + 1, float(bound) * (1 + 2.0**-40) + 1e-300, tangent.radius)]

    def _advance(self, flow: Expansion, tangent: Expansion, end: float, horizon: arb | None) -> None:
        """Move the set to the end of a step or to the horizon: a fixed time for every point of the set."""
        hull = self.points.hull()
        unit = arb(self.unit)
        if horizon is None:
            s = arb(end)
            centre = [self.points.centre[0] + unit * s, *(flow.state(i).at(s) for i in range(len(flow.states)))]
            self._move(centre, self._derivative(tangent, s))
            return
        middle = ((horizon - self.points.centre[0]) / unit).mid()
        span = (horizon - hull[0]) / unit
        # The gap (horizon - t) shrinks as t grows: slope -1, derivative (-1, 0, ..., 0), as for any event.
        gap = horizon - self.points.centre[0] - unit * middle
        row = [arb(-int(j == 0)) for j in range(len(hull))]
        made = self.model.mode(self.mode)
        self._project(made, flow, tangent, span.union(middle), middle, gap, row, -unit, ())

    def _land(self, made: ModeModel, flow: Expansion, tangent: Expansion, index: int, root: arb) -> Hit:
        """Move the set onto the guard that fell, decide the next mode, and enter it."""
        size = len(self.points.centre)
        middle = root.mid()
        stray, tails = self._stray(tangent, index, flow.output_tail(index))
        slope = guard_curve(flow.outputs[index], stray, tails, 0).slope(root)
        with working_precision(self.tangent_bits):
            row = [tangent.output(index * size + j).at(root) for j in range(size)]
        if not slope < 0:
            raise UndecidedError("the guard's slope has no strict sign at the event: a graze", "graze")
        guard = made.guards[index]
        before = self.mode
        reached = set() if guard.ends else {guard.index}
        on = tuple(sorted({i for i, s in enumerate(before) if s == 0} | reached))
        self._project(made, flow, tangent, root, middle, flow.output(index).at(middle), row, slope, on)
        resets = resetting(self.model.system, before, [guard])
        rate = slope / arb(self.unit)
        if resets:
            return self._reset(guard, before, rate)
        if self._accumulating is not None:
            raise UndecidedError("another event occurs near the limit of accumulating impacts", "mode")
        box = tuple(self.points.hull())
        entry = entry_after(self.model, box, before, guard)
        self.enter(entry)
        return Hit(guard, before, entry.mode, box, rate)

    def _reset(self, guard: Guard, before: Mode, rate: arb) -> Hit:
        index, arrived = guard.index, self.points.hull()
        if self._accumulating not in (None, index):
            raise UndecidedError("another surface resets the state near the limit of accumulating impacts", "mode")
        maps = ProvenMaps(self.model, before, index)
        applied = []
        while maps.due:
            jump = maps.next(self.points.hull())
            self._jump(jump)
            applied.append((maps.applied[-1], tuple(self.points.hull())))
            maps.after(jump, self.points.hull())
        box = tuple(self.points.hull())
        entry = entry_after_jump(self.model, box, maps.sides, maps.speeds)
        after, rest = entry.mode, None
        for i, speed in maps.speeds.items():
            if after[i] == 0 and i in maps.applied and speed == 0:  # the impact leaves no normal velocity
                after, rest = replaced(after, i, 1), Rest(entry.mode, box)
        recorded = self._accumulating is None
        if rest is None and index in maps.speeds and after[index] > 0:
            rest = self._limit(index, before, after, maps.speeds[index], arrived)
        if rest is not None and rest.box is not box:
            self._accumulating = None
            self.points = PointSet.box(rest.box)
            entry = entry_at_rest(self.model, rest.box, rest.mode)
        if self._accumulating is not None and len(applied) > 1:
            raise UndecidedError("another surface resets the state near the limit of accumulating impacts", "mode")
        self.enter(entry)
        return Hit(guard, before, after, box, rate, tuple(applied), rest, recorded)

    def _limit(self, index: int, before: Mode, after: Mode, speed: arb, arrived: Sequence[arb]) -> Rest | None:
        """Limit of accumulating impacts, if near enough to be enclosed; mark when impacts are no longer recorded."""
        if not self.span:
            return None
        impact, box = impact_of(self.model.system, index), self.points.hull()
        assert impact is not None
        at = self.model.at(box)
        made = self.model.mode(after)
        own = next(g for g in made.guards if g.kind == "surface" and g.index == index)
        bend = enclose(made.lie_derivative(made.lie_derivative(own.expression)), at)
        fall = enclose(self.model.system.numeric(impact.speed), self.model.at(arrived))
        time = time_to_rest(fall, speed, bend, arb(REMAINING * self.span))
        if time is None:
            return None
        if impact.refusal:
            name = self.model.system.sign_names[index]
            raise UndecidedError(f"the limit of impacts on {name} is not enclosed: {impact.refusal}", "mode")
        if any(j != index and old != new for j, (old, new) in enumerate(zip(before, after, strict=True))):
            raise UndecidedError("a surface changes its side with the impacts that accumulate", "mode")
        self._accumulating = index
        if not time < 2.0**-56 * self.span:  # the radius of the limit is about the square of it
            return None
        return Accumulation(self.model, index, after, speed, box).rest()

    def _jump(self, jump: Jump) -> None:
        """Map the set through a jump of the state: the value at the centre, the derivative over the set."""
        symbols, (time, *_) = self.model.symbols, self.points.centre
        at, over = self.model.at(self.points.centre), self.model.at(self.points.hull())
        states = [self.model.system.numeric(value) for value in jump.states]
        rows = [[arb(int(j == 0)) for j in range(len(symbols))]]
        rows += [[enclose(slope, over) for slope in gradient(value, symbols)] for value in states]
        self._move([time, *(enclose(value, at) for value in states)], rows)

    def _project(
        self,
        made: ModeModel,
        flow: Expansion,
        tangent: Expansion,
        root: arb,
        middle: arb,
        value: arb,
        row: Sequence[arb],
        slope: arb,
        on: tuple[int, ...],
    ) -> None:
        """Move every point of the set to its own zero of a function g, and set the states that are then known exactly.

        With ``g(s; X) = value + row (X - centre) + slope (s - middle)`` (enclosures over the set), a point moves by
        ``(s - middle) (1, f)`` from its position at ``middle``; the derivative of this map is the saltation matrix.
        """
        size = len(self.points.centre)
        offsets = [h - c for h, c in zip(self.points.hull(), self.points.centre, strict=True)]
        start, unit = self.points.centre[0], arb(self.unit)
        moved = self._derivative(tangent, root)
        here = [start + unit * root, *(flow.state(i).at(root) for i in range(size - 1))]
        hull = [c + _dot(r, offsets) for c, r in zip(here, moved, strict=True)]
        speed = [f * unit / slope for f in made.field_over(hull)]
        centre = [start + unit * middle, *(flow.state(i).at(middle) for i in range(size - 1))]
        centre = [c - v * value for c, v in zip(centre, speed, strict=True)]
        derivative = [[d - v * w for d, w in zip(r, row, strict=True)] for r, v in zip(moved, speed, strict=True)]
        self._clean(centre, derivative, offsets, on)
        self._move(centre, derivative)

    def _clean(
        self, centre: list[arb], derivative: list[list[arb]], offsets: Sequence[arb], on: tuple[int, ...]
    ) -> None:
        """Set each state for which a surface that is now exactly zero is solved."""
        for index, value, partial in self.model.solved(on):
            k = index + 1
            over = self.model.at([c + _dot(r, offsets) for c, r in zip(centre, derivative, strict=True)])
            centre[k] = enclose(value, self.model.at(centre))
            slopes = [(i, enclose(g, over)) for i, g in enumerate(partial) if i != k]
            derivative[k] = [sum((g * derivative[i][j] for i, g in slopes), arb(0)) for j in range(len(centre))]

    def _move(self, centre: Sequence[arb], derivative: list[list[arb]]) -> None:
        matrix = arb_mat(derivative)
        self.points = self.points.moved(centre, matrix)
        self.derivative = matrix * self.derivative


def _dot(row: Sequence[arb], column: Sequence[arb]) -> arb:
    return sum((a * b for a, b in zip(row, column, strict=True)), arb(0))
