"""The way between a caller and a worker: whole messages, each with its job's token, from the worker alone.

A message is a head (magic, token, process, length) and a pickle. What another process than the worker sends, such as
a child that a solver has forked, is dropped by the number of its process, for which the kernel vouches on Linux;
elsewhere the message says it. What carries the token of another job came late, and is dropped as well. Anything else
that is no message is the worker's own doing: :class:`NoReply`.

The connections of :mod:`multiprocessing` wait for the rest of a message once it has begun, and do not tell who sent it:
a worker that sends half of one would stop its caller. Here no call of the caller's end ever waits.
"""

from __future__ import annotations

import os
import secrets
import socket
import struct
import sys
from collections.abc import Iterator

LARGEST = 2**28
"""Bytes that one message of a solver may have."""
MAGIC = b"hr1\n"
TOKEN = 16
NO_TOKEN = bytes(TOKEN)
"""Of what a worker sends before its first job."""
_HEAD = struct.Struct(f"=4s{TOKEN}siQ")
"""Magic, token, number of the sender's process, length of the pickle."""
_CREDENTIALS = struct.Struct("=iii")
_AT_ONCE, _IN_A_ROW = 1 << 18, 64
"""Bytes taken with one call, and calls before others have their turn, however much there is."""
_VOUCHED = sys.platform == "linux"


class NoReply(Exception):  # noqa: N818  (says what came, not that we failed)
    """What a worker sent is no message."""


def new_token() -> bytes:
    """What a job's messages are known by; nobody can guess it."""
    return secrets.token_bytes(TOKEN)


def framed(token: bytes, pickled: bytes) -> bytes:
    """A message as it is sent."""
    return _HEAD.pack(MAGIC, token, os.getpid(), len(pickled)) + pickled


class Channel:
    """The caller's end.

    Parameters
    ----------
    own : socket
    largest : int, optional
        Bytes that one message may have; None: as many as there are.

    Attributes
    ----------
    sender : int or None
        The worker's process: the one that sends first, before any job.
    waiting : bytearray
        What is still to be sent.
    closed : bool
        Nothing will come any more.
    """

    def __init__(self, own: socket.socket, largest: int | None = LARGEST) -> None:
        self.socket, self.largest = own, largest
        own.setblocking(False)
        if _VOUCHED:
            own.setsockopt(socket.SOL_SOCKET, socket.SO_PASSCRED, 1)
        self.sender: int | None = None
        self.waiting = bytearray()
        self.closed = False
        self._come = bytearray()

    def send(self, token: bytes, pickled: bytes) -> None:
        """Send a message, or what of it there is room for; :meth:`go_on` sends the rest."""
        self.waiting += framed(token, pickled)
        self.go_on()

    def go_on(self) -> None:
        """Send what is still to be sent, as far as there is room for it."""
        try:
            while self.waiting:
                del self.waiting[: self.socket.send(bytes(self.waiting[:_AT_ONCE]))]
        except BlockingIOError:
            return
        except OSError:  # nobody is there to take it: seen as the worker's end
            self.waiting.clear()

    def receive(self) -> Iterator[tuple[bytes, bytes]]:
        """Token and pickle of the worker's messages that are here by now; of very much, a part.

        Raises
        ------
        NoReply
            Where something else came from the worker, or a message that is too large.
        """
        yield from self._messages()
        for _ in range(_IN_A_ROW):
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
            return self.socket.recv(_AT_ONCE), []
        return self.socket.recvmsg(_AT_ONCE, socket.CMSG_SPACE(_CREDENTIALS.size))[:2]

    def _messages(self) -> Iterator[tuple[bytes, bytes]]:
        """Whole messages out of what has come."""
        come = self._come
        while come:
            if not come.startswith(MAGIC[: len(come)]):
                raise NoReply("the worker sent something that is no reply")
            if len(come) < _HEAD.size:
                return
            _, token, pid, length = _HEAD.unpack_from(come)
            if self.largest is not None and length > self.largest:
                raise NoReply(f"the worker sent a reply of {length} bytes, {self.largest} are allowed")
            end = _HEAD.size + length
            if len(come) < end:
                return
            pickled = bytes(memoryview(come)[_HEAD.size : end])
            del come[:end]
            self.sender = self.sender or pid
            if pid == self.sender:
                yield token, pickled


def read_message(theirs: socket.socket) -> tuple[bytes, bytes] | None:
    """The next message as the worker reads it, waiting for it: token and pickle; None where the caller has closed."""
    head = _exactly(theirs, _HEAD.size)
    if head is None:
        return None
    _, token, _, length = _HEAD.unpack(head)
    pickled = _exactly(theirs, length)
    return None if pickled is None else (token, pickled)


def _exactly(theirs: socket.socket, count: int) -> bytes | None:
    parts = bytearray()
    while len(parts) < count:
        piece = theirs.recv(min(count - len(parts), _AT_ONCE))
        if not piece:
            return None
        parts += piece
    return bytes(parts)
