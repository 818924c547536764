"""The worker pool: jobs in worker processes, with deadlines and a limit on memory, so that one failure stays one.

Who wants jobs done writes a sequence of them: a generator that yields a job and gets its result, or the
:class:`~henon_ref.harness.campaign.worker.Failure` that it came to, as the value of the ``yield``. What it does in
between it does in the caller's process. The jobs of a sequence are done by one worker; sequences of one queue share
workers, too, one after the other, and where workers are free several are at work on a queue.

A worker that misses its deadline, dies, outgrows its memory or sends what is no reply is killed with all that it has
started; its job has failed, and the sequence goes on with a new worker. Deadlines are in processor time, of the worker
and all that it has started; behind that stands a limit on wall time, :data:`WALL` times as long, from which the time is
taken for which it, or the caller, was ready to run while others had the processors. Where nothing tells the processor
time (elsewhere than on Linux) that limit alone holds, and memory is bounded by the system's own limit a process.
Nothing here waits for a worker. Leaving :meth:`WorkerPool.run`, by whatever exception, leaves no process behind.

Pebble and loky are no substitute: no shared memory limit, no killing of what a worker has started, no job for the one
worker that holds its prepared run.
"""

from __future__ import annotations

import pickle
import select
import time
from collections import deque
from collections.abc import Callable, Generator
from typing import Any

from henon_ref.errors import HenonRefError
from henon_ref.harness.campaign.channel import NoReply, new_token
from henon_ref.harness.campaign.fork_server import BEGUN, ENDED, ForkServer, present_server
from henon_ref.harness.campaign.worker import REPLY, Failure, Job, failure_of
from henon_ref.harness.campaign.worker_process import WorkerProcess
from henon_ref.text import short_line

POLL = 0.05
"""Seconds between two looks at the clock and at memory."""
WALL = 3.0
"""Wall time that a job may take, in its deadlines."""
COMPILE_SECONDS = 120.0
"""Processor time that a job's run may take for what its preparation could not foresee [s]."""
START_SECONDS = 20.0
"""Wall time, less what it waits for a processor, that a fork server may take to begin a worker, or is replaced [s]."""
MOST_SERVERS = 3
"""Fork servers that are lost before the pool gives up."""
ABSENCE = 1.0
"""Wall time between two looks beyond which the caller was busy itself: no worker's time [s]."""
REUSED = 0.25
"""Part of its memory by which a worker may have grown that begins another sequence."""

Jobs = Generator[Job, Any, None]
"""A sequence of jobs; each one's result, or its Failure, is the value of the ``yield``."""


