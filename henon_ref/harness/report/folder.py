"""Folders of reports: which files this package writes there, links between them, and locks.

A lock is the system's own lock on a hidden file in the folder: it ends with the process that holds it, however that
ends, so that two runs do not destroy each other's files and a killed one blocks nobody. The file names its holder.
"""

from __future__ import annotations

import errno
import json
import logging
import os
import re
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from urllib.parse import unquote
from weakref import WeakSet

from henon_ref.errors import CaseError

try:
    import fcntl
except ImportError:  # Windows: nothing is locked there
    fcntl = None  # type: ignore[assignment]

_LOG = logging.getLogger(__name__)

REPORT, MANIFEST = "report.md", "manifest.json"
RUNS, TRANSITIONS, STICKS = "runs.csv", "transitions.csv", "sticks.csv"
SAMPLES = "samples.csv"
"""Raw timing samples of a report's runs."""
CASE_FILE, SCHEMA = "page.json", 1
"""What the page shows of a case besides its rows, and the version of that."""
ROWS = (TRANSITIONS, SAMPLES)
"""Files of a report that are too long to be kept in a repository."""
INDEX, MATRIX = "README.md", "matrix.csv"
"""The index of all reports in a folder, and the rows that it is made of."""
PAGE = "index.html"
"""The page to click through, of a folder of reports or of a sweep."""
PAGE_BEGINNING = "<!doctype html>\n<!-- henon_ref "
_STUDY = re.compile(
    r"# (What accuracy costs in time|Atlas of grazes|What the libraries do by themselves|The paper, computed again"
    r"|Restart habits|How a library is restarted after an event"
    r"|Rivals in turn|Times of henon and of other solvers, run in turn)\n"
)
"""How the README.md of a study's folder begins, of earlier versions, too."""
_BEGINNINGS = {
    INDEX: re.compile(rf"# Reports\n\n(Which solver to|\| solver \| right in |\d+ readings? of )|{_STUDY.pattern}"),
    MATRIX: re.compile("case,(title,)?reading,kind,solver,"),
    PAGE: re.compile(PAGE_BEGINNING),
}
"""How the files begin that this package writes over all reports of a folder, and into that of a study."""


def remove_if_empty(folder: Path) -> None:
    """Remove a folder that is there and has nothing in it."""
    if folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()


def check_folder(folder: Path) -> None:
    """See that files can be written into a folder, without leaving anything there; else CaseError."""
    nearest = next((path for path in (folder, *folder.absolute().parents) if path.exists()), Path("/"))
    if not nearest.is_dir():
        raise CaseError(f"{nearest} is a file; --out needs a folder", file=None)
    try:
        with tempfile.TemporaryFile(dir=nearest, prefix=".henon_ref."):
            pass
    except OSError as error:
        words = f"cannot write into {nearest}: {error.strerror}; give --out a folder that can be written"
        raise CaseError(words) from error


def check_index(folder: Path) -> None:
    """See that a folder's README.md, matrix and page may be replaced, CaseError where somebody else wrote one."""
    for file, beginning in ((folder / name, beginning) for name, beginning in _BEGINNINGS.items()):
        if file.exists() and not _begins(file, beginning):
            words = "was not written by henon_ref, so it is not replaced; give --out another folder"
            raise CaseError(words, file=str(file))


def check_writable(folder: Path) -> None:
    """See that reports can be written into a folder: :func:`check_folder`, :func:`check_index`."""
    check_folder(folder)
    check_index(folder)


def own_files(folder: Path) -> set[str]:
    """The files of a case's report that are in its folder, as its manifest lists them; of any other folder, none."""
    try:
        content = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError, RecursionError, ValueError):
        return set()
    if (
        not isinstance(content, dict)
        or content.get("case") != folder.name
        or not isinstance(content.get("files"), list)
    ):
        return set()
    names = {name for name in content["files"] if isinstance(name, str) and Path(name).name == name}
    return {name for name in names if os.path.isfile(folder / name)}


def is_study(folder: Path) -> bool:
    """Whether this package wrote the README.md of a study's folder."""
    return _begins(folder / INDEX, _STUDY)


def _begins(path: Path, beginning: re.Pattern[str]) -> bool:
    try:
        return beginning.match(path.read_text(encoding="utf-8")) is not None
    except (OSError, ValueError):
        return False


