"""Jobs for a pool of workers that fail in all possible ways."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from henon_ref.errors import UnavailableError, UnsupportedError
from henon_ref.jit.processor_time import compiling
from henon_ref.workers.channel import MAGIC, MAX_MESSAGE
from henon_ref.workers.machine import resident_bytes
from henon_ref.workers.pool import Jobs, WorkerPool
from henon_ref.workers.worker import REPLY, Failure, Job, WorkerState


def memory() -> int:
    """Bytes that a worker may hold: it begins with what this process holds, which depends on the tests before."""
    return resident_bytes([os.getpid()]) + 600 * 2**20


def way_out() -> list[int]:
    """Descriptors of the sockets that a process has: what a hostile library finds by looking."""
    found = []
    for name in os.listdir("/proc/self/fd"):
        with suppress(OSError):
            if os.readlink(f"/proc/self/fd/{name}").startswith("socket:"):
                found.append(int(name))
    return found


def send_all(data: bytes) -> None:
    """Write something to every socket."""
    for descriptor in way_out():
        with suppress(OSError):
            os.write(descriptor, data)


def burn(seconds: float) -> None:
    """Use processor time."""
    ends = time.process_time() + seconds
    while time.process_time() < ends:
        pass


@contextmanager
def crowd() -> Iterator[int]:
    """Number of a processor that six programs want all the time."""
    processor = min(os.sched_getaffinity(0))
    code = f"import os; os.sched_setaffinity(0, [{processor}])\nwhile True: pass"
    programs = [subprocess.Popen([sys.executable, "-c", code]) for _ in range(6)]
    try:
        yield processor
    finally:
        for program in programs:
            program.kill()
            program.wait()


def grandchild(work) -> None:
    """Have something done by a process in a session of its own, whose parent is gone at once."""
    if os.fork() == 0:
        os.setsid()
        if os.fork() == 0:
            work()
        os._exit(0)
    os.wait()


def note(path: str) -> None:
    """Write down the process's number."""
    with open(path, "a", encoding="ascii") as file:
        file.write(f"{os.getpid()}\n")


def noted(path: Path) -> list[int]:
    return [int(line) for line in path.read_text().split()] if path.exists() else []


def square(value: int) -> int:
    return value * value


