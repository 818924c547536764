"""Kinds of connections of a scene: their keys with units, and the terms that each kind adds to its bodies.

``KINDS`` lists them. Only the connections named in a scene become part of the equations.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Literal

import sympy as sp

from henon_ref.errors import CaseError
from henon_ref.expressions.kinks import Kinks, chosen, sgn
from henon_ref.system.assembly import Body
from henon_ref.system.source import Path, Source
from henon_ref.taylor.tape import TIME

Range = Literal["any", "nonnegative", "positive", "fraction"]
"""Range of a value; ``fraction``: from 0 to 1."""


@dataclass(frozen=True)
class Key:
    name: str
    unit: str
    """Unit between masses."""
    angular: str
    """Unit between rotors."""
    meaning: str
    optional: bool = False
    """Whether the key may be omitted; its term is then absent from the equations."""
    range: Range = "any"
    of: Literal["parameters", "time", "states"] = "parameters"
    """Quantities allowed in the expression; "time" also allows parameters, "states" also time and parameters."""
    words: tuple[str, ...] = ()
    """Allowed words, if the value is a word instead of an expression."""


@dataclass
class Link:
    """Connection under construction: the values of its keys and the terms that they add (see ``Connection``)."""

    kind: str
    ends: tuple[Body, ...]
    """Bodies of ``between``, in its order, or the body of ``on``."""
    source: Source
    path: Path
    name: str | None
    kinks: Kinks
    values: dict[str, sp.Expr] = field(default_factory=dict)
    words: dict[str, str] = field(default_factory=dict)
    kinked_values: dict[str, list[sp.Expr]] = field(default_factory=dict)
    """Key that may hold states -> arguments of the kinks of its value, which have no symbols yet."""
    pushes: list[tuple[str, sp.Expr]] = field(default_factory=list)
    """Pairs of a body's name and the force [N] or torque [N m] of this connection on it."""
    surfaces: dict[sp.Symbol, sp.Expr] = field(default_factory=dict)
    shared: dict[sp.Symbol, sp.Expr] = field(default_factory=dict)
    """Surfaces of other connections whose signs occur in the terms of this connection (as signs of equal kinks)."""
    holds: dict[sp.Symbol, sp.Expr] = field(default_factory=dict)
    impacts: dict[sp.Symbol, sp.Expr] = field(default_factory=dict)

    def error(self, message: str, *, at: str | None = None) -> CaseError:
        """Error at the key ``at``, or at the connection's kind if ``at`` is None."""
        return self.source.error(self.path if at is None else (*self.path, at), message, key=True)

    def later(self, names: Collection[str]) -> str:
        """Return the key that is last in the file among ``names``."""
        return [key for key in self.source.keys(self.path) if key in names][-1]

    @property
    def velocity(self) -> sp.Expr:
        """v_p - v_q [m/s], or omega_p - omega_q [rad/s]."""
        p, q = self.ends
        return p.velocity - q.velocity

    @property
    def distance(self) -> sp.Expr:
        """x_p - x_q [m], or phi_p - phi_q [rad]."""
        positions = []
        for i, body in enumerate(self.ends):
            if body.position is None:
                message = (
                    f"{self.kind} requires the position of '{body.name}', which has a 'velocity' only; "
                    "give its 'position' instead of its 'velocity'"
                )
                raise self.source.error((*self.path, "between", i), message)
            positions.append(body.position)
        p, q = positions
        return p - q

    def push(self, force: sp.Expr) -> None:
        """Add a force [N] or torque [N m] on the first body, and its opposite on the second."""
        for body, own in zip(self.ends, (force, -force), strict=False):
            if body.inertia is not None:
                self.pushes.append((body.name, own))

    def sign(self, letter: str, surface: sp.Expr) -> sp.Symbol:
        """Add a surface, named as the connection or ``letter_p_q``, and return the symbol of its sign."""
        name = self.name or "_".join((letter, *(body.name for body in self.ends)))
        symbol = sp.Symbol(name, real=True)
        self.surfaces[symbol] = surface
        self.kinks.declare(symbol, surface)
        return symbol

    def positive_part(self, key: str) -> sp.Expr:
        """Return max(0, value) of a key that may hold states; its kinks become surfaces."""
        value = self.values[key]
        return self.kinked(self.kinks.resolved(chosen(value, value, sp.S.Zero), [*self.kinked_values[key], value]))

    def limited(self, expression: sp.Expr, bound: sp.Expr) -> sp.Expr:
        """Return an expression limited to [-bound, bound]; its kinks become surfaces."""
        above, below = bound + expression, bound - expression
        return self.kinked(self.kinks.resolved((sgn(above) * above - sgn(below) * below) / 2, [above, below]))

    def kinked(self, expression: sp.Expr) -> sp.Expr:
        """Return an expression and add the surfaces of its kinks to this connection."""
        self.surfaces |= self.kinks.used(expression)
        for sign, surface in self.kinks.declared.items():
            if expression.has(sign) and sign not in self.surfaces:
                self.shared[sign] = surface
        return expression


