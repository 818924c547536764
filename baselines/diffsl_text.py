"""The equations of one mode as text in DiffSL, from the same expressions as every other adapter's.

DiffSL (https://martinjrobins.github.io/diffsl/functions.html) has neither the inverse trigonometric functions nor
acosh and atanh under names of its own that it can differentiate; its ``tan`` ends the process (Enzyme does not know
LLVM's intrinsic), so that a tangent is written as a quotient here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from henon_ref.baselines.flow import LIMIT
from henon_ref.baselines.mode_functions import ModeFunctions
from henon_ref.errors import UnsupportedError
from henon_ref.modes.callables import rounded
from henon_ref.taylor.fold import Rules, Walk, fold, fraction
from henon_ref.taylor.tape import TIME

FUNCTIONS = ("sin", "cos", "sinh", "cosh", "tanh", "exp", "log")


def mode_text(model: ModeFunctions) -> str:
    """One mode with its guards as stop functions.

    Its inputs are the initial unknowns, and for each guard a lift and a time up to which it reads 1. The last stop
    function is the guard against divergence, 1e100 minus the sum of abs(x).

    Parameters
    ----------
    model : ModeFunctions

    Raises
    ------
    UnsupportedError
        For a function that DiffSL does not have.
    """
    names = {x: f"x{k}" for k, x in enumerate(model.unknowns)}
    guards = range(len(model.guards))
    inputs = [*(f"a{k} = 0.0" for k in range(len(names)))]
    inputs += [f"{letter}{k} = 0.0" for letter in ("l", "q") for k in guards]
    awake = [f"w{k} {{ heaviside(t - q{k}) }}" for k in guards]
    stops = [f"(1.0 - w{k}) + w{k} * ({to_diffsl(model.guard_expressions[k], names)} + l{k})" for k in guards]
    size = " - ".join([number(LIMIT), *(f"abs(x{k})" for k in range(len(model.states)))])
    parts = [
        _tensor("in_i", inputs),
        _tensor("u_i", [f"{name} = a{k}" for k, name in enumerate(names.values())]),
        *awake,
        _tensor("F_i", [to_diffsl(f, names) for f in model.right]),
        _tensor("stop_i", [*stops, size]),
    ]
    return "\n".join(parts)


def _tensor(name: str, entries: Sequence[str]) -> str:
    return f"{name} {{\n  " + ",\n  ".join(entries) + "\n}"


def number(value: float) -> str:
    """A double as DiffSL reads it: digits and a point, a small e, a sign in parentheses."""
    text = repr(float(value))
    return f"({text})" if text.startswith("-") else text


def to_diffsl(expression: sp.Expr, names: Mapping[sp.Symbol, str]) -> str:
    """One expression as DiffSL.

    Parameters
    ----------
    expression : Expr
        In time and the unknowns, parameters put in.
    names : mapping
        Unknown -> its name in the text.

    Raises
    ------
    UnsupportedError
        For a function that DiffSL does not have.
    """

    def product(e: sp.Expr, walk: Walk[str]) -> str:
        above, below = fraction(e)
        numerator = " * ".join(map(walk, above)) or "1.0"
        return f"({numerator}" + "".join(f" / {walk(b)}" for b in below) + ")"

    def power(e: sp.Expr, walk: Walk[str]) -> str:
        if e.base == sp.E:
            return f"exp({walk(e.exp)})"
        if e.exp.is_Rational and e.exp.is_negative:
            return f"(1.0 / {walk(sp.Pow(e.base, -e.exp))})"
        base = walk(e.base)
        if e.exp.is_Integer and int(e.exp) <= MOST_FACTORS:
            return "(" + " * ".join([base] * int(e.exp)) + ")"
        if e.exp == sp.Rational(1, 2):
            return f"sqrt({base})"
        return f"pow({base}, {walk(e.exp)})"

    def function(e: sp.Expr, walk: Walk[str]) -> str:
        name, inner = e.func.__name__, walk(e.args[0])
        if name == "tan":
            return f"(sin({inner}) / cos({inner}))"
        if name not in FUNCTIONS:
            raise UnsupportedError(f"DiffSL has no {name}")
        return f"{name}({inner})"

    rules = Rules(
        number=lambda e: number(float(e)),
        add=lambda e, walk: "(" + " + ".join(map(walk, e.args)) + ")",
        multiply=product,
        power=power,
        function=function,
    )
    return fold(rounded(expression), rules, {TIME: "t", **names})


MOST_FACTORS = 4
"""Up to this whole number a power is written as a product, whose derivative has a value at zero, too."""
