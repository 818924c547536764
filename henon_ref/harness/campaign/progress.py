"""Progress of a campaign: a status line in a terminal or a notebook."""

from __future__ import annotations

import math
import time
from contextlib import AbstractContextManager
from typing import TextIO

from henon_ref.harness.campaign.options import Setting
from henon_ref.harness.campaign.rows import Record
from henon_ref.terminal import Line, in_notebook, is_terminal
from henon_ref.text import message

PERIOD = 0.2
"""Time between two updates of the line [s]; each update takes processor time from the timed runs."""
SELDOM = 5.0
"""Time between two lines in a stream that cannot overwrite a line, for example a file [s]."""
NOTICE_DELAY = 10.0
"""Time after which a command without a status line reports that a truth is being computed [s]."""
TRUTH = "truth"
"""Word that follows the name of a reading whose truth is being computed."""


class ProgressLine(AbstractContextManager["ProgressLine"]):
    """Status line with the number of finished rows and the current runs.

    It starts no thread, so that workers can be forked. Without a ``stream``, nothing is shown. ``name`` is that of the
    case, if a comparison is called from Python: the final line then remains, and a stream that cannot overwrite a line
    receives a new line every few seconds. Without a name (in a command) the line is erased at the end, and a stream
    that cannot overwrite a line receives one line per finished row.
    """

    def __init__(self, stream: TextIO | None, name: str | None = None) -> None:
        self._stream = stream
        self._name = name
        self._line = Line(stream)
        self.seen = is_seen(stream)
        """Whether the line can be overwritten."""
        self._what, self._done, self._total = "truths", 0, 0
        self._at_work: dict[str, float] = {}
        """Running task -> time of its start [s]."""
        self._began = time.monotonic()
        self._shown = -SELDOM
        self._wait_is_reported = self.seen or name is not None

    def __exit__(self, *exception: object) -> None:
        words = "" if self._name is None else f"{self._counted()}, {time.monotonic() - self._began:.1f} s"
        if self.seen:
            self._line.clear(words)
        elif words:
            self._print(words)

    def stage(self, what: str, total: int, done: int = 0) -> None:
        """Start a stage of ``total`` truths or rows, ``done`` of which are already finished."""
        self._at_work.clear()
        self._what, self._total, self._done = what, total, done

    def begun(self, case: str, what: str) -> None:
        """Note the start of a run of a case, or of the computation of a truth."""
        self._at_work[f"{case} {what}"] = time.monotonic()
        self.tick()

    def truth(self, name: str) -> None:
        """Note that the truth of a reading is available, or has failed."""
        self._at_work.pop(f"{name} {TRUTH}", None)
        self._done += 1

    def row(self, finished: Record) -> None:
        """Note a finished row."""
        run = finished.run
        what = f"{run.case} {run.reading} {run.solver} {Setting.of(run).label}"
        self._at_work.pop(what, None)
        self._done += 1
        if not self.seen and self._name is None:
            right = run.verdict == "right" and run.digits is not None
            found = f", {math.floor(10 * (run.digits or 0)) / 10} digits" if right else ""
            self._print(f"{self._done} of {self._total}: {what}: {run.verdict or run.status}{found}")

    def tick(self) -> None:
        """Update the line if it is due; called at short intervals.

        Without a line, report once that a truth takes long to compute.
        """
        now = time.monotonic()
        late = [
            what for what, since in self._at_work.items() if what.endswith(f" {TRUTH}") and now - since > NOTICE_DELAY
        ]
        if late and not self._wait_is_reported:
            self._wait_is_reported = True
            how_long = "(limited to a few minutes; `henon-ref truth` has no limit)"
            self._print(f"computing a truth that is not stored: {late[0]} {how_long}")
        if (self.seen or self._name is not None) and now - self._shown >= (PERIOD if self.seen else SELDOM):
            self._shown = now
            work = ", ".join(f"{what} ({now - since:.0f} s)" for what, since in self._at_work.items())
            words = f"{self._counted()}, {now - self._began:.0f} s{'; running: ' if work else ''}{work}"
            (self._line.show if self.seen else self._print)(words)

    def _counted(self) -> str:
        name = "" if self._name is None else f"{self._name}: "
        return f"{name}{self._done} of {self._total} {self._what}"

    def _print(self, words: str) -> None:
        if self._stream is not None:
            print(message(words), file=self._stream, flush=True)


def is_seen(stream: TextIO | None) -> bool:
    """Check whether a stream is a terminal or a notebook, whose lines can be overwritten."""
    return stream is not None and (in_notebook() or is_terminal(stream))
