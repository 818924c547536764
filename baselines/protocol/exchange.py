"""One exchange with a program: bytes in, bytes out, within limits on time, memory and output.

Whatever the program does, what comes back is its output or one sentence about what became of it; and nothing that it
has started goes on.
"""

from __future__ import annotations

import contextlib
import math
import os
import signal
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from time import monotonic, sleep
from typing import IO

from henon_ref.errors import ContractError, UnavailableError
from henon_ref.jit.processor_time import waited_seconds
from henon_ref.text import short_line

try:
    import resource
except ImportError:  # elsewhere than on POSIX systems: wall time alone is limited there
    resource = None  # type: ignore[assignment]

WALL = 2.5
"""Wall time that a program may take, less what it waits for a processor, in its processor time."""
OUTPUT = 64 * 2**20
"""Bytes that a program may write on each of its streams."""
SAID = 2000
"""Last bytes of its standard error that are kept for the reason of a failure."""
LOOK = 0.02
"""Seconds between two looks at whether the program has ended."""
COUNTED = 0.5
"""Part of its limit that a program has used at least that is stopped by it: the system holds against the limit whole
ticks of its clock in which the program was met, and on a busy machine that was up to a third more than it had used."""
ASKED = 60.0
"""Wall time in which a program tells its version [s]."""


class ProgramError(ContractError):
    """A program that gave no response: how it ended, and what it said."""


class ProgramTimeoutError(ProgramError):
    """A program that was stopped since it took too long."""


@dataclass(frozen=True)
class Limits:
    """What one exchange may take."""

    seconds: float
    """Processor time [s], rounded down to whole seconds, one at least; and, ``WALL`` times as much, wall time."""
    memory: int = 4 * 2**30
    """Bytes of data that the program may allocate."""
    output: int = OUTPUT
    """Bytes that it may write."""


class _Program(subprocess.Popen[bytes]):
    """A program of which the system tells, when it has ended, what it has used."""

    used = 0.0
    """Its processor time [s], known once it has ended."""

    def has_ended(self, options: int = os.WNOHANG) -> bool:
        """Whether it has ended; ``options`` are those of ``wait4``, 0 waits until it has."""
        if self.returncode is None:
            try:
                pid, status, usage = os.wait4(self.pid, options)
            except ChildProcessError:  # the process that we are in does not care for its children: nobody knows
                self.returncode = 0
                return True
            if pid:
                self.returncode = os.waitstatus_to_exitcode(status)
                self.used = usage.ru_utime + usage.ru_stime
        return self.returncode is not None

    def was_stopped(self, seconds: float) -> bool:
        """Whether the system has ended it for its processor time, of which it was allowed so much.

        It sends SIGXCPU then, and SIGKILL where that is ignored. Others send SIGKILL, too: what was used decides.
        """
        by = -self.returncode
        return by == signal.SIGXCPU or (by == signal.SIGKILL and self.used > COUNTED * seconds)


def exchange(
    command: Sequence[str], request: bytes, limits: Limits, environment: Mapping[str, str] | None = None
) -> bytes:
    """Start a program, hand it the request, and read all that it writes.

    Its streams are files, so that nobody has to read while it writes. No shell reads the command; ``environment`` are
    variables that it gets besides ours.

    Raises
    ------
    UnavailableError
        Where there is no such program.
    ProgramTimeoutError, ProgramError
        Where it takes too long, writes too much, crashes, or ends with an exit status other than 0.
    """
    with tempfile.TemporaryFile() as given, tempfile.TemporaryFile() as output, tempfile.TemporaryFile() as said:
        given.write(request)
        given.seek(0)
        own = {**os.environ, **(environment or {})}
        try:
            process = _Program(list(command), stdin=given, stdout=output, stderr=said, start_new_session=True, env=own)
        except (OSError, ValueError) as error:
            what = getattr(error, "strerror", None) or str(error)
            raise UnavailableError(short_line(f"{command[0]} cannot be started: {what}")) from error
        try:
            allowed = _limit(process.pid, limits)
            _wait(process, limits, output, said)
        finally:
            _end(process)
        if process.was_stopped(allowed):
            raise ProgramTimeoutError(f"the program was stopped after {allowed:.0f} s of processor time")
        if process.returncode == 0:
            output.seek(0)
            return output.read()
        said.seek(max(0, _size(said) - SAID))
        words = short_line(said.read().decode("utf-8", "replace"))
    ended = f"ended with exit status {process.returncode}"
    if process.returncode < 0:
        ended = f"crashed, {_signal_name(-process.returncode)}"
    raise ProgramError(short_line(f"the program {ended}{f': {words}' if words else ''}"))


def _limit(pid: int, limits: Limits) -> float:
    """Set the system's own limits, none above ours, and give the processor time that is allowed [s].

    It is infinite where the system cannot be asked for a limit; a program that has ended already needs none.
    """
    if resource is None or not hasattr(resource, "prlimit"):
        return math.inf
    seconds = max(1, int(limits.seconds))
    wanted = (
        (resource.RLIMIT_CPU, seconds, seconds + 1),  # one that ignores the signal is killed a second later
        (resource.RLIMIT_DATA, limits.memory, limits.memory),
        (resource.RLIMIT_CORE, 0, 0),
    )
    for kind, soft, hard in wanted:
        own = _own_limits(kind)
        with contextlib.suppress(ProcessLookupError, PermissionError, ValueError):
            resource.prlimit(pid, kind, (min([soft, *own]), min([hard, *own])))
    return min([seconds, *_own_limits(resource.RLIMIT_CPU)])


def _own_limits(kind: int) -> list[int]:
    """Those of the process that we are in."""
    return [value for value in resource.getrlimit(kind) if value != resource.RLIM_INFINITY]


def _wait(process: _Program, limits: Limits, output: IO[bytes], said: IO[bytes]) -> None:
    """Wait until the program has ended; raise where it takes too long, or writes too much."""
    began, pause, ended = monotonic(), 1e-3, False
    while not ended:
        ended = process.has_ended()
        if _size(output) > limits.output or _size(said) > OUTPUT:
            raise ProgramError(f"the program wrote more than {limits.output} bytes")
        if not ended:
            if monotonic() - began - waited_seconds(process.pid) > WALL * limits.seconds:
                raise ProgramTimeoutError(f"the program gave no response within {WALL * limits.seconds:.3g} s")
            sleep(pause)
            pause = min(2 * pause, LOOK)


def _size(file: IO[bytes]) -> int:
    return os.fstat(file.fileno()).st_size


def _end(process: _Program) -> None:
    """Kill the program, where it has not ended, and all of its session."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    process.has_ended(0)


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def said_by(*command: str, environment: Mapping[str, str] | None = None) -> str | None:
    """What a command writes, its version say; None where it fails, or takes longer than ``ASKED``."""
    try:
        done = subprocess.run(
            command,
            capture_output=True,
            text=True,
            timeout=ASKED,
            check=False,
            env={**os.environ, **(environment or {})},
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None
