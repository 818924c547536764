"""A problem as the request has it: the mode table, right-hand sides, guards and what follows them, as text."""

from __future__ import annotations

import sympy as sp

from henon_ref.baselines.mode_functions import is_linear
from henon_ref.baselines.protocol import messages
from henon_ref.baselines.protocol.text import infix
from henon_ref.errors import ModelError, UnsupportedError
from henon_ref.modes import equations
from henon_ref.modes.mode import Mode
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
from henon_ref.text import spelled

RESERVED = ("t", "pow")
"""Names that mean something else in expressions."""


def problem_text(problem: Problem, start: Mode) -> messages.Problem:
    """The problem in the words of the protocol.

    Parameters
    ----------
    problem : Problem
    start : Mode
        Mode at the start.

    Raises
    ------
    UnsupportedError
        Where it has more than one surface or none, or the initial mode has no equations.
    """
    system = problem.system
    if len(system.surfaces) != 1:
        raise UnsupportedError(f"the protocol hands over one surface, not {len(system.surfaces)}")
    if system.resets:
        raise UnsupportedError("the protocol has no word for jumps of the state")
    modes = [text for side in (-1, 0, 1) if (text := _mode_text(system, (side,))) is not None]
    if start[0] not in [text.mode for text in modes]:
        raise UnsupportedError("the initial mode has no equations")
    names = [spelled(str(name)) for name in (*system.states, *system.parameters)]
    if clash := sorted(set(names) & set(RESERVED)):
        raise UnsupportedError(f"the protocol has a meaning of its own for the name {clash[0]}")
    if twice := sorted(name for name in set(names) if names.count(name) > 1):
        raise UnsupportedError(f"spelled out for the protocol two names are {twice[0]}")
    surface = system.surfaces[0]
    return messages.Problem(
        states=names[: len(system.states)],
        parameters={spelled(str(name)): float(value) for name, value in system.parameters.items()},
        surface=messages.Surface(
            name=spelled(str(system.signs[0])),
            expression=infix(surface),
            gradient=[infix(sp.diff(surface, x)) for x in system.states],
        ),
        modes=modes,
        start=messages.Point(time=float(problem.start), state=[float(v) for v in problem.initial], mode=start[0]),
        until=float(problem.until),
    )


def _mode_text(system: FilippovSystem, mode: Mode) -> messages.Mode | None:
    """One mode; None where it has no equations."""
    try:
        found = system.equations(mode)
    except ModelError:
        return None
    return messages.Mode(
        mode=mode[0],
        field=[infix(f) for f in found.field],
        jacobian=[[infix(sp.diff(f, x)) for x in system.states] for f in found.field],
        guards=[_guard_text(system, found, guard) for guard in found.guards],
    )


def _guard_text(system: FilippovSystem, mode: equations.ModeEquations, guard: equations.Guard) -> messages.Guard:
    if guard.kind == "attracts":
        raise UnsupportedError("the protocol has no guard that ends a slide on an intersection")
    rate = equations.along(guard.expression, system.states, mode.field)
    return messages.Guard(
        kind=guard.kind,
        expression=infix(guard.expression),
        rate=infix(rate),
        rate_slopes=[infix(sp.diff(rate, x)) for x in system.states],
        linear=is_linear(system.numeric(guard.expression), system.states),
        armed=not guard.rising_only,
        successors=_successors(system, guard),
    )


def _successors(system: FilippovSystem, guard: equations.Guard) -> list[messages.Successor]:
    """What follows where a guard has fallen: Filippov (1988), Sec. 4, by the normal velocities on the two sides."""
    if guard.ends is not None:
        return [messages.Successor(mode=None, ends="invalid", when=[])]
    if guard.kind == "release":
        return [messages.Successor(mode=guard.to_sign, ends=None, when=[])]
    normal, sign = system.normal_velocity(0), system.signs[0]
    below, above = (normal.xreplace({sign: sp.Integer(side)}) for side in (-1, 1))
    held = system.held_inside(0)
    hold = [infix(g.expression) for g in system.hold_guards(0)] if held else [infix(below), infix(-above)]
    return [
        messages.Successor(mode=0, ends=None, when=hold),
        messages.Successor(mode=1, ends=None, when=[infix(below), infix(above)]),
        messages.Successor(mode=-1, ends=None, when=[infix(-below), infix(-above)]),
        messages.Successor(mode=None, ends="nonunique", when=[infix(-below), infix(above)]),
    ]
