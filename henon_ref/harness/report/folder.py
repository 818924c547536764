"""Folders of reports: the files that this package writes, links between them, and locks.

A lock prevents two runs from destroying each other's files. It is a lock of the operating system on a hidden file with
the number of the process. It ends with the process, so that a killed run does not block the folder.
"""

from __future__ import annotations

import errno
import json
import logging
import os
import re
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any
from urllib.parse import unquote
from weakref import WeakSet

from henon_ref.errors import CaseError

try:
    import fcntl
except ImportError:  # Windows, where folders are not locked
    fcntl = None  # type: ignore[assignment]

_LOG = logging.getLogger(__name__)

REPORT, MANIFEST = "report.md", "manifest.json"
RUNS, TRANSITIONS, STICKS = "runs.csv", "transitions.csv", "sticks.csv"
SAMPLES = "samples.csv"
"""Raw timing samples of a report's runs."""
CASE_FILE, SCHEMA = "page.json", 1
"""File with the data of a case for the page, except its rows, and the version of its format."""
ROWS = (TRANSITIONS, SAMPLES)
"""Files of a report that are too long for a repository."""
FILES = (MANIFEST, REPORT, RUNS, TRANSITIONS, STICKS, SAMPLES, CASE_FILE)
"""Files of every report of a case."""
INDEX, MATRIX = "README.md", "matrix.csv"
"""Index of all reports in a folder, and the table from which it is made."""
PAGE = "index.html"
"""Interactive page of a folder of reports, or of a sweep."""
_STUDY = re.compile(
    r"# (What accuracy costs in time|Atlas of grazes|What the libraries do by themselves|The paper, computed again"
    r"|Restart habits|How a library is restarted after an event"
    r"|Rivals in turn|Times of henon and of other solvers, run in turn)\n"
)
"""First line of the README.md of a study, in this version and earlier ones."""
NOT_OURS = "was not written by henon_ref, so it is not replaced; choose another folder with --out"
_BEGINNINGS = {
    INDEX: re.compile(rf"# Reports\n\n(Which solver to|\| solver \| right in |\d+ readings? of )|{_STUDY.pattern}"),
    MATRIX: re.compile("case,(title,)?reading,kind,solver,"),
    PAGE: re.compile("<!doctype html>\n<!-- henon_ref "),
}
"""First characters of the index, matrix and page that this package writes."""
_SWEEP_PAGE = re.compile(rf"{_BEGINNINGS[PAGE].pattern}sweep")


def remove_if_empty(folder: Path) -> None:
    if folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()


def check_folder(folder: Path) -> None:
    """Check that files can be written into a folder, and leave none there; raise CaseError if not."""
    nearest = next((path for path in (folder, *folder.absolute().parents) if os.path.lexists(path)), Path("/"))
    if not nearest.is_dir():
        what = "file" if nearest.exists() else "link without a target"
        raise CaseError(f"{nearest} is a {what}; --out requires a folder", file=None)
    try:
        with tempfile.TemporaryFile(dir=nearest, prefix=".henon_ref."):
            pass
    except OSError as error:
        words = f"cannot write into {nearest}: {error.strerror}; choose a writable folder with --out"
        raise CaseError(words) from error


def check_index(folder: Path) -> None:
    """Check that this package wrote the index, matrix and page to be replaced in a folder; raise CaseError if not.

    The page of a sweep is not replaced.
    """
    for file, beginning in ((folder / name, beginning) for name, beginning in _BEGINNINGS.items()):
        if file.exists() and not _begins(file, beginning):
            raise CaseError(NOT_OURS, file=str(file))
    if _begins(folder / PAGE, _SWEEP_PAGE):
        raise CaseError("is the page of a sweep; choose another folder with --out", file=str(folder / PAGE))


def check_report(folder: Path, figures: Iterable[str]) -> None:
    """Check that the report of a case can be written into its folder, and that it replaces only files of such a report.

    ``figures``: names of all figures that it may have.

    Raise CaseError if not.
    """
    check_folder(folder)
    own = own_files(folder)
    for name in (*FILES, *figures):
        if (folder / name).exists() and name not in own:
            raise CaseError(NOT_OURS, file=str(folder / name))


def check_writable(folder: Path) -> None:
    """Check that reports can be written into a folder: :func:`check_folder`, :func:`check_index`."""
    check_folder(folder)
    check_index(folder)


def own_files(folder: Path) -> set[str]:
    """Return the existing files that the manifest of a case's report lists; empty for any other folder."""
    content = read_json(folder / MANIFEST)
    files = content.get("files")
    if content.get("case") != folder.name or not isinstance(files, list):
        return set()
    names = {name for name in files if isinstance(name, str) and Path(name).name == name}
    return {name for name in names if os.path.isfile(folder / name)}


def read_json(file: Path) -> Mapping[str, Any]:
    """Read a JSON object from a file; empty if the file is missing or has no such object."""
    try:
        return mapping(json.loads(file.read_text(encoding="utf-8"))) if file.is_file() else {}
    except (FileNotFoundError, NotADirectoryError, RecursionError, ValueError):
        return {}


