"""The transitions of a run as they come."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from henon_ref.integrator.run import Run
from henon_ref.modes.kinks import HiddenKinks
from henon_ref.simulation.launch import Launch
from henon_ref.simulation.outcome import Outcome
from henon_ref.simulation.tables import rows_of


class TransitionStream(Iterator[Any]):
    """An iterator over the transitions of one run, which goes on as they are asked for and keeps none.

    Attributes
    ----------
    outcome : Outcome or None
        How the run ended, once it is through.
    """

    def __init__(self, made: Launch) -> None:
        self.outcome: Outcome | None = None
        self._rows = self._made(made)

    def _made(self, made: Launch) -> Iterator[Any]:
        model = made.base.model
        run, rows, kinks = Run(made.integrator, made.start), rows_of(model), HiddenKinks(model)
        for block in run.stream():
            yield from rows(block.visible(kinks) if model.kinks else block)
        assert run.ended is not None
        self.outcome = Outcome(made.base, made.parameters, made.ended(run.ended)._replace(transitions=()))

    def __next__(self) -> Any:
        return next(self._rows)
