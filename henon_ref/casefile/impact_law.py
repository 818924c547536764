"""Newton's impact law between two bodies of a scene."""

from __future__ import annotations

import sympy as sp

from henon_ref.casefile.bodies import Body


def thrown_back(p: Body, q: Body, restitution: sp.Expr) -> dict[sp.Symbol, sp.Expr]:
    """Velocities after an impact, of those bodies that move freely.

    The relative velocity v_p - v_q turns round and is multiplied by the restitution, the momentum of the two stays
    (Brogliato, *Nonsmooth Mechanics*, 2016, Ch. 4); a body whose motion is given is not moved.

    Parameters
    ----------
    p, q : Body
    restitution : Expr
        Speed after over speed before, 0 to 1 [1].
    """
    change = (1 + restitution) * (p.velocity - q.velocity)
    if p.inertia is None:
        return {q.velocity: q.velocity + change}
    if q.inertia is None:
        return {p.velocity: p.velocity - change}
    whole = p.inertia + q.inertia
    return {p.velocity: p.velocity - q.inertia * change / whole, q.velocity: q.velocity + p.inertia * change / whole}
