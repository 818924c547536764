"""End of a step, as machine code: the series summed for the states, and lower bounds of the guards."""

from __future__ import annotations

from collections.abc import Sequence

from henon_ref.jit.ir_writer import LANES, ONE, ZERO, IRWriter, loop_function, row_length

_VECTOR = f"<{LANES} x double>"


def step_end_ir(states: int, outputs: int, order: int, name: str) -> str:
    """LLVM IR of ``void name(double theta, double* C, double* out)``: evaluation of the series at the end of a step.

    For each state, ``out`` receives its change over the step (all terms but the first, so that adding it rounds once);
    then for each output a lower bound on (0, theta]: its first coefficient plus its negative terms.
    """
    w = IRWriter()
    powers, strides = _powers(w)
    for r in range(states + outputs):
        _row(w, ("%C", r * row_length(order)), ("%out", r), order, r >= states, powers, strides)
    return _function(name, w.lines)


def looped_step_end_ir(states: int, outputs: int, order: int, name: str) -> str:
    """LLVM IR as :func:`step_end_ir`, with loops over the rows."""
    text, lines = "", []
    for which, first, count in (("states", 0, states), ("outputs", states, outputs)):
        w = IRWriter()
        w.lines += [
            f"  %row = mul i64 %at, {row_length(order)}",
            "  %C = getelementptr double, ptr %first, i64 %row",
            "  %out = getelementptr double, ptr %results, i64 %at",
        ]
        powers, strides = _powers(w)
        _row(w, ("%C", 0), ("%out", 0), order, which == "outputs", powers, strides)
        text += loop_function(
            f"{name}.{which}", "double %theta, ptr noalias %first, ptr noalias %results, i64 %count", w.lines
        )
        lines += [
            f"  %first{first} = getelementptr double, ptr %C, i64 {first * row_length(order)}",
            f"  %results{first} = getelementptr double, ptr %out, i64 {first}",
            f"  call void @{name}.{which}(double %theta, ptr %first{first}, ptr %results{first}, i64 {count})",
        ]
    return text + _function(name, lines)


def _function(name: str, lines: Sequence[str]) -> str:
    body = "\n".join(lines)
    return f"define void @{name}(double %theta, ptr noalias %C, ptr noalias %out) {{\nentry:\n{body}\n  ret void\n}}\n"


def _powers(w: IRWriter) -> tuple[str, list[str]]:
    """Powers of theta from 0 to 3, and theta^4, each as a vector."""
    square = w.binary("fmul", "%theta", "%theta")
    strides = [w.vector([w.binary("fmul", square, square)] * LANES)]
    return w.vector([ONE, "%theta", square, w.binary("fmul", square, "%theta")]), strides


def _row(
    w: IRWriter, row: tuple[str, int], out: tuple[str, int], order: int, bound: bool, powers: str, strides: list[str]
) -> None:
    """Store the result of one row: a state's change, or an output's lower ``bound``."""
    zero, terms = w.vector([ZERO] * LANES), []
    for v in range(row_length(order) // LANES):
        term = w.load(row[0], row[1] + v * LANES, _VECTOR)
        if v == 0:
            term = w.emit(f"insertelement {_VECTOR} {term}, double {ZERO}, i64 0")
        if (v + 1) * LANES > order + 1:  # behind the row's end memory may hold anything
            own = ", ".join(f"i1 {int(k <= order)}" for k in range(v * LANES, (v + 1) * LANES))
            term = w.emit(f"select <{LANES} x i1> <{own}>, {_VECTOR} {term}, {_VECTOR} {zero}")
        if bound:
            below = w.emit(f"fcmp olt {_VECTOR} {term}, {zero}")
            term = w.emit(f"select <{LANES} x i1> {below}, {_VECTOR} {term}, {_VECTOR} {zero}")
        terms.append(term)
    total = _estrin(w, terms, strides)
    total = w.across(LANES, w.lanewise("fmul", LANES, total, powers))
    w.store(w.plus(w.load(*row), total) if bound else total, *out)


def _estrin(w: IRWriter, terms: list[str], strides: list[str]) -> str:
    """sum of terms_v stride^v by Estrin's scheme; ``strides``: the powers 1, 2, 4 ... computed so far."""
    level = 0
    while len(terms) > 1:
        if level == len(strides):
            strides.append(w.lanewise("fmul", LANES, strides[-1], strides[-1]))
        paired = [w.lanewise_fused(LANES, terms[i + 1], strides[level], terms[i]) for i in range(0, len(terms) - 1, 2)]
        terms = paired + terms[2 * len(paired) :]
        level += 1
    return terms[0]
