"""The kind of a case, from its exact run: the ability of a solver that the case tests."""

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
"""All kinds, in the order of tables."""
CLOSE = 1 / 400
"""Two transitions of one surface are close if the time between them is less than this part of the mean time between
transitions. Motions of the suite that are not built to have close roots stay above 1/320 of it."""


def kind_of(expected: Expected | None, surfaces: int) -> Kind:
    """Return the kind of a reading from its truth and its number of surfaces: the first one that applies.

    * ``no truth``: nothing is known of the exact run after its start;
    * ``ends early``: it cannot reach its horizon (its future is not unique, the model no longer holds, it diverges);
    * ``graze or close roots``: it touches a surface, comes close to one without reaching it (a near graze of the
      truth), or two transitions of one surface are close;
    * ``no transition``;
    * ``jumps``: the state jumps;
    * ``several surfaces``: the system has more than one;
    * ``stick-slip``: it enters or leaves sliding;
    * ``crossings``: it only crosses the surface.
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
