"""Command ``compare``: its options and their validation."""

from __future__ import annotations

import gc
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from henon_ref.commands import FLAG, Cases, application, examples, path_of, status_line
from henon_ref.commands.exit_status import DONE, command_of, writing_into
from henon_ref.text import listed, shortened
from henon_ref.workers import ONE_THREAD

ROWS_KEPT = "finished rows are kept; --resume continues from them"
RUNS, SHOWN, DEMANDS = "Runs", "Output", "Exit status"
"""Panels of the help."""

app = application()


def _tolerance(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 1e-16 <= value < 1:
        words = f"a tolerance lies between 1e-16 and 1, not {shortened(text)}"
        raise typer.BadParameter(words, param_hint="--tolerances")
    return value


def names(text: str | None, option: str) -> tuple[str, ...] | None:
    """Split the comma-separated list of names of an option, and drop repeated names."""
    if text is None:
        return None
    parts = tuple(part.strip() for part in text.split(",") if part.strip())
    if not parts:
        raise typer.BadParameter("the list is empty", param_hint=option)
    return tuple(dict.fromkeys(parts))


def _in(panel: str | None, **how: Any) -> Any:
    return typer.Option(rich_help_panel=panel, **how)


def _flag(name: str, panel: str | None, words: str) -> Any:
    return typer.Option(name, help=words, metavar=FLAG, rich_help_panel=panel)


Solvers = Annotated[
    str | None,
    typer.Option(
        help="Solvers to run, separated by commas. If omitted: the solvers that a case lists, or the default solvers "
        "if it lists none. 'all' also includes the installed peers (optional libraries) if a case lists none. "
        "'heyoka@direction' is heyoka with the restart 'direction' after events.",
        metavar="NAMES",
    ),
]
Required = Annotated[
    str | None,
    _in(
        DEMANDS,
        help="Solvers, separated by commas. Exit with status 1 if one of them is wrong through its own fault at its "
        "tightest setting in some reading, or is not judged in any reading.",
        metavar="NAMES",
    ),
]


@app.command(
    epilog=examples(
        "compare fig8",
        "compare hard --solvers henon,heyoka --tolerances 1e-6,1e-9",
        "compare my_case.yaml --check",
        "compare my_case.yaml --gate --json > table.json",
        "compare hard --solvers my-solver --require my-solver",
    )
)
def main(
    context: typer.Context,
    cases: Cases,
    out: Annotated[Path, typer.Option(help="Folder of the reports.", parser=path_of, metavar="FOLDER")] = Path("out"),
    solvers: Solvers = None,
    tolerances: Annotated[
        str | None, typer.Option(help="Comma-separated relative tolerances that replace the case's.", metavar="NUMBERS")
    ] = None,
    check: Annotated[
        bool,
        _flag(
            "--check",
            None,
            "Only read the case files, and print their states, surfaces, jumps, effects, and the equations of each "
            "mode.",
        ),
    ] = False,
    timeout: Annotated[
        float,
        _in(
            RUNS,
            help="Limit on the processor time of one run. Its preparation may take 240 s in addition, and a truth that "
            "is not stored 300 s.",
            metavar="SECONDS",
        ),
    ] = 10.0,
    repeats: Annotated[
        int | None,
        _in(
            RUNS,
            min=1,
            help="Timing samples per row. If omitted: as many as a fraction of a second allows.",
            metavar="N",
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        _in(RUNS, min=1, help="Concurrent runs. If omitted: 2, or 1 on a single processor core.", metavar="N"),
    ] = None,
    resume: Annotated[bool, _flag("--resume", RUNS, "Continue an interrupted comparison from its rows.")] = False,
    json: Annotated[
        bool,
        _flag("--json", SHOWN, "Print the final table as a JSON document, and nothing else, on standard output."),
    ] = False,
    figures: Annotated[bool, _in(SHOWN, help="Draw figures.", metavar=FLAG)] = True,
    gate: Annotated[
        bool,
        _flag(
            "--gate",
            DEMANDS,
            "Exit with status 1 if a bound of a case's gate is violated, or if the cases have bounds and none was "
            "checked.",
        ),
    ] = False,
    require: Required = None,
) -> int:
    """Run every solver on every case, score the runs against the truth, and write reports."""
    options = {
        "solvers": names(solvers, "--solvers"),
        "tolerances": None if tolerances is None else tuple(map(_tolerance, names(tolerances, "--tolerances") or ())),
        "repeats": repeats,
        "timeout": timeout,
        "processes": jobs or min(2, os.cpu_count() or 1),
        "folder": out,
        "resume": resume,
        "required": names(require, "--require") or (),
    }
    shown = {"gated": gate, "figures": figures, "as_json": json}
    return _run(cases, options, shown, check=check, served=bool(context.obj))


def _run(
    cases: Sequence[Path], options: Mapping[str, Any], shown: Mapping[str, bool], *, check: bool, served: bool
) -> int:
    """Explain or compare cases; with ``served``, workers are forked from a server."""
    judged = {"--json": shown["as_json"], "--gate": shown["gated"], "--require": options["required"]}
    if check and any(judged.values()):
        without = listed([name for name, given in judged.items() if given])
        raise typer.BadParameter(f"it runs no solver and has no result for {without}", param_hint="--check")
    try:
        # Shown before the slow imports.
        status_line.show(f"reading {listed([str(path) for path in cases], 4)}")
        from henon_ref.workers.worker import collect_seldom

        collect_seldom()
        if check:
            from henon_ref.harness.cli.explain_cases import explain

            explain(cases)
            return DONE
        if served:
            _begin_server(figures=shown["figures"])
        from henon_ref.harness.cli.compare_cases import run

        with writing_into(options["folder"], kept=ROWS_KEPT):
            return run(cases, options, **shown)
    finally:
        status_line.clear()


def _begin_server(*, figures: bool) -> None:
    """Start a server of worker processes, while this process imports the modules of the command."""
    from henon_ref.harness.campaign import DRAWING_NEEDS, WORKERS_NEED
    from henon_ref.jit.cache_folder import cache_root
    from henon_ref.workers.worker_process import begin_server

    cache_root()  # chooses a usable cache folder, which the workers inherit
    begin_server(*WORKERS_NEED, *(DRAWING_NEEDS if figures else ()))


command = command_of(app, "compare", kept=ROWS_KEPT)


def program(arguments: Sequence[str] | None = None) -> int:
    """Run the command as a separate process and return its exit status."""
    # A run has one thread, and threads of BLAS would disturb the timings. NumPy, which is imported later, reads these.
    for name, value in ONE_THREAD.items():
        os.environ.setdefault(name, value)
    status = command(arguments, obj=True)
    gc.freeze()  # skips the garbage collection at exit, which takes a tenth of the time of a short comparison
    return status
