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
from pathlib import Path
from types import FrameType
from typing import Annotated, Any

# One run is one thread: BLAS's own threads would only disturb the timings. Set before numpy is imported.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import typer  # noqa: E402

from henon_ref.errors import HenonRefError  # noqa: E402
from henon_ref.report.request import Request  # noqa: E402

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)

DONE, GATE, BAD, INTERRUPTED = 0, 1, 2, 130
SELDOM = 200_000
"""Objects made between two looks for garbage."""
LONGEST = 1e6
"""Seconds that may be given to one run."""
KEPT = "finished rows are kept, --resume goes on from them"
# What typer raises for a wrong argument; it exports this one class of them only.
USAGE_ERROR: Any = typer.BadParameter.__base__


def _folder(text: str | Path) -> Path:
    if not str(text).strip():
        raise typer.BadParameter("an empty path; the folder one stands in is .")
    return Path(text)


@app.command()
def main(
    cases: Annotated[list[Path], typer.Argument(help="Case files, or folders of them.", show_default=False)],
    out: Annotated[Path, typer.Option(help="Folder of the reports.", parser=_folder, metavar="PATH")] = Path("reports"),
    solvers: Annotated[str | None, typer.Option(help="Names with commas; all that a case lists if left out.")] = None,
    tolerances: Annotated[str | None, typer.Option(help="Relative tolerances with commas, for the cases' own.")] = None,
    repeats: Annotated[int | None, typer.Option(min=1, help="Timing samples a row.")] = None,
    timeout: Annotated[
        float,
        typer.Option(
            min=0.01,
            max=LONGEST,
            help="Seconds one run may take. Preparing it may take 120 besides, a truth that is not stored 900.",
        ),
    ] = 10.0,
    jobs: Annotated[int | None, typer.Option(min=1, help="Runs at work at once; two if there are two cores.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Keep the rows of an interrupted comparison.")] = False,
    restart: Annotated[
        str | None,
        typer.Option(
            help="How libraries are restarted after an event, with commas: event-free-step, offset, direction, none; "
            "each solver's own if left out. For one solver alone: --solvers heyoka@direction."
        ),
    ] = None,
    figures: Annotated[bool, typer.Option(help="Draw figures.")] = True,
    gate: Annotated[
        bool,
        typer.Option(
            "--gate", help="Exit with 1 if a bound of a case's gate is not met, or none of its bounds was checked."
        ),
    ] = False,
    require: Annotated[
        str | None,
        typer.Option(
            help="Solvers with commas: exit with 1 if one of them is wrong by its own fault in some reading, at its "
            "tightest setting, or is not judged in any."
        ),
    ] = None,
) -> Request:
    """Run every solver on every case, score it against the truth, and write a report."""
    return Request(
        cases=tuple(cases),
        out=out,
        solvers=_parts(solvers),
        tolerances=None if tolerances is None else tuple(_tolerance(part) for part in _parts(tolerances) or ()),
        repeats=repeats,
        timeout=timeout,
        processes=jobs or min(2, os.cpu_count() or 1),
        resume=resume,
        gate=gate,
        figures=figures,
        restarts=_parts(restart) or (),
        required=_parts(require) or (),
    )


def _parts(text: str | None) -> tuple[str, ...] | None:
    """Words between commas."""
    if text is None:
        return None
    parts = tuple(part.strip() for part in text.split(",") if part.strip())
    if not parts:
        raise typer.BadParameter("an empty list")
    return tuple(dict.fromkeys(parts))


def _tolerance(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 1e-16 <= value < 1:
        raise typer.BadParameter(f"a tolerance lies between 1e-16 and 1, not '{text}'", param_hint="--tolerances")
    return value


def _terminate(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def command(arguments: Sequence[str] | None = None) -> int:
    """Run the command; the exit status. Whatever goes wrong is one message on standard error."""
    signal.signal(signal.SIGTERM, _terminate)
    gc.set_threshold(SELDOM)  # what is imported and compiled stays: looking through it again and again is for nothing
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
        return _say(
            f"cannot write{where}: {error.strerror or error}; finished rows are kept, --resume goes on from them"
        )
    except (KeyboardInterrupt, typer.Abort):
        print(f"interrupted; {KEPT}", file=sys.stderr)
        return INTERRUPTED


def _run(request: Request) -> int:
    from henon_ref.report.command import run

    unmet = run(request)
    for what, failures in unmet._asdict().items():
        for words in failures:
            print(f"{what}: {words}", file=sys.stderr)
    return GATE if unmet.required or (request.gate and unmet.gate) else DONE


def _say(message: str) -> int:
    print(f"error: {' '.join(message.split())}", file=sys.stderr)
    return BAD


if __name__ == "__main__":
    _status = command()
    gc.freeze()  # nor is it looked through once more on the way out: a tenth of a short comparison
    sys.exit(_status)
