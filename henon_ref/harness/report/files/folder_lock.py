"""Locks on the folders that commands write into, so that two runs do not destroy each other's files.

A lock is the system's own lock on a hidden file in the folder: it ends with the process that holds it, however that
ends. The file names its holder and is removed with the lock; one that a killed process has left blocks nobody.
"""

from __future__ import annotations

import errno
import logging
import os
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from weakref import WeakSet

from henon_ref.errors import CaseError

try:
    import fcntl
except ImportError:  # Windows: nothing is locked there
    fcntl = None  # type: ignore[assignment]

_LOG = logging.getLogger(__name__)

FILE = ".henon_ref.lock"
PATIENCE = 60.0
"""Seconds for which a lock is waited for that is only ever held for a moment."""
POLL = 0.02
"""Seconds between two tries."""
TRIES = 100
"""How often a file is opened anew because its last holder has just removed it."""
UNSUPPORTED = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)
"""What a file system says that has no locks."""


class FolderLock:
    """A lock on one folder, which is made if it is not there.

    Raises
    ------
    BlockingIOError
        Where another process (or another lock of this one) holds it; nothing has been changed then.
    OSError
        Where the folder or the file cannot be made.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / FILE
        self._made = [path for path in (folder, *folder.parents) if not path.exists()]
        self._descriptor = self._opened()
        _held.add(self)
        try:
            os.ftruncate(self._descriptor, 0)
            os.write(self._descriptor, f"{os.getpid()}\n".encode())
        except OSError:
            self.release()
            raise

    def _opened(self) -> int:
        """The file, locked."""
        for _ in range(TRIES):
            try:
                self.path.parent.mkdir(parents=True, exist_ok=True)
                descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o644)
            except FileNotFoundError:  # its holder has just removed the folder
                continue
            try:
                _lock(descriptor, self.path)
                if _same(descriptor, self.path):
                    return descriptor
            except BaseException:
                os.close(descriptor)
                raise
            os.close(descriptor)  # its holder has just removed the file: who comes next would lock another one
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(self.path))

    def release(self) -> None:
        """Remove the file, and the folders that were made for it if nothing else is in them; then end the lock."""
        _held.discard(self)
        with suppress(OSError):
            self.path.unlink()
            for folder in self._made:
                folder.rmdir()
        os.close(self._descriptor)

    def forget(self) -> None:
        """In a fork of the holder: the lock is not this process's."""
        os.close(self._descriptor)


_held: WeakSet[FolderLock] = WeakSet()


def _forget_all() -> None:
    for lock in list(_held):
        lock.forget()
    _held.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_all)


def _lock(descriptor: int, path: Path) -> None:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno not in UNSUPPORTED:
            raise
        _LOG.warning("%s cannot be locked (%s): let no other run write into that folder", path, error.strerror)


def _same(descriptor: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), os.lstat(path))
    except FileNotFoundError:
        return False


@contextmanager
def locked(folders: Iterable[Path]) -> Iterator[None]:
    """Hold the locks of some folders.

    Raises
    ------
    CaseError
        Where another process holds one of them, with its id; nothing has been changed then.
    """
    if fcntl is None:
        yield
        return
    with ExitStack() as stack:
        # What another run holds is there already: it is tried before anything is made.
        for folder in sorted(dict.fromkeys(folders), key=lambda folder: not (folder / FILE).exists()):
            try:
                stack.callback(FolderLock(folder).release)
            except BlockingIOError:
                raise CaseError(
                    f"{folder} is being written by another run{_holder(folder)}; wait for it, or give --out another "
                    "folder"
                ) from None
        yield


@contextmanager
def locked_for_a_moment(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder that nobody holds for long, once it is free.

    Raises
    ------
    CaseError
        Where it does not become free.
    """
    deadline = time.monotonic() + PATIENCE
    while fcntl is not None:
        try:
            lock = FolderLock(folder)
        except BlockingIOError:
            if time.monotonic() > deadline:
                raise CaseError(f"{folder} is being written by another run{_holder(folder)}") from None
            time.sleep(POLL)
            continue
        try:
            yield
        finally:
            lock.release()
        return
    yield


def _holder(folder: Path) -> str:
    """Who holds a lock, as text; empty where the file does not say."""
    for _ in range(TRIES):  # between locking the file and writing into it there is a moment
        with suppress(OSError, ValueError):
            return f", process {int((folder / FILE).read_text(encoding='ascii'))}"
        time.sleep(POLL)
    return ""
