"""nosnoc: finite elements with switch detection (FESD), the only peer solver with its own Filippov method.

nosnoc runs without the driver. It gets the case's field in each region of the surfaces (one column of ``F`` per
combination of signs) and treats sliding itself, by a complementarity system (Stewart's or Heaviside's; the adapter
chooses Heaviside steps, whose alpha is the weight of a sign). Transitions are read from the ends of its finite
elements: alpha changes between 0 and 1 at a crossing, and is between 0 and 1 while the surface slides.

nosnoc has no error control: the tolerance of a row sets the number n of stages of Radau IIA (order 2 n - 1) and the
tolerance of the complementarity. The grid is the same for all tolerances: twice as many equal control steps, each of
which can resolve one switch, as SciPy's RK45 takes at 1e-3. A coarser grid gives wrong results without a warning
(:mod:`henon_ref.baselines.causes.nosnoc_grid`).

The homotopy parameter starts at 1e-2 and is multiplied by 1e-4 per step, a quarter of the work of the default. If
IPOPT reports a control step as infeasible, the step is halved, up to twice, and then repeated with slower homotopies,
the last of which is nosnoc's default. If all fail, the run ends. (nosnoc itself prints a warning and continues.)
"""

from __future__ import annotations

import copy
import io
from contextlib import redirect_stdout
from itertools import product
from math import ceil, sqrt
from types import SimpleNamespace
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from henon_ref.baselines.adapter import LibrarySolver
from henon_ref.baselines.driver import Driver
from henon_ref.baselines.library import LIMIT, DeadlinePassed, Times, Work
from henon_ref.baselines.record import Record
from henon_ref.baselines.scipy_ivp import RK45
from henon_ref.baselines.sundials import ADAMS
from henon_ref.errors import UnsupportedError
from henon_ref.expressions.grammar import FUNCTIONS
from henon_ref.modes.callables import rounded
from henon_ref.modes.kinks import visible
from henon_ref.modes.mode import Mode
from henon_ref.modes.problem import Problem
from henon_ref.solver import Run
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Status, Trajectory

GRID = 1e-3
"""Tolerance of the run whose steps are counted for the grid."""
FEWEST = 20
"""Smallest number of control steps of a run."""
ELEMENTS = 2
"""Finite elements per control step."""
HOMOTOPIES = ((1e-2, 1e-4), (1e-1, 1e-2), (1.0, 0.1))
"""Start and factor of each homotopy, tried in turn; the last is nosnoc's default."""
HALVINGS = 2
"""Largest number of halvings of a control step that IPOPT cannot solve."""


class Nosnoc(LibrarySolver):
    """nosnoc's solver, called for one control step after another. It returns no samples.

    Counts: ``steps`` are finite elements. nosnoc does not count right-hand sides (0) and has no event functions.
    """

    landing = "switch detection"
    distribution = module = "nosnoc"
    extra = "peers"

    def prepared(self, problem: Problem, rtol: float, atol: float, work: Work, times: Times) -> Run:
        """Build the nonlinear program."""
        system = problem.system
        for beyond, words in (
            (system.overrides, "nosnoc slides by Filippov's combination only, and the case replaces it"),
            (system.valid, "nosnoc does not support the end of a model ('valid')"),
            (system.resets, "nosnoc does not support jumps of the state"),
        ):
            if beyond:
                raise UnsupportedError(words)
        if not 1 <= len(system.surfaces) <= 3:  # n surfaces make 2**n regions
            raise UnsupportedError(f"the adapter supports 1 to 3 surfaces, not {len(system.surfaces)}")
        self.loaded()
        return _Simulation(problem, rtol, self.landing, work).run


