"""End of a step, as machine code: the series summed for the states, and bounds from below for the guards."""

from __future__ import annotations

from henon_ref.jit.ir_writer import LANES, ONE, ZERO, IRWriter, row_length


def step_end_ir(states: int, outputs: int, order: int, name: str) -> str:
    """LLVM IR of ``void name(double theta, double* C, double* out)``: what a step needs of its coefficients.

    ``out`` receives, for each state, its change over the step (all terms but the first, so that adding it
    rounds once), then for each output a bound from below on (0, theta]: its first coefficient plus its
    negative terms.
    """
    w = IRWriter()
    vector = f"<{LANES} x double>"
    width = row_length(order)
    square = w.binary("fmul", "%theta", "%theta")
    fourth = w.binary("fmul", square, square)
    strides = [w.vector([fourth] * LANES)]
    powers = w.vector([ONE, "%theta", square, w.binary("fmul", square, "%theta")])
    zero = w.vector([ZERO] * LANES)
    for r in range(states + outputs):
        terms = []
        for v in range(width // LANES):
            term = w.load("%C", r * width + v * LANES, vector)
            if v == 0:
                term = w.emit(f"insertelement {vector} {term}, double {ZERO}, i64 0")
            if r >= states:
                below = w.emit(f"fcmp olt {vector} {term}, {zero}")
                term = w.emit(f"select <{LANES} x i1> {below}, {vector} {term}, {vector} {zero}")
            terms.append(term)
        total = _estrin(w, terms, strides)
        total = w.across(LANES, w.lanewise("fmul", LANES, total, powers))
        w.store(w.plus(w.load("%C", r * width), total) if r >= states else total, "%out", r)
    body = "\n".join(w.lines)
    return f"define void @{name}(double %theta, ptr noalias %C, ptr noalias %out) {{\nentry:\n{body}\n  ret void\n}}\n"


def _estrin(w: IRWriter, terms: list[str], strides: list[str]) -> str:
    """sum of terms_v stride^v, in pairs; ``strides``: its powers 1, 2, 4 ... as far as they are made."""
    level = 0
    while len(terms) > 1:
        if level == len(strides):
            strides.append(w.lanewise("fmul", LANES, strides[-1], strides[-1]))
        paired = [w.lanewise_fused(LANES, terms[i + 1], strides[level], terms[i]) for i in range(0, len(terms) - 1, 2)]
        terms = paired + terms[2 * len(paired) :]
        level += 1
    return terms[0]
