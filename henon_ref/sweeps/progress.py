"""The progress of a sweep on a terminal or in a notebook: points done, runs a second, time left."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from henon_ref.simulation.notice import NotebookLine, in_notebook, is_watched

PERIOD = 0.2
"""Seconds between two pictures."""
Advance = Callable[[int, bool], None]
"""Takes a number of points, and whether they are kept from before."""


@contextmanager
def shown(total: int, *, quiet: bool = False) -> Iterator[Advance]:
    """Show a bar on standard error, where that is a terminal, or in a notebook; elsewhere nothing.

    Parameters
    ----------
    total : int
        Points of the sweep.
    quiet : bool
        Show nothing there, either.
    """
    if quiet or not is_watched():
        yield lambda points, kept: None
        return
    if in_notebook():
        with _notebook_line(total) as advance:
            yield advance
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        MofNCompleteColumn(),
        TextColumn("points"),
        BarColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    # It starts no thread, so that workers can be forked.
    with Progress(*columns, console=Console(stderr=True), transient=True, auto_refresh=False) as bar:
        task = bar.add_task("points", total=total, rate="")
        began, run, drawn = time.monotonic(), 0, [0.0]
        bar.refresh()

        def advance(points: int, kept: bool) -> None:
            nonlocal run
            run += 0 if kept else points
            bar.update(task, advance=points, rate=f"{run / max(time.monotonic() - began, 1e-9):,.0f} runs/s")
            if time.monotonic() - drawn[0] > PERIOD:
                drawn[0] = time.monotonic()
                bar.refresh()

        yield advance


@contextmanager
def _notebook_line(total: int) -> Iterator[Advance]:
    """A line in a notebook, which stays there with the whole time."""
    line, began, drawn, done, run = NotebookLine(), time.monotonic(), 0.0, 0, 0

    def advance(points: int, kept: bool) -> None:
        nonlocal done, run, drawn
        done, run, now = done + points, run + (0 if kept else points), time.monotonic()
        if now - drawn > PERIOD:
            drawn = now
            rate = run / max(now - began, 1e-9)
            left = f", {(total - done) / rate:.0f} s left" if run else ""
            line.show(f"{done:,} of {total:,} points, {rate:,.0f} runs/s{left}")

    yield advance
    line.show(f"{done:,} of {total:,} points in {time.monotonic() - began:.1f} s")
