"""The reference on many points of one system: one compiled call for all of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.henon.integrator import Integrator
from henon_ref.henon.points import NOTHING, Keep, PointRuns
from henon_ref.henon.records import HENON
from henon_ref.simulation.compiled import local_error
from henon_ref.sweeps.runs import Settings, Vector

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


def together(wanted: Sequence[Keep]) -> Keep:
    """What is kept for several observations, of which each finds its own in it."""
    some = [keep for keep in wanted if keep != NOTHING]
    if not some:
        return NOTHING
    return Keep(after=min(keep.after for keep in some), open_sticks=any(keep.open_sticks for keep in some))


def run_points(
    integrator: Integrator, settings: Settings, parameters: Mapping[str, Vector], initial: Vector, keep: Keep
) -> Ended:
    """Run K points.

    Parameters
    ----------
    integrator : Integrator
    settings : Settings
    parameters : mapping
        Every parameter -> its values, shape (K,).
    initial : ndarray, shape (K, n)
    keep : Keep
    """
    count, number = len(initial), settings.system.number
    values = np.empty((count, len(integrator.parameters)))
    for k, symbol in enumerate(integrator.parameters):
        values[:, k] = parameters[symbol.name]
    runs = PointRuns(
        integrator,
        values,
        initial,
        start=float(sp.N(number(settings.start))),
        until=float(sp.N(number(settings.until))),
        tolerance=local_error(settings.rtol),
        landing=HENON,
        keep=keep,
    )
    blocks = [block for block in runs if len(block)] if count else []
    records = np.concatenate([np.zeros(0, dtype=runs.transition_dtype), *blocks])
    order = np.argsort(records["point"], kind="stable")  # points that were set aside come behind others
    status, message = np.full(count, "ok", dtype=object), np.full(count, OK, dtype=object)
    end_mode = runs.ends["mode"].astype(np.int64)
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
    )
