"""``henon-listing``: the program of the paper's appendix as printed, including its mistakes, as a solver.

``listing.c`` has a switch for each mistake, and explains it there. All of them are on in ``henon-listing``; with some
(:func:`run_variant`) the audit of :mod:`henon_ref.harness.studies.paper.audit` runs. With none the program is a correct
implementation of Sec. 3 for Eq. (18), of order 4 with Filippov's sliding.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.baselines.paper import COMPILER, ffi, lib, rows
from henon_ref.casefile.case import load_case
from henon_ref.casefile.files import shipped_folder
from henon_ref.errors import UnsupportedError
from henon_ref.expressions.algebra import simplified
from henon_ref.modes.mode import Mode, transition_kind
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
from henon_ref.solver import Run
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Counts, Status, Trajectory, Transition

Floats = NDArray[np.float64]

_UPPER = 2 * math.sqrt(3) / 3 * np.array([math.cos(math.pi / 9), math.cos(2 * math.pi / 9), math.sin(math.pi / 18)])
EDGES = np.array([*_UPPER, *-_UPPER[::-1]])
"""Tangent points z of Eq. (24), highest first: the stick zones are [1, 0], [3, 2] and [5, 4]."""
PRINTED_STEP = 1e-4
"""The step of the appendix [s]."""
MAX_CHANGES = 200_000
"""Largest number of changes of mode; the listing at h = 1e-4 makes 180."""
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


class Listing:
    """Solver ``henon-listing``: the appendix as printed.

    It supports only the system that is the limit of the listing for h -> 0, the reading ``listing_limit`` of
    ``cases/fig8.yaml``: slip by ``3 f`` with f of Eq. (18), and a stick that ends when z rises through the middle
    upper tangent point. It reads m, k1, k2, mu0, vp, A and w by name; the tangent points are constants of the listing.

    The listing counts passes and has no horizon. The trajectory's end state is that after the last pass, whose time may
    differ from the horizon by some steps, although the trajectory's end time is the horizon.

    A transition is reported when the listing changes its mode, with the listing's time and state. If a release is
    followed by a step that lands again and turns to the other side, both are reported as one release to that side.

    ``steps`` and ``event_evaluations`` are passes of the loop. ``rhs_evaluations`` is 4 for each pass in slip and 4 for
    each landing. The deadline is not checked: a million passes take about 20 ms.
    """

    name = "henon-listing"
    fixed_step = True
    landing = "listing"
    version = COMPILER

    def prepare(
        self,
        problem: Problem,
        *,
        rtol: float | None = None,
        atol: float | None = None,
        step: float | None = None,
        sample_times: Floats | None = None,
        deadline: float | None = None,
    ) -> Run:
        """Check the system and the step (see :class:`henon_ref.solver.Solver`)."""
        if step is None or not step > 0:
            raise UnsupportedError(f"{self.name} needs a positive step, got {step}")
        numbers = listing_parameters(problem)
        until = float(problem.until)
        steps = round((until - float(problem.start)) / step)
        if steps > 2e8:
            raise UnsupportedError(f"{self.name} has no deadline and supports at most 2e+08 steps")
        start = _start(problem)
        start_mode = _start_mode(start, numbers[4])

        def run() -> Trajectory:
            x = np.array([float(problem.start), *start])
            room = 0 if sample_times is None else steps + 1
            end, changes, path = _run(
                x, numbers, DEFECTS, sticking=start_mode == (0,), passes=steps + 1, step=step, most=MAX_CHANGES,
                path_room=room,
            )  # fmt: skip
            status: Status = "ok" if np.isfinite(x).all() else "diverged"
            reason = "" if status == "ok" else "the state is no longer finite"
            if end.changes == MAX_CHANGES:
                status, reason = "failed", f"more than {MAX_CHANGES} changes of mode: it chatters"
            return Trajectory(
                status=status,
                transitions=_transitions(changes, start_mode, until),
                end_time=until if status == "ok" else min(float(x[0]), until),
                end_state=(float(x[1]), float(x[2])),
                end_mode=(end.mode,),
                reason=reason,
                counts=Counts(steps + 1, 4 * (end.slips + end.landings), steps + 1),
                samples=None if sample_times is None else _sampled(np.asarray(sample_times, dtype=float), path),
            )

        return run


LISTING = Listing()


def listing_parameters(problem: Problem) -> tuple[float, ...]:
    """Return m, k1, k2, mu0, vp, A, w of a problem with the listing's system, rounded to doubles.

    If the system is another one, the UnsupportedError names the difference.
    """
    read = ("m", "k1", "k2", "mu0", "vp", "A", "w")
    named = {symbol.name: symbol for symbol in problem.system.parameters}
    missing = [name for name in read if name not in named]
    different = f"no parameter {', '.join(missing)}" if missing else _difference(problem.system, named)
    if different:
        raise UnsupportedError(f"henon-listing runs the system of Fig. 8 only: {different}")
    return tuple(float(problem.system.parameters[named[name]]) for name in read)


def _difference(system: FilippovSystem, p: Mapping[str, sp.Symbol]) -> str:
    """Describe the first difference between the system and the limit of the listing; empty if there is none."""
    if system.resets:
        return "its state does not jump"
    if len(system.states) != 2 or len(system.surfaces) != 1:
        return "it has two states and one surface"
    override = system.overrides.get(0)
    if override is None or len(override.release) != 1 or override.entry != "attracting":
        return "its stick is not Filippov's: it needs the 'sliding' override with one release and entry 'attracting'"
    position, velocity = system.states
    z = position - p["A"] * sp.sin(p["w"] * TIME)
    force = p["k2"] * z**3 - p["k1"] * z
    release = override.release[0]
    middle = 2 * sp.sqrt(3) / 3 * sp.sin(sp.pi / 18)
    if release.to != -1 or (release.direction == "falling") == _same(system, release.when, z - middle):
        return "its stick ends where z rises through the upper middle tangent point, into s = -1"
    expected = [
        ("surface", system.surfaces[0], velocity - p["vp"]),
        ("stick", override.field[0], p["vp"]),
        ("stick", override.field[1], sp.Integer(0)),
    ]
    for sign in (-1, 1):
        field = system.equations((sign,)).field
        friction = p["mu0"] / (p["vp"] - velocity - sign)
        expected += [("slip", field[0], 3 * velocity), ("slip", field[1], 3 * (force + friction) / p["m"])]
    for what, given, wanted in expected:
        if not _same(system, given, wanted):
            return f"its {what} has {wanted} where the case has {given}"
    return ""


def _same(system: FilippovSystem, one: sp.Expr, other: sp.Expr) -> bool:
    return bool(simplified(system.numeric(one - other)) == 0)


def _start(problem: Problem) -> tuple[float, float]:
    """Initial position and velocity; a position at a tangent point is replaced by the listing's double."""
    position, velocity = (float(v) for v in problem.initial)
    near = [float(edge) for edge in EDGES if math.isclose(edge, position, rel_tol=1e-15)]
    return (near[0] if near else position), velocity


