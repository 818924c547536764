"""The text of an expression, token by token: everything that can be refused before anything is computed.

The scan checks characters, names, parentheses and the order of operands and operators, so that every
message has its place in the text, and writes ``^`` as ``**`` so that Python's own grammar gives it the
precedence of a power.
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass

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

_LETTER = "A-Za-zΑ-ΡΣ-Ωα-ω"
"""Latin and Greek, as a class of characters."""
_KINK = re.compile(rf"\b({'|'.join(KINK_FUNCTIONS)})\s*\(")
NAME = re.compile(rf"[{_LETTER}][{_LETTER}0-9_]*")

_TOKEN = re.compile(
    r"(?P<space>\s+)|(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    rf"|(?P<name>[{_LETTER}_][{_LETTER}0-9_]*)"
    r"|(?P<operator>\*\*|[-+*/^])|(?P<bracket>[(),])|(?P<comparison>[<>]=?)",
    re.ASCII,
)
_ALLOWED = "numbers, names, + - * / ** ^ and parentheses"
_LOOKALIKES = {"−": "-", "–": "-", "×": "*", "·": "*", "÷": "/", "²": "^2", "³": "^3", "[": "(", "]": ")", "|": "abs()"}
_LOOKALIKES |= {"≤": "<=", "≥": ">=", "µ": "μ, the Greek letter (U+03BC)"}
_TWO_CONDITIONS = (
    "a condition has one comparison: where two are to hold, write one piecewise in another, as in "
    "piecewise(piecewise(1, x < 1, 0), x > 0, 0) for 0 < x < 1"
)
_CONNECTIVES = ("and", "or", "not")
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
    **dict.fromkeys(("And", "Or", "Not"), _TWO_CONDITIONS),
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


@dataclass(frozen=True, slots=True)
class Token:
    """One token of an expression."""

    kind: str
    """``number``, ``name``, ``operator``, ``bracket`` or ``comparison``."""
    text: str
    offset: int
    """0-based offset in the expression."""


@dataclass(frozen=True, slots=True)
class Scanned:
    """An expression that reads well, in Python's spelling."""

    tokens: tuple[Token, ...]
    python: bytes
    """The expression with ``**`` for every ``^``, one blank between tokens; in UTF-8, by which Python's syntax trees
    count."""
    origin: tuple[int, ...]
    """For every byte of ``python`` the offset of its token in the expression."""


def name_problem(name: str, *, parameter: bool = False) -> str:
    """Why a state or surface (or parameter) may not be called this; empty if it may.

    A parameter ``e``, such as a restitution, is what ``e`` means wherever it is declared; else it is Euler's number.
    """
    if parameter and name == EULER:
        return ""
    if not NAME.fullmatch(name):
        like = next((f"; write {_LOOKALIKES[c]}" for c in name if c in _LOOKALIKES), "")
        return f"{shortened(name)} is no name: a letter (Latin or Greek) first, then letters, digits, underscores{like}"
    if name in RESERVED:
        return f"'{name}' is taken (t, pi, π, e, mode and the names of functions are); choose another name"
    if keyword.iskeyword(name):
        return f"'{name}' is a word of Python that expressions cannot hold; choose another name, such as '{name}_'"
    return ""


def may_have_kinks(text: str) -> bool:
    """Whether an expression calls a function that has kinks or jumps."""
    return _KINK.search(text) is not None


def scan(text: str, names: Collection[str], *, constant: bool = False, kinks: bool = False) -> Scanned:
    """Split an expression into tokens and check that they follow each other as they may.

    Parameters
    ----------
    text : str
    names : collection of str
        Names that may stand in it besides ``pi`` and ``e``.
    constant : bool
        Whether ``abs`` and ``atan2`` are allowed (where the value is a number).
    kinks : bool
        Whether ``abs``, ``sign``, ``min``, ``max`` and ``piecewise`` are allowed (in a field).

    Raises
    ------
    ExpressionError
        With the offset of the first thing that is not allowed.
    """
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"an expression of {len(text)} characters; at most {MAX_LENGTH} are allowed", 0)
    allowed = KINK_FUNCTIONS if kinks else CONSTANT_FUNCTIONS if constant else {}
    scanner = _Scanner(text, names, {**dict.fromkeys(FUNCTIONS, 1), **allowed})
    position = 0
    while position < len(text):
        match = _TOKEN.match(text, position)
        if match is None:
            raise _bad_character(text, position)
        if match.lastgroup != "space":
            scanner.accept(Token(str(match.lastgroup), match.group(), position))
        position = match.end()
    return scanner.finished()