class _Simulation:
    """One problem prepared for repeated runs."""

    def __init__(self, problem: Problem, rtol: float, landing: str, work: Work) -> None:
        import casadi
        import nosnoc

        self.problem, self.landing = problem, landing
        self.nearest = sqrt(_complementarity(rtol))
        self.work = work
        self.start, self.until = float(problem.start), float(problem.until)
        self.success = nosnoc.Status.SUCCESS
        self.steps = _control_steps(problem, work.deadline)
        self.length = (self.until - self.start) / self.steps
        self.clocked = any(e.has(TIME) for e in (*problem.system.field, *problem.system.surfaces))
        initial = [float(v) for v in problem.initial]
        self.initial = np.array([*initial, self.start] if self.clocked else initial)
        self.solvers = []
        for level in range(HALVINGS + 1):
            model = nosnoc.NosnocModel(x0=self.initial, **_model(casadi, problem, self.clocked))
            options = _options(nosnoc, rtol, self.length / 2**level)
            self.solvers.append(nosnoc.NosnocSolver(options, model))

    def run(self) -> Trajectory:
        """Run from the start to the horizon."""
        system, self.largest = self.problem.system, np.full(len(self.problem.system.surfaces), self.nearest)
        self.work.start()
        with threadpool_limits(1):
            found = self._march(Record(self.work, self.problem, self.landing))
        return found._replace(transitions=visible(system, found.transitions))

    def _march(self, record: Record) -> Trajectory:
        x, mode, states = self.initial, (0,) * len(self.largest), len(self.problem.system.states)

        def ended(status: Status, t: float, reason: str = "") -> Trajectory:
            return record.finish(status, t, tuple(x[:states].tolist()), mode, reason)

        for k in range(self.steps):
            t = self.start + k * self.length
            try:
                self.work.check()
            except DeadlinePassed:
                return ended("timeout", t, f"stopped after {self.work.deadline:g} s")
            elements = self._step(x, 0)
            if elements is None:
                return ended("failed", t, f"IPOPT finds no step from t = {t:.17g}")
            for at, element in enumerate(elements):
                if element.length > 1e-9 * self.length:  # a shorter one has no mode
                    after = self._mode(element)
                    if after != mode and (k or at):
                        # The lengths of elements have an error of the complementarity's tolerance.
                        within = min(max(t, self.start), self.until)
                        record.event(within, 0.0, tuple(x[:states].tolist()), mode, after, ())
                    mode = after
                    record.drift = max([record.drift, *element.off[[s == 0 for s in mode], -1]])
                t, x = t + element.length, element.x
            if not np.abs(x).max() <= LIMIT:
                return ended("diverged", t, f"the state passed {LIMIT:g} at t = {t:.17g}")
        return ended("ok", self.until)

    def _step(self, x: NDArray[np.float64], level: int) -> list[SimpleNamespace] | None:
        """Solve a control step that was halved ``level`` times; None if IPOPT finds no solution."""
        found = self._solved(x, level, *HOMOTOPIES[0])
        if found is None and level < HALVINGS:
            first = self._step(x, level + 1)
            second = None if first is None else self._step(first[-1].x, level + 1)
            found = None if first is None or second is None else first + second
        for homotopy in HOMOTOPIES[1:]:
            found = found or self._solved(x, level, *homotopy)
        return found

    def _solved(self, x: NDArray[np.float64], level: int, sigma: float, factor: float) -> list[SimpleNamespace] | None:
        solver = self.solvers[level]
        options = solver.opts
        options.sigma_0, options.homotopy_update_slope = sigma, factor
        options.max_iter_homotopy = ceil(np.log(options.sigma_N / sigma) / np.log(factor)) + 1
        solver.set("x0", x)
        with redirect_stdout(io.StringIO()):  # nosnoc prints failures of IPOPT
            result = solver.solve()
        if result["status"] != self.success:
            return None
        self.work.steps += ELEMENTS
        return _elements(solver.problem, result)

    def _mode(self, element: SimpleNamespace) -> Mode:
        """Mode of a finite element.

        By complementarity, either the weight of a surface is 0 or 1, or the distance of the state from the surface is
        zero, up to the complementarity's tolerance. A surface slides if the distance of its weight from 0 and 1 exceeds
        the relative distance of the state. That distance is relative to the largest one so far, or to the square root
        of the complementarity's tolerance if that is larger.
        """
        weight, off = element.weight, element.off.max(axis=1)
        self.largest = np.maximum(self.largest, off)
        between = np.minimum(weight, 1.0 - weight).max(axis=1)
        slides = between > off / self.largest
        sides = np.where(weight.mean(axis=1) > 0.5, 1, -1)
        return tuple(int(side) for side in np.where(slides, 0, sides))


