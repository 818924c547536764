"""The price list: effects, long runs, landings, and tables made from rows."""

from __future__ import annotations

import csv
import io
import math
import os
import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import pytest

from henon_ref.baselines.henon import HENON_SOLVER
from henon_ref.casefile.case import load_case
from henon_ref.errors import CaseError
from henon_ref.harness.campaign import timing
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.campaign.progress import ProgressLine
from henon_ref.harness.campaign.timing import MAX_REPETITIONS, Turns, interleaved
from henon_ref.harness.report.manifest import provenance
from henon_ref.harness.report.model import mode_tape, operations
from henon_ref.harness.result_files import read_rows
from henon_ref.harness.rows import RunRow
from henon_ref.harness.studies.page import fitted, in_fresh_process, shipped_problem
from henon_ref.harness.studies.pairs import PairRow, TimedPair
from henon_ref.harness.studies.price import ladder
from henon_ref.harness.studies.price.accuracy import (
    STICKS,
    Horizon,
    Landed,
    crest_crossings,
    horizons,
    landing_table,
    landings,
)
from henon_ref.harness.studies.price.chains import ManyContacts, Size, contact_table, many_contacts, sizes
from henon_ref.harness.studies.price.ladder import (
    ALONE,
    WHEN_NAMED,
    Ready,
    mean_costs,
    readiness,
    ready_table,
    rival_table,
    samples_text,
    solvers,
    time_ladder_pairs,
    why_not,
)
from henon_ref.harness.studies.price.operations import BODIES, Body, Work, additions, count, work
from henon_ref.harness.studies.price.page import write_page
from henon_ref.jit.cache_folder import VARIABLE
from henon_ref.modes.problem import Problem

CASES = Path(__file__).parents[3] / "cases"


@pytest.mark.parametrize("body", BODIES, ids=lambda body: body.name)
def test_effects_that_are_named_cost_operations_even_at_zero(body: Body) -> None:
    *added, _ = additions(body)
    every = operations(mode_tape(added[-1][1].system))
    for _, own, carried in added:
        assert operations(mode_tape(own.system)) <= operations(mode_tape(carried.system)) == every


def test_runs_of_added_effects_have_no_transition_and_those_that_stick_have() -> None:
    for body in BODIES:
        problems = [own for _, own, _ in additions(body)]
        counts = [len(HENON_SOLVER.prepare(problem, rtol=1e-6)().transitions) for problem in problems]
        assert not any(counts[:-1])
        assert counts[-1] > 10


def test_no_dense_output_is_made_unless_samples_are_asked_for() -> None:
    assert HENON_SOLVER.prepare(shipped_problem("fig8", "listing_limit"), rtol=1e-9)().samples is None


def test_long_runs_hand_out_every_transition_and_keep_their_sticks() -> None:
    found = horizons(shipped_problem("fig8", "listing_limit"), {"henon": (70.0, 7000.0), "heyoka": (70.0, 700.0)})
    assert [(own.solver, own.until) for own in found] == [
        ("henon", 70.0), ("henon", 7000.0), ("heyoka", 70.0), ("heyoka", 700.0)
    ]  # fmt: skip
    short, long, other_short, other_long = found
    assert short.transitions == other_short.transitions == 126
    assert long.transitions > 100 * short.transitions - 200
    assert long.stick_error_s < 1e-11
    assert other_long.stick_error_s < 1e-9
    assert all(own.stick_error_s != own.stick_error_s for own in (short, other_short))
    assert STICKS[0] > STICKS[1]


def test_powers_are_fitted_with_their_errors() -> None:
    def power(*walls: float) -> str:
        runs = [Horizon("a", 10.0 ** (k + 2), 1, wall, 0.0, 0.0) for k, wall in enumerate(walls)]
        return fitted(runs, "until", "wall_s", 1e3)

    assert power(1.0, 2.0, 200.0, 20000.0) == "2.00 ± 0.00"  # the first one is before the smallest horizon
    error = math.log10(2) * math.sqrt(2 / 3) / math.sqrt(2)
    assert power(1.0, 1.0, 10 * 2, 100.0) == f"1.00 ± {error:.2f}"  # the middle one is off by log10(2)
    assert (power(1.0, 1.0, 10.0), power(1.0, 1.0)) == ("1.00", "?")


