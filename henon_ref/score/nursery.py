"""A nursery: a process that imports what workers need while the command reads its cases, and that they are forked from.

It is the fork server of :mod:`multiprocessing`. Without it each worker imports that itself, once the cases are read.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
from multiprocessing import forkserver

PRELOADED = "henon_ref.score.preloaded"
"""The module that it imports."""


def begin_nursery() -> None:
    """From here on workers are forked from a process that is begun now.

    On Linux, where there is a second core for it, and where it can be begun.
    """
    if sys.platform != "linux" or len(os.sched_getaffinity(0)) < 2:
        return
    multiprocessing.set_start_method("forkserver")
    multiprocessing.set_forkserver_preload([PRELOADED])
    try:
        forkserver.ensure_running()
    except OSError:  # such as where no socket can be made: workers are begun as they are elsewhere
        multiprocessing.set_start_method(None, force=True)
