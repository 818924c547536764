"""Many contacts: their modes are numbers, put together and changed by the compiled loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
import sympy as sp
from often import daily

import henon_ref as hr
from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.records import mode_dtype, numbered, packed, read, unpacked, words_of, written
from henon_ref.integrator.run import Run
from henon_ref.kernel.library import ffi, kernel
from henon_ref.modes.problem import Problem
from henon_ref.modes.selection import after_event
from henon_ref.modes.system import FilippovSystem
from henon_ref.simulation.launch import integrator_of
from henon_ref.trajectory import Decisions, Trajectory, Transition

RTOL = 1e-9
LOCAL_ERROR = 0.1 * RTOL
"""Of a step, at this tolerance."""
UNTIL = 20


BESIDE = {
    "section": ("x0 + x1 - 0.3", ""),
    "section of a block's own speed": ("v0 - 0.2", ""),
    "stop": ("x0 - 1", " - 5*(1 + k)/2*(x0 - 1)"),
    "kink of two": ("x0 - x1", " - k*(x0 - x1)"),
    "force that jumps": ("x1 - 0.1", " - 0.3*k"),
}
"""A surface that stands beside the contacts, and the force that its side has on the first block."""


def chain(blocks: int, static: float = 0.0, every_other: int = 2, beside: str = "") -> hr.System:
    """Blocks on a belt, a spring each to the wall and to the neighbours, friction that falls with the sliding speed.

    ``static``: of every second block, say, what holds it; 0: no more than friction in sliding. ``beside``: of BESIDE.
    """
    every = range(blocks)
    pulls = [f"-x{i}" + "".join(f" - (x{i} - x{j})" for j in (i - 1, i + 1) if j in every) for i in every]
    other, force = BESIDE.get(beside, ("", ""))
    pulls[0] += force
    field = [*(f"v{i}" for i in every), *(f"{pulls[i]} - F*s{i}/(1 + d*s{i}*(v{i} - vb))" for i in every)]
    held = {
        f"s{i}": {
            "field": [*field[: blocks + i], "0", *field[blocks + i + 1 :]],
            "entry": "inside",
            "release": [
                {"when": f"{pulls[i]} - {static}", "direction": "rising", "to": 1},
                {"when": f"{pulls[i]} + {static}", "direction": "falling", "to": -1},
            ],
        }
        for i in every[: blocks if static else 0 : every_other]
    }
    return hr.System(
        state=[*(f"x{i}" for i in every), *(f"v{i}" for i in every)],
        parameters={"F": 1, "d": 3, "vb": 0.5},
        surfaces={f"s{i}": f"v{i} - vb" for i in every} | ({"k": other} if other else {}),
        field=field,
        sliding=held or None,
    )


def start(blocks: int, seed: int) -> dict[str, float]:
    x, v = np.random.default_rng(seed).uniform(-1, 1, (2, blocks)).round(3)
    return {**{f"x{i}": 2 * float(x[i]) for i in range(blocks)}, **{f"v{i}": float(v[i]) for i in range(blocks)}}


def run(system: hr.System, initial: dict[str, float], until: float = UNTIL) -> Trajectory:
    return hr.simulate(system, initial, until=until, rtol=RTOL).trajectory


def in_bits(transitions: Sequence[Transition]) -> list[tuple[object, ...]]:
    return [(t.kind, t.surface, t.from_mode, t.to_mode, t.time, t.time_low, t.state) for t in transitions]


@pytest.mark.parametrize("static", [0.0, 1.2])
def test_a_mode_that_was_not_seen_before_is_no_affair_of_python(static: float) -> None:
    system = chain(12, static)
    integrator = integrator_of(system, LOCAL_ERROR)
    seen = set()
    for seed in range(3):
        found = run(system, start(12, seed))
        assert found.counts.decisions == Decisions()
        seen |= {t.to_mode for t in found.transitions}
        table = integrator.mode_table
        rows, constants = len(table.compiled.records), len(table.constants)
        assert (rows, len(table.modes)) == (3, 3)
        assert constants <= 3 * sum(len(tape.tape.constants) for tape in table.codes[0].tapes)
    assert len(seen) > 100


@pytest.mark.parametrize("static", [0.0, 1.2])
@pytest.mark.parametrize("beside", daily(BESIDE, some=("stop", "kink of two")))
def test_what_stands_beside_a_chain_costs_no_rows_of_modes(beside: str, static: float) -> None:
    system = chain(8, static, beside=beside)
    integrator, forces_jump, asked = integrator_of(system, LOCAL_ERROR), beside == "force that jumps", 0
    crossed = 0
    for seed in range(3):
        found = run(system, start(8, seed))
        assert found.status == "ok"
        crossed += sum(t.surface == 8 for t in found.transitions)
        decisions = found.counts.decisions
        asked += decisions.mode_selections  # where a force that jumps ends a slide
        assert decisions._replace(mode_selections=0) == Decisions()
        assert len(integrator.mode_table.modes) == 3
    assert crossed > 5
    assert asked <= (2 if forces_jump else 0)
    assert all(len(own) < 2 for tape in integrator.mode_table.codes[0].tapes for own in tape.owners)


@pytest.mark.parametrize("beside", daily(["section of a block's own speed", "stop", "force that jumps"], some=["stop"]))
def test_a_chain_with_more_beside_it_is_what_its_own_modes_make_of_it(
    beside: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    system, until = chain(4, 1.2, beside=beside), 4
    found = run(system, start(4, 2), until)
    monkeypatch.setattr(FilippovSystem, "switched", None)
    order, initial = integrator_of(system, LOCAL_ERROR).order, start(4, 2)
    parameters = {p: sp.Rational(v) for p, v in zip(sp.symbols("F d vb", real=True), ("1", "3", "1/2"), strict=True)}
    rows = Integrator(replace(system.model, parameters=parameters), order)
    exact = tuple(sp.Rational(str(v)) for v in initial.values())
    own = rows.start(Problem(rows.system, sp.S.Zero, exact, sp.Integer(until)), tolerance=LOCAL_ERROR)
    other = Run(rows, own).to_horizon()
    told = [[(t.kind, t.surface, t.from_mode, t.to_mode) for t in each.transitions] for each in (found, other)]
    assert told[0] == told[1]
    assert len(told[0]) > 8
    assert [t.time for t in found.transitions] == pytest.approx([t.time for t in other.transitions], abs=1e-8)


def test_a_run_is_the_same_again() -> None:
    system = chain(12, 1.2)
    first, again = (run(system, start(12, 7)) for _ in range(2))
    assert in_bits(first.transitions) == in_bits(again.transitions)
    assert first.counts == again.counts


@pytest.mark.parametrize(("blocks", "static"), daily([(5, 0.0), (12, 1.2), (40, 0.0)], some=[(5, 0.0), (12, 1.2)]))
def test_modes_are_those_that_the_transitions_lead_through(blocks: int, static: float) -> None:
    """The label of each is that before it with the surface's own entry changed; velocities say which side it is."""
    system = chain(blocks, static)
    initial = start(blocks, 3)
    found = run(system, initial)
    mode = tuple(1 if initial[f"v{i}"] > 0.5 else -1 for i in range(blocks))
    assert len(found.transitions) > 5 * blocks
    for transition in found.transitions:
        assert transition.from_mode == mode
        entry = transition.to_mode[transition.surface]
        assert {"stick": entry == 0, "release": mode[transition.surface] == 0}.get(transition.kind, entry != 0)
        mode = (*mode[: transition.surface], entry, *mode[transition.surface + 1 :])
        assert transition.to_mode == mode
        for i, own in enumerate(mode):
            off = transition.state[blocks + i] - 0.5
            assert abs(off) < 1e-9 if own == 0 else (i == transition.surface or off * own > 0)
    assert found.end_mode == mode