def test_landings_find_the_same_and_the_swap_takes_fewest_evaluations() -> None:
    case = load_case(CASES / "free_coulomb.yaml")
    found = {own.solver: own for own in landings([case])}
    assert set(found) == {"henon", "henon-newton", "henon-brent"}
    assert all(own.error_s < 1e-12 for own in found.values())
    assert found["henon"].evaluations < found["henon-newton"].evaluations < found["henon-brent"].evaluations


def row(solver: str, wall: float, digits: float, **values: object) -> RunRow:
    names = {"case": "c", "reading": "default", "solver": solver, "verdict": "right", "digits": digits}
    return RunRow(**names | {"wall_s": wall, "compile_s": 0.0, "max_time_error_s": 10.0**-digits} | values)


def pair(rival: str, ratio: float, digits: int = 6, **values: object) -> PairRow:
    found = {
        "case": "c", "reading": "default", "digits": digits, "against": rival, "rtol": 1e-9, "rival": rival,
        "rival_rtol": 1e-8, "rival_step_s": None, "rounds": 9,
        "wall_s": ratio, "rival_wall_s": 1.0, "ratio": ratio, "ratio_low": ratio, "ratio_high": ratio,
    }  # fmt: skip
    return PairRow(**found | values)


def test_mean_costs_are_over_all_readings_and_in_turn() -> None:
    found = [
        pair("b", 1 / 4), pair("c", 1 / 3),
        pair("b", 1 / 9, case="d"),
        pair("b", 1 / 2, digits=9), pair("c", 2.0, digits=9),
    ]  # fmt: skip
    assert mean_costs(found, 6) == pytest.approx({"henon": 1.0, "b": 6.0})
    assert mean_costs(found, 9) == pytest.approx({"henon": 1.0, "b": 2.0, "c": 0.5})
    own = mean_costs([pair("heyoka", 1 / 4, rival_own_s=0.5), pair("heyoka", 1 / 4, case="d", rival_own_s=2.0)], 6)
    assert own == pytest.approx({"henon": 1.0, "heyoka": 4.0, ALONE: 4.0})
    assert ALONE not in mean_costs([pair("heyoka", 1 / 4, rival_own_s=0.5), pair("heyoka", 1 / 4, case="d")], 6)
    rows = [row("henon", 1.0, 12), row("c", 1.0, 12), row("henon", 1.0, 12, case="d"), row("c", 1.0, 3, case="d")]
    assert why_not(rows, "c", 6) == "not reached"
    rows[-1] = replace(rows[-1], status="timeout")
    assert why_not(rows, "c", 6) == "over 4 s"
    assert why_not([*rows[:-1], row("c", 1.0, 9, case="d")], "c", 6) == ""


def test_others_are_said_to_take_so_many_times_as_long() -> None:
    """Never as a fraction: 0.00056 is 1800 times as long."""
    slow = pair("cvode-adams", 1 / 1000, ratio_low=0.00056, ratio_high=1 / 900)
    (cells,) = rival_table([slow, pair("heyoka", 1 / 8)]).rows
    assert "1000 (900 to 1800)" in cells
    assert "8 (8 to 8)" in cells


def test_a_peer_that_ran_has_a_column() -> None:
    columns = rival_table([pair("heyoka", 1 / 8), pair("diffsol-tsit45", 1 / 70)])
    assert columns.headings[-1] == "`diffsol-tsit45`"
    assert columns.rows[0][-1].startswith("70 ")
    assert "`diffsol-tsit45`" not in rival_table([pair("heyoka", 1 / 8)]).headings


