"""Tables of a report agree with its rows: of one reading, of all readings, and of printed numbers."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import pytest
from fakes import TIMES, Reference, case, expected, found, reference, trajectory
from made_reports import ORIGIN, SWEEP, VALUES, cells, changed, compared, made, sweep, tables, usual

from henon_ref.casefile.case import load_case
from henon_ref.harness.campaign.comparison import Comparison, ReadingResult
from henon_ref.harness.campaign.options import Setting
from henon_ref.harness.campaign.rows import Outcome, record, scored
from henon_ref.harness.report.case_report import MANY_READINGS, report_text
from henon_ref.harness.report.tables import price_table, solver_table, stick_table
from henon_ref.harness.report.truth import no_truth, printed_times_table, published_table, truth_table
from henon_ref.harness.rows import RunRow
from henon_ref.harness.score.ranking import over_all
from henon_ref.trajectory import Transition
from henon_ref.workers.worker import Failure

RIGHT = "right"
CASES = Path(__file__).parents[3] / "cases"


def solvers(comparison: Comparison) -> dict[str, dict[str, str]]:
    return cells(solver_table(comparison.records))


def truth(comparison: Comparison) -> dict[str, tuple[str, ...]]:
    """Value and note of each line of the table on the truth."""
    return {row[0]: row[1:] for row in truth_table(comparison.readings[0]).rows}


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
    assert (row[RIGHT], row["digits"], row["time"], row["times as long"]) == ("1 of 1", "12", "", "")
    assert row["note"].startswith("no time: ")
    assert "failed: it died" in row["note"]


def test_a_single_solver_is_not_ranked():
    alone = compared(made("henon", 1e-6, 1e-4), made("henon", 1e-9, 1e-4), made("ida", 1e-6, 0.0, what="unavailable"))
    assert solvers(alone)["`henon`"]["times as long"] == ""
    assert price_table(alone.run_rows, {}) is None
    assert price_table(usual().run_rows, {}) is not None


def test_without_a_truth_nothing_is_scored():
    whole = compared(made("henon", 1e-6, 1e-4))
    whole.readings[0] = replace(whole.readings[0], truth=Failure("failed", "the routes disagree"))
    assert truth(whole) == {"exact run": ("none, nothing is scored", "the routes disagree")}
    assert no_truth(whole.readings[0]) == "No run is judged: there is no truth (the routes disagree)."
    assert no_truth(usual().readings[0]) == ""


@pytest.mark.parametrize(
    ("changes", "end", "note"),
    [
        ({}, "ok, to t = 5 s", ""),
        ({"partial": True, "end_time": 0.5}, "ok, to t = 0.5 s", "the truth ends there"),
        ({"partial": True, "end_time": 0.0}, "unknown after its start, no run is judged", "the truth ends there"),
    ],
)
def test_the_exact_run_has_a_row(changes, end, note):
    found = truth(compared(exact=replace(expected(), transitions=(), **changes)))
    assert found["exact run"] == (end, note)
    assert (found["transitions"], found["touches"]) == (("0", ""), ("0", ""))
    assert found["certified"] == ("yes", "it is proven in ball arithmetic that there is no transition")


def test_what_is_proven_of_a_truth_and_why_the_rest_is_not():
    def partly(proven: int) -> dict[str, tuple[str, ...]]:
        exact = expected(transitions=[replace(event, proven=k < proven) for k, event in enumerate(reference())])
        return truth(compared(exact=exact, certified=False, uncertified_because="a graze, at t = 1."))

    assert partly(proven=2)["certified"] == ("2 of 5", "a graze, at t = 1")
    assert partly(proven=0)["certified"] == ("no", "a graze, at t = 1")
    assert partly(proven=2)["modes confirmed by"] == ("nothing independent", "")
    closed = [replace(event, closed_form=k < 3) for k, event in enumerate(reference())]
    other = truth(compared(exact=expected(transitions=closed, near_grazes=["one", "another"])))
    assert (other["closed forms of the case"][0], other["near touches"][0]) == ("3", "2")


def test_a_truth_without_a_proof_names_the_libraries_that_find_its_modes():
    """Not the reference, nor the library of the truth itself."""
    result = compared(certified=False, uncertified_because="a graze").readings[0]
    runs = [RunRow("a", "b", solver, status="ok", missed=0, spurious=0) for solver in ("henon", "heyoka", "ida")]
    row = {row[0]: row[1:] for row in truth_table(result, runs).rows}["modes confirmed by"]
    assert row == ("`ida`", "its driver finds the same transitions")
    wrong = RunRow("a", "b", "ida", status="ok", missed=1, spurious=0)
    assert ("modes confirmed by", "nothing independent", "") in truth_table(result, [wrong]).rows


def test_an_exact_run_that_ends_early_says_why():
    ended = expected(TIMES[:3], status="nonunique", end_time=2.7)
    outcome = Outcome("made_up", case().readings[0], "henon", Setting(rtol=1e-6, atol=1e-6))
    outcome = replace(outcome, trajectory=trajectory(found(TIMES[:3]), "nonunique", end_time=2.7))
    whole = compared(record(scored(outcome, ended), ended), exact=ended, reason="both sides repel")
    assert truth(whole)["exact run"] == ("nonunique, to t = 2.7 s", "both sides repel")
    assert truth(whole)["transitions"] == ("3", "")
    assert solvers(whole)["`henon`"][RIGHT] == "1 of 1"


def test_a_solver_that_reports_no_touch_is_right_with_a_note():
    touched = replace(expected(), transitions=(Reference("graze", 0, (1,), (1,), 1.0),))
    seen = (Transition("graze", 0, (1,), (1,), 1.0, (0.25,)),)
    records = []
    for solver, transitions in (("henon", seen), ("scipy-rk45", ())):
        outcome = Outcome("made_up", case().readings[0], solver, Setting(rtol=1e-6, atol=1e-6))
        outcome = scored(replace(outcome, trajectory=trajectory(transitions)), touched)
        records.append(record(outcome, touched))
    whole = compared(*records, exact=touched)
    assert (truth(whole)["transitions"][0], truth(whole)["touches"][0]) == ("0", "1")
    notes = {solver: (row[RIGHT], row["note"].partition(";")[0]) for solver, row in solvers(whole).items()}
    assert notes["`scipy-rk45`"] == ("1 of 1", "touches missed: 1")
    assert "touches" not in notes["`henon`"][1]


@pytest.mark.parametrize(
    ("file", "heading"), [("static_belt", "length in `x1` [m]"), ("rig_periodic", "length in `x1`")]
)
def test_a_length_has_a_unit_where_the_first_state_is_a_position_in_a_scene(file, heading):
    reading = load_case(CASES / f"{file}.yaml").readings[0]
    comparison = usual()
    table = stick_table(
        comparison.records, replace(comparison.readings[0], reading=replace(reading, measure_after=0.0))
    )
    assert table is not None
    assert table.headings[-1] == heading


def published(comparison: Comparison, *printed: str, measure_after: float = 1.0) -> dict[str, dict[str, str]]:
    """The table of printed durations of a comparison whose source prints these."""
    reading = comparison.readings[0].reading
    own = replace(reading.published, stick_durations=decimals(*printed))
    reading = replace(reading, published=own, measure_after=measure_after)
    return cells(published_table(comparison.records, replace(comparison.readings[0], reading=reading)))


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
    whole = compared(made("henon", 1e-6, 1e-4, truth=truth), exact=truth)
    row = published(whole, "0.75", measure_after=4.5)["0.75"]
    assert row["note"] == ("no stick after t = 4.5 s" if ends_in_slip else "no stick that ends after t = 4.5 s")
    assert row["digits hold"] == ""


def test_a_run_without_transitions_has_none_beside_a_printed_time():
    result: ReadingResult = compared(exact=expected(())).readings[0]
    own = replace(result.reading.published, transition_times=decimals("1.00"))
    found = printed_times_table(replace(result, reading=replace(result.reading, published=own)))
    assert found is not None
    assert found.rows == [("1.00", "none", "", "", "")]


def first(comparison: Comparison) -> dict[str, dict[str, str]]:
    """The table that a report begins with."""
    return cells(tables(report_text(comparison, ORIGIN))[0])


def test_one_setting_for_all_readings_costs_the_sum_of_their_times():
    comparison = sweep()
    whole = over_all([[r.run for r in comparison.of_reading(f"f{v}")] for v in VALUES])
    assert [(row.solver, row.rtol, row.verdict, row.right_in) for row in whole] == [
        ("henon", 1e-6, "right", 4), ("henon", 1e-9, "right", 4),
        ("heyoka", 1e-6, "right", 4), ("heyoka", 1e-9, "right", 4),
    ]  # fmt: skip
    one = comparison.of_reading("f1")[1].run
    assert whole[1].wall_s == pytest.approx(4 * one.wall_s)
    assert whole[1].digits == one.digits


def test_where_no_setting_is_right_in_all_readings_the_best_ones_are_shown():
    wrong = [(solver, f"f{v}", rtol) for solver in ("henon", "heyoka") for v in (1, 2) for rtol in (1e-6, 1e-9)]
    comparison = sweep(wrong=wrong[1:])
    table = first(comparison)
    assert list(table["`henon`"].values()) == ["`henon`", "6", "", "", "1e-6", "3 of 4", ""]
    assert list(table["`heyoka`"].values())[1:] == ["9", "", "", "1e-9", "2 of 4", "in as many at 1e-6"]
    assert all("cheapest" not in own.headings for own in tables(report_text(comparison, ORIGIN))[:2])
    none = first(sweep(wrong=[(s, f"f{v}", r) for s in ("henon", "heyoka") for v in VALUES for r in (1e-6, 1e-9)]))
    assert list(none["`henon`"].values())[1:] == ["", "", "", "", "0 of 4", ""]


def test_of_few_readings_the_tables_stand_at_the_top():
    assert MANY_READINGS == 4
    head = report_text(sweep(readings=VALUES[:3]), ORIGIN).split("## f1\n")[0]
    assert [own.headings[0] for own in tables(head)] == ["solver"] * 3
    assert head.count("Most accurate right run of each solver") == 1
    assert "[f2](#f2)" in head
    assert "## All readings" not in head


def test_a_model_and_a_story_are_told_once():
    text = report_text(sweep(), ORIGIN)
    assert text.count("\\begin{aligned}") == report_text(sweep(readings=(1,)), ORIGIN).count("\\begin{aligned}")
    assert text.count("The equations are those of [f1](#f1).") == len(VALUES) - 1
    assert all(f"$F = {value}$" in text for value in VALUES)
    told = replace(case(text=SWEEP).readings[0], story="A story.")
    comparison = sweep()
    for result in comparison.readings:
        result.reading = replace(result.reading, story=told.story)
    assert report_text(comparison, ORIGIN).count("A story.") == 1


def put(comparison: Comparison, reading: str, number: int, **values: object) -> None:
    """Other values for a run of a reading."""
    own = comparison.of_reading(reading)[number]
    comparison.records[comparison.records.index(own)] = changed(own, **values)


def test_of_settings_that_are_as_good_the_cheapest_is_shown():
    comparison = sweep(settings=(1e-9, 0.9e-9))
    for result in comparison.readings:
        put(comparison, result.reading.name, 1, wall_s=1e-9)
    row = first(comparison)["`henon`"]
    assert (row["setting"], row["note"]) == ("9e-10", "in as many at 1e-9")
    for result in comparison.readings:
        put(comparison, result.reading.name, 0, wall_s=1e-10)
    assert first(comparison)["`henon`"]["setting"] == "1e-9"


def test_a_run_that_is_not_judged_has_no_ok_of_one_that_is_right():
    comparison = sweep(settings=(1e-6,))
    values = ({}, {"verdict": "not judged"}, {"verdict": "not judged", "status": "timeout"})
    for k, own in enumerate(values):
        comparison.records[k] = changed(comparison.records[k], digits=None, **own)
    table = tables(report_text(comparison, ORIGIN).partition("## All readings")[2])[0]
    assert [row[2:] for row in table.rows[:2]] == [("ok", "not judged"), ("timeout", "6")]
