"""One run as rows of the result files."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from henon_ref.casefile.case import Reading
from henon_ref.harness.campaign.causes import cause_of
from henon_ref.harness.campaign.settings import Setting
from henon_ref.harness.campaign.timing import summarise
from henon_ref.harness.rows import REPEATED, RunRow, StickRow, TransitionRow
from henon_ref.harness.score.errors import Score, score
from henon_ref.harness.score.matching import Matching
from henon_ref.harness.score.reference import Expected
from henon_ref.harness.score.sticks import published_partners
from henon_ref.harness.score.verdict import granted_error, graze_distance, missed_verdict, spurious_verdict
from henon_ref.modes.mode import Mode, mode_text
from henon_ref.text import short_line
from henon_ref.trajectory import Counts, Stick, Trajectory, sticks
from henon_ref.workers.worker import Failure

FAILURES = {"unsupported": "not run", "unavailable": "not run", "timeout": "not judged"}
"""Verdicts on runs without an answer, by status; any other is the solver's fault, and so is an ignored deadline."""
UNJUDGED = (None, "not run", "not judged")
"""Verdicts of runs whose row says why there is none, in ``status_reason``: in the solver's own words, or else ..."""
NO_TRUTH, UNSAID = "there is no truth to judge it by", "the solver gives no reason"


@dataclass(frozen=True)
class Outcome:
    """Everything that is known of one run."""

    case: str
    reading: Reading
    solver: str
    setting: Setting
    library_version: str = ""
    landing: str = ""
    compile_s: float | None = None
    trajectory: Trajectory | None = None
    samples: tuple[float, ...] = ()
    failure: Failure | None = None
    """Why there is no answer."""
    repeat_failure: Failure | None = None
    """What happened after the answer, when the run was repeated for its wall time."""
    score: Score | None = None

    @property
    def prepared(self) -> bool:
        """Whether its preparation came to an end."""
        return self.compile_s is not None

    @property
    def timed_out(self) -> bool:
        """Whether it took too long, by its own word or by ours."""
        known = self.failure or self.trajectory
        return known is not None and known.status == "timeout"

    @property
    def invented(self) -> bool:
        """Whether it has transitions that are not the truth's."""
        return self.score is not None and bool(self.score.matching.spurious)


@dataclass(frozen=True)
class Record:
    """One run, scored: its row, its transitions' and sticks' rows, its raw timing samples."""

    run: RunRow
    transitions: list[TransitionRow] = field(default_factory=list)
    sticks: list[StickRow] = field(default_factory=list)
    samples: list[float] = field(default_factory=list)


def scored(outcome: Outcome, expected: Expected | None) -> Outcome:
    """The outcome with its trajectory's score, where there is one and something to score it against."""
    if outcome.trajectory is None or expected is None:
        return outcome
    return replace(outcome, score=score(outcome.trajectory, expected, tolerance=outcome.setting.rtol))


def record(outcome: Outcome, expected: Expected | None) -> Record:
    """The rows of one outcome; :func:`scored` comes first."""
    transitions: list[TransitionRow] = []
    stick_rows: list[StickRow] = []
    if outcome.trajectory is not None and expected is not None and outcome.score is not None:
        transitions = _transition_rows(outcome, outcome.trajectory, expected, outcome.score)
        stick_rows = _stick_rows(outcome, outcome.trajectory, expected, outcome.score)
    run = _run_row(outcome, expected, stick_rows)
    run = replace(run, cause=cause_of(run, transitions))
    return Record(run, transitions, stick_rows, list(outcome.samples))


Values = dict[str, Any]
"""Some fields of a row."""


def _identity(outcome: Outcome) -> Values:
    """What all rows of one outcome begin with."""
    setting = outcome.setting
    return {"case": outcome.case, "reading": outcome.reading.name, "solver": outcome.solver, "rtol": setting.rtol,
            "step_s": setting.step}  # fmt: skip


