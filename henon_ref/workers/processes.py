"""Worker processes of our own, each with a pipe of its own, so that one that is killed leaves the others as they are.

The workers of ``concurrent.futures`` share two queues. Where one is killed, the lock or the half message that it leaves
behind has made the pool wait forever (CPython's issues 94777 and 105829; once in our own tests on Python 3.11.7).
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import traceback
import warnings
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from queue import SimpleQueue
from typing import Any, NamedTuple

from henon_ref.errors import HenonRefError

AHEAD = 2
"""Tasks that a worker has at once: the one that it does, and the next."""
TRIES = 3
"""How often a task is begun whose worker ends in the middle of it."""
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""A worker is one thread: those of linear algebra would only get in the way of the others."""

START_VARIABLE = "HENON_REF_START"
"""Environment variable: with ``spawn`` no copy of this process is made where one could be, as on other systems."""

KILL = getattr(signal, "SIGKILL", signal.SIGTERM)
"""The signal that nothing outlives: loky's processes have no method for it."""


class EndedError(HenonRefError):
    """Whoever does the tasks has ended before they were done."""


class Task(NamedTuple):
    """A number that it goes by, and what its function is called with."""

    number: int
    arguments: tuple[Any, ...]


class Worker:
    """A process, the parent's end of its pipe, and the tasks that it has been handed, the one it is at first."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.tasks: deque[Task] = deque()
        self.pipe, other = get_context().Pipe()
        self.process = _process(function, other)
        with warnings.catch_warnings():
            # The threads that linear algebra has of its own survive a fork by handlers of theirs.
            warnings.simplefilter("ignore", DeprecationWarning)
            self.process.start()
        other.close()  # the worker alone holds it: the pipe ends where the worker does

    def hand(self, task: Task) -> None:
        """Hand it a task. Of a worker that has ended this is not noticed here, but as the end of its pipe."""
        self.tasks.append(task)
        with suppress(OSError):
            self.pipe.send(task.arguments)

    def end(self, *, now: bool) -> None:
        """End the process once its tasks are done, or now."""
        if now:
            if self.process.is_alive():  # it has not been waited for: the number is still its own
                os.kill(self.process.pid, KILL)
        else:
            with suppress(OSError):
                self.pipe.send(None)
        self.process.join()
        self.pipe.close()


def may_fork() -> bool:
    """Whether a copy of this process may be made: it holds no lock of a thread that the copy does not have."""
    return sys.platform == "linux" and threading.active_count() == 1 and os.environ.get(START_VARIABLE) != "spawn"


def finished_by_workers(function: Callable[..., Any], tasks: Iterator[Task], jobs: int) -> Iterator[tuple[int, Any]]:
    """Do tasks in processes, and hand out each one's number and what its function returned, as they are finished.

    A task whose worker has ended is done again by another one.

    Raises
    ------
    EndedError
        Where a task has been begun ``TRIES`` times and its worker has ended each time. Whatever a task raises is passed
        on.
    """
    tries: dict[int, int] = {}
    again: deque[Task] = deque()
    workers: list[Worker] = []
    whole = False
    try:
        while True:
            _hand_out(function, again, tasks, workers, jobs)
            busy = {worker.pipe: worker for worker in workers if worker.tasks}
            if not busy:
                break
            for pipe in wait(list(busy)):
                worker = busy[pipe]  # type: ignore[index]
                try:
                    succeeded, value = worker.pipe.recv()
                except (EOFError, OSError):  # in the middle of a message, too
                    workers.remove(worker)
                    worker.end(now=True)
                    _count(worker.tasks[0], tries)
                    again.extendleft(reversed(worker.tasks))
                    continue
                task = worker.tasks.popleft()
                if not succeeded:
                    raise value
                yield task.number, value
        whole = True
    finally:
        for worker in workers:
            worker.end(now=not whole)


def _hand_out(
    function: Callable[..., Any], again: deque[Task], tasks: Iterator[Task], workers: list[Worker], jobs: int
) -> None:
    """Give each worker as many tasks as it may have, each of them one before any has two."""
    for wanted in range(1, AHEAD + 1):
        for place in range(jobs):
            if place < len(workers) and len(workers[place].tasks) >= wanted:
                continue
            task = again.popleft() if again else next(tasks, None)
            if task is None:
                return
            if place >= len(workers):
                workers.append(Worker(function))
            workers[place].hand(task)


def _count(task: Task, tries: dict[int, int]) -> None:
    tries[task.number] = tries.get(task.number, 0) + 1
    if tries[task.number] == TRIES:
        raise EndedError(
            f"{TRIES} workers have ended while they were at chunk {task.number}: killed, or out of memory (smaller "
            "chunks take less of it)"
        )


def _process(function: Callable[..., Any], pipe: Connection) -> Any:
    """A copy of this process, on Linux while it has a single thread; else one that begins afresh.

    That begins in some seconds, whatever the caller's main module is: neither script nor notebook needs a guard.
    """
    if may_fork():
        return get_context("fork").Process(target=_work, args=(function, pipe))
    from loky.backend.process import LokyProcess

    return LokyProcess(target=_work, args=(function, pipe), env=ONE_THREAD)


def _work(function: Callable[..., Any], pipe: Connection) -> None:
    """Do what comes through the pipe, until None comes.

    The pipe is read by a thread of its own, so that the parent never waits to hand over a task while this process waits
    to hand over a value.
    """
    _begin_worker()
    arguments: SimpleQueue[Any] = SimpleQueue()
    threading.Thread(target=_receive, args=(pipe, arguments), daemon=True).start()
    while (given := arguments.get()) is not None:
        try:
            value = True, function(*given)
        except Exception as error:  # noqa: BLE001 - whatever it is, it is the parent's to raise
            value = False, _sendable(error)
        pipe.send(value)


def _receive(pipe: Connection, arguments: SimpleQueue[Any]) -> None:
    given: Any = ()
    while given is not None:
        try:
            given = pipe.recv()
        except (EOFError, OSError):  # the parent has ended
            os._exit(1)
        arguments.put(given)


def _sendable(error: Exception) -> Exception:
    """The error with a note of where it arose, or its text where it cannot be pickled."""
    import pickle

    error.add_note("In a worker process:\n" + "".join(traceback.format_exception(error)))
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # noqa: BLE001 - whatever its own pickling raises
        return HenonRefError(f"{type(error).__name__} in a worker process: {error}")
    return error


def _begin_worker() -> None:
    """A terminal's interrupt is the parent's, with whom a worker ends."""
    from henon_ref.workers.procfs import signal_with_parent

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal_with_parent(signal.SIGKILL)
