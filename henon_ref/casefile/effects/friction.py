"""Dry friction between block and belt; it opposes the sliding velocity v (Eq. 18, the listing)."""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from henon_ref.casefile.effects.base import Contact, Effect, EffectParameter, Stage
from henon_ref.filippov.system import Release, SlidingOverride


def _coulomb(body: Contact, values: Mapping[str, sp.Expr]) -> None:
    body.friction += body.normal_load * values["force"] * body.sign


def _stribeck(body: Contact, values: Mapping[str, sp.Expr]) -> None:
    # abs(v) is sign * v: smooth as text in each mode.
    weakening = 1 + values["slope"] * body.sign * body.sliding_velocity
    body.friction += body.normal_load * values["force"] * body.sign / weakening


def _static(body: Contact, values: Mapping[str, sp.Expr]) -> None:
    on_belt = {body.velocity: body.belt}
    limit = body.normal_load.xreplace(on_belt) * values["force"]
    load = body.holding_load()
    body.override = SlidingOverride(
        field=body.stuck_field(),
        release=(Release(load - limit, "rising", 1), Release(load + limit, "falling", -1)),
        entry="inside",
    )


COULOMB_FRICTION: Effect[Contact] = Effect(
    name="coulomb_friction",
    meaning="friction force * sgn(v)",
    stage=Stage.FRICTION,
    parameters=(EffectParameter("force", "N", "of kinetic friction", range="nonnegative"),),
    term=_coulomb,
)

STRIBECK_FRICTION: Effect[Contact] = Effect(
    name="stribeck_friction",
    meaning="friction force * sgn(v) / (1 + slope * abs(v)), Eq. (2)",
    stage=Stage.FRICTION,
    parameters=(
        EffectParameter("force", "N", "of friction at v = 0 (mu0 of the paper)", range="nonnegative"),
        EffectParameter("slope", "s/m", "how fast friction falls with speed (delta)", range="nonnegative"),
    ),
    term=_stribeck,
)

STATIC_FRICTION: Effect[Contact] = Effect(
    name="static_friction",
    meaning="the block is held while the load on the contact is at most force, above kinetic friction, and sticks "
    "wherever it comes to rest on the belt under such a load; this is no convex combination of Filippov's",
    stage=Stage.HOLDING,
    parameters=(EffectParameter("force", "N", "that static friction can hold", range="nonnegative"),),
    term=_static,
    needs=("coulomb_friction", "stribeck_friction"),
)
