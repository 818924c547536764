"""Supports and belts that move."""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from henon_ref.casefile.effects.base import Contact, Effect, EffectParameter, Stage
from henon_ref.casefile.effects.oscillator import Oscillator
from henon_ref.taylor.tape import TIME


def _harmonic_base(body: Oscillator, values: Mapping[str, sp.Expr]) -> None:
    body.elongation += -values["amplitude"] * sp.sin(values["frequency"] * TIME + values["phase"])


def _moving_belt(body: Contact, values: Mapping[str, sp.Expr]) -> None:
    body.belt += values["velocity"]


HARMONIC_BASE = Effect(
    name="harmonic_base",
    meaning="the springs' support moves: z = x1 - amplitude * sin(frequency * t + phase)",
    stage=Stage.MOTION,
    parameters=(
        EffectParameter("amplitude", "m", "of the support"),
        EffectParameter("frequency", "rad/s", "of the support"),
        EffectParameter("phase", "rad", "of the support at t = 0", default="0"),
    ),
    term=_harmonic_base,
)

MOVING_BELT: Effect[Contact] = Effect(
    name="moving_belt",
    meaning="the belt's velocity, a constant or a function of t; a belt that is not named is at rest",
    stage=Stage.MOTION,
    parameters=(EffectParameter("velocity", "m/s", "of the belt", in_time=True),),
    term=_moving_belt,
)
