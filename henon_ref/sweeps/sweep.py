"""Many runs of one system: the function :func:`sweep`."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from operator import itemgetter
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from henon_ref.errors import ArgumentError
from henon_ref.integrator.integrator import MOST_STEPS
from henon_ref.simulation.arguments import whole_number
from henon_ref.simulation.system import System
from henon_ref.sweeps.chunk import Tables, execute
from henon_ref.sweeps.plan import MOST_CHUNK, RTOL, Plan, planned
from henon_ref.sweeps.points import Points
from henon_ref.sweeps.storage import SweepFolder
from henon_ref.sweeps.work import Observation
from henon_ref.system.python_arguments import explained
from henon_ref.terminal import Line, in_notebook, notice_if_slow
from henon_ref.workers.executors import EndedError, check_executor, finished, processors

_LOG = logging.getLogger(__name__)
TASK_SECONDS = 0.1
"""Intended processor time of a task [s]; short chunks are combined, because each task has an overhead."""
PERIOD = 0.2
"""Interval between two updates of the progress line [s]."""
Advance = Callable[[int, bool], None]
"""Callback: number of points that are finished, and whether they were finished before."""


class SweepTable(pd.DataFrame):
    """Results of a sweep, one row for each point, in the order of the points; the index is ``point``.

    Columns: those of the points, ``status``, and the observations.

    Attributes
    ----------
    frames : mapping
        Name -> data frame of a ragged observation; its column ``point`` refers to a row of this table.
    """

    _metadata: ClassVar[list[str]] = ["frames"]
    frames: Mapping[str, pd.DataFrame]

    @property
    def _constructor(self) -> Any:  # slices and results of operations are plain data frames
        return pd.DataFrame


@explained
def sweep(
    system: System,
    initial: Mapping[str, Any] | Sequence[Any] | None = None,
    *,
    until: Any = None,
    grid: Any,
    observe: Sequence[Observation] = (),
    rtol: float = RTOL,
    jobs: int | None = None,
    chunk: int | None = None,
    executor: Any = None,
    out: str | Path | None = None,
    resume: bool = False,
    start: Any = None,
    mode: Mapping[str, int] | None = None,
    max_steps: int = MOST_STEPS,
) -> SweepTable:
    """Simulate a system at many points, and observe each run.

    Parameters
    ----------
    system : System
    initial : mapping, or array of shape (n,)
        Every state -> number, or the numbers in order; for a state of the grid, the grid's values apply. May be
        omitted for a system from a case, as in :func:`henon_ref.simulate`.
    until, start : number
        Horizon and initial time of each run [s].
    grid : mapping, DataFrame, str, Path or Points
        Parameter or state -> numbers, or ``{"from": a, "to": b, "count": n}``: every combination is a point; the
        last name changes fastest. A data frame, CSV or Parquet file has one point per row. For other points see
        :mod:`henon_ref.points`.
    observe : sequence
        Observations of :mod:`henon_ref.observe`.
    rtol, mode, max_steps
        As in :func:`henon_ref.simulate`.
    jobs : int, optional
        Number of worker processes; None: number of processors. With 1, everything runs in this process.
    chunk : int, optional
        Number of points that are run together and stored in one file; None: 16 to 2000.
    executor : concurrent.futures.Executor or dask.distributed.Client, optional
        Used instead of worker processes; its workers may be threads.
    out : str or Path, optional
        Folder for the results, as Parquet files; None: nothing is written.
    resume : bool
        Whether to skip the chunks in ``out`` that an earlier sweep of the same content has finished.

    Returns
    -------
    SweepTable
        Data frame with a row for each point, in their order, also if its run ended early: columns of the point,
        ``status``, observations. Ragged observations are data frames in the attribute ``frames``, with the number of
        the row as ``point``. All numbers have equal bits for any chunks and any executor.

    Raises
    ------
    HenonRefError
        If an argument is invalid (also a ValueError; nothing is run or written then), or the folder cannot be written.

    Examples
    --------
    A block that slides to rest in v / F:

    >>> from henon_ref import observe
    >>> block = System(["x", "v"], {"F": 0.5}, {"s": "v"}, ["v", "-F*s"])
    >>> table = sweep(block, {"x": 0, "v": 1}, until=9, grid={"F": [0.5, 1]}, observe=[observe.final_state()], jobs=1)
    >>> table[["F", "status", "final_x", "final_mode"]].values.tolist()
    [[0.5, 'ok', 1.0, 's=0'], [1.0, 'ok', 0.5, 's=0']]
    """
    plan = planned(
        system, initial, until=until, grid=grid, observe=observe, rtol=rtol, chunk=chunk, start=start, mode=mode,
        max_steps=max_steps,
    )  # fmt: skip
    processes = processors() if jobs is None else whole_number(jobs, "jobs")
    check_executor(executor)
    if resume and out is None:
        raise ArgumentError("resume requires out, the folder of the sweep to be continued")
    folder = None if out is None else SweepFolder(Path(out), plan)
    if folder is not None:
        folder.begin(resume=resume)
    return assembled(plan.points, list(done(plan, folder, jobs=processes, executor=executor)))


def assembled(points: Points, chunks: Sequence[tuple[int, Tables]]) -> SweepTable:
    """Return the numbered chunks of a sweep as one table."""
    own, tables = points.columns(slice(None)), [found for _, found in sorted(chunks, key=itemgetter(0))]
    table = SweepTable(
        {**own, **_concatenated([chunk.points for chunk in tables])}, index=pd.RangeIndex(len(points), name="point")
    )
    names = dict.fromkeys(name for chunk in tables for name in chunk.ragged)
    frames = {name: pd.DataFrame(_concatenated([chunk.ragged[name] for chunk in tables])) for name in names}
    object.__setattr__(table, "frames", frames)
    return table


def _concatenated(parts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    names = dict.fromkeys(name for part in parts for name in part)
    return {name: np.concatenate([part[name] for part in parts]) for name in names}


def done(
    plan: Plan, folder: SweepFolder | None, *, jobs: int, executor: Any = None, quiet: bool = False
) -> Iterator[tuple[int, Tables]]:
    """Run the unfinished chunks, write them, show the progress, and yield each chunk's number and tables.

    If the workers or the executor end, the message of the HenonRefError gives the finished chunks and how to resume.
    """
    with progress(len(plan.points), quiet=quiet) as advance:
        before = set()
        for number, tables in folder.finished() if folder else ():
            before.add(number)
            advance(len(plan.chunks[number]), True)
            yield number, tables
        if ahead := [number for number in range(len(plan.chunks)) if number not in before]:
            yield from _run(plan, folder, ahead, jobs, executor, advance)


def _run(
    plan: Plan, folder: SweepFolder | None, ahead: Sequence[int], jobs: int, executor: Any, advance: Advance
) -> Iterator[tuple[int, Tables]]:
    with notice_if_slow():
        plan.work.integrator()  # compile now, so that workers find it in the cache
    pickled = plan.work.pickled()
    refused: list[str] = []
    count = len(plan.chunks) - len(ahead)
    size, most = 1, max(MOST_CHUNK // plan.chunk, 1)
    tasks = (plan.task(numbers, pickled) for numbers in _groups(ahead, lambda: size))
    try:
        with closing(finished(execute, tasks, executor=executor, jobs=min(jobs, len(ahead)))) as results:
            for first, (chunks, seconds) in results:
                size = _group_size(len(chunks), seconds, most)
                for number, tables in enumerate(chunks, start=first):
                    if folder is not None:
                        folder.write(number, tables)
                    count += 1
                    refused += tables.refused[: 5 - len(refused)]  # 5 warnings are enough
                    advance(len(plan.chunks[number]), False)
                    yield number, tables
    except EndedError as error:
        there = f"{count} of {len(plan.chunks)} chunks are finished"
        where = "but lost, since no folder (out=) was given"
        if folder is not None:
            where = f"and stored in {folder.path}; --resume (resume=True) continues from them"
        raise EndedError(f"{error}; {there} {where}") from error
    for words in refused:
        _LOG.warning("%s", words)


def _groups(numbers: Sequence[int], size: Callable[[], int]) -> Iterator[list[int]]:
    """Yield groups of consecutive chunk numbers, one for each task; ``size`` returns the present largest length."""
    at = 0
    while group := numbers[at : at + size()]:
        group = [number for k, number in enumerate(group) if number == group[0] + k]
        at += len(group)
        yield group


def _group_size(count: int, seconds: float, most: int) -> int:
    """Return the number of chunks of a task, at most ``most``, given the processor time of ``count`` chunks [s]."""
    wanted = int(count * min(TASK_SECONDS / max(seconds, 1e-9), 8))  # at most 8 times as many
    return min(max(wanted, 1), most)


@contextmanager
def progress(total: int, *, quiet: bool = False) -> Iterator[Advance]:
    """Show finished points, runs per second and the time left, in a terminal or a notebook (where it remains)."""
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
        line.clear()
    if in_notebook() and not quiet:
        line.show(f"{done:,} of {total:,} points in {time.monotonic() - began:.1f} s")
