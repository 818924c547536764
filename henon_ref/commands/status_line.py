"""What a terminal shows while the libraries are imported that can show more: one line, taken back before the next."""

from __future__ import annotations

import os
import shutil
import sys

from henon_ref.text import message

_ERASED = "\r\x1b[2K"
"""The cursor goes to the line's start, and what stands in the line goes away."""
_shown = False
"""There is one terminal, and it has one line that the cursor is in."""


def is_terminal() -> bool:
    """Whether standard error is a terminal on which a line can be taken back."""
    return sys.stderr is not None and sys.stderr.isatty() and os.environ.get("TERM") not in ("dumb", "unknown")


def show(words: str) -> None:
    """Show on a terminal what is being done, in place of what was shown before; elsewhere nothing."""
    global _shown
    if is_terminal():
        room = shutil.get_terminal_size().columns - 1
        print(f"{_ERASED if _shown else ''}{message(words)[:room]}", end="", file=sys.stderr, flush=True)
        _shown = True


def clear() -> None:
    """Take the line back, where one is shown."""
    global _shown
    if _shown:
        print(_ERASED, end="", file=sys.stderr, flush=True)
        _shown = False
