"""The audit: the paper's program with a switch per mistake, from the correct method to the appendix as printed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

from henon_ref.baselines.paper import ffi
from henon_ref.baselines.paper.listing import DEFECTS, fig8_numbers, run_variant
from henon_ref.harness.studies.paper.audit import (
    ADDED,
    CROSSING_START,
    audit_row,
    audit_table,
    durations,
    limit_of,
    matched,
    order_of,
    sets,
    truth_of,
)
from henon_ref.harness.studies.paper.systems import fig8_equations


def run(*defects, step=1e-4):
    return run_variant(defects, step=step)


def test_each_mistake_is_a_switch_of_the_compiled_program() -> None:
    assert [name for name, _ in ffi.typeof("struct defects").fields] == list(DEFECTS)
    with pytest.raises(KeyError, match="typing_error"):
        run("typing_error")


def test_without_mistakes_it_has_order_4_and_nothing_sticks_in_the_end():
    assert order_of(()) == pytest.approx(4, abs=0.3)
    assert durations(run()).size == 0


@pytest.mark.parametrize(
    ("defects", "order"),
    [(("frozen_forcing",), 1), (("rounded_sixth",), 1), (("exit_side",), 4), (("frozen_forcing", "rounded_sixth"), 1)],
)
def test_order_where_nothing_sticks(defects, order):
    assert order_of(defects, CROSSING_START) == pytest.approx(order, abs=0.3)


def test_the_listing_converges_with_order_1_to_its_own_limit():
    assert limit_of(DEFECTS) == "3 f, one-sided"
    assert order_of(DEFECTS) == pytest.approx(1, abs=0.2)
    assert np.isnan(order_of(("aliased_steps",)))


@pytest.mark.parametrize("alone", ["aliased_steps", "one_sided_release"])
def test_neither_of_the_two_mistakes_alone_gives_the_sticks_of_fig_8(alone):
    found = durations(run(alone))
    assert not np.any(np.abs(found - 1.1743) < 1e-2)


def test_both_together_give_the_limits_sticks():
    found = np.sort(durations(run(*ADDED[:2], step=1e-5)))
    assert found[0] == pytest.approx(0.4164164369, abs=1e-4)
    assert found[-1] == pytest.approx(1.1743004676, abs=1e-4)


@pytest.mark.parametrize("missing", ["aliased_steps", "landing_sign"])
def test_the_wrong_exit_side_chatters_without_the_mistakes_that_undo_it(missing):
    assert run(*(d for d in DEFECTS if d != missing)).status == "chatters"


def test_aliasing_alone_makes_slivers_at_the_lower_tangent_point_that_multiply_as_the_step_shrinks():
    *_, amplitude, frequency = fig8_numbers()
    counts = []
    for step in (4e-4, 1e-4):
        found = run("aliased_steps", step=step)
        sliver = np.flatnonzero((found.modes[:-1] == 0) & (np.diff(found.times) < 20 * step))
        counts.append(len(sliver))
        ends = sliver + 1
        z = found.states[ends, 0] - amplitude * np.sin(frequency * found.times[ends])
        speed = amplitude * frequency * np.cos(frequency * found.times[ends]) / 0.4
        assert z == pytest.approx(np.full(len(z), -0.20051164), abs=1e-8)
        assert np.all((speed > 1) & (speed < 3))
    assert counts[1] > 3 * counts[0] > 0


def test_the_table_names_every_mistake_once_in_each_family():
    rows = list(sets())
    for family in ("alone", "added", "left out"):
        assert sorted(name for kind, name, _ in rows if kind == family) == sorted(DEFECTS)
    assert set(rows[len(DEFECTS) * 2][2]) == set(DEFECTS)
    right, printed, chattering = (audit_row(*own) for own in (rows[0], rows[len(DEFECTS) * 2], rows[3]))
    assert [row.status for row in (right, printed, chattering)] == ["ok", "ok", "chatters"]
    assert (round(printed.long_s, 5), round(printed.short_s, 5)) == (1.1746, 0.4161)
    assert (right.sticks, printed.sticks, chattering.sticks) == (0, 17, None)
    cells = audit_table([right, printed], "+ ").rows
    assert cells[0][:6] == ("none", "equations", "ok", "86", "0", "")
    assert cells[1][:7] == ("+ `exit_side`", "3 f, one-sided", "ok", "126", "17", "1.17460", "0.41610")


def test_without_mistakes_it_finds_every_transition_of_the_equations():
    assert np.abs(matched(run(step=1e-3), truth_of("equations"))).max() < 1e-9


def test_sequences_that_differ_are_not_compared():
    truth = truth_of("equations")
    found = run(step=1e-3)
    assert matched(replace(found, modes=-found.modes), truth) is None
    assert matched(replace(found, status="diverged"), truth) is None


def test_the_papers_period_is_the_forcings():
    assert fig8_numbers()[-1] == pytest.approx(2 * np.pi / 1.64853333333333, rel=1e-13)
    assert sp.N(fig8_equations().initial[0]) == pytest.approx(-0.2005116442405804)