_LINK = re.compile(r"(?P<picture>!?)\[(?P<text>(?:[^\[\]\\]|\\.)*)\]\((?P<address>[^()\s]+)\)")
_ELSEWHERE = re.compile(r"[a-z][a-z0-9+.-]*:|/|#", re.IGNORECASE)
_CODE = re.compile(r"^```.*?^```$|^ {4}.*?$|`[^`\n]+`", re.DOTALL | re.MULTILINE)


def linked(text: str) -> Iterator[str]:
    """Addresses of relative links and pictures in markdown."""
    code = [found.span() for found in _CODE.finditer(text)]
    for found in _LINK.finditer(text):
        inside = any(begin <= found.start() < end for begin, end in code)
        if not inside and not _ELSEWHERE.match(found["address"]):
            yield found["address"]


def dead_links(text: str, folder: Path) -> Iterator[str]:
    """Those that lead to no file; ``folder`` is where the page lies."""
    return (own for own in linked(text) if not os.path.exists(folder / unquote(own.partition("#")[0])))


def without_dead_links(text: str, folder: Path) -> str:
    """Markdown of a page in a folder in which dead links are plain text, and dead pictures are gone."""
    dead = set(dead_links(text, folder))

    def kept(found: re.Match[str]) -> str:
        if found["address"] not in dead:
            return found[0]
        return "" if found["picture"] else found["text"]

    return _LINK.sub(kept, text)


LOCK = ".henon_ref.lock"
PATIENCE = 60.0
"""Seconds for which a lock is waited for that is only ever held for a moment."""
POLL = 0.02
"""Seconds between two tries."""
TRIES = 100
"""How often a file is opened anew because its last holder has just removed it."""
UNSUPPORTED = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)
"""What a file system says that has no locks."""


class FolderLock:
    """A lock on one folder, which is made if it is not there; BlockingIOError, and no change, where it is held."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / LOCK
        self._made = [path for path in (folder, *folder.parents) if not path.exists()]
        self.descriptor = self._opened()
        _held.add(self)
        try:
            os.ftruncate(self.descriptor, 0)
            os.write(self.descriptor, f"{os.getpid()}\n".encode())
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
            with ExitStack() as failed:
                failed.callback(os.close, descriptor)
                self._lock(descriptor)
                # Where its holder has just removed the file, who comes next would lock another one.
                with suppress(FileNotFoundError):
                    if os.path.samestat(os.fstat(descriptor), os.lstat(self.path)):
                        failed.pop_all()
                        return descriptor
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(self.path))

    def _lock(self, descriptor: int) -> None:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno not in UNSUPPORTED:
                raise
            words = "%s cannot be locked (%s): let no other run write into that folder"
            _LOG.warning(words, self.path, error.strerror)

    def release(self) -> None:
        """Remove the file, and the folders that were made for it if nothing else is in them; then end the lock."""
        _held.discard(self)
        with suppress(OSError):
            self.path.unlink()
            for folder in self._made:
                folder.rmdir()
        os.close(self.descriptor)


_held: WeakSet[FolderLock] = WeakSet()


def _forget_all() -> None:
    """In a fork of their holder: the locks are not this process's."""
    for lock in list(_held):
        os.close(lock.descriptor)
    _held.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_all)


@contextmanager
def locked(folders: Iterable[Path], *, wait: bool = False) -> Iterator[None]:
    """Hold the locks of some folders; ``wait``: others hold them for a moment only.

    Where another process holds one of them, CaseError names it, and nothing has been changed.
    """
    deadline = time.monotonic() + (PATIENCE if wait else 0.0)
    with ExitStack() as stack:
        # What another run holds is there already: it is tried before anything is made.
        for folder in sorted(dict.fromkeys(folders), key=lambda folder: not (folder / LOCK).exists()):
            while fcntl is not None:
                try:
                    stack.callback(FolderLock(folder).release)
                    break
                except BlockingIOError:
                    if time.monotonic() >= deadline:
                        words = f"{folder} is being written by another run{_holder(folder)}"
                        raise CaseError(f"{words}; wait for it, or give --out another folder") from None
                time.sleep(POLL)
        yield


def _holder(folder: Path) -> str:
    """Who holds a lock, as text; empty where the file does not say."""
    for _ in range(TRIES):  # between locking the file and writing into it there is a moment
        with suppress(OSError, ValueError):
            return f", process {int((folder / LOCK).read_text(encoding='ascii'))}"
        time.sleep(POLL)
    return ""
