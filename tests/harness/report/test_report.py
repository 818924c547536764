"""Text, tables and figures of reports agree with their rows, also in stored reports.

``snapshot.md`` and ``snapshot_of_many.md`` are whole reports; where their words are to be others,
``HENON_REF_SNAPSHOT=1 pytest tests/harness/report`` writes them anew.
"""

from __future__ import annotations

import json
import os
import re
import shutil
from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from fakes import CASE, case, expected, found, reference, trajectory, truth
from made_reports import ORIGIN, changed, compared, made, sweep, usual

from henon_ref.baselines.causes import CAUSES
from henon_ref.casefile.case import load_case
from henon_ref.casefile.expected import Orbit
from henon_ref.errors import CaseError
from henon_ref.figures.motion import motion_of
from henon_ref.harness.campaign.comparison import Comparison, ReadingResult
from henon_ref.harness.campaign.options import Options, Setting
from henon_ref.harness.campaign.rows import Outcome, record, scored
from henon_ref.harness.cli.stored import differences
from henon_ref.harness.report.case_report import report_text, write_report
from henon_ref.harness.report.gate import gate_table, why_unchecked
from henon_ref.harness.report.model import mode_equations, model_text
from henon_ref.harness.report.svg import figure_job
from henon_ref.harness.report.tables import price_table, run_table
from henon_ref.harness.result_files import csv_text, read_rows, rows_text
from henon_ref.harness.rows import RunRow
from henon_ref.harness.score.gate import Gate
from henon_ref.harness.score.ranking import LEVELS, cheapest
from henon_ref.modes.latex import latex, symbol
from henon_ref.trajectory import Samples
from henon_ref.workers.worker import Failure, WorkerState


@pytest.fixture
def comparison() -> Comparison:
    return usual()


def kept(name: str, text: str) -> str:
    """A whole report as it was; HENON_REF_SNAPSHOT=1 keeps the one that is made now."""
    file = Path(__file__).with_name(name)
    if os.environ.get("HENON_REF_SNAPSHOT"):
        file.write_text(text, encoding="utf-8")
    return file.read_text(encoding="utf-8")


def test_a_small_report_is_as_it_was():
    """With every table that a report of one reading may have, its figures, and a gate that is not met."""
    comparison = usual()
    result = comparison.readings[0]
    source = replace(result.reading.published, transition_times=(Decimal("0.5"), Decimal("1.4")))
    orbit = Orbit(sp.Integer(2), (Decimal("0.75"), Decimal("0.4")), (Decimal("1.5"),))
    result.reading = replace(result.reading, published=source, orbit=orbit, story="A story.\n\nOf *two* parts.")
    kinds = ("cost", "errors", "portrait", "modes")
    result.figures |= dict.fromkeys((f"default_{kind}.svg" for kind in kinds), b"<svg/>")
    comparison.records[0] = changed(comparison.records[0], status="wrong", verdict="ill-conditioned", missed=1)
    comparison.records[1] = changed(comparison.records[1], wall_s_iqr=1e-3)
    made = report_text(comparison, ORIGIN)
    assert made == kept("snapshot.md", made)


def test_a_report_of_many_readings_is_as_it_was():
    comparison = sweep(wrong=[("henon", "f3", 1e-6)], without_truth=("f2",))
    comparison.records[1] = changed(comparison.records[1], wall_s_iqr=1e-3)
    made = report_text(comparison, ORIGIN)
    assert made == kept("snapshot_of_many.md", made)


def test_prices_count_only_right_rows_and_never_a_faster_wrong_one(comparison):
    three, six, nine, twelve = (cheapest(comparison.run_rows, level) for level in LEVELS)
    assert [first.rtol for first, _ in (three, six, nine, twelve)] == [1e-6, 1e-6, 1e-12, 1e-12]
    assert {other.solver for _, other in (three, six, nine, twelve)} == {"heyoka"}
    assert (
        "| 12 | `henon` | 1e-12 | 0.3 ms | `heyoka` | 1e-12 | 0.9 ms | 3 |"
        in price_table(comparison.run_rows, {}).markdown
    )