@dataclass(frozen=True)
class Act:
    """A job that does what its name says; its result is its name twice, or else what is asked for."""

    what: str
    seconds: float = 20.0
    notes: str = ""
    """File to which the processes that take part write their numbers."""

    def run(self, state: WorkerState) -> object:
        if self.notes:
            note(self.notes)
        act = getattr(self, f"do_{self.what}", None)
        result = act(state) if act is not None else None
        return self.what * 2 if result is None else result

    def do_pid(self, state):
        return os.getpid()

    def do_keep(self, state):
        state.kept["word"] = "kept"

    def do_kept(self, state):
        return state.kept.get("word", "nothing")

    def do_imported(self, state):
        return "henon_ref.integrator.integrator" in sys.modules

    def do_hang(self, state):
        while True:
            time.sleep(1)

    def do_spin(self, state):
        sum(iter(int, 1))  # endless in C: no byte code, so no Python signal handler ever runs

    def do_sleep(self, state):
        time.sleep(1.5 * self.seconds)

    def do_wait(self, state):
        time.sleep(0.6)

    def do_answer_at_length(self, state):
        """More than the way to the pool holds, and no work to speak of."""
        return b"x" * (4 * 2**20)

    def do_burn(self, state):
        burn(1.5 * self.seconds + 0.1)

    def do_burn_in_a_crowd(self, state):
        """So much less than it may that it would be in time, if it had a processor for itself."""
        os.sched_setaffinity(0, [min(os.sched_getaffinity(0))])
        burn(0.6 * self.seconds)

    def do_burn_in_a_child(self, state):
        child = os.fork()
        if child == 0:
            burn(60)
            os._exit(0)
        os.waitpid(child, 0)

    def do_compile(self, state):
        with state.off_the_clock(), compiling():
            burn(1.5 * self.seconds + 0.1)

    def do_gulp(self, state):
        bytearray(2**50)

    def do_eat(self, state):
        held = []
        while True:
            held.append(bytearray(os.urandom(1) * (20 * 2**20)))
            time.sleep(0.01)

    def do_hold(self, state):
        """A quarter of a GiB, which every worker may."""
        return len(b"x" * 2**28)

    def do_eat_elsewhere(self, state):
        """Three processes, none of which holds too much alone."""

        def eat():
            note(self.notes)
            held = b"x" * (400 * 2**20)
            time.sleep(60 + len(held) % 2)

        for _ in range(3):
            grandchild(eat)
        time.sleep(60)

    def do_kill(self, state):
        os.kill(os.getpid(), signal.SIGKILL)

    def do_abort(self, state):
        os.write(2, b"LLVM ERROR: out of registers\n")
        os.abort()

    def do_abort_while_a_child_holds_the_way(self, state):
        if os.fork() == 0:
            time.sleep(60)
        os.write(2, b"the end\n")
        os.abort()

    def do_raise(self, state):
        raise ValueError("bad\n  value")

    def do_unsupported(self, state):
        raise UnsupportedError("no events")

    def do_unavailable(self, state):
        raise UnavailableError("not installed")

    def do_trap(self, state):
        return Trap()

    def do_local(self, state):
        return lambda: None

    def do_children(self, state):
        child = subprocess.Popen(["sleep", "60"])
        Path(self.notes).write_text(f"{os.getpid()}\n{child.pid}\n")
        time.sleep(60)

    def do_leave_a_daemon(self, state):
        def stay():
            note(self.notes)
            time.sleep(60)

        grandchild(stay)
        while len(noted(Path(self.notes))) < 2:
            time.sleep(0.01)

    def do_stray(self, state):
        send_all(b"\0\0\0\x04")

    def do_stray_done(self, state):
        send_all(struct.pack("!i", 17) + b"\x80\x04done, I swear...")
        time.sleep(60)

    def do_stray_part(self, state):
        send_all(MAGIC)
        time.sleep(60)

    def do_large(self, state):
        send_all(struct.pack("=4s16siQ", MAGIC, b"", os.getpid(), MAX_MESSAGE + 1))
        time.sleep(60)

    def do_stop(self, state):
        send_all(struct.pack("=4s16siQ", MAGIC, b"", os.getpid(), 100) + b"only so much")
        os.kill(os.getpid(), signal.SIGSTOP)

    def do_forge(self, state):
        """A child of ours answers for us, with all that our answer would have."""
        token, worker = state.tell.__defaults__
        pickled = pickle.dumps((REPLY, "forged"))
        child = os.fork()
        if child == 0:
            send_all(struct.pack("=4s16siQ", MAGIC, token, worker, len(pickled)) + pickled)
            os._exit(0)
        os.waitpid(child, 0)

    def do_flood(self, state):
        """A child of ours sends on and on."""
        if os.fork() == 0:
            while True:
                send_all(b"x" * 2**16)
        time.sleep(0.5)

    def do_fork_and_return(self, state):
        """The child comes back out of the solver, too, late."""
        if os.fork() == 0:
            time.sleep(0.3)
            return "late"
        return "mine"

    def do_late_thread(self, state):
        """A thread of ours answers in the next job, with what it was told in this one."""
        tell = state.tell
        threading.Timer(0.3, lambda: tell(REPLY, "late")).start()

    def do_print(self, state):
        while True:
            os.write(1, b"x" * 2**16)

    def do_print_much(self, state):
        for _ in range(100):
            os.write(1, b"x" * 2**16)

    def do_pool(self, state):
        with multiprocessing.get_context("fork").Pool(2) as pool:
            return sum(pool.map(square, range(4)))

    def do_stop_guard(self, state):
        os.kill(os.getppid(), signal.SIGSTOP)

    def do_kill_guard(self, state):
        os.kill(os.getppid(), signal.SIGKILL)
        time.sleep(60)

    def do_close(self, state):
        for descriptor in way_out():
            os.close(descriptor)
        os.closerange(0, 3)
        time.sleep(60)


class Trap:
    """Fails where it is taken out of a pickle."""

    def __reduce__(self):
        return exec, (r"raise RuntimeError('out of\nthe pickle')",)


@dataclass(frozen=True)
class Stuck:
    """A job that does not go into a pickle."""

    what: str = "stuck"
    seconds: float = 20.0

    def run(self, state):
        raise NotImplementedError

    def __getstate__(self):
        raise ValueError("no state")


class Collector:
    """Takes results by the names of jobs."""

    def __init__(self) -> None:
        self.results: dict[str, object] = {}
        self.failures: dict[str, Failure] = {}

    def jobs(self, *jobs: str | Act | Stuck) -> Jobs:
        for job in jobs:
            asked = Act(job) if isinstance(job, str) else job
            result = yield Job(asked.run, (), asked.seconds)
            self.take(asked.what, result)

    def take(self, what: str, result: object) -> None:
        if isinstance(result, Failure):
            self.failures[what] = result
        else:
            self.results[what] = result


def run(
    *queues: list[str | Act | Stuck], collector: Collector | None = None, workers: int = 2, main: bool = False
) -> Collector:
    """Do jobs, each list in a queue of its own."""
    collector = collector or Collector()
    pool = WorkerPool(workers=workers, memory=memory(), main=main)
    for number, jobs in enumerate(queues):
        pool.add(str(number), collector.jobs(*jobs))
    pool.run()
    return collector
