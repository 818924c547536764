"""The equations of a problem as C: what a user of CVODE writes by hand, made from the text of a request.

Values of parameters and numbers of the run are no part of it: readings of a case that differ in them share one program.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from henon_ref.baselines.protocol.messages import Guard, Mode, Problem
from henon_ref.baselines.protocol.text import renamed

ARGUMENTS = "double t, const double *x, const double *p"
SILENT = "    (void)t, (void)x, (void)p, (void)out;"
CODES = {"nonunique": "NONUNIQUE", "invalid": "INVALID"}
HEAD = """/* Made by henon_ref from the text of a request. */
#pragma once
#include <math.h>

enum {{ STATES = {states}, PARAMETERS = {parameters}, MODE_COUNT = {modes}, MOST_GUARDS = {guards} }};
enum {{ NONUNIQUE = 2, INVALID = 3, NONE = 4 }};
typedef enum {{ SURFACE, RELEASE, VALID }} Kind;
typedef void Function(double, const double *, const double *, double *);

typedef struct {{
    int mode, unknowns, guards;
    int surface_guard; /* index of the guard that is the surface; -1: none */
    int unarmed;       /* guards that may begin negative, one bit each */
    Kind kinds[MOST_GUARDS];
    Function *field, *jacobian, *values, *start;
    int (*successor)(int, double, const double *, const double *);
}} ModeTable;
"""


def c_equations(problem: Problem) -> str:
    """The header ``problem.h`` of the C program."""
    names = {name: f"x[{k}]" for k, name in enumerate(problem.states)}
    names |= {name: f"p[{k}]" for k, name in enumerate(problem.parameters)}
    head = HEAD.format(
        states=len(problem.states),
        parameters=len(problem.parameters),
        modes=len(problem.modes),
        guards=max(1, *(len(mode.guards) for mode in problem.modes)),
    )
    surface = [
        f"static double surface({ARGUMENTS})\n{{\n    (void)t, (void)x, (void)p;\n"
        f"    return {renamed(problem.surface.expression, names)};\n}}\n",
        _function("surface_gradient", problem.surface.gradient, names),
    ]
    modes = [part for k, mode in enumerate(problem.modes) for part in _mode(k, mode, names)]
    table = ",\n".join(f"    {_entry(k, mode, len(problem.states))}" for k, mode in enumerate(problem.modes))
    return "\n".join([head, *surface, *modes, f"static const ModeTable MODES[] = {{\n{table}\n}};\n"])


def _followed(mode: Mode) -> list[Guard]:
    """Guards whose values are integrated along, so that error control sees them."""
    return [guard for guard in mode.guards if not guard.linear]


def _mode(index: int, mode: Mode, names: Mapping[str, str]) -> list[str]:
    """Functions of one mode. Its unknowns are the states and the values of the followed guards."""
    followed = _followed(mode)
    field = [*mode.field, *(guard.rate for guard in followed)]
    columns = len(mode.field) + len(followed)
    entries = {
        row + column * columns: text
        for row, texts in enumerate([*mode.jacobian, *(guard.rate_slopes for guard in followed)])
        for column, text in enumerate(texts)
    }
    return [
        _function(f"field_{index}", field, names),
        _function(f"values_{index}", [guard.expression for guard in mode.guards], names),
        _function(f"start_{index}", [guard.expression for guard in followed], names),
        _matrix(f"jacobian_{index}", entries, names),
        _successor(f"successor_{index}", mode.guards, names),
    ]


def _function(name: str, texts: Sequence[str], names: Mapping[str, str]) -> str:
    return _matrix(name, dict(enumerate(texts)), names)


def _matrix(name: str, entries: Mapping[int, str], names: Mapping[str, str]) -> str:
    lines = [f"    out[{k}] = {renamed(text, names)};" for k, text in entries.items()]
    return "\n".join([f"static void {name}({ARGUMENTS}, double *out)", "{", SILENT, *lines, "}\n"])


def _successor(name: str, guards: Sequence[Guard], names: Mapping[str, str]) -> str:
    lines = []
    for k, guard in enumerate(guards):
        for successor in guard.successors:
            holds = "".join(f" && ({renamed(text, names)}) >= 0.0" for text in successor.when)
            follows = str(successor.mode) if successor.ends is None else CODES[successor.ends]
            lines.append(f"    if (guard == {k}{holds}) return {follows};")
    quiet = "    (void)guard, (void)t, (void)x, (void)p;"
    return "\n".join([f"static int {name}(int guard, {ARGUMENTS})", "{", quiet, *lines, "    return NONE;", "}\n"])


def _entry(index: int, mode: Mode, states: int) -> str:
    kinds = ", ".join(guard.kind.upper() for guard in mode.guards) or "VALID"
    surface = next((k for k, guard in enumerate(mode.guards) if guard.kind == "surface"), -1)
    unarmed = sum(1 << k for k, guard in enumerate(mode.guards) if not guard.armed)
    functions = ", ".join(f"{what}_{index}" for what in ("field", "jacobian", "values", "start", "successor"))
    unknowns = states + len(_followed(mode))
    return f"{{{mode.mode}, {unknowns}, {len(mode.guards)}, {surface}, {unarmed}, {{{kinds}}}, {functions}}}"