def test_a_table_of_transitions_has_their_modes() -> None:
    system = chain(5)
    found = hr.simulate(system, start(5, 1), until=UNTIL, rtol=RTOL, dense_output=True)
    for row, transition in zip(found.transitions.itertuples(), found.trajectory.transitions, strict=True):
        for text, mode in ((row.from_mode, transition.from_mode), (row.to_mode, transition.to_mode)):
            assert text == " ".join(f"s{i}={s:+d}" if s else f"s{i}=0" for i, s in enumerate(mode))
    middle = found.trajectory.transitions[20]
    assert tuple(found.mode(middle.time).values()) == middle.to_mode  # type: ignore[union-attr]
    streamed = list(hr.stream(system, start(5, 1), until=UNTIL, rtol=RTOL))
    assert [row.to_mode for row in streamed] == found.transitions["to_mode"].tolist()


def test_a_sweep_comes_to_what_single_runs_come_to() -> None:
    system = chain(5)
    grid = {"x0": [0.1, 0.7, -1.3], "vb": [0.3, 0.5]}
    table = hr.sweep(
        system, start(5, 2), until=UNTIL, grid=grid, rtol=RTOL, jobs=1,
        observe=[hr.observe.final_state(), hr.observe.sticks(each=True)],
    )  # fmt: skip
    for row in table.itertuples():
        own = hr.simulate(system, start(5, 2) | {"x0": row.x0}, until=UNTIL, rtol=RTOL, parameters={"vb": row.vb})
        assert row.final_mode == own.final_mode
        assert tuple(getattr(row, f"final_{name}") for name in system.state) == own.trajectory.end_state
        assert row.stick_count == len(own.sticks)


