"""Execution of tasks: in this process, in worker processes, by an executor of the user, or on a Dask cluster.

A task is a pure function of its arguments, so that it can be repeated if its worker dies.
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
from typing import Any

from henon_ref.errors import ArgumentError, HenonRefError
from henon_ref.workers.pool import Jobs, WorkerPool
from henon_ref.workers.worker import Failure, Job, WorkerState

TRIES = 3
"""Number of attempts at a task whose worker dies."""
Task = tuple[int, tuple[Any, ...]]
"""Number that identifies a task, and the arguments of its function."""


class EndedError(HenonRefError):
    """The workers or the executor ended before the tasks were finished."""


def processors() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def check_executor(executor: Any) -> None:
    """Raise ArgumentError for what is neither an Executor nor a Dask Client, or is a closed client."""
    if executor is not None and not isinstance(executor, Executor) and not hasattr(executor, "get_executor"):
        raise ArgumentError(
            f"executor is a {type(executor).__name__}; wanted a concurrent.futures.Executor, a Dask Client, or None"
        )
    if getattr(executor, "status", None) in ("closing", "closed"):
        raise ArgumentError("executor is a closed client; wanted a client of a running cluster")


def finished(
    function: Callable[..., Any], tasks: Iterable[Task], *, executor: Any = None, jobs: int = 1
) -> Generator[tuple[int, Any], None, None]:
    """Execute tasks, and yield the number of each and the value of its function as they finish.

    The function belongs to a module, so that workers can import it by name. Tasks are consumed as workers become free,
    so that memory does not grow with their number. ``executor``, an Executor or a Dask Client, replaces the worker
    processes, and is not shut down. With one job, the tasks run in this process. EndedError if workers die repeatedly,
    or the executor ends; exceptions of a task propagate.
    """
    if executor is not None:
        yield from _on_executor(function, tasks, executor)
    elif jobs == 1:
        for number, arguments in tasks:
            yield number, function(*arguments)
    else:
        yield from _by_workers(function, iter(tasks), jobs)


def _on_executor(function: Callable[..., Any], tasks: Iterable[Task], executor: Any) -> Iterator[tuple[int, Any]]:
    """Execute tasks, three per worker submitted at a time."""
    workers = getattr(executor, "_max_workers", None) or 16  # if it does not report them
    with ExitStack() as stack:
        if not isinstance(executor, Executor):
            with _reached():
                workers = max(sum(executor.nthreads().values()), 1)
                executor = executor.get_executor(pure=False)
            stack.callback(executor.shutdown, wait=False)
        running: dict[Future[Any], int] = {}
        try:
            for number, arguments in tasks:
                with _reached():
                    running[executor.submit(_raising, function, *arguments)] = number
                if len(running) >= 3 * workers:
                    yield from _done(running)
            while running:
                yield from _done(running)
        except (CancelledError, BrokenExecutor) as error:
            raise _ended(error) from error
        finally:
            for future in running:
                future.cancel()


@contextmanager
def _reached() -> Iterator[None]:
    """Convert exceptions from requests to an executor into an EndedError."""
    try:
        yield
    except (OSError, RuntimeError) as error:  # from a cluster, or from an executor that is shut down or broken
        raise _ended(error) from error


def _ended(error: Exception) -> EndedError:
    why = f": {error}" if str(error) else ""
    return EndedError(
        "the executor has ended or dropped its tasks, for example because one of its processes or the scheduler of a "
        f"cluster died ({type(error).__name__}{why:.200})"
    )


def _done(running: dict[Future[Any], int]) -> Iterator[tuple[int, Any]]:
    """Yield the values of finished tasks; if some have failed, those of the others come before the exception."""
    done = wait(running, return_when=FIRST_COMPLETED).done
    failed = {future: future.cancelled() or future.exception() is not None for future in done}
    for future in sorted(done, key=lambda future: (failed[future], running[future])):
        found = future.result()
        yield running.pop(future), found


def _call(state: WorkerState, function: Callable[..., Any], *arguments: Any) -> tuple[bool, Any]:
    """Job: call the function of a task; return whether it succeeded, and its value or exception."""
    try:
        return True, function(*arguments)
    except Exception as error:  # noqa: BLE001 - any exception is raised again in the caller
        return False, _sendable(error)


def _raising(function: Callable[..., Any], *arguments: Any) -> Any:
    """Call the function of a task; an exception that is raised can be pickled."""
    try:
        return function(*arguments)
    except Exception as error:  # noqa: BLE001 - raised below: here it would be the context, which Dask pickles, too
        raised = _sendable(error)
    raise raised


def _sendable(error: Exception) -> Exception:
    """Return an exception with a note of its traceback; if it cannot be pickled, an error with its text and notes."""
    error.add_note("In a worker:\n" + "".join(traceback.format_exception(error)))
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # noqa: BLE001 - its pickling may raise anything
        plain = HenonRefError(f"{type(error).__name__} in a worker: {error}")
        for note in error.__notes__:
            plain.add_note(note)
        return plain
    return error


def _by_workers(function: Callable[..., Any], tasks: Iterator[Task], jobs: int) -> Iterator[tuple[int, Any]]:
    """Execute tasks in worker processes; a task whose worker dies is repeated by a new worker."""
    results: deque[tuple[int, Any]] = deque()

    def sequence() -> Jobs:
        for number, arguments in tasks:
            for _ in range(TRIES):
                result = yield Job(_call, (function, *arguments), math.inf)
                if not isinstance(result, Failure):
                    break
            else:
                raise EndedError(
                    f"{TRIES} workers ended while running chunk {number}, killed or out of memory "
                    f"(smaller chunks need less memory); the last one: {result.reason}"
                )
            succeeded, value = result
            if not succeeded:
                raise value
            results.append((number, value))

    pool = WorkerPool(workers=jobs, modules=[function.__module__])
    for _ in range(jobs):
        pool.add("tasks", sequence())
    with closing(pool.turns()) as turns:
        for _ in turns:  # a worker that has finished a task is at the next one by now
            while results:
                yield results.popleft()
