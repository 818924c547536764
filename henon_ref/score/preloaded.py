"""What the nursery does: it imports what workers need. Imported by nobody else, for what it does then.

See :mod:`henon_ref.score.nursery`.
"""

from __future__ import annotations

import signal
from contextlib import suppress
from importlib import import_module

from henon_ref.score.upkeep import collect_seldom, die_with_parent

signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is the command's own, with which this process ends
die_with_parent()
collect_seldom()
with suppress(Exception):  # what cannot be imported is a failure of the job that needs it
    for module in ("henon_ref.henon.solvers", "henon_ref.score.runjob", "henon_ref.score.truthjob"):
        import_module(module)
    import_module("henon_ref.jit").warm_up()
