"""The form of a stored truth: what each entry holds, and what has to fit together.

Strict, for a stored truth decides who is right: no text for a number, no number that is not finite, no key too many.
"""

from __future__ import annotations

import math
from decimal import Decimal
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from henon_ref.harness.truth.reference import NearGraze, ReferenceTransition, Truth, instants
from henon_ref.modes.mode import Mode
from henon_ref.trajectory import Kind

SCHEMA: Literal[1] = 1

Digits = Annotated[str, Field(pattern=r"^-?[0-9]+(\.[0-9]+)?([eE][+-]?[0-9]{1,3})?$")]
"""A number in decimal digits."""
Number = Annotated[float, Field(allow_inf_nan=False)]
Size = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=0)]


class _Form(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


class MethodForm(_Form):
    """One way in which the truth was computed."""

    method: str
    bits: tuple[Count, ...]
    seconds: Size


class NearGrazeForm(_Form):
    """An instant at which a surface is nearly touched."""

    time: Number
    surface: Count
    distance: Size
    lasts: bool = False


class TransitionForm(_Form):
    """One transition."""

    kind: Kind
    surface: Count
    modes: Annotated[str, Field(pattern=r"^([+-]1|0)(,([+-]1|0))* -> ([+-]1|0)(,([+-]1|0))*$")]
    """Signs before and after, such as ``+1,0 -> +1,-1``."""
    time: Digits
    radius: Size
    proven: bool
    closed_form: bool
    state: tuple[Digits, ...]
    state_radius: Size
    transversality: Size
    conditioning: Size | None
    """None: infinite."""

    @property
    def transition(self) -> ReferenceTransition:
        """The transition as the rest of the package has it."""
        before, after = (_mode(side) for side in self.modes.split(" -> "))
        return ReferenceTransition(
            **self.model_dump(exclude={"modes", "time", "conditioning"}),
            from_mode=before,
            to_mode=after,
            time_digits=self.time,
            conditioning=math.inf if self.conditioning is None else self.conditioning,
        )


class TruthForm(_Form):
    """A stored truth."""

    form: Literal[1] = Field(alias="schema")
    case: str
    reading: str
    mathematics: str
    status: Literal["ok", "diverged", "nonunique", "invalid", "failed"]
    reason: str
    end_time: Digits
    end_radius: Size
    certified: bool
    uncertified_because: str
    methods: tuple[MethodForm, ...]
    near_grazes: tuple[NearGrazeForm, ...]
    transitions: tuple[TransitionForm, ...]
    checksum: str

    @property
    def truth(self) -> Truth:
        """The truth as the rest of the package has it."""
        return Truth(
            **{name: getattr(self, name) for name in _SAME},
            mathematics_hash=self.mathematics,
            end_digits=self.end_time,
            transitions=tuple(entry.transition for entry in self.transitions),
            near_grazes=tuple(NearGraze(**graze.model_dump()) for graze in self.near_grazes),
            methods=tuple((m.method, m.bits, m.seconds) for m in self.methods),
        )


_SAME = ("case", "reading", "status", "reason", "end_radius", "certified", "uncertified_because")
"""Entries of the form that a truth has by the same name."""


def parse(text: str) -> Truth:
    """The truth that a text of this form holds; whether its checksum fits is for the caller to see.

    Raises
    ------
    ValueError
        For any other text; the message is one line.
    """
    try:
        truth = TruthForm.model_validate_json(text).truth
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        raise ValueError(f"{place}: {first['msg']}" if place else first["msg"]) from None
    if contradiction := _contradiction(truth):
        raise ValueError(contradiction)
    return truth


def _contradiction(truth: Truth) -> str:
    """What does not fit together; empty where everything does."""
    surfaces = {len(mode) for t in truth.transitions for mode in (t.from_mode, t.to_mode)}
    if len(surfaces) > 1 or len({len(t.state) for t in truth.transitions}) > 1:
        return "modes or states of different lengths"
    for index, t in enumerate(truth.transitions):
        if t.surface >= len(t.to_mode):
            return f"transition {index}: surface {t.surface} of {len(t.to_mode)}"
    groups = [truth.transitions[indices.start] for indices in instants(truth.transitions)]
    for earlier, later in pairwise(groups):
        if Decimal(later.time_digits) < Decimal(earlier.time_digits):
            return f"the transition at t = {later.time:g} stands behind a later one"
        if later.from_mode != earlier.to_mode:
            return f"the transition at t = {later.time:g} does not begin in the mode that the one before leads to"
    if groups and Decimal(groups[-1].time_digits) > Decimal(truth.end_digits):
        return "a transition beyond the end"
    if truth.certified and truth.proven < len(truth.transitions):
        return "certified, though not every transition is proven"
    return ""


def _mode(text: str) -> Mode:
    return tuple(int(sign) for sign in text.split(","))
