"""Tables on the truth of a reading: the exact run, its certification, and comparisons with published numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from decimal import Decimal
from typing import TYPE_CHECKING

from henon_ref.harness.campaign.comparison import ReadingResult
from henon_ref.harness.campaign.rows import Record
from henon_ref.harness.rows import RunRow, StickRow, number
from henon_ref.harness.score.reference import Expected
from henon_ref.harness.score.scoring import published_partners
from henon_ref.harness.table import Table, error, exponential, listing, significant
from henon_ref.text import code, markdown
from henon_ref.trajectory import sticks
from henon_ref.workers.worker import Failure

if TYPE_CHECKING:
    from henon_ref.harness.truth import Truth


def truth_table(result: ReadingResult, runs: Iterable[RunRow] = ()) -> Table:
    """Make the table of the exact run: end, transitions, certification and methods of computation.

    If the transitions are not certified, the table names the independent solvers in ``runs`` that confirm their modes.
    """
    headings, truth, expected = ("truth", "value", "note"), result.truth, result.expected
    if isinstance(truth, Failure) or expected is None:
        return Table(headings, "lll", [("exact run", "none, nothing is scored", _reason(result))])
    touches = sum(event.kind == "graze" for event in expected.transitions)
    ended = "the truth ends there" if expected.partial else ""
    rows = [
        ("exact run", _end(expected), "; ".join(filter(None, (ended, _reason(result))))),
        ("transitions", f"{len(expected.transitions) - touches}", ""),
        ("touches", f"{touches}", "a surface is met and not crossed" if touches else ""),
        ("certified", *_certified(truth, expected)),
    ]
    if not truth.certified and expected.transitions:
        names = sorted({f"`{run.solver}`" for run in runs if _confirms(run)})
        note = "its driver finds the same transitions" if len(names) == 1 else "their drivers find the same transitions"
        rows.append(("modes confirmed by", *((listing(names), note) if names else ("nothing independent", ""))))
    if expected.radius:
        radius = f"{exponential(expected.radius, 1)} s"
        rows.append(("largest radius of a transition time", radius, "no error is claimed below it"))
    if closed_forms := sum(event.closed_form for event in expected.transitions):
        rows.append(("closed forms of the case", f"{closed_forms}", "transition times that agree with them"))
    for method, bits, seconds in truth.methods:
        note = f"{listing([f'{b}' for b in bits])} bits, {significant(seconds, 2)} s" if bits else ""
        rows.append(("computed by", method, note))
    if expected.near_grazes:
        rows.append(("near touches", f"{len(expected.near_grazes)}", "instants at which a surface is nearly met"))
    return Table(headings, "lll", rows)


def _confirms(run: RunRow) -> bool:
    """Check whether a run of an independent library has exactly the transitions and modes of the truth.

    The truth shares the rule that selects its modes with ``henon``, and its library with ``heyoka``.
    """
    dependent = run.solver.startswith(("henon", "heyoka"))
    return run.status == "ok" and not run.missed and not run.spurious and not dependent


def no_truth(result: ReadingResult) -> str:
    """Return a sentence if no run is judged because there is no truth; otherwise an empty string."""
    if result.expected is not None and not result.expected.nothing_known:
        return ""
    reason = _reason(result)
    return "No run is judged: there is no truth" + (f" ({reason})." if reason else ".")


def _reason(result: ReadingResult) -> str:
    return markdown(result.truth.reason).rstrip(".")


def _end(expected: Expected) -> str:
    if expected.nothing_known:
        return "unknown after its start, no run is judged"
    return f"{expected.status}, to t = {significant(expected.end_time, 9)} s"


def _certified(truth: Truth, expected: Expected) -> tuple[str, str]:
    """Return whether the truth is proven, and an explanation."""
    number = len(expected.transitions)
    if truth.certified and not number:
        return "yes", "it is proven in ball arithmetic that there is no transition"
    if truth.certified:
        each = "the only transition" if number == 1 else f"every one of the {number}"
        return "yes", f"{each} is enclosed in ball arithmetic, and it is proven that there is no other"
    why = markdown(truth.uncertified_because).rstrip(".")
    return (f"{truth.proven} of {number}" if truth.proven else "no"), why


def published_table(records: Sequence[Record], result: ReadingResult) -> Table | None:
    """Make the table of printed stick durations, each with the exact last stick of its kind, and with agreeing runs."""
    reading, expected = result.reading, result.expected
    printed = reading.published.stick_durations if reading.published is not None else ()
    if not printed or expected is None:
        return None
    exact = _last_sticks(expected, printed, reading.measure_after)
    runs = [record for record in records if _has_printed_digits(record, printed)][:3]
    lines = []
    for value in printed:
        cells, note = ("", "", ""), ""
        if value in exact:
            holds = "yes" if printed_alike(exact[value], value) else "no"
            cells = significant(exact[value], 11), error(float(value) - exact[value]), holds
        else:
            note = _why_none(exact, expected, reading.measure_after)
        lines.append((f"{value}", *cells, "; ".join(_shown(record, value, printed) for record in runs), note))
    headings = ("printed [s]", "exact, last [s]", "printed − exact [s]", "digits hold", "runs that give them", "note")
    return Table(headings, "rrrlll", lines)


def printed_times_table(result: ReadingResult) -> Table | None:
    """Make the table of the printed times of transitions, each with the nearest exact transition."""
    reading, expected = result.reading, result.expected
    printed = reading.published.transition_times if reading.published is not None else ()
    if not printed or expected is None:
        return None
    names, lines = reading.problem.system.sign_names, []
    for value in printed:
        own = min(expected.transitions, key=lambda event: abs(event.time - float(value)), default=None)
        if own is None:
            lines.append((f"{value}", "none", "", "", ""))
            continue
        holds = "yes" if printed_alike(own.time, value) else "no"
        apart = float(value - Decimal(own.time)) - own.time_low
        what = f"{own.kind}, {code(names[own.surface])}"
        lines.append((f"{value}", what, significant(own.time, 17), error(apart), holds))
    headings = ("printed time [s]", "nearest transition", "exact [s]", "printed − exact [s]", "digits hold")
    return Table(headings, "rlrrl", lines)


def _last_sticks(expected: Expected, printed: Sequence[Decimal], after: float) -> dict[Decimal, float]:
    """Map each printed duration to an exact one [s]: the nearer one of the last two sticks of its kind."""
    exact = [stick.duration for stick in sticks(expected.transitions, start=expected.start, after=after)]
    partners = published_partners(exact, [float(value) for value in printed])
    found: dict[Decimal, float] = {}
    for partner, own in list(zip(partners, exact, strict=True))[-2 * len(printed) :]:
        value = _closest(partner or 0.0, printed)
        before = found.get(value, own)
        found[value] = own if abs(own - float(value)) <= abs(before - float(value)) else before
    return found


def _why_none(exact: dict[Decimal, float], expected: Expected, after: float) -> str:
    """Return the reason why a printed duration has no exact counterpart; a stick cut off by the horizon has no end."""
    if exact:
        return "no stick of this kind"
    ends_in_slip = bool(expected.transitions) and 0 not in expected.transitions[-1].to_mode
    return f"{'no stick' if ends_in_slip else 'no stick that ends'} after t = {max(after, expected.start):g} s"


def _closest(value: float, printed: Sequence[Decimal]) -> Decimal:
    return min(printed, key=lambda candidate: abs(float(candidate) - value))


def _compared(record: Record, printed: Sequence[Decimal]) -> list[tuple[Decimal, StickRow]]:
    """Return the sticks of a run that have a printed duration, each with the latter."""
    own = [row for row in record.sticks if row.duration_s is not None and row.published_s is not None]
    return [(_closest(number(row.published_s), printed), row) for row in own]


def _has_printed_digits(record: Record, printed: Sequence[Decimal]) -> bool:
    own = _compared(record, printed)
    return bool(own) and all(printed_alike(number(row.duration_s), value) for value, row in own)


def _shown(record: Record, value: Decimal, printed: Sequence[Decimal]) -> str:
    """Format a run with the durations [s] and lengths of its sticks of one kind."""
    own = [row for partner, row in _compared(record, printed) if partner == value]
    cells = [code(record.run.solver), record.run.setting]
    for label, known in (("duration", [row.duration_s for row in own]), ("length", [row.length for row in own])):
        values = dict.fromkeys(f"{value:.5f}" for value in known if value is not None)
        cells += [f"{label} {' / '.join(values)}"] if values else []
    return ", ".join(cells)


def orbit_table(result: ReadingResult) -> Table | None:
    """Make the table of the periodic orbit that a case gives, with the deviations of the exact run's last events."""
    orbit, expected = result.reading.orbit, result.expected
    if orbit is None or expected is None or not (orbit.sticks or orbit.crossings):
        return None
    found = [s.duration for s in sticks(expected.transitions, start=expected.start, after=result.reading.measure_after)]
    partners = published_partners(found, [float(value) for value in orbit.sticks])
    last = dict(zip(partners, found, strict=True))  # the last stick of each kind
    period = float(orbit.period)
    times = [event.time for event in expected.transitions if event.kind == "crossing"][-len(orbit.crossings) :]
    lines = [("period", significant(period, 11), "")]
    for value in orbit.sticks:
        own = last.get(float(value))
        lines.append(("stick", f"{value}", "none" if own is None else error(own - float(value))))
    for value in orbit.crossings:
        apart = min((math.remainder(time - float(value), period) for time in times), key=abs, default=None)
        lines.append(("crossing, modulo the period", f"{value}", "none" if apart is None else error(apart)))
    return Table(("periodic orbit", "value in the case [s]", "last of the exact run − this value [s]"), "lrr", lines)


def printed_alike(value: float, printed: Decimal) -> bool:
    """Check whether a value rounds to the digits of a printed number.

    >>> printed_alike(1.17463, Decimal("1.1746")), printed_alike(1.1743, Decimal("1.1746"))
    (True, False)
    """
    exponent = printed.as_tuple().exponent
    unit = Decimal(1).scaleb(exponent) if isinstance(exponent, int) else Decimal(1)
    return abs(Decimal(value) - printed) <= unit / 2
