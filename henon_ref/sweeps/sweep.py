"""Many runs of one system: the function :func:`sweep`."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from henon_ref.integrator.start import MOST_STEPS
from henon_ref.simulation.arguments import whole_number
from henon_ref.simulation.system import System
from henon_ref.sweeps.chunk import Tables, execute
from henon_ref.sweeps.manifest import files_of, manifest_of
from henon_ref.sweeps.observations import Observation
from henon_ref.sweeps.plan import MOST_CHUNK, RTOL, Plan, planned
from henon_ref.sweeps.progress import shown
from henon_ref.sweeps.storage import SweepFolder
from henon_ref.terminal import notice_if_slow
from henon_ref.workers.executors import EndedError, check_executor, finished, processors

if TYPE_CHECKING:
    from henon_ref.sweeps.table import SweepTable

_LOG = logging.getLogger(__name__)
MOST_TOLD = 5
"""Points without a run, of which a warning says why."""
TASK_SECONDS = 0.1
"""Processor time that a task takes at least [s], where it can: short chunks go together, for a task has its price."""
FASTER = 8
"""How many times as many chunks as the last one a task has at most."""
KEPT_NOWHERE = "and lost: nothing is kept without a folder (out=)"


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
        Every state -> number, or the numbers in their order; a state of the grid has the grid's values instead. May be
        left out of a system from a case, as in :func:`henon_ref.simulate`.
    until, start : number
        Horizon and initial time of each run [s].
    grid : mapping, DataFrame, str, Path or Points
        Parameter or state -> numbers, or ``{"from": a, "to": b, "count": n}``: every combination is a point, the last
        name changes fastest. A data frame, CSV or Parquet file has a point a row; others: :mod:`henon_ref.points`.
    observe : sequence
        Of :mod:`henon_ref.observe`.
    rtol, mode, max_steps
        As in :func:`henon_ref.simulate`.
    jobs : int, optional
        Worker processes; as many as there are processors if left out. With 1 everything is done in this process.
    chunk : int, optional
        Points that are run in one go, and stand in one file; up to 2000 if left out.
    executor : concurrent.futures.Executor or dask.distributed.Client, optional
        In place of processes of our own; threads do as well.
    out : str or Path, optional
        A folder for the results, as Parquet files; nothing is written without it.
    resume : bool
        Chunks that an earlier sweep of the same content has finished in ``out`` are not run again.

    Returns
    -------
    SweepTable
        A data frame with a row a point, in the points' order: their columns, ``status``, and what was observed. A run
        that ends before its horizon is a row that says so. Ragged observations are data frames by name in its
        attribute ``frames``; their column ``point`` is the row's number. Every number is the same to the last bit,
        however the points are cut into chunks and whoever runs them.

    Raises
    ------
    HenonRefError
        Also a ValueError, before anything is run or written, for invalid arguments. A CaseError where the folder
        cannot be written.

    Examples
    --------
    A block that slides to rest in v / F:

    >>> from henon_ref import observe
    >>> block = System(["x", "v"], {"F": 0.5}, {"s": "v"}, ["v", "-F*s"])
    >>> last = observe.final_state()
    >>> table = sweep(block, {"x": 0, "v": 1}, until=9, grid={"F": [0.5, 1]}, observe=[last], jobs=1)
    >>> table[["F", "status", "final_x", "final_mode"]].values.tolist()
    [[0.5, 'ok', 1.0, 's=0'], [1.0, 'ok', 0.5, 's=0']]
    """
    plan = planned(
        system, initial, until=until, grid=grid, observe=observe, rtol=rtol, chunk=chunk, start=start, mode=mode,
        max_steps=max_steps,
    )  # fmt: skip
    processes = processors() if jobs is None else whole_number(jobs, "jobs")
    check_executor(executor)
    return collected(plan, jobs=processes, executor=executor, out=out, resume=resume)


def collected(
    plan: Plan, *, jobs: int, executor: Any = None, out: str | Path | None = None, resume: bool = False
) -> SweepTable:
    """Do a plan, and gather its results."""
    from henon_ref.sweeps.table import assembled

    kept: dict[int, Tables] = {}
    folder = None if out is None else SweepFolder(Path(out), plan)
    if folder is not None:
        folder.begin(files_of(plan), manifest_of(plan), resume=resume)
    with shown(len(plan.points)) as progress:
        for number, tables in done(plan, folder, jobs=jobs, executor=executor, progress=progress):
            kept[number] = tables
    return assembled(plan.points, [kept[number] for number in range(len(plan.chunks))])


def done(
    plan: Plan,
    folder: SweepFolder | None,
    *,
    jobs: int,
    executor: Any = None,
    progress: Callable[[int, bool], None],
) -> Iterator[tuple[int, Tables]]:
    """Run what is not finished, write it, and hand out each chunk's number and tables.

    Parameters
    ----------
    plan : Plan
    folder : SweepFolder, optional
    jobs, executor
        See :func:`sweep`.
    progress : callable
        Told of so many points, and whether they are kept from before.

    Raises
    ------
    HenonRefError
        Where workers, or whoever hands out the work, end: with what is finished, and what resumes it.
    """
    before = set()
    for number, tables in folder.finished() if folder else ():
        before.add(number)
        progress(len(plan.chunks[number]), True)
        yield number, tables
    ahead = plan.tasks(before)
    if not ahead:
        return
    with notice_if_slow("compiling the system"):
        plan.work.prepared()  # compiled here and now: workers find it in the cache
    pickled = plan.work.pickled()
    refused: list[str] = []
    done = len(before)
    groups = _Groups(ahead, max(MOST_CHUNK // plan.chunk, 1))
    tasks = (plan.task(numbers, pickled) for numbers in groups)
    try:
        with closing(finished(execute, tasks, executor=executor, jobs=min(jobs, len(ahead)))) as results:
            for first, (chunks, seconds) in results:
                groups.took(len(chunks), seconds)
                for number, tables in enumerate(chunks, start=first):
                    if folder is not None:
                        folder.write(number, tables)
                    done += 1
                    refused += tables.refused[: MOST_TOLD - len(refused)]
                    progress(len(plan.chunks[number]), False)
                    yield number, tables
    except EndedError as error:
        there = f"{done} of {len(plan.chunks)} chunks are finished"
        where = f"and lie in {folder.path}; --resume (resume=True) goes on from them" if folder else KEPT_NOWHERE
        raise EndedError(f"{error}; {there} {where}") from error
    for words in refused:
        _LOG.warning("%s", words)


class _Groups(Iterator[list[int]]):
    """Numbers of chunks, those that go together in one task at a time: more of them, the less time they take.

    Parameters
    ----------
    numbers : sequence of int
        In order; a task has such as follow each other.
    most : int
        In one task.
    """

    def __init__(self, numbers: Sequence[int], most: int) -> None:
        self._numbers, self._most, self._size, self._next = numbers, most, 1, 0

    def took(self, count: int, seconds: float) -> None:
        """Note how much processor time so many chunks took [s]."""
        wanted = int(count * min(TASK_SECONDS / max(seconds, 1e-9), FASTER))
        self._size = min(max(wanted, 1), self._most)

    def __next__(self) -> list[int]:
        group = list(self._numbers[self._next : self._next + self._size])
        if not group:
            raise StopIteration
        group = [number for k, number in enumerate(group) if number == group[0] + k]
        self._next += len(group)
        return group