def _elements(problem: Any, result: dict[str, Any]) -> list[SimpleNamespace]:
    """Return length, final state, and weights and surface distances, shape (surfaces, stages), of each element."""
    found = result["w_sol"]
    by_stage = [
        np.array([[found[stage[0]] for stage in element] for element in index[0]]).swapaxes(1, 2)
        for index in (problem.ind_alpha, problem.ind_lambda_p, problem.ind_lambda_n)
    ]
    return [
        SimpleNamespace(length=float(length), x=np.asarray(x), weight=weight, off=np.maximum(above, below))
        for length, x, weight, above, below in zip(result["time_steps"], result["x_list"], *by_stage, strict=True)
    ]


def _control_steps(problem: Problem, deadline: float | None) -> int:
    """Number of control steps, from the steps of RK45 at a loose tolerance, or of CVODE if SciPy raises (flat root)."""
    try:
        scout = Driver(problem, RK45.library(GRID, GRID), Work(deadline))
        found = scout.run()
    except RuntimeError:  # raised by SciPy, not by nosnoc
        scout = Driver(problem, ADAMS.library(GRID, GRID), Work(deadline))
        found = scout.run()
    done = (found.end_time - scout.start) / (scout.until - scout.start)
    return min(max(ceil(2 * found.counts.steps / max(done, 1e-3)), FEWEST), 20_000)


def _complementarity(rtol: float) -> float:
    """Tolerance of the complementarity for a row's tolerance."""
    return min(max(1e-2 * rtol, 1e-11), 1e-8)


def _options(nosnoc: Any, rtol: float, length: float) -> Any:
    options = nosnoc.NosnocOpts()
    # All objects share the dictionary of the class; a copy prevents that they share a tolerance.
    options.opts_casadi_nlp = copy.deepcopy(nosnoc.NosnocOpts.opts_casadi_nlp)
    options.opts_casadi_nlp["show_eval_warnings"] = False
    options.irk_scheme = nosnoc.IrkSchemes.RADAU_IIA
    options.irk_representation = nosnoc.IrkRepresentation.DIFFERENTIAL
    options.pss_mode = nosnoc.PssMode.STEP
    options.n_s = 3 if rtol > 1e-7 else 4 if rtol > 1e-10 else 5
    options.N_finite_elements = ELEMENTS
    options.terminal_time = length
    options.comp_tol = options.sigma_N = _complementarity(rtol)
    options.tol_ipopt = 1e-2 * options.comp_tol
    options.sigma_0, options.homotopy_update_slope = HOMOTOPIES[0]
    return options


def _model(casadi: Any, problem: Problem, clocked: bool) -> dict[str, Any]:
    """Return nosnoc's description of the problem: state, surfaces, signs of each region, and the field in each."""
    system = problem.system
    names = [*system.states, *([TIME] if clocked else [])]
    state = casadi.vertcat(*(casadi.SX.sym(f"x{k}") for k in range(len(names))))
    regions = list(product((1, -1), repeat=len(system.surfaces)))

    def converted(expressions: list[sp.Expr]) -> Any:
        exprs = [rounded(system.numeric(e)) for e in expressions]
        functions = {name: getattr(casadi, name) for name in FUNCTIONS}
        values = sp.lambdify(names, exprs, modules=[functions], cse=True, dummify=True)(*casadi.vertsplit(state))
        return casadi.vertcat(*values)

    def field(region: tuple[int, ...]) -> Any:
        signs = system.entries(region)
        rates = converted([f.xreplace(signs) for f in system.field])
        return casadi.vertcat(rates, 1.0) if clocked else rates

    return {
        "x": state,
        "F": [casadi.horzcat(*map(field, regions))],
        "S": [np.array(regions)],
        "c": [converted(list(system.surfaces))],
    }


NOSNOC = Nosnoc("nosnoc")
