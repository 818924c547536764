"""Progress of a campaign on a terminal: a bar, and a line for each run at work."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from henon_ref.campaign.options import TRUTH, Silent
from henon_ref.campaign.rows import Record
from henon_ref.campaign.settings import Setting
from henon_ref.cli import status_line
from henon_ref.cli.colours import console_colours
from henon_ref.cli.exit_status import say
from henon_ref.text import message

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.progress import Progress, TaskID

PATIENCE = 10.0
"""Seconds after which it is said that a truth is being computed, where no progress is shown."""
PERIOD = 0.2
"""Seconds between two pictures: drawing them takes time from what is being timed."""
MOST_SHOWN = 8
"""Runs at work that are shown."""


class Shown(Silent, AbstractContextManager["Shown"]):
    """Progress on a terminal; elsewhere nothing. It never starts a thread, so that workers can be forked."""

    def __init__(self) -> None:
        self.on_terminal = status_line.is_terminal()
        self._wait_is_said = self.on_terminal
        """Whether it need not be said any more that a truth takes its time."""
        self._progress: Progress | None = None
        self._task: TaskID | None = None
        self._at_work: dict[str, float] = {}
        """What each process is at, and since when."""
        self._drawn = 0.0

    def __enter__(self) -> Shown:
        status_line.clear()
        if self.on_terminal:
            self._progress = _bar(self)
            self._progress.start()
        return self

    def __exit__(self, *exception: object) -> None:
        if self._progress is not None:
            self._progress.stop()

    def truths(self, readings: int) -> None:
        """The truths of so many readings are being read or computed."""
        self._begin("truths", readings, 0)

    def truth(self, name: str) -> None:
        """The truth of a reading is known."""
        self._at_work.pop(message(f"{name} {TRUTH}"), None)
        self._step()

    def runs(self, rows: int, kept: int) -> None:
        """So many rows are to be made, so many of them are kept from before."""
        self._begin("rows", rows, kept)

    def begun(self, case: str, what: str) -> None:
        """A run is begun, or the computation of a truth."""
        self._at_work[message(f"{case} {what}")] = time.monotonic()

    def row(self, finished: Record) -> None:
        """A row is finished."""
        run = finished.run
        label = Setting(rtol=run.rtol, step=run.step_s).label
        self._at_work.pop(message(f"{run.case} {run.reading} {run.solver} {label}"), None)
        self._step()

    def tick(self) -> None:
        """Some time has passed."""
        if not self._wait_is_said:
            self._tell_of_truths()
        if self._progress is not None and time.monotonic() - self._drawn > PERIOD:
            self._drawn = time.monotonic()
            self._progress.refresh()

    def _tell_of_truths(self) -> None:
        """Say, once, which truth takes its time where no line can be shown."""
        now = time.monotonic()
        late = [what for what, since in self._at_work.items() if what.endswith(f" {TRUTH}") and now - since > PATIENCE]
        if late:
            self._wait_is_said = True
            say(f"computing what is not stored: {late[0]} (at most some minutes; `truth` computes it without a limit)")

    def at_work(self) -> list[RenderableType]:
        """A line for each run at work: which one, and for how long."""
        from rich.text import Text

        now = time.monotonic()
        lines = [f"  {what}, {now - since:.0f} s" for what, since in list(self._at_work.items())[:MOST_SHOWN]]
        if self._progress is not None and all(task.finished for task in self._progress.tasks):
            lines.append("  figures and reports")
        return [Text(line, no_wrap=True, overflow="ellipsis") for line in lines]

    def _begin(self, what: str, total: int, done: int) -> None:
        self._at_work.clear()
        if self._progress is not None:
            if self._task is not None:
                self._progress.remove_task(self._task)
            self._task = self._progress.add_task(what, total=total, completed=done)
            self._progress.refresh()

    def _step(self) -> None:
        if self._progress is not None and self._task is not None:
            self._progress.advance(self._task)


def _bar(shown: Shown) -> Progress:
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    class Bar(Progress):
        def get_renderables(self) -> Iterator[RenderableType]:
            yield from super().get_renderables()
            yield from shown.at_work()

    columns = (
        MofNCompleteColumn(),
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("left", markup=False),
        TimeRemainingColumn(),
    )
    return Bar(*columns, console=Console(stderr=True, **console_colours()), transient=True, auto_refresh=False)
