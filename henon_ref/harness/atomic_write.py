"""Files that are written whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path


def write_through(path: Path, content: bytes) -> None:
    """Write a new file, not through a link, and wait until it is on the disk."""
    path.unlink(missing_ok=True)
    with path.open("xb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def replace_file(path: Path, content: bytes) -> None:
    """Put a whole file in the place of another, or leave the other as it is.

    Raises
    ------
    OSError
        Where it cannot be written.
    """
    waiting = path.with_name(f".{path.name}.{os.getpid()}.new")
    try:
        write_through(waiting, content)
        os.replace(waiting, path)
    finally:
        waiting.unlink(missing_ok=True)