def mapping(value: object) -> Mapping[str, Any]:
    """Return a value from a file if it is a mapping, else an empty one."""
    return value if isinstance(value, dict) else {}


def is_study(folder: Path) -> bool:
    """Check whether a folder has the README.md of a study, written by this package."""
    return _begins(folder / INDEX, _STUDY)


def _begins(path: Path, beginning: re.Pattern[str]) -> bool:
    try:
        return path.is_file() and beginning.match(path.read_text(encoding="utf-8")) is not None
    except (OSError, ValueError):
        return False


_LINK = re.compile(r"(?P<picture>!?)\[(?P<text>(?:[^\[\]\\]|\\.)*)\]\((?P<address>[^()\s]+)\)")


def linked(text: str) -> Iterator[str]:
    """Yield the addresses of relative links and pictures in markdown."""
    blocks = re.finditer(r"^```.*?^```$|^ {4}.*?$|`[^`\n]+`", text, re.DOTALL | re.MULTILINE)
    code = [found.span() for found in blocks]
    for found in _LINK.finditer(text):
        inside = any(begin <= found.start() < end for begin, end in code)
        if not inside and not re.match(r"[a-z][a-z0-9+.-]*:|/|#", found["address"], re.IGNORECASE):
            yield found["address"]


def dead_links(text: str, folder: Path) -> Iterator[str]:
    """Yield the addresses of relative links to missing files; ``folder`` is the folder of the page."""
    return (own for own in linked(text) if not os.path.exists(folder / unquote(own.partition("#")[0])))


def without_dead_links(text: str, folder: Path) -> str:
    """Replace dead links in the markdown of a page by their text, and remove dead pictures."""
    dead = set(dead_links(text, folder))

    def kept(found: re.Match[str]) -> str:
        if found["address"] not in dead:
            return found[0]
        return "" if found["picture"] else found["text"]

    return _LINK.sub(kept, text)


LOCK = ".henon_ref.lock"
LOCK_SECONDS = 60.0
"""Longest time to wait for a lock that other processes hold only briefly [s]."""
TRIES = 100
"""Largest number of attempts to open a lock file that its holder has just removed."""


class FolderLock:
    """Lock on one folder, which is created if necessary; BlockingIOError if another process holds the lock."""

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
        """Open and lock the file; return its descriptor."""
        for _ in range(TRIES):
            try:
                self.path.parent.mkdir(parents=True, exist_ok=True)
                descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o644)
            except FileNotFoundError:  # the last holder has just removed the folder
                continue
            with ExitStack() as failed:
                failed.callback(os.close, descriptor)
                self._lock(descriptor)
                # If the last holder has just removed the file, the next process would lock a new file: try again.
                with suppress(FileNotFoundError):
                    if os.path.samestat(os.fstat(descriptor), os.lstat(self.path)):
                        failed.pop_all()
                        return descriptor
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(self.path))

    def _lock(self, descriptor: int) -> None:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno not in (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP):
                raise  # otherwise the file system has no locks
            words = "%s cannot be locked (%s): let no other run write into that folder"
            _LOG.warning(words, self.path, error.strerror)

    def release(self) -> None:
        """Remove the file, and the folders made for it if they are empty; then end the lock."""
        _held.discard(self)
        with suppress(OSError):
            self.path.unlink()
            for folder in self._made:
                folder.rmdir()
        os.close(self.descriptor)


_held: WeakSet[FolderLock] = WeakSet()


def _forget_all() -> None:
    """Close the lock files in a forked process, which does not hold the locks of its parent."""
    for lock in list(_held):
        os.close(lock.descriptor)
    _held.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_all)


@contextmanager
def locked(folders: Iterable[Path], *, wait: bool = False) -> Iterator[None]:
    """Hold the locks of some folders; with ``wait``, wait up to ``LOCK_SECONDS`` for other processes.

    If another process holds one of the locks, raise CaseError, which names the folder; nothing has been changed then.
    """
    deadline = time.monotonic() + (LOCK_SECONDS if wait else 0.0)
    with ExitStack() as stack:
        # Existing lock files come first: if another run holds one, no folder has been created yet.
        for folder in sorted(dict.fromkeys(folders), key=lambda folder: not (folder / LOCK).exists()):
            while fcntl is not None:
                try:
                    stack.callback(FolderLock(folder).release)
                    break
                except BlockingIOError:
                    if time.monotonic() >= deadline:
                        words = f"{folder} is being written by another run{_holder(folder)}"
                        raise CaseError(f"{words}; wait for it, or choose another folder with --out") from None
                time.sleep(0.02)
        yield


def _holder(folder: Path) -> str:
    """Format the process that holds a lock; empty if the file does not contain its number."""
    for _ in range(TRIES):  # the holder writes its number shortly after it has locked the file
        with suppress(OSError, ValueError):
            return f", process {int((folder / LOCK).read_text(encoding='ascii'))}"
        time.sleep(0.02)
    return ""