@dataclass(frozen=True)
class Kind:
    add: Callable[[Link], None]
    """Adds the terms of the kind to a connection under construction."""
    meaning: str
    keys: tuple[Key, ...]
    on: Literal["", "mass", "rotor"] = ""
    """Kind of the one body that it acts on, named by ``on``. Empty if it acts between two bodies of ``between``."""
    between_given: bool = False
    """Whether it may connect two bodies of prescribed motion, on which it has no effect, but a mode."""

    @property
    def example(self) -> str:
        """Its key for bodies, in a message."""
        return "on: a" if self.on else "between: [a, wall]"


# -- springs, dampers, forces: Modelica's Spring, Damper, Force, Torque ---------------------------------


def _spring(link: Link) -> None:
    if not link.values:
        raise link.error("a spring requires 'stiffness' [N/m, between rotors N m/rad], 'cubic', or both")
    for name, power in (("stiffness", 1), ("cubic", 3)):
        if name in link.values:
            link.push(-link.values[name] * link.distance**power)


def _damper(link: Link) -> None:
    link.push(-link.values["coefficient"] * link.velocity)


def _load(link: Link) -> None:
    link.push(link.values["value"])


# -- dry friction: it opposes the relative velocity v = v_p - v_q; the sign s of v belongs to a surface --

LAWS = {"coulomb": None, "stribeck": "slope", "stribeck_exp": "velocity"}
"""Friction law -> key that only this law requires. ``stribeck`` is Eq. (2) of Olejnik and Awrejcewicz (2013),
force/(1 + slope abs(v)). ``stribeck_exp`` is force + (static - force) exp(-abs(v)/velocity), as in Modelica's
``MassWithStopAndFriction``."""


def _friction(link: Link) -> None:
    law = _checked_law(link)
    given = link.values
    velocity = link.velocity
    alone = all(body.inertia is None for body in link.ends)
    if alone and _is_constant(velocity.xreplace(link.kinks.parameters)):
        velocity = velocity.xreplace({TIME: sp.Integer(0)})
    sign = link.sign("s", velocity)
    normal = link.positive_part("normal") if "normal" in given else sp.Integer(1)
    speed = sign * velocity  # abs(v), written as a smooth expression in each mode
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
    if alone and not velocity.has(TIME):  # no effect on the motion, but stuck while the velocities are equal
        link.holds[sign] = normal * (force if static is None else static)
    elif not alone and static is not None and law != "stribeck_exp":  # this law reaches 'static' at rest
        link.holds[sign] = normal * static


def _is_constant(velocity: sp.Expr) -> bool:
    """Check whether a prescribed velocity is constant, by its derivative (an analytic function) at a few times."""
    rate, times = sp.diff(velocity, TIME), (sp.Rational(1, 3), sp.Rational(7, 5), sp.Rational(29, 11))
    return all(abs(sp.N(rate.xreplace({TIME: time}), 40)) < sp.Float("1e-30") for time in times)


