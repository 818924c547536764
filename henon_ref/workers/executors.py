"""Who does the chunks: this process, processes of our own, an executor of somebody's, or a Dask cluster.

A task is a pure function of what it is given, so that one whose worker has died is done again.
"""

from __future__ import annotations

import math
import os
import pickle
import traceback
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from typing import Any, NamedTuple

from henon_ref.errors import ArgumentError, HenonRefError
from henon_ref.workers.pool import Jobs, WorkerPool
from henon_ref.workers.worker import Failure, Job, WorkerState

AHEAD = 3
"""Tasks that are handed in to an executor, for each of its workers."""
TRIES = 3
"""How often a task is begun whose worker ends in the middle of it."""
WORKERS_ASSUMED = 16
"""Workers of an executor that does not tell how many it has."""


class EndedError(HenonRefError):
    """Whoever does the tasks has ended before they were done."""


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
        For what is neither an Executor nor a Dask Client, and for a client that is closed.
    """
    if executor is not None and not isinstance(executor, Executor) and not hasattr(executor, "get_executor"):
        raise ArgumentError(
            f"executor is a {type(executor).__name__}; wanted a concurrent.futures.Executor, a Dask Client, or None"
        )
    if getattr(executor, "status", None) in ("closing", "closed"):
        raise ArgumentError("executor is a client that is closed; wanted one of a cluster that runs")


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
    EndedError
        Where workers end again and again, or the executor ends. Whatever a task raises is passed on.
    """
    if executor is not None:
        yield from _on_executor(function, iter(tasks), executor)
    elif jobs == 1:
        for task in tasks:
            yield task.number, function(*task.arguments)
    else:
        yield from _by_workers(function, iter(tasks), jobs)


def _on_executor(function: Callable[..., Any], tasks: Iterator[Task], executor: Any) -> Iterator[tuple[int, Any]]:
    workers = getattr(executor, "_max_workers", None) or WORKERS_ASSUMED
    with ExitStack() as stack:
        if not isinstance(executor, Executor):
            with _reached():
                workers = max(sum(executor.nthreads().values()), 1)
                executor = executor.get_executor(pure=False)
            stack.callback(executor.shutdown, wait=False)
        running: dict[Future[Any], Task] = {}
        try:
            yield from _flow(function, tasks, executor, running, AHEAD * workers)
        except (CancelledError, BrokenExecutor) as error:
            raise _ended(error) from error
        finally:
            for future in running:
                future.cancel()


@contextmanager
def _reached() -> Iterator[None]:
    """What goes wrong where an executor is asked for something says that it has ended."""
    try:
        yield
    except (OSError, RuntimeError) as error:  # of a cluster; and of an executor that is shut down, or broken
        raise _ended(error) from error


def _ended(error: Exception) -> EndedError:
    why = f": {error}" if str(error) else ""
    return EndedError(
        f"the executor has ended, or dropped its tasks, as where the scheduler of a cluster dies "
        f"({type(error).__name__}{why:.200})"
    )


def _flow(
    function: Callable[..., Any],
    tasks: Iterator[Task],
    executor: Executor,
    running: dict[Future[Any], Task],
    most: int,
) -> Iterator[tuple[int, Any]]:
    """Keep so many tasks handed in. What is in ``running`` at the end has not been finished."""
    for task in tasks:
        with _reached():
            running[executor.submit(function, *task.arguments)] = task
        if len(running) >= most:
            yield from _done(running)
    while running:
        yield from _done(running)


def _done(running: dict[Future[Any], Task]) -> Iterator[tuple[int, Any]]:
    for future in sorted(wait(running, return_when=FIRST_COMPLETED).done, key=lambda f: running[f].number):
        found = future.result()
        yield running.pop(future).number, found


@dataclass(frozen=True)
class _Call(Job):
    """A task as a worker's job; the result is whether it has succeeded, and its value or error."""

    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    seconds: float = math.inf

    def run(self, state: WorkerState) -> tuple[bool, Any]:
        try:
            return True, self.function(*self.arguments)
        except Exception as error:  # noqa: BLE001 - whatever it is, it is the caller's to raise
            return False, _sendable(error)


def _sendable(error: Exception) -> Exception:
    """The error with a note of where it arose, or its text where it cannot be pickled."""
    error.add_note("In a worker process:\n" + "".join(traceback.format_exception(error)))
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # noqa: BLE001 - whatever its own pickling raises
        return HenonRefError(f"{type(error).__name__} in a worker process: {error}")
    return error


def _by_workers(function: Callable[..., Any], tasks: Iterator[Task], jobs: int) -> Iterator[tuple[int, Any]]:
    """Do tasks in processes of our own. One whose worker has ended is done again by another one."""
    results: deque[tuple[int, Any]] = deque()

    def sequence() -> Jobs:
        for task in tasks:
            for _ in range(TRIES):
                result = yield _Call(function, task.arguments)
                if not isinstance(result, Failure):
                    break
            else:
                raise EndedError(
                    f"{TRIES} workers have ended while they were at chunk {task.number}: killed, or out of memory "
                    f"(smaller chunks take less of it); the last one: {result.reason}"
                )
            succeeded, value = result
            if not succeeded:
                raise value
            results.append((task.number, value))

    pool = WorkerPool(workers=jobs, modules=[function.__module__])
    for _ in range(jobs):
        pool.add("tasks", sequence())
    with closing(pool.turns()) as turns:
        for _ in turns:  # who has done a task is at the next one by now
            while results:
                yield results.popleft()
