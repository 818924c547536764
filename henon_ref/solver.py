"""The contract that Hénon's integrator and every baseline meet.

To add a solver, write a class with the attributes and the one method of :class:`Solver` and register an
instance under the entry-point group ``henon_ref.solvers``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from henon_ref.modes.problem import Problem
from henon_ref.trajectory import Trajectory

MEMBERS = ("name", "fixed_step", "landing", "prepare")
"""What an object must have to be a solver."""
Run = Callable[[], Trajectory]
"""A prepared run: no arguments, may be called again and again, each call does the whole run afresh."""


@runtime_checkable
class SelfTimedRun(Protocol):
    """A prepared run that is timed by a clock of its own: a program's, say, without the program's start."""

    wall_s: float
    """Wall time of the latest call [s]; NaN where it is not known."""

    def __call__(self) -> Trajectory:
        """Do the whole run afresh."""
        ...

    def times(self, count: int) -> tuple[float, ...]:
        """Wall times of so many further runs [s]."""
        ...


@runtime_checkable
class Solver(Protocol):
    """A way to compute a trajectory with its transitions.

    Implementer's checklist
    -----------------------
    * ``prepare`` does all that is done once a model: code generation, compilation, lambdify, warm-up of a
      JIT. Its time is reported as ``compile_s``; the run's time does not hold it.
    * The returned callable does the whole run and has no memory of earlier calls.
    * Transitions come in order of time; every one of them is reported, also after a failure.
    * Where ``problem.system.resets`` holds a surface, the state jumps as it falls through zero: a transition ``reset``
      with the state after, also where the mode stays. A map that carries another such surface from above zero to zero
      or below triggers that one's reset at the same instant: a transition each, with the state that its map has left
      (:mod:`henon_ref.modes.cascade`). Impacts that accumulate are reported until all later ones last
      less than 2^-26 of the run; their limit is a ``stick`` on that surface (:mod:`henon_ref.modes.resets`).
    * What the run returns is checked (:mod:`henon_ref.harness.campaign.contract_check`): a :class:`Trajectory`, an
      entry a state and a surface, times in order and from the start to the horizon; with status ``ok`` the end at the
      horizon and finite states; no more transitions than ten times the truth's and 100000. NumPy's numbers will do,
      and words are cut to one line. What fails the check is a row ``failed``.
    * ``UnsupportedError`` from ``prepare`` where the solver cannot do the problem; ``UnavailableError``
      where its library is missing. Other failures of a library are status ``failed`` with the reason.
    * The docstring says what ``steps``, ``rhs_evaluations`` and ``event_evaluations`` count.
    """

    name: str
    """The name used in case files and reports, e.g. ``scipy-dop853``."""
    fixed_step: bool
    """True: driven by ``step`` [s]; False: driven by ``rtol`` and ``atol``."""
    landing: str
    """How it puts a step's end on the surface, for the ``landing`` column."""

    @property
    def version(self) -> str:
        """Version of the library underneath (``""`` where it is not installed)."""
        ...

    def prepare(
        self,
        problem: Problem,
        *,
        rtol: float | None = None,
        atol: float | None = None,
        step: float | None = None,
        sample_times: NDArray[np.float64] | None = None,
        deadline: float | None = None,
    ) -> Run:
        """Get ready to run a problem.

        Parameters
        ----------
        problem : Problem
        rtol, atol : float, optional
            Tolerances, for ``fixed_step = False``.
        step : float, optional
            Step [s], for ``fixed_step = True``.
        sample_times : ndarray, shape (k,), optional
            Increasing times at which the state is wanted (figures only); solvers that cannot sample ignore it.
        deadline : float, optional
            Processor time that a run may take [s] (:func:`time.process_time`), what it compiles on the way apart; past
            it the run returns status ``timeout`` with what it has. One that goes on for a quarter more, or for several
            times as much wall time, is stopped from outside: a defect.
        """
        ...


def fault(candidate: object) -> str:
    """What keeps an object from being a solver, as the end of a sentence; empty where nothing does.

    The version is not asked for: that may import the library.
    """
    if isinstance(candidate, type):
        return f"is the class {candidate.__name__}, wanted an instance of it: {candidate.__name__}()"
    held: dict[str, object] = {}
    for member in MEMBERS:
        try:
            held[member] = getattr(candidate, member)
        except AttributeError:
            continue
        except Exception as error:  # noqa: BLE001 - a property may raise anything
            return f"is no solver: its {member} raises {type(error).__name__}: {error}"
    missing = [member for member in MEMBERS if member not in held]
    if missing:
        kind = type(candidate).__name__
        return f"is no solver: {kind} has no {', '.join(missing)} (see henon_ref.solver.Solver)"
    for member, wanted in (("name", str), ("fixed_step", bool)):
        if not isinstance(held[member], wanted):
            return f"is no solver: its {member} is {held[member]!r}, wanted a {wanted.__name__}"
    return ""
