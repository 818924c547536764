"""Linear dampers; Modelica's ``Damper``."""

from __future__ import annotations

from henon_ref.casefile.connection import Key, Kind, Link


def _add(link: Link) -> None:
    link.push(-link.values["coefficient"] * link.velocity)


KIND = Kind(
    meaning="resists a relative velocity: force -coefficient (v_p - v_q) on the first",
    keys=(Key("coefficient", "N s/m", "N m s/rad", "force over relative velocity"),),
    add=_add,
)
