"""Simulation of one run: the complete run, or a stream of its transitions.

The method is a Taylor series method (Jorba and Zou, *Exp. Math.* 14 (2005) 99-117) with Hénon's landing on the surfaces
(Hénon, *Physica D* 5 (1982) 412-413) and Filippov's sliding (Filippov, 1988). A system is compiled once per order, and
may be simulated from several threads at once.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from henon_ref.integrator.integrator import MOST_STEPS
from henon_ref.integrator.run import Run
from henon_ref.simulation.launch import Outcome, ended, launch
from henon_ref.simulation.solution import Solution
from henon_ref.simulation.system import System
from henon_ref.system.python_arguments import explained


@explained
def simulate(
    system: System,
    initial: Mapping[Any, Any] | Sequence[Any] | None = None,
    *,
    until: Any = None,
    start: Any = None,
    rtol: float = 1e-10,
    parameters: Mapping[Any, Any] | None = None,
    mode: Mapping[Any, int] | None = None,
    dense_output: bool = True,
    stop: Mapping[Any, str] | None = None,
    max_steps: int = MOST_STEPS,
) -> Solution:
    """Simulate one run of a piecewise-smooth system and locate every transition.

    Parameters
    ----------
    system : System
    initial : mapping, or array of shape (n,)
        State -> number (int, float, Fraction, or text in the parameters), or numbers in the order of the states. A
        system from a case has default initial values, start, horizon and mode.
    until : number
        Horizon, the end of the run [s].
    start : number, optional
        Initial time [s]; by default 0, or that of the case.
    rtol : float
        Tolerance, from 1e-16 to below 1: a tenth of it is the local error of a step relative to the size of each state.
    parameters : mapping, optional
        Values that replace the system's; parameters that depend on them are recomputed.
    mode : mapping, optional
        Sign -> -1, 0 or +1, for a start on a surface from which several motions are possible, or where another run was
        in this mode (``run.mode(t)``): the start may be off the surfaces by the error of that run, ten times ``rtol``.
    dense_output : bool
        Keep the polynomials of the steps. A run whose steps and transitions take 2 GiB ends with status ``failed``
        (with two states and the default ``rtol``, some 5 million steps); a stream keeps neither.
    stop : mapping, optional
        Sign -> ``"falling"`` or ``"rising"``: the run ends when the surface's expression falls (rises) to zero, or when
        a jump of the state carries it through zero. A graze does not end it.
    max_steps : int
        Number of steps after which the run ends with status ``failed``.

    Returns
    -------
    Solution
        If the run ended before its horizon, ``success`` is False and ``message`` gives the reason.

    Raises
    ------
    HenonRefError
        Also a ValueError, before the run, if an argument is invalid.

    Examples
    --------
    A block that slides to rest: x'' = -F sgn(x') with x'(0) = 1 stops at t = 1/F.

    >>> block = System(["x", "v"], {"F": 0.5}, {"s": "v"}, ["v", "-F*s"])
    >>> run = simulate(block, {"x": 0, "v": 1}, until=3)
    >>> run.transitions[["time_s", "kind", "x"]].values.tolist()
    [[2.0, 'stick', 1.0]]
    """
    integrator, begin = launch(system, initial, until, start, rtol, parameters, mode, stop, max_steps)
    run = Run(integrator, begin, dense=256 if dense_output else 0)  # steps in one block of memory
    trajectory = ended(run.to_horizon(), begin, system)
    return Solution(system, parameters, begin.time[0], begin.x, trajectory, run.steps if dense_output else None)


@explained
def stream(
    system: System,
    initial: Mapping[Any, Any] | Sequence[Any] | None = None,
    *,
    until: Any = None,
    start: Any = None,
    rtol: float = 1e-10,
    parameters: Mapping[Any, Any] | None = None,
    mode: Mapping[Any, int] | None = None,
    stop: Mapping[Any, str] | None = None,
    max_steps: int = MOST_STEPS,
) -> TransitionStream:
    """Simulate one run and yield its transitions; none is stored, so that memory does not grow with the horizon.

    Parameters
    ----------
    system, initial, until, start, rtol, parameters, mode, stop, max_steps
        As in :func:`simulate`.

    Returns
    -------
    TransitionStream
        An iterator over named tuples ``time_s, kind, surface, from_mode, to_mode``, then the states by name. Its
        attribute ``outcome`` describes the end of the run after the last transition.

    Raises
    ------
    HenonRefError
        Also a ValueError, at once, if an argument is invalid.

    Examples
    --------
    >>> oscillator = System(["x", "v"], {}, {"s": "x"}, ["v", "-x"])
    >>> [round(row.time_s, 9) for row in stream(oscillator, {"x": 1, "v": 0}, until=5)]
    [1.570796327, 4.71238898]
    """
    integrator, begin = launch(system, initial, until, start, rtol, parameters, mode, stop, max_steps)

    def rows() -> Generator[Any, None, Outcome]:
        from henon_ref.simulation.tables import rows_of

        model = system.model
        run, named = Run(integrator, begin), rows_of(model)
        for block in run.stream():
            yield from named(block.visible(model) if model.kinks else block)
        assert run.ended is not None
        return Outcome(system, parameters, ended(run.ended, begin, system)._replace(transitions=()))

    return TransitionStream(rows())


class TransitionStream(Iterator[Any]):
    """Iterator over the transitions of one run, which advances on request and stores none.

    Attributes
    ----------
    outcome : Outcome or None
        End of the run; None before the last transition.
    """

    def __init__(self, rows: Generator[Any, None, Outcome]) -> None:
        self._rows = rows
        self.outcome: Outcome | None = None

    def __next__(self) -> Any:
        try:
            return next(self._rows)
        except StopIteration as end:
            self.outcome = self.outcome or end.value
            raise


def load_run(path: str | Path) -> Solution:
    """Read a run written by :meth:`Solution.save`: equal transitions and sticks, and ``sol(t)`` to the last bit.

    Raises
    ------
    ArgumentError
        Also a ValueError, if the file cannot be read or is not such a run.
    """
    from henon_ref.simulation.run_file import read_run

    system, start, initial, trajectory, steps = read_run(path)
    return Solution(system, None, start, initial, trajectory, steps)
