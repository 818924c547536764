"""The command: case files in, reports out; its options, and what is wrong with them.

``python -m henon_ref.compare CASE.yaml [...]``. Exit status 1: the gate is not met or a required solver is wrong; for
the others see :mod:`henon_ref.commands.exit_status`.
"""

from __future__ import annotations

import gc
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from henon_ref.commands import status_line
from henon_ref.commands.exit_status import DONE, NOT_MET, exit_status, parsed, say, writing_into
from henon_ref.commands.typer_app import FLAG, Cases, application, examples
from henon_ref.text import listed

ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""A run is one thread: those of BLAS would only disturb the timings."""
KEPT = "finished rows are kept, --resume goes on from them"
SHORTEST, LONGEST = 0.01, 1e6
"""Seconds that may be given to one run."""
RUNS, SHOWN, DEMANDS = "Runs", "What is shown", "What must hold"
"""Panels of the help."""
HELP = "Run every solver on every case, score it against the truth, and write a report."
EXAMPLES = (
    "compare fig8",
    "compare hard --solvers henon,heyoka --tolerances 1e-6,1e-9",
    "compare my_case.yaml --check",
    "compare my_case.yaml --gate --json > table.json",
    "compare hard --solvers my-solver --require my-solver",
)

app = application()


class Request(NamedTuple):
    """What the command was asked for."""

    cases: Sequence[Path]
    options: Mapping[str, Any]
    """How the campaign is run, and where its reports go: see :func:`henon_ref.harness.cli.compare_cases.run`."""
    shown: Mapping[str, bool]
    """What else that takes."""
    check: bool
    """Only read and explain the case files."""


def _folder(text: str | Path) -> Path:
    if not str(text).strip():
        raise typer.BadParameter("an empty path; the folder one stands in is .")
    return Path(text)


def _number(text: str | float) -> float:
    try:
        return float(text)
    except ValueError:
        return float("nan")


def _seconds(text: str | float) -> float:
    value = _number(text)
    if not SHORTEST <= value <= LONGEST:
        raise typer.BadParameter(f"a number of seconds from {SHORTEST:g} to {LONGEST:g}, not '{text}'")
    return value


def _tolerance(text: str) -> float:
    value = _number(text)
    if not 1e-16 <= value < 1:
        raise typer.BadParameter(f"a tolerance lies between 1e-16 and 1, not '{text}'", param_hint="--tolerances")
    return value


def names(text: str | None) -> tuple[str, ...] | None:
    """Words between commas."""
    if text is None:
        return None
    parts = tuple(part.strip() for part in text.split(",") if part.strip())
    if not parts:
        raise typer.BadParameter("an empty list")
    return tuple(dict.fromkeys(parts))


def _in(panel: str | None, **how: Any) -> Any:
    """An option in a panel of the help."""
    return typer.Option(rich_help_panel=panel, **how)


def _flag(name: str, panel: str | None, words: str) -> Any:
    """An option without a value."""
    return typer.Option(name, help=words, metavar=FLAG, rich_help_panel=panel)


@app.command(help=HELP, epilog=examples(*EXAMPLES))
def main(
    cases: Cases,
    out: Annotated[Path, typer.Option(help="Folder of the reports.", parser=_folder, metavar="FOLDER")] = Path("out"),
    solvers: Annotated[
        str | None,
        typer.Option(
            help="Names with commas; all that a case lists if left out. 'all' stands for those that run by default and "
            "the peers that are installed (henon-ref[peers]). heyoka@direction: heyoka, restarted in another way after "
            "an event.",
            metavar="NAMES",
        ),
    ] = None,
    tolerances: Annotated[
        str | None, typer.Option(help="Relative tolerances with commas, in place of the cases' own.", metavar="NUMBERS")
    ] = None,
    check: Annotated[
        bool,
        _flag(
            "--check",
            None,
            "Run nothing: read the files, and explain states, surfaces, effects, and the equations of each mode.",
        ),
    ] = False,
    timeout: Annotated[
        float,
        _in(
            RUNS,
            parser=_seconds,
            help="Seconds of processor time that one run may take. Preparing it may take 240 besides, a truth that is "
            "not stored 300.",
            metavar="SECONDS",
        ),
    ] = 10.0,
    repeats: Annotated[
        int | None,
        _in(RUNS, min=1, help="Timing samples a row; as many as fit a fraction of a second if left out.", metavar="N"),
    ] = None,
    jobs: Annotated[
        int | None, _in(RUNS, min=1, help="Runs at work at once; two if there are two cores.", metavar="N")
    ] = None,
    resume: Annotated[bool, _flag("--resume", RUNS, "Keep the rows of an interrupted comparison.")] = False,
    json: Annotated[
        bool,
        _flag("--json", SHOWN, "The table at the end as one JSON document, and nothing else on standard output."),
    ] = False,
    figures: Annotated[bool, _in(SHOWN, help="Draw figures.", metavar=FLAG)] = True,
    gate: Annotated[
        bool,
        _flag(
            "--gate", DEMANDS, "Exit with 1 if a bound of a case's gate is not met, or none of its bounds was checked."
        ),
    ] = False,
    require: Annotated[
        str | None,
        _in(
            DEMANDS,
            help="Solvers with commas: exit with 1 if one of them is wrong by its own fault in some reading, at its "
            "tightest setting, or is not judged in any.",
            metavar="NAMES",
        ),
    ] = None,
) -> Request:
    """Run every solver on every case, score it against the truth, and write a report."""
    options = {
        "solvers": names(solvers),
        "tolerances": None if tolerances is None else tuple(map(_tolerance, names(tolerances) or ())),
        "repeats": repeats,
        "timeout": timeout,
        "processes": jobs or min(2, os.cpu_count() or 1),
        "folder": out,
        "resume": resume,
        "required": names(require) or (),
    }
    return Request(cases, options, {"gated": gate, "figures": figures, "as_json": json}, check)


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
            from henon_ref.harness.cli.explain_cases import explain

            explain(request.cases)
            return DONE
        if served:
            _begin_server(figures=request.shown["figures"])
        with writing_into(request.options["folder"], kept=KEPT):
            return _run(request)
    finally:
        status_line.clear()


def _run(request: Request) -> int:
    from henon_ref.harness.cli.compare_cases import run

    unmet = run(request.cases, request.options, **request.shown)
    for what, failures in unmet._asdict().items():
        for words in failures:
            say(f"{what}: {words}")
    return NOT_MET if unmet.required or (request.shown["gated"] and unmet.gate) else DONE
