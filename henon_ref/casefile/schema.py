"""Form of a case file: its keys, the values that they hold, and the messages for other values.

Forms only check the form; the meaning of expressions is checked where they are read
(:mod:`henon_ref.system.problem`, :mod:`henon_ref.casefile.expected`). A system is built from the tree of the file,
not from its form. Forms that are kept in a reading are also dataclasses.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from types import MappingProxyType
from typing import Annotated, Any, Literal

from henon_ref.casefile.form import NONE, Form, Scalar, Size, read_form
from henon_ref.expressions.grammar import MAX_STATES, MOST_STATES
from henon_ref.system.source import Source
from henon_ref.system.tree import MappingNode
from henon_ref.text import shortened

MAX_NAME = 64
"""Largest number of characters of the name of a case or a reading, which becomes a file name."""
NAME_PATTERN = f"^[a-z0-9_]{{1,{MAX_NAME}}}$"


# -- scalars --------------------------------------------------------------------------------------------


def _expression(value: Any) -> str:
    if isinstance(value, bool) or not isinstance(value, str | int | Decimal):
        raise ValueError("must be a number or an expression (text)")
    if isinstance(value, Decimal) and not value.is_finite():
        raise ValueError("must be a finite number or an expression")
    # YAML 1.1 reads such text as a date.
    if isinstance(value, str) and re.fullmatch(r"[0-9]{4}-[0-9]{1,2}-[0-9]{1,2}", value.strip()):
        raise ValueError(f"{value.strip()} is a date; write a difference with spaces, as in 3 - 2 - 1")
    return str(value)


def _decimal(value: Any) -> Decimal:
    if isinstance(value, bool) or not isinstance(value, int | Decimal):
        note = f", not the text {shortened(value)}" if isinstance(value, str) else ""
        raise ValueError(f"must be a number{note}")
    value = Decimal(value)
    if not value.is_finite() or not math.isfinite(float(value)):
        raise ValueError("must be a finite number")
    return value


def _positive(value: Any) -> Decimal:
    number = _decimal(value)
    if float(number) <= 0:  # a double that is too small is 0
        raise ValueError("must be larger than 0")
    return number


def _tolerance(value: Any) -> float:
    number = _decimal(value)
    if not 1e-16 <= float(number) < 1:
        raise ValueError(f"a tolerance lies between 1e-16 and 1, not {number:.6g}")
    return float(number)


def _text(value: Any) -> str:
    if not isinstance(value, str) or not value.strip():
        raise ValueError("must be text (put quotes around a number or a word such as true)")
    for character in value:
        # Control characters, line and paragraph separators, and surrogates.
        if character not in "\t\n" and unicodedata.category(character) in ("Cc", "Zl", "Zp", "Cs"):
            raise ValueError(f"the control character U+{ord(character):04X} is not allowed in text")
    return value


def one_line(value: Any) -> str:
    """Return text in one line: line breaks and runs of spaces become one space."""
    return re.sub(r"[ \t\n]+", " ", _text(value)).strip()


def file_name(value: Any) -> str:
    """Return the name of a case or a reading, after checking that it can be a file name."""
    if not isinstance(value, str) or not re.fullmatch(r"[a-z0-9_]+", value):
        shown = shortened(value) if isinstance(value, str) else f"{value} (put quotes around a number)"
        raise ValueError(f"a name is made of a-z, 0-9 and _ only, not {shown}")
    if len(value) > MAX_NAME:
        raise ValueError(f"a name has at most {MAX_NAME} characters, not {len(value)}")
    return value


def _solver(value: Any) -> str:
    if not isinstance(value, str) or not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.+-]*", value):
        raise ValueError("must be the name of a solver, such as henon or scipy-dop853")
    return value


def whole_number(message: str, *values: int, schema: Mapping[str, Any] | None = None) -> Scalar:
    """Return the kind of a whole number of the given values; true, 1.0 and text are refused."""

    def read(value: Any) -> int:
        if type(value) is not int or value not in values:
            raise ValueError(message)
        return value

    return Scalar(read, {"enum": list(values)} if schema is None else schema)


_NUMBER = {"type": "number"}
_ABOVE_ZERO = _NUMBER | {"exclusiveMinimum": 0}
Expression = Annotated[Any, Scalar(_expression, {"type": ["number", "string"]})]
"""Read as text; evaluated later (:mod:`henon_ref.casefile.expected`)."""
Digits = Annotated[Decimal, Scalar(_decimal, _NUMBER)]
PositiveDigits = Annotated[Decimal, Scalar(_positive, _ABOVE_ZERO)]
Positive = Annotated[float, Scalar(lambda value: float(_positive(value)), _ABOVE_ZERO)]
Tolerance = Annotated[float, Scalar(_tolerance, _NUMBER | {"minimum": 1e-16, "exclusiveMaximum": 1})]
Text = Annotated[str, Scalar(_text, {"type": "string"})]
OneLine = Annotated[str, Scalar(one_line, {"type": "string"})]
CaseName = Annotated[str, Scalar(file_name, {"type": "string", "pattern": NAME_PATTERN})]
SolverName = Annotated[str, Scalar(_solver, {"type": "string"})]
ModeEntry = Annotated[int, whole_number("a mode is -1 or 1 (slip, the side of the surface) or 0 (sliding)", -1, 0, 1)]
Side = Annotated[int, whole_number("must be -1 or 1", -1, 1, schema={"enum": [-1, 1], "type": "integer"})]
Version = Annotated[
    int, whole_number("must be 1, the version of the case file's form", 1, schema={"const": 1, "type": "integer"})
]


# -- the model ------------------------------------------------------------------------------------------


class SystemForm(Form):
    """Piecewise-smooth system, given as equations."""

    state: Annotated[tuple[Text, ...], Size(1, MAX_STATES), "names of the states"]
    parameters: Annotated[Mapping[str, Expression], "name: number, or expression in other parameters"] = NONE
    surfaces: Annotated[
        Mapping[str, Expression], Size(0, MAX_STATES), "sign symbol: the expression whose sign it is"
    ] = NONE
    field: Annotated[
        tuple[Expression, ...],
        "x', one expression for each state; t is time; abs, sign, min, max, piecewise become surfaces kink1, ...",
    ]
    valid: Annotated[tuple[Expression, ...], "expressions that are positive while the model is valid"] = ()


class SceneForm(Form):
    """Bodies and connections; nothing else is part of the equations."""

    parameters: Annotated[Mapping[str, Expression], "name: number, or expression in other parameters"] = NONE
    bodies: Annotated[
        Mapping[str, Any], Size(1), "name: its kind, as in {mass: 1}, {inertia: 1}, {velocity: cos(t)} or fixed"
    ]
    connections: Annotated[
        tuple[Any, ...], "each a kind with its keys, as in spring: {between: [a, wall], stiffness: 1}"
    ]


class InitialForm(Form):
    """Start: time, every state by name, and the mode if the fields do not determine it."""

    OTHERS = Expression

    t: Annotated[Expression, "time of the start [s]"] = "0"
    mode: Annotated[Mapping[str, ModeEntry], "sign symbol: -1 or 1 (side of the surface), or 0 (sliding)"] = NONE


class ReleaseForm(Form):
    """Condition that ends a sliding mode."""

    when: Annotated[Expression, "the sliding ends when this crosses zero"]
    direction: Literal["rising", "falling"]
    to: Annotated[Side, "side of the surface that is entered"]


class SlidingForm(Form):
    """Sliding mode of the source, in place of Filippov's."""

    field: Annotated[tuple[Expression, ...], "x' while it slides, one expression for each state"]
    release: Annotated[tuple[ReleaseForm, ...], Size(1)]
    entry: Annotated[
        Literal["attracting", "inside"],
        "a trajectory on the surface sticks if both slip fields point at it (attracting), "
        "or if no release condition is met (inside: static friction)",
    ] = "attracting"


