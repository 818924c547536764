"""Model of a reading in markdown: equations of every mode, parameters, start and horizon, and effects of a scene."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from math import log2

import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.grouping import grouped
from henon_ref.harness.campaign.comparison import ReadingResult
from henon_ref.harness.table import Table
from henon_ref.integrator.integrator import local_error, order_for
from henon_ref.jit.ir_writer import count
from henon_ref.modes.kinks import continuous
from henon_ref.modes.latex import (
    MOST_MODES,
    TOO_LONG,
    aligned,
    derivative,
    few,
    general_form,
    latex,
    printable,
    symbol,
)
from henon_ref.modes.mode import Mode, mode_text
from henon_ref.modes.resets import REMAINING, impact_of, never_pressed
from henon_ref.modes.system import FilippovSystem
from henon_ref.system.assembly import Scene
from henon_ref.taylor.llvm.expansion import expansion_ir
from henon_ref.taylor.tape import TIME, Tape, build_tape
from henon_ref.text import markdown


def model_text(result: ReadingResult) -> str:
    """Return the model without values, which is equal for readings that differ only in values."""
    system, effects = result.reading.problem.system, effect_table(result)
    blocks = ["Effects of the scene (no others are compiled):", effects[0].markdown, effects[1]] if effects else []
    blocks += [_displayed(general_form(system)), _listed(as_written(system))]
    blocks.append(_listed([*kink_notes(system), *reset_notes(system)]))
    for mode in modes_of(result):
        title, equations, notes = mode_equations(system, mode)
        blocks += [f"{title}:", _displayed(equations), _listed(notes)]
    return "\n\n".join(filter(None, blocks))


def _displayed(formula: str) -> str:
    return f"$$\n{formula}\n$$" if formula else ""


def _listed(lines: Sequence[str]) -> str:
    return "\n".join(f"- {line}" for line in lines)


def as_written(system: FilippovSystem) -> list[str]:
    """Return the expressions that :func:`general_form` omits, as written in the case file, in markdown."""
    parts = [(f"{x.name}' = ", x, f) for x, f in zip(system.states, system.field, strict=True)]
    parts += [(f"{s.name} = sign of ", s, h) for s, h in zip(system.signs, system.surfaces, strict=True)]
    every = not few([*system.field, *system.surfaces])
    return [
        f"`{start}{' '.join(system.written.get(x, f'({TOO_LONG})').split())}`"
        for start, x, expression in parts
        if every or not printable(expression)
    ]


def kink_notes(system: FilippovSystem) -> list[str]:
    """Return notes on surfaces that are sections or kinks, or across which the field is continuous."""
    smooth = continuous(system)
    notes = []
    for index, name in enumerate(system.sign_names):
        if index in system.observed - system.kinks:
            notes.append(f"`{name}`: a section; no force depends on its sign, and it is always crossed")
        elif index in smooth:
            notes.append(f"`{name}`: a kink of a continuous field; it is always crossed, without sliding")
        elif index in system.kinks and any(rate.has(system.signs[index]) for rate in system.field):
            notes.append(f"`{name}`: a jump of the field")
    return notes


def reset_notes(system: FilippovSystem) -> list[str]:
    notes = []
    for index, reset in sorted(system.resets.items()):
        values = [(x, value) for x, value in reset.map.items() if printable(value)]
        lines = ", ".join(f"${symbol(x.name)}^+ = {latex(value)}$" for x, value in values)
        lines += "" if len(values) == len(reset.map) else f" (a value is {TOO_LONG})"
        note = f"`{system.sign_names[index]}`: when it falls through zero, the state jumps: {lines}"
        impact, part = impact_of(system, index), f"2^{log2(REMAINING):.0f}"
        note += f" (priority {reset.priority:g})" if reset.priority else ""
        if impact is not None and index not in never_pressed(system):
            note += f"; impacts are reported until all later ones last less than {part} of the run, then "
            note += f"the run ends: {impact.refusal}" if impact.refusal else "the body rests"
        notes.append(note)
    return notes


def modes_of(result: ReadingResult) -> list[Mode]:
    """Return the modes that the exact run visits, or all modes of a single surface (a section has no stick)."""
    system = result.reading.problem.system
    if len(system.surfaces) == 1:
        return [(-1,), (1,)] if system.observed else [(-1,), (0,), (1,)]
    events = result.expected.transitions if result.expected else ()
    visited = dict.fromkeys(tuple(mode) for event in events for mode in (event.from_mode, event.to_mode))
    return list(visited)[:MOST_MODES]


def mode_equations(system: FilippovSystem, mode: Mode) -> tuple[str, str, list[str]]:
    """Return the title of a mode, its field as LaTeX, and notes on equivalent signs and the ends of sliding."""
    title = f"{'Stick' if 0 in mode else 'Slip'}, `{mode_text(mode, system.sign_names)}`"
    try:
        equations = system.equations(mode)
    except ModelError as error:
        return title, "", [markdown(str(error))]
    releases = [guard for guard in equations.guards if guard.kind == "release"]
    shown = [*equations.field, *equations.equivalent_signs.values(), *(guard.expression for guard in releases)]
    if not (few(shown) and all(map(printable, shown))):
        return title, "", [f"its equations are {TOO_LONG}"]
    signs = [symbol(sign.name) for sign in system.signs]
    notes = [f"equivalent sign ${signs[k]} = {latex(value)}$" for k, value in equations.equivalent_signs.items()]
    for guard in releases:
        sides = ", ".join(f"{signs[i]} = {side:+d}" for i, side in guard.cut or ((guard.index, guard.to_sign),))
        notes.append(f"left to ${sides}$ where ${latex(guard.expression)}$ falls through 0")
    held = "entered whenever the surface is reached while these guards are positive, whatever the slip fields"
    notes += [held for index, entry in enumerate(mode) if entry == 0 and system.held_inside(index)]
    lines = [derivative(x, f) for x, f in zip(system.states, equations.field, strict=True)]
    return title, aligned(lines), notes


def parameters(result: ReadingResult) -> list[str]:
    """Format ``name = exact value (decimal)`` of every parameter, initial value and the horizon as LaTeX."""
    problem = result.reading.problem
    start = f"({latex(problem.start)})" if problem.start != 0 else "(0)"
    values = {symbol(s.name): value for s, value in problem.system.parameters.items()}
    initial = zip(problem.system.states, problem.initial, strict=True)
    values |= {f"{symbol(x.name)}{start}": value for x, value in initial}
    values[f"{symbol(TIME.name)}_{{\\mathrm{{end}}}}"] = problem.until
    return [f"${name} = {_value(value)}$" for name, value in values.items()]


def _value(value: sp.Expr) -> str:
    """Format an exact number, with a decimal approximation if it is not a short decimal."""
    decimal = float(value)
    if not printable(value):
        return f"{decimal:.10g}"
    if value.is_Rational and sp.Rational(f"{decimal:g}") == value:
        return f"{decimal:g}"
    return f"{latex(value)} \\approx {decimal:.10g}"


MOST_ROWS = 24
"""Largest number of connections with one row each; beyond it there is one row per kind."""


def effect_table(result: ReadingResult) -> tuple[Table, str] | None:
    """Make the table of the effects of a reading's scene, and the text on its columns; None if there is no scene."""
    scene = result.reading.scene
    if scene is None or not scene.connections:
        return None
    order = order_for(local_error(min(result.reading.tolerances)))
    whole = _work(scene.system(), order)
    rows = []
    for label, numbers in _effects(scene):
        rest = _work(scene.without(numbers).system(), order)
        saved, floating = whole[0] - rest[0], whole[1] - rest[1]
        rows.append((f"`{label}`", str(saved), str(floating), f"{100 * floating / whole[1]:.0f} %"))
    rows.append(("*all*", str(whole[0]), str(whole[1]), "100 %"))
    explained = (
        "Operations saved if the effect is left out: on the tape of slip, and in the machine code of one Taylor "
        f"expansion of order {order}. Operations shared by two effects count for neither."
    )
    return Table(("effect", "operations", "floating-point operations a step", "of all"), "lrrr", rows), explained


def _effects(scene: Scene) -> list[tuple[str, list[int]]]:
    if len(scene.connections) <= MOST_ROWS:
        return [(connection.label, [number]) for number, connection in enumerate(scene.connections)]
    kinds = grouped(range(len(scene.connections)), lambda number: scene.connections[number].kind)
    return [(f"{kind} ({len(numbers)} of them)", numbers) for kind, numbers in kinds.items()]


def _work(system: FilippovSystem, order: int) -> tuple[int, int]:
    """Count the operations on the tape of slip, and the floating-point operations of its expansion."""
    tape = mode_tape(system)
    return operations(tape), count(expansion_ir(tape, len(system.states), order, "expansion"))


def mode_tape(system: FilippovSystem, sliding: Collection[int] = ()) -> Tape:
    """Return the tape of the modes that slide on some surfaces; default: slip."""
    equations = system.shared_equations(frozenset(sliding))
    return build_tape(system.states, equations.field, [guard.expression for guard in equations.guards])


def operations(tape: Tape) -> int:
    """Count the operations on a tape, without reads of states and constants."""
    return sum(number for name, number in tape.counts.items() if name not in ("state", "constant"))
