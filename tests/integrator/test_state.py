"""A run's state, and other records that the compiled loop and Python share: one description, the header's."""

from __future__ import annotations

import numpy as np
import pytest
from problems import make_problem

from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.records import TRANSITION, step_dtype, transition_dtype
from henon_ref.integrator.run import Run
from henon_ref.kernel.library import ffi, kernel, record_dtype


def test_one_library_serves_every_size() -> None:
    """The record holds scalars only: its type does not depend on the number of states."""
    for n in (1, 2, 16):
        names = [f"x{i}" for i in range(n)]
        problem = make_problem(" ".join(names), ["t - s"] + ["-x0"] * (n - 1), {"s": "x0"}, [0] * n, 3)
        integrator = Integrator(problem.system, 8)
        found = Run(integrator, integrator.start(problem, tolerance=1e-6)).to_horizon()
        assert (found.status, len(found.end_state)) == ("ok", n)


@pytest.mark.parametrize("name", ["run", "mode", "guard", "transition", "step", "slot", "end"])
def test_numpy_sees_a_record_as_c_does(name: str) -> None:
    """Each field has the place and the bytes that the compiler gives it."""
    record = record_dtype(name)
    assert record.itemsize == ffi.sizeof(f"struct {name}")
    row = np.zeros(1, dtype=record)
    there = ffi.cast(f"struct {name} *", ffi.from_buffer(row))
    for number, field in enumerate(record.names or (), start=1):
        if not isinstance(getattr(there, field), ffi.CData):  # an address
            setattr(there, field, number)
            assert row[0][field] == number, field
            assert (np.frombuffer(row, dtype=np.uint8) != 0).any()


def test_counts_and_places_are_integers_and_times_doubles() -> None:
    run = record_dtype("run")
    assert (run["steps"], run["mode"], run["dense"]) == (np.int64, np.int64, np.int64)
    assert (run["time"], run["tolerance"], TRANSITION["time_low"]) == (np.float64,) * 3


def test_what_stands_behind_a_record_begins_where_c_has_it() -> None:
    assert transition_dtype(3).fields["state"][1] == ffi.offsetof("struct transition", "state")  # type: ignore[index]
    assert step_dtype(3, 8).fields["coefficients"][1] == ffi.offsetof("struct step", "coefficients")  # type: ignore[index]
    assert transition_dtype(3).itemsize == 8 * kernel.places_of(3, 4, 8, 0, 0).record_width


@pytest.mark.parametrize(("states", "guards", "order"), [(1, 2, 4), (2, 7, 18), (16, 40, 24)])
def test_parts_of_a_block_do_not_overlap(states: int, guards: int, order: int) -> None:
    own = kernel.places_of(states, guards, order, 0, 0)
    begins = [own.last_steps, own.state, own.known_zeros, own.since, own.end_of_state, own.band, own.room]
    begins += [own.remembered, own.records, own.size]
    assert begins == sorted(begins)
    assert own.since - own.known_zeros == 3 * guards
    assert own.records - own.remembered >= 64
    assert own.size - own.records == 1024 * (4 + states)