class ResetForm(Form):
    """Jump of the state when a surface falls through zero."""

    when: Annotated[Literal["falling"], "direction in which the surface crosses zero"] = "falling"
    map: Annotated[
        Mapping[str, Expression],
        Size(1),
        "state: its value after the jump, in t, the states before the jump, and parameters; default: unchanged",
    ]
    priority: Annotated[Digits, "order of several resets at one instant: the lowest is applied first"] = Decimal(0)


# -- expected results -----------------------------------------------------------------------------------


class MeasureForm(Form):
    after: Annotated[Expression, "sticks that end before this time are not measured [s]"] = "0"


@dataclass(frozen=True)
class Published(Form):
    """Figures of the source, compared separately from the truth; their last digit is taken as rounded."""

    stick_durations: Annotated[tuple[PositiveDigits, ...], "[s]"] = ()
    # If the source prints fewer lengths than there are sticks, they repeat in this order.
    stick_lengths: Annotated[tuple[Digits, ...], "change of the first state in each stick"] = ()
    transition_times: Annotated[tuple[Digits, ...], "[s], of some transitions"] = ()
    # Each is compared with the nearest exact transition time.


@dataclass(frozen=True)
class Exact(Form):
    """Closed forms, which take precedence over computed truth."""

    transition_times: Annotated[tuple[Expression, ...], "[s], from the first transition on"]
    modes: Annotated[tuple[tuple[ModeEntry, ...], ...], "mode after each transition, one entry for each surface"] = ()