def _run_row(outcome: Outcome, expected: Expected | None, stick_rows: list[StickRow]) -> RunRow:
    row = _identity(outcome) | {"library_version": outcome.library_version or None, "atol": outcome.setting.atol}
    row.update(landing=outcome.landing or None, compile_s=outcome.compile_s)
    if expected is not None:
        counted = [event for event in expected.transitions if event.kind != "graze"]
        row.update(reference_transitions=len(counted), time_unit_s=expected.time_unit)
        row.update(expected_status=None if expected.nothing_known else expected.status)
        row.update(reference_radius_s=expected.radius if expected.transitions else None)
    if outcome.trajectory is not None:
        row.update(_trajectory_values(outcome.trajectory))
    if outcome.score is not None:
        row.update(_score_values(outcome.score))
        errors = [abs(stick.error_s) for stick in stick_rows if stick.error_s is not None]
        row.update(stick_count=sum(stick.duration_s is not None for stick in stick_rows))
        row.update(max_stick_error_s=max(errors, default=None))
    if outcome.failure is not None:
        row.update(status=outcome.failure.status, status_reason=outcome.failure.reason or None)
        forgiven = None if outcome.failure.ignored else FAILURES.get(outcome.failure.status)
        row.update(verdict=forgiven or "solver defect")
    if row.get("verdict") in UNJUDGED and not row.get("status_reason"):
        row.update(status_reason=row.get("verdict_basis") or (UNSAID if expected else NO_TRUTH))
    if outcome.repeat_failure is not None:
        row.update(status_reason=_and_then(row.get("status_reason"), outcome.repeat_failure))
    timing = summarise(outcome.samples)
    if timing is not None:
        row.update(wall_s=timing.median, wall_s_iqr=timing.iqr, wall_s_low=timing.low, wall_s_high=timing.high)
        row.update(timed_runs=len(outcome.samples))
    return RunRow(**row)


def _and_then(reason: str | None, failure: Failure) -> str:
    """The reason of a row, and what happened when its run was repeated."""
    how = f"{REPEATED}{failure.status}: {failure.reason}"
    return short_line(f"{reason}; {how}" if reason else how)


def _trajectory_values(trajectory: Trajectory) -> Values:
    """What a run says of itself. Counts that a solver leaves at nought it did not count."""
    landings = sorted({event.landing for event in trajectory.transitions if event.landing})
    counts: Counts = trajectory.counts
    values = {
        "status": trajectory.status,
        "status_reason": trajectory.reason or None,
        "found_transitions": sum(event.kind != "graze" for event in trajectory.transitions),
        "max_surface_drift": trajectory.max_surface_drift,
        "steps": counts.steps or None,
        "rhs_evaluations": counts.rhs_evaluations or None,
        "event_evaluations": counts.event_evaluations or None,
        "end_time_s": trajectory.end_time,
        "undecided_after_s": min((time for _, time in trajectory.undecided_after), default=None),
    }
    return values | ({"landing": short_line("+".join(landings))} if landings else {})


