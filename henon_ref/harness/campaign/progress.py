"""How a campaign gets on: who is told, and one line that is written over, on a terminal or in a notebook."""

from __future__ import annotations

import math
import sys
import time
from contextlib import AbstractContextManager
from typing import TextIO

from henon_ref.harness.campaign.options import Setting
from henon_ref.harness.campaign.rows import Record
from henon_ref.terminal import Line, in_notebook, is_terminal
from henon_ref.text import message

PERIOD = 0.2
"""Seconds between two pictures of the line: drawing it takes time from what is being timed."""
SELDOM = 5.0
"""Seconds between two lines where none can be written over: in a file."""
PATIENCE = 10.0
"""Seconds after which a command says that a truth is being computed, where it shows no line."""
TRUTH = "truth"
"""What is said to be begun of a reading whose truth is computed, behind its name."""


class Observer:
    """Is told how a campaign gets on; this one shows nothing."""

    def stage(self, what: str, total: int, done: int = 0) -> None:
        """So many truths, or rows, are to be made; so many of them are kept from before."""

    def begun(self, case: str, what: str) -> None:
        """A run of a case is begun, or the computation of a truth."""

    def truth(self, name: str) -> None:
        """The truth of a reading is known, or that there is none."""

    def row(self, finished: Record) -> None:
        """A row is finished."""

    def tick(self) -> None:
        """Some time has passed."""


class ProgressLine(Observer, AbstractContextManager["ProgressLine"]):
    """How many rows are done, and which runs are at work. It never starts a thread, so that workers can be forked.

    Parameters
    ----------
    stream : TextIO, optional
        None: standard error.
    name : str, optional
        Of the case, where a comparison is called from Python: the last line stays, and where none can be written over,
        there is one now and then. A command takes it back, and where none can be written over it tells of each row.
    """

    def __init__(self, stream: TextIO | None = None, name: str | None = None) -> None:
        self._stream = stream or sys.stderr
        self._name = name
        self._line = Line(self._stream)
        self.seen = is_seen(self._stream)
        """Whether the line is written over."""
        self._what, self._done, self._total = "truths", 0, 0
        self._at_work: dict[str, float] = {}
        """What was begun, and when."""
        self._began = time.monotonic()
        self._shown = -SELDOM
        self._wait_is_said = self.seen or name is not None

    def __exit__(self, *exception: object) -> None:
        words = "" if self._name is None else f"{self._counted()}, {time.monotonic() - self._began:.1f} s"
        if self.seen:
            self._line.end(words)
        elif words:
            self._tell(words)

    def stage(self, what: str, total: int, done: int = 0) -> None:
        self._at_work.clear()
        self._what, self._total, self._done = what, total, done

    def begun(self, case: str, what: str) -> None:
        self._at_work[f"{case} {what}"] = time.monotonic()
        self.tick()

    def truth(self, name: str) -> None:
        self._at_work.pop(f"{name} {TRUTH}", None)
        self._done += 1

    def row(self, finished: Record) -> None:
        run = finished.run
        what = f"{run.case} {run.reading} {run.solver} {Setting.of(run).label}"
        self._at_work.pop(what, None)
        self._done += 1
        if not self.seen and self._name is None:
            right = run.verdict == "right" and run.digits is not None
            found = f", {math.floor(10 * (run.digits or 0)) / 10} digits" if right else ""
            self._tell(f"{self._done} of {self._total}: {what}: {run.verdict or run.status}{found}")

    def tick(self) -> None:
        """Show the line, now and then; say once which truth takes its time where no line can be shown."""
        now = time.monotonic()
        late = [what for what, since in self._at_work.items() if what.endswith(f" {TRUTH}") and now - since > PATIENCE]
        if late and not self._wait_is_said:
            self._wait_is_said = True
            how_long = "(at most some minutes; `truth` computes it without a limit)"
            self._tell(f"computing what is not stored: {late[0]} {how_long}")
        if (self.seen or self._name is not None) and now - self._shown >= (PERIOD if self.seen else SELDOM):
            self._shown = now
            work = ", ".join(f"{what} ({now - since:.0f} s)" for what, since in self._at_work.items())
            words = f"{self._counted()}, {now - self._began:.0f} s{'; at work: ' if work else ''}{work}"
            (self._line.show if self.seen else self._tell)(words)

    def _counted(self) -> str:
        name = "" if self._name is None else f"{self._name}: "
        return f"{name}{self._done} of {self._total} {self._what}"

    def _tell(self, words: str) -> None:
        print(message(words), file=self._stream, flush=True)


def is_seen(stream: TextIO | None) -> bool:
    """Whether somebody watches a stream and a line of it can be written over: a terminal, or a notebook."""
    return stream is not None and (in_notebook() or is_terminal(stream))