def test_the_ladder_has_cvode_from_c_and_those_that_are_asked_for_beside_the_reference() -> None:
    assert {"henon", "heyoka", "cvode-c-adams", "cvode-c-bdf"} <= set(solvers())
    assert "diffrax-dopri8" not in solvers()
    assert solvers(["diffrax-dopri8", "heyoka"]) == ("henon", "diffrax-dopri8", "heyoka")
    assert solvers(["all"])[0] == "henon"
    assert not any(name.endswith("+numba") for name in solvers())
    assert set(solvers()) - set(WHEN_NAMED) <= set(solvers(["all"]))
    with pytest.raises(CaseError, match="unknown solver 'heyokka'"):
        solvers(["heyokka"])


def test_pairs_run_in_turn_at_the_cheapest_settings_for_the_same_digits() -> None:
    pytest.importorskip("heyoka")
    case = load_case(CASES / "free_coulomb.yaml")
    ladder = [
        row(solver, wall, digits, case=case.name, rtol=rtol, atol=rtol, status="ok")
        for solver, rtol, wall, digits in [
            ("henon", 1e-6, 1e-5, 5), ("henon", 1e-9, 3e-5, 10), ("henon", 1e-12, 2e-5, 13), ("henon", 1e-13, 4e-5, 14),
            ("heyoka", 1e-9, 5e-5, 9.5), ("heyoka", 1e-12, 6e-5, 11),
        ]
    ]  # fmt: skip
    found, failed = time_ladder_pairs([case], ladder, Options(processes=1), ProgressLine(None), seconds=0.1)
    assert (len(found), failed) == (3, [])
    for pair, digits in zip(found[1:], (6, 9), strict=True):
        assert (pair.rival, pair.digits) == ("heyoka", digits)
        assert pair.rtol in (1e-9, 1e-12, 1e-13)
        assert pair.rival_rtol in (1e-9, 1e-12)
        assert pair.rounds == 16
        assert 0 < pair.ratio_low <= pair.ratio <= pair.ratio_high
        assert 0 < pair.wall_s not in (2e-5, 3e-5, 4e-5)
        assert pair.rival_wall_s > 0
    table = rival_table(found).rows
    assert [cells[:2] for cells in table] == [(case.name, "3"), (case.name, "6"), (case.name, "9")]
    samples = list(csv.DictReader(io.StringIO(samples_text(found))))
    assert [(own["solver"], own["digits"]) for own in samples[:2]] == [("henon", "3"), ("heyoka", "3")]
    assert all(len(own["samples_us"].split()) == found[0].rounds for own in samples)


def test_a_change_of_the_machines_pace_does_not_change_a_ratio() -> None:
    """The pace changes within a round: one median comes from before, the other from after."""
    times = Turns({"a": [1.0, 1.0, 1.0, 3.0, 3.0], "b": [2.0, 2.0, 6.0, 6.0, 6.0]})
    assert times.median("a") / times.median("b") == pytest.approx(1 / 6)
    assert times.ratio("a", "b") == pytest.approx(1 / 2)


def test_a_short_run_is_repeated_within_its_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a clock that the runs alone move: how busy the machine is does not count."""
    calls = {"shortest": 0, "short": 0, "long": 0}
    now = 0

    def run(key: str, microseconds: int) -> None:
        nonlocal now
        calls[key] += 1
        now += 1000 * microseconds

    monkeypatch.setattr(timing, "time", SimpleNamespace(perf_counter_ns=lambda: now))
    lengths = {"shortest": 10, "short": 400, "long": 5000}
    found = interleaved({key: partial(run, key, length) for key, length in lengths.items()}, rounds=3, turn=4.1e-3)
    assert calls == {"shortest": 4 * MAX_REPETITIONS, "short": 4 * 10, "long": 4}
    assert {key: found.median(key) for key in lengths} == pytest.approx({"shortest": 1e-5, "short": 4e-4, "long": 5e-3})


def test_crossings_near_a_crest_are_found_by_every_landing() -> None:
    found = crest_crossings(("1", "1e-7"))
    assert [one.transitions for one in found] == [2] * 6
    assert max(one.error_s for one in found[:3]) < 1e-14
    assert max(one.error_s for one in found[3:]) < 1e-11
    assert found[3].evaluations <= 4 < found[5].evaluations < found[4].evaluations
    timed = [replace(one, to_bracketing=1.1 if "-7" in one.reading else 0.9) for one in found]
    assert [line[-2:] for line in landing_table(timed).rows] == [("0.90", ""), ("1.10", "bracketing is quicker")]


def test_operations_are_counted_by_lane_and_fused_ones_twice() -> None:
    ir = """\
