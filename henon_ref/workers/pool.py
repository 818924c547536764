"""The worker pool: jobs in worker processes, with deadlines and a limit on memory, so that one failure stays one.

Who wants jobs done writes a sequence of them: a generator that yields a job and gets its result, or the
:class:`~henon_ref.workers.worker.Failure` that it came to, as the value of the ``yield``. What it does in between it
does in the caller's process. The jobs of a sequence are done by one worker; sequences of one queue share workers, too,
one after the other, and where workers are free several are at work on a queue.

A worker that misses its deadline, dies, outgrows its memory or sends what is no reply is killed with all that it has
started; its job has failed, and the sequence goes on with a new worker. Deadlines are in processor time, of the worker
and all that it has started; behind that stands a limit on wall time, :data:`WALL` times as long, from which the time is
taken for which it, or the caller, was ready to run while others had the processors. Where nothing tells the processor
time (elsewhere than on Linux) that limit alone holds, and memory is bounded by the system's own limit a process, if at
all. Leaving :meth:`WorkerPool.run`, by whatever exception, leaves no worker behind.

The executors of the standard library, of Pebble and loky are no substitute: no shared memory limit, no killing of what
a worker has started, no job for the one worker that holds its prepared run.
"""

from __future__ import annotations

import math
import pickle
import time
from collections import deque
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from importlib import import_module
from typing import Any

from henon_ref.errors import HenonRefError
from henon_ref.text import short_line
from henon_ref.workers.channel import NO_TOKEN, NoReply, new_token
from henon_ref.workers.worker import REPLY, Failure, Job, failure_of
from henon_ref.workers.worker_process import FORK, WorkerProcess, exchange, start_method

POLL = 0.05
"""Seconds between two looks at the clock and at memory."""
WALL = 3.0
"""Wall time that a job may take, in its deadlines."""
COMPILE_SECONDS = 120.0
"""Processor time that a job's run may take for what its preparation could not foresee [s]."""
BEGIN_SECONDS = 120.0
"""Wall time after which a worker that does not begin is given up [s]."""
MOST_LOST = 3
"""Workers that end before they have begun until the pool gives up."""
ABSENCE = 1.0
"""Wall time between two looks beyond which the caller was busy itself: no worker's time [s]."""
REUSED = 0.25
"""Part of its memory by which a worker may have grown that begins another sequence."""

Jobs = Generator[Job, Any, None]
"""A sequence of jobs; each one's result, or its Failure, is the value of the ``yield``."""


class _Task:
    """A sequence at work: its worker, and the job that it is at."""

    def __init__(self, queue: str, jobs: Jobs, worker: WorkerProcess | None) -> None:
        self.queue, self.jobs, self.worker = queue, jobs, worker
        self.job: Job | None = None
        self.token = NO_TOKEN
        """Of the job that the worker has been sent; ``NO_TOKEN`` while there is none."""

    def begin(self, worker: WorkerProcess) -> None:
        """The job begins: from now on the worker's time is the job's."""
        self.began, self.used_before = worker.clock, worker.used
        self.compiled = 0.0
        self.compiling_since: tuple[float, float] | None = None

    def compiling(self, spent: float | None, worker: WorkerProcess) -> None:
        """Compiling begins (None), or has ended after so much processor time: the job's clock stands meanwhile."""
        if spent is None:
            self.compiling_since = worker.clock, worker.used
        elif self.compiling_since is not None:
            self.compiled += spent
            self.began += worker.clock - self.compiling_since[0]
            self.compiling_since = None

    def pause(self, seconds: float) -> None:
        """Nobody has looked for so long: that is no time of the job."""
        self.began += seconds
        if self.compiling_since is not None:
            self.compiling_since = self.compiling_since[0] + seconds, self.compiling_since[1]

    def is_late(self, worker: WorkerProcess) -> bool:
        """Whether the job is past its deadline."""
        if self.job is None or self.job.seconds == math.inf:
            return False
        used, now = worker.used, worker.clock
        if self.compiling_since is not None:
            since, before = self.compiling_since
            spent = self.compiled + used - before
            return spent > COMPILE_SECONDS or now - since > WALL * COMPILE_SECONDS
        own = used - self.used_before - self.compiled
        return own > self.job.seconds or now - self.began > WALL * self.job.seconds


