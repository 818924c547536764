"""A report of many readings begins with all of them at once."""

from __future__ import annotations

from dataclasses import replace

import pytest
from fakes import CASE, case, expected, statement
from made_reports import ORIGIN, made

from henon_ref.campaign.comparison import Comparison
from henon_ref.campaign.options import Options
from henon_ref.campaign.results import ReadingResult
from henon_ref.report.case_report import report_files
from henon_ref.report.files.figure_jobs import READINGS
from henon_ref.report.files.write import REPORT
from henon_ref.report.text import readings_figure
from henon_ref.report.text.formats import duration
from henon_ref.report.text.markdown import report_text
from henon_ref.report.text.overview import MANY, judged
from henon_ref.report.text.ranking import over_all
from henon_ref.report.text.readings_figure import draw_readings

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
    assert [label.get_text() for label in figure.legends[0].get_texts()] == ["(corner) wrong at another setting"]


def test_where_cells_are_too_small_for_digits_shades_stand_for_them(monkeypatch):
    monkeypatch.setattr(readings_figure, "MOST_TEXTS", 3)
    figure = draw_readings(judged(sweep()))
    assert not figure.axes[0].texts
    words = [label.get_text() for label in figure.legends[0].get_texts()]
    assert words == ["3 digits", "6 digits", "9 digits", "12 digits"]


def table(text: str) -> list[str]:
    return [line for line in text.splitlines() if line.startswith("|")]


def test_one_setting_for_all_readings_costs_the_sum_of_their_times():
    comparison = sweep()
    whole = over_all([[r.run for r in comparison.of_reading(f"f{v}")] for v in VALUES])
    assert [(row["solver"], row["rtol"], row["verdict"], row["right_in"]) for row in whole] == [
        ("henon", 1e-6, "right", 4), ("henon", 1e-9, "right", 4),
        ("heyoka", 1e-6, "right", 4), ("heyoka", 1e-9, "right", 4),
    ]  # fmt: skip
    one = comparison.of_reading("f1")[1].run
    assert whole[1]["wall_s"] == pytest.approx(4 * one["wall_s"])
    assert whole[1]["digits"] == one["digits"]


def test_a_time_of_all_readings_that_scatters_is_marked():
    comparison = sweep()
    assert "†" not in report_text(comparison, ORIGIN).partition("### Every run")[0]
    shaken = comparison.of_reading("f1")[0].run
    shaken["wall_s_iqr"] = 4 * shaken["wall_s"]
    head = report_text(comparison, ORIGIN).partition("## All readings")[0]
    assert f"| {duration(4 * shaken['wall_s'])} † |" in head
    assert "†: the ranges of all readings' samples add up to more than a tenth of it." in head


def test_a_setting_that_is_wrong_in_one_reading_is_no_answer_for_all():
    text = report_text(sweep(wrong=[("henon", "f3", 1e-6)]), ORIGIN)
    assert "4 readings. Right in every one of them at one and the same setting: `henon` (at 1e-9);" in text
    assert "; `heyoka` (at every setting)." in text
    rows = table(text.split("## All readings")[0])
    assert rows[2].startswith("| 3 | `henon` | 1e-9 | 0.318 ms | `heyoka` | 1e-6 | 0.637 ms | 2 |")
    assert rows[5].startswith("| 12 | none |")
    assert "| [f3](#f3) | 5 | 9 * | 9 |" in text
    assert "| [f4](#f4) | 5 | 9 | 9 |" in text


def test_where_no_setting_is_right_in_all_readings_the_report_says_which_comes_closest():
    wrong = [(solver, f"f{v}", rtol) for solver in ("henon", "heyoka") for v in (1, 2) for rtol in (1e-6, 1e-9)]
    text = report_text(sweep(wrong=wrong[1:]), ORIGIN)
    assert "No solver is right in all at one setting; most often `henon` at 1e-6, in 3." in text
    assert "reaches so many digits in every reading" not in text
    assert "No solver is right in any." in report_text(
        sweep(wrong=[(s, f"f{v}", r) for s in ("henon", "heyoka") for v in VALUES for r in (1e-6, 1e-9)]), ORIGIN
    )


def test_solvers_that_are_right_at_the_same_settings_are_named_together():
    text = report_text(sweep(), ORIGIN)
    assert "at one and the same setting: `henon` and `heyoka` (at every setting)." in text


def test_readings_without_a_truth_are_counted_and_left_out():
    text = report_text(sweep(without_truth=("f2",)), ORIGIN)
    assert "4 readings, 3 of them with a truth. Right in every one of them" in text
    assert "[f2](#f2)" not in text


def test_each_reading_tells_of_itself_in_its_own_section():
    text = report_text(sweep(), ORIGIN)
    top, section = text.split("## f2\n")[0], text.split("## f2\n")[1].split("## f3\n")[0]
    assert "solvers find all 5 transitions" not in top.split("## f1\n")[0]
    assert section.startswith("\nAll 2 solvers find all 5 transitions in order.")


def test_few_readings_are_told_of_at_the_top():
    assert MANY == 4
    text = report_text(sweep(readings=VALUES[:3]), ORIGIN)
    assert "**[f2](#f2)**. All 2 solvers find" in text.split("## f1\n")[0]
    assert "## All readings" not in text
