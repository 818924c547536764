"""Many runs of one system: the function :func:`sweep`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from henon_ref.simulation.system import System
from henon_ref.sweeps.chunk import Tables, execute
from henon_ref.sweeps.executors import check_executor, finished, processors
from henon_ref.sweeps.manifest import files_of, manifest_of
from henon_ref.sweeps.observations import Observation
from henon_ref.sweeps.plan import RTOL, Plan, planned, whole_number
from henon_ref.sweeps.progress import shown
from henon_ref.sweeps.storage import SweepFolder

if TYPE_CHECKING:
    from henon_ref.sweeps.table import SweepTable


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
    rtol, mode
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
        Also a ValueError, before anything is run or written, for what cannot be meant. A CaseError where the folder
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
        system, initial, until=until, grid=grid, observe=observe, rtol=rtol, chunk=chunk, start=start, mode=mode
    )
    processes = processors() if jobs is None else whole_number(jobs, "jobs")
    check_executor(executor)
    return collected(plan, jobs=processes, executor=executor, out=out, resume=resume)


def collected(
    plan: Plan, *, jobs: int, executor: Any = None, out: str | Path | None = None, resume: bool = False
) -> SweepTable:
    """Do a plan, and gather its results."""
    from henon_ref.sweeps.table import assembled

    kept: dict[int, Tables] = {}
    folder = None if out is None else opened(plan, Path(out), resume=resume)
    with shown(len(plan.points)) as progress:
        for number, tables in done(plan, folder, jobs=jobs, executor=executor, progress=progress):
            kept[number] = tables
    return assembled(plan.points, [kept[number] for number in range(len(plan.chunks))])


def opened(plan: Plan, out: Path, *, resume: bool) -> SweepFolder:
    """The folder of a plan's results, ready to be written into."""
    folder = SweepFolder(out, plan.content)
    folder.begin(files_of(plan), manifest_of(plan), resume=resume)
    return folder


def done(
    plan: Plan,
    folder: SweepFolder | None,
    *,
    jobs: int,
    executor: Any = None,
    progress: Callable[[int, bool], None],
    wanted: bool = True,
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
    wanted : bool
        Hand out finished chunks, too.
    """
    before = folder.finished(plan.chunks) if folder else set()
    for number in sorted(before):
        progress(len(plan.chunks[number]), True)
        if wanted and folder:
            yield number, folder.read(number)
    ahead = plan.tasks(before)
    if not ahead:
        return
    plan.work.prepared()  # compiled here and now: workers find it in the cache
    pickled = plan.work.pickled()
    workers = min(jobs, len(ahead))
    with closing(
        finished(execute, (plan.task(number, pickled) for number in ahead), executor=executor, jobs=workers)
    ) as results:
        for number, tables in results:
            chunk = plan.chunks[number]
            if folder is not None:
                own = plan.points.columns(slice(chunk.start, chunk.stop)) | dict(tables.points)
                folder.write(number, chunk.start, own, tables.ragged)
            progress(len(chunk), False)
            yield number, tables