class WorkerPool:
    """Does sequences of jobs, a few at a time.

    Parameters
    ----------
    workers : int
        How many are at work at once.
    memory : int, optional
        Bytes that one worker may hold, with all that it has started; None: as many as there are.
    main : bool
        Whether jobs hold objects of the caller's main module.
    modules : sequence of str
        What workers need to have imported.
    """

    def __init__(
        self, *, workers: int, memory: int | None = None, main: bool = False, modules: Sequence[str] = ()
    ) -> None:
        self.workers, self.memory = workers, memory
        self._main, self._modules = main, modules
        self._waiting: dict[str, deque[Jobs]] = {}
        self._tasks: list[_Task] = []
        self._stopped: list[WorkerProcess] = []
        self._lost = 0
        self._looked = time.monotonic()

    def add(self, queue: str, jobs: Jobs, *, first: bool = False) -> None:
        """Put a sequence at the end of a queue; ``first``: the queue comes before all others."""
        if first and queue not in self._waiting:
            self._waiting = {queue: deque(), **self._waiting}
        self._waiting.setdefault(queue, deque()).append(jobs)

    def run(self, tick: Callable[[], None] = lambda: None) -> None:
        """Do all that has been added, and is added meanwhile; ``tick`` is called several times a second."""
        with closing(self.turns()) as turns:
            for _ in turns:
                tick()

    def turns(self) -> Generator[None, None, None]:
        """The same for who has something to do several times a second: that is done between two turns."""
        self._looked = time.monotonic()
        try:
            while self._waiting or self._tasks:
                while self._waiting and len(self._tasks) < self.workers:
                    at_work = {task.queue for task in self._tasks}
                    free = (name for name in self._waiting if name not in at_work)
                    self._begin(next(free, next(iter(self._waiting))), None)
                exchange([task.worker for task in self._tasks if task.worker is not None], POLL)
                for task in list(self._tasks):
                    self._receive(task)
                self._enforce()
                yield
        finally:
            for task in self._tasks:
                self._without_worker(task)
                task.jobs.close()
            for worker in self._stopped:
                worker.join()
            self._tasks.clear()
            self._waiting.clear()
            self._stopped.clear()

    def _begin(self, queue: str, worker: WorkerProcess | None) -> None:
        """Begin the next sequence of a queue, with a worker that has done one before."""
        task = _Task(queue, self._waiting[queue].popleft(), worker)
        if not self._waiting[queue]:
            del self._waiting[queue]
        self._tasks.append(task)
        self._next(task, None)

    def _next(self, task: _Task, result: Any) -> None:
        """Go on with a sequence, whose present job has this result."""
        try:
            task.job = task.jobs.send(result)
        except StopIteration:
            self._end(task)
            return
        if task.worker is not None and task.worker.ended is not None and not task.job.rests:
            self._without_worker(task)  # what it died of was no job of this one
        self._send(task)

    def _end(self, task: _Task) -> None:
        """A sequence is over: its worker goes on with the next one of the queue."""
        self._tasks.remove(task)
        worker = task.worker
        if worker is None:
            return
        grown = worker.resident - (worker.began_with or 0)
        few = self.memory is None or grown <= REUSED * self.memory
        if task.queue in self._waiting and worker.ended is None and few:
            self._begin(task.queue, worker)
        else:
            self._without_worker(task)

    def _without_worker(self, task: _Task) -> None:
        if task.worker is not None:
            task.worker.stop()
            self._stopped.append(task.worker)
            task.worker = None

    def _send(self, task: _Task) -> None:
        """Have a job done by the sequence's worker, or a new one."""
        try:
            pickled = pickle.dumps(task.job, pickle.HIGHEST_PROTOCOL)
        except Exception as error:  # whatever the solver's own classes do on the way into a pickle
            raise HenonRefError(
                f"a job of {task.queue} cannot be sent to its worker ({failure_of(error).reason}); "
                "define solvers at the top of a module"
            ) from error
        if task.worker is None:
            if start_method() == FORK:
                for module in self._modules:
                    import_module(module)
            task.worker = WorkerProcess(self.memory, main=self._main, modules=self._modules)
        task.token = new_token()
        task.begin(task.worker)
        task.worker.channel.send(task.token, pickled)

    def _receive(self, task: _Task) -> None:
        """Take the messages of a worker on its job."""
        worker, result = task.worker, None
        if worker is None or task.token == NO_TOKEN:
            return
        try:
            for token, pickled in worker.channel.receive():
                if token == NO_TOKEN and worker.began_with is None:
                    worker.began_with = worker.resident
                    task.begin(worker)
                elif token == task.token:
                    kind, result = pickle.loads(pickled)
                    if kind == REPLY:
                        break
                    task.compiling(result, worker)
            else:
                return
        except NoReply as error:
            self._finish(task, Failure("failed", str(error)), sound=False)
            return
        except (Exception, SystemExit) as error:  # noqa: BLE001 - whatever the solver's classes do out of a pickle
            reason = f"what the worker sent cannot be read: {failure_of(error).reason}"
            self._finish(task, Failure("failed", short_line(reason)), sound=False)
            return
        self._finish(task, result, sound=not (isinstance(result, Failure) and result.status == "failed"))

    def _enforce(self) -> None:
        """End the jobs whose worker has ended, and those past their deadline or their memory."""
        now = time.monotonic()
        absent, self._looked = now - self._looked, now
        for task in list(self._tasks):
            worker = task.worker
            if worker is None or task.token == NO_TOKEN:
                continue
            if absent > ABSENCE:
                task.pause(absent)
            if worker.began_with is None:
                self._replace_unbegun(task, worker)
            elif failure := self._failure(task, worker):
                self._finish(task, failure, sound=False)

    def _failure(self, task: _Task, worker: WorkerProcess) -> Failure | None:
        """Why a job has to be ended; None where it has not."""
        if worker.ended is not None:
            return worker.crash()
        most = self.memory
        if most is not None and worker.resident > most and (held := worker.own) > most:
            return Failure("failed", f"memory: {held / 2**30:.1f} GiB held, {most / 2**30:.1f} GiB allowed")
        if task.is_late(worker):
            return Failure("timeout", "stopped from outside: no answer within the time allowed", ignored=True)
        return None

    def _finish(self, task: _Task, result: Any, *, sound: bool) -> None:
        """A job has its result; ``sound``: its worker can go on."""
        task.token = NO_TOKEN
        if not sound:
            self._without_worker(task)
        self._next(task, result)

    def _replace_unbegun(self, task: _Task, worker: WorkerProcess) -> None:
        """Send a job to another worker where its own does not come to its beginning: that is no fault of the job's.

        Raises
        ------
        HenonRefError
            Where that has happened too often.
        """
        if worker.ended is None and time.monotonic() - worker.asked < BEGIN_SECONDS:
            return
        self._without_worker(task)
        self._lost += 1
        if self._lost > MOST_LOST:
            raise HenonRefError(f"worker processes have ended before they began, {self._lost} times")
        self._send(task)
