"""Hashes of the LLVM IR of the Taylor coefficients of every mode of the suite; comparison of two records.

    python -m tests.support.ir dump RECORD [--only fig8,hard] [--orders 1,4,7,12,24]
    python -m tests.support.ir compare RECORD RECORD

A refactoring of ``henon_ref/taylor/llvm`` or ``henon_ref/jit/ir_writer`` is right if no hash changes: the same text is
the same machine code, and no run need be made. ``compare`` ends with status 1 where one differs, and names it.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from hashlib import sha256
from itertools import combinations
from pathlib import Path

import sympy as sp

from henon_ref.casefile.case import load_case
from henon_ref.casefile.files import yaml_files
from henon_ref.errors import ModelError
from henon_ref.jit.ir_writer import row_length
from henon_ref.modes.decoupled_contacts import switched_equations
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.llvm.expansion import expansion_ir
from henon_ref.taylor.llvm.step import step_end_ir
from henon_ref.taylor.tape import TIME, Tape, build_tape

CASES = Path(__file__).parents[2] / "cases"
ORDERS = (1, 4, 7, 12, 24)
"""Scalar code below 8, vectors from 8 on; 12 and 24 are what runs use at 1e-6 and 1e-12."""
MOST_SURFACES = 3
"""With more surfaces all modes share one machine code, where their contacts allow it."""

Record = dict[str, tuple[str, int]]
"""By ``case.reading mode@order`` the hash of the text and its number of lines."""


def record(only: Collection[str] = (), orders: Sequence[int] = ORDERS) -> Record:
    """Hashes of the code of all modes of the suite; a system that several readings share is written once."""
    found: Record = {}
    seen: set[str] = set()
    for path in yaml_files(CASES):
        if only and path.stem not in only and path.parent.name not in only:
            continue
        case = load_case(path)
        for reading in case.readings:
            for mode, states, tape in tapes(reading.problem.system):
                what = f"{states} {tape}"
                if what in seen:
                    continue
                seen.add(what)
                for order in orders if tape.field else (0,):
                    found[f"{case.name}.{reading.name} {mode}@{order}"] = _written(tape, states, order)
    for at, tape in enumerate(every_operation()):
        for order in (0, *orders):
            found[f"every operation {at}@{order}"] = _written(tape, 2, order)
    return found


def _written(tape: Tape, states: int, order: int) -> tuple[str, int]:
    shortest = 4
    text = expansion_ir(tape, states, order, "f", None if order >= shortest else row_length(shortest))
    if order >= shortest:
        text += step_end_ir(states, len(tape.outputs), order, "g")
    return sha256(text.encode()).hexdigest()[:20], text.count("\n")


def tapes(system: FilippovSystem) -> Iterator[tuple[str, int, Tape]]:
    """Name, number of states and tape of each mode's equations, and of the normal velocities."""
    n, surfaces = len(system.states), len(system.surfaces)
    inputs = (*system.states, *system.signs)
    yield "normals", len(inputs), build_tape(inputs, (), [system.normal_velocity(i) for i in range(surfaces)])
    switched = switched_equations(system) if surfaces > MOST_SURFACES else None
    if switched is not None:
        yield "switched", n, build_tape(system.states, switched.field, switched.outputs)
        return
    for many in range(min(surfaces, MOST_SURFACES) + 1):
        for sliding in combinations(range(surfaces), many):
            with suppress(ModelError):  # such a mode has no equations
                equations = system.shared_equations(frozenset(sliding))
                outputs = [guard.expression for guard in equations.guards]
                yield f"sliding {sliding}", n, build_tape(system.states, equations.field, outputs)


def every_operation() -> list[Tape]:
    """Tapes that hold, between them, every operation that a tape can have: the suite's cases do not."""
    x, y = sp.symbols("x y", real=True)
    t, third = TIME, sp.Rational(1, 3)
    functions = [
        sp.exp(-x / 3) + sp.log(2 + x**2) + sp.sin(x) * sp.cos(y) + sp.sinh(x) * sp.cosh(y),
        sp.tan(x / 4) + sp.tanh(y) + sp.atan(x * y) + sp.asin(x / 5) - sp.acos(y / 7),
        sp.sqrt(3 + x) / sp.sqrt(3 + x * y) + (2 + x) ** third + (x - 1) / (y + 3) ** 2 + 1 / (1 + y),
        t**2 * sp.sin(3 * t + 1) + 5 * sp.cos(t) + (x + y) ** 5 / 5 - x**3 + 3 * sp.exp(t) + (1 + t) ** third,
        7 / (2 + y) + (y - sp.sin(t)) ** 3 * x + (1 + x**2) ** y,
    ]
    tapes = [build_tape((x, y), [f, x - y], [x * f]) for f in functions]
    return [*tapes, build_tape((x, y), [2 * y, sum(functions)], [x - 2 * y, *functions])]


def differing(one: Record, other: Record) -> list[str]:
    """Names whose texts are not the same in two records, or that one of them lacks."""
    return sorted(name for name in one.keys() | other.keys() if one.get(name) != other.get(name))


def main() -> int:
    """Command line; see the docstring of the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    dump = commands.add_parser("dump")
    dump.add_argument("record", type=Path)
    dump.add_argument("--only", default="")
    dump.add_argument("--orders", default=",".join(map(str, ORDERS)))
    beside = commands.add_parser("compare")
    beside.add_argument("records", type=Path, nargs=2)
    given = parser.parse_args()
    if given.command == "dump":
        only = [name for name in given.only.split(",") if name]
        found = record(only, [int(order) for order in given.orders.split(",")])
        given.record.write_text(json.dumps(found, indent=1))
        print(f"{len(found)} texts, {sum(lines for _, lines in found.values())} lines: {given.record}")
        return 0
    one, other = (json.loads(path.read_text()) for path in given.records)
    names = differing(one, other)
    print("\n".join([f"{len(one.keys() | other.keys())} texts, {len(names)} differ", *names]))
    return int(bool(names))


if __name__ == "__main__":
    sys.exit(main())
