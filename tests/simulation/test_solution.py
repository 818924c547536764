"""What a solution holds: times and states, dense output, modes, tables, a figure."""

from __future__ import annotations

import math
import os
import pickle
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from often import daily

import henon_ref as hr

CASES = Path(__file__).parents[2] / "cases"
OSCILLATOR = hr.System(["x", "v"], {}, {"s": "x"}, ["v", "-x"])
BELT = hr.System(["x", "v"], {"F": 1, "d": 3, "vb": 0.5}, {"s": "v - vb"}, ["v", "-x - F*s/(1 + d*s*(v - vb))"])
COLUMNS = ["time_s", "kind", "surface", "from_mode", "to_mode"]


@pytest.fixture(scope="module")
def wave() -> hr.Solution:
    return hr.simulate(OSCILLATOR, {"x": 1, "v": 0}, until=30)


@pytest.fixture(scope="module")
def stick_slip() -> hr.Solution:
    return hr.simulate(BELT, {"x": 1.5, "v": 0}, until=20)


def test_dense_output_is_the_solution(wave: hr.Solution) -> None:
    times = np.linspace(0, 30, 10_001)
    assert wave.sol(times).shape == (2, 10_001)
    assert np.abs(wave.sol(times) - [np.cos(times), -np.sin(times)]).max() < 1e-10
    assert wave.sol(7.5).shape == (2,)
    assert wave.sol(7.5).tolist() == wave.sol([7.5])[:, 0].tolist()
    assert wave.sol([]).shape == (2, 0)


@pytest.mark.parametrize("name", ["stribeck_belt", "two_blocks", "free_coulomb", "hard/grazing", "hard/roots_at_once"])
def test_times_and_states_have_the_steps_and_both_sides_of_every_transition(name: str) -> None:
    case = hr.System.from_case(CASES / f"{name}.yaml")
    given = {"until": case.until, "start": case.start, "mode": case.mode}
    run, few = (hr.simulate(case, case.initial, dense_output=dense, **given) for dense in (True, False))
    for solution in (run, few):
        t, y, table = solution.t, solution.y, solution.transitions
        assert y.shape == (len(case.state), len(t))
        assert (t[0], t[-1]) == (float(case.start), float(case.until))
        assert y[:, 0].tolist() == [float(x) for x in case.initial.values()]
        assert (np.diff(t) >= 0).all()
        assert min(np.count_nonzero(t == time) for time in table.time_s) >= 2
        for time, state in zip(table.time_s, table[list(case.state)].to_numpy(), strict=True):
            assert state.tolist() in y[:, t == time].T.tolist()
    assert len(few.t) == 2 + 2 * len(few.transitions)
    assert len(run.t) >= len(few.t) + run.counts.steps - len(run.transitions) - 1
    assert few.transitions.equals(run.transitions)
    assert few.sticks.equals(run.sticks)
    assert few.counts == run.counts
    assert np.abs(run.sol(run.t) - run.y).max() < 1e-8 * np.abs(run.y).max()


def test_it_is_as_exact_between_the_steps_as_at_their_ends(stick_slip: hr.Solution) -> None:
    middle = (stick_slip.t[1:] + stick_slip.t[:-1]) / 2
    for time, state in zip(middle.tolist(), stick_slip.sol(middle).T, strict=True):
        there = hr.simulate(BELT, {"x": 1.5, "v": 0}, until=time, dense_output=False)
        assert state == pytest.approx(there.y[:, -1], abs=1e-9)


@pytest.mark.parametrize("t", [-1e-9, 30.000001, math.nan, math.inf, [1, 31], "one", [[1.0]], None])
def test_a_time_that_is_none_of_the_run_is_refused(wave: hr.Solution, t: object) -> None:
    for function in (wave.sol, wave.mode):
        with pytest.raises(ValueError, match="t ") as refused:
            function(t)
        assert len(str(refused.value)) < 400


def test_the_mode_is_that_after_a_transition(stick_slip: hr.Solution) -> None:
    begin = stick_slip.sticks.start_s[0]
    assert stick_slip.mode(begin) == {"s": 0}
    assert stick_slip.mode(np.nextafter(begin, 0)) == {"s": 1}
    assert stick_slip.mode([0, begin, 20]) == [{"s": -1}, {"s": 0}, {"s": -1}]
    assert stick_slip.final_mode == "s=-1"


