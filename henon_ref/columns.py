"""The columns of the result files, in their order: a contract, so new ones go to the end."""

from __future__ import annotations

RUN_COLUMNS = (
    "case", "reading", "solver", "library_version", "rtol", "atol", "step_s", "status", "landing",
    "reference_transitions", "found_transitions", "matched", "missed", "spurious",
    "max_time_error_s", "rms_time_error_s", "max_state_error", "max_surface_drift",
    "stick_count", "max_stick_error_s", "wall_s", "wall_s_iqr", "compile_s",
    "steps", "rhs_evaluations", "event_evaluations",
    "status_reason", "expected_status", "verdict", "digits", "time_unit_s", "end_time_s",
    "reference_radius_s", "missed_touches", "spurious_touches", "cut_off", "wall_s_low", "wall_s_high", "timed_runs",
    "verdict_basis", "cause", "undecided_after_s",
)  # fmt: skip
"""A row a reading, solver and setting. From ``status_reason`` on beyond the contract:

* ``expected_status``: how the truth ends, missing where nothing is known of it after the start;
* ``verdict``: see :mod:`henon_ref.score.verdict`;
* ``digits``: decimal digits of the worst transition time, counted from ``time_unit_s``;
* ``missed_touches``, ``spurious_touches``: touch-and-go events, not counted as missed or spurious;
* ``cut_off``: transitions that the horizon cuts off;
* ``wall_s_low``, ``wall_s_high``: 95 % bootstrap interval of the median; ``timed_runs``: samples behind it;
* ``verdict_basis``: what the verdict on a run that is not right rests on;
* ``cause``: name of the cause of a solver's defect, where one is known for certain (:mod:`henon_ref.campaign.causes`);
* ``undecided_after_s``: from when on the solver decides nothing of some surface, which is below its own rounding.
"""

TRANSITION_COLUMNS = (
    "case", "reading", "solver", "rtol", "step_s", "index", "kind", "surface", "from_mode", "to_mode",
    "reference_time_s", "reference_radius_s", "time_s", "time_error_s", "conditioning",
)  # fmt: skip
"""A row a transition, of the truth or of the run or (matched) of both; the state by name follows, then:"""

JUDGED_COLUMNS = ("transversality", "graze_distance", "outcome", "verdict")
"""What a verdict on one transition rests on, and the verdict.

* ``transversality``: the guard's speed through zero [unit of the guard / s];
* ``graze_distance``: depth to which the surface function goes between the transition and its neighbour, on the
  parabola through both [unit of the surface];
* ``outcome``: matched, missed, spurious, cut off (beyond the horizon within the run's error), touch (no mode changes);
* ``verdict``: on one that is missed or spurious, see :mod:`henon_ref.score.verdict`.
"""

STICK_COLUMNS = (
    "case", "reading", "solver", "rtol", "step_s", "index", "start_s", "duration_s", "reference_s", "error_s",
    "published_s", "published_error_s", "length",
)  # fmt: skip
"""A row a stick that ends within the measured window, of the truth or of the run or of both."""

Row = dict[str, object]
"""One row by column name; a missing value is None (an empty field in the file)."""
REPEATED = "a repeated run ended otherwise than the first one, "
"""How a row's reason tells of that."""
