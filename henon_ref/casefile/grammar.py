"""Words of expressions: functions, constants, names, and how much of everything there may be."""

from __future__ import annotations

import keyword
import re
from collections.abc import Collection, Mapping

from henon_ref.errors import ExpressionError
from henon_ref.taylor.rules import FUNCTIONS as SMOOTH
from henon_ref.text import did_you_mean, listed, shortened

MAX_LENGTH = 10_000
"""Characters an expression may have."""
MAX_TOKENS = 2_000
"""Numbers, names, operators and parentheses an expression may have."""
MAX_DEPTH = 60
"""How deep parentheses, calls, signs and powers may nest."""
MAX_NESTING = 16
"""How deep functions and powers may stand in each other: every solver's derivatives grow with it."""
MAX_STATES = 256
"""States, and surfaces, that the system of a file may have."""
MOST_STATES = 4_096
"""The same of one from Python."""
MAX_DIGITS = 400
"""Digits a number may have, and the largest absolute decimal exponent."""
LONGEST_WHOLE = 4 * MAX_DIGITS
"""Bits of a whole number of Python."""

FUNCTIONS = (*SMOOTH, "sqrt")
"""Functions allowed in every expression; each takes one argument."""
MANY = 1_000
"""Arity of a function that takes two arguments or more."""
CONSTANT_FUNCTIONS = {"abs": 1, "atan2": 2}
"""Functions allowed where the value is a number (parameters, initial values ...), with their arity."""
KINK_FUNCTIONS = {"abs": 1, "sign": 1, "min": MANY, "max": MANY, "piecewise": MANY}
"""Functions allowed in fields, whose kinks and jumps become surfaces, with their arity."""
EULER = "e"
CONSTANTS = ("pi", EULER)
NOT_STATES = ("t", "mode")
"""Keys of ``initial`` that are no state."""
RESERVED = frozenset((*FUNCTIONS, *CONSTANT_FUNCTIONS, *KINK_FUNCTIONS, *CONSTANTS, "π", *NOT_STATES))
"""Names that a state, parameter or sign symbol may not have."""
TAKEN = frozenset(
    (
        "case", "reading", "solver", "rtol", "step_s", "index", "kind", "surface", "from_mode", "to_mode",
        "reference_time_s", "reference_radius_s", "time_s", "time_error_s", "conditioning", "transversality",
        "graze_distance", "outcome", "verdict",
    )
)  # fmt: skip
"""Columns of ``transitions.csv``, where a state's column has the name of the state: a state may not have them."""

LETTER = "A-Za-zΑ-ΡΣ-Ωα-ω"
"""Latin and Greek, as a class of characters."""
_KINK = re.compile(rf"\b({'|'.join(KINK_FUNCTIONS)})\s*\(")
NAME = re.compile(rf"[{LETTER}][{LETTER}0-9_]*")
LOOKALIKES = {"−": "-", "–": "-", "×": "*", "·": "*", "÷": "/", "²": "^2", "³": "^3", "[": "(", "]": ")", "|": "abs()"}
LOOKALIKES |= {"≤": "<=", "≥": ">=", "µ": "μ, the Greek letter (U+03BC)"}
"""Characters that people write -> what is meant."""
TWO_CONDITIONS = (
    "a condition has one comparison: where two are to hold, write one piecewise in another, as in "
    "piecewise(piecewise(1, x < 1, 0), x > 0, 0) for 0 < x < 1"
)
_HINTS: dict[str, str] = {
    **dict.fromkeys(
        KINK_FUNCTIONS,
        "what jumps or has a kink stands in 'field' and 'surfaces', in a scene in 'value' and 'normal': elsewhere "
        "name a surface h and use its sign s, as in s*h",
    ),
    **dict.fromkeys(("heaviside", "Heaviside"), "write piecewise(1, x > 0, 0)"),
    "Piecewise": "write piecewise(value, condition, value otherwise), as in piecewise(1, x < 0, 2)",
    "where": "write piecewise(value, condition, value otherwise), as in piecewise(1, x < 0, 2)",
    **dict.fromkeys(("np", "numpy", "math", "sp", "sympy"), "functions stand by themselves, as in sin(x)"),
    **dict.fromkeys(("And", "Or", "Not"), TWO_CONDITIONS),
    "π": "write pi",
    **dict.fromkeys(("Abs", "fabs"), "write abs(...)"),
    **dict.fromkeys(
        ("floor", "ceil", "round", "mod"), "it jumps without end; write a finite number of jumps with piecewise or sign"
    ),
    **dict.fromkeys(("nan", "NaN", "inf", "Inf", "infinity", "oo"), "a number must be finite"),
    **{f"arc{name}": f"write a{name}(...)" for name in ("tan", "sin", "cos")},
    "sgn": "write sign(...)",
    "Max": "write max(a, b)",
    "Min": "write min(a, b)",
    "ln": "write log(...)",
}


def name_problem(name: str, *, parameter: bool = False) -> str:
    """Why a state or surface (or parameter) may not be called this; empty if it may.

    A parameter ``e``, such as a restitution, is what ``e`` means wherever it is declared; else it is Euler's number.
    """
    if parameter and name == EULER:
        return ""
    if not NAME.fullmatch(name):
        like = next((f"; write {LOOKALIKES[c]}" for c in name if c in LOOKALIKES), "")
        return f"{shortened(name)} is no name: a letter (Latin or Greek) first, then letters, digits, underscores{like}"
    if name in RESERVED:
        return f"'{name}' is taken (t, pi, π, e, mode and the names of functions are); choose another name"
    if keyword.iskeyword(name):
        return f"'{name}' is a word of Python that expressions cannot hold; choose another name, such as '{name}_'"
    return ""


def may_have_kinks(text: str) -> bool:
    """Whether a text calls a function that has kinks or jumps."""
    return _KINK.search(text) is not None


def check_name(name: str, names: Collection[str], functions: Mapping[str, int], offset: int) -> None:
    """Refuse a name, or a function, that is not known."""
    if name in names or name in CONSTANTS or name in functions:
        return
    if name == "atan2":
        raise ExpressionError("'atan2' is allowed among parameters only", offset)
    if name in _HINTS:
        what = "is not allowed here" if name in KINK_FUNCTIONS else "is not known"
        raise ExpressionError(f"'{name}' {what}; {_HINTS[name]}", offset)
    known = [*names, *CONSTANTS]
    raise ExpressionError(
        f"unknown name {shortened(name)}{did_you_mean(name, [*known, *functions])}; "
        f"known here: {listed(known)}; functions: {', '.join(functions)}",
        offset,
    )
