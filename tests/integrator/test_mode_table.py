"""Tables of compiled modes: a mode costs its own row, and no reader is led past what it has."""

from __future__ import annotations

import numpy as np
from runs import constants_of
from test_contacts import chain

import henon_ref as hr
from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.mode_table import ModeTable
from henon_ref.kernel.library import kernel
from henon_ref.modes.mode import Mode


def test_a_row_is_that_of_the_mode_written_out() -> None:
    model = chain(3).model
    integrator = Integrator(model, 8)
    table = integrator.mode_table
    modes = [(1, -1, 0), (0, -1, 0), (1, -1, 1), (1, 0, 0)]
    for mode in modes:
        table.row(mode)
    index: dict[Mode, int] = {mode: row for row, mode in enumerate(modes)}
    compiled, constants = (
        table.compiled,
        integrator.constants(tuple(model.parameters[p] for p in integrator.parameters)).update(),
    )
    for row, mode in enumerate(modes):
        own = compiled.records["guards"][row]
        for g, guard in enumerate(table.guards(mode)):
            sides = {s: index.get((*mode[: guard.index], s, *mode[guard.index + 1 :]), -1) for s in (-1, 0, 1)}
            assert (own["index"][g], own["side"][g]) == (
                guard.index,
                mode[guard.index] if guard.kind == "surface" else 0,
            )
            if guard.kind == "surface":
                assert (own["mode_across"][g], own["mode_stuck"][g]) == (sides[-mode[guard.index]], sides[0])
            elif mode[guard.index] == 0:
                assert own["mode_across"][g] == sides[guard.to_sign]
        for tape, found in zip(table.codes[row].tapes, constants_of(constants)[row], strict=True):
            exact = [float(model.numeric(tape.constant(at, mode))) for at in range(len(tape.tape.constants))]
            assert found[: len(exact)].tolist() == exact


def test_whoever_reads_is_not_led_to_rows_that_he_does_not_have() -> None:
    table = ModeTable(chain(3).model, 8)
    table.row((1, 1, 1))
    read = table.compiled.records
    before = read.copy()
    table.row((0, 1, 1))
    assert np.array_equal(read, before)
    assert table.leads_to(0, 0, 0) == 1
    table.row((1, 0, 1))
    assert table.leads_to(0, 1, 0) == 2


def test_what_ends_a_run_is_noted_at_its_own_place() -> None:
    """A guard that ends the run is a surface's or a valid expression's: its place among those below rounding."""
    system = hr.System(["x", "y"], {}, {"s": "x", "u": "y"}, ["(t - 1)*s", "s/10 - u"], valid=["2 - t", "3 - x"]).model
    table = ModeTable(system, 8)
    table.row((0, 0))
    own = table.compiled.records["guards"][0]
    found = {(guard.kind, guard.index): int(own["valid"][g]) for g, guard in enumerate(table.guards((0, 0)))}
    assert {key: valid for key, valid in found.items() if key[0] != "release"} == {
        ("attracts", 0): 0, ("valid", 0): 1, ("valid", 1): 1,
    }  # fmt: skip
    assert all(own["kind"][g] == kernel.VALID for g, guard in enumerate(table.guards((0, 0))) if guard.ends)
