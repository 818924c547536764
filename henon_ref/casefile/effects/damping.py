"""Viscous damping."""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from henon_ref.casefile.effects.base import Effect, EffectParameter, Stage
from henon_ref.casefile.effects.oscillator import Oscillator


def _viscous(body: Oscillator, values: Mapping[str, sp.Expr]) -> None:
    body.force += -values["coefficient"] * body.velocity


VISCOUS_DAMPING = Effect(
    name="viscous_damping",
    meaning="damping force coefficient * x2, against the frame",
    stage=Stage.FORCE,
    parameters=(EffectParameter("coefficient", "N s/m", "of the damper between block and frame"),),
    term=_viscous,
)
