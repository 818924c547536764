"""The way between the pool and a worker: whole messages, each with its job's token, from the worker alone.

A message is a head (magic, token, length) and a pickle. What another process than the worker sends, such as a child
that the solver has forked, is dropped by the number of its process, for which the kernel vouches on Linux; elsewhere
the message says it. What carries the token of another job came late, and is dropped as well. Anything else that is no
message is the worker's own doing: :class:`NoReply`. No call of the pool's end ever waits.
"""

from __future__ import annotations

import os
import secrets
import socket
import struct
import sys
from collections.abc import Iterator

LARGEST = 2**28
"""Bytes that one message may have."""
MAGIC = b"hr1\n"
TOKEN = 16
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
    """The pool's end.

    Attributes
    ----------
    theirs : socket
        The worker's end.
    waiting : bytearray
        What is still to be sent.
    closed : bool
        Nothing will come any more.
    """

    def __init__(self) -> None:
        self._socket, self.theirs = socket.socketpair()
        self._socket.setblocking(False)
        if _VOUCHED:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_PASSCRED, 1)
        self.waiting = bytearray()
        self.closed = False
        self._come = bytearray()

    def fileno(self) -> int:
        """For :func:`select.poll`."""
        return self._socket.fileno()

    def close(self) -> None:
        """No more of it."""
        self._socket.close()
        self.theirs.close()

    def send(self, token: bytes, pickled: bytes) -> None:
        """Send a message, or what of it there is room for; :meth:`go_on` sends the rest."""
        self.waiting += framed(token, pickled)
        self.go_on()

    def go_on(self) -> None:
        """Send what is still to be sent, as far as there is room for it."""
        try:
            while self.waiting:
                del self.waiting[: self._socket.send(memoryview(self.waiting)[:_AT_ONCE].tobytes())]
        except BlockingIOError:
            return
        except OSError:  # nobody is there to take it: seen as the worker's end
            self.waiting.clear()

    def receive(self, sender: int, token: bytes) -> Iterator[bytes]:
        """The messages of a worker on a job that are here by now, pickled; of very much, a part.

        Parameters
        ----------
        sender : int
            Number of the worker's process.
        token : bytes
            The job's.

        Raises
        ------
        NoReply
            Where something else came from the worker, or a message that is too large.
        """
        for _ in range(_IN_A_ROW):
            try:
                piece, extra, _, _ = self._socket.recvmsg(_AT_ONCE, socket.CMSG_SPACE(_CREDENTIALS.size))
            except BlockingIOError:
                return
            except OSError:
                piece, extra = b"", []
            if not piece:
                self.closed = True
                return
            if not _VOUCHED or any(_CREDENTIALS.unpack(data[: _CREDENTIALS.size])[0] == sender for _, _, data in extra):
                self._come += piece
                yield from self._messages(sender, token)

    def _messages(self, sender: int, token: bytes) -> Iterator[bytes]:
        """Whole messages out of what has come."""
        come = self._come
        while come:
            if not come.startswith(MAGIC[: len(come)]):
                raise NoReply("the worker sent something that is no reply")
            if len(come) < _HEAD.size:
                return
            _, whose, pid, length = _HEAD.unpack_from(come)
            if length > LARGEST:
                raise NoReply(f"the worker sent a reply of {length} bytes, {LARGEST} are allowed")
            end = _HEAD.size + length
            if len(come) < end:
                return
            pickled = bytes(come[_HEAD.size : end])
            del come[:end]
            if whose == token and pid == sender:
                yield pickled


def read_message(theirs: socket.socket) -> tuple[bytes, bytes] | None:
    """The next message as the worker reads it, waiting for it: token and pickle; None where the pool has closed."""
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
