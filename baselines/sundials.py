"""What CVODE and IDA share: event functions, a run of scikit-sundae, and reading its results."""

from __future__ import annotations

import io
import os
from abc import abstractmethod
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from typing import Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.adapter import Adapter
from henon_ref.baselines.base import SmoothMode
from henon_ref.baselines.flow import Stop
from henon_ref.baselines.mode_functions import EPSILON
from henon_ref.baselines.restart import Watcher
from henon_ref.baselines.work import Stalled
from henon_ref.modes.callables import ARITHMETIC

# SUNDIALS' own logger writes its warnings ("t + h = t") to the standard output of the process, past Python.
os.environ.setdefault("SUNLOGGER_WARNING_FILENAME", os.devnull)

STEPS_BETWEEN_OUTPUTS = 1_000_000
"""``max_num_steps``: counts between outputs only, so it bounds nothing here; the deadline does."""


class SundialsAdapter(Adapter):
    """What is the same of CVODE and IDA as solvers."""

    landing = "illinois"
    distribution = "scikit-sundae"
    least_rtol = 1e-15  # its documentation asks for no smaller one

    def location_error(self, t: float) -> float:
        """SUNDIALS locates a root to ``100 eps (abs(t) + abs(h))``; the step h is not known here."""
        return 100.0 * EPSILON * abs(t)


class SundialsFlow(SmoothMode):
    """One mode on an integrator of scikit-sundae: subclasses set the attributes and add ``start``."""

    function: Callable[..., None]
    """Right-hand side or residual."""
    options: dict[str, Any]
    """Of the integrator, without events."""
    events: dict[str, Any]
    """Its options for events."""

    def connect(self, jacfn: Callable[..., None], watchers: Sequence[Watcher], dae: bool = False, **more: Any) -> None:
        """Set the options, ``more`` among them; all events are terminal, the guard against divergence is the last."""
        last, count, direction = self.last, len(watchers), self.gates.direction

        def of_ode(t: float, x: NDArray[np.float64], out: NDArray[np.float64]) -> None:
            for k, watcher in enumerate(watchers):
                out[k] = watcher(t, x)
            out[count] = last.value(t, x)

        def of_dae(t: float, y: NDArray[np.float64], yp: NDArray[np.float64], out: NDArray[np.float64]) -> None:
            of_ode(t, y, out)

        eventsfn: Any = of_dae if dae else of_ode
        # scikit-sundae reads both off the function.
        eventsfn.terminal, eventsfn.direction = [True] * (count + 1), [direction] * count + [-1]
        self.events = {"eventsfn": eventsfn, "num_events": count + 1}
        self.options = {"rtol": self.rtol, "atol": self.atol, "jacfn": jacfn, **more}
        self.options["max_num_steps"] = STEPS_BETWEEN_OUTPUTS

    @abstractmethod
    def start(self, t: float, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """The arrays that the library's ``solve`` starts from where the unknowns are x at t.

        Raises
        ------
        ZeroDivisionError, ValueError, OverflowError
            Where the field has no value there.
        """

    def integrate(self, t: float, x: NDArray[np.float64], until: float) -> Stop:
        """See :class:`henon_ref.baselines.base.SmoothMode`."""
        try:
            start = self.start(t, x)
        except ARITHMETIC as error:
            return self.failed(f"the field has no value at the start: {error}")
        make, work, said = self.library.module, self.work, io.StringIO()
        before = work.rhs
        # scikit-sundae prints its errors.
        with redirect_stdout(said):
            try:
                # A new object every time: it keeps the events of earlier calls.
                result = make(self.function, **self.options, **self.events).solve([t, until], *start)
            except (RuntimeError, Stalled) as error:
                return self.failed(f"{error} {said.getvalue().strip()}")
            work.steps += result.t.size - 1
            work.rhs = before + int(result.nfev)
            stop = self._stop(result, until, said.getvalue())
            if (wanted := self.wanted) is None:
                return stop
            kept = work.rhs
            times = wanted[(wanted <= stop.t) & (wanted > t)]
            samples = self._sampled(start, t, times)
            work.rhs = kept
        return stop._replace(samples=samples)

    def _stop(self, result: Any, until: float, said: str) -> Stop:
        """Where a result of ``solve`` ends; ``said`` is what the library wrote while it ran."""
        t, x = float(result.t[-1]), tuple(result.y[-1, : self.states].tolist())
        if not result.success:
            return Stop("failed", t, 0.0, x, reason=" ".join([result.message, *said.split()]))
        if result.t_events is None:
            return self.stopped(until, x, None)
        # The last row: the object is new for every run of a mode, but a reader of this line should not have to know.
        return self.stopped(t, x, np.flatnonzero(result.i_events[-1]).tolist())

    def _sampled(
        self, start: tuple[NDArray[np.float64], ...], t: float, times: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """States at some times, shape (k, n), by a second pass from the start without events."""
        if not times.size:
            return np.empty((0, self.states))
        solver = self.library.module(self.function, **self.options)
        rows = solver.solve(np.concatenate([[t], times]), *start).y[:, : self.states]
        # Two times make scikit-sundae return every internal step, the last of which is the one asked for.
        found = rows[-1:] if times.size == 1 else rows[1:]
        full = np.full((times.size, self.states), np.nan)
        full[: len(found)] = found
        return full