def _bad_character(text: str, offset: int) -> ExpressionError:
    character = text[offset]
    if character in "&|=!" and text[:offset].rfind("piecewise") >= 0:
        equal = "an equation holds at single points only: compare with <, <=, > or >="
        return ExpressionError(equal if character in "=!" else _TWO_CONDITIONS, offset)
    like = _LOOKALIKES.get(character)
    hint = f"; write {like}" if like else ""
    return ExpressionError(f"{character!r} is not allowed in an expression{hint}; allowed: {_ALLOWED}", offset)


@dataclass
class _Open:
    """A parenthesis that is open."""

    bracket: Token
    function: Token | None
    """The function before it."""
    commas: int = 0
    """So far."""
    compared: bool = False
    """Whether this argument has its comparison."""

    @property
    def is_condition(self) -> bool:
        """Whether the argument is a condition: every second one of ``piecewise`` but for the last."""
        return self.function is not None and self.function.text == "piecewise" and self.commas % 2 == 1


class _Scanner:
    """Checks each token against what may come next."""

    def __init__(self, text: str, names: Collection[str], functions: Mapping[str, int]) -> None:
        self.text = text
        self.names = names
        self.functions = functions
        """Functions that are allowed -> arity."""
        self.tokens: list[Token] = []
        self.open: list[_Open] = []
        """Open parentheses."""
        self.signs = 0
        self.want_operand = True

    def accept(self, token: Token) -> None:
        if len(self.tokens) >= MAX_TOKENS:
            raise ExpressionError(f"more than {MAX_TOKENS} numbers, names and operators", token.offset)
        last = self.tokens[-1] if self.tokens else None
        if last is not None and last.kind == "name" and self._is_function(last.text) and token.text != "(":
            raise ExpressionError(f"the function '{last.text}' needs its argument: {last.text}(...)", last.offset)
        if token.kind in ("number", "name"):
            self._operand(token, last)
        elif token.kind == "operator":
            self._operator(token)
        elif token.kind == "comparison":
            self._comparison(token)
        else:
            self._bracket(token, last)
        self.tokens.append(token)

    def finished(self) -> Scanned:
        end = len(self.text)
        if not self.tokens:
            raise ExpressionError("an empty expression; write a number or a formula", 0)
        last = self.tokens[-1]
        if last.kind == "name" and self._is_function(last.text):
            raise ExpressionError(f"the function '{last.text}' needs its argument: {last.text}(...)", last.offset)
        if self.want_operand:
            raise ExpressionError(f"the expression ends after '{last.text}' where a number or a name is missing", end)
        if self.open:
            raise ExpressionError("'(' is never closed", self.open[-1].bracket.offset)
        pieces, origin = [], []
        for token in self.tokens:
            piece = (_python_spelling(token) + " ").encode()
            pieces.append(piece)
            origin += [token.offset] * len(piece)
        return Scanned(tuple(self.tokens), b"".join(pieces), tuple(origin))

    def _is_function(self, name: str) -> bool:
        return name in FUNCTIONS or name in CONSTANT_FUNCTIONS or name in KINK_FUNCTIONS

    def _operand(self, token: Token, last: Token | None) -> None:
        if token.text in _CONNECTIVES and token.text not in self.names:
            raise ExpressionError(f"'{token.text}' is no operator here; {_TWO_CONDITIONS}", token.offset)
        if not self.want_operand:
            assert last is not None
            raise ExpressionError(
                f"an operator is missing between '{last.text}' and '{token.text}'; a product is written with *",
                token.offset,
            )
        if token.kind == "number":
            _check_number(token)
        else:
            self._check_name(token)
        self.want_operand = False
        self.signs = 0

    def _check_name(self, token: Token) -> None:
        name = token.text
        if name in self.names or name in CONSTANTS or name in self.functions:
            return
        known = [*self.names, *CONSTANTS]
        functions = list(self.functions)
        if name == "atan2":
            raise ExpressionError("'atan2' is allowed among parameters only", token.offset)
        if name in _HINTS:
            what = "is not allowed here" if name in KINK_FUNCTIONS else "is not known"
            raise ExpressionError(f"'{name}' {what}; {_HINTS[name]}", token.offset)
        raise ExpressionError(
            f"unknown name {shortened(name)}{did_you_mean(name, [*known, *functions])}; "
            f"known here: {listed(known)}; functions: {', '.join(functions)}",
            token.offset,
        )

    def _operator(self, token: Token) -> None:
        if not self.want_operand:
            self.want_operand = True
            return
        if token.text not in "+-":
            after = f" after '{self.tokens[-1].text}'" if self.tokens else ""
            raise ExpressionError(f"a number or a name is missing{after} before '{token.text}'", token.offset)
        self.signs += 1
        if self.signs > MAX_DEPTH:
            raise ExpressionError(f"more than {MAX_DEPTH} signs in a row", token.offset)

    def _bracket(self, token: Token, last: Token | None) -> None:
        if token.text == "(":
            function = last if last is not None and last.kind == "name" and self._is_function(last.text) else None
            if not self.want_operand and function is None:
                assert last is not None
                what = f"'{last.text}' is no function" if last.kind == "name" else "an operator is missing before '('"
                raise ExpressionError(f"{what}; a product is written with *", token.offset)
            self.open.append(_Open(token, function))
            if len(self.open) > MAX_DEPTH:
                raise ExpressionError(f"parentheses nest deeper than {MAX_DEPTH}", token.offset)
            self.want_operand = True
            return
        if self.want_operand:
            before = self.tokens[-1].text if self.tokens else "the beginning"
            raise ExpressionError(f"a number or a name is missing between '{before}' and '{token.text}'", token.offset)
        if not self.open:
            raise ExpressionError(f"'{token.text}' without a '(' before it", token.offset)
        innermost = self.open[-1]
        self._check_condition(innermost, token)
        function = innermost.function
        arity = self.functions.get(function.text, 1) if function else 1
        if token.text == ",":
            if innermost.commas + 1 >= arity:
                several = f"'{function.text}' takes {arity} argument{'s' if arity > 1 else ''}" if function else ""
                what = several or "',' stands between arguments only"
                raise ExpressionError(f"{what}; a decimal point is written '.'", token.offset)
            innermost.commas += 1
            innermost.compared = False
            self.want_operand = True
            return
        self.open.pop()
        if function is not None and function.text == "piecewise" and (innermost.commas < 2 or innermost.commas % 2):
            raise ExpressionError(
                f"'{function.text}' takes a value and its condition, more of both, and the value otherwise, "
                "as in piecewise(1, x < 0, 2)",
                function.offset,
            )
        if function is not None and innermost.commas + 1 < (2 if arity == MANY else arity):
            several = "two arguments or more" if arity == MANY else f"{arity} arguments"
            raise ExpressionError(f"'{function.text}' takes {several}", function.offset)

    def _comparison(self, token: Token) -> None:
        """A comparison stands in a condition, once."""
        innermost = self.open[-1] if self.open else None
        if innermost is None or not innermost.is_condition:
            if any(bracket.is_condition for bracket in self.open):
                raise ExpressionError(f"a comparison has no parentheses of its own; {_TWO_CONDITIONS}", token.offset)
            raise ExpressionError(f"'{token.text}' stands in a condition of 'piecewise' only", token.offset)
        if self.want_operand:
            raise ExpressionError(f"a number or a name is missing before '{token.text}'", token.offset)
        if innermost.compared:
            raise ExpressionError(_TWO_CONDITIONS, token.offset)
        innermost.compared = True
        self.want_operand = True

    def _check_condition(self, innermost: _Open, token: Token) -> None:
        if innermost.is_condition and not innermost.compared:
            raise ExpressionError("a condition has one comparison, as in x < 1", token.offset)


def _python_spelling(token: Token) -> str:
    if token.text == "^":
        return "**"
    if token.kind == "number":
        # Python refuses leading zeros in whole numbers.
        digits = token.text.lstrip("0")
        return digits if digits[:1].isdigit() else "0" + digits
    return token.text


def _check_number(token: Token) -> None:
    mantissa, _, exponent = token.text.lower().partition("e")
    if len(mantissa) > MAX_DIGITS or len(exponent) > 5 or abs(int(exponent or 0)) > MAX_DIGITS:
        raise ExpressionError(
            f"the number {shortened(token.text, 24)} is too long; at most {MAX_DIGITS} digits and an exponent "
            f"between -{MAX_DIGITS} and {MAX_DIGITS} are allowed",
            token.offset,
        )
