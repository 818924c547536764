"""The price list: what an absent effect leaves behind, long runs, landings, and how prices are read from rows."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest
import sympy as sp

from henon_ref.columns import RUN_COLUMNS, Row
from henon_ref.model.case import load_case, parse_case
from henon_ref.price import effects
from henon_ref.price.command import orbit_problem, truths_of
from henon_ref.price.growth import STICKS, horizons
from henon_ref.price.ladder import paid_after, relative_costs
from henon_ref.price.landings import landings, near_grazing
from henon_ref.price.operations import count
from henon_ref.price.page import rival_table
from henon_ref.price.pairs import pairs
from henon_ref.price.states import Size, exponent, sizes
from henon_ref.score.options import Options, Silent
from henon_ref.score.turns import MOST, Turns, in_turn
from henon_ref.trajectory import Problem

CASES = Path(__file__).parents[1] / "cases"
BASE = dict(list(effects.OSCILLATOR.items())[:3])


@pytest.mark.parametrize(
    ("body", "problem"),
    [
        ("belt oscillator", effects.oscillator(BASE)),
        ("rig", effects.rig(dict(list(effects.RIG.items())[:5]))),
    ],
)
def test_what_a_scene_does_not_name_is_not_in_its_tape(body: str, problem: Problem) -> None:
    """The same operations as a system written by hand without it."""
    written = parse_case(effects.BY_HAND[body]).readings[0].problem
    assert effects.slip_tape(problem.system).counts == effects.slip_tape(written.system).counts
    at = {x: sp.Rational(k + 2, 7) for k, x in enumerate(problem.system.states)}
    for mode in ((-1,), (0,), (1,)):
        ours, theirs = (
            [sp.simplify(p.system.numeric(f).xreplace(at)) for f in p.system.equations(mode).field]
            for p in (problem, written)
        )
        assert ours == theirs


@pytest.mark.parametrize("name", list(effects.OFF))
def test_an_effect_that_is_named_costs_operations_even_at_zero(name: str) -> None:
    without = effects.operations(effects.oscillator(BASE).system)
    carried = effects.operations(effects.oscillator({**BASE, name: effects.OFF[name]}).system)
    assert carried > without


def test_a_rig_without_dampers_has_none() -> None:
    names = list(effects.RIG)
    plain = {name: effects.RIG[name] for name in names[:5]}
    assert effects.operations(effects.rig(plain).system) < effects.operations(effects.rig(effects.RIG).system)
    assert "c" not in {str(symbol)[0] for symbol in effects.rig(plain).system.field[1].free_symbols}


def test_no_dense_output_is_made_unless_samples_are_asked_for() -> None:
    from henon_ref.henon.solvers import HENON_SOLVER

    assert HENON_SOLVER.prepare(orbit_problem(), rtol=1e-9)().samples is None


def test_the_orbit_of_long_runs_is_that_of_the_case_file() -> None:
    (reading,) = [r for r in load_case(CASES / "fig8.yaml").readings if r.name == "listing_limit"]
    theirs, ours = reading.problem, orbit_problem()
    for mode in ((-1,), (0,), (1,)):
        fields = [p.system.equations(mode).field for p in (theirs, ours)]
        for a, b in zip(*fields, strict=True):
            assert (theirs.system.numeric(a) - ours.system.numeric(b)).simplify() == 0


def test_long_runs_hand_out_every_transition_and_keep_their_sticks() -> None:
    short, long = horizons(orbit_problem(), (70.0, 7000.0))
    assert short.transitions == 126
    assert long.transitions > 100 * short.transitions - 200
    assert long.stick_error_s < 1e-11
    assert STICKS[0] > STICKS[1]


def test_landings_find_the_same_and_the_swap_takes_fewest_evaluations() -> None:
    case = load_case(CASES / "free_coulomb.yaml")
    found = {own.solver: own for own in landings([case], truths_of([case]))}
    assert set(found) == {"henon", "henon-newton", "henon-brent"}
    assert all(own.error_s < 1e-12 for own in found.values())
    assert found["henon"].evaluations < found["henon-newton"].evaluations < found["henon-brent"].evaluations


def row(solver: str, wall: float, digits: float, **values: object) -> Row:
    found: Row = dict.fromkeys(RUN_COLUMNS)
    found.update(
        case="c", reading="default", solver=solver, verdict="right", digits=digits, wall_s=wall, compile_s=0.0,
        max_time_error_s=10.0**-digits,
    )  # fmt: skip
    found.update(values)
    return found


def test_relative_costs_are_means_over_all_readings() -> None:
    rows = [
        row("a", 1.0, 9), row("b", 4.0, 9),
        row("a", 2.0, 9, case="d"), row("b", 2.0, 9, case="d"), row("z", 1.0, 9, case="d", verdict="solver defect"),
        row("c", 1.0, 3),
    ]  # fmt: skip
    assert relative_costs(rows, 6) == pytest.approx({"a": 1.0, "b": 2.0})


def test_pairs_run_in_turn_at_the_cheapest_settings_for_the_same_digits() -> None:
    case = load_case(CASES / "free_coulomb.yaml")
    ladder = [
        {**row(solver, wall, digits, case=case.name), "rtol": rtol, "atol": rtol}
        for solver, rtol, wall, digits in [
            ("henon", 1e-6, 1e-5, 5), ("henon", 1e-9, 3e-5, 10), ("henon", 1e-12, 2e-5, 13), ("henon", 1e-13, 4e-5, 14),
            ("heyoka", 1e-9, 5e-5, 9.5), ("heyoka", 1e-12, 6e-5, 11), ("scipy-rk45", 1e-9, 1e-5, 12),
        ]
    ]  # fmt: skip
    found, failed = pairs([case], ladder, Options(processes=1), Silent(), seconds=0.1)
    assert (len(found), failed) == (2, [])
    for pair, digits in zip(found, (6, 9), strict=True):
        assert (pair["rival"], pair["digits"]) == ("heyoka", digits)
        assert pair["rtol"] in (1e-9, 1e-12, 1e-13)
        assert pair["rival_rtol"] in (1e-9, 1e-12)
        assert pair["rounds"] == 20
        assert 0 < pair["wall_s"] not in (2e-5, 3e-5, 4e-5)
        assert pair["ratio"] == pytest.approx(pair["wall_s"] / pair["rival_wall_s"], rel=0.5)
    table = rival_table(found).rows
    assert [cells[:3] for cells in table] == [
        (case.name, f"{pair['digits']}", f"{pair['ratio']:.2g}") for pair in found
    ]


def test_a_change_of_the_machines_pace_does_not_change_a_ratio() -> None:
    """The pace changes within a round: one median comes from before, the other from after."""
    times = Turns({"a": [1.0, 1.0, 1.0, 3.0, 3.0], "b": [2.0, 2.0, 6.0, 6.0, 6.0]})
    assert times.median("a") / times.median("b") == pytest.approx(1 / 6)
    assert times.ratio("a", "b") == pytest.approx(1 / 2)


def test_a_short_run_is_repeated_within_its_turn() -> None:
    calls: dict[str, int] = {"short": 0, "long": 0}

    def run(key: str, seconds: float) -> None:
        calls[key] += 1
        time.sleep(seconds)

    in_turn({"short": lambda: run("short", 1e-4), "long": lambda: run("long", 4e-3)}, rounds=3, turn=4e-3)
    assert calls["long"] == 4
    assert 4 * 5 <= calls["short"] <= 4 * MOST


def test_crossings_near_a_crest_are_found_by_every_landing() -> None:
    found = near_grazing(("1", "1e-7"))
    assert [one.transitions for one in found] == [2] * 6
    assert max(one.error_s for one in found[:3]) < 1e-14
    assert max(one.error_s for one in found[3:]) < 1e-11
    assert found[3].evaluations < found[4].evaluations


def test_operations_are_counted_by_lane_and_fused_ones_twice() -> None:
    ir = """\