class _Task:
    """A sequence at work: its worker, and the job that it is at."""

    def __init__(self, queue: str, jobs: Jobs) -> None:
        self.queue, self.jobs = queue, jobs
        self.worker: WorkerProcess | None = None
        self.job: Job | None = None
        self.again: Job | None = None
        """What is to be done again after the present job, which only prepares a new worker for it."""
        self.begin(b"", 0.0, 0.0)

    def begin(self, token: bytes, used: float, now: float) -> None:
        """A job begins, with a worker that has used so much processor time so far, by its own clock."""
        self.token = token
        self.sent = bool(token)
        self.began, self.used_before = now, used
        self.compiled = 0.0
        self.compiling_since: tuple[float, float] | None = None

    def compiling(self, spent: float | None, used: float, now: float) -> None:
        """Compiling begins (None), or has ended after so much processor time: the job's clock stands meanwhile."""
        if spent is None:
            self.compiling_since = now, used
        elif self.compiling_since is not None:
            self.compiled += spent
            self.began += now - self.compiling_since[0]
            self.compiling_since = None

    def pause(self, seconds: float) -> None:
        """Nobody has looked for so long: that is no time of the job."""
        self.began += seconds
        if self.compiling_since is not None:
            self.compiling_since = self.compiling_since[0] + seconds, self.compiling_since[1]
        if self.worker is not None:
            self.worker.asked += seconds

    def is_late(self, used: float, now: float) -> bool:
        """Whether the job is past its deadline."""
        if self.job is None:
            return False
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
    memory : int
        Bytes that one worker may hold, with all that it has started.
    main : bool
        Whether jobs hold objects of the caller's main module.
    """

    def __init__(self, *, workers: int, memory: int, main: bool = False) -> None:
        self.workers = workers
        self.memory = memory
        self._main = main
        self._waiting: dict[str, deque[Jobs]] = {}
        self._tasks: list[_Task] = []
        self._starting: deque[WorkerProcess] = deque()
        self._server: ForkServer | None = None
        self._lost = 0
        self._wanted: set[str] = set()
        self._looked = time.monotonic()

    def add(self, queue: str, jobs: Jobs, *, first: bool = False) -> None:
        """Put a sequence at the end of a queue; ``first``: the queue comes before all others."""
        if first and queue not in self._waiting:
            self._waiting = {queue: deque(), **self._waiting}
        self._waiting.setdefault(queue, deque()).append(jobs)

    def preload(self, function: Callable[[], None]) -> None:
        """Have a function of a module called where workers are forked, beside their work: it imports something."""
        self._wanted.add(f"{function.__module__}:{function.__qualname__}")

    def run(self, tick: Callable[[], None] = lambda: None) -> None:
        """Do all that has been added, and is added meanwhile; ``tick`` is called several times a second."""
        self._looked = time.monotonic()
        try:
            while self._waiting or self._tasks:
                self._fill()
                self._exchange()
                self._enforce()
                tick()
        finally:
            for task in self._tasks:
                if task.worker is not None:
                    task.worker.stop()
                task.jobs.close()
            self._tasks.clear()
            self._waiting.clear()
            # One that still owes us a worker would tell of it somebody else.
            if self._server is not None and (self._starting or self._server is not present_server()):
                self._server.close()
            self._starting.clear()
            self._server = None

    def _fill(self) -> None:
        """Begin sequences while there are workers for them."""
        while self._waiting and len(self._tasks) < self.workers:
            at_work = {task.queue for task in self._tasks}
            queue = next((name for name in self._waiting if name not in at_work), next(iter(self._waiting)))
            self._begin(queue, None)
        while self._wanted and self._server is not None:
            self._server.preload(self._wanted.pop())

    def _begin(self, queue: str, worker: WorkerProcess | None) -> None:
        """Begin the next sequence of a queue, with a worker that has done one before."""
        task = _Task(queue, self._waiting[queue].popleft())
        if not self._waiting[queue]:
            del self._waiting[queue]
        task.worker = worker
        self._tasks.append(task)
        self._next(task, None)

    def _next(self, task: _Task, result: Any) -> None:
        """Go on with a sequence, whose present job has this result."""
        if task.again is not None:
            job, task.again = task.again, None
            if not isinstance(result, Failure):
                self._send(task, job)
                return
        try:
            job = task.jobs.send(result)
        except StopIteration:
            self._end(task)
            return
        if task.worker is not None and task.worker.ended is not None and not job.rests:
            self._without_worker(task)  # what it died of was no job of this one
        self._send(task, job)

    def _end(self, task: _Task) -> None:
        """A sequence is over: its worker goes on with the next one of the queue."""
        self._tasks.remove(task)
        worker, task.worker = task.worker, None
        if worker is None:
            return
        grown = worker.resident - worker.began_with
        if task.queue in self._waiting and worker.ended is None and grown <= REUSED * self.memory:
            self._begin(task.queue, worker)
        else:
            worker.stop()

    def _without_worker(self, task: _Task) -> None:
        if task.worker is not None:
            task.worker.stop()
            task.worker = None

    def _send(self, task: _Task, job: Job) -> None:
        """Have a job done by the sequence's worker, or a new one."""
        task.job = job
        if task.worker is None:
            task.worker = self._new_worker()
        task.begin(b"", 0.0, 0.0)
        if task.worker.pid is not None:
            self._request(task, task.worker)

    def _request(self, task: _Task, worker: WorkerProcess) -> None:
        job = task.job
        try:
            pickled = pickle.dumps(job, pickle.HIGHEST_PROTOCOL)
        except Exception as error:  # whatever the solver's own classes do on the way into a pickle
            raise HenonRefError(
                f"a job of {task.queue} cannot be sent to its worker ({failure_of(error).reason}); "
                "define solvers at the top of a module"
            ) from error
        task.begin(new_token(), worker.used, worker.clock)
        worker.channel.send(task.token, pickled)

    def _new_worker(self) -> WorkerProcess:
        if self._server is None:
            self._server = present_server() or ForkServer.of_caller(main=self._main)
        worker = WorkerProcess(self._server, self.memory)
        self._starting.append(worker)
        return worker

    def _exchange(self) -> None:
        """Take and give what can be had or given, waiting for the next look at the clock at most."""
        poll = select.poll()
        if self._server is not None:
            poll.register(self._server, select.POLLIN)
        for task in self._tasks:
            if task.worker is not None:
                task.worker.register(poll)
        poll.poll(POLL * 1000)
        self._hear()  # first of all: what a worker has sent before its end is there then
        for task in list(self._tasks):
            if (worker := task.worker) is not None:
                worker.channel.go_on()
                worker.read_log()
                self._receive(task, worker)

    def _hear(self) -> None:
        """Take what the fork server tells: which workers have begun, and which have ended."""
        for kind, pid, status in self._server.reports() if self._server is not None else []:
            if kind == BEGUN:
                worker = self._starting.popleft()
                worker.pid = pid
                worker.began_with = worker.resident
                for task in self._tasks:
                    if task.worker is worker:
                        self._request(task, worker)
            for task in self._tasks:
                if kind == ENDED and task.worker is not None and task.worker.pid == pid:
                    task.worker.ended = status

    def _receive(self, task: _Task, worker: WorkerProcess) -> None:
        """Take the messages of a worker on its job."""
        if worker.pid is None or not task.sent:
            return
        result: Any = None
        try:
            for pickled in worker.channel.receive(worker.pid, task.token):
                kind, result = pickle.loads(pickled)
                if kind == REPLY:
                    break
                task.compiling(result, worker.used, worker.clock)
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
        absent = now - self._looked
        self._looked = now
        if absent > ABSENCE:
            for task in self._tasks:
                task.pause(absent)
        if self._server is not None and (not self._server.is_sound or self._is_slow(self._server)):
            self._replace_server(self._server)
        for task in list(self._tasks):
            if (worker := task.worker) is not None and task.sent and (failure := self._failure(task, worker)):
                self._finish(task, failure, sound=False)

    def _failure(self, task: _Task, worker: WorkerProcess) -> Failure | None:
        """Why a job has to be ended; None where it has not."""
        if worker.ended is not None:
            return worker.crash()
        if worker.resident > self.memory and (held := worker.own) > self.memory:
            return Failure("failed", f"memory: {held / 2**30:.1f} GiB held, {self.memory / 2**30:.1f} GiB allowed")
        if task.is_late(worker.used, worker.clock):
            return Failure("timeout", "stopped from outside: no answer within the time allowed", ignored=True)
        return None

    def _finish(self, task: _Task, result: Any, *, sound: bool) -> None:
        """A job has its result; ``sound``: its worker can go on."""
        task.sent = False
        if not sound:
            self._without_worker(task)
        elif task.worker is not None and task.job is not None and task.job.prepares:
            task.worker.prepared = None if isinstance(result, Failure) else task.job
        self._next(task, result)

    def _is_slow(self, server: ForkServer) -> bool:
        return bool(self._starting) and server.clock - self._starting[0].asked > START_SECONDS

    def _replace_server(self, server: ForkServer) -> None:
        """Do all jobs again whose workers a lost fork server takes with it: it was no fault of theirs.

        Raises
        ------
        HenonRefError
            Where that has happened too often.
        """
        server.close()
        self._server = None
        self._starting.clear()
        self._lost += 1
        if self._lost > MOST_SERVERS:
            raise HenonRefError(f"the process that workers are forked from was stopped or ended {self._lost} times")
        for task in self._tasks:
            worker, job = task.worker, task.job
            self._without_worker(task)
            if worker is None or job is None:
                continue
            if task.again is None and job.rests and worker.prepared is not None:
                task.again, job = job, worker.prepared
            self._send(task, job)
