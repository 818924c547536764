"""Lyapunov exponents from the variational equations.

Benettin's method: tangent vectors are integrated along a trajectory (:mod:`henon_ref.analysis.tangent_frame`) and
repeatedly orthonormalized by QR; the exponents are the mean logarithmic growth rates on the diagonal of R (Benettin et
al., *Meccanica* 15, 1980; Geist, Parlitz and Lauterborn, *Prog. Theor. Phys.* 83, 1990). A transition into a stick
removes a direction: the vector is dropped at the transition, not by an underflow, and its exponent is -infinity.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.analysis.tangent_frame import LOCAL_ERROR, TangentFrame
from henon_ref.analysis.variational import TangentFlow
from henon_ref.errors import ArgumentError
from henon_ref.integrator.integrator import local_error
from henon_ref.modes.problem import Problem
from henon_ref.simulation.arguments import problem_of, tolerance_of
from henon_ref.simulation.system import System
from henon_ref.system.python_arguments import explained, without_dimensions, written
from henon_ref.trajectory import Status

BATCHES = 10
"""Number of equal parts of the span whose means give the standard errors."""


@dataclass(frozen=True)
class Spectrum:
    """Lyapunov exponents of one trajectory over a span of time."""

    exponents: tuple[float, ...]
    """n exponents [1/s], largest first; ``-inf`` for directions that a stick or a rest has removed."""
    times: NDArray[np.float64]
    """(k,) times since the averaging began [s]."""
    history: NDArray[np.float64]
    """(k, n) averages up to those times, in the order of the tangent vectors."""
    span: float
    """Averaging time [s]."""
    transitions: int
    """Number of transitions in that time."""
    stick_fraction: float
    """Part of that time in which at least one surface slides."""
    status: Status
    """``ok``, or the status with which the trajectory ended early."""
    reason: str = ""

    @property
    def lost(self) -> int:
        """Number of directions that sticks have removed (exponents of -infinity)."""
        return sum(e == -math.inf for e in self.exponents)

    @property
    def standard_errors(self) -> tuple[float, ...]:
        """Standard error of each exponent [1/s], from the means over :data:`BATCHES` equal parts of the span.

        NaN for removed directions, and if the run ended without an average.
        """
        n = len(self.exponents)
        if not len(self.times):
            return (math.nan,) * n
        order = np.argsort(self.history[-1])[::-1]
        logs = np.vstack([np.zeros(n), self.history * self.times[:, None]])[:, order]
        marks = np.linspace(0.0, self.span, BATCHES + 1)
        with np.errstate(invalid="ignore"):
            grown = np.array([np.diff(np.interp(marks, [0.0, *self.times], column)) for column in logs.T])
            errors = np.std(grown / np.diff(marks), axis=1, ddof=1) / math.sqrt(BATCHES)
        return tuple(errors.tolist())

    def kaplan_yorke(self, *, zero: float = 0.0) -> float:
        """Kaplan-Yorke dimension of the attractor; exponents within ``zero`` of 0 count as 0.

        NaN if there are no exponents.
        """
        if any(map(math.isnan, self.exponents)):
            return math.nan
        total = 0.0
        for i, exponent in enumerate(self.exponents):
            counted = 0.0 if abs(exponent) <= zero else exponent
            if total + counted < 0:
                return i - total / counted
            total += counted
        return float(len(self.exponents))


def lyapunov_spectrum(problem: Problem, *, discard: float, span: float, tolerance: float = 1e-12) -> Spectrum:
    """Return all Lyapunov exponents of a problem's trajectory; see :func:`lyapunov_exponents`.

    The problem's own ``until`` is not used. ``tolerance`` is the local error of a step, at most :data:`LOCAL_ERROR`, so
    that the check of the logarithms' sum can pass.
    """
    tolerance = min(tolerance, LOCAL_ERROR)
    flow = TangentFlow(problem, tolerance=tolerance)
    if flow.refused is not None:
        n = len(problem.system.states)
        nothing = np.empty(0), np.empty((0, n)), 0.0, 0, 0.0
        return Spectrum((math.nan,) * n, *nothing, flow.refused.status, flow.refused.reason)
    frame = TangentFrame(flow, tolerance)
    start = float(problem.start)
    status, reason = frame.run(start + discard)
    frame.reset()
    if status == "ok":
        status, reason = frame.run(start + discard + span)
    times = np.array(frame.times)
    history = np.array(frame.history).reshape(len(times), frame.logs.size)
    final = history[-1] if len(times) else np.full(frame.logs.size, np.nan)
    return Spectrum(
        exponents=tuple(sorted(final.tolist(), reverse=True)),
        times=times,
        history=history,
        span=float(times[-1]) if len(times) else 0.0,
        transitions=frame.transitions,
        stick_fraction=frame.stuck / times[-1] if len(times) else 0.0,
        status=status,
        reason=reason,
    )


@explained
def lyapunov_exponents(
    system: System,
    initial: Mapping[Any, Any],
    *,
    span: float,
    discard: float = 0.0,
    start: Any = 0,
    rtol: float = 1e-10,
    parameters: Mapping[Any, Any] | None = None,
    mode: Mapping[Any, int] | None = None,
) -> Spectrum:
    """Return all Lyapunov exponents of a system's motion, including its transitions.

    Tangent vectors follow the variational equations, are multiplied by the saltation matrix at each transition, and are
    orthonormalized by QR (Benettin et al., *Meccanica* 15, 1980; Mueller, *Chaos, Solitons & Fractals* 5, 1995). A
    stick removes directions: their exponents are -infinity. The sum of all logarithms is checked against the integrated
    divergence and the volume factors of the saltation matrices, to 1e-8 of the sum of the absolute values of all terms.

    Parameters
    ----------
    system : System
    initial : mapping
        State -> number.
    span : float
        Averaging time [s].
    discard : float
        Time before the averaging, in which the motion reaches its attractor, and the tangent vectors the directions of
        the exponents [s]; without it, the exponents have an error of the order of 1/span. Directions that sticks remove
        in this time do not count.
    start, parameters, mode
        As in :func:`henon_ref.simulate`.
    rtol : float
        As in :func:`henon_ref.simulate`; values above 1e-12 act as 1e-12, as the check of the sum requires.

    Returns
    -------
    Spectrum
        ``.exponents`` [1/s], largest first; ``.history`` shows their convergence.

    Raises
    ------
    HenonRefError
        For invalid arguments, if several surfaces change at one instant, and if the check of the sum fails.

    Examples
    --------
    A damped linear oscillator: both exponents are minus half the damping, also with crossings.

    >>> import henon_ref as hr
    >>> oscillator = hr.System(["x", "v"], {"c": 0.2}, {"s": "x"}, ["v", "-x - c*v"])
    >>> [round(e, 3) for e in hr.lyapunov_exponents(oscillator, {"x": 1, "v": 0}, span=500).exponents]
    [-0.1, -0.1]
    """
    span, discard = without_dimensions(span), without_dimensions(discard)
    if not (isinstance(span, Real) and 0 < float(span) < math.inf):
        raise ArgumentError(f"span is {str(span)[:60]}; wanted a time in s, larger than 0")
    if not (isinstance(discard, Real) and 0 <= float(discard) < math.inf):
        raise ArgumentError(f"discard is {str(discard)[:60]}; wanted a time in s, 0 or larger")
    until = f"({written(start, 'start')}) + 1"  # any later time: ``span`` sets the end
    error = min(local_error(tolerance_of(rtol)), LOCAL_ERROR)
    given = {"start": start, "parameters": parameters, "mode": mode}
    _, problem = problem_of(system, initial, until=until, **given, error=error)
    return lyapunov_spectrum(problem, discard=float(discard), span=float(span), tolerance=error)