def test_an_error_below_the_radius_is_not_claimed():
    truth = expected(transitions=tuple(replace(e, radius=1e-9) for e in reference()))
    one = made("henon", 1e-12, 1e-4, truth=truth)
    assert one.run.digits == pytest.approx(9.0)
    assert "< 1e-9" in run_table([one]).markdown


def test_a_cause_is_a_link_only_beside_the_page_of_causes(tmp_path, comparison):
    comparison.records[4] = changed(comparison.records[4], cause="heyoka-gap")
    title = CAUSES["heyoka-gap"].title
    without = write_report(comparison, ORIGIN, tmp_path).read_text()
    assert f"| {title} |" in without
    assert "causes/README.md" not in without
    (tmp_path / "causes").mkdir()
    (tmp_path / "causes" / "README.md").write_text("# Causes")
    made = write_report(comparison, ORIGIN, tmp_path).read_text()
    assert f"[{title}](../causes/README.md#heyoka-gap)" in made
    assert "[runs.csv](runs.csv)" in without


@pytest.mark.parametrize(
    ("samples", "words"),
    [
        ((73e-6, 22e-6), "| 47.5 µs (2 runs) † |"),
        ((73e-6, 72e-6), "| 72.5 µs (2 runs) |"),
        ((1.5,), "| 1.5 s (1 run) |"),
        ((1.0, 1.0, 1.5), "| 1 s (250 ms) † |"),
        ((1.0, 1.0, 1.1), "| 1 s (50 ms) |"),
    ],
)
def test_a_time_says_how_far_its_samples_scatter_or_how_few_they_are(samples, words):
    outcome = Outcome("made_up", case().readings[0], "henon", Setting(rtol=1e-6, atol=1e-6), samples=samples)
    outcome = replace(outcome, trajectory=trajectory(found(error=1e-7)))
    outcome = scored(outcome, expected())
    assert words in run_table([record(outcome, expected())]).markdown


GATES = """
gate:
  henon: {{max_time_error: 1e-5, max_stick_error: 1e-5, status: ok}}
  heyoka: {{}}
"""


@pytest.mark.parametrize(
    ("solvers", "state", "checked", "left_out"),
    [
        (("henon", "heyoka"), "met", "4 of 4", ""),
        (("heyoka",), "met", "1 of 4", "`henon`"),
        (("scipy-sign",), "not checked", "0 of 4", "`henon`, `heyoka`"),
    ],
)
def test_the_gate_counts_the_bounds_that_were_checked(solvers, state, checked, left_out):
    gated = case(text=re.sub("gate: .*", GATES, CASE))
    result = ReadingResult(gated.readings[0], truth())
    records = [made(solver, 1e-6, 1e-4) for solver in solvers]
    table = gate_table(Comparison(gated, [result], records, Options(solvers=solvers)).gate)
    assert list(table.rows) == [(state, checked, "", left_out)]


def test_a_gate_of_one_bound_that_was_not_checked_says_why():
    assert why_unchecked(Gate(1, 0)) == "the only bound is for solvers that were not run"


def test_the_stick_of_static_friction_says_when_it_is_entered():
    static = load_case(Path(__file__).parents[3] / "cases" / "static_belt.yaml").readings[0].problem.system
    assert any(note.startswith("entered whenever") for note in mode_equations(static, (0,))[2])
    assert not any(note.startswith("entered") for note in mode_equations(static, (1,))[2])
    plain = compared().readings[0].reading.problem.system
    assert not any(note.startswith("entered") for note in mode_equations(plain, (0,))[2])


def test_a_section_is_named_and_has_no_stick():
    text = CASE.replace("cos(t) - F*s", "cos(t) - F")
    model = model_text(ReadingResult(case(text=text).readings[0], truth()))
    assert "- `s`: a section; no force depends on its sign, and it is always crossed" in model
    assert "Slip, `s=+1`:" in model
    assert "Stick" not in model
    notes = mode_equations(case(text=text).readings[0].problem.system, (0,))[2]
    assert notes == ["the field does not depend on the sign of a surface it should slide on: s"]


