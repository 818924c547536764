"""One exchange with a program: bytes in, bytes out, within limits on time, memory and output.

Whatever the program does, what comes back is its output or one sentence about what became of it; and nothing that it
has started goes on.
"""

from __future__ import annotations

import contextlib
import os
import selectors
import signal
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from time import monotonic

from henon_ref.errors import ContractError, UnavailableError
from henon_ref.text import short_line

try:
    import resource
except ImportError:  # elsewhere than on POSIX systems: wall time alone is limited there
    resource = None  # type: ignore[assignment]

WALL = 2.5
"""Wall time that a program may take, in its processor time."""
OUTPUT = 64 * 2**20
"""Bytes that a program may write on its standard output."""
SAID = 2000
"""Last bytes of its standard error that are kept for the reason of a failure."""
LOOK = 0.05
"""Seconds between two looks at whether the program has ended."""
CHUNK = 2**16


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


def exchange(
    command: Sequence[str], request: bytes, limits: Limits, environment: Mapping[str, str] | None = None
) -> bytes:
    """Start a program, hand it the request, and read all that it writes.

    Parameters
    ----------
    command : sequence of str
        Program and arguments; no shell reads them.
    request : bytes
        Its whole standard input.
    limits : Limits
    environment : mapping, optional
        Variables that it gets besides ours.

    Raises
    ------
    UnavailableError
        Where there is no such program.
    ProgramTimeoutError, ProgramError
        Where it takes too long, writes too much, crashes, or ends with an exit status other than 0.
    """
    with tempfile.TemporaryFile() as given:
        given.write(request)
        given.seek(0)
        try:
            process = subprocess.Popen(
                list(command),
                stdin=given,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                start_new_session=True,
                env={**os.environ, **(environment or {})},
            )
        except (OSError, ValueError) as error:
            what = getattr(error, "strerror", None) or str(error)
            raise UnavailableError(short_line(f"{command[0]} cannot be started: {what}")) from error
    began = monotonic()
    with process:
        try:
            _limit(process.pid, limits)
            output, said = _read(process, limits)
        finally:
            _end(process)
    killed = process.returncode in (-signal.SIGKILL, -signal.SIGXCPU)
    if killed and monotonic() - began >= _whole(limits.seconds):
        raise ProgramTimeoutError(f"the program was stopped after {_whole(limits.seconds)} s of processor time")
    return _judged(process.returncode, output, said)


def _limit(pid: int, limits: Limits) -> None:
    """The system's own limits; a program that has ended already needs none."""
    if resource is None or not hasattr(resource, "prlimit"):
        return
    seconds = _whole(limits.seconds)
    wanted = (
        (resource.RLIMIT_CPU, seconds, seconds + 1),  # one that ignores the signal is killed a second later
        (resource.RLIMIT_DATA, limits.memory, limits.memory),
        (resource.RLIMIT_CORE, 0, 0),
    )
    for kind, soft, hard in wanted:
        now_soft, now_hard = resource.getrlimit(kind)
        bounds = [value for value in (now_soft, now_hard) if value != resource.RLIM_INFINITY]
        with contextlib.suppress(ProcessLookupError, PermissionError, ValueError):
            resource.prlimit(pid, kind, (min([soft, *bounds]), min([hard, *bounds])))


def _whole(seconds: float) -> int:
    """Processor time in the system's own unit."""
    return max(1, int(seconds))


def _read(process: subprocess.Popen[bytes], limits: Limits) -> tuple[bytes, bytes]:
    """Standard output, and the end of standard error, until the program has ended."""
    output, said = bytearray(), bytearray()
    until = monotonic() + WALL * limits.seconds
    assert process.stdout is not None
    assert process.stderr is not None
    with selectors.DefaultSelector() as ready:
        for stream, kept in ((process.stdout, output), (process.stderr, said)):
            os.set_blocking(stream.fileno(), False)
            ready.register(stream, selectors.EVENT_READ, kept)
        while ready.get_map():
            ended = process.poll() is not None
            found = ready.select(0.0 if ended else LOOK)
            for key, _ in found:
                piece = os.read(key.fd, CHUNK)
                key.data.extend(piece)
                if not piece:
                    ready.unregister(key.fileobj)
            del said[:-SAID]
            if len(output) > limits.output:
                raise ProgramError(f"the program wrote more than {limits.output} bytes")
            if monotonic() > until:
                raise ProgramTimeoutError(f"the program gave no response within {WALL * limits.seconds:.3g} s")
            if ended and not found:
                break  # what it has started may hold the streams open
    try:
        process.wait(max(until - monotonic(), LOOK))
    except subprocess.TimeoutExpired:
        raise ProgramTimeoutError("the program closed its output and did not end") from None
    return bytes(output), bytes(said)


def _end(process: subprocess.Popen[bytes]) -> None:
    """Kill the program, where it has not ended, and all of its session."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _judged(status: int, output: bytes, said: bytes) -> bytes:
    """The output of a program that ended well.

    Raises
    ------
    ProgramError
    """
    if status == 0:
        return output
    words = short_line(said.decode("utf-8", "replace"))
    said_words = f": {words}" if words else ""
    if status < 0:
        raise ProgramError(short_line(f"the program crashed, {_signal_name(-status)}{said_words}"))
    raise ProgramError(short_line(f"the program ended with exit status {status}{said_words}"))


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