def _start_mode(start: tuple[float, float], vp: float) -> Mode:
    """Mode of the listing at the start: stick if the velocity is the belt's, in a zone that the listing tests."""
    position, velocity = start
    if velocity != vp:
        return (-1,) if velocity < vp else (1,)
    return (0,) if any(EDGES[i + 1] <= position <= EDGES[i] for i in (0, 2)) else (1,)


def _transitions(changes: Floats, start: Mode, until: float) -> tuple[Transition, ...]:
    """Convert the changes of mode up to the horizon to transitions; the last passes may be after the horizon."""
    found: list[Transition] = []
    mode = start
    for _, time, position, velocity, entry in effective_changes(changes, start[0]).tolist():
        if time <= until:
            new = (int(entry),)
            kind = transition_kind(mode[0], new[0])
            found.append(Transition(kind, 0, mode, new, time, (position, velocity), landing="listing"))
            mode = new
    return tuple(found)


def effective_changes(changes: Floats, start: int) -> Floats:
    """Merge each release that the next step undoes with the change of that step.

    Such a release goes to one side, and the next step lands again and turns to the other side. The result has one
    release to the other side, at the time of the release. ``changes``: step, time, position, velocity and mode after
    each change, shape (k, 5); ``start``: mode before the first change.
    """
    modes = changes[:, 4]
    released = np.concatenate(([start], modes[:-1])) == 0
    undone = np.flatnonzero(released[:-1] & (np.diff(changes[:, 0]) == 1) & (modes[1:] != 0))
    kept = changes.copy()
    kept[undone, 4] = modes[undone + 1]
    return np.delete(kept, undone + 1, axis=0)


def _sampled(wanted: Floats, path: Floats) -> Floats:
    """Interpolate positions and velocities linearly between steps; NaN after the end."""
    return np.column_stack([np.interp(wanted, path[:, 0], path[:, i], right=np.nan) for i in (1, 2)])


def _run(
    x: Floats,
    numbers: tuple[float, ...],
    defects: Collection[str],
    *,
    sticking: bool,
    passes: int,
    until: float = math.inf,
    step: float,
    most: int,
    path_room: int,
    path_from: float = -math.inf,
) -> tuple[Any, Floats, Floats]:
    """Run the program (``listing_run`` of ``paper.h``) with some :data:`DEFECTS` from time and state ``x``, updated.

    Return its ``struct listing_end``, the changes of mode, at most ``most``, and the path.
    """
    changes, path = np.empty((most, 5)), np.empty((path_room, 3))
    end = lib.listing_run(
        rows(x, "struct belt_state"), sticking, passes, until, step, rows(EDGES), ffi.new("struct belt *", numbers),
        ffi.new("struct defects *", dict.fromkeys(defects, 1)), rows(changes, "struct mode_change"), most,
        rows(path, "struct belt_state"), path_room, path_from,
    )  # fmt: skip
    return end, changes[: end.changes], path[: end.path]


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
    """Run the paper's program on Fig. 8 with some of its mistakes, named in :data:`DEFECTS`; KeyError for other names.

    ``step``: h [s]; ``start``: position and velocity at t = 0, in slip (None: in stick at [z(4), vp], as in the paper);
    ``until``: horizon [s]; ``path_from``: time from which the path is stored [s] (None: no path).
    """
    numbers = fig8_numbers()
    most = 20_000  # with more changes a run counts as chattering
    x = np.array([0.0, *((EDGES[3], numbers[4]) if start is None else start)])
    first = 0 if start is None else -1 if start[1] < numbers[4] else 1
    room = 0 if path_from is None else int((until - path_from) / step) + 2 * most
    end, changes, path = _run(
        x, numbers, defects, sticking=first == 0, passes=2**62, until=until, step=step, most=most,
        path_room=room, path_from=path_from or 0.0,
    )  # fmt: skip
    kept = effective_changes(changes, first)
    kept = kept[kept[:, 1] <= until]
    status = "chatters" if end.changes == most else "ok" if np.isfinite(x).all() else "diverged"
    return VariantRun(kept[:, 1], kept[:, 2:4], kept[:, 4].astype(np.int64), status, path)