def test_formulas_keep_the_names_a_reader_expects():
    x2, vp = sp.symbols("x2 vp", real=True)
    assert latex(x2 - vp) == "x_{2} - v_{p}"
    assert [symbol(n) for n in ("mu0", "a_b", "_x")] == [r"\mu_{0}", r"a_{\mathrm{b}}", r"\mathrm{\_x}"]


@pytest.mark.parametrize("name", ["a_b_c_d", "mu_1_2", "mu0_a", "a__b", "x_", "_x", "Alpha", "PI", "Omega_s", "kc"])
def test_every_name_is_a_formula_that_can_be_set(name):
    from matplotlib.mathtext import MathTextParser

    parser = MathTextParser("path")
    for formula in (symbol(name), latex(sp.Symbol(name) ** 2 - 1)):
        assert parser.parse(f"${formula}$").glyphs


def test_names_apart_stay_apart():
    names = ["a_b_c", "a_bc", "ab_c", "a_b__c", "a_b_c_", "abc", "a1_2", "a_1_2", "mu1_2", "mu_1_2"]
    assert len({symbol(name) for name in names}) == len(names)


def test_csv_reads_back_the_same():
    text = csv_text(("a", "b", "c", "d"), [(0.1 + 0.2, None, "x,y", 3)])
    assert text == 'a,b,c,d\n0.30000000000000004,,"x,y",3\n'


def figures(comparison: Comparison, **changes: object) -> dict[str, bytes]:
    times = np.linspace(1.0, 5.0, 81)
    samples = Samples(times, np.sin(times)[:, None], None)
    given = {"result": replace(comparison.readings[0], samples=samples), "records": comparison.records}
    job = figure_job(**given | changes)
    return job.function(WorkerState(lambda kind, value: None), *job.arguments)


def test_figures_are_the_same_bytes_for_the_same_data(comparison):
    first, second = figures(comparison), figures(comparison)
    assert set(first) == {"default_modes.svg", "default_errors.svg", "default_cost.svg"}
    assert first == second
    assert all(b"dc:date" not in content for content in first.values())
    assert all(b'<svg role="img"' in content and b"<desc id=" in content for content in first.values())


def test_only_the_cost_figure_changes_where_nothing_but_timings_did(comparison):
    slower = [changed(own, wall_s=3.0, compile_s=4.0) for own in comparison.records if own.samples]
    cut_off = [changed(own, rtol=1e-13, status="timeout") for own in comparison.records[:2]]
    quick = figures(comparison, records=tuple(own for own in comparison.records if own.samples))
    slow = figures(comparison, records=(*slower, *cut_off))
    assert {name for name in quick if quick[name] != slow[name]} == {"default_cost.svg"}


def test_figures_stand_any_lack_of_data(comparison):
    result = comparison.readings[0]
    times = np.array([1.0, 2.0])
    samples = Samples(times, np.ones((2, 1)), None)
    without_truth = replace(result, truth=Failure("failed", "none"), samples=samples)
    assert figures(comparison, result=without_truth) == {}
    assert figures(comparison, result=replace(result, samples=None), records=[]) == {}
    nothing = Samples(times, np.full((2, 1), np.nan), None)
    assert "default_modes.svg" not in figures(comparison, result=replace(result, samples=nothing))
    one = (made("henon", 1e-12, 1e-4),)
    assert set(figures(comparison, records=one)) == {"default_modes.svg", "default_errors.svg"}
    failed = (made("ida", 1e-6, 0.0, what="unavailable"),)
    assert set(figures(comparison, records=failed)) == {"default_modes.svg"}


