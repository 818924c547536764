"""The command: case files in, reports out.

``python -m henon_ref.compare CASE.yaml [...]``. Exit status 0 done, 1 the gate is not met or a required solver is
wrong, 2 a bad case file or argument (one message on standard error), 130 interrupted.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
from collections.abc import Sequence
from types import FrameType
from typing import TYPE_CHECKING

from henon_ref.cachefolder import watched_cache
from henon_ref.score.forkserver import begin_server, collect_seldom

# One run is one thread: BLAS's own threads would only disturb the timings. Set before numpy is imported.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

if TYPE_CHECKING:
    from henon_ref.report.request import Request

DONE, GATE, BAD, INTERRUPTED = 0, 1, 2, 130
KEPT = "finished rows are kept, --resume goes on from them"


def _terminate(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def command(arguments: Sequence[str] | None = None) -> int:
    """Run the command; the exit status. Whatever goes wrong is one message on standard error."""
    from henon_ref.errors import HenonRefError
    from henon_ref.report.arguments import ABORT, USAGE_ERROR, app

    signal.signal(signal.SIGTERM, _terminate)
    collect_seldom()
    try:
        # Run outside of typer, which has its own way with an interrupt.
        request = app(arguments, prog_name="python -m henon_ref.compare", standalone_mode=False)
        if request == INTERRUPTED:  # typer takes an interrupt while it is at work for a status
            raise KeyboardInterrupt
        return DONE if request is None or isinstance(request, int) else _run(request)
    except USAGE_ERROR as error:
        return _say(f"{error.format_message()} (see --help)")
    except HenonRefError as error:
        return _say(str(error))
    except OSError as error:
        where = f" {error.filename}" if error.filename else ""
        return _say(f"cannot write{where}: {error.strerror or error}; {KEPT}")
    except (KeyboardInterrupt, ABORT):
        print(f"interrupted; {KEPT}", file=sys.stderr)
        return INTERRUPTED


def _run(request: Request) -> int:
    from henon_ref.report.command import run
    from henon_ref.text import message

    unmet = run(request)
    for what, failures in unmet._asdict().items():
        for words in failures:
            print(message(f"{what}: {words}"), file=sys.stderr)
    return GATE if unmet.required or (request.gate and unmet.gate) else DONE


def _say(words: str) -> int:
    from henon_ref.text import message

    print(message(f"error: {words}"), file=sys.stderr)
    return BAD


if __name__ == "__main__":
    with watched_cache():  # its processes use the folder that is found usable here
        begin_server()  # while it is at work, this process imports what the command needs
        _status = command()
    gc.freeze()  # nor is it looked through once more on the way out: a tenth of a short comparison
    sys.exit(_status)
