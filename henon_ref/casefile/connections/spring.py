"""Springs, linear and cubic, between masses or (torsional) between rotors; Modelica's ``Spring``."""

from __future__ import annotations

from henon_ref.casefile.connection import Key, Kind, Link


def _add(link: Link) -> None:
    if not link.values:
        raise link.error("a spring lacks its 'stiffness' [N/m, between rotors N m/rad], or 'cubic', or both")
    for name, power in (("stiffness", 1), ("cubic", 3)):
        if name in link.values:
            link.push(-link.values[name] * link.distance**power)


KIND = Kind(
    meaning="pulls its bodies together: force -(stiffness d + cubic d^3) on the first, d = x_p - x_q",
    keys=(
        Key("stiffness", "N/m", "N m/rad", "of the linear part; may be negative", optional=True),
        Key("cubic", "N/m^3", "N m/rad^3", "of the cubic part; negative: a softening spring", optional=True),
    ),
    add=_add,
)
