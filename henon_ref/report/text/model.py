"""The model as formulas: equations of every mode, parameters, start and horizon."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from henon_ref.campaign.results import ReadingResult
from henon_ref.errors import ModelError
from henon_ref.filippov.latex import latex, symbol
from henon_ref.filippov.modes import Mode, mode_text
from henon_ref.filippov.system import FilippovSystem
from henon_ref.taylor.size import size, total_size
from henon_ref.taylor.tape import TIME
from henon_ref.text import markdown

MOST_MODES = 9
"""Modes whose equations are printed."""
MOST_OPERATIONS, MOST_IN_ALL = 500, 2_500
"""Operations up to which an expression, and all that stand together, are set as formulas: a printer sorts their terms,
and asks of each many questions."""


@dataclass(frozen=True)
class ModeText:
    """One mode's equations."""

    title: str
    equations: str
    """LaTeX of the field."""
    notes: list[str]
    """LaTeX of equivalent signs and of what ends a sliding mode."""


def general_form(system: FilippovSystem) -> str:
    """The field with its sign symbols, and the surfaces, as LaTeX; without those that are too long for it."""
    lines = [_derivative(x, f) for x, f in zip(system.states, system.field, strict=True) if _printable(f)]
    for sign, surface in zip(system.signs, system.surfaces, strict=True):
        if _printable(surface):
            lines.append(rf"{symbol(sign.name)} &= \operatorname{{sgn}}\left({latex(surface)}\right)")
    return _aligned(lines) if lines and _few([*system.field, *system.surfaces]) else ""


def as_written(system: FilippovSystem) -> list[str]:
    """What :func:`general_form` leaves out, as the case file has it, in markdown."""
    pairs = [(f"{x.name}' = ", x, f) for x, f in zip(system.states, system.field, strict=True)]
    pairs += [(f"{s.name} = sign of ", s, h) for s, h in zip(system.signs, system.surfaces, strict=True)]
    every = not _few([*system.field, *system.surfaces])
    left_out = [
        (start, system.written.get(x, "(too long to be printed)"))
        for start, x, e in pairs
        if every or not _printable(e)
    ]
    return [f"`{start}{' '.join(text.split())}`" for start, text in left_out]


def _printable(expression: sp.Expr) -> bool:
    return size(expression, MOST_OPERATIONS) <= MOST_OPERATIONS


def _few(expressions: Sequence[sp.Expr]) -> bool:
    """Whether expressions have few enough operations, all together, to be printed."""
    return total_size((e for e in expressions if _printable(e)), MOST_IN_ALL) <= MOST_IN_ALL


def modes_of(result: ReadingResult) -> list[Mode]:
    """The modes that the exact run visits, or all of a single surface."""
    system = result.reading.problem.system
    visited: dict[Mode, None] = {}
    for event in result.expected.transitions if result.expected else ():
        visited.setdefault(tuple(event.from_mode))
        visited.setdefault(tuple(event.to_mode))
    if len(system.surfaces) == 1:
        return [(-1,), (0,), (1,)]
    return list(visited)[:MOST_MODES]


def mode_equations(system: FilippovSystem, mode: Mode) -> ModeText:
    """The equations of one mode as LaTeX."""
    title = f"{'Stick' if 0 in mode else 'Slip'}, `{mode_text(mode, system.sign_names)}`"
    try:
        equations = system.equations(mode)
    except ModelError as error:
        return ModeText(title, "", [markdown(str(error))])
    shown = [*equations.field, *equations.equivalent_signs.values()]
    shown += [guard.expression for guard in equations.guards if guard.kind == "release"]
    if not (_few(shown) and all(map(_printable, shown))):
        return ModeText(title, "", ["its equations are too long to be printed"])
    lines = [_derivative(x, f) for x, f in zip(system.states, equations.field, strict=True)]
    notes = []
    for index, value in equations.equivalent_signs.items():
        notes.append(f"equivalent sign ${symbol(system.signs[index].name)} = {latex(value)}$")
    for guard in equations.guards:
        if guard.kind == "release":
            name = symbol(system.signs[guard.index].name)
            notes.append(f"left to ${name} = {guard.to_sign:+d}$ where ${latex(guard.expression)}$ falls through 0")
    for index, entry in enumerate(mode):
        if entry == 0 and system.held_inside(index):
            notes.append("entered wherever the surface is reached with these positive, whatever the slip fields do")
    return ModeText(title, _aligned(lines), notes)


def _derivative(state: sp.Symbol, rate: sp.Expr) -> str:
    return rf"\dot{{{symbol(state.name)}}} &= {latex(rate)}"


def _aligned(lines: list[str]) -> str:
    return "\\begin{aligned}\n" + " \\\\\n".join(lines) + "\n\\end{aligned}"


def parameters(result: ReadingResult) -> list[str]:
    """``name = exact value (decimal)`` of every parameter, the start and the horizon, as LaTeX."""
    problem = result.reading.problem
    pairs = [(symbol(s.name), value) for s, value in problem.system.parameters.items()]
    start = f"({latex(problem.start)})" if problem.start != 0 else "(0)"
    pairs += [
        (f"{symbol(x.name)}{start}", value) for x, value in zip(problem.system.states, problem.initial, strict=True)
    ]
    pairs.append((f"{symbol(TIME.name)}_{{\\mathrm{{end}}}}", problem.until))
    return [f"${name} = {_value(value)}$" for name, value in pairs]


def _value(value: sp.Expr) -> str:
    """An exact number, with its decimals where they are not plain to see."""
    if size(value, MOST_OPERATIONS) > MOST_OPERATIONS:
        return f"{float(value):.10g}"
    if value.is_Rational:
        decimal = float(value)
        return f"{decimal:g}" if sp.Rational(f"{decimal:g}") == value else f"{latex(value)} \\approx {decimal:.10g}"
    return f"{latex(value)} \\approx {float(value):.10g}"
