"""A force from outside on one mass, an incline's pull among them; Modelica's ``Force``."""

from __future__ import annotations

from henon_ref.casefile.connection import Key, Kind, Link


def _add(link: Link) -> None:
    link.push(link.values["value"])


KIND = Kind(
    meaning="a force from outside, along the body's coordinate",
    keys=(Key("value", "N", "N", "of the force, in t and parameters", of="time"),),
    add=_add,
    on="mass",
)