declare <4 x double> @llvm.fmuladd.v4f64(<4 x double>, <4 x double>, <4 x double>)
  %a = fmul contract double %x, %y
  %b = fadd contract <4 x double> %v, %w
  %c = call contract <4 x double> @llvm.fmuladd.v4f64(<4 x double> %v, <4 x double> %w, <4 x double> %b)
  %d = call contract double @llvm.fmuladd.f64(double %a, double %x, double %y)
  %e = fcmp ogt double %a, %x
"""
    assert count(ir) == 1 + 4 + 8 + 2


def test_chains_of_every_length_agree() -> None:
    found = sizes((1, 5), ("henon", "scipy-dop853"))
    assert [size.states for size in found] == [2, 2, 10, 10]
    assert all(size.agrees and size.transitions > 5 for size in found)
    same = [Size(n, "a", 1, 10, 0.0, 10 * n**1.5, 1.0, True) for n in (2, 16, 64)]
    assert exponent(same, "a") == pytest.approx(1.5)


def test_compiling_is_paid_for_after_so_many_runs() -> None:
    fast, slow = row("a", 1.0, 9, compile_s=5.0), row("b", 3.0, 9, compile_s=1.0)
    assert paid_after(fast, slow) == pytest.approx(2.0)
    assert paid_after(slow, fast) is None


def test_importing_the_package_loads_nothing_heavy() -> None:
    heavy = "{'sympy', 'numba', 'heyoka', 'scipy', 'pandas', 'matplotlib', 'numpy'}"
    code = f"import sys, henon_ref; print(sorted({heavy} & set(sys.modules)))"
    assert (
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == "[]"
    )


def test_an_unknown_case_is_one_clear_error(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "henon_ref.price", str(tmp_path / "no.yaml"), "--out", str(tmp_path / "out")]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 2
    assert "no.yaml" in ended.stderr
    assert not (tmp_path / "out").exists()
