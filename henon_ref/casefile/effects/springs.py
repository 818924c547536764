"""Springs between the block and its support."""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from henon_ref.casefile.effects.base import Effect, EffectParameter, Stage
from henon_ref.casefile.effects.oscillator import Oscillator


def _linear(body: Oscillator, values: Mapping[str, sp.Expr]) -> None:
    body.force += -values["stiffness"] * body.elongation


def _cubic(body: Oscillator, values: Mapping[str, sp.Expr]) -> None:
    body.force += -values["stiffness"] * body.elongation**3


LINEAR_SPRING = Effect(
    name="linear_spring",
    meaning="restoring force stiffness * z",
    stage=Stage.FORCE,
    parameters=(EffectParameter("stiffness", "N/m", "negative: the double well of Eq. (1)"),),
    term=_linear,
)

CUBIC_SPRING = Effect(
    name="cubic_spring",
    meaning="restoring force stiffness * z^3",
    stage=Stage.FORCE,
    parameters=(EffectParameter("stiffness", "N/m^3", "negative: the softening spring of Eq. (17)"),),
    term=_cubic,
)
