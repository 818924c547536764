"""Worker pool: jobs in worker processes, with deadlines and a memory limit, so that a failure ends one job only.

The caller writes sequences of jobs: generators that yield a job and receive its result, or its
:class:`~henon_ref.workers.worker.Failure`, as the value of the ``yield``. Code between two jobs runs in the caller's
process. All jobs of a sequence run in one worker. Sequences of a queue share workers, one after the other; if workers
are free, several work on a queue.

A worker that misses its deadline, dies, exceeds its memory or sends anything but a reply is killed with its
descendants. Its job has then failed, and the sequence continues with a new worker. Deadlines are in processor time of
the worker and its descendants. A second limit is on wall time, :data:`WALL_FACTOR` times as long, not counting the time
in which the worker or the caller was ready to run but had no processor. If processor time is unknown (outside Linux),
only the limit on wall time holds, and memory is bounded at most by the system's limit per process. When
:meth:`WorkerPool.run` ends, by whatever exception, no worker is left.

The executors of the standard library, Pebble and loky lack a common memory limit, killing of a worker's descendants,
and jobs for the one worker that has a prepared run.
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
from henon_ref.workers.worker_process import WorkerProcess, exchange, start_method

WALL_FACTOR = 3.0
"""Wall time that a job may take, as a multiple of its deadline."""
COMPILE_SECONDS = 120.0
"""Processor time that a job may spend on compiling that its preparation did not cover [s]."""
MAX_REUSED_GROWTH = 0.25
"""Largest growth of a worker that is reused for another sequence, as a fraction of its memory limit."""

Jobs = Generator[Job, Any, None]
"""Sequence of jobs; the value of each ``yield`` is the result of the job, or its Failure."""


class _Task:
    """A running sequence, with its worker and its current job."""

    def __init__(self, queue: str, jobs: Jobs, worker: WorkerProcess | None) -> None:
        self.queue, self.jobs, self.worker = queue, jobs, worker
        self.job: Job | None = None
        self.token = NO_TOKEN
        """Token of the job sent to the worker; ``NO_TOKEN`` if there is none."""

    def begin(self, worker: WorkerProcess) -> None:
        self.began, self.used_before = worker.clock, worker.used
        self.compiled = 0.0
        self.compiling_since: tuple[float, float] | None = None

    def compiling(self, spent: float | None, worker: WorkerProcess) -> None:
        """Stop the job's clock while it compiles (None), or restart it after so much processor time of compiling."""
        if spent is None:
            self.compiling_since = worker.clock, worker.used
        elif self.compiling_since is not None:
            self.compiled += spent
            self.began += worker.clock - self.compiling_since[0]
            self.compiling_since = None

    def pause(self, seconds: float) -> None:
        """Exclude a period in which nothing was checked from the job's time."""
        self.began += seconds
        if self.compiling_since is not None:
            self.compiling_since = self.compiling_since[0] + seconds, self.compiling_since[1]

    def is_late(self, worker: WorkerProcess) -> bool:
        if self.job is None or self.job.seconds == math.inf:
            return False
        used, now = worker.used, worker.clock
        if self.compiling_since is not None:
            since, before = self.compiling_since
            spent = self.compiled + used - before
            return spent > COMPILE_SECONDS or now - since > WALL_FACTOR * COMPILE_SECONDS
        own = used - self.used_before - self.compiled
        return own > self.job.seconds or now - self.began > WALL_FACTOR * self.job.seconds


