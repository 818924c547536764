"""One-sided stops: they keep x_p - x_q at or above a gap, as Modelica's ``ElastoGap`` does.

As there, the damping force of an elastic stop is never larger than the spring's, so that it does not pull and its force
is continuous. A hard stop throws back (:func:`henon_ref.casefile.assembly.thrown_back`).
"""

from __future__ import annotations

from henon_ref.casefile.connection import Key, Kind, Link


def _add(link: Link) -> None:
    ways = [name for name in ("restitution", "stiffness") if name in link.values]
    if not ways:
        elastic = "'stiffness' [N/m, between rotors N m/rad]"
        raise link.error(f"a stop is hard, with 'restitution' [1], or elastic, with {elastic}; give one of the two")
    if len(ways) == 2:
        raise link.error("a stop has 'restitution' (hard) or 'stiffness' (elastic), not both", at=link.later(ways))
    opening = link.distance - link.values["gap"]
    sign = link.sign("g", opening)
    if ways == ["restitution"]:
        if "damping" in link.values:
            raise link.error("a hard stop, with 'restitution', has no 'damping'", at="damping")
        link.throw_back(sign, link.values["restitution"])
        return
    spring = -link.values["stiffness"] * opening
    link.push(spring * (1 - sign) / 2)
    if "damping" in link.values:
        link.push(link.limited(-link.values["damping"] * link.velocity, spring) * (1 - sign) / 2)


KIND = Kind(
    meaning="keeps x_p - x_q at or above the gap: throws back, or pushes by stiffness times what it falls short",
    keys=(
        Key("gap", "m", "rad", "least value of x_p - x_q"),
        Key("stiffness", "N/m", "N m/rad", "of an elastic stop", optional=True, range="positive"),
        Key("damping", "N s/m", "N m s/rad", "of an elastic stop, besides", True, "nonnegative"),
        Key("restitution", "1", "1", "of a hard stop: speed after an impact over that before", True, "fraction"),
    ),
    add=_add,
)
