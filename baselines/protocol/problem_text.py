"""Conversion of a problem to the request's text: modes, right-hand sides, guards and their successors.

C, Octave, Python, Julia, JavaScript and awk can evaluate the expressions: doubles, names, ``+ - * /``, parentheses,
``pow(a, b)``, and sin cos tan asin acos atan sinh cosh tanh exp log sqrt. Numbers always have a point or an exponent,
so that ``1.0/2.0`` is a half in every language. Greek letters are spelled out.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import sympy as sp
from sympy.printing.str import StrPrinter

from henon_ref.baselines.protocol import messages
from henon_ref.baselines.surface_functions import is_linear
from henon_ref.errors import ModelError, UnsupportedError
from henon_ref.expressions.grammar import FUNCTIONS
from henon_ref.modes import equations
from henon_ref.modes.callables import rounded
from henon_ref.modes.mode import Mode
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
from henon_ref.text import spelled


def problem_text(problem: Problem, start: Mode) -> messages.Problem:
    """Convert a problem that starts in the mode ``start`` to a message of the protocol.

    UnsupportedError if the system has not exactly one surface, the initial mode has no equations, or the protocol
    cannot express the system (jumps of the state, a slide on an intersection, a name, a function).
    """
    system = problem.system
    if len(system.surfaces) != 1:
        raise UnsupportedError(f"the protocol supports exactly one surface, not {len(system.surfaces)}")
    if system.resets:
        raise UnsupportedError("the protocol does not support jumps of the state")
    modes = [text for side in (-1, 0, 1) if (text := _mode_text(system, (side,))) is not None]
    if start[0] not in [text.mode for text in modes]:
        raise UnsupportedError("the initial mode has no equations")
    names = [spelled(str(name)) for name in (*system.states, *system.parameters)]
    if clash := sorted({"t", "pow"}.intersection(names)):
        raise UnsupportedError(f"the protocol reserves the name {clash[0]}; rename the state or parameter")
    if twice := sorted(name for name in set(names) if names.count(name) > 1):
        raise UnsupportedError(f"two names become {twice[0]} with Greek letters spelled out; rename one of them")
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
    """Convert one mode; None if it has no equations."""
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
        raise UnsupportedError("the protocol does not support slides on an intersection of surfaces")
    rate = equations.along(guard.expression, system.states, mode.field)
    return messages.Guard(
        kind=guard.kind,
        expression=infix(guard.expression),
        rate=infix(rate),
        rate_slopes=[infix(sp.diff(rate, x)) for x in system.states],
        linear=is_linear(system.numeric(guard.expression), system.states),
        armed=not (guard.rising_only or guard.held),
        successors=_successors(system, guard),
    )


def _successors(system: FilippovSystem, guard: equations.Guard) -> list[messages.Successor]:
    """Successors of a guard, by the normal velocities on the two sides (Filippov 1988, Sec. 4)."""
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


class _Printer(StrPrinter):
    """Printer that writes each number as one double, and powers as products, quotients, ``sqrt`` and ``pow``."""

    def _print_Symbol(self, expr: sp.Expr) -> str:  # noqa: N802
        return spelled(expr.name)

    def _double(self, expr: sp.Expr) -> str:
        return repr(float(expr))

    # These replace SymPy's methods of their names.
    _print_Float = _print_Integer = _print_Rational = _print_Zero = _double  # noqa: N815

    def _print_Mul(self, expr: sp.Expr) -> str:  # noqa: N802
        above: list[sp.Expr] = []
        below: list[sp.Expr] = []
        for factor in expr.as_ordered_factors():
            inverse = factor.is_Pow and factor.exp.is_number and factor.exp.is_negative
            (below if inverse else above).append(1 / factor if inverse else factor)
        sign = "-" if above and above[0] == -1 else ""
        above = above[1:] if sign else above
        product = "*".join(map(self._factor, above)) or "1.0"
        return sign + product + "".join(f"/{self._factor(factor)}" for factor in below)

    def _factor(self, expr: sp.Expr) -> str:
        text: str = self._print(expr)
        product = expr.is_Pow and expr.exp.is_Integer and "*" in text and "pow(" not in text
        return f"({text})" if expr.is_Add or expr.is_Mul or text.startswith("-") or "/" in text or product else text

    def _print_Pow(self, expr: sp.Expr, rational: bool = False) -> str:  # noqa: N802
        base, exponent = expr.base, expr.exp
        if exponent.is_number and exponent.is_negative:
            return f"1.0/{self._factor(1 / expr)}"
        if exponent == sp.Rational(1, 2):
            return f"sqrt({self._print(base)})"
        if base.is_Symbol and exponent.is_Integer and exponent <= 4:
            return "*".join([self._print(base)] * int(exponent))
        return f"pow({self._print(base)}, {self._print(exponent)})"

    def _print_Function(self, expr: sp.Expr) -> str:  # noqa: N802
        name = expr.func.__name__
        if name not in (*FUNCTIONS, "pow"):
            raise UnsupportedError(f"the protocol has no function {name}")
        return f"{name}({', '.join(map(self._print, expr.args))})"

    _print_exp = _print_Function


def infix(expression: sp.Expr) -> str:
    """Return the text of an expression; UnsupportedError if the protocol has no such function.

    Examples
    --------
    >>> x, v, m = sp.symbols("x v m", real=True)
    >>> infix(-x / m + sp.Rational(1, 3) * sp.cos(v) ** 2 - sp.sqrt(2) * x**3)
    '-1.4142135623730951*(x*x*x) + 0.3333333333333333*pow(cos(v), 2.0) - x/m'
    """
    text: str = _Printer().doprint(rounded(expression))
    return text


def renamed(text: str, names: Mapping[str, str]) -> str:
    """Replace the names in a text that ``names`` lists.

    Examples
    --------
    >>> renamed("1e5*e5 + sin(x)", {"e5": "p[0]", "x": "x[0]"})
    '1e5*p[0] + sin(x[0])'
    """
    return re.sub(r"(?<![\w.])[^\W\d_]\w*", lambda found: names.get(found[0], found[0]), text)
