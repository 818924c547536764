"""Fences: jobs in worker processes, with limits on time and memory, so that one failure stays one failure.

A lane is a queue of jobs that share a worker (one solver's runs: its imports and compiled code are kept), and lanes of
one kin take over each other's workers. A worker that hangs, dies or outgrows its memory is killed with all it started,
its job is reported as failed, and the lane goes on with a new worker. Leaving :meth:`Fence.run`, by whatever exception,
leaves no process behind.

Workers are forked on Linux while the caller has a single thread; elsewhere they are spawned, and a script that
calls this needs the usual ``if __name__ == "__main__"`` guard.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import tempfile
import threading
import time
import warnings
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.context import BaseContext
from multiprocessing.process import BaseProcess
from multiprocessing.reduction import ForkingPickler
from pathlib import Path
from typing import IO, Any, Protocol

from henon_ref.errors import HenonRefError
from henon_ref.score.plaintext import plain_text
from henon_ref.score.worker import DONE, FAILURE, Failure, Job, failure_of, serve

POLL = 0.05
"""Seconds between two looks at the clock and at memory."""
PASSED_ON = 0.25
"""Part of its memory by which a worker that is passed on may have grown: what one lane has left there is not held
against the next."""
LOG_TAIL = 4000
"""Bytes of a dead worker's output that are searched for its last words."""


@dataclass(eq=False)
class Lane:
    """Jobs that one worker does in turn."""

    name: str
    jobs: deque[Job] = field(default_factory=deque)
    kin: str | None = None
    """Lanes of the same kin may have the same worker, one after the other."""


@dataclass(frozen=True)
class Answer:
    """What a worker is told, and how long it then has until its next message."""

    value: Any
    seconds: float


class Consumer(Protocol):
    """Takes what the workers report."""

    def receive(self, lane: Lane, job: Job, stage: str, payload: Any) -> Answer:
        """A stage of a job is reached."""
        ...

    def finished(self, lane: Lane, job: Job, failure: Failure | None) -> None:
        """A job is over."""
        ...

    def tick(self) -> None:
        """Called several times a second while waiting."""
        ...


class _Worker:
    """One process and the parent's end of its connection."""

    def __init__(self, context: BaseContext, memory: int) -> None:
        self.log: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - closed in stop()
        self.connection, theirs = multiprocessing.Pipe()
        # A spawned process does not inherit the file: its last words are lost.
        log = self.log.fileno() if context.get_start_method() == "fork" else None
        self.process: BaseProcess = context.Process(  # type: ignore[attr-defined]
            target=serve, args=(theirs, os.getpid(), memory, log), daemon=True
        )
        with warnings.catch_warnings():
            # BLAS keeps threads of its own, which survive a fork by its own handlers.
            warnings.simplefilter("ignore", DeprecationWarning)
            self.process.start()
        theirs.close()
        self._began_with = resident_bytes(self.process.pid) or 0

    @property
    def grown(self) -> int:
        """Bytes that it holds beyond those that it began with (a fork begins with its parent's)."""
        return (resident_bytes(self.process.pid) or 0) - self._began_with

    def stop(self) -> None:
        """Kill the process and everything it started."""
        pid = self.process.pid
        try:
            os.killpg(pid, signal.SIGKILL)  # type: ignore[arg-type]
        except (ProcessLookupError, PermissionError):  # it is gone, or has not made its group yet
            self.process.kill()
        self.process.join()
        self.process.close()
        self.connection.close()
        self.log.close()

    def last_words(self) -> str:
        """The last line that the process printed, for the reason of a crash."""
        size = self.log.seek(0, os.SEEK_END)
        self.log.seek(max(0, size - LOG_TAIL))
        lines = map(plain_text, self.log.read().decode(errors="replace").split("\n"))
        return next((line for line in reversed([*lines]) if line), "")


@dataclass
class _Slot:
    """A lane at work."""

    lane: Lane
    worker: _Worker
    job: Job
    deadline: float