def test_motion_has_a_corner_at_every_transition():
    samples = Samples(np.linspace(1.0, 3.0, 5), np.zeros((5, 1)), None)
    motion = motion_of(samples, reference())
    assert motion.times.tolist() == [1.0, 1.25, 1.5, 2.0, 2.0, 2.5, 3.0]
    assert motion.modes == ((0,), (-1,), (-1,), (1,), (1,), (1,), (1,))


@pytest.fixture
def stored(tmp_path, comparison):
    """A folder with one stored report, and one that has just been made."""
    write_report(comparison, ORIGIN, tmp_path / "reports")
    shutil.copytree(tmp_path / "reports", tmp_path / "fresh")
    return tmp_path / "reports" / "made_up", tmp_path / "fresh" / "made_up"


def rewrite(folder, change) -> None:
    rows = change(read_rows(RunRow, folder / "runs.csv"))
    (folder / "runs.csv").write_text(rows_text(RunRow, rows))


def first(**values: object):
    """Other values for the first row."""
    return lambda rows: [replace(rows[0], **values), *rows[1:]]


def also(**values: object):
    """One more row, as the first one but for these values."""
    return lambda rows: [*rows, replace(rows[0], **values)]


def test_a_report_that_still_holds(stored):
    old, fresh = stored
    rewrite(fresh, lambda rows: [replace(row, wall_s=9.0, wall_s_iqr=1.0, compile_s=7.0) for row in rows])
    rewrite(fresh, first(max_time_error_s=2e-6))
    assert differences(old, fresh) == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"max_time_error_s": 2e-4}, "max_time_error_s was 9.90e-07, is 2.00e-04"),
        ({"max_time_error_s": None}, "max_time_error_s was"),
        ({"status": "wrong", "verdict": "solver defect"}, "was ok (right), is wrong (solver defect)"),
        ({"matched": 4}, "matched was 5, is 4"),
        ({"solver": "new"}, "is not stored"),
    ],
)
def test_a_report_that_no_longer_holds(stored, change, words):
    old, fresh = stored
    rewrite(fresh, first(**change))
    assert any(words in line for line in differences(old, fresh))


def test_a_timeout_is_the_machine_s_doing(stored):
    old, fresh = stored
    rewrite(fresh, first(status="timeout", verdict="solver defect", matched=2))
    assert differences(old, fresh) == []


def test_rows_of_a_peer_are_checked_where_it_was_run(stored):
    old, fresh = stored
    rewrite(old, also(solver="nosnoc"))
    assert differences(old, fresh) == []
    rewrite(fresh, also(solver="nosnoc", matched=4))
    assert len(differences(old, fresh)) == 1
    rewrite(old, also(solver="scipy-radau"))
    assert len(differences(old, fresh)) == 2


def test_texts_and_files_are_checked_too(stored):
    old, fresh = stored
    report = fresh / "report.md"
    report.write_text(report.read_text().replace("| certified | yes |", "| certified | no |"))
    listed = json.loads((old / "manifest.json").read_text())["files"]
    (old / "sticks.csv").unlink()
    assert "sticks.csv" in listed
    assert differences(old, fresh) == ["Truth: the text differs", "the file sticks.csv is missing"]
    shutil.rmtree(old)
    assert differences(old, fresh) == [f"there is no report in {old}"]


@pytest.mark.parametrize(
    ("name", "damaged"), [("runs.csv", "[1]"), ("manifest.json", "[1]"), ("manifest.json", None), ("report.md", None)]
)
def test_a_damaged_report_is_an_error_of_that_file(stored, name, damaged):
    old, fresh = stored
    (old / name).unlink() if damaged is None else (old / name).write_text(damaged)
    with pytest.raises(CaseError, match=name):
        differences(old, fresh)


def test_a_report_that_is_no_text_differs(stored):
    old, fresh = stored
    (old / "report.md").write_bytes(b"\xff")
    assert "Truth: the text differs" in differences(old, fresh)


def test_a_manifest_without_a_list_of_files_is_a_difference(stored):
    old, fresh = stored
    (old / "manifest.json").write_text('{"title": "of another version"}')
    assert differences(old, fresh) == ["manifest.json has no list of files"]