def _checked_law(link: Link) -> str:
    law = link.words["law"]
    for name, own in LAWS.items():
        if own is not None and (own in link.values) != (name == law):
            if name == law:
                unit = "s/m, between rotors s/rad" if own == "slope" else "m/s, between rotors rad/s"
                raise link.error(f"friction with the law '{law}' requires '{own}' [{unit}]")
            raise link.error(f"the law '{law}' has no '{own}'; the law '{name}' has", at=own)
    return law


# -- one-sided stops: they keep x_p - x_q at or above a gap, as Modelica's ElastoGap does ----------------


def _stop(link: Link) -> None:
    """Add a one-sided stop: hard (the bodies rebound) or elastic (a spring with damping).

    As in Modelica, damping never exceeds the spring's force: the stop does not pull, and the force is continuous.
    """
    ways = [name for name in ("restitution", "stiffness") if name in link.values]
    if not ways:
        elastic = "'stiffness' [N/m, between rotors N m/rad]"
        raise link.error(f"a stop requires 'restitution' [1] (hard) or {elastic} (elastic)")
    if len(ways) == 2:
        raise link.error("a stop has 'restitution' (hard) or 'stiffness' (elastic), not both", at=link.later(ways))
    opening = link.distance - link.values["gap"]
    sign = link.sign("g", opening)
    if ways == ["restitution"]:
        if "damping" in link.values:
            raise link.error("a hard stop, with 'restitution', has no 'damping'", at="damping")
        link.impacts[sign] = link.values["restitution"]
        return
    spring = -link.values["stiffness"] * opening
    link.push(spring * (1 - sign) / 2)
    if "damping" in link.values:
        link.push(link.limited(-link.values["damping"] * link.velocity, spring) * (1 - sign) / 2)


KINDS: Mapping[str, Kind] = {
    "damper": Kind(
        _damper,
        "opposes the relative velocity: force -coefficient (v_p - v_q) on the first body",
        (Key("coefficient", "N s/m", "N m s/rad", "force over relative velocity"),),
    ),
    "force": Kind(
        _load,
        "external force along the body's coordinate",
        (Key("value", "N", "N", "force, in t and parameters", of="time"),),
        on="mass",
    ),
    "friction": Kind(
        _friction,
        "dry friction: opposes the relative velocity, and holds the bodies together while it is zero",
        (
            Key("law", "", "", "how friction depends on the relative velocity", words=tuple(LAWS)),
            Key("force", "N", "N m", "sliding friction; with 'normal': its coefficient [1]", False, "nonnegative"),
            Key("slope", "s/m", "s/rad", "how fast friction falls with speed", True, "nonnegative"),
            Key("velocity", "m/s", "rad/s", "at which friction has fallen by 1 - 1/e", True, "positive"),
            Key("viscous", "N s/m", "N m s/rad", "coefficient of additional viscous friction", True, "nonnegative"),
            Key("static", "N", "N m", "static friction; with 'normal': its coefficient [1]", True, "nonnegative"),
            Key("normal", "N", "N m", "load on the contact, in t and states; 0 if negative", True, of="states"),
        ),
        between_given=True,
    ),
    "spring": Kind(
        _spring,
        "pulls its bodies together: force -(stiffness d + cubic d^3) on the first body, d = x_p - x_q",
        (
            Key("stiffness", "N/m", "N m/rad", "of the linear part; may be negative", True),
            Key("cubic", "N/m^3", "N m/rad^3", "of the cubic part; negative: a softening spring", True),
        ),
    ),
    "stop": Kind(
        _stop,
        "keeps x_p - x_q at or above the gap, by impacts (hard), or by stiffness times the depth (elastic)",
        (
            Key("gap", "m", "rad", "least value of x_p - x_q"),
            Key("stiffness", "N/m", "N m/rad", "of an elastic stop", True, "positive"),
            Key("damping", "N s/m", "N m s/rad", "of an elastic stop", True, "nonnegative"),
            Key("restitution", "1", "1", "of a hard stop: speed after over speed before an impact", True, "fraction"),
        ),
    ),
    "torque": Kind(
        _load,
        "external torque along the rotor's angle",
        (Key("value", "N m", "N m", "torque, in t and parameters", of="time"),),
        on="rotor",
    ),
}
"""Name of a kind in a scene -> kind, in alphabetical order."""
