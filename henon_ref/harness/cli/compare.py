"""The command: case files in, reports out.

``python -m henon_ref.compare CASE.yaml [...]``. Exit status 1: the gate is not met or a required solver is wrong; for
the others see :mod:`henon_ref.commands.exit_status`.
"""

from __future__ import annotations

import gc
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

from henon_ref.commands import status_line
from henon_ref.commands.exit_status import DONE, NOT_MET, exit_status, parsed, say, writing_into
from henon_ref.text import listed

if TYPE_CHECKING:
    from henon_ref.harness.cli.request import Request

ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""A run is one thread: those of BLAS would only disturb the timings."""
KEPT = "finished rows are kept, --resume goes on from them"


def command(arguments: Sequence[str] | None = None) -> int:
    """Run the command; the exit status. Whatever goes wrong is one message on standard error."""
    return exit_status(lambda: _act(arguments, served=False), name="compare", arguments=arguments, kept=KEPT)


def program(arguments: Sequence[str] | None = None) -> int:
    """The command as a process of its own: the exit status."""
    for name in ONE_THREAD:  # read when numpy is imported, which it has not been yet
        os.environ.setdefault(name, "1")
    status = exit_status(lambda: _act(arguments, served=True), name="compare", arguments=arguments, kept=KEPT)
    gc.freeze()  # nor is it looked through once more on the way out: a tenth of a short comparison
    return status


def _begin_server(*, figures: bool) -> None:
    """Begin a server of worker processes: meanwhile this process imports what the command needs."""
    from henon_ref.harness.campaign import DRAWING_NEEDS, WORKERS_NEED
    from henon_ref.jit.cache_folder import cache_root
    from henon_ref.workers.worker_process import begin_server

    cache_root()  # workers use the folder that is found usable here
    begin_server(*WORKERS_NEED, *(DRAWING_NEEDS if figures else ()))


def _act(arguments: Sequence[str] | None, *, served: bool) -> int:
    from henon_ref.harness.cli.arguments import app

    # Run outside of typer, which has its own way with an interrupt.
    request = parsed(app, arguments, name="compare")
    if isinstance(request, int):
        return request
    try:
        # Before anything that takes long is imported.
        status_line.show(f"reading {listed([str(path) for path in request.cases], 4)}")
        from henon_ref.workers.worker import collect_seldom

        collect_seldom()
        if request.check:
            return _explain(request)
        if served:
            _begin_server(figures=request.figures)
        with writing_into(request.out, kept=KEPT):
            return _run(request)
    finally:
        status_line.clear()


def _explain(request: Request) -> int:
    from henon_ref.harness.cli.explain_cases import explain

    explain(request.cases)
    return DONE


def _run(request: Request) -> int:
    from henon_ref.harness.cli.compare_cases import run

    unmet = run(request)
    for what, failures in unmet._asdict().items():
        for words in failures:
            say(f"{what}: {words}")
    return NOT_MET if unmet.required or (request.gate and unmet.gate) else DONE
