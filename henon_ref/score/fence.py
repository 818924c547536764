"""Fences: jobs in worker processes, with limits on time and memory, so that one failure stays one failure.

A lane is a queue of jobs that share a worker (one solver's runs: its imports and compiled code are kept), and lanes of
one kin take over each other's workers. A worker that hangs, dies or outgrows its memory is killed with all it started,
its job is reported as failed, and the lane goes on with a new worker. Leaving :meth:`Fence.run`, by whatever exception,
leaves no process behind.
"""

from __future__ import annotations

import signal
import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.reduction import ForkingPickler
from typing import Any, Protocol

from henon_ref.errors import HenonRefError
from henon_ref.score.plaintext import plain_text
from henon_ref.score.process import Process
from henon_ref.score.worker import DONE, FAILURE, Failure, Job, failure_of

POLL = 0.05
"""Seconds between two looks at the clock and at memory."""
PASSED_ON = 0.25
"""Part of its memory by which a worker that is passed on may have grown: what one lane has left there is not held
against the next."""


@dataclass(eq=False)
class Lane:
    """Jobs that one worker does in turn."""

    name: str
    jobs: deque[Job] = field(default_factory=deque)
    kin: str | None = None
    """Lanes of the same kin may have the same worker, one after the other."""
    here: bool = False
    """Whether its worker wants what this process has imported by then."""


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


@dataclass
class _Slot:
    """A lane at work."""

    lane: Lane
    worker: Process
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

    def _begin(self, lane: Lane, worker: Process | None = None) -> None:
        """Start the lane's next job, in its worker or a new one; a lane without jobs is over."""
        if not lane.jobs:
            if worker is not None:
                self._pass_on(lane, worker)
            return
        job = lane.jobs.popleft()
        slot = _Slot(lane, worker or Process(self.memory, here=lane.here), job, time.monotonic() + job.seconds)
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

    def _pass_on(self, lane: Lane, worker: Process) -> None:
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
            held = slot.worker.resident
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


def _crash(worker: Process) -> Failure:
    """What a worker died of."""
    code = worker.ended()
    how = f"the worker ended with code {code}"
    if code is not None and code < 0:
        how = f"the library was ended by signal {signal.Signals(-code).name}"
    words = worker.last_words()
    return Failure("failed", f"{how}: {words}" if words else how)
