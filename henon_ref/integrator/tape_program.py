"""Tapes as compiled code goes through them in double-double: ``struct tape`` of ``henon_ref/kernel/kernel.h``."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from henon_ref.kernel.shared import ffi, kernel
from henon_ref.taylor.rules import RULES, IntegralOfProduct, IntegralOfQuotient
from henon_ref.taylor.tape import INFINITE, Tape

MOST_OPERATIONS = 200
"""Of a tape: what takes longer than some tenths of a millisecond may as well go to multiprecision."""
_KINDS: dict[str, int] = {
    name[5:].lower(): number for name, number in ffi.typeof("enum tape_kind").relements.items()
} | {"square": kernel.TAPE_MUL}


def tape_program(tape: Tape, degree: int) -> NDArray[np.int64] | None:
    """Operations of a tape with its field and outputs; None where one has no counterpart in double-double.

    Parameters
    ----------
    tape : Tape
    degree : int
        Of states and outputs where they are polynomials in time; else :data:`henon_ref.taylor.tape.INFINITE`.
    """
    large = len(tape.field) + len(tape.outputs) > kernel.PAIR_ROWS or len(tape.nodes) > MOST_OPERATIONS
    if large or any(node.op not in _KINDS for node in tape.nodes):
        return None
    operations: list[int] = []
    for at, node in enumerate(tape.nodes):
        rule = RULES.get(node.op)
        first, second, sign, divides = (node.args[0], node.args[-1], 0, 0) if rule else (0, 0, 0, 0)
        if isinstance(rule, IntegralOfProduct | IntegralOfQuotient):
            second, sign, divides = rule.place(at, node.args), rule.sign, int(isinstance(rule, IntegralOfQuotient))
        operations += [_KINDS[node.op], first, second, *(*node.constants, 0, 0)[:2], sign, divides, node.degree]
    head = len(tape.nodes), len(tape.constants), len(tape.field), len(tape.outputs), degree if degree < INFINITE else 0
    return np.array([*head, *operations, *tape.field, *tape.outputs], dtype=np.int64)
