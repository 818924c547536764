"""A hang, a crash, memory beyond the limit or an exception is one failed job; the others go on."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path

import pytest

from henon_ref.errors import HenonRefError, UnavailableError, UnsupportedError
from henon_ref.score import fence, process
from henon_ref.score.fence import Answer, Fence, Lane
from henon_ref.score.process import resident_bytes
from henon_ref.score.worker import Failure

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX signals")


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
        yield "result", doubled

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


def gone(pid: int) -> bool:
    """Whether a process is no more (or is only waiting to be reaped by somebody else)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except FileNotFoundError:
        return True


def test_lanes_of_one_kin_have_one_worker_after_the_other(monkeypatch):
    """Four lanes of two kins, one at a time, and two of none: four workers. A grown one is not passed on."""

    def workers() -> list[int]:
        seen = Collector()
        kins = {"a": "x", "b": "y", "c": "x", "d": "y", "e": None, "f": None}
        lanes = [Lane(what, deque([Act(what)]), kin) for what, kin in kins.items()]
        Fence(processes=1, memory=memory()).run(lanes, seen)
        assert set(seen.results) == set(kins)
        return [seen.pids[what] for what in kins]

    a, b, c, d, e, f = workers()
    assert (a, b) == (c, d)
    assert len({a, b, e, f}) == 4
    monkeypatch.setattr(fence, "PASSED_ON", -1.0)
    assert len(set(workers())) == 6


def test_a_dead_worker_is_not_passed_on():
    seen = Collector()
    lanes = [Lane(what, deque([Act(what)]), "x") for what in ("a", "kill", "b", "c")]
    Fence(processes=1, memory=memory()).run(lanes, seen)
    assert set(seen.results) == {"a", "b", "c"}
    assert set(seen.failures) == {"kill"}
    assert seen.pids["a"] != seen.pids["b"] == seen.pids["c"]


def test_a_lane_keeps_its_worker():
    seen = run(["a", "b", "c"])
    assert seen.results == {"a": "aa", "b": "bb", "c": "cc"}
    assert len(set(seen.pids.values())) == 1
    assert not seen.failures


@pytest.mark.parametrize(
    ("what", "status", "words"),
    [
        ("kill", "failed", "SIGKILL"),
        ("abort", "failed", "SIGABRT: LLVM ERROR: out of registers"),
        ("raise", "failed", "ValueError: bad value"),
        ("trap", "failed", "what the worker sent cannot be read: RuntimeError: out of the pickle"),
        ("unsupported", "unsupported", "no events"),
        ("unavailable", "unavailable", "not installed"),
    ],
)
def test_a_failed_job_says_why_and_the_lane_goes_on(what, status, words):
    seen = run(["before", what, "after"], ["other"])
    assert seen.failures[what].status == status
    assert words in seen.failures[what].reason
    assert seen.results == {"before": "beforebefore", "after": "afterafter", "other": "otherother"}


def test_a_job_that_cannot_be_sent_is_named_whatever_its_classes_raise():
    with pytest.raises(HenonRefError, match=r"a job of a cannot be sent to its worker \(ValueError: no state\)"):
        Fence(processes=1, memory=memory()).run([Lane("a", deque([Stuck()]))], Collector())


@pytest.mark.parametrize("what", ["hang", "spin"])
def test_a_hang_is_ended_at_its_deadline(what):
    seen = run([what, "after"], collector=Collector(seconds=0.3))
    assert seen.failures[what].status == "timeout"
    assert seen.results == {"after": "afterafter"}
    assert gone(seen.pids[what])


@pytest.mark.parametrize("what", ["eat", "gulp"])
def test_memory_beyond_the_limit_ends_the_job(what):
    seen = run([what, "after"])
    assert seen.failures[what].status == "failed"
    assert "memory" in seen.failures[what].reason.lower()
    assert seen.results == {"after": "afterafter"}


def test_what_a_worker_started_dies_with_it():
    seen = run(["children"], collector=Collector(seconds=0.5))
    assert seen.failures["children"].status == "timeout"
    deadline = time.monotonic() + 5
    while not gone(seen.pids["child"]) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert gone(seen.pids["child"])


def test_an_interrupt_leaves_no_process_behind():
    class Interrupted(Collector):
        def finished(self, lane, job, failure):
            super().finished(lane, job, failure)
            raise KeyboardInterrupt

    collector = Interrupted()
    with pytest.raises(KeyboardInterrupt):
        run(["a"], ["hang"], collector=collector)
    assert collector.done == ["a"]
    deadline = time.monotonic() + 5
    while not all(gone(pid) for pid in collector.pids.values()) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert all(gone(pid) for pid in collector.pids.values())


@pytest.mark.skipif(sys.platform != "linux", reason="the parent-death signal is Linux's")
def test_workers_die_with_a_killed_parent(tmp_path):
    script = tmp_path / "parent.py"
    script.write_text(
        textwrap.dedent(f"""
        import sys
        sys.path.insert(0, {str(Path(__file__).parent)!r})
        from test_fence import Collector, run
        class Tell(Collector):
            def receive(self, lane, job, stage, payload):
                print(payload[1], flush=True)
                return super().receive(lane, job, stage, payload)
        run(["hang"], collector=Tell(60))
        """)
    )
    parent = subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True)
    worker = int(parent.stdout.readline())
    parent.kill()
    parent.wait()
    parent.stdout.close()
    deadline = time.monotonic() + 5
    while not gone(worker) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert gone(worker)


def test_spawned_workers_do_the_same(monkeypatch):
    monkeypatch.setattr(process, "_context", lambda: multiprocessing.get_context("spawn"))
    seen = run(["a", "kill", "b"])
    assert seen.results == {"a": "aa", "b": "bb"}
    assert "SIGKILL" in seen.failures["kill"].reason
