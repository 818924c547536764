"""The sign after an event by the signs of two normal velocities, where these alone decide it.

A surface that is reached from one side is left on the other where both fields point there, and slid on where each
points at it (Filippov 1988, Sec. 4). Where a normal velocity is near zero, or both point away, this rule says
nothing: :class:`~henon_ref.filippov.switching.Switching` looks at higher derivatives there.
"""

from __future__ import annotations

CLEAR = 1e-9
"""Part of the two normal velocities together below which one counts as near zero: far above the rounding of a
velocity, far below any that a smooth field has over more than an instant."""


def sign_after(below: float, above: float) -> int | None:
    """-1 or +1: the side on which the surface is left; 0: it is slid on; None where two signs do not decide.

    Parameters
    ----------
    below, above : float
        dh/dt of the fields on the negative and on the positive side, at a point of the surface h = 0.

    Examples
    --------
    >>> sign_after(1.0, 2.0), sign_after(-1.0, -2.0), sign_after(1.0, -2.0)
    (1, -1, 0)
    >>> sign_after(-1.0, 2.0), sign_after(1.0, 1e-12)
    (None, None)
    """
    clear = CLEAR * (abs(below) + abs(above))
    if below > clear:
        return 1 if above > clear else 0 if above < -clear else None
    return -1 if below < -clear and above < -clear else None
