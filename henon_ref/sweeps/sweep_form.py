"""The form of a sweep file: which keys there are; what points and observations hold is checked where they are read."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from henon_ref.casefile.schema import (
    CaseName,
    Expression,
    Form,
    InitialForm,
    OneLine,
    ResetForm,
    SceneForm,
    SlidingForm,
    SystemForm,
    Text,
    Tolerance,
)
from henon_ref.integrator.start import MOST_STEPS
from henon_ref.sweeps.plan import RTOL


def _version(value: Any) -> int:
    if type(value) is not int or value != 1:
        raise ValueError("must be 1, the version of the sweep file's form")
    return value


def _size(value: Any) -> int:
    if type(value) is not int or value < 1:
        raise ValueError("must be a whole number from 1 on")
    return value


class SweepForm(Form):
    """A sweep file, schema 1."""

    schema_: Annotated[Literal[1], BeforeValidator(_version)] = Field(alias="schema")
    name: CaseName
    title: OneLine
    source: OneLine | None = None
    story: Text | None = None
    system: SystemForm | None = None
    scene: SceneForm | None = None
    sliding: dict[str, SlidingForm] = Field({})
    resets: dict[str, ResetForm] = Field({})
    initial: InitialForm
    until: Expression
    points: Annotated[dict[str, Any], Field(min_length=1, max_length=1)]
    observe: Annotated[list[Annotated[dict[str, Any], Field(min_length=1, max_length=1)]], Field(min_length=1)]
    rtol: Tolerance = RTOL
    chunk: Annotated[int, BeforeValidator(_size)] | None = None
    max_steps: Annotated[int, BeforeValidator(_size)] = MOST_STEPS
