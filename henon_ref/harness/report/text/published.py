"""What a source prints beside the exact run: stick durations, times of transitions, and a periodic orbit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from decimal import Decimal

from henon_ref.casefile.expected import Orbit
from henon_ref.harness.campaign.comparison import Comparison
from henon_ref.harness.campaign.results import ReadingResult
from henon_ref.harness.campaign.rows import Record
from henon_ref.harness.report.text.formats import error, printed_alike, setting, significant
from henon_ref.harness.rows import StickRow, number
from henon_ref.harness.score.reference import Expected
from henon_ref.harness.score.sticks import published_partners
from henon_ref.harness.table import Table
from henon_ref.text import code
from henon_ref.trajectory import sticks

MOST_RUNS = 3
"""Runs that a table names of those with the printed digits."""


def published_table(comparison: Comparison, result: ReadingResult) -> Table | None:
    """A row a printed stick duration: the exact run's last stick of that kind, and the runs with the printed digits."""
    reading, expected = result.reading, result.expected
    if reading.published is None or not reading.published.stick_durations or expected is None:
        return None
    printed = reading.published.stick_durations
    exact = _last_sticks(expected, printed, reading.measure_after)
    runs = [record for record in comparison.of_reading(reading.name) if _has_printed_digits(record, printed)]
    lines = []
    for value in printed:
        own = exact.get(value)
        cells = (f"{value}", "", "", "", _why_none(exact, expected, reading.measure_after))
        if own is not None:
            holds = "yes" if printed_alike(own, value) else "no"
            cells = (f"{value}", significant(own, 11), error(float(value) - own), holds, "")
        lines.append((*cells[:4], "; ".join(_shown(record, value, printed) for record in runs[:MOST_RUNS]), cells[4]))
    headings = ("printed [s]", "exact, last [s]", "printed − exact [s]", "digits hold", "runs that give them", "note")
    return Table(headings, "rrrlll", lines)


def printed_times_table(result: ReadingResult) -> Table | None:
    """A row a printed time of a transition, beside the exact transition that is nearest to it."""
    reading, expected = result.reading, result.expected
    if reading.published is None or not reading.published.transition_times or expected is None:
        return None
    names = reading.problem.system.sign_names
    lines = []
    for value in reading.published.transition_times:
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
    """The exact duration [s] that belongs to each printed one: of the last two sticks of its kind the one nearer."""
    exact = [stick.duration for stick in sticks(expected.transitions, start=expected.start, after=after)]
    partners = published_partners(exact, [float(value) for value in printed])
    found: dict[Decimal, float] = {}
    for partner, own in list(zip(partners, exact, strict=True))[-2 * len(printed) :]:
        value = _closest(partner or 0.0, printed)
        before = found.get(value, own)
        found[value] = own if abs(own - float(value)) <= abs(before - float(value)) else before
    return found


def _why_none(exact: dict[Decimal, float], expected: Expected, after: float) -> str:
    """Why a printed duration has no counterpart; a stick that the horizon cuts off is one without an end."""
    if exact:
        return "no stick of this kind"
    ends_in_slip = bool(expected.transitions) and 0 not in expected.transitions[-1].to_mode
    return f"{'no stick' if ends_in_slip else 'no stick that ends'} after t = {max(after, expected.start):g} s"


def _closest(value: float, printed: Sequence[Decimal]) -> Decimal:
    return min(printed, key=lambda candidate: abs(float(candidate) - value))


def _compared(record: Record) -> list[StickRow]:
    """The sticks of a run that have a printed duration."""
    return [row for row in record.sticks if row.duration_s is not None and row.published_s is not None]


def _has_printed_digits(record: Record, printed: Sequence[Decimal]) -> bool:
    own = _compared(record)
    return bool(own) and all(
        printed_alike(number(row.duration_s), _closest(number(row.published_s), printed)) for row in own
    )


def _shown(record: Record, value: Decimal, printed: Sequence[Decimal]) -> str:
    """A run with its duration [s] and length of the sticks of one kind."""
    own = [row for row in _compared(record) if _closest(number(row.published_s), printed) == value]
    cells = [code(record.run.solver), setting(record.run.rtol, record.run.step_s)]
    for label, known in (("duration", [row.duration_s for row in own]), ("length", [row.length for row in own])):
        values = dict.fromkeys(f"{value:.5f}" for value in known if value is not None)
        cells += [f"{label} {' / '.join(values)}"] if values else []
    return ", ".join(cells)


def orbit_table(result: ReadingResult) -> Table | None:
    """The periodic orbit that a case names, and how far the exact run's last period is from it."""
    orbit, expected = result.reading.orbit, result.expected
    if orbit is None or expected is None or not (orbit.sticks or orbit.crossings):
        return None
    lines = [("period", significant(float(orbit.period), 11), "")]
    lines += _stick_rows(orbit, expected, result.reading.measure_after)
    lines += _crossing_rows(orbit, expected)
    return Table(("periodic orbit", "named [s]", "exact run, last − named [s]"), "lrr", lines)


def _stick_rows(orbit: Orbit, expected: Expected, after: float) -> list[tuple[str, str, str]]:
    """How far the last stick of each kind is from the orbit's."""
    found = [stick.duration for stick in sticks(expected.transitions, start=expected.start, after=after)]
    named = [float(value) for value in orbit.sticks]
    last = dict(zip(published_partners(found, named), found, strict=True))  # of each kind the last one
    return [
        ("stick", f"{value}", error(last[own] - own) if own in last else "none")
        for value, own in zip(orbit.sticks, named, strict=True)
    ]


def _crossing_rows(orbit: Orbit, expected: Expected) -> list[tuple[str, str, str]]:
    """How far the last crossings are from the orbit's, modulo the period."""
    period = float(orbit.period)
    times = [event.time for event in expected.transitions if event.kind == "crossing"]
    last = times[-len(orbit.crossings) :] if orbit.crossings else []
    return [
        (
            "crossing, modulo the period",
            f"{value}",
            error(min((math.remainder(time - float(value), period) for time in last), key=abs)) if last else "none",
        )
        for value in orbit.crossings
    ]