@dataclass(frozen=True)
class Orbit(Form):
    """Known or claimed periodic orbit."""

    period: Annotated[Expression, "[s]"]
    sticks: Annotated[tuple[PositiveDigits, ...], "stick durations within one period [s]"] = ()
    crossings: Annotated[tuple[Digits, ...], "times of the crossings modulo the period [s]"] = ()


@dataclass(frozen=True)
class Gate(Form):
    """Requirements on one solver for ``--gate``."""

    at: Annotated[Tolerance | None, "tolerance of the row; the tightest if left out"] = None
    max_time_error: Annotated[Positive | None, "largest error of a transition time [s]"] = None
    max_stick_error: Annotated[Positive | None, "largest error of a stick duration [s]"] = None
    status: Annotated[
        Literal["ok", "wrong", "diverged", "nonunique", "invalid", "unsupported"] | None,
        "the status the row must have; ok if left out",
    ] = None


@dataclass(frozen=True)
class Expect(Form):
    """Expected end of the run if not at the horizon, and whether double precision can decide it."""

    status: Annotated[
        Literal["ok", "diverged", "nonunique", "invalid", "failed"],
        "status of the run; ok, at the horizon, if left out",
    ] = "ok"
    reason: Annotated[OneLine | None, "reason"] = None
    verdict: Annotated[
        Literal["ill-conditioned"] | None,
        "no double-precision state decides what happens: its transitions have no finite conditioning",
    ] = None
    time: Annotated[Expression | None, "time of the end [s]"] = None


class CaseForm(Form):
    """A case file, schema 1."""

    BESIDE = ("readings",)
    """Keys that are read before (:func:`henon_ref.casefile.case.reading_sources`)."""
    HINTS = MappingProxyType({"points": " (a sweep file is run by henon-ref sweep)"})

    schema: Annotated[Version, "version of this form"]
    name: Annotated[CaseName, "name, also of the report's folder"]
    title: Annotated[OneLine, "title of the report"]
    source: Annotated[OneLine | None, "source of the case"] = None
    story: Annotated[Text | None, "the motion, its difficulty, the correct result"] = None
    equations: Annotated[Text | None, "the equations as a reader would write them"] = None
    links: Annotated[tuple[OneLine, ...], "addresses for the report"] = ()
    tags: Annotated[tuple[OneLine, ...], "words for henon-ref cases --tag"] = ()
    system: SystemForm | None = None
    scene: SceneForm | None = None
    initial: InitialForm
    until: Annotated[Expression, "the horizon [s]"]
    sliding: Annotated[Mapping[str, SlidingForm], "sign symbol: sliding mode, in place of Filippov's"] = NONE
    resets: Annotated[Mapping[str, ResetForm], "sign symbol: jump of the state as its surface falls through 0"] = NONE
    measure: Annotated[MeasureForm, "which sticks are measured"] = MeasureForm()
    published: Published | None = None
    exact: Exact | None = None
    orbit: Orbit | None = None
    solvers: Annotated[Annotated[tuple[SolverName, ...], Size(1)] | None, "the default solvers if left out"] = None
    tolerances: Annotated[tuple[Tolerance, ...], Size(1), "relative tolerances"] = (1e-6, 1e-9, 1e-12)
    # A coarse, a usual and a tight tolerance: enough for a work-precision line.
    steps: Annotated[tuple[Positive, ...], Size(1), "for fixed-step solvers [s]"] = (1e-3,)
    gate: Mapping[SolverName, Gate] = NONE
    expect: Expect | None = None


READING_KEYS = frozenset(CaseForm.__annotations__) - {"schema", "name"}
"""Keys that a reading may override."""


def check_form(tree: MappingNode) -> None:
    """Check the form of a model from Python, which has some of the keys of a case file and may be larger."""
    read_form(CaseForm, Source(tree, most_states=MOST_STATES), partial=True)
