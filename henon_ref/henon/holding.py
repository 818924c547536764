"""Whether a surface with a hold zone (``entry: inside``) is stuck to, decided in machine code where it is clear."""

from __future__ import annotations

from henon_ref.henon.registers import G_INDEX, G_KIND, RELEASE, T_EXPANSION, T_GUARDS
from henon_ref.jit.calls import call_expand
from henon_ref.jit.njit import inner
from henon_ref.jit.primitives import smaller

EDGE = 1e-9
"""Size of the smallest release guard, relative to all their coefficients, below which Python looks closer."""


@inner()
def held(t, low, sigma, n, x, index, layout, constants, ahead, order):  # type: ignore[no-untyped-def]
    """+1 inside the hold zone of a surface, -1 outside, 0 where that is not clear.

    Parameters
    ----------
    t, low, sigma, n, x
        Time, what rounding it lost, a unit of time, states, and the state.
    index : int
        The surface.
    layout : rows of int
        Table of the stick (see :func:`henon_ref.henon.kernel.advance`).
    constants : row
        Its constants.
    ahead : rows
        Work space of its expansion.
    """
    call_expand(layout[0, T_EXPANSION], t, low, sigma, x, constants, ahead)
    least, size = 1e300, 0.0
    for g in range(layout[0, T_GUARDS]):
        if layout[1 + g, G_KIND] == RELEASE and layout[1 + g, G_INDEX] == index:
            least = smaller(least, ahead[n + g, 0])
            for k in range(order + 1):
                size += abs(ahead[n + g, k])
    if not abs(least) > EDGE * size:
        return 0
    return 1 if least > 0.0 else -1