def test_modes_of_several_surfaces_are_text_as_in_the_reports() -> None:
    case = hr.System.from_case(CASES / "two_blocks.yaml")
    run = hr.simulate(case, case.initial, until=case.until)
    names = case.model.sign_names
    assert list(run.mode(1.0)) == list(names)
    assert run.final_mode == " ".join(f"{n}={m:+d}" if m else f"{n}=0" for n, m in run.mode(float(case.until)).items())


def test_without_dense_output_there_is_no_solution_but_the_mode(stick_slip: hr.Solution) -> None:
    run = hr.simulate(BELT, {"x": 1.5, "v": 0}, until=20, dense_output=False)
    assert run.sol is None
    times = np.linspace(0, 20, 50)
    assert run.mode(times) == stick_slip.mode(times)
    with pytest.raises(hr.HenonRefError, match="dense_output=True"):
        run.to_dataframe(times)
    with pytest.raises(hr.HenonRefError, match="dense output"):
        run.plot()


def test_tables_have_the_columns_of_the_reports(stick_slip: hr.Solution, wave: hr.Solution) -> None:
    assert list(stick_slip.transitions.columns) == [*COLUMNS, "x", "v"]
    assert list(stick_slip.sticks.columns) == ["start_s", "duration_s", "surface"]
    assert len(wave.sticks) == 0
    nothing = hr.simulate(OSCILLATOR, {"x": 1, "v": 0}, until=1)
    assert list(nothing.transitions.columns) == [*COLUMNS, "x", "v"]
    assert nothing.transitions.time_s.dtype == nothing.sticks.duration_s.dtype == float


def test_a_stick_that_the_horizon_cuts_off_is_left_out(stick_slip: hr.Solution) -> None:
    ends = stick_slip.transitions.query("kind == 'release'").time_s
    assert (stick_slip.sticks.start_s + stick_slip.sticks.duration_s).tolist() == pytest.approx(ends.tolist())
    cut = hr.simulate(BELT, {"x": 1.5, "v": 0}, until=stick_slip.sticks.start_s[1] + 1)
    assert (len(cut.sticks), cut.final_mode) == (1, "s=0")


def test_a_stick_that_the_run_starts_in_is_whole() -> None:
    run = hr.simulate(BELT, {"x": 0, "v": 0.5}, until=4)
    assert run.sticks.values.tolist() == [[0.0, pytest.approx(2.0), "s"]]


def test_a_refused_start_has_no_solution_but_its_own(stick_slip: hr.Solution) -> None:
    run = hr.simulate(hr.System(["x"], {}, {"s": "x"}, ["s"]), {"x": 0}, until=1)
    assert run.sol(0).tolist() == [0.0]
    assert run.mode(0) == {}
    with pytest.raises(ValueError, match="between"):
        run.sol(0.1)


@pytest.mark.parametrize(("name", "panels"), [("stribeck_belt", 3), ("leaving_slide", 2), ("two_blocks", 4)])
def test_it_is_drawn(name: str, panels: int) -> None:
    case = hr.System.from_case(CASES / f"{name}.yaml")
    run = hr.simulate(case, case.initial, until=case.until)
    assert run.plot().lines
    axes = run.plot_time()
    assert len(axes) == panels
    assert all(a.lines for a in axes)
    plt.close("all")


def test_states_and_axes_of_the_portrait_are_chosen(stick_slip: hr.Solution) -> None:
    axes = stick_slip.plot(x="v", y="x")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("$v$", "$x$")
    own = plt.figure().subplots()
    assert stick_slip.plot(x="t", y="v", ax=own) is own
    assert (own.get_xlabel(), own.get_ylabel()) == ("time t [s]", "$v$")
    assert stick_slip.plot(y="x").get_xlabel() == "$v$"
    assert stick_slip.plot(x="v").get_ylabel() == "$x$"
    with pytest.raises(hr.HenonRefError, match=r"x is 'w', which is no state.*wanted one of x, v, t"):
        stick_slip.plot(x="w")
    with pytest.raises(hr.HenonRefError, match="y is 't', which is no state"):
        stick_slip.plot(y="t")
    plt.close("all")


