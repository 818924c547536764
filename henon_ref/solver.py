"""The interface of all solvers, Hénon's integrator and the baselines.

To add a solver, write a class with the attributes and the method of :class:`Solver` and register an instance under the
entry-point group ``henon_ref.solvers``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from henon_ref.modes.problem import Problem
from henon_ref.trajectory import Trajectory

Run = Callable[[], Trajectory]
"""A prepared run, without arguments; each call performs the whole run independently of earlier calls."""


@runtime_checkable
class SelfTimedRun(Protocol):
    """A prepared run that measures its own time, such as a program without its start-up time."""

    wall_s: float
    """Wall time of the latest call [s], positive; NaN if unknown."""

    def __call__(self) -> Trajectory:
        """Perform the whole run, independently of earlier calls."""
        ...

    def times(self, count: int) -> tuple[float, ...]:
        """Wall times of ``count`` further runs [s], all positive."""
        ...


@runtime_checkable
class Solver(Protocol):
    """A way to compute a trajectory with its transitions.

    Implementer's checklist
    -----------------------
    * ``prepare`` does everything that is done once per model: code generation, compilation, lambdify, warm-up of a
      JIT. Its time is reported as ``compile_s`` and is not part of the run's time.
    * The returned callable performs the whole run and does not depend on earlier calls.
    * All transitions are reported in order of time, also those before a failure.
    * If ``problem.system.resets`` contains a surface, the state jumps when the surface falls through zero: a transition
      ``reset`` with the state after the jump, even if the mode stays. A map that moves another surface with a reset
      from above zero to zero or below triggers that reset at the same instant: one transition per map, with the state
      after the map (:mod:`henon_ref.modes.cascade`). Accumulating impacts are reported as long as all later ones
      together last at least 2^-26 of the run; their limit is a ``stick`` on that surface
      (:mod:`henon_ref.modes.resets`).
    * The result of a run is checked (:mod:`henon_ref.harness.campaign.contract_check`): a :class:`Trajectory`, one
      entry per state and per surface, times in order from the start to the horizon; with status ``ok`` the end at the
      horizon and finite states; at most ten times the truth's transitions plus 100000. NumPy numbers are accepted, and
      texts are cut to one line. A result that fails the check gives a row ``failed``. A right run is repeated for its
      wall time; if a later call then has another status or other transitions, the row has no wall time and says so.
    * ``prepare`` raises ``UnsupportedError`` if the solver cannot solve the problem, and ``UnavailableError`` if its
      library is missing. Other failures of a library give status ``failed`` with the reason.
    * The solver's docstring states what ``steps``, ``rhs_evaluations`` and ``event_evaluations`` count.
    """

    name: str
    """Name in case files and reports, e.g. ``scipy-dop853``."""
    fixed_step: bool
    """True: driven by ``step`` [s]; False: driven by ``rtol`` and ``atol``."""
    landing: str
    """Method that puts the end of a step on the surface, for the column ``landing``."""

    @property
    def version(self) -> str:
        """Version of the library (``""`` if it is not installed)."""
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
        """Prepare a run of a problem.

        Parameters
        ----------
        problem : Problem
        rtol, atol : float, optional
            Tolerances, for ``fixed_step = False``.
        step : float, optional
            Step [s], for ``fixed_step = True``.
        sample_times : ndarray, shape (k,), optional
            Increasing times at which the state is sampled for figures; solvers that cannot sample ignore them.
        deadline : float, optional
            Processor time limit of a run [s] (:func:`time.process_time`), without compilation during the run. Past the
            limit, the run returns status ``timeout`` with its transitions so far. A run that exceeds the limit by a
            quarter, or several times in wall time, is stopped from outside, which counts as a defect.
        """
        ...


def fault(candidate: object) -> str:
    """Reason why an object is not a solver, as the end of a sentence; empty if it is one.

    ``version`` is not read, because that may import the library.
    """
    if isinstance(candidate, type):
        return f"is the class {candidate.__name__}, wanted an instance of it: {candidate.__name__}()"
    required, held = ("name", "fixed_step", "landing", "prepare"), dict[str, object]()
    for member in required:
        try:
            held[member] = getattr(candidate, member)
        except AttributeError:
            continue
        except Exception as error:  # noqa: BLE001 - a property may raise anything
            return f"is no solver: its {member} raises {type(error).__name__}: {error}"
    missing = [member for member in required if member not in held]
    if missing:
        kind = type(candidate).__name__
        return f"is no solver: {kind} has no {', '.join(missing)} (see henon_ref.solver.Solver)"
    for member, wanted in (("name", str), ("fixed_step", bool)):
        if not isinstance(held[member], wanted):
            return f"is no solver: its {member} is {held[member]!r}, wanted a {wanted.__name__}"
    return ""
