"""Grid and options of nosnoc's finite elements with switch detection."""

from __future__ import annotations

import io
from contextlib import redirect_stdout
from functools import partial
from typing import Any

import numpy as np

from henon_ref.baselines.causes.base import cause, holds

shows = partial(cause, "nosnoc", docs="https://nosnoc-py.readthedocs.io/en/latest/", apart=True)


def simulated(model: Any, until: float, steps: int) -> Any:
    """Simulate in equal control steps, each with two finite elements of three stages; return nosnoc's results."""
    import nosnoc

    options = nosnoc.NosnocOpts()
    options.pss_mode = nosnoc.PssMode.STEP
    options.terminal_time, options.n_s, options.N_finite_elements = until / steps, 3, 2
    options.comp_tol = options.sigma_N = 1e-10
    options.sigma_0, options.homotopy_update_slope = 1e-2, 1e-4
    with redirect_stdout(io.StringIO()):
        looper = nosnoc.NosnocSimLooper(nosnoc.NosnocSolver(options, model), model.x0, steps)
        looper.run()
    return looper.get_results()


def release() -> Any:
    """Model x' = t - s, s = sgn(x), x(0) = 0: at rest until t = 1, then x = (t - 1)^2 / 2."""
    import casadi

    x, t = casadi.SX.sym("x"), casadi.SX.sym("t")
    return one_surface(x, casadi.vertcat(x, t), [casadi.vertcat(t - 1, 1), casadi.vertcat(t + 1, 1)], [0.0, 0.0])


def oscillator() -> Any:
    """Model x'' = -x - 0.6 sgn(x'), x(0) = 5.3, x'(0) = 0."""
    import casadi

    x, v = casadi.SX.sym("x"), casadi.SX.sym("v")
    return one_surface(v, casadi.vertcat(x, v), [casadi.vertcat(v, -x - force) for force in (0.6, -0.6)], [5.3, 0.0])


def one_surface(surface: Any, state: Any, fields: list[Any], start: list[float]) -> Any:
    """Make a model with one surface and the fields above and below it."""
    import casadi
    import nosnoc

    sides = [np.array([[1], [-1]])]
    return nosnoc.NosnocModel(x=state, F=[casadi.horzcat(*fields)], S=sides, c=[surface], x0=np.array(start))


@shows("nosnoc-grid", "A release is located on the grid only")
def release_is_put_on_the_grid() -> str:
    """The equations hold at the stages of a finite element. At a release the weight of the sign reaches 0 or 1 without
    a jump, so that an element that begins before the release may slip throughout. The release is then at a grid point,
    with an error of up to one element for any order, and no warning is printed.
    """
    errors = {}
    for steps in (7, 71):
        found = simulated(release(), 2.5, steps)
        weights = np.array([np.ravel(weight)[0] for step in found["alpha_sim"] for weight in step])
        leaves = int(np.argmax(weights > 0.5 + 0.5 * (1 - 1e-6)))
        errors[steps] = abs(float(found["t_grid"][leaves]) - 1.0)
    holds(min(errors.values()) > 1e-3, f"errors of the release {errors}")
    return (
        f"rest ends at t = 1; on a grid of 7 steps to 2.5 it ends {errors[7]:.1e} s off, of 71 {errors[71]:.1e} s, "
        "and every step reports success"
    )


@shows("nosnoc-shared-options", "Options are shared between objects", "https://github.com/nosnoc/nosnoc_py")
def options_are_shared() -> str:
    """IPOPT's options are a dictionary of the class: an option set for one object is set for all. The adapter makes a
    copy.
    """
    import nosnoc

    first, second = nosnoc.NosnocOpts(), nosnoc.NosnocOpts()
    before = second.tol_ipopt
    first.tol_ipopt = 1e-3
    holds(before is None and second.tol_ipopt == 1e-3, f"the second has {second.tol_ipopt}")
    return "`first.tol_ipopt = 1e-3` sets `second.tol_ipopt` of another `NosnocOpts()` to 0.001"


@shows("nosnoc-infeasible", "A step without a solution does not end the run")
def infeasible_goes_on() -> str:
    """If IPOPT finds no solution of a step, nosnoc prints a warning and continues from the last iterate. The adapter
    halves the step, tries slower homotopies, and ends the run if all fail.

    The free oscillator with Coulomb friction in two steps: too few switches are allowed.
    """
    found = simulated(oscillator(), 20.0, 2)
    states = [status.name for status in found["status"]]
    holds("INFEASIBLE" in states, f"statuses {states}")
    end = float(found["X_sim"][-1][0])
    return f"in two steps with room for one switch each the statuses are {states}; it goes on, to x = {end:.2f}"


@shows("nosnoc-cost", "A step is a series of nonlinear programs")
def steps_are_programs() -> str:
    """IPOPT solves each control step several times with a decreasing relaxation of the complementarity, in about ten to
    fifty milliseconds. A long run therefore exceeds the time limit of a row.
    """
    from time import process_time

    began = process_time()
    found = simulated(oscillator(), 10.0, 20)
    spent = (process_time() - began) / 20
    programs = float(np.count_nonzero(found["cpu_nlp"])) / 20
    holds(programs >= 2, f"{programs} programs a step")
    return f"a control step is {programs:.1f} nonlinear programs, here {1e3 * spent:.0f} ms of processor time"


@shows("nosnoc-node", "Switches close to each other are one")
def two_switches_at_one_node() -> str:
    """A switch is at an end of a finite element. If two switches are closer than the tolerance of the complementarity
    resolves and there is one end for both, they are put together at this end: without an order, and at a wrong time.

    x' = 1 up to x = 0, 2 or 3 up to 1e-6, 4 beyond, from -1.1 in three steps, each with room for one switch.
    """
    import casadi
    import nosnoc

    x, apart = casadi.SX.sym("x"), 1e-6
    regions = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    fields, surfaces = casadi.horzcat(4.0, 3.0, 2.0, 1.0), casadi.vertcat(x, x - apart)
    found = simulated(nosnoc.NosnocModel(x=x, F=[fields], S=[regions], c=[surfaces], x0=np.array([-1.1])), 1.5, 3)
    weights = [np.round(np.ravel(weight), 3).tolist() for step in found["alpha_sim"] for weight in step][-2:]
    states = {status.name for status in found["status"]}
    holds(states == {"SUCCESS"} and weights == [[0, 0], [1, 1]], f"statuses {states}, weights {weights}")
    return f"surfaces {apart:g} apart are left at one node, t = {found['t_grid'][-2]:.8f}, and the step reports success"
