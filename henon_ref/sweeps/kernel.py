"""The reference on many points of one system: one compiled call for all of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.pairs import pair_of
from henon_ref.integrator.points import NOTHING, ExactPoint, Keep, PointRuns
from henon_ref.integrator.prepared_run import local_error
from henon_ref.integrator.records import HENON, transition_dtype
from henon_ref.integrator.run import Run
from henon_ref.integrator.transition_array import TransitionArray
from henon_ref.kernel.shared import kernel
from henon_ref.modes.mode import Mode
from henon_ref.sweeps.runs import Settings, Vector
from henon_ref.trajectory import Transition

OK = "the run reached its horizon"


@dataclass(frozen=True)
class Ended:
    """How K runs ended, and the transitions that are kept (see :class:`henon_ref.sweeps.runs.Runs`)."""

    status: NDArray[Any]
    message: NDArray[Any]
    end_time: Vector
    end_state: Vector
    end_mode: NDArray[np.int64]
    counts: NDArray[np.int64]
    run: NDArray[np.int64]
    records: NDArray[Any]
    modes: tuple[Mode, ...]
    refused: NDArray[np.bool_]


def together(wanted: Sequence[Keep]) -> Keep:
    """What is kept for several observations, of which each finds its own in it."""
    some = [keep for keep in wanted if keep != NOTHING]
    if not some:
        return NOTHING
    return Keep(after=min(keep.after for keep in some), open_sticks=any(keep.open_sticks for keep in some))


def run_points(
    integrator: Integrator,
    settings: Settings,
    parameters: Mapping[str, Vector],
    initial: Vector,
    times: Vector,
    keep: Keep,
) -> Ended:
    """Run K points.

    Parameters
    ----------
    integrator : Integrator
    settings : Settings
    parameters : mapping
        Every parameter -> its values, shape (K, 2), pairs of doubles like all numbers here.
    initial : ndarray, shape (K, n, 2)
    times : ndarray, shape (K, 2, 2)
        Initial time and horizon [s].
    keep : Keep
    """
    count = len(initial)
    values = np.empty((count, len(integrator.parameters), 2))
    for k, symbol in enumerate(integrator.parameters):
        values[:, k] = parameters[symbol.name]
    exact = _exact_points(settings, values, initial, times)
    if settings.mode:
        mode = {settings.system.model.sign_names.index(sign): side for sign, side in settings.mode.items()}
        return _one_by_one(integrator, [exact(k) for k in range(count)], settings, mode)
    runs = PointRuns(
        integrator,
        values,
        initial,
        start=times[:, 0],
        until=times[:, 1],
        tolerance=local_error(settings.rtol),
        landing=HENON,
        keep=keep,
        most_steps=settings.max_steps,
        exact=exact,
    )
    blocks = [block for block in runs if len(block)] if count else []
    records = np.concatenate([np.zeros(0, dtype=runs.transition_dtype), *blocks])
    order = np.argsort(records["point"], kind="stable")  # points that were set aside come behind others
    status, message = np.full(count, "ok", dtype=object), np.full(count, OK, dtype=object)
    end_mode = runs.ends["mode"].astype(np.int64)
    for point in np.flatnonzero(runs.ends["code"] == kernel.BUDGET_SPENT).tolist():
        status[point], message[point] = runs.status(point)
    for point, end in runs.others.items():
        status[point], message[point] = end.status, end.reason or OK
        if runs.start(point).refused is not None:  # there is no mode to begin with
            end_mode[point] = -1
    return Ended(
        status=status,
        message=message,
        end_time=runs.ends["time"].copy(),
        end_state=runs.states,
        end_mode=end_mode,
        counts=np.column_stack([runs.ends[name] for name in ("steps", "expansions", "guard_evaluations")]),
        run=records["point"][order].astype(np.int64),
        records=records[order],
        modes=tuple(runs.modes),
        refused=np.zeros(count, dtype=bool),
    )


def refused_runs(messages: Sequence[Any], initial: Vector, times: Vector) -> Ended:
    """How runs end that cannot begin.

    Parameters
    ----------
    messages : sequence of str
        Why, of each.
    initial, times
        As in :func:`run_points`.
    """
    count = len(initial)
    return Ended(
        status=np.full(count, "failed", dtype=object),
        message=np.array(messages, dtype=object),
        end_time=times[:, 0, 0].copy(),
        end_state=initial[:, :, 0].copy(),
        end_mode=np.full(count, -1),
        counts=np.zeros((count, 3), dtype=np.int64),
        run=np.zeros(0, dtype=np.int64),
        records=np.zeros(0, dtype=transition_dtype(initial.shape[1])),
        modes=(),
        refused=np.ones(count, dtype=bool),
    )


def _exact_points(settings: Settings, values: Vector, initial: Vector, times: Vector) -> Callable[[int], ExactPoint]:
    """What gives the exact numbers of a point that are pairs here: what :func:`simulate` takes in their place."""
    own = settings.exact_parameters

    def number(pair: list[float]) -> Any:
        high, low = pair
        if pair_of(high) == (high, low) or not math.isfinite(high):
            return high
        return own.get((high, low), sp.Rational(high) + sp.Rational(low))

    def point(k: int) -> ExactPoint:
        state, parameters = ([number(pair) for pair in pairs[k].tolist()] for pairs in (initial, values))
        return ExactPoint(tuple(parameters), state, *(number(pair) for pair in times[k].tolist()))

    return point


def _one_by_one(
    integrator: Integrator, points: Sequence[ExactPoint], settings: Settings, mode: Mapping[int, int]
) -> Ended:
    """The same where all runs start in a mode that is given: each is started by itself."""
    states = len(integrator.system.states)
    ends, records, nowhere = [], [np.zeros(0, dtype=transition_dtype(states))], []
    numbers: dict[Mode, int] = {}
    for own in points:
        start = integrator.begin(
            own.values, own.initial, start=own.start, until=own.until, tolerance=local_error(settings.rtol),
            landing=HENON, mode=mode, most_steps=settings.max_steps,
        )  # fmt: skip
        end = Run(integrator, start).to_horizon()
        ends.append(end)
        nowhere.append(start.refused is not None)
        records.append(_numbered(end.transitions, numbers) if len(end.transitions) else records[0])
    pairs = zip(ends, nowhere, strict=True)
    last = [-1 if no else numbers.setdefault(end.end_mode, len(numbers)) for end, no in pairs]
    return Ended(
        status=np.array([end.status for end in ends], dtype=object),
        message=np.array([end.reason or OK for end in ends], dtype=object),
        end_time=np.array([end.end_time for end in ends]),
        end_state=np.array([end.end_state for end in ends]).reshape(-1, states),
        end_mode=np.array(last, dtype=np.int64),
        counts=np.array([tuple(end.counts) for end in ends]).reshape(-1, 3),
        run=np.repeat(np.arange(len(ends)), [len(r) for r in records[1:]]),
        records=np.concatenate(records),
        modes=tuple(numbers),
        refused=np.zeros(len(ends), dtype=bool),
    )


def _with_modes(records: NDArray[Any], rows: NDArray[np.int64]) -> NDArray[Any]:
    """Records with other numbers for modes."""
    own = records.copy()
    own["from_mode"], own["to_mode"] = rows[own["from_mode"]], rows[own["to_mode"]]
    return own


def _numbered(transitions: Sequence[Transition], numbers: dict[Mode, int]) -> NDArray[Any]:
    """Records of transitions with modes by some numbers, to which new ones are added."""
    assert isinstance(transitions, TransitionArray)
    rows = np.array([numbers.setdefault(mode, len(numbers)) for mode in transitions.modes])
    return _with_modes(transitions.records, rows)


def joined(parts: Sequence[tuple[NDArray[np.int64], Ended]]) -> Ended:
    """Some parts of all runs as one.

    Parameters
    ----------
    parts : sequence of (ndarray, Ended)
        Numbers of the runs of each part, and how they ended.
    """
    order = np.argsort(np.concatenate([own for own, _ in parts]), kind="stable")
    found = {
        name: np.concatenate([getattr(ended, name) for _, ended in parts])[order]
        for name in ("status", "message", "end_time", "end_state", "counts", "refused")
    }
    numbers: dict[Mode, int] = {}
    end_mode, records = [], []
    for _, ended in parts:
        rows = np.array([*(numbers.setdefault(mode, len(numbers)) for mode in ended.modes), -1])
        end_mode.append(rows[ended.end_mode])
        records.append(_with_modes(ended.records, rows))
    run = np.concatenate([own[ended.run] for own, ended in parts])
    by_run = np.argsort(run, kind="stable")
    return Ended(
        **found,
        end_mode=np.concatenate(end_mode)[order],
        run=run[by_run],
        records=np.concatenate([own for own in records if len(own)] or records[:1])[by_run],
        modes=tuple(numbers),
    )
