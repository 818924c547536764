"""Convert one run to rows of the result files."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from henon_ref.casefile.case import Reading
from henon_ref.harness.campaign.causes import cause_of
from henon_ref.harness.campaign.options import Setting
from henon_ref.harness.campaign.timing import summarise
from henon_ref.harness.rows import REPEATED, UNJUDGED, RunRow, StickRow, TransitionRow
from henon_ref.harness.score.matching import Matching
from henon_ref.harness.score.reference import Expected
from henon_ref.harness.score.scoring import (
    Score,
    granted_error,
    graze_distance,
    missed_verdict,
    published_partners,
    score,
    spurious_verdict,
)
from henon_ref.modes.mode import mode_text
from henon_ref.text import short_line
from henon_ref.trajectory import Counts, Event, Stick, Trajectory, sticks
from henon_ref.workers.worker import Failure

Values = dict[str, Any]
"""Some fields of a row."""
NO_TRUTH, UNSAID = "there is no truth to judge it by", "the solver gives no reason"
"""Reasons used if the solver gives none."""


@dataclass(frozen=True)
class Outcome:
    """Result of one run, before it is converted to rows."""

    case: str
    reading: Reading
    solver: str
    setting: Setting
    library_version: str = ""
    landing: str = ""
    compile_s: float | None = None
    """Wall time of the one-time preparation [s]; None if the preparation failed."""
    trajectory: Trajectory | None = None
    samples: tuple[float, ...] = ()
    failure: Failure | None = None
    """Reason why there is no answer."""
    repeat_failure: Failure | None = None
    """Failure of a repetition for the wall time, after a right answer."""
    score: Score | None = None

    @property
    def timed_out(self) -> bool:
        """Whether the run timed out, as reported by the solver or by the worker pool."""
        known = self.failure or self.trajectory
        return known is not None and known.status == "timeout"

    @property
    def identity(self) -> Values:
        """Fields common to all rows of the run."""
        run = {"case": self.case, "reading": self.reading.name, "solver": self.solver}
        return run | {"rtol": self.setting.rtol, "step_s": self.setting.step}


@dataclass(frozen=True)
class Record:
    """Rows of one scored run, its transitions and its sticks, and the raw timing samples."""

    run: RunRow
    transitions: list[TransitionRow] = field(default_factory=list)
    sticks: list[StickRow] = field(default_factory=list)
    samples: list[float] = field(default_factory=list)


def scored(outcome: Outcome, expected: Expected | None) -> Outcome:
    """Return the outcome with its score; unchanged if it has no trajectory, or if there is no truth."""
    if outcome.trajectory is None or expected is None:
        return outcome
    return replace(outcome, score=score(outcome.trajectory, expected, tolerance=outcome.setting.rtol))


def record(outcome: Outcome, expected: Expected | None) -> Record:
    """Return the rows of an outcome that has passed through :func:`scored`."""
    transitions: list[TransitionRow] = []
    stick_rows: list[StickRow] = []
    if outcome.trajectory is not None and expected is not None and outcome.score is not None:
        transitions = _transition_rows(outcome, outcome.trajectory, expected, outcome.score)
        stick_rows = _stick_rows(outcome, outcome.trajectory, expected, outcome.score)
    run = _run_row(outcome, expected, stick_rows)
    return Record(replace(run, cause=cause_of(run, transitions)), transitions, stick_rows, list(outcome.samples))


def _run_row(outcome: Outcome, expected: Expected | None, stick_rows: list[StickRow]) -> RunRow:
    """Collect the fields of a run, from its settings to its wall times; later values replace earlier ones."""
    row = outcome.identity | {"atol": outcome.setting.atol, "library_version": outcome.library_version or None}
    row |= {"landing": outcome.landing or None, "compile_s": outcome.compile_s}
    if expected is not None:
        row |= {
            "reference_transitions": sum(event.kind != "graze" for event in expected.transitions),
            "time_unit_s": expected.time_unit,
            "expected_status": None if expected.nothing_known else expected.status,
            "reference_radius_s": expected.radius if expected.transitions else None,
        }
    if outcome.trajectory is not None:
        row |= _trajectory_values(outcome.trajectory)
    if outcome.score is not None:
        errors = [abs(stick.error_s) for stick in stick_rows if stick.error_s is not None]
        row |= _score_values(outcome.score)
        row |= {"stick_count": sum(stick.duration_s is not None for stick in stick_rows)}
        row |= {"max_stick_error_s": max(errors, default=None)}
    if (failure := outcome.failure) is not None:
        verdicts = {"unsupported": "not run", "unavailable": "not run", "timeout": "not judged"}
        verdict = "solver defect" if failure.ignored else verdicts.get(failure.status, "solver defect")
        row |= {"status": failure.status, "status_reason": failure.reason, "verdict": verdict}
    reason = row.get("status_reason")
    if not reason and row.get("verdict") in (None, *UNJUDGED):
        reason = row.get("verdict_basis") or (UNSAID if expected else NO_TRUTH)
    if (later := outcome.repeat_failure) is not None:
        how = f"{REPEATED}{later.status}: {later.reason}"
        reason = short_line(f"{reason}; {how}" if reason else how)
    return RunRow(**row | summarise(outcome.samples) | {"status_reason": reason or None})


def _trajectory_values(trajectory: Trajectory) -> Values:
    """Return the fields that the solver reports; a count of zero means that the solver did not count."""
    landings = sorted({event.landing for event in trajectory.transitions if event.landing})
    counts: Counts = trajectory.counts
    return {
        "status": trajectory.status,
        "status_reason": trajectory.reason,
        "found_transitions": sum(event.kind != "graze" for event in trajectory.transitions),
        "max_surface_drift": trajectory.max_surface_drift,
        "steps": counts.steps or None,
        "rhs_evaluations": counts.rhs_evaluations or None,
        "event_evaluations": counts.event_evaluations or None,
        "end_time_s": trajectory.end_time,
        "undecided_after_s": min((time for _, time in trajectory.undecided_after), default=None),
        **({"landing": short_line("+".join(landings))} if landings else {}),
    }


def _score_values(score: Score) -> Values:
    matching = score.matching
    return {
        "status": score.status,
        "status_reason": score.reason,
        "verdict": score.verdict.word,
        "verdict_basis": score.verdict.basis or None,
        "matched": len(matching.pairs),
        "missed": len(matching.missed),
        "spurious": len(matching.spurious),
        "missed_touches": len(matching.missed_touches),
        "spurious_touches": len(matching.spurious_touches),
        "cut_off": len(matching.cut_reference) + len(matching.cut_found),
        "max_time_error_s": score.max_time_error,
        "rms_time_error_s": score.rms_time_error,
        "max_state_error": score.max_state_error,
        "digits": score.digits,
    }


def _transition_rows(outcome: Outcome, trajectory: Trajectory, expected: Expected, score: Score) -> list[TransitionRow]:
    """Return the rows of the union of the exact and the found transitions, in order of time."""
    system, allowed = outcome.reading.problem.system, granted_error(expected, outcome.setting.rtol)
    matching = score.matching
    partner = dict(matching.pairs + matching.touch_pairs)
    order: list[Pair] = [(i, partner.get(i)) for i in range(len(expected.transitions))]
    order += [(None, j) for j in sorted(set(range(len(trajectory.transitions))) - set(partner.values()))]
    order.sort(key=lambda pair: _time(pair, expected, trajectory))
    became = _became(matching)
    rows: list[TransitionRow] = []
    for index, (i, j) in enumerate(order):
        what = became.get((i, j), "touch")
        row = outcome.identity | {"index": index, "outcome": what}
        event: Event
        if j is not None:
            event = found = trajectory.transitions[j]
            row |= {"time_s": found.time, "state": dict(zip(system.state_names, found.state, strict=False))}
            if what == "spurious":
                row["verdict"] = spurious_verdict(expected, found, allowed).word
        if i is not None:
            event = exact = expected.transitions[i]
            row |= {
                "reference_time_s": exact.time,
                "reference_radius_s": exact.radius,
                "conditioning": exact.conditioning,
                "time_error_s": score.time_errors.get(i),
                "transversality": exact.transversality,
                "graze_distance": 0.0 if exact.kind == "graze" else graze_distance(expected, i),
            }
            if what == "missed":
                row["verdict"] = missed_verdict(expected, i, allowed).word
        modes = (mode_text(mode, system.sign_names) for mode in (event.from_mode, event.to_mode))
        row |= {"kind": event.kind, "surface": system.sign_names[event.surface]}
        rows.append(TransitionRow(**row | dict(zip(("from_mode", "to_mode"), modes, strict=True))))
    return rows


Pair = tuple[int | None, int | None]
"""Index of a transition in the truth and in the run; None if it is absent there."""


def _became(matching: Matching) -> dict[Pair, str]:
    """Return the outcome of each matched, missed, spurious or cut-off transition."""
    found: dict[Pair, str] = dict.fromkeys(matching.pairs, "matched")
    found |= {(i, None): "missed" for i in matching.missed}
    found |= {(None, j): "spurious" for j in matching.spurious}
    found |= {(i, None): "cut off" for i in matching.cut_reference}
    return found | {(None, j): "cut off" for j in matching.cut_found}


def _time(pair: Pair, expected: Expected, trajectory: Trajectory) -> float:
    """Return the exact time of a pair if there is one, else the found time [s]."""
    i, j = pair
    if i is not None:
        return expected.transitions[i].time
    return trajectory.transitions[j].time if j is not None else 0.0


def _stick_rows(outcome: Outcome, trajectory: Trajectory, expected: Expected, score: Score) -> list[StickRow]:
    """Return the rows of the union of exact and found sticks in the measured window, in order of their ends."""
    reading = outcome.reading
    exact, found = (
        sticks(own.transitions, start=expected.start, after=reading.measure_after) for own in (expected, trajectory)
    )
    partner = dict(score.matching.pairs)
    by_ends = {(stick.begin, stick.end): stick for stick in found}
    pairs: list[tuple[Stick | None, Stick | None]] = []
    for stick in exact:
        begin = None if stick.begin is None else partner.get(stick.begin, -1)
        pairs.append((stick, by_ends.pop((begin, partner.get(stick.end, -1)), None)))
    pairs += [(None, stick) for stick in by_ends.values()]
    pairs.sort(key=lambda pair: _time((_end(pair[0]), _end(pair[1])), expected, trajectory))
    durations = [None if run is None else run.duration for _, run in pairs]
    published = reading.published.stick_durations if reading.published else ()
    partners = published_partners(durations, [float(value) for value in published])
    rows: list[StickRow] = []
    for index, ((truth, run), printed) in enumerate(zip(pairs, partners, strict=True)):
        row = outcome.identity | {"index": index, "published_s": printed}
        row |= {"reference_s": None if truth is None else truth.duration}
        if run is not None:
            row |= {"start_s": run.start, "duration_s": run.duration, "length": _length(run, trajectory, reading)}
            row |= {"error_s": None if truth is None else run.duration - truth.duration}
            row |= {"published_error_s": None if printed is None else run.duration - printed}
        rows.append(StickRow(**row))
    return rows


def _end(stick: Stick | None) -> int | None:
    return None if stick is None else stick.end


def _length(stick: Stick, trajectory: Trajectory, reading: Reading) -> float:
    last = trajectory.transitions[stick.end].state[0]
    first = float(reading.problem.initial[0])
    if stick.begin is not None:
        first = trajectory.transitions[stick.begin].state[0]
    return abs(last - first)
