"""The case file's form: which keys there are, what they hold, and what is said where they do not.

The models only check form; what the expressions in them mean is checked where they are read
(:mod:`henon_ref.casefile.problem`, :mod:`henon_ref.casefile.expected`). A system is built of the tree, not of them:
a model from Python is checked without them (:mod:`henon_ref.casefile.model_form`).
"""

from __future__ import annotations

import math
import re
import unicodedata
from decimal import Decimal
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema

from henon_ref.casefile.grammar import MAX_STATES
from henon_ref.casefile.model_form import DATE
from henon_ref.casefile.scene_schema import bodies_schema, connections_schema
from henon_ref.text import shortened

DEFAULT_TOLERANCES = (1e-6, 1e-9, 1e-12)
"""A coarse, a usual and a tight one: enough for a work-precision line."""
DEFAULT_STEPS = (1e-3,)
MAX_NAME = 64
"""Characters the name of a case or of a reading may have: files are called after both."""

ExpectedVerdict = Literal["ill-conditioned"]
ExpectedStatus = Literal["ok", "diverged", "nonunique", "invalid", "failed"]
GateStatus = Literal["ok", "wrong", "diverged", "nonunique", "invalid", "unsupported"]


def _expression(value: Any) -> str:
    if isinstance(value, bool) or not isinstance(value, str | int | Decimal):
        raise ValueError("must be a number or an expression (text)")
    if isinstance(value, Decimal) and not value.is_finite():
        raise ValueError("must be a finite number or an expression")
    if isinstance(value, str) and DATE.fullmatch(value.strip()):
        raise ValueError(f"{value.strip()} is a date; a difference is written with blanks, as in 3 - 2 - 1")
    return str(value)


def _decimal(value: Any) -> Decimal:
    if isinstance(value, bool) or not isinstance(value, int | Decimal):
        raise ValueError(f"must be a number{_text_note(value)}")
    value = Decimal(value)
    if not value.is_finite() or not math.isfinite(float(value)):
        raise ValueError("must be a finite number")
    return value


def _text_note(value: Any) -> str:
    return f", not the text {shortened(value)}" if isinstance(value, str) else ""


def _positive_decimal(value: Any) -> Decimal:
    number = _decimal(value)
    if float(number) <= 0:  # a double that is too small is 0
        raise ValueError("must be larger than 0")
    return number


def _positive(value: Any) -> float:
    return float(_positive_decimal(value))


def _tolerance(value: Any) -> float:
    number = float(_decimal(value))
    if not 1e-16 <= number < 1:
        raise ValueError(f"a tolerance lies between 1e-16 and 1, not {number:g}")
    return number


def _text(value: Any) -> str:
    if not isinstance(value, str) or not value.strip():
        raise ValueError("must be text (a number or a word such as true stands in quotes)")
    for character in value:
        if character not in "\t\n" and unicodedata.category(character) in _CONTROLS:
            raise ValueError(f"the control character U+{ord(character):04X} is not allowed in text")
    return value


# Control characters, separators of lines and paragraphs, and halves of surrogate pairs, which no file can hold.
_CONTROLS = ("Cc", "Zl", "Zp", "Cs")


def one_line(value: Any) -> str:
    """Text that reports set in one line: line breaks and runs of blanks become one blank.

    Raises
    ------
    ValueError
        For what is no text, is empty, or holds a control character.
    """
    return re.sub(r"[ \t\n]+", " ", _text(value)).strip()


def file_name(value: Any) -> str:
    """The name of a case or a reading, which files and folders are called after.

    Raises
    ------
    ValueError
        For a name that is too long or has characters that not every file system takes.
    """
    if not isinstance(value, str) or not re.fullmatch(r"[a-z0-9_]+", value):
        shown = shortened(value) if isinstance(value, str) else f"{value} (a number alone stands in quotes)"
        raise ValueError(f"a name is made of a-z, 0-9 and _ only, not {shown}")
    if len(value) > MAX_NAME:
        raise ValueError(f"a name has at most {MAX_NAME} characters, not {len(value)}")
    return value


