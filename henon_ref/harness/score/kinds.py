"""The kind of a case, from its exact run: what a solver has to be good at."""

from __future__ import annotations

from typing import Literal, get_args

from henon_ref.harness.score.reference import Expected

Kind = Literal[
    "crossings",
    "stick-slip",
    "several surfaces",
    "jumps",
    "graze or close roots",
    "no transition",
    "ends early",
    "no truth",
]
KINDS: tuple[Kind, ...] = get_args(Kind)
"""In the order of tables."""
CLOSE = 1 / 400
"""Two transitions of one surface are close where the time between them is less than this part of the mean time between
transitions. Motions of the suite that are not built to have close roots stay above 1/320 of it."""


def kind_of(expected: Expected | None, surfaces: int) -> Kind:
    """The kind of a reading (its truth, how many surfaces it has); the first of these that holds.

    * ``no truth``: nothing is known of the exact run after its start;
    * ``ends early``: it cannot reach its horizon (its future is not unique, the model no longer holds, it diverges);
    * ``graze or close roots``: it touches a surface, comes close to one without reaching it (by the truth's own
      list of near grazes), or two transitions of one surface are close;
    * ``no transition``;
    * ``jumps``: the state jumps;
    * ``several surfaces``: the system has more than one;
    * ``stick-slip``: it enters or leaves sliding;
    * ``crossings``: it crosses the surface, and that is all.
    """
    if expected is None or expected.nothing_known:
        return "no truth"
    if expected.status != "ok" or expected.partial:
        return "ends early"
    kinds = {event.kind for event in expected.transitions}
    if "graze" in kinds or expected.near_grazes or _has_close_roots(expected):
        return "graze or close roots"
    if not kinds:
        return "no transition"
    if "reset" in kinds:
        return "jumps"
    if surfaces > 1:
        return "several surfaces"
    return "stick-slip" if kinds & {"stick", "release"} else "crossings"


def _has_close_roots(expected: Expected) -> bool:
    mean = (expected.end_time - expected.start) / max(len(expected.transitions), 1)
    return min(expected.gaps, default=mean) < CLOSE * mean
