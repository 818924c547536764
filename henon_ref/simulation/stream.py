"""The transitions of a run as they come."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from henon_ref.henon.run import Run
from henon_ref.simulation.outcome import Outcome
from henon_ref.simulation.system import System
from henon_ref.simulation.tables import row_of


class TransitionStream(Iterator[Any]):
    """An iterator over the transitions of one run, which goes on as they are asked for and keeps none.

    Attributes
    ----------
    outcome : Outcome or None
        How the run ended, once it is through.
    """

    def __init__(self, system: System, run: Run) -> None:
        self.outcome: Outcome | None = None
        self._rows = self._made(system, run)

    def _made(self, system: System, run: Run) -> Iterator[Any]:
        row = row_of(system.model)
        for block in run.stream():
            yield from map(row, block)
        assert run.ended is not None
        self.outcome = Outcome(system, run.ended._replace(transitions=()))

    def __next__(self) -> Any:
        return next(self._rows)