class WorkerPool:
    """Runs sequences of jobs, each in one of at most ``workers`` workers.

    ``memory`` is the largest memory of one worker with its descendants [bytes], None: unlimited; ``main``: whether jobs
    contain objects of the caller's main module; ``modules``: modules that workers must have imported.
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
        """Append a sequence to a queue; with ``first``, the queue is placed before all other queues."""
        if first and queue not in self._waiting:
            self._waiting = {queue: deque(), **self._waiting}
        self._waiting.setdefault(queue, deque()).append(jobs)

    def run(self, tick: Callable[[], None] = lambda: None) -> None:
        """Run all sequences, including those added meanwhile; ``tick`` is called several times a second."""
        with closing(self.turns()) as turns:
            for _ in turns:
                tick()

    def turns(self) -> Generator[None, None, None]:
        """Run all sequences as a generator, which yields to the caller several times a second."""
        self._looked = time.monotonic()
        try:
            while self._waiting or self._tasks:
                while self._waiting and len(self._tasks) < self.workers:
                    at_work = {task.queue for task in self._tasks}
                    free = (name for name in self._waiting if name not in at_work)
                    self._begin(next(free, next(iter(self._waiting))), None)
                exchange([task.worker for task in self._tasks if task.worker is not None], seconds=0.05)
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
        """Start the next sequence of a queue, with a worker from a previous sequence if one is given."""
        task = _Task(queue, self._waiting[queue].popleft(), worker)
        if not self._waiting[queue]:
            del self._waiting[queue]
        self._tasks.append(task)
        self._next(task, None)

    def _next(self, task: _Task, result: Any) -> None:
        """Continue a sequence with the result of its current job."""
        try:
            task.job = task.jobs.send(result)
        except StopIteration:
            self._end(task)
            return
        if task.worker is not None and task.worker.ended is not None and not task.job.rests:
            self._without_worker(task)  # the worker did not die of a job of this sequence
        self._send(task)

    def _end(self, task: _Task) -> None:
        """Remove a finished sequence; its worker continues with the next one of the queue."""
        self._tasks.remove(task)
        worker = task.worker
        if worker is None:
            return
        grown = worker.resident - (worker.began_with or 0)
        few = self.memory is None or grown <= MAX_REUSED_GROWTH * self.memory
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
        """Send the sequence's job to its worker, or to a new one."""
        try:
            pickled = pickle.dumps(task.job, pickle.HIGHEST_PROTOCOL)
        except Exception as error:  # pickling of the solver's classes may raise anything
            raise HenonRefError(
                f"a job of {task.queue} cannot be sent to its worker ({failure_of(error).reason}); "
                "define solvers at the top of a module"
            ) from error
        if task.worker is None:
            if start_method() == "fork":
                for module in self._modules:
                    import_module(module)
            task.worker = WorkerProcess(self.memory, main=self._main, modules=self._modules)
        task.token = new_token()
        task.begin(task.worker)
        task.worker.channel.send(task.token, pickled)

    def _receive(self, task: _Task) -> None:
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
        except (Exception, SystemExit) as error:  # noqa: BLE001 - unpickling may raise anything
            reason = f"the worker's reply cannot be read: {failure_of(error).reason}"
            self._finish(task, Failure("failed", short_line(reason)), sound=False)
            return
        self._finish(task, result, sound=not (isinstance(result, Failure) and result.status == "failed"))

    def _enforce(self) -> None:
        """End jobs whose worker has ended, and jobs that exceed their deadline or memory."""
        now = time.monotonic()
        absent, self._looked = now - self._looked, now
        for task in list(self._tasks):
            worker = task.worker
            if worker is None or task.token == NO_TOKEN:
                continue
            if absent > 1.0:  # the caller was busy
                task.pause(absent)
            if worker.began_with is None:
                self._replace_unbegun(task, worker)
            elif failure := self._failure(task, worker):
                self._finish(task, failure, sound=False)

    def _failure(self, task: _Task, worker: WorkerProcess) -> Failure | None:
        """Return why a job must be ended; None if it may continue."""
        if worker.ended is not None:
            return worker.crash()
        most = self.memory
        if most is not None and worker.resident > most and (held := worker.own) > most:
            return Failure("failed", f"memory: {held / 2**30:.1f} GiB held, {most / 2**30:.1f} GiB allowed")
        if task.is_late(worker):
            return Failure("timeout", "stopped from outside: no answer within the time allowed", ignored=True)
        return None

    def _finish(self, task: _Task, result: Any, *, sound: bool) -> None:
        """Record the result of a job; ``sound``: whether its worker can be used further."""
        task.token = NO_TOKEN
        if not sound:
            self._without_worker(task)
        self._next(task, result)

    def _replace_unbegun(self, task: _Task, worker: WorkerProcess) -> None:
        """Send a job to a new worker if its worker does not start within 120 s, which is no failure of the job.

        HenonRefError if this happens for the fourth time.
        """
        if worker.ended is None and time.monotonic() - worker.asked < 120.0:
            return
        self._without_worker(task)
        self._lost += 1
        if self._lost > 3:
            raise HenonRefError(f"{self._lost} worker processes ended before they had started")
        self._send(task)