def _solver(value: Any) -> str:
    if not isinstance(value, str) or not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.+-]*", value):
        raise ValueError("must be the name of a solver, such as henon or scipy-dop853")
    return value


def _version(value: Any) -> int:
    if type(value) is not int or value != 1:
        raise ValueError("must be 1, the version of the case file's form")
    return value


def _side(value: Any) -> int:
    if type(value) is not int or value not in (-1, 1):
        raise ValueError("must be -1 or 1")
    return value


def _entry(value: Any) -> int:
    if type(value) is not int or value not in (-1, 0, 1):
        raise ValueError("a mode is -1 or 1 (slip, the side of the surface) or 0 (sliding)")
    return value


_NUMBER: dict[str, Any] = {"type": "number"}
Expression = Annotated[str, BeforeValidator(_expression), WithJsonSchema({"type": ["number", "string"]})]
Digits = Annotated[Decimal, BeforeValidator(_decimal), WithJsonSchema(_NUMBER)]
PositiveDigits = Annotated[
    Decimal, BeforeValidator(_positive_decimal), WithJsonSchema(_NUMBER | {"exclusiveMinimum": 0})
]
Positive = Annotated[float, BeforeValidator(_positive), WithJsonSchema(_NUMBER | {"exclusiveMinimum": 0})]
Tolerance = Annotated[
    float, BeforeValidator(_tolerance), WithJsonSchema(_NUMBER | {"minimum": 1e-16, "exclusiveMaximum": 1})
]
Text = Annotated[str, BeforeValidator(_text), WithJsonSchema({"type": "string"})]
OneLine = Annotated[str, BeforeValidator(one_line), WithJsonSchema({"type": "string"})]
NAME_PATTERN = f"^[a-z0-9_]{{1,{MAX_NAME}}}$"
CaseName = Annotated[str, BeforeValidator(file_name), WithJsonSchema({"type": "string", "pattern": NAME_PATTERN})]
SolverName = Annotated[str, BeforeValidator(_solver), WithJsonSchema({"type": "string"})]
ModeEntry = Annotated[int, BeforeValidator(_entry), WithJsonSchema({"enum": [-1, 0, 1]})]


class Form(BaseModel):
    """A mapping of the case file: unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, populate_by_name=False)


class SystemForm(Form):
    """A piecewise-smooth system, written out."""

    state: Annotated[list[Text], Field(min_length=1, max_length=MAX_STATES, description="names of the states")]
    parameters: dict[str, Expression] = Field({}, description="name: number, or expression in other parameters")
    surfaces: dict[str, Expression] = Field(
        {}, max_length=MAX_STATES, description="sign symbol: the expression whose sign it is"
    )
    field: list[Expression] = Field(
        description="x', one expression a state; t is time; abs, sign, min, max, piecewise become surfaces kink1, ..."
    )
    valid: list[Expression] = Field([], description="the model holds while these are > 0")


class SceneForm(Form):
    """Bodies and what connects them; what is named is built, nothing else (:mod:`henon_ref.casefile.scene`)."""

    parameters: dict[str, Expression] = Field({}, description="name: number, or expression in other parameters")
    bodies: Annotated[dict[str, Any], WithJsonSchema(bodies_schema())] = Field(
        min_length=1, description="name: what it is, as in {mass: 1}, {inertia: 1}, {velocity: cos(t)} or fixed"
    )
    connections: Annotated[list[Any], WithJsonSchema(connections_schema())] = Field(
        description="one kind with its keys each, as in spring: {between: [a, wall], stiffness: 1}"
    )


class InitialForm(Form):
    """The start: time, every state by its name, and the mode where the fields leave it open."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Expression]

    t: Expression = "0"
    mode: dict[str, ModeEntry] = {}


class ReleaseForm(Form):
    """One way out of a sliding mode."""

    when: Expression = Field(description="the sliding ends where this crosses zero")
    direction: Literal["rising", "falling"]
    to: Annotated[Literal[-1, 1], BeforeValidator(_side)] = Field(description="the side released into")


class SlidingForm(Form):
    """Sliding in a source's own way, in place of Filippov's."""

    field: list[Expression]
    release: Annotated[list[ReleaseForm], Field(min_length=1)]
    entry: Literal["attracting", "inside"] = Field(
        "attracting",
        description="a trajectory on the surface sticks where both slip fields point at it (attracting), "
        "or where no release is due (inside: static friction)",
    )


