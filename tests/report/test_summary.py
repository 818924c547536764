"""The tables that a report begins with hold what the rows hold."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal

import pytest
import sympy as sp
from fakes import TIMES, Reference, case, expected, found, trajectory
from made_reports import cells, compared, made, usual

from henon_ref.campaign.comparison import Comparison
from henon_ref.campaign.results import ReadingResult
from henon_ref.campaign.rows import Outcome, record, scored
from henon_ref.campaign.settings import Setting
from henon_ref.casefile.expected import Orbit
from henon_ref.report.text.published import orbit_table, published_table
from henon_ref.report.text.summary import exact_run_table, solver_table
from henon_ref.trajectory import Transition

RIGHT = "right (settings)"


def solvers(comparison: Comparison) -> dict[str, dict[str, str]]:
    return cells(solver_table(comparison, comparison.readings[0]))


def exact_run(comparison: Comparison) -> dict[str, str]:
    (row,) = cells(exact_run_table(comparison.readings[0])).values()
    return row


def test_a_row_a_solver_says_where_it_is_right_and_what_it_costs():
    table = solvers(usual())
    assert list(table) == ["`henon`", "`heyoka`", "`scipy-rk45`", "`scipy-sign`", "`ida`"]
    assert list(table["`henon`"].values()) == ["`henon`", "2 of 2", "12", "9.9e-13", "1e-12", "0.3 ms", "1", ""]
    assert table["`heyoka`"]["times the fastest"] == "3"
    assert (table["`scipy-rk45`"][RIGHT], table["`scipy-rk45`"]["note"]) == ("1 of 2", "1 missed, 0 spurious at 1e-6")
    assert list(table["`scipy-sign`"].values())[1:-1] == ["0 of 1", "", "", "", "", ""]
    assert (table["`ida`"][RIGHT], table["`ida`"]["note"]) == ("unavailable", "it is not installed")


def test_settings_out_of_time_are_noted_beside_wrong_ones():
    table = solvers(
        compared(
            made("scipy-bdf", 1e-6, 0.0, what="misses"),
            made("scipy-bdf", 1e-9, 0.0, what="untried"),
            made("scipy-bdf", 1e-12, 0.0, what="untried"),
            made("scipy-lsoda", 1e-6, 0.0, what="untried"),
        )
    )
    assert table["`scipy-bdf`"][RIGHT] == "0 of 3"
    assert table["`scipy-bdf`"]["note"] == "1 missed, 0 spurious at 1e-6; timeout at 1e-9, 1e-12"
    assert table["`scipy-lsoda`"]["note"] == "timeout at 1e-6"


def test_a_run_that_fails_when_it_is_repeated_is_right_without_a_time():
    whole = compared(made("henon", 1e-6, 1e-4), made("heyoka", 1e-12, 0.0, what="fails later"))
    row = solvers(whole)["`heyoka`"]
    assert (row[RIGHT], row["digits"], row["time"], row["times the fastest"]) == ("1 of 1", "12", "", "")
    assert row["note"].startswith("no time: ")
    assert "failed: it died" in row["note"]


def test_without_a_truth_nothing_is_scored():
    whole = compared(made("henon", 1e-6, 1e-4), expected=None, reason="the routes disagree")
    row = exact_run(whole)
    assert (row["exact run"], row["note"]) == ("no truth, nothing is scored", "the routes disagree")


@pytest.mark.parametrize(
    ("changes", "status", "known", "note"),
    [
        ({}, "ok", "5", ""),
        ({"partial": True, "end_time": 0.5}, "ok", "0.5", "the truth ends there"),
        ({"partial": True, "end_time": 0.0}, "unknown after its start, no run is judged", "0", "the truth ends there"),
    ],
)
def test_the_exact_run_has_a_row(changes, status, known, note):
    truth = replace(expected(), transitions=(), **changes)
    row = exact_run(compared(expected=truth))
    assert list(row.values()) == [status, "0", "0", known, note]


def test_an_exact_run_that_ends_early_says_why():
    truth = expected(TIMES[:3], status="nonunique", end_time=2.7)
    outcome = Outcome("made_up", case().readings[0], "henon", Setting(rtol=1e-6, atol=1e-6))
    outcome = replace(outcome, trajectory=trajectory(found(TIMES[:3]), "nonunique", end_time=2.7))
    whole = compared(record(scored(outcome, truth), truth), expected=truth, reason="both sides repel")
    assert list(exact_run(whole).values()) == ["nonunique", "3", "0", "2.7", "both sides repel"]
    assert solvers(whole)["`henon`"][RIGHT] == "1 of 1"


def test_a_solver_that_reports_no_touch_is_right_with_a_note():
    truth = replace(expected(), transitions=(Reference("graze", 0, (1,), (1,), 1.0),))
    seen = (Transition("graze", 0, (1,), (1,), 1.0, (0.25,)),)
    records = []
    for solver, transitions in (("henon", seen), ("scipy-rk45", ())):
        outcome = Outcome("made_up", case().readings[0], solver, Setting(rtol=1e-6, atol=1e-6))
        outcome = scored(replace(outcome, trajectory=trajectory(transitions)), truth)
        records.append(record(outcome, truth))
    whole = compared(*records, expected=truth)
    assert list(exact_run(whole).values())[1:3] == ["0", "1"]
    notes = {solver: (row[RIGHT], row["note"].partition(";")[0]) for solver, row in solvers(whole).items()}
    assert notes["`scipy-rk45`"] == ("1 of 1", "touches missed: 1")
    assert "touches" not in notes["`henon`"][1]


def published(comparison: Comparison, *printed: str, measure_after: float = 1.0) -> dict[str, dict[str, str]]:
    """The table of printed durations of a comparison whose source prints these."""
    reading = comparison.readings[0].reading
    own = replace(reading.published, stick_durations=decimals(*printed))
    reading = replace(reading, published=own, measure_after=measure_after)
    return cells(published_table(comparison, replace(comparison.readings[0], reading=reading)))


def decimals(*texts: str) -> tuple[Decimal, ...]:
    return tuple(Decimal(text) for text in texts)


def test_printed_durations_hold_or_not():
    source = replace(case().readings[0].published, stick_durations=decimals("0.75", "0.5"))
    whole = compared(made("henon", 1e-6, 1e-4, reading=replace(case().readings[0], published=source)))
    table = published(whole, "0.9", "0.5")
    assert (table["0.9"]["digits hold"], table["0.9"]["printed − exact [s]"]) == ("no", "1.5e-1")
    table = published(whole, "0.75", "0.5")
    assert (table["0.75"]["digits hold"], table["0.75"]["exact, last [s]"]) == ("yes", "0.75")
    assert table["0.75"]["runs that give them"].startswith("`henon`, 1e-6, duration 0.75000, length ")


@pytest.mark.parametrize(
    ("times", "ends_in_slip"), [(TIMES[:1], False), (TIMES[:4], False), ((), False), (TIMES[:3], True)]
)
def test_a_stick_that_the_horizon_cuts_off_is_not_denied(times, ends_in_slip):
    truth = expected(times)
    whole = compared(made("henon", 1e-6, 1e-4, truth=truth), expected=truth)
    row = published(whole, "0.75", measure_after=4.5)["0.75"]
    assert row["note"] == ("no stick after t = 4.5 s" if ends_in_slip else "no stick that ends after t = 4.5 s")
    assert row["digits hold"] == ""


def test_an_orbit_that_the_case_names_is_set_beside_the_last_period():
    result: ReadingResult = compared().readings[0]
    orbit = Orbit(sp.Integer(2), decimals("0.75", "0.4"), decimals("1.5"))
    table = orbit_table(replace(result, reading=replace(result.reading, orbit=orbit)))
    assert [row[:2] for row in table.rows] == [
        ("period", "2"), ("stick", "0.75"), ("stick", "0.4"), ("crossing, modulo the period", "1.5"),
    ]  # fmt: skip
    assert [row[2] for row in table.rows] == ["", "0", "1.0e-1", "5.0e-1"]
    assert orbit_table(result) is None
