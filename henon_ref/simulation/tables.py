"""Transitions and sticks of a run as data frames, and as named tuples one at a time."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from henon_ref.filippov.modes import mode_text
from henon_ref.filippov.system import FilippovSystem
from henon_ref.score.sticks import sticks
from henon_ref.trajectory import Transition

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = ("time_s", "kind", "surface", "from_mode", "to_mode")
"""Columns of a table of transitions, which the states follow by name."""
STICK_COLUMNS = ("start_s", "duration_s", "surface")
_named_tuple: Any = namedtuple
"""Whose fields no type checker can know."""


def row_of(system: FilippovSystem) -> Callable[[Transition], tuple[Any, ...]]:
    """What makes a row of a transition: a named tuple of COLUMNS and the states.

    Every name that a state may have is fit for a field: a letter first, no word of Python, none of the columns.
    """
    make = _named_tuple("TransitionRow", (*COLUMNS, *system.state_names))._make
    names = system.sign_names
    texts: dict[tuple[int, ...], str] = {}

    def text(mode: tuple[int, ...]) -> str:
        if mode not in texts:
            texts[mode] = mode_text(mode, names)
        return texts[mode]

    def made(event: Transition) -> tuple[Any, ...]:
        modes = text(event.from_mode), text(event.to_mode)
        return make((event.time, event.kind, names[event.surface], *modes, *event.state))

    return made


def transition_table(system: FilippovSystem, transitions: Sequence[Transition]) -> pd.DataFrame:
    """A row a transition: COLUMNS, then the states by name."""
    import pandas as pd

    columns = [*COLUMNS, *system.state_names]
    table = pd.DataFrame(list(map(row_of(system), transitions)), columns=columns)
    return table if len(table) else table.astype(dict.fromkeys(["time_s", *system.state_names], float))


def stick_table(system: FilippovSystem, transitions: Sequence[Transition], start: float) -> pd.DataFrame:
    """A row a whole stick, in order of their ends: one that the end of the run cuts off is left out."""
    import pandas as pd

    names = system.sign_names
    rows = [(s.start, s.duration, names[s.surface]) for s in sticks(transitions, start=start, after=start)]
    table = pd.DataFrame(rows, columns=list(STICK_COLUMNS))
    return table if rows else table.astype({"start_s": float, "duration_s": float})
