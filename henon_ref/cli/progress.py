"""Progress of a campaign on a terminal."""

from __future__ import annotations

import sys
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from henon_ref.campaign.options import Silent
from henon_ref.campaign.rows import Record
from henon_ref.text import message

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID


class Shown(Silent, AbstractContextManager["Shown"]):
    """Progress on a terminal; elsewhere nothing. It never starts a thread, so that workers can be forked."""

    def __init__(self) -> None:
        self._progress: Progress | None = None
        self._task: TaskID | None = None

    def __enter__(self) -> Shown:
        if sys.stderr is not None and sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

            columns = (
                TextColumn("{task.description}", markup=False),
                BarColumn(),
                MofNCompleteColumn(),
                TimeElapsedColumn(),
            )
            self._progress = Progress(*columns, console=Console(stderr=True), transient=True, auto_refresh=False)
            self._progress.start()
        return self

    def __exit__(self, *exception: object) -> None:
        if self._progress is not None:
            self._progress.stop()

    def truths(self, readings: int) -> None:
        """The truths of so many readings are being read or computed."""
        if self._progress is not None:
            self._task = self._progress.add_task("truth", total=readings)

    def truth(self, name: str) -> None:
        """The truth of a reading is known."""
        self._step(f"truth of {name}")

    def runs(self, rows: int, kept: int) -> None:
        """So many rows are to be made, so many of them are kept from before."""
        if self._progress is not None:
            if self._task is not None:
                self._progress.remove_task(self._task)
            self._task = self._progress.add_task("runs", total=rows, completed=kept)

    def begun(self, case: str, what: str) -> None:
        """A run is begun."""
        if self._progress is not None and self._task is not None:
            self._progress.update(self._task, description=message(f"{case} {what}"))

    def row(self, finished: Record) -> None:
        """A row is finished."""
        self._step(None)

    def tick(self) -> None:
        """Some time has passed."""
        if self._progress is not None:
            self._progress.refresh()

    def _step(self, description: str | None) -> None:
        if self._progress is not None and self._task is not None:
            if description is not None:
                self._progress.update(self._task, description=description)
            self._progress.advance(self._task)
