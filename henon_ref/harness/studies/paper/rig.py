"""The rig of Sec. 5 (Fig. 9, Eqs. 27-28) in its own parameters, the sets we run it in, and what its printed signs do.

The paper gives no numbers for it. Ours: m = k1 = k2 = k3 = a = b = r = 1, c1 = c2 = 0.01, mu0 = 0.5,
delta = 3, from rest on the belt with the bracket turned by 0.1; the speed of the belt makes the motion
periodic, quasi-periodic or chaotic. Time is the paper's dimensionless tau = omega t.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.casefile.case import parse_case
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem

SPEEDS: Mapping[str, str] = {"periodic": "0.40", "quasi-periodic": "1.00", "two-frequency": "0.75", "chaotic": "0.03"}
"""Kind of motion -> speed of the belt. (``two-frequency`` is quasi-periodic as well, with a faster decay.)"""

XI: tuple[sp.Symbol, ...] = sp.symbols("xi1:8", real=True)
"""xi1 .. xi7 of Eq. (27)."""

_CASE = """\
schema: 1
name: rig
title: Block on a belt, coupled to a bracket (Sec. 5)
system:
  state: [x1, x2, x3, x4]
  parameters: {{m: 1, k1: 1, k2: 1, k3: 1, c1: 0.01, c2: 0.01, mu0: 0.5, delta: 3, a: 1, b: 1, r: 1, vp: {speed}}}
  surfaces: {{s: x2 - vp}}
  field:
    - x2
    - >-
      -x1 - c1*sqrt((k1 + k2)/m)/(k1 + k2)*x2 {sign} k2/(k1 + k2)*x3 - c1*sqrt((k1 + k2)/m)/(k1 + k2)*x4
      {sign} k2/(k1 + k2)*(1 - mu0*k3/k2*x3 - mu0*c2*sqrt((k1 + k2)/m)/k2*x4)*mu0*s/(1 + delta*s*(x2 - vp))
    - x4
    - >-
      -3*r^2*k2/((a^2 + b^2)*(k1 + k2))*x1 - 3*r^2*c1*sqrt((k1 + k2)/m)/((a^2 + b^2)*(k1 + k2))*x2
      - 3*r^2*(k2 + k3)/((a^2 + b^2)*(k1 + k2))*x3
      - 3*r^2*(c1 + c2)*sqrt((k1 + k2)/m)/((a^2 + b^2)*(k1 + k2))*x4
  valid: ["1 - mu0*k3/k2*x3 - mu0*c2*sqrt((k1 + k2)/m)/k2*x4"]
initial: {{t: 0, x1: 0, x2: {start}, x3: 0.1, x4: 0}}
until: {until}
"""
"""The coupling's spring k2 acts on the bracket through an arm r, and the bracket unloads the contact."""


def rig_problem(speed: str, *, until: str | float = 100, printed: bool = False, start: str | None = None) -> Problem:
    """The rig at one speed of the belt, from ``[0, start, 0.1, 0]``.

    Parameters
    ----------
    speed : str
        vp, in decimal digits or as an expression in numbers.
    until : str or float
        Horizon.
    printed : bool
        With the signs of Eq. (27) as printed.
    start : str, optional
        Initial velocity of the block; the belt's if left out.
    """
    text = _CASE.format(
        speed=speed,
        until=until,
        start=speed if start is None else start,
        sign="+" if printed else "-",
    )
    return parse_case(text).readings[0].problem


def parameters_of_eq27(system: FilippovSystem) -> dict[sp.Symbol, sp.Expr]:
    """xi1 .. xi7 as the paper defines them, in the rig's own parameters."""
    m, k1, k2, k3, c1, c2, mu0, a, b, r = (
        sp.Symbol(name, real=True) for name in ("m", "k1", "k2", "k3", "c1", "c2", "mu0", "a", "b", "r")
    )
    omega = sp.sqrt((k1 + k2) / m)
    inertia = m * (a**2 + b**2) / 3
    values = (
        k2 / (omega**2 * m),
        c1 * omega / k2,
        k2 * r**2 / (omega**2 * inertia),
        (k2 + k3) / k2,
        omega * (c1 + c2) / k2,
        mu0 * k3 / k2,
        omega * c2 * mu0 / k2,
    )
    return {symbol: system.numeric(value) for symbol, value in zip(XI, values, strict=True)}


def eq27(system: FilippovSystem, *, printed: bool) -> tuple[sp.Expr, ...]:
    """Eq. (27) with the friction of Eq. (28) in slip, written out by hand, in the states and sign of a rig.

    Parameters
    ----------
    system : FilippovSystem
        A rig; its parameters give mu0, delta and vp.
    printed : bool
        The signs as printed, or ``x2' = -x1 - xi1 (xi2 (x2 + x4) + x3 + T)``.
    """
    x1, x2, x3, x4 = system.states
    s = system.signs[0]
    mu0, delta, vp = (system.parameters[sp.Symbol(name, real=True)] for name in ("mu0", "delta", "vp"))
    xi1, xi2, xi3, xi4, xi5, xi6, xi7 = XI
    load = 1 - xi6 * x3 - xi7 * x4
    friction = s * load * mu0 / (1 + delta * s * (x2 - vp))
    coupling = -x3 - friction if printed else x3 + friction
    field = (
        x2,
        -x1 - xi1 * (xi2 * (x2 + x4) + coupling),
        x4,
        xi3 * (-x1 - xi2 * x2 - xi4 * x3 - xi5 * x4),
    )
    values = parameters_of_eq27(system)
    return tuple(f.xreplace(values) for f in field)


def frictionless_eigenvalues(system: FilippovSystem) -> NDArray[np.complex128]:
    """Eigenvalues of the rig with the friction taken away, largest growth rate first."""
    quiet = {system.signs[0]: sp.Integer(0)}
    linear = sp.Matrix([system.numeric(f.xreplace(quiet)) for f in system.field]).jacobian(system.states)
    values = np.linalg.eigvals(np.array(linear.evalf(30), dtype=float)).astype(complex)
    return values[np.argsort(-values.real, kind="stable")]
