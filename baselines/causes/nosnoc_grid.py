"""nosnoc's finite elements with switch detection: what its grid does, and its options."""

from __future__ import annotations

import io
from contextlib import redirect_stdout
from typing import Any

import numpy as np

from henon_ref.baselines.causes.base import Cause, elsewhere, holds

DOCS = "https://nosnoc-py.readthedocs.io/en/latest/"
REPOSITORY = "https://github.com/nosnoc/nosnoc_py"


def _options(length: float, stages: int) -> Any:
    import nosnoc

    options = nosnoc.NosnocOpts()
    options.pss_mode = nosnoc.PssMode.STEP
    options.terminal_time, options.n_s, options.N_finite_elements = length, stages, 2
    options.comp_tol = options.sigma_N = 1e-10
    options.sigma_0, options.homotopy_update_slope = 1e-2, 1e-4
    return options


def simulated(columns: Any, surface: Any, state: Any, start: list[float], until: float, steps: int) -> Any:
    """A system with one surface, ``columns`` its field above and below, in equal control steps; nosnoc's results."""
    import casadi
    import nosnoc

    model = nosnoc.NosnocModel(
        x=state, F=[casadi.horzcat(*columns)], S=[np.array([[1], [-1]])], c=[surface], x0=np.array(start)
    )
    with redirect_stdout(io.StringIO()):
        solver = nosnoc.NosnocSolver(_options(until / steps, 3), model)
        looper = nosnoc.NosnocSimLooper(solver, model.x0, steps)
        looper.run()
    return looper.get_results()


def release_is_put_on_the_grid() -> str:
    """x' = t - s, s = sgn(x), x(0) = 0: at rest until t = 1, then x = (t - 1)^2 / 2."""
    import casadi

    x, t = casadi.SX.sym("x"), casadi.SX.sym("t")
    columns = [casadi.vertcat(t - 1, 1), casadi.vertcat(t + 1, 1)]
    errors = {}
    for steps in (7, 71):
        found = simulated(columns, x, casadi.vertcat(x, t), [0.0, 0.0], 2.5, steps)
        weights = np.array([np.ravel(weight)[0] for step in found["alpha_sim"] for weight in step])
        leaves = int(np.argmax(weights > 0.5 + 0.5 * (1 - 1e-6)))
        errors[steps] = abs(float(found["t_grid"][leaves]) - 1.0)
    holds(min(errors.values()) > 1e-3, f"errors of the release {errors}")
    return (
        f"rest ends at t = 1; on a grid of 7 steps to 2.5 it ends {errors[7]:.1e} s off, of 71 {errors[71]:.1e} s, "
        "and every step reports success"
    )


def options_are_shared() -> str:
    """Two objects with options: the second has the IPOPT tolerance of the first."""
    import nosnoc

    first, second = nosnoc.NosnocOpts(), nosnoc.NosnocOpts()
    before = second.tol_ipopt
    first.tol_ipopt = 1e-3
    holds(before is None and second.tol_ipopt == 1e-3, f"the second has {second.tol_ipopt}")
    return "`first.tol_ipopt = 1e-3` sets `second.tol_ipopt` of another `NosnocOpts()` to 0.001"


def infeasible_goes_on() -> str:
    """The free oscillator with Coulomb friction in two steps: too few switches are allowed."""
    import casadi

    x, v = casadi.SX.sym("x"), casadi.SX.sym("v")
    columns = [casadi.vertcat(v, -x - 0.6), casadi.vertcat(v, -x + 0.6)]
    found = simulated(columns, v, casadi.vertcat(x, v), [5.3, 0.0], 20.0, 2)
    states = [status.name for status in found["status"]]
    end = float(found["X_sim"][-1][0])
    holds("INFEASIBLE" in states, f"statuses {states}")
    return f"in two steps with room for one switch each the statuses are {states}; it goes on, to x = {end:.2f}"


def steps_are_programs() -> str:
    """Processor time of one control step of the same oscillator."""
    from time import process_time

    import casadi

    x, v = casadi.SX.sym("x"), casadi.SX.sym("v")
    columns = [casadi.vertcat(v, -x - 0.6), casadi.vertcat(v, -x + 0.6)]
    began = process_time()
    found = simulated(columns, v, casadi.vertcat(x, v), [5.3, 0.0], 10.0, 20)
    spent = (process_time() - began) / 20
    programs = float(np.count_nonzero(found["cpu_nlp"])) / 20
    holds(programs >= 2, f"{programs} programs a step")
    return f"a control step is {programs:.1f} nonlinear programs, here {1e3 * spent:.0f} ms of processor time"


def two_switches_at_one_node() -> str:
    """x' = 1 up to x = 0, 2 or 3 up to 1e-6, 4 beyond, from -1.1 in three steps, each with room for one switch."""
    import casadi
    import nosnoc

    x, apart = casadi.SX.sym("x"), 1e-6
    regions = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    model = nosnoc.NosnocModel(
        x=x, F=[casadi.horzcat(4.0, 3.0, 2.0, 1.0)], S=[regions], c=[casadi.vertcat(x, x - apart)], x0=np.array([-1.1])
    )
    with redirect_stdout(io.StringIO()):
        looper = nosnoc.NosnocSimLooper(nosnoc.NosnocSolver(_options(0.5, 3), model), model.x0, 3)
        looper.run()
    found = looper.get_results()
    weights = [np.round(np.ravel(weight), 3).tolist() for step in found["alpha_sim"] for weight in step][-2:]
    states = {status.name for status in found["status"]}
    holds(states == {"SUCCESS"} and weights == [[0, 0], [1, 1]], f"statuses {states}, weights {weights}")
    return f"surfaces {apart:g} apart are left at one node, t = {found['t_grid'][-2]:.8f}, and the step reports success"


NOSNOC = (
    Cause(
        "nosnoc-grid",
        "nosnoc",
        "A release is put on the grid",
        "The equations hold at the stages of a finite element, and at a release the weight of the sign meets its end "
        "without a jump: an element that begins before the release may slip all through it. The release is then where "
        "the grid is, off by up to an element, whatever the order, and nothing is said.",
        elsewhere(release_is_put_on_the_grid),
        (DOCS,),
    ),
    Cause(
        "nosnoc-node",
        "nosnoc",
        "Switches close to each other are one",
        "A switch is an end of a finite element. Two that are closer than the complementarity tells and have one end "
        "between them are taken there together: in no order, and both at a time that is neither's.",
        elsewhere(two_switches_at_one_node),
        (DOCS,),
    ),
    Cause(
        "nosnoc-infeasible",
        "nosnoc",
        "A step without a solution is no end",
        "Where IPOPT finds no solution of a step, nosnoc prints a warning and goes on from what it has. The adapter "
        "halves the step, tries slower homotopies, and ends the run where that fails.",
        elsewhere(infeasible_goes_on),
        (DOCS,),
    ),
    Cause(
        "nosnoc-cost",
        "nosnoc",
        "A step is a series of nonlinear programs",
        "Each control step is solved by IPOPT several times, with the complementarity relaxed less and less: some ten "
        "to fifty milliseconds a step, so that a long run does not end within the time of a row.",
        elsewhere(steps_are_programs),
        (DOCS,),
    ),
    Cause(
        "nosnoc-shared-options",
        "nosnoc",
        "Options are shared between objects",
        "IPOPT's options are a dictionary of the class: what one object sets, all have. The adapter copies it.",
        elsewhere(options_are_shared),
        (REPOSITORY,),
    ),
)
