"""One exchange with a program: bytes in, bytes out, within limits on time, memory and output.

The result is the program's output, or an error with one sentence about the failure. All processes that the program has
started are killed at the end.
"""

from __future__ import annotations

import contextlib
import math
import os
import signal
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from time import monotonic, sleep
from typing import IO

from henon_ref.errors import ContractError, DeadlineError, UnavailableError
from henon_ref.jit.processor_time import waited_seconds
from henon_ref.text import short_line

try:
    import resource
except ImportError:  # not a POSIX system; only the wall time is limited
    resource = None  # type: ignore[assignment]

WALL = 2.5
"""Largest wall time of a program, without its waiting for a processor, as a multiple of its limit of processor time."""
OUTPUT = 64 * 2**20
"""Largest standard error of a program, and default limit of its standard output [bytes]."""


class _Program(subprocess.Popen[bytes]):
    """A process that records the processor time that it has used."""

    used = 0.0
    """Processor time [s]; known once the process has ended."""

    def has_ended(self, options: int = os.WNOHANG) -> bool:
        """Check whether the process has ended; ``options`` are those of ``wait4``, and 0 waits for the end."""
        if self.returncode is None:
            try:
                pid, status, usage = os.wait4(self.pid, options)
            except ChildProcessError:  # our process ignores SIGCHLD, so that the exit status is unknown
                self.returncode = 0
                return True
            if pid:
                self.returncode = os.waitstatus_to_exitcode(status)
                self.used = usage.ru_utime + usage.ru_stime
        return self.returncode is not None

    def was_stopped(self, seconds: float) -> bool:
        """Check whether the system has stopped the process for using more processor time than ``seconds``.

        The system sends SIGXCPU and, if the process ignores it, SIGKILL. SIGKILL may have other causes; the processor
        time that was used decides. The system charges whole clock ticks against the limit, on a busy machine up to a
        third more than that time.
        """
        by = -self.returncode
        return by == signal.SIGXCPU or (by == signal.SIGKILL and self.used > 0.5 * seconds)


def exchange(
    command: Sequence[str],
    request: bytes,
    seconds: float,
    environment: Mapping[str, str] | None = None,
    *,
    memory: int = 4 * 2**30,
    most_output: int = OUTPUT,
) -> bytes:
    """Start a program, write the request to its standard input, and return its standard output.

    ``seconds`` limits the processor time, rounded down to whole seconds, at least one; the wall time is limited to
    ``WALL`` times ``seconds``. ``memory`` limits the data that the program may allocate, and ``most_output`` its
    standard output [bytes].

    The streams are files, so that a full pipe cannot block the program. The command is started without a shell;
    ``environment`` are variables in addition to those of this process.

    UnavailableError if the program does not exist; DeadlineError if it takes too long; ContractError if it
    writes too much, crashes, or ends with an exit status other than 0.
    """
    with tempfile.TemporaryFile() as source, tempfile.TemporaryFile() as output, tempfile.TemporaryFile() as errors:
        source.write(request)
        source.seek(0)
        env = {**os.environ, **(environment or {})}
        try:
            process = _Program(
                list(command), stdin=source, stdout=output, stderr=errors, start_new_session=True, env=env
            )
        except (OSError, ValueError) as error:
            what = getattr(error, "strerror", None) or str(error)
            raise UnavailableError(short_line(f"{command[0]} cannot be started: {what}")) from error
        try:
            allowed = _limit(process.pid, seconds, memory)
            _wait(process, seconds, (("output", output, most_output), ("error", errors, OUTPUT)))
        finally:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(process.pid, signal.SIGKILL)  # all processes of its session
            process.has_ended(0)
        if process.was_stopped(allowed):
            raise DeadlineError(f"the program was stopped after {allowed:.0f} s of processor time")
        if process.returncode == 0:
            output.seek(0)
            return output.read()
        errors.seek(max(0, _size(errors) - 2000))
        text = short_line(errors.read().decode("utf-8", "replace"))
    ended = f"ended with exit status {process.returncode}"
    if process.returncode < 0:
        ended = f"crashed, {_signal_name(-process.returncode)}"
    raise ContractError(short_line(f"the program {ended}{f': {text}' if text else ''}"))


def _limit(pid: int, wanted_seconds: float, memory: int) -> float:
    """Set the system's limits, none above those of this process, and return the allowed processor time [s].

    The time is infinite if the system has no such limits. A program that has already ended is ignored.
    """
    if resource is None or not hasattr(resource, "prlimit"):
        return math.inf
    seconds = max(1, int(wanted_seconds))
    wanted = (
        (resource.RLIMIT_CPU, seconds, seconds + 1),  # a program that ignores the signal is killed a second later
        (resource.RLIMIT_DATA, memory, memory),
        (resource.RLIMIT_CORE, 0, 0),
    )
    for kind, soft, hard in wanted:
        own = _own_limits(kind)
        with contextlib.suppress(ProcessLookupError, PermissionError, ValueError):
            resource.prlimit(pid, kind, (min([soft, *own]), min([hard, *own])))
    return min([seconds, *_own_limits(resource.RLIMIT_CPU)])


def _own_limits(kind: int) -> list[int]:
    """Finite limits of this process."""
    return [value for value in resource.getrlimit(kind) if value != resource.RLIM_INFINITY]


def _wait(process: _Program, seconds: float, streams: Sequence[tuple[str, IO[bytes], int]]) -> None:
    """Wait until the program has ended; raise if it takes too long or writes too much."""
    began, pause, ended = monotonic(), 1e-3, False
    while not ended:
        ended = process.has_ended()
        for stream, file, most in streams:
            if _size(file) > most:
                raise ContractError(f"the program wrote more than {most} bytes to its standard {stream}")
        if not ended:
            if monotonic() - began - waited_seconds(process.pid) > WALL * seconds:
                raise DeadlineError(f"the program gave no response within {WALL * seconds:.3g} s")
            sleep(pause)
            pause = min(2 * pause, 0.02)


def _size(file: IO[bytes]) -> int:
    return os.fstat(file.fileno()).st_size


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def command_output(*command: str, environment: Mapping[str, str] | None = None) -> str | None:
    """Return the output of a short command; None if it fails or takes longer than a minute."""
    env = {**os.environ, **(environment or {})}
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=60.0, check=False, env=env)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None
