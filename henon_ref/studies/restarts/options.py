"""Options of the libraries' own event handling that somebody who knows them might set, beside their defaults here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from baselines.base import Adapter
from baselines.heyoka_taylor import HEYOKA
from baselines.scipy_ivp import BDF, DOP853, LSODA, RADAU, RK45

AGAIN = "the root located again, `xtol` 1e-300"
TIGHTEST = 1e-300
"""Absolute tolerance of a root's time that leaves the relative one, 4 eps, alone [s]."""


@dataclass(frozen=True)
class Option:
    """One option of one library."""

    without: Adapter
    with_it: Adapter
    words: str
    """What is set."""


def options_of(libraries: Sequence[str]) -> list[Option]:
    """The options of these libraries; SUNDIALS has none beside the direction, which two of the restarts differ in."""
    found = [
        Option(HEYOKA, replace(HEYOKA, name="heyoka (cooldown)", cooldown="automatic"), "`cooldown`: heyoka's own"),
        *(
            Option(own, replace(own, name=f"{own.name} (root)", root_tolerance=TIGHTEST), AGAIN)
            for own in (RK45, DOP853, RADAU, BDF, LSODA)
        ),
    ]
    return [option for option in found if option.without.name in libraries]
