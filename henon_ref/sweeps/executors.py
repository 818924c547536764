"""Who does the chunks: this process, processes of our own, an executor of somebody's, or a Dask cluster.

A task is a pure function of what it is given, so that one whose worker has died is done again.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, suppress
from multiprocessing import get_context
from typing import Any, NamedTuple

from henon_ref.errors import ArgumentError, HenonRefError

AHEAD = 3
"""Tasks that are handed in, for each worker."""
WORKERS_ASSUMED = 16
"""Workers of an executor that does not tell how many it has."""
TRIES = 3
"""How often a task is begun whose worker ends in the middle of it."""
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""A worker is one thread: those of linear algebra would only get in the way of the others."""


class Task(NamedTuple):
    """A number that it goes by, and what its function is called with."""

    number: int
    arguments: tuple[Any, ...]


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def check_executor(executor: Any) -> None:
    """Check that tasks can be handed to it.

    Raises
    ------
    ArgumentError
        For what is neither an Executor nor a Dask Client.
    """
    if executor is not None and not isinstance(executor, Executor) and not hasattr(executor, "get_executor"):
        raise ArgumentError(
            f"executor is a {type(executor).__name__}; wanted a concurrent.futures.Executor, a Dask Client, or None"
        )


def finished(
    function: Callable[..., Any], tasks: Iterable[Task], *, executor: Any = None, jobs: int = 1
) -> Generator[tuple[int, Any], None, None]:
    """Do tasks, and hand out each one's number and what its function returned, as they are finished.

    Parameters
    ----------
    function : callable
        That of a module, so that workers find it by its name.
    tasks : iterable of Task
        Taken as workers become free: memory does not grow with their number.
    executor : Executor or Client, optional
        In place of processes of our own. It is not shut down.
    jobs : int
        Processes; with one, the tasks are done in this one.

    Raises
    ------
    HenonRefError
        Where workers end again and again. Whatever a task raises is passed on.
    """
    if executor is not None:
        yield from _on_executor(function, iter(tasks), executor)
    elif jobs == 1:
        for task in tasks:
            yield task.number, function(*task.arguments)
    else:
        yield from _in_processes(function, iter(tasks), jobs)


def _on_executor(function: Callable[..., Any], tasks: Iterator[Task], executor: Any) -> Iterator[tuple[int, Any]]:
    workers = getattr(executor, "_max_workers", None) or WORKERS_ASSUMED
    with ExitStack() as stack:
        if not isinstance(executor, Executor):
            workers = max(sum(executor.nthreads().values()), 1)
            executor = executor.get_executor(pure=False)
            stack.callback(executor.shutdown, wait=False)
        running: dict[Future[Any], Task] = {}
        try:
            yield from _flow(function, tasks, executor, running, AHEAD * workers)
        finally:
            for future in running:
                future.cancel()


def _in_processes(function: Callable[..., Any], tasks: Iterator[Task], jobs: int) -> Iterator[tuple[int, Any]]:
    """Processes of our own; where one of them ends, all begin anew, and do what had not been finished."""
    tries: dict[int, int] = {}
    again: list[Task] = []
    while True:
        running: dict[Future[Any], Task] = {}
        executor = _pool(jobs)
        whole = False
        try:
            yield from _flow(function, _first(again, tasks), executor, running, AHEAD * jobs)
            whole = True
            return
        except BrokenProcessPool:
            lost = sorted(running.values())
            for task in lost:
                tries[task.number] = tries.get(task.number, 0) + 1
                if tries[task.number] == TRIES:
                    raise HenonRefError(
                        f"{TRIES} workers have ended while they were at the chunks from {lost[0].number} to "
                        f"{lost[-1].number}: killed, or out of memory (smaller chunks take less of it)"
                    ) from None
            again[:] = [*lost, *again]
        finally:
            _end(executor, whole=whole)


def _pool(jobs: int) -> Any:
    """Processes that have what this one has, on Linux while it has a single thread; else ones that begin afresh.

    Those begin in some seconds, whatever the caller's main module is: neither script nor notebook needs a guard.
    """
    if may_fork():
        return ProcessPoolExecutor(jobs, mp_context=get_context("fork"), initializer=_begin_worker)
    from loky import ProcessPoolExecutor as FreshProcesses

    return FreshProcesses(jobs, timeout=None, initializer=_begin_worker, env=ONE_THREAD)


def may_fork() -> bool:
    """Whether a copy of this process holds no lock of a thread that it does not have."""
    return sys.platform == "linux" and threading.active_count() == 1


def _end(executor: Any, *, whole: bool) -> None:
    """End the processes; where not all is done, in the middle of what they do."""
    if not isinstance(executor, ProcessPoolExecutor):
        executor.shutdown(wait=True, kill_workers=not whole)
        return
    if not whole:  # from Python 3.14 on there is a method for it
        for process in list((executor._processes or {}).values()):
            with suppress(ProcessLookupError):
                process.kill()
    executor.shutdown(wait=True, cancel_futures=True)


def _first(again: list[Task], tasks: Iterator[Task]) -> Iterator[Task]:
    while again:
        yield again.pop(0)
    for task in tasks:  # noqa: UP028 - 'yield from' would end the other generator with this one
        yield task


def _flow(
    function: Callable[..., Any],
    tasks: Iterator[Task],
    executor: Executor,
    running: dict[Future[Any], Task],
    most: int,
) -> Iterator[tuple[int, Any]]:
    """Keep so many tasks handed in. What is in ``running`` at the end has not been finished."""
    for task in tasks:
        running[_handed_in(function, task, executor, running)] = task
        if len(running) >= most:
            yield from _done(running)
    while running:
        yield from _done(running)


def _handed_in(
    function: Callable[..., Any], task: Task, executor: Executor, running: dict[Future[Any], Task]
) -> Future[Any]:
    try:
        with warnings.catch_warnings():
            # The first one forks; the threads that linear algebra has of its own survive that by handlers of theirs.
            warnings.simplefilter("ignore", DeprecationWarning)
            return executor.submit(function, *task.arguments)
    except BrokenProcessPool:  # this one has not been begun, but is no less lost
        running[Future()] = task
        raise


def _done(running: dict[Future[Any], Task]) -> Iterator[tuple[int, Any]]:
    for future in sorted(wait(running, return_when=FIRST_COMPLETED).done, key=lambda f: running[f].number):
        found = future.result()
        yield running.pop(future).number, found


def _begin_worker() -> None:
    """A terminal's interrupt is the parent's, with whom a worker ends."""
    from henon_ref.campaign.procfs import signal_with_parent

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal_with_parent(signal.SIGKILL)
