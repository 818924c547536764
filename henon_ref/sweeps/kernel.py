"""The reference on many points of one system."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.henon.integrator import Integrator
from henon_ref.henon.records import HENON, transition_dtype
from henon_ref.henon.run import Run
from henon_ref.henon.transition_array import TransitionArray
from henon_ref.simulation.arguments import problem_of
from henon_ref.simulation.compiled import local_error
from henon_ref.sweeps.runs import Settings, Vector


@dataclass(frozen=True)
class Ended:
    """How K runs ended, and their transitions (see :class:`henon_ref.sweeps.runs.Runs`)."""

    status: NDArray[Any]
    message: NDArray[Any]
    end_time: Vector
    end_state: Vector
    end_mode: NDArray[np.int64]
    counts: NDArray[np.int64]
    run: NDArray[np.int64]
    records: NDArray[Any]


def run_points(integrator: Integrator, settings: Settings, parameters: Mapping[str, Vector], initial: Vector) -> Ended:
    ends, blocks, runs = [], [], []
    model = integrator.system
    for k in range(len(initial)):
        system, problem = problem_of(
            settings.system,
            dict(zip(settings.system.state, initial[k].tolist())),
            until=settings.until,
            start=settings.start,
            parameters={name: float(v[k]) for name, v in parameters.items()},
            mode=settings.mode,
        )
        from dataclasses import replace

        problem = replace(problem, system=replace(model, parameters=problem.system.parameters))
        start = integrator.start(problem, tolerance=local_error(settings.rtol), landing=HENON)
        end = Run(integrator, start).to_horizon()
        ends.append(end)
        records = end.transitions.records if isinstance(end.transitions, TransitionArray) else np.zeros(0, dtype=transition_dtype(len(model.states)))
        blocks.append(records)
        runs.append(np.full(len(records), k))
    modes = {m: i for i, m in enumerate(integrator.mode_table.modes)}
    return Ended(
        status=np.array([e.status for e in ends], dtype=object),
        message=np.array([e.reason or "the run reached its horizon" for e in ends], dtype=object),
        end_time=np.array([e.end_time for e in ends]),
        end_state=np.array([e.end_state for e in ends]),
        end_mode=np.array([modes.get(e.end_mode, -1) for e in ends]),
        counts=np.array([tuple(e.counts) for e in ends]),
        run=np.concatenate(runs),
        records=np.concatenate(blocks),
    )
