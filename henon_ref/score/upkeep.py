"""How a process ends with the one that it was begun by, and when it looks for garbage."""

from __future__ import annotations

import ctypes
import gc
import signal

SELDOM = 200_000
"""Objects made between two looks for garbage."""


def die_with_parent() -> None:
    """Ask the kernel (Linux's) for SIGKILL when the process that this one was begun by ends, however it ends."""
    set_parent_death_signal = 1
    ctypes.CDLL(None, use_errno=True).prctl(set_parent_death_signal, signal.SIGKILL, 0, 0, 0)


def collect_seldom() -> None:
    """What is imported and compiled stays: looking through it again and again would be for nothing."""
    gc.set_threshold(SELDOM)