declare <4 x double> @llvm.fma.v4f64(<4 x double>, <4 x double>, <4 x double>)
  %a = fmul double %x, %y
  %b = fadd <4 x double> %v, %w
  %c = call <4 x double> @llvm.fma.v4f64(<4 x double> %v, <4 x double> %w, <4 x double> %b)
  %d = call double @llvm.fma.f64(double %a, double %x, double %y)
  %e = fcmp ogt double %a, %x
"""
    assert count(ir) == 1 + 4 + 8 + 2


def test_expansions_are_counted_by_mode() -> None:
    """Each stick has some, and slip far more; both together are all."""
    found = work(shipped_problem("fig8", "listing_limit"))
    assert 6 <= found.in_stick < found.expansions / 3
    everything = found.expansions * found.expansion + found.steps * found.closing + 2 * found.order * found.landed
    assert found.total == everything - found.in_stick * (found.expansion - found.stick)


@pytest.mark.slow  # daily: chains of each kind in modes/, and the fits by test_powers_are_fitted_with_their_errors
def test_chains_of_every_length_agree() -> None:
    found = sizes((1, 3), ("henon", "scipy-dop853"))
    assert [size.states for size in found] == [2, 2, 6, 6]
    assert all(size.agrees and size.transitions > 5 for size in found)
    same = [Size(n, "a", 1, n**1.5, 1.0, 1.0, 10, n**2.0, 1.0, True) for n in (2, 16, 64)]
    assert fitted(same, "states", "per_second", 16) == "2.00"
    assert fitted(same, "states", "ready_s", 16) == "1.50"


def test_many_contacts_have_the_transitions_of_a_run_by_hand() -> None:
    found = many_contacts(3)
    assert found.transitions > 20
    assert found.by_hand_s is not None
    assert contact_table([found, replace(found, by_hand_s=None)]).rows[1][-1] == "other result"


def test_compiling_is_paid_for_after_so_many_runs() -> None:
    fast = Ready("c", "default", "henon", 1e-9, wall_s=1.0, cold_s=5.0, kept_s=1.5)
    slow = Ready("c", "default", "heyoka", 1e-9, wall_s=3.0, cold_s=1.0, kept_s=1.0)
    assert (fast.paid_after(slow), slow.paid_after(fast)) == ("2 / 1", "never / never")
    assert ready_table([fast, slow]).rows[0][-1] == "2 / 1 against `heyoka`"


def test_getting_ready_is_measured_twice_in_new_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    """With an empty folder of compiled code, and with what the first process has left there."""
    seen: list[tuple[str, str]] = []

    def measured(function: object, problem: Problem, solver: str, rtol: float, cache: str) -> float:
        seen.append((solver, cache))
        return float(len(seen))

    monkeypatch.setattr(ladder, "in_fresh_process", measured)
    own = [pair("heyoka", 0.1, 9, case="free_coulomb"), pair("scipy-rk45", 0.1, 9, case="free_coulomb")]
    first, other = readiness([load_case(CASES / "free_coulomb.yaml")], own)
    assert [(ready.solver, ready.rtol, ready.cold_s, ready.kept_s) for ready in (first, other)] == [
        ("henon", 1e-9, 1.0, 2.0), ("heyoka", 1e-8, 3.0, 4.0),
    ]  # fmt: skip
    assert [solver for solver, _ in seen] == ["henon", "henon", "heyoka", "heyoka"]
    places = [place for _, place in seen]
    assert places[0] == places[1] != places[2] == places[3]


def test_a_fresh_process_keeps_its_compiled_code_in_its_own_folder(tmp_path: Path) -> None:
    assert in_fresh_process(os.getenv, VARIABLE, cache=str(tmp_path)) == str(tmp_path)
    assert os.getenv(VARIABLE) == in_fresh_process(os.getenv, VARIABLE) != str(tmp_path)


@pytest.mark.slow  # daily: the one above, where nothing is compiled
def test_getting_ready_is_timed_in_new_processes() -> None:
    case = load_case(CASES / "free_coulomb.yaml")
    first, own = readiness([case], [pair("heyoka", 0.1, 9, case=case.name), pair("scipy-rk45", 0.1, 9, case=case.name)])
    assert (own.solver, own.rtol, own.wall_s) == ("heyoka", 1e-8, 1.0)
    assert (first.solver, first.rtol) == ("henon", 1e-9)
    assert min(first.cold_s, first.kept_s, own.cold_s, own.kept_s) > 0


def timed_run(solver: str, wall: float, iqr: float | None) -> RunRow:
    own = {"case": "c", "reading": "late", "solver": solver, "rtol": 1e-9, "verdict": "right", "status": "ok"}
    counts = {"digits": 9.5, "max_time_error_s": 3e-10, "rhs_evaluations": 50, "steps": 10, "wall_s": wall}
    return RunRow(**own | counts, wall_s_iqr=iqr)


def test_the_page_shows_what_was_measured_and_every_link_leads_to_a_file(tmp_path: Path) -> None:
    rows = [timed_run("henon", 1e-5, 1e-7), timed_run("heyoka", 4e-5, 1e-5), timed_run("scipy-dop853", 1e-2, None)]
    timed = TimedPair(
        "c", "late", 9, "heyoka", rtol=1e-9, rival="heyoka", rival_rtol=1e-9, rival_step_s=None, wall_s=1e-5,
        rival_wall_s=4e-5, ratio=0.25, ratio_low=0.2, ratio_high=0.3, rounds=3, rival_own_s=2e-5,
        samples_s=(1e-5,) * 3, rival_samples_s=(4e-5,) * 3,
    )  # fmt: skip
    parts = {
        "ready": [Ready("c", "late", "henon", 1e-9, 1e-5, 4.0, 1.0)],
        "landings": [
            Landed("c", "late", solver, 5, 2.0, 1e-5, 0.75, 1e-15)
            for solver in ("henon", "henon-newton", "henon-brent")
        ],
        "effects": [],
        "growth": [Horizon("henon", until, 10, 1e-3, 0.0, 1e-13) for until in (1e3, 1e4)],
        "sizes": [Size(2, solver, 5, 1.0, 1e-5, 1.0, 10, 1e-5, 1.0, True) for solver in ("henon", "heyoka")],
        "contacts": [ManyContacts(4, 56, 1e-2, 1e-3, 0.2)],
    }
    done = Work(100, 50, 10, 20, 20, 4, 6, 30, 1e-5, 1e10)
    failed, context = ["c, late, against ida: it *died*"], provenance("make it again")
    text = write_page(tmp_path, context, rows, [timed], failed, done, parts).read_text(encoding="utf-8")
    links = {link for link in re.findall(r"\]\(([^)]+)\)", text) if not link.startswith(("#", "../"))}
    assert {path.name for path in tmp_path.iterdir()} == links | {"README.md"}
    assert len(read_rows(RunRow, tmp_path / "price.csv")) == 3
    assert len((tmp_path / "samples.csv").read_text().splitlines()) == 1 + 2
    assert "## c, late" in text
    assert "| 4 (3.3 to 5) | 2 |" in text
    assert "| `heyoka`, its own calls alone |  |  | 2 |  |" in text
    assert "its own calls of `propagate_until` are 50%" in text
    assert "Times in the figure: 3. Times with an interquartile range above a tenth of the median:\n1. Times" in text
    assert "from one or two runs, drawn without a bar: 1." in text
    assert "| 0.75 |  |\n" in text
    assert "Not timed: c, late, against ida: it \\*died\\*" in text
    assert "    make it again\n" in text
