"""A report of many readings begins with all of them at once."""

from __future__ import annotations

from dataclasses import replace

import pytest
from fakes import CASE, case, expected, statement
from made_reports import ORIGIN, cells, changed, made, tables

from henon_ref.harness.campaign.comparison import Comparison
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.campaign.results import ReadingResult
from henon_ref.harness.report.case_report import report_files
from henon_ref.harness.report.figure_jobs import READINGS
from henon_ref.harness.report.folder import REPORT
from henon_ref.harness.report.text import readings_figure
from henon_ref.harness.report.text.markdown import report_text
from henon_ref.harness.report.text.overview import MANY, judged
from henon_ref.harness.report.text.ranking import over_all
from henon_ref.harness.report.text.readings_figure import draw_readings
from henon_ref.harness.table import duration

VALUES = (1, 2, 3, 4)
ALL = range(1, 8)
SWEEP = CASE + "readings:\n" + "".join(f"  f{v}: {{{{system: {{{{parameters: {{{{F: {v}}}}}}}}}}}}}\n" for v in ALL)


def sweep(wrong=(), readings=VALUES, without_truth=(), settings=(1e-6, 1e-9)) -> Comparison:
    """A made-up sweep: ``wrong`` are the runs (solver, reading, rtol) that miss a transition."""
    swept = case(text=SWEEP)
    chosen = [r for r in swept.readings if r.name in {f"f{v}" for v in readings}]
    results = [
        ReadingResult(r, replace(statement(None, None), expected=None, reason="none")
                      if r.name in without_truth else statement(None, None))
        for r in chosen
    ]  # fmt: skip
    records = [
        made(
            solver,
            rtol,
            wall / rtol**0.1,
            what="misses" if (solver, r.name, rtol) in wrong else "right",
            truth=replace(expected(), start=0.0),
            reading=r,
        )
        for r in chosen
        for solver, wall in (("henon", 1e-5), ("heyoka", 4e-5))
        for rtol in settings
    ]
    return Comparison(swept, results, records, Options())


def test_many_readings_get_a_figure_where_figures_are_wanted(tmp_path):
    comparison = sweep(wrong=[("heyoka", "f2", 1e-9)], readings=ALL)
    assert READINGS not in report_files(comparison, ORIGIN)
    comparison.readings[0].figures["f1_cost.svg"] = b"<svg/>"
    files = report_files(comparison, ORIGIN)
    assert files[READINGS].startswith(b"<?xml")
    assert f"({READINGS})".encode() in files[REPORT]
    figure = draw_readings(judged(comparison))
    (axes,) = figure.axes
    assert [label.get_text() for label in axes.get_yticklabels()] == ["heyoka", "henon"]
    assert [text.get_text() for text in axes.texts] == ["9", "6", *["9"] * 12]
    assert [label.get_text() for label in figure.legends[0].get_texts()] == ["(corner) not right at another setting"]


def test_where_cells_are_too_small_for_digits_shades_stand_for_them(monkeypatch):
    monkeypatch.setattr(readings_figure, "MOST_TEXTS", 3)
    figure = draw_readings(judged(sweep()))
    assert not figure.axes[0].texts
    words = [label.get_text() for label in figure.legends[0].get_texts()]
    assert words == ["3 digits", "6 digits", "9 digits", "12 digits"]


def first(comparison: Comparison) -> dict[str, dict[str, str]]:
    """The table that a report begins with."""
    return cells(tables(report_text(comparison, ORIGIN))[0])


RIGHT = "right"


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


def test_a_time_of_all_readings_that_scatters_is_marked():
    comparison = sweep()
    assert "†" not in report_text(comparison, ORIGIN).partition("### Every run")[0]
    shaken = comparison.of_reading("f1")[0].run
    put(comparison, "f1", 0, wall_s_iqr=4 * shaken.wall_s)
    head = report_text(comparison, ORIGIN).partition("## All readings")[0]
    assert f"| {duration(4 * shaken.wall_s)} † |" in head
    assert "†: the ranges of all readings' samples add up to more than a tenth of it." in head


