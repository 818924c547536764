"""Dry friction; it opposes the relative velocity v = v_p - v_q, whose sign s is a surface's.

Laws: Coulomb's; ``stribeck``, Eq. (2) of Olejnik and Awrejcewicz (2013), force/(1 + slope abs(v)); ``stribeck_exp``,
force + (static - force) exp(-abs(v)/velocity), as Modelica's ``MassWithStopAndFriction`` has it.
"""

from __future__ import annotations

import sympy as sp

from henon_ref.casefile.connection import Key, Kind, Link
from henon_ref.taylor.tape import TIME

LAWS = {"coulomb": None, "stribeck": "slope", "stribeck_exp": "velocity"}
"""Law -> the key that it alone needs."""
TIMES = (sp.Rational(1, 3), sp.Rational(7, 5), sp.Rational(29, 11))
UNITS = {"slope": "s/m, between rotors s/rad", "velocity": "m/s, between rotors rad/s"}


def _add(link: Link) -> None:
    law = _checked_law(link)
    given = link.values
    velocity = link.velocity
    alone = all(body.inertia is None for body in link.ends)
    if alone and _is_constant(velocity.xreplace(link.kinks.parameters)):
        velocity = velocity.xreplace({TIME: sp.Integer(0)})
    sign = link.sign("s", velocity)
    normal = link.positive_part("normal") if "normal" in given else sp.Integer(1)
    speed = sign * velocity  # abs(v): smooth as text in each mode
    force, static = given["force"], given.get("static")
    if law == "coulomb":
        link.push(-(normal * force * sign))
    elif law == "stribeck":
        link.push(-(normal * force * sign / (1 + given["slope"] * speed)))
    else:
        decay = sp.exp(-speed / given["velocity"])
        carried = force * decay if static is None else force + (static - force) * decay
        link.push(-(normal * sign * carried))
    if "viscous" in given:
        link.push(-given["viscous"] * velocity)
    if alone and not velocity.has(TIME):  # it acts on nothing; with both at one velocity it holds
        link.hold(sign, normal * (force if static is None else static))
    elif not alone and static is not None and law != "stribeck_exp":  # which slides with 'static' as it comes to rest
        link.hold(sign, normal * static)


def _is_constant(velocity: sp.Expr) -> bool:
    """Whether a velocity that is given is the same at all times: an analytic function whose rate is zero at some."""
    rate = sp.diff(velocity, TIME)
    return all(abs(sp.N(rate.xreplace({TIME: time}), 40)) < sp.Float("1e-30") for time in TIMES)


def _checked_law(link: Link) -> str:
    law = link.words["law"]
    for name, own in LAWS.items():
        if own is not None and (own in link.values) != (name == law):
            if name == law:
                raise link.error(f"friction lacks its '{own}' [{UNITS[own]}], which the law '{law}' needs")
            raise link.error(f"the law '{law}' has no '{own}'; the law '{name}' has", at=own)
    return law


KIND = Kind(
    meaning="dry friction: it opposes the relative velocity, and holds while there is none",
    keys=(
        Key("law", "", "", "how friction depends on the relative velocity", words=tuple(LAWS)),
        Key("force", "N", "N m", "of friction in sliding; with 'normal' its coefficient [1]", range="nonnegative"),
        Key("slope", "s/m", "s/rad", "how fast friction falls with speed", optional=True, range="nonnegative"),
        Key("velocity", "m/s", "rad/s", "where friction has fallen by 1 - 1/e", optional=True, range="positive"),
        Key("viscous", "N s/m", "N m s/rad", "of a viscous part besides", optional=True, range="nonnegative"),
        Key("static", "N", "N m", "that it holds; with 'normal' a coefficient [1]", optional=True, range="nonnegative"),
        Key("normal", "N", "N m", "load on the contact, in t and states; 0 below 0", optional=True, of="states"),
    ),
    add=_add,
    between_given=True,
)
