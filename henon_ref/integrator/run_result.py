"""Result of a run, made from the memory of the run when it is read."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields
from typing import Any

from henon_ref.integrator.mode_table import ModeTable
from henon_ref.integrator.records import Workspace, read
from henon_ref.integrator.transition_array import TransitionArray
from henon_ref.modes.kinks import HiddenKinks
from henon_ref.trajectory import Counts, Status, Trajectory

Reason = str | Callable[[], str]
"""Reason of an ending, or a function that returns it: making the sentence takes longer than many runs."""
_FIELDS = tuple(field.name for field in fields(Trajectory))


class RunResult(Trajectory):
    """Trajectory whose fields, except the status, are made when one is first read: they take longer than a short run.

    Parameters
    ----------
    table : ModeTable
    workspace : Workspace
        Memory of the run, which may be used for another run afterwards.
    kinks : HiddenKinks, optional
        Kinks whose transitions are left out if another branch hides them.
    status : Status
    reason : str or callable
    """

    def __init__(
        self,
        table: ModeTable,
        workspace: Workspace,
        kinks: HiddenKinks | None = None,
        status: Status = "ok",
        reason: Reason = "",
    ) -> None:
        found = workspace.unpack(workspace.memory)
        rows = workspace.transitions[: found[5]].copy() if found[5] else None
        since = workspace.since.tolist() if found[6] else ()
        self.status, self._made_of = status, (table, found, rows, since, reason, kinks)

    def __getattr__(self, name: str) -> Any:
        """Make the fields; called for an attribute that does not exist."""
        if name not in _FIELDS:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        table, found, rows, since, reason, kinks = self._made_of
        surfaces = len(table.system.surfaces)  # the ``valid`` expressions follow them
        self.transitions = () if rows is None else TransitionArray(rows, table.modes, table.contacts, kinks)
        self.end_time, self.end_state = found[0], found[7:-1]
        mode = table.mode(read(found[-1]) if table.contacts else found[1])
        self.end_mode = kinks.shown(mode) if kinks else mode
        self.reason, self.counts = reason if isinstance(reason, str) else reason(), Counts(*found[2:5])
        self.undecided_after = tuple((i if i < surfaces else -1, t) for i, t in enumerate(since) if t < math.inf)
        return getattr(self, name)

    def __reduce__(self) -> Any:
        """Pickle the fields alone, not the compiled modes."""
        return Trajectory, tuple(getattr(self, name) for name in _FIELDS)
