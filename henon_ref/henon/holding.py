"""Whether a surface with a hold zone (``entry: inside``) is stuck to, decided in machine code where it is clear."""

from __future__ import annotations

from henon_ref.henon.calls import call_expand
from henon_ref.jit import inner

EDGE = 1e-9
"""Size of the smallest release guard, relative to all their coefficients, below which Python looks closer."""
_RELEASE = 1


@inner()
def held(t, low, sigma, x, index, layout, expansion, constants, ahead, order):  # type: ignore[no-untyped-def]
    """+1 inside the hold zone of a surface, -1 outside, 0 where that is not clear.

    Parameters
    ----------
    t, low, sigma, x
        Time, what rounding it lost, a unit of time, and the state of shape (n,).
    index : int
        The surface.
    layout : ndarray of int
        Guards of the stick (see :func:`henon_ref.henon.kernel.advance`).
    expansion, constants
        Its machine code.
    ahead : ndarray
        Work space of its expansion.
    """
    n = x.size
    call_expand(expansion, t, low, sigma, x, constants, ahead)
    least, size = 1e300, 0.0
    for g in range(layout[0, 0]):
        if layout[1 + g, 0] == _RELEASE and layout[1 + g, 1] == index:
            least = min(least, ahead[n + g, 0])
            for k in range(order + 1):
                size += abs(ahead[n + g, k])
    if not abs(least) > EDGE * size:
        return 0
    return 1 if least > 0.0 else -1
