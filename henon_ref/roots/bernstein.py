"""Machine code for the Bernstein coefficients of a guard on a step, and for the number of roots by their signs.

By Descartes' rule of signs the number of roots on the step is the number of sign changes of the Bernstein coefficients,
or less by an even number (Mourrain and Pavone, *J. Symbolic Comput.* 44, 2009): no or one sign change is decisive.
"""

from __future__ import annotations

from math import comb

from henon_ref.jit.ir_writer import LANES, ZERO, IRWriter, literal, row_length
from henon_ref.kernel.shared import kernel

_VECTOR = f"<{LANES} x double>"


def bernstein_ir(order: int, name: str) -> str:
    """LLVM IR of ``i64 name(double* q, double* powers, i64 degree, double* a, double* b)``.

    ``a`` receives q_k powers_k up to ``degree``, then zeros; ``b`` the Bernstein coefficients of degree ``order`` of
    this polynomial on [0, 1]; both arrays hold whole vectors. The value (``enum roots_outcome`` of ``kernel.h``) is
    ROOT if the polynomial falls through exactly one root there, NO_ROOT if through none, and SUBDIVIDE if undecided.
    """
    w = IRWriter()
    blocks = row_length(order) // LANES
    every = (1 << (order + 1)) - 1
    degree = w.emit(f"insertelement <{LANES} x i64> poison, i64 %degree, i64 0")
    degree = w.emit(f"shufflevector <{LANES} x i64> {degree}, <{LANES} x i64> poison, <{LANES} x i32> zeroinitializer")
    zero = w.vector([ZERO] * LANES)
    terms = []
    for v in range(blocks):
        places = ", ".join(f"i64 {v * LANES + i}" for i in range(LANES))
        counts = w.emit(f"icmp sle <{LANES} x i64> <{places}>, {degree}")
        product = w.lanewise("fmul", LANES, w.load("%q", v * LANES, _VECTOR), w.load("%powers", v * LANES, _VECTOR))
        terms.append(w.emit(f"select <{LANES} x i1> {counts}, {_VECTOR} {product}, {_VECTOR} {zero}"))
        w.store(terms[v], "%a", v * LANES, _VECTOR)
    splats = [w.shuffled(LANES, terms[k // LANES], [k % LANES] * LANES) for k in range(order + 1)]
    positive, certain = "0", "0"
    for v in range(blocks):
        chains = [splats[0], zero]
        for k in range(1, min(order, LANES * v + LANES - 1) + 1):
            weights = w.vector([literal(_weight(order, k, i)) for i in range(LANES * v, LANES * v + LANES)])
            chains[k % 2] = w.lanewise_fused(LANES, splats[k], weights, chains[k % 2])
        b = w.lanewise("fadd", LANES, *chains)
        w.store(b, "%b", v * LANES, _VECTOR)
        positive = _gathered(w, positive, f"fcmp ogt {_VECTOR} {b}, {zero}", v)
        certain = _gathered(w, certain, f"fcmp one {_VECTOR} {b}, {zero}", v)
    positive = w.emit(f"and i64 {positive}, {every}")
    certain = w.emit(f"icmp eq i64 {w.emit(f'and i64 {certain}, {every}')}, {every}")
    turned = w.emit(f"xor i64 {positive}, {w.emit(f'lshr i64 {positive}, 1')}")
    changes = w.emit(f"call i64 @llvm.ctpop.i64(i64 {w.emit(f'and i64 {turned}, {every >> 1}')})")
    falling = w.emit(f"select i1 {w.emit(f'trunc i64 {positive} to i1')}, i64 {kernel.ROOT}, i64 {kernel.NO_ROOT}")
    outcome = w.emit(f"select i1 {w.emit(f'icmp eq i64 {changes}, 1')}, i64 {falling}, i64 {kernel.SUBDIVIDE}")
    outcome = w.emit(f"select i1 {w.emit(f'icmp eq i64 {changes}, 0')}, i64 {kernel.NO_ROOT}, i64 {outcome}")
    outcome = w.emit(f"select i1 {certain}, i64 {outcome}, i64 {kernel.SUBDIVIDE}")
    body = "\n".join(w.lines)
    return (
        f"define i64 @{name}(ptr noalias %q, ptr noalias %powers, i64 %degree, ptr noalias %a, ptr noalias %b) {{\n"
        f"entry:\n{body}\n  ret i64 {outcome}\n}}\n"
    )


def _weight(order: int, k: int, i: int) -> float:
    """Weight of power coefficient k in Bernstein coefficient i."""
    return comb(i, k) / comb(order, k) if i <= order else 0.0


def _gathered(w: IRWriter, mask: str, comparison: str, block: int) -> str:
    bits = w.emit(f"bitcast <{LANES} x i1> {w.emit(comparison)} to i{LANES}")
    wide = w.emit(f"shl i64 {w.emit(f'zext i{LANES} {bits} to i64')}, {block * LANES}")
    return w.emit(f"or i64 {mask}, {wide}")
