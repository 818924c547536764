"""Tables of a run: transitions, sticks and states as data frames, and transitions as named tuples."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.integrator.run_result import KINDS, TransitionArray
from henon_ref.modes.mode import Mode, mode_text
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Transition, sticks

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = ("time_s", "kind", "surface", "from_mode", "to_mode")
"""Columns of a table of transitions; the states follow by name."""


def columns_of(system: FilippovSystem, transitions: TransitionArray) -> dict[str, NDArray[Any]]:
    """Return the columns of a table of transitions by name: COLUMNS, then the states."""
    records = transitions.records
    rows, places = np.unique([records["from_mode"], records["to_mode"]], return_inverse=True)
    texts = np.array([mode_text(transitions.modes[row], system.sign_names) for row in rows.tolist()], dtype=object)
    before, after = texts[places.reshape(2, -1)]
    return {
        "time_s": records["time"],
        "kind": np.array(KINDS, dtype=object)[records["kind"]],
        "surface": np.array(system.sign_names, dtype=object)[records["surface"]],
        "from_mode": before,
        "to_mode": after,
        **dict(zip(system.state_names, records["state"].T, strict=True)),
    }


def rows_of(system: FilippovSystem) -> Callable[[TransitionArray], Iterator[Any]]:
    """Return a function that converts transitions to named tuples with the fields COLUMNS and the states.

    Every valid state name is a valid field: it begins with a letter and is neither a Python keyword nor a column.
    """
    make = namedtuple("TransitionRow", (*COLUMNS, *system.state_names))._make  # type: ignore[attr-defined]

    def rows(transitions: TransitionArray) -> Iterator[Any]:
        return map(make, zip(*(c.tolist() for c in columns_of(system, transitions).values()), strict=True))

    return rows


def transition_table(system: FilippovSystem, transitions: TransitionArray) -> pd.DataFrame:
    """Return a table with one row per transition: COLUMNS, then the states by name."""
    import pandas as pd

    return pd.DataFrame(columns_of(system, transitions))


def stick_table(system: FilippovSystem, transitions: Sequence[Transition], start: float) -> pd.DataFrame:
    """Return a table with one row per stick that ends within the run, ordered by end."""
    import pandas as pd

    found = sticks(transitions, start=start, after=start)
    columns = {
        "start_s": np.array([s.start for s in found], dtype=np.float64),
        "duration_s": np.array([s.duration for s in found], dtype=np.float64),
        "surface": np.array([system.sign_names[s.surface] for s in found], dtype=object),
    }
    return pd.DataFrame(columns)


def state_table(
    system: FilippovSystem, times: NDArray[np.float64], states: NDArray[np.float64], modes: Sequence[Mode]
) -> pd.DataFrame:
    """Return a table with one row per time: ``t``, the states, and the signs; ``states`` has shape (k, n)."""
    import pandas as pd

    signs = system.sign_names
    table = np.array([mode or (0,) * len(signs) for mode in modes], dtype=np.int64).reshape(len(times), len(signs))
    named = dict(zip(system.state_names, states.T, strict=True)) | dict(zip(signs, table.T, strict=True))
    return pd.DataFrame({TIME.name: times} | named)
