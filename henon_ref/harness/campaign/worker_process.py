"""A worker's process: what goes to it and comes from it, what it holds and has used, and how it ends."""

from __future__ import annotations

import os
import select
import signal
import time
from contextlib import suppress

from henon_ref.harness.campaign.channel import Channel
from henon_ref.harness.campaign.fork_server import ForkServer
from henon_ref.harness.campaign.worker import Failure, Job
from henon_ref.jit.processor_time import waited_seconds
from henon_ref.text import short_line
from henon_ref.workers.procfs import KNOWN, family, kill_family, own_bytes, processor_seconds, resident_bytes

LOG_TAIL = 4000
"""Bytes of a worker's output that are kept, for its last words."""
_AT_ONCE = 1 << 16


class WorkerProcess:
    """A worker, from the pool's side.

    Parameters
    ----------
    server : ForkServer
        Begins it, in its own time.
    memory : int
        Bytes that it may allocate.
    """

    def __init__(self, server: ForkServer, memory: int) -> None:
        self.channel = Channel()
        self.log, theirs = os.pipe()
        os.set_blocking(self.log, False)
        server.fork(self.channel.theirs, theirs, memory)
        os.close(theirs)
        self.channel.theirs.close()
        self.pid: int | None = None
        """Its process; None until the server has begun it."""
        self.ended: int | None = None
        """Exit status, once it has ended."""
        self._waited: dict[int, float] = {}
        self.asked = server.clock
        self.began_with = 0
        self.prepared: Job | None = None
        """The job whose preparation it holds."""
        self._tail, self._silent = b"", False

    @property
    def resident(self) -> int:
        """Bytes that it holds, with all that it has started."""
        return resident_bytes(family(self.pid)) if KNOWN and self.pid else 0

    @property
    def own(self) -> int:
        """The same, what they share counted once (slower to tell)."""
        return own_bytes(family(self.pid)) if KNOWN and self.pid else 0

    @property
    def used(self) -> float:
        """Processor time that it has used, with all that it has started [s]."""
        return processor_seconds(family(self.pid)) if KNOWN and self.pid else 0.0

    @property
    def clock(self) -> float:
        """Wall time, less what it, all that it has started, and this process have waited for a processor [s]."""
        if KNOWN and self.pid:
            for pid in (os.getpid(), *family(self.pid)):  # one that has ended since, of which nothing is told, has, too
                self._waited[pid] = max(self._waited.get(pid, 0.0), waited_seconds(pid))
        return time.monotonic() - sum(self._waited.values())

    def register(self, poll: select.poll) -> None:
        """Have what it sends and prints looked for, and room for what it is sent."""
        if not self.channel.closed:
            poll.register(self.channel, select.POLLIN | (select.POLLOUT if self.channel.waiting else 0))
        if not self._silent:
            poll.register(self.log, select.POLLIN)

    def read_log(self) -> None:
        """Take what it has printed, and keep the end of that."""
        with suppress(BlockingIOError):
            printed = os.read(self.log, _AT_ONCE)
            self._silent = not printed
            self._tail = (self._tail + printed)[-LOG_TAIL:]

    def crash(self) -> Failure:
        """What it died of."""
        how = f"the worker ended with code {self.ended}"
        if self.ended is not None and self.ended < 0:
            how = f"the library was ended by signal {signal.Signals(-self.ended).name}"
        self.read_log()
        lines = map(short_line, self._tail.decode(errors="replace").split("\n"))
        words = next((line for line in reversed([*lines]) if line), "")
        return Failure("failed", f"{how}: {words}" if words else how)

    def stop(self) -> None:
        """Kill it and everything it has started."""
        if self.pid is not None and self.ended is None:
            kill_family(self.pid)
        self.channel.close()
        with suppress(OSError):
            os.close(self.log)
