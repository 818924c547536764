"""Channel between a caller and a worker: complete messages from the worker alone, each with the token of its job.

A message is a header (magic number, token, process, length) and a pickle. Messages of other processes, such as a child
forked by a solver, are dropped by their process number, which the kernel guarantees on Linux and the header gives
elsewhere. A message with the token of another job is late and is dropped, too. Any other data come from the worker
itself and raise :class:`NoReply`.

The connections of :mod:`multiprocessing` wait for the rest of a message once it has begun, and do not identify the
sender: a worker that sends half a message would block its caller. No call at the caller's end of this channel blocks.
"""

from __future__ import annotations

import os
import secrets
import socket
import struct
import sys
from collections.abc import Iterator
from typing import BinaryIO

MAX_MESSAGE = 2**28
"""Largest size of a solver's message [bytes]."""
MAGIC = b"hr1\n"
TOKEN = 16
NO_TOKEN = bytes(TOKEN)
"""Token of messages that a worker sends before its first job."""
_HEAD = struct.Struct(f"=4s{TOKEN}siQ")
"""Magic number, token, process number of the sender, length of the pickle."""
_CREDENTIALS = struct.Struct("=iii")
_READ_SIZE = 1 << 18
"""Number of bytes read by one call."""
_VOUCHED = sys.platform == "linux"


class NoReply(Exception):  # noqa: N818  (describes the data, not a failure of the caller)
    """Data from a worker that are not a message."""


def new_token() -> bytes:
    """Return a random token that identifies the messages of one job."""
    return secrets.token_bytes(TOKEN)


def framed(token: bytes, pickled: bytes) -> bytes:
    """Return a message in the form in which it is sent."""
    return _HEAD.pack(MAGIC, token, os.getpid(), len(pickled)) + pickled


class Channel:
    """The caller's end of the channel; ``largest``: largest size of a message [bytes], None: unlimited."""

    def __init__(self, own: socket.socket, largest: int | None = MAX_MESSAGE) -> None:
        self.socket, self.largest = own, largest
        own.setblocking(False)
        if _VOUCHED:
            own.setsockopt(socket.SOL_SOCKET, socket.SO_PASSCRED, 1)
        self.sender: int | None = None
        """Process number of the worker: the first sender, before any job."""
        self.waiting = bytearray()
        """Data still to be sent."""
        self.closed = False
        """Whether the worker's end is closed."""
        self._come = bytearray()

    def send(self, token: bytes, pickled: bytes) -> None:
        """Send as much of a message as possible without blocking; :meth:`go_on` sends the rest."""
        self.waiting += framed(token, pickled)
        self.go_on()

    def go_on(self) -> None:
        """Send as much of the remaining data as possible without blocking."""
        try:
            while self.waiting:
                del self.waiting[: self.socket.send(bytes(self.waiting[:_READ_SIZE]))]
        except BlockingIOError:
            return
        except OSError:  # the worker has ended, which is detected elsewhere
            self.waiting.clear()

    def receive(self) -> Iterator[tuple[bytes, bytes]]:
        """Yield token and pickle of the worker's messages that have arrived; of a large amount of data, a part.

        NoReply if the worker has sent other data, or a message that is too large.
        """
        yield from self._messages()
        for _ in range(64):  # then the other workers are served
            try:
                piece, extra = self._piece()
            except BlockingIOError:
                return
            except OSError:
                piece, extra = b"", []
            if not piece:
                self.closed = True
                return
            known = {_CREDENTIALS.unpack(data[: _CREDENTIALS.size])[0] for _, _, data in extra}
            if self.sender is None and known:
                (self.sender,) = known
            if not _VOUCHED or self.sender in known:
                self._come += piece
                yield from self._messages()

    def _piece(self) -> tuple[bytes, list[tuple[int, int, bytes]]]:
        if not _VOUCHED:
            return self.socket.recv(_READ_SIZE), []
        return self.socket.recvmsg(_READ_SIZE, socket.CMSG_SPACE(_CREDENTIALS.size))[:2]

    def _messages(self) -> Iterator[tuple[bytes, bytes]]:
        """Yield the complete messages among the received data."""
        come = self._come
        while come:
            if not come.startswith(MAGIC[: len(come)]):
                raise NoReply("the worker sent something that is no reply")
            if len(come) < _HEAD.size:
                return
            _, token, pid, length = _HEAD.unpack_from(come)
            if self.largest is not None and length > self.largest:
                raise NoReply(f"the worker sent a reply of {length} bytes; at most {self.largest} are allowed")
            end = _HEAD.size + length
            if len(come) < end:
                return
            pickled = bytes(memoryview(come)[_HEAD.size : end])
            del come[:end]
            self.sender = self.sender or pid
            if pid == self.sender:
                yield token, pickled


def read_message(stream: BinaryIO) -> tuple[bytes, bytes] | None:
    """Wait for the next message at the worker's end; return token and pickle, or None if the caller has closed."""
    head = stream.read(_HEAD.size)
    if len(head) < _HEAD.size:
        return None
    _, token, _, length = _HEAD.unpack(head)
    pickled = stream.read(length)
    return (token, pickled) if len(pickled) == length else None