def test_a_setting_that_is_wrong_in_one_reading_is_not_right_in_all():
    comparison = sweep(wrong=[("henon", "f3", 1e-6)])
    table = first(comparison)
    assert list(table["`henon`"].values()) == ["`henon`", "9", "0.318 ms", "1", "1e-9", "4 of 4", ""]
    also = "in as many at 1e-6"
    assert list(table["`heyoka`"].values()) == ["`heyoka`", "9", "1.27 ms", "4", "1e-9", "4 of 4", also]
    whole = tables(report_text(comparison, ORIGIN))
    prices = next(own for own in whole if own.headings[:2] == ("digits", "cheapest"))
    digits = next(own for own in whole if own.headings[0] == "reading")
    assert prices.rows[0] == ("3", "`henon`", "1e-9", "0.318 ms", "`heyoka`", "1e-6", "0.637 ms", "2")
    assert prices.rows[3][:2] == ("12", "none")
    assert cells(digits)["[f3](#f3)"]["`henon`"] == "9 *"
    assert cells(digits)["[f4](#f4)"]["`henon`"] == "9"


def test_where_no_setting_is_right_in_all_readings_the_best_ones_are_shown():
    wrong = [(solver, f"f{v}", rtol) for solver in ("henon", "heyoka") for v in (1, 2) for rtol in (1e-6, 1e-9)]
    comparison = sweep(wrong=wrong[1:])
    table = first(comparison)
    assert list(table["`henon`"].values()) == ["`henon`", "6", "", "", "1e-6", "3 of 4", ""]
    assert list(table["`heyoka`"].values())[1:] == ["9", "", "", "1e-9", "2 of 4", "in as many at 1e-6"]
    assert all("cheapest" not in own.headings for own in tables(report_text(comparison, ORIGIN))[:2])
    none = first(sweep(wrong=[(s, f"f{v}", r) for s in ("henon", "heyoka") for v in VALUES for r in (1e-6, 1e-9)]))
    assert list(none["`henon`"].values())[1:] == ["", "", "", "", "0 of 4", ""]


def test_readings_without_a_truth_are_counted_and_left_out():
    comparison = sweep(without_truth=("f2",))
    assert first(comparison)["`henon`"][RIGHT] == "3 of 3"
    text = report_text(comparison, ORIGIN)
    assert "in how many of 3 readings, 1 more without a truth, at one and the same setting" in text
    assert "[f2](#f2)" not in text
    assert "No run is judged: there is no truth (none)." in text.partition("## f2\n")[2].partition("## f3\n")[0]


def test_of_many_readings_each_has_its_tables_in_its_own_section():
    head, section = report_text(sweep(), ORIGIN).split("## f1\n\n")
    assert "printed [s]" not in [own.headings[0] for own in tables(head)]
    assert [own.headings[0] for own in tables(section)[:2]] == ["solver", "printed [s]"]


def test_of_few_readings_the_tables_stand_at_the_top():
    assert MANY == 4
    head = report_text(sweep(readings=VALUES[:3]), ORIGIN).split("## f1\n")[0]
    assert [own.headings[0] for own in tables(head)] == ["solver"] * 3
    assert head.count("its time set against the shortest one in the table") == 1
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


def test_every_end_of_a_run_has_its_colour_in_the_figure_and_its_legend():
    comparison = sweep(settings=(1e-6,), readings=ALL[:5])
    heyoka = [k for k, record in enumerate(comparison.records) if record.run.solver == "heyoka"]
    ends = (("timeout", "not judged"), ("wrong", "ill-conditioned"), ("wrong", "solver defect"), ("ok", "not judged"))
    for k, (status, verdict) in zip(heyoka, ends, strict=False):
        comparison.records[k] = changed(comparison.records[k], status=status, verdict=verdict, digits=None)
    comparison.records[heyoka[4]] = changed(comparison.records[heyoka[4]], status="unsupported")
    figure = draw_readings(judged(comparison))
    colours = [patch.get_facecolor() for patch in figure.axes[0].patches if patch.get_y() == 0]
    assert len(set(colours)) == 4
    (drawn,) = figure.legends
    named = zip(drawn.get_texts(), drawn.get_patches(), strict=True)
    legend = {text.get_text(): patch.get_facecolor() for text, patch in named}
    words = ["out of time", "ill-conditioned or not unique", "right at no setting", "not judged"]
    assert [legend[word] for word in words] == colours
    assert set(legend) == {*words, "cannot do it, or not run"}


def test_a_run_that_is_not_judged_has_no_ok_of_one_that_is_right():
    comparison = sweep(settings=(1e-6,))
    values = ({}, {"verdict": "not judged"}, {"verdict": "not judged", "status": "timeout"})
    for k, own in enumerate(values):
        comparison.records[k] = changed(comparison.records[k], digits=None, **own)
    table = tables(report_text(comparison, ORIGIN).partition("## All readings")[2])[0]
    assert [row[2:] for row in table.rows[:2]] == [("ok", "not judged"), ("timeout", "6")]