def test_runs_are_drawn_over_each_other_in_a_style_of_ones_own(stick_slip: hr.Solution) -> None:
    axes = stick_slip.plot(label="slow", color="red", lw=0.5)
    longer = hr.simulate(BELT, {"x": 3, "v": 0}, until=20)
    assert longer.plot(ax=axes, label="far", ls=":") is axes
    assert {line.get_color() for line in axes.lines[: len(axes.lines) // 2 - 1]} == {"red"}
    assert [text.get_text() for text in axes.legend().get_texts()] == ["slow", "far"]
    assert axes.get_xlim()[1] > 3  # both within the limits
    plt.close("all")


def test_transitions_are_marked_and_places_of_one_kind_share_a_name(stick_slip: hr.Solution) -> None:
    axes = stick_slip.plot(transitions=True)
    dots = axes.lines[-1]
    assert dots.get_xdata().tolist() == stick_slip.transitions["x"].tolist()
    words = [text.get_text() for text in axes.texts if text.get_text()]
    assert len(words) < len(stick_slip.transitions)
    assert all(text.split()[0] in {"stick", "release", "crossing"} for text in words)
    assert stick_slip.plot(x="t", y="v", transitions=True).lines[-1].get_xdata().tolist() == dots_at(stick_slip)
    plt.close("all")


def dots_at(run: hr.Solution) -> list[float]:
    return run.transitions["time_s"].tolist()


def test_states_and_surfaces_over_time_are_chosen(stick_slip: hr.Solution) -> None:
    axes = stick_slip.plot_time("s", "x", color="green")
    assert [a.get_ylabel() for a in axes] == ["$s$:  $h = v - v_{b}$", "$x$"]
    assert axes[1].lines[-1].get_color() == "green"
    below = plt.figure().subplots()
    assert list(stick_slip.plot_time("v", ax=below)) == [below]
    with pytest.raises(hr.HenonRefError, match=r"'w' is no state and no surface.*wanted some of x, v, s"):
        stick_slip.plot_time("w")
    with pytest.raises(hr.HenonRefError, match="ax holds 1 axes; wanted 2, one each for x, v"):
        stick_slip.plot_time("x", "v", ax=below)
    plt.close("all")


def test_a_portrait_shows_a_body_against_its_own_speed() -> None:
    scene = hr.Scene()
    first, second = (scene.body(name, mass=1) for name in ("first", "second"))
    scene.spring(first, second, stiffness=1)
    scene.friction(second, scene.wall, law="coulomb", force=1)
    system = scene.system()
    run = hr.simulate(system, {"x_first": 3, "v_first": 0, "x_second": 0, "v_second": 1}, until=5)
    axes = run.plot()
    assert (axes.get_xlabel(), axes.get_ylabel()) == (r"$x_{\mathrm{second}}$", r"$v_{\mathrm{second}}$")
    assert run.plot(x="x_first").get_ylabel() == r"$v_{\mathrm{first}}$"
    plt.close("all")


def test_states_by_name_and_as_a_table(stick_slip: hr.Solution) -> None:
    assert stick_slip["v"].tolist() == stick_slip.y[1].tolist()
    assert stick_slip["t"].tolist() == stick_slip.t.tolist()
    with pytest.raises(hr.HenonRefError, match="'s' is no state; wanted one of x, v, t"):
        stick_slip["s"]
    table = stick_slip.to_dataframe()
    assert list(table.columns) == ["t", "x", "v", "s"]
    assert table[["x", "v"]].to_numpy().T.tolist() == stick_slip.y.tolist()
    at = table[table["t"] == stick_slip.sticks.start_s[0]]
    assert at["s"].tolist()[:2] == [1, 0]  # before it and after it
    few = stick_slip.to_dataframe([0, 10.5])
    assert few[["x", "v"]].to_numpy().T.tolist() == stick_slip.sol([0, 10.5]).tolist()
    assert few["s"].tolist() == [stick_slip.mode(t)["s"] for t in (0, 10.5)]
    plain = hr.simulate(BELT, {"x": 1.5, "v": 0}, until=20, dense_output=False)
    assert plain.to_dataframe()["s"].tolist()[-1] == -1
    with pytest.raises(hr.HenonRefError, match="dense_output=True"):
        plain.to_dataframe([1.0])


@pytest.mark.parametrize("call", daily(["run.plot()", "hr.plots.histogram(table, 'x')"], some=["run.plot()"]))
def test_a_notebook_shows_all_figures(tmp_path: Path, call: str) -> None:
    """The backend of notebooks makes pyplot interactive where it is loaded, which is with the first figure."""
    (tmp_path / "notebook_backend.py").write_text(
        "import matplotlib\nfrom matplotlib.backends.backend_agg import *\nmatplotlib.interactive(True)\n"
    )
    code = (
        "import matplotlib, henon_ref as hr, pandas as pd\n"
        "table = pd.DataFrame({'x': [1.0, 2.0, 4.0]})\n"
        "run = hr.simulate(hr.System(['x', 'v'], {}, {'s': 'x'}, ['v', '-x']), {'x': 1, 'v': 0}, until=5)\n"
        f"before = matplotlib.is_interactive()\n{call}\nprint(before, matplotlib.is_interactive())\n"
    )
    paths = os.pathsep.join([str(tmp_path), *sys.path])
    environment = {**os.environ, "PYTHONPATH": paths, "MPLBACKEND": "module://notebook_backend"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]


def test_a_blow_up_is_drawn_up_to_where_it_leaves_the_rest_behind() -> None:
    run = hr.simulate(hr.System(["x"], {}, {"s": "x - 2"}, ["x^2"]), {"x": 1}, until=2)
    axes = run.plot_time()
    assert run.status == "diverged"
    assert all(a.get_ylim()[1] < 1e3 for a in axes)
    plt.close(axes[0].figure)


def test_it_is_shown_in_a_line_and_in_a_notebook(stick_slip: hr.Solution) -> None:
    assert repr(stick_slip).startswith("Solution(ok; t = 0 to 20, 5 transitions, ")
    assert "<table" in stick_slip._repr_html_()


def test_many_grazes_in_a_long_run_are_kept_whole() -> None:
    """x = 1 + cos t touches 0 once a period, each time located in multiprecision."""
    tide = hr.System(["x", "v"], {}, {"s": "x"}, ["v", "1 - x"])
    run = hr.simulate(tide, {"x": 2, "v": 0}, until=1000)
    assert set(run.transitions.kind) <= {"graze", "crossing"}
    times = np.linspace(0, 1000, 20_001)
    assert np.abs(run.sol(times)[0] - 1 - np.cos(times)).max() < 1e-7
    assert (np.diff(run.t) >= 0).all()


def test_it_can_be_sent_to_another_process(stick_slip: hr.Solution) -> None:
    there = hr.simulate(BELT, {"x": 1.5, "v": 0}, until=20, parameters={"vb": 0.3})
    again = pickle.loads(pickle.dumps(there))
    assert again.transitions.equals(there.transitions)
    assert again.sol(7.0).tolist() == there.sol(7.0).tolist()
    assert again.system == there.system == BELT.with_parameters({"vb": 0.3})
    assert again.system.parameters["vb"] == Fraction(3, 10)


def test_the_start_comes_before_what_happens_there() -> None:
    """The crossing is half a unit in the last place after the start."""
    case = hr.System.from_case(CASES / "hard" / "horizon_one_ulp.yaml", "event")
    run = hr.simulate(case, case.initial, start=case.start, until=case.until)
    assert len(run.transitions) == 1
    assert run.t[:3].tolist() == [1.0, 1.0, 1.0]
    assert run.y[0, 0] == float(case.initial["x"]) < 0 <= run.y[0, 1]


def test_a_run_whose_transitions_are_all_on_hidden_kinks_has_its_modes() -> None:
    """The larger of two changes in a branch that is not active, as x falls from 2.5."""
    system = hr.System(["x", "v"], {}, {}, ["v", "piecewise(2 - x, x > 0, max(sqrt(5 - v), x))"])
    run = hr.simulate(system, {"x": 2.5, "v": 0.25}, until=6)
    assert (run.status, len(run.transitions)) == ("ok", 0)
    assert run.mode([1, 5]) == [run.mode(0)] * 2
    assert set(run.to_dataframe()["kink1"]) == {1}


@pytest.mark.parametrize("until", [0.01, 1.5, 14, 60])
def test_frames_are_those_of_rows(until: float) -> None:
    run = hr.simulate(BELT, {"x": 1, "v": 0}, until=until)
    found = [
        (t.time, t.kind, BELT.model.sign_names[t.surface], f"s={t.from_mode[0]:+d}", f"s={t.to_mode[0]:+d}", *t.state)
        for t in run.trajectory.transitions
    ]
    rows = [tuple(cell.replace("s=+0", "s=0") if isinstance(cell, str) else cell for cell in row) for row in found]
    numbers = dict.fromkeys(("time_s", "x", "v"), float)
    wanted = pd.DataFrame(rows, columns=[*COLUMNS, "x", "v"]).astype(numbers)
    pd.testing.assert_frame_equal(run.transitions, wanted, check_exact=True, check_column_type=False)
    sticks = [(s[0], s[1], "s") for s in zip(run.sticks["start_s"], run.sticks["duration_s"], strict=True)]
    wanted = pd.DataFrame(sticks, columns=["start_s", "duration_s", "surface"]).astype(
        {"start_s": float, "duration_s": float}
    )
    pd.testing.assert_frame_equal(run.sticks, wanted, check_exact=True)
