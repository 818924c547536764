"""A torque from outside on one rotor; Modelica's ``Torque``."""

from __future__ import annotations

from henon_ref.casefile.connection import Key, Kind, Link


def _add(link: Link) -> None:
    link.push(link.values["value"])


KIND = Kind(
    meaning="a torque from outside, along the rotor's angle",
    keys=(Key("value", "N m", "N m", "of the torque, in t and parameters", of="time"),),
    add=_add,
    on="rotor",
)
