"""A program: compare a sweep of the friction oscillator with heyoka's batch and ensemble modes.

``python -m tests.support.sweep_against_heyoka [POINTS]``. heyoka at its best: one integrator for all modes, whose
parameters (the sign, whether it sticks, the lift of a fresh guard) belong to each lane of the batch; terminal events
change them in place, so that a batch goes on to the horizon. Times are those of the processor, all threads together,
so that others at work on the machine do not count. Errors are those of the final state against a sweep at 1e-14.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import heyoka as hy
import numpy as np
import pandas as pd
from numpy.typing import NDArray

import henon_ref as hr
from tests.support.sweep_rates import friction_oscillator

XI, MUSD, MUD, V0, VD = 0.05, 2.0, 0.5, 0.5, 1.5
LIFT = 1e-15
"""By which a guard is lifted that is zero where it begins: heyoka would stop there at once."""
UNTIL = 500.0
SIGN, STUCK, LIFTED = range(3)


class Reached:
    """The surface is reached: stick, or cross."""

    def __call__(self, ta: Any, sign: int, lane: int) -> bool:
        load = -ta.state[0, lane] - 2 * XI * VD
        ta.state[1, lane] = VD
        if abs(load) <= MUD * MUSD:
            ta.pars[STUCK, lane] = 1.0
        else:
            ta.pars[SIGN, lane] *= -1.0
            ta.pars[LIFTED, lane] = LIFT
        return True


class Released:
    """The load reaches the friction: slip on."""

    def __call__(self, ta: Any, sign: int, lane: int) -> bool:
        ta.pars[STUCK, lane], ta.pars[LIFTED, lane] = 0.0, LIFT
        ta.pars[SIGN, lane] = np.sign(-ta.state[0, lane] - 2 * XI * VD)
        return True


def integrator(lanes: int, tolerance: float) -> Any:
    """An adaptive integrator of all modes."""
    x, v = hy.make_vars("x", "v")
    s, stuck, lifted = (hy.par[k] for k in (SIGN, STUCK, LIFTED))
    slip = -x - 2 * XI * v - s * (MUD + MUD * (MUSD - 1) * hy.exp(-s * (v - VD) / V0))
    load = (-x - 2 * XI * VD) / (MUD * MUSD)
    events = [
        hy.t_event_batch(
            (1 - stuck) * (s * (v - VD) + lifted) + stuck, callback=Reached(), direction=hy.event_direction.negative
        ),
        hy.t_event_batch(
            stuck * (1 - load * load) + (1 - stuck), callback=Released(), direction=hy.event_direction.negative
        ),
    ]
    return hy.taylor_adaptive_batch(
        [(x, v), (v, (1 - stuck) * slip)], np.zeros((2, lanes)), pars=np.zeros((3, lanes)), t_events=events,
        tol=tolerance,
    )  # fmt: skip


def started(ta: Any, starts: NDArray[np.float64]) -> Any:
    """The integrator at some starts, a lane each."""
    ta.set_time(0.0)
    ta.state[:] = starts.T
    ta.pars[SIGN], ta.pars[STUCK], ta.pars[LIFTED] = np.sign(starts[:, 1] - VD), 0.0, 0.0
    return ta


def batch(starts: NDArray[np.float64], lanes: int, tolerance: float) -> tuple[float, NDArray[np.float64]]:
    """One batch after another: processor time [s], and final states."""
    ta, ends = integrator(lanes, tolerance), np.empty_like(starts)
    began = time.process_time()
    for k in range(0, len(starts), lanes):
        started(ta, starts[k : k + lanes]).propagate_until(UNTIL)
        ends[k : k + lanes] = ta.state.T
    return time.process_time() - began, ends


def ensemble(starts: NDArray[np.float64], lanes: int, tolerance: float) -> tuple[float, NDArray[np.float64]]:
    """heyoka's ensemble of batches, on all cores: processor time of all threads [s], and final states."""
    ta, ends = integrator(lanes, tolerance), np.empty_like(starts)
    began = time.process_time()
    done = hy.ensemble_propagate_until_batch(
        ta, UNTIL, len(starts) // lanes, lambda own, k: started(own, starts[k * lanes : (k + 1) * lanes])
    )
    for k, (own, *_) in enumerate(done):
        ends[k * lanes : (k + 1) * lanes] = own.state.T
    return time.process_time() - began, ends


def swept(system: hr.System, starts: NDArray[np.float64], rtol: float) -> tuple[float, NDArray[np.float64]]:
    """A sweep in this process: processor time [s], and final states."""
    grid = {"x": starts[:, 0], "v": starts[:, 1]}
    began = time.process_time()
    table = hr.sweep(
        system, {"x": 0, "v": 0}, until=UNTIL, grid=pd.DataFrame(grid), rtol=rtol, jobs=1,
        observe=[hr.observe.final_state()],
    )  # fmt: skip
    return time.process_time() - began, table[["final_x", "final_v"]].to_numpy()


def main(points: int) -> None:
    """Print a row for each way and tolerance."""
    lanes = hy.recommended_simd_size()
    draws = {"x": {"uniform": [-2, 2]}, "v": {"uniform": [0, 2]}}
    starts = hr.points.random(draws, count=points // lanes * lanes, seed=1).values
    system = friction_oscillator()
    _, truth = swept(system, starts, 1e-14)
    ways = {
        "henon, sweep": lambda tolerance: swept(system, starts, tolerance),
        f"heyoka, batches of {lanes}": lambda tolerance: batch(starts, lanes, tolerance),
        f"heyoka, ensemble of batches of {lanes}": lambda tolerance: ensemble(starts, lanes, tolerance),
    }
    for tolerance in (1e-8, 1e-10, 1e-12):
        swept(system, starts, tolerance)  # compiles all code, as heyoka's is before its time is taken
        for name, way in ways.items():
            took, ends = way(tolerance)
            error = np.max(np.abs(ends - truth), axis=1)
            print(
                f"{tolerance:g} {name}: {took:.2f} s, {len(starts) / took:,.0f} runs a second of processor time; "
                f"error: median {np.median(error):.1e}, worst {error.max():.1e}"
            )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 2000)