def _score_values(score: Score) -> Values:
    matching = score.matching
    return {
        "status": score.status,
        "status_reason": score.reason or None,
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
    """The union of the truth's transitions and the run's, in order of time."""
    reading, allowed = outcome.reading, granted_error(expected, outcome.setting.rtol)
    system, identity = reading.problem.system, _identity(outcome)
    matching = score.matching
    partner = dict(matching.pairs + matching.touch_pairs)
    matched_runs = set(partner.values())
    order: list[tuple[float, int | None, int | None]] = [
        (event.time, i, partner.get(i)) for i, event in enumerate(expected.transitions)
    ]
    order += [(event.time, None, j) for j, event in enumerate(trajectory.transitions) if j not in matched_runs]
    order.sort(key=lambda entry: entry[0])
    outcomes = _outcomes(matching)
    rows: list[TransitionRow] = []
    for index, (_, i, j) in enumerate(order):
        exact = None if i is None else expected.transitions[i]
        found = None if j is None else trajectory.transitions[j]
        event = exact if exact is not None else found
        if event is None:
            continue
        row = identity | {"index": index, "kind": event.kind, "surface": system.sign_names[event.surface]}
        row.update(from_mode=_text(event.from_mode, reading), to_mode=_text(event.to_mode, reading))
        if i is not None and exact is not None:
            row.update(reference_time_s=exact.time, reference_radius_s=exact.radius, conditioning=exact.conditioning)
            row.update(time_error_s=score.time_errors.get(i), transversality=exact.transversality)
            row.update(graze_distance=0.0 if exact.kind == "graze" else graze_distance(expected, i))
        if found is not None:
            row.update(time_s=found.time, state=dict(zip(system.state_names, found.state, strict=False)))
        what = outcomes.get((i, j), "touch")
        row.update(outcome=what)
        if what == "missed" and i is not None:
            row.update(verdict=missed_verdict(expected, i, allowed).word)
        elif what == "spurious" and found is not None:
            row.update(verdict=spurious_verdict(expected, found, allowed).word)
        rows.append(TransitionRow(**row))
    return rows


def _outcomes(matching: Matching) -> dict[tuple[int | None, int | None], str]:
    """What became of each transition of the truth (index or None) and of the run; touches left out."""
    found: dict[tuple[int | None, int | None], str] = dict.fromkeys(matching.pairs, "matched")
    found.update(((i, None), "missed") for i in matching.missed)
    found.update(((None, j), "spurious") for j in matching.spurious)
    found.update(((i, None), "cut off") for i in matching.cut_reference)
    found.update(((None, j), "cut off") for j in matching.cut_found)
    return found


def _text(mode: Mode, reading: Reading) -> str:
    return mode_text(mode, reading.problem.system.sign_names)


def _stick_rows(outcome: Outcome, trajectory: Trajectory, expected: Expected, score: Score) -> list[StickRow]:
    """The union of the truth's sticks and the run's within the measured window, in order of their ends."""
    reading = outcome.reading
    after = reading.measure_after
    exact = sticks(expected.transitions, start=expected.start, after=after)
    found = sticks(trajectory.transitions, start=expected.start, after=after)
    partner = dict(score.matching.pairs)
    by_ends = {(stick.begin, stick.end): stick for stick in found}
    pairs: list[tuple[Stick | None, Stick | None]] = []
    for stick in exact:
        begin = None if stick.begin is None else partner.get(stick.begin, -1)
        pairs.append((stick, by_ends.pop((begin, partner.get(stick.end, -1)), None)))
    pairs += [(None, stick) for stick in by_ends.values()]
    pairs.sort(key=lambda pair: _end(pair, expected, trajectory))
    durations = [None if run is None else run.duration for _, run in pairs]
    published = reading.published.stick_durations if reading.published else ()
    partners = published_partners(durations, [float(value) for value in published])
    rows: list[StickRow] = []
    for index, ((truth, run), printed) in enumerate(zip(pairs, partners, strict=True)):
        row = _identity(outcome) | {"index": index, "published_s": printed}
        row.update(reference_s=None if truth is None else truth.duration)
        if run is not None:
            row.update(start_s=run.start, duration_s=run.duration, length=_length(run, trajectory, reading))
            row.update(error_s=None if truth is None else run.duration - truth.duration)
            row.update(published_error_s=None if printed is None else run.duration - printed)
        rows.append(StickRow(**row))
    return rows


def _end(pair: tuple[Stick | None, Stick | None], expected: Expected, trajectory: Trajectory) -> float:
    truth, run = pair
    if truth is not None:
        return expected.transitions[truth.end].time
    return trajectory.transitions[run.end].time if run is not None else 0.0


def _length(stick: Stick, trajectory: Trajectory, reading: Reading) -> float:
    """How far the first state moves during a stick."""
    last = trajectory.transitions[stick.end].state[0]
    first = float(reading.problem.initial[0])
    if stick.begin is not None:
        first = trajectory.transitions[stick.begin].state[0]
    return abs(last - first)