class ResetForm(Form):
    """A jump of the state where a surface falls through zero."""

    when: Literal["falling"] = Field("falling", description="the way in which the surface goes through zero")
    map: Annotated[dict[str, Expression], Field(min_length=1)] = Field(
        description="state: its value after the jump, in t, the states before it, and parameters; the others stay"
    )
    priority: Digits = Field(
        Decimal(0),
        json_schema_extra={"default": 0},
        description="of several resets that are due at one instant the lowest goes first",
    )


class MeasureForm(Form):
    after: Expression = Field(default="0", description="sticks that end before this time are left out [s]")


class PublishedForm(Form):
    """Figures of the source, scored apart from the truth; their last digit is taken to be rounded."""

    stick_durations: list[PositiveDigits] = Field([], description="[s]")
    stick_lengths: list[Digits] = []
    transition_times: list[Digits] = Field([], description="[s], of any of the transitions")


class ExactForm(Form):
    """Closed forms; they outrank computed truth."""

    transition_times: list[Expression] = Field(description="[s], from the first transition on")
    modes: list[list[ModeEntry]] = Field([], description="mode after each transition, of all of them, by surface")


class OrbitForm(Form):
    """A periodic orbit that is known or claimed."""

    period: Expression = Field(description="[s]")
    sticks: list[PositiveDigits] = Field([], description="stick durations within one period [s]")
    crossings: list[Digits] = Field([], description="times of the crossings modulo the period [s]")


class GateForm(Form):
    """What one solver must reach for ``--gate``."""

    at: Tolerance | None = Field(None, description="tolerance of the row; the tightest if left out")
    max_time_error: Positive | None = Field(None, description="worst error of a transition [s]")
    max_stick_error: Positive | None = Field(None, description="worst error of a stick duration [s]")
    status: GateStatus | None = Field(None, description="the status the row must have; ok if left out")


class ExpectForm(Form):
    """How the run has to end, where that is not at the horizon, and whether the question is a fair one."""

    status: ExpectedStatus = Field("ok", description="how it ends; ok, at the horizon, if left out")
    reason: OneLine | None = Field(None, description="why")
    verdict: ExpectedVerdict | None = Field(
        None, description="no double-precision state decides what happens: its transitions have no finite conditioning"
    )
    time: Expression | None = Field(None, description="where it ends [s]")


class CaseForm(Form):
    """A case file, schema 1."""

    schema_: Annotated[Literal[1], BeforeValidator(_version)] = Field(
        alias="schema", description="version of this form"
    )
    name: CaseName = Field(description="the report's folder")
    title: OneLine
    source: OneLine | None = Field(None, description="where the case comes from")
    story: Text | None = Field(None, description="what happens, what makes it hard, what is right")
    equations: Text | None = Field(None, description="the equations as a reader would write them")
    links: list[OneLine] = []
    tags: list[OneLine] = []
    system: SystemForm | None = None
    scene: SceneForm | None = None
    initial: InitialForm
    until: Expression = Field(description="the horizon [s]")
    sliding: dict[str, SlidingForm] = Field({}, description="sign symbol: sliding in the source's own way")
    resets: dict[str, ResetForm] = Field({}, description="sign symbol: how the state jumps at its surface")
    measure: MeasureForm = MeasureForm()
    published: PublishedForm | None = None
    exact: ExactForm | None = None
    orbit: OrbitForm | None = None
    solvers: Annotated[list[SolverName], Field(min_length=1)] | None = Field(None, description="all if left out")
    tolerances: Annotated[list[Tolerance], Field(min_length=1)] = list(DEFAULT_TOLERANCES)
    steps: Annotated[list[Positive], Field(min_length=1)] = Field(
        list(DEFAULT_STEPS), description="for fixed-step solvers [s]"
    )
    gate: dict[SolverName, GateForm] = {}
    expect: ExpectForm | None = None


READING_KEYS = frozenset(CaseForm.model_fields) - {"schema_", "name"}
"""Keys that a reading may override."""
