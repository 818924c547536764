"""The paper's program with a switch for each of its mistakes: ``variants.c``, called from Python.

The audit of :mod:`henon_ref.harness.studies.paper.audit` uses it. With all switches off it is a correct implementation
of Sec. 3 for Eq. (18): order 4, Filippov's sliding. With all switches on it gives exactly the numbers of the appendix
as printed (:mod:`henon_ref.baselines.paper.listing`).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.paper.compiled import ffi, lib, rows
from henon_ref.baselines.paper.listing import EDGES, PRINTED_STEP, effective_changes, listing_parameters
from henon_ref.casefile.case import load_case
from henon_ref.casefile.files import shipped_folder

Floats = NDArray[np.float64]

DEFECTS: dict[str, str] = {
    "aliased_steps": "`xn = x` names one list twice: every Runge-Kutta stage moves the state itself",
    "one_sided_release": "a stick is tested against the upper tangent point only",
    "exit_side": "the stick is left to the wrong side (`k <> 2`)",
    "frozen_forcing": "the forcing of the start of a step stands at all its stages",
    "frozen_tangent": "the way back to the tangent point takes it where it is at the end of the step",
    "quantised_release": "aliased, that way back is zero: a release keeps the time of the end of the step",
    "landing_sign": "above the belt's speed the landing step has the wrong sign",
    "rounded_sixth": "`h*0.166666` stands for h/6 in the landing step",
}
"""Mistakes that change the result: name (a switch of ``struct defects``) and description."""

MAX_CHANGES = 20_000
"""Number of changes of mode after which a run counts as chattering."""


@dataclass(frozen=True)
class VariantRun:
    """Result of a run of one variant."""

    times: Floats
    """Times of the changes of mode [s]."""
    states: Floats
    """Positions and velocities at these times, shape (k, 2)."""
    modes: NDArray[np.int64]
    """Mode after each change: -1 below the belt's speed, 0 in stick, +1 above."""
    status: str
    """``ok``, ``chatters`` (the changes of mode never end) or ``diverged``."""
    path: Floats
    """Time, position and velocity after each step from ``path_from`` on, shape (steps, 3)."""


@cache
def fig8_numbers() -> tuple[float, ...]:
    """Parameters m, k1, k2, mu0, vp, A, w of Fig. 8, rounded to doubles."""
    return listing_parameters(load_case(shipped_folder() / "fig8.yaml").reading("listing_limit").problem)


def run_variant(
    defects: Collection[str],
    *,
    step: float = PRINTED_STEP,
    start: tuple[float, float] | None = None,
    until: float = 70.0,
    path_from: float | None = None,
) -> VariantRun:
    """Run the paper's program on Fig. 8 with some of its mistakes.

    Parameters
    ----------
    defects : collection of str
        Names of :data:`DEFECTS`.
    step : float
        Step h [s].
    start : tuple of float, optional
        Position and velocity at t = 0, in slip. Without it, the run starts in stick at [z(4), vp] as in the paper.
    until : float
        Horizon [s].
    path_from : float, optional
        Time from which the path is stored [s]. Without it, no path is stored.

    Raises
    ------
    KeyError
        If a defect is unknown.
    """
    for name in defects:
        DEFECTS[name]  # raises KeyError for an unknown name
    numbers = fig8_numbers()
    changes = np.empty((MAX_CHANGES, 5))
    path = np.empty((0 if path_from is None else int((until - path_from) / step) + 2 * MAX_CHANGES, 3))
    x = np.array([0.0, *((EDGES[3], numbers[4]) if start is None else start)])
    first = 0 if start is None else -1 if start[1] < numbers[4] else 1
    end = lib.variant_run(
        rows(x, "struct belt_state"), first == 0, until, step, rows(EDGES), ffi.new("struct belt *", numbers),
        ffi.new("struct defects *", dict.fromkeys(defects, 1)), rows(changes, "struct mode_change"), len(changes),
        rows(path, "struct belt_state"), len(path), path_from or 0.0,
    )  # fmt: skip
    kept = effective_changes(changes[: end.changes], first)
    kept = kept[kept[:, 1] <= until]
    status = ("ok", "chatters", "diverged")[end.ending]
    return VariantRun(kept[:, 1], kept[:, 2:4], kept[:, 4].astype(np.int64), status, path[: end.path])