@pytest.mark.parametrize("static", [0.0, 1.2])
@pytest.mark.parametrize("alike", [True, False])
def test_what_happens_at_one_instant_is_decided_for_each_contact(static: float, alike: bool) -> None:
    """A chain that is its own mirror image stays so: what one block does, its image does at the same instant."""
    initial = start(4, 5)
    initial |= {f"{x}{i}": initial[f"{x}{0 if alike else 3 - i}"] for x in "xv" for i in (1, 2, 3) if alike or i > 1}
    found = run(chain(4, static, every_other=1), initial)
    assert (found.status, found.counts.decisions) == ("ok", Decisions())
    told = [[(t.kind, t.time) for t in found.transitions if t.surface == i] for i in range(4)]
    at_once = sum(a.time == b.time for a, b in pairwise(found.transitions))
    assert at_once >= 4
    for one, other in [(0, 3), (1, 2), *([(0, 1)] if alike else [])]:
        assert len(told[one]) > 2
        assert [kind for kind, _ in told[one]] == [kind for kind, _ in told[other]]
        assert [t for _, t in told[one]] == pytest.approx([t for _, t in told[other]], abs=1e-12)


@pytest.mark.parametrize("beyond", [1e-10, 1e-12, 1e-13, -1e-10, -1e-13])
def test_a_contact_that_is_next_to_touching_does_as_it_would_alone(beyond: float) -> None:
    """Slipping with x'' = F - x from v = 0 its speed comes to ``vb + beyond``: a short slide, or none."""
    every, vb, friction = range(5), 0.5, 0.1
    many = hr.System(
        state=[f"{name}{i}" for name in "xv" for i in every],
        surfaces={f"s{i}": f"v{i} - {vb}" for i in every},
        field=[*(f"v{i}" for i in every), *(f"-x{i} - {friction}*s{i}" for i in every)],
    )
    one = hr.System(["x", "v"], surfaces={"s": f"v - {vb}"}, field=["v", f"-x - {friction}*s"])
    begin = friction - vb - beyond
    others = {f"x{i}": 0.2 + 0.05 * i for i in every} | {f"v{i}": 0.0 for i in every}
    found = run(many, others | {"x0": begin}, until=4)
    alone = run(one, {"x": begin, "v": 0.0}, until=4)
    told = [(t.kind, t.time) for t in found.transitions if t.surface == 0]
    assert [kind for kind, _ in told] == [t.kind for t in alone.transitions]
    assert len(told) == (2 if beyond > 0 else 0)
    assert [time for _, time in told] == pytest.approx([t.time for t in alone.transitions], abs=1e-9)


def test_a_sweep_starts_on_a_surface_as_a_run_does() -> None:
    system = chain(5)
    initial = start(5, 4) | {"v2": 0.5}
    own = hr.simulate(system, initial, until=UNTIL, rtol=RTOL)
    frame = hr.sweep(
        system, initial, until=UNTIL, grid={"x0": [initial["x0"]]}, rtol=RTOL, jobs=1,
        observe=[hr.observe.final_state()],
    )  # fmt: skip
    assert frame["final_mode"].tolist() == [own.final_mode]
    assert [frame[f"final_{name}"][0] for name in system.state] == list(own.trajectory.end_state)


