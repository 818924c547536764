"""Jobs that fail in all ways there are, for fences."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections import deque
from dataclasses import dataclass

from henon_ref.errors import UnavailableError, UnsupportedError
from henon_ref.score.fence import Answer, Fence, Lane
from henon_ref.score.process import resident_bytes
from henon_ref.score.worker import Failure


def memory() -> int:
    """Bytes that a worker may hold: it begins with what this process holds, which depends on the tests before."""
    return (resident_bytes(os.getpid()) or 0) + 600 * 2**20


@dataclass(frozen=True)
class Act:
    """A job that does what its name says."""

    what: str
    seconds: float = 20.0

    def stages(self):
        doubled = yield "begun", (self.what, os.getpid())
        if self.what == "hang":
            while True:
                time.sleep(1)
        elif self.what == "spin":
            sum(iter(int, 1))  # endless in C: no byte code, so no Python signal handler ever runs
        elif self.what == "gulp":
            bytearray(2**50)
        elif self.what == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        elif self.what == "abort":
            os.write(2, b"LLVM ERROR: out of registers\n")
            os.abort()
        elif self.what == "eat":
            self.eat()
        elif self.what == "raise":
            raise ValueError("bad\n  value")
        elif self.what == "unsupported":
            raise UnsupportedError("no events")
        elif self.what == "unavailable":
            raise UnavailableError("not installed")
        elif self.what == "trap":
            yield "begun", Trap()
        elif self.what == "children":
            yield "begun", ("child", subprocess.Popen(["sleep", "60"]).pid)
            time.sleep(60)
        yield "result", "henon_ref.henon.engine" in sys.modules if self.what == "imported" else doubled

    def eat(self):
        held = []
        while True:
            held.append(bytearray(os.urandom(1) * (20 * 2**20)))
            time.sleep(0.01)


def spring():
    raise RuntimeError("out of\nthe pickle")


class Trap:
    """Fails where it is taken out of a pickle."""

    def __reduce__(self):
        return spring, ()


@dataclass(frozen=True)
class Stuck:
    """A job that does not go into a pickle."""

    what: str = "stuck"
    seconds: float = 20.0

    def __getstate__(self):
        raise ValueError("no state")


class Collector:
    def __init__(self, seconds: float = 20.0):
        self.results: dict[str, object] = {}
        self.failures: dict[str, Failure] = {}
        self.pids: dict[str, int] = {}
        self.done: list[str] = []
        self.seconds = seconds

    def receive(self, lane, job, stage, payload):
        if stage == "begun":
            self.pids[payload[0]] = payload[1]
            return Answer(payload[0] * 2, self.seconds)
        self.results[job.what] = payload
        return Answer(None, self.seconds)

    def finished(self, lane, job, failure):
        self.done.append(job.what)
        if failure is not None:
            self.failures[job.what] = failure

    def tick(self):
        pass


def run(*lanes: list[str], collector: Collector | None = None, processes: int = 2) -> Collector:
    collector = collector or Collector()
    Fence(processes=processes, memory=memory()).run(
        [Lane(str(k), deque(Act(what) for what in jobs)) for k, jobs in enumerate(lanes)], collector
    )
    return collector


class Tell(Collector):
    """Prints what a job has begun with."""

    def receive(self, lane, job, stage, payload):
        print(*payload[1:], flush=True)
        return super().receive(lane, job, stage, payload)
