"""Commands ``explain`` and ``compare --check``: explain case files without a run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path

import sympy as sp

from henon_ref.casefile.case import Case, Reading
from henon_ref.commands import Cases, application, examples
from henon_ref.commands.exit_status import DONE, command_of
from henon_ref.errors import ModelError
from henon_ref.expressions.traversal import is_longer
from henon_ref.harness.campaign.options import load_cases
from henon_ref.harness.table import count
from henon_ref.modes.latex import MOST_IN_ALL, MOST_IN_CELL, MOST_MODES, TOO_LONG
from henon_ref.modes.mode import Mode, mode_text
from henon_ref.modes.system import FilippovSystem
from henon_ref.text import listed, message

MAX_NAMED = 8
"""Largest number of states, surfaces or solvers named in one line."""

app = application()


@app.command(epilog=examples("explain fig8", "explain my_case.yaml"))
def main(cases: Cases) -> int:
    """Explain case files without a run: states, surfaces, jumps, effects, and the equations of each mode."""
    explain(cases)
    return DONE


command = command_of(app, "explain")


def explain(paths: Sequence[Path]) -> None:
    """Print the explanation of case files; CaseError if a file is invalid, and nothing is printed then."""
    for case in load_cases(paths):
        for line in explanation(case):
            print(line[: len(line) - len(line.lstrip(" "))] + message(line))  # a clean line with its indent


def explanation(case: Case) -> Iterator[str]:
    """Yield the indented lines that explain a case; equations shared by several readings appear once."""
    file = f" ({case.path})" if case.path else ""
    yield f"{case.name}: {case.title}{file}, {count(len(case.readings), 'reading')}"
    explained: list[Reading] = []
    for reading in case.readings:
        yield f"  reading {reading.name}: {reading.title}"
        yield from (f"    {line}" for line in _run(reading))
        alike = next((other for other in explained if _same(other.problem.system, reading.problem.system)), None)
        if alike is not None:
            yield f"    equations as in {alike.name}"
            continue
        explained.append(reading)
        yield from (f"    {line}" for line in _model(reading.problem.system))


def _run(reading: Reading) -> Iterator[str]:
    """Yield the lines on a reading: start, horizon, parameters, solvers, tolerances and gate."""
    problem = reading.problem
    system = problem.system
    values = [f"{x.name} = {_text(v)}" for x, v in zip(system.states, problem.initial, strict=True)]
    yield f"from t = {_text(problem.start)} to t = {_text(problem.until)} s, start {listed(values, MAX_NAMED)}"
    if system.parameters:
        given = [f"{name.name} = {_text(value)}" for name, value in system.parameters.items()]
        yield f"parameters: {listed(given, 2 * MAX_NAMED)}"
    yield f"solvers: {listed(reading.solvers) if reading.solvers else 'the default solvers'}"
    yield f"relative tolerances: {listed([f'{value:g}' for value in reading.tolerances])}"
    if reading.gate:
        yield f"gate on {listed(list(reading.gate))}"


def _model(system: FilippovSystem) -> Iterator[str]:
    yield f"{count(len(system.states), 'state')}: {listed(system.state_names, MAX_NAMED)}"
    yield f"effects: {listed(system.effects) if system.effects else 'none named, the system is written out'}"
    yield f"{count(len(system.surfaces), 'surface')}:"
    for name, surface in list(zip(system.sign_names, system.surfaces, strict=True))[:MAX_NAMED]:
        yield f"  {name} = sign of {_text(surface)}"
    for index, reset in sorted(system.resets.items())[:MAX_NAMED]:
        jumps = [f"{state} -> {_text(value)}" for state, value in reset.map.items()]
        first = f" (priority {reset.priority:g})" if reset.priority else ""
        name = system.sign_names[index]
        yield f"  where the surface of {name} falls through 0, jump: {listed(jumps, MAX_NAMED)}{first}"
    for valid in system.valid:
        yield f"the model holds while {_text(valid)} > 0"
    total = 3 ** len(system.surfaces)
    if is_longer((*system.field, *system.surfaces), MOST_IN_ALL):
        yield f"{total} modes, whose equations are {TOO_LONG}"
        return
    modes = _modes(system)
    shown = "" if len(modes) == total else f", {len(modes)} of them below"
    yield f"{total} modes (-1 and +1: slip, 0: sliding){shown}"
    for mode in modes:
        yield from (f"  {line}" for line in _mode(system, mode))


def _modes(system: FilippovSystem) -> list[Mode]:
    """Return all modes if they are few; else the mode of slip with all signs +1, and sliding on each surface."""
    surfaces = len(system.surfaces)
    if 3**surfaces <= MOST_MODES:
        return list(product((-1, 0, 1), repeat=surfaces))
    slip: Mode = (1,) * surfaces
    return [slip, *((*slip[:i], 0, *slip[i + 1 :]) for i in range(min(surfaces, MOST_MODES - 1)))]


def _mode(system: FilippovSystem, mode: Mode) -> Iterator[str]:
    """Yield the equations of one mode, and the conditions of its releases."""
    yield f"{'sliding' if 0 in mode else 'slip'}, {mode_text(mode, system.sign_names)}"
    try:
        equations = system.equations(mode)
    except ModelError as error:
        yield f"  {error}"
        return
    for state, rate in list(zip(system.state_names, equations.field, strict=True))[:MAX_NAMED]:
        yield f"  {state}' = {_text(rate)}"
    if len(system.states) > MAX_NAMED:
        yield f"  and {len(system.states) - MAX_NAMED} more"
    for index, sign in equations.equivalent_signs.items():
        yield f"  equivalent sign {system.sign_names[index]} = {_text(sign)}"
    for guard in equations.guards:
        if guard.kind == "release":
            side = f"{system.sign_names[guard.index]} = {guard.to_sign:+d}"
            yield f"  released to {side} where {_text(guard.expression)} falls through 0"


def _same(one: FilippovSystem, other: FilippovSystem) -> bool:
    return all(
        getattr(one, name) == getattr(other, name)
        for name in ("states", "surfaces", "field", "valid", "overrides", "resets", "effects")
    )


def _text(expression: sp.Expr) -> str:
    return f"({TOO_LONG})" if is_longer(expression, MOST_IN_CELL) else str(expression)