class Fence:
    """Runs lanes of jobs, a few at a time.

    Parameters
    ----------
    processes : int
        Workers at work at once.
    memory : int
        Bytes that one worker may hold.
    """

    def __init__(self, *, processes: int, memory: int) -> None:
        self.processes = processes
        self.memory = memory
        self._slots: list[_Slot] = []
        self._waiting: deque[Lane] = deque()
        self._context = _context()

    def run(self, lanes: Iterable[Lane], consumer: Consumer) -> None:
        """Do all jobs of all lanes; see :class:`Consumer` for what comes back."""
        self._waiting.extend(lane for lane in lanes if lane.jobs)
        try:
            while self._waiting or self._slots:
                while self._waiting and len(self._slots) < self.processes:
                    self._begin(self._waiting.popleft())
                self._wait(consumer)
                self._enforce(consumer)
                consumer.tick()
        finally:
            for slot in self._slots:
                slot.worker.stop()
            self._slots.clear()
            self._waiting.clear()

    def add(self, lane: Lane) -> None:
        """A lane that came up while others are at work; it is the next to begin."""
        self._waiting.appendleft(lane)

    def _begin(self, lane: Lane, worker: _Worker | None = None) -> None:
        """Start the lane's next job, in its worker or a new one; a lane without jobs is over."""
        if not lane.jobs:
            if worker is not None:
                self._pass_on(lane, worker)
            return
        job = lane.jobs.popleft()
        slot = _Slot(lane, worker or _Worker(self._context, self.memory), job, time.monotonic() + job.seconds)
        self._slots.append(slot)
        try:
            message = ForkingPickler.dumps(job)
        except Exception as error:  # whatever the solver's own classes do on the way into a pickle
            raise HenonRefError(
                f"a job of {lane.name} cannot be sent to its worker ({failure_of(error).reason}); "
                "define solvers at the top of a module"
            ) from error
        try:
            slot.worker.connection.send_bytes(message)
        except BrokenPipeError:  # it died at once: seen as a crash on the next look
            return

    def _pass_on(self, lane: Lane, worker: _Worker) -> None:
        """Give the worker of a lane that is over to the next one of its kin."""
        heir = next((other for other in self._waiting if lane.kin is not None and other.kin == lane.kin), None)
        if heir is None or worker.grown > PASSED_ON * self.memory:
            worker.stop()
            return
        self._waiting.remove(heir)
        self._begin(heir, worker)

    def _wait(self, consumer: Consumer) -> None:
        """Take the messages that arrive before the next look at the clock."""
        by_connection = {slot.worker.connection: slot for slot in self._slots}
        for ready in wait(list(by_connection), timeout=POLL):
            slot = by_connection[ready]  # type: ignore[index]
            try:
                message = slot.worker.connection.recv_bytes()
            except (EOFError, OSError):
                self._end(slot, consumer, _crash(slot.worker), restart=True)
                continue
            try:
                stage, payload = ForkingPickler.loads(message)
            except (Exception, SystemExit) as error:  # noqa: BLE001 - whatever its classes do on the way out
                reason = f"what the worker sent cannot be read: {failure_of(error).reason}"
                self._end(slot, consumer, Failure("failed", plain_text(reason)), restart=True)
                continue
            if stage == DONE:
                self._end(slot, consumer, None, restart=False)
            elif stage == FAILURE:
                self._end(slot, consumer, payload, restart=payload.status == "failed")
            else:
                answer = consumer.receive(slot.lane, slot.job, stage, payload)
                slot.deadline = time.monotonic() + answer.seconds
                _answer(slot.worker.connection, answer.value)

    def _enforce(self, consumer: Consumer) -> None:
        """End the jobs that are past their time or their memory."""
        now = time.monotonic()
        for slot in list(self._slots):
            held = resident_bytes(slot.worker.process.pid)
            if held is not None and held > self.memory:
                reason = f"memory: {held / 2**30:.1f} GiB held, {self.memory / 2**30:.1f} GiB allowed"
                self._end(slot, consumer, Failure("failed", reason), restart=True)
            elif now > slot.deadline and not slot.worker.connection.poll():
                reason = "stopped from outside: no answer within the time allowed"
                self._end(slot, consumer, Failure("timeout", reason), restart=True)

    def _end(self, slot: _Slot, consumer: Consumer, failure: Failure | None, *, restart: bool) -> None:
        self._slots.remove(slot)
        if restart:
            slot.worker.stop()
        try:
            consumer.finished(slot.lane, slot.job, failure)
        except BaseException:
            if not restart:
                slot.worker.stop()
            raise
        self._begin(slot.lane, None if restart else slot.worker)


def _answer(connection: Connection, value: Any) -> None:
    try:
        connection.send(value)
    except BrokenPipeError:  # it died meanwhile: seen as a crash on the next look
        return


def _crash(worker: _Worker) -> Failure:
    """What a worker died of."""
    worker.process.join(timeout=5)
    code = worker.process.exitcode
    how = f"the worker ended with code {code}"
    if code is not None and code < 0:
        how = f"the library was ended by signal {signal.Signals(-code).name}"
    words = worker.last_words()
    return Failure("failed", f"{how}: {words}" if words else how)


def resident_bytes(pid: int | None) -> int | None:
    """Memory that a process holds; None where the system does not tell."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
    except (OSError, IndexError):
        return None
    return pages * os.sysconf("SC_PAGE_SIZE")


def _context() -> BaseContext:
    single = sys.platform == "linux" and threading.active_count() == 1
    return multiprocessing.get_context("fork" if single else "spawn")