def test_a_mode_is_put_together_as_it_would_be_written_out() -> None:
    system = chain(5, 1.2)
    integrator, model = integrator_of(system, LOCAL_ERROR), system.model
    values = {"F": 1, "d": 3, "vb": Fraction(1, 2)}
    given = tuple(values[symbol.name] for symbol in integrator.parameters)
    begin = integrator.begin(given, [*start(5, 1).values()], until=UNTIL, tolerance=1e-10)
    own, table = Run(integrator, begin, block=1), integrator.mode_table
    at = kernel.places_of(*table.sizes)
    seen = 0
    while isinstance(own.next_event(), Transition):
        seen += 1
        record = own.workspace.block[at.own : at.constants].view(mode_dtype(table.most_guards))[0]
        for guard, found in zip(table.guards(own.mode), record["guards"], strict=False):
            slip = guard.kind == "surface"
            assert (found["index"], found["side"]) == (guard.index, own.mode[guard.index] if slip else 0)
            assert found["hold_zone"] == (slip and guard.index in model.overrides)
            assert found["mode_across"] == guard.to_sign + 1
            assert found["kind"] == (kernel.SURFACE if slip else kernel.RELEASE)
        constants = own.workspace.block[at.constants : at.records].reshape(len(table.codes[0].tapes), -1)
        for tape, found in zip(table.codes[0].tapes, constants, strict=True):
            exact = [float(model.numeric(tape.constant(k, own.mode))) for k in range(len(tape.tape.constants))]
            assert found[: len(exact)].tolist() == exact
    assert seen > 30


def test_any_corner_is_decided_as_in_python() -> None:
    """Contacts i that are reached at once, with x_i' = a_i + b_i s_i for any numbers: these are states that rest."""
    every = range(6)
    system = hr.System(
        state=[f"{name}{i}" for name in "xab" for i in every],
        surfaces={f"s{i}": f"x{i}" for i in every},
        field=[*(f"a{i} + b{i}*s{i}" for i in every), *("0" for _ in (*every, *every))],
    )
    integrator, random, clear = integrator_of(system, LOCAL_ERROR), np.random.default_rng(6), 0
    table = integrator.mode_table
    for _ in range(120):
        numbers = [*random.integers(-6, 7, 6) / 2, *random.integers(-4, 2, 6).astype(float)]  # ties are frequent
        mode = tuple(random.choice([-1, 0, 1], 6, p=[0.4, 0.2, 0.4]).tolist())
        hit = [i for i in every if mode[i] and random.random() < 0.8]
        if len(hit) < 2:
            continue
        x = [*(0.0 for _ in every), *map(float, numbers)]
        begin = integrator.begin((), [1.0] * 18, until=1.0, tolerance=1e-6)
        own = Run(integrator, begin)
        own.until, own.x[:], own.row = (0.0, 0.0), x, table.row(mode) or 0
        own.hits[: len(table.guards(mode))] = [g.kind == "surface" and g.index in hit for g in table.guards(mode)]
        own.scalars.guard, own.scalars.event_pending = 2 * hit[0], 1
        code = kernel.advance(own.workspace.run, begin.constants.update().tables, ffi.NULL, 0)
        asked = [g for g in table.guards(mode) if g.kind == "surface" and g.index in hit]
        theirs = after_event(begin.constants.in_doubles.at(0.0, x), mode, asked)
        assert code in (kernel.HORIZON, kernel.SELECT_MODE)
        assert code != kernel.HORIZON or (theirs.status, theirs.mode) == ("unique", own.mode), (numbers, mode, hit)
        assert code == kernel.HORIZON or own.mode == mode
        clear += code == kernel.HORIZON
    assert clear >= 20


@pytest.mark.parametrize("contacts", [1, 4, 31, 32, 33, 64, 100])
def test_a_mode_is_read_as_it_was_written(contacts: int) -> None:
    rng = np.random.default_rng(contacts)
    modes = [tuple(row) for row in rng.integers(-1, 2, (6, contacts)).tolist()]
    rows = np.array([written(packed(mode), contacts) for mode in modes])
    assert rows.shape == (6, words_of(contacts))
    assert [unpacked(read(row.tobytes()), contacts) for row in rows] == modes
    different, at = numbered(rows[[0, 3, 0]], contacts)
    assert [different[k] for k in at] == [modes[0], modes[3], modes[0]]
