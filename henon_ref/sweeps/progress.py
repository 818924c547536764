"""The progress of a sweep on a terminal or in a notebook: points done, runs a second, time left."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from henon_ref.terminal import Line, in_notebook

PERIOD = 0.2
"""Seconds between two pictures."""
Advance = Callable[[int, bool], None]
"""Takes a number of points, and whether they are kept from before."""


@contextmanager
def shown(total: int, *, quiet: bool = False) -> Iterator[Advance]:
    """Show a line on standard error, where that is a terminal, or in a notebook, where it stays; elsewhere nothing.

    Parameters
    ----------
    total : int
        Points of the sweep.
    quiet : bool
        Show nothing there, either.
    """
    line, began, drawn, done, run = Line(), time.monotonic(), 0.0, 0, 0

    def advance(points: int, kept: bool) -> None:
        nonlocal done, run, drawn
        done, run, now = done + points, run + (0 if kept else points), time.monotonic()
        if now - drawn > PERIOD and not quiet:
            drawn = now
            rate = run / max(now - began, 1e-9)
            left = f", {(total - done) / rate:.0f} s left" if run else ""
            line.show(f"{done:,} of {total:,} points, {rate:,.0f} runs/s{left}")

    try:
        yield advance
    finally:
        line.end()
    if in_notebook() and not quiet:
        line.show(f"{done:,} of {total:,} points in {time.monotonic() - began:.1f} s")
