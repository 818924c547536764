"""Vocabulary of expressions: functions, constants, names, and limits of size."""

from __future__ import annotations

import keyword
import re
from collections.abc import Collection, Mapping

from henon_ref.errors import ExpressionError
from henon_ref.text import did_you_mean, listed, shortened

MAX_LENGTH = 10_000
"""Largest number of characters of an expression."""
MAX_TOKENS = 2_000
"""Largest number of tokens (numbers, names, operators and parentheses) of an expression."""
MAX_DEPTH = 60
"""Largest depth of nested parentheses, calls, signs and powers."""
MAX_NESTING = 16
"""Largest depth of functions and powers inside each other: the cost of derivatives grows with it."""
MAX_STATES = 256
"""Largest number of states, and of surfaces, of a system in a file."""
MOST_STATES = 4_096
"""Largest number of states, and of surfaces, of a system from Python."""
MAX_DIGITS = 400
"""Largest number of digits of a number, and largest absolute value of its decimal exponent."""
LONGEST_WHOLE = 4 * MAX_DIGITS
"""Largest number of bits of a Python integer."""

ELEMENTARY = ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log")
"""Functions of one argument that SymPy has as classes, by their names there; its square root is a power."""
FUNCTIONS = (*ELEMENTARY, "sqrt")
"""Functions allowed in every expression, of one argument each."""
ANY_NUMBER = 1_000
"""Stands for the arity of a function of two or more arguments."""
CONSTANT_FUNCTIONS = {"abs": 1, "atan2": 2}
"""Function -> arity: functions also allowed in an expression whose value is a number (parameters, initial values)."""
KINK_FUNCTIONS = {"abs": 1, "sign": 1, "min": ANY_NUMBER, "max": ANY_NUMBER, "piecewise": ANY_NUMBER}
"""Function -> arity: functions also allowed in fields, whose kinks and jumps become surfaces."""
EULER = "e"
CONSTANTS = ("pi", EULER)
NOT_STATES = ("t", "mode")
"""Keys of ``initial`` that are not states."""
RESERVED = frozenset((*FUNCTIONS, *CONSTANT_FUNCTIONS, *KINK_FUNCTIONS, *CONSTANTS, "π", *NOT_STATES))
"""Names that a state, parameter or sign symbol must not have."""
TAKEN = frozenset(
    (
        "case", "reading", "solver", "rtol", "step_s", "index", "kind", "surface", "from_mode", "to_mode",
        "reference_time_s", "reference_radius_s", "time_s", "time_error_s", "conditioning", "transversality",
        "graze_distance", "outcome", "verdict",
    )
)  # fmt: skip
"""Fixed columns of ``transitions.csv``. A state must not have such a name, since its column is named after it."""

LETTER = "A-Za-zΑ-ΡΣ-Ωα-ω"
"""Latin and Greek letters, as a character class."""
NAME = re.compile(rf"[{LETTER}][{LETTER}0-9_]*")
LOOKALIKES = {"−": "-", "–": "-", "×": "*", "·": "*", "÷": "/", "²": "^2", "³": "^3", "[": "(", "]": ")", "|": "abs()"}
LOOKALIKES |= {"≤": "<=", "≥": ">=", "µ": "μ, the Greek letter (U+03BC)"}
"""Characters often written by mistake -> replacement suggested."""
TWO_CONDITIONS = (
    "a condition has one comparison: for two conditions at once write a piecewise inside another, as in "
    "piecewise(piecewise(1, x < 1, 0), x > 0, 0) for 0 < x < 1"
)
_HINTS: dict[str, str] = {
    **dict.fromkeys(
        KINK_FUNCTIONS,
        "functions with a jump or a kink are allowed in 'field' and 'surfaces' (in a scene in 'value' and 'normal'); "
        "elsewhere define a surface h and use its sign s, as in s*h",
    ),
    **dict.fromkeys(("heaviside", "Heaviside"), "write piecewise(1, x > 0, 0)"),
    "Piecewise": "write piecewise(value, condition, value otherwise), as in piecewise(1, x < 0, 2)",
    "where": "write piecewise(value, condition, value otherwise), as in piecewise(1, x < 0, 2)",
    **dict.fromkeys(("np", "numpy", "math", "sp", "sympy"), "write functions without a prefix, as in sin(x)"),
    **dict.fromkeys(("And", "Or", "Not"), TWO_CONDITIONS),
    "π": "write pi",
    **dict.fromkeys(("Abs", "fabs"), "write abs(...)"),
    **dict.fromkeys(
        ("floor", "ceil", "round", "mod"), "it jumps infinitely often; write finitely many jumps with piecewise or sign"
    ),
    **dict.fromkeys(("nan", "NaN", "inf", "Inf", "infinity", "oo"), "a number must be finite"),
    **{f"arc{name}": f"write a{name}(...)" for name in ("tan", "sin", "cos")},
    "sgn": "write sign(...)",
    "Max": "write max(a, b)",
    "Min": "write min(a, b)",
    "ln": "write log(...)",
}


def name_problem(name: str, *, parameter: bool = False, state: bool = False) -> str:
    """Return why a state, surface or parameter must not have this name; empty if it may.

    A parameter may be called ``e`` (such as a restitution); expressions then use it in place of Euler's number. A state
    must not be called as a column of ``transitions.csv``.
    """
    if parameter and name == EULER:
        return ""
    if not NAME.fullmatch(name):
        like = next((f"; write {LOOKALIKES[c]}" for c in name if c in LOOKALIKES), "")
        return f"{shortened(name)} is not a name: a letter (Latin or Greek), then letters, digits and underscores{like}"
    if name in RESERVED:
        return f"'{name}' is reserved (as t, pi, π, e, mode and all names of functions); choose another name"
    if keyword.iskeyword(name):
        return f"'{name}' is a keyword of Python; choose another name, such as '{name}_'"
    if state and name in TAKEN:
        return f"'{name}' is the name of another column of transitions.csv; choose another name"
    return ""


def may_have_kinks(text: str) -> bool:
    """Check whether a text calls a function that has kinks or jumps."""
    return re.search(rf"\b({'|'.join(KINK_FUNCTIONS)})\s*\(", text) is not None


def check_name(name: str, names: Collection[str], functions: Mapping[str, int], offset: int) -> None:
    """Raise ExpressionError if a name is unknown or must not be used here."""
    if name in names or name in CONSTANTS or name in functions:
        return
    if name == "atan2":
        raise ExpressionError("'atan2' is allowed in parameters, initial values and times only", offset)
    if name in _HINTS:
        what = "is not allowed here" if name in KINK_FUNCTIONS else "is not known"
        raise ExpressionError(f"'{name}' {what}; {_HINTS[name]}", offset)
    known = [*names, *CONSTANTS]
    raise ExpressionError(
        f"unknown name {shortened(name)}{did_you_mean(name, [*known, *functions])}; "
        f"known here: {listed(known)}; functions: {', '.join(functions)}",
        offset,
    )
