"""What the command takes: its options, and what is wrong with them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from henon_ref.commands.typer_app import FLAG, Cases, application, examples
from henon_ref.harness.cli.request import Request

app = application()

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


def _folder(text: str | Path) -> Path:
    if not str(text).strip():
        raise typer.BadParameter("an empty path; the folder one stands in is .")
    return Path(text)


def _seconds(text: str | float) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not SHORTEST <= value <= LONGEST:
        raise typer.BadParameter(f"a number of seconds from {SHORTEST:g} to {LONGEST:g}, not '{text}'")
    return value


Solvers = Annotated[
    str | None,
    typer.Option(
        help="Names with commas; all that a case lists if left out. 'all' stands for those that run by default and "
        "the peers that are installed (henon-ref[peers]). heyoka@direction: heyoka, restarted in another way after "
        "an event.",
        metavar="NAMES",
    ),
]
Tolerances = Annotated[
    str | None, typer.Option(help="Relative tolerances with commas, in place of the cases' own.", metavar="NUMBERS")
]
Check = Annotated[
    bool,
    typer.Option(
        "--check",
        help="Run nothing: read the files, and explain states, surfaces, effects, and the equations of each mode.",
        metavar=FLAG,
    ),
]
Timeout = Annotated[
    float,
    typer.Option(
        parser=_seconds,
        help="Seconds of processor time that one run may take. Preparing it may take 240 besides, a truth that is "
        "not stored 300.",
        metavar="SECONDS",
        rich_help_panel=RUNS,
    ),
]
Repeats = Annotated[
    int | None,
    typer.Option(
        min=1,
        help="Timing samples a row; as many as fit a fraction of a second if left out.",
        metavar="N",
        rich_help_panel=RUNS,
    ),
]
Processes = Annotated[
    int | None,
    typer.Option(min=1, help="Runs at work at once; two if there are two cores.", metavar="N", rich_help_panel=RUNS),
]
Resume = Annotated[
    bool,
    typer.Option("--resume", help="Keep the rows of an interrupted comparison.", metavar=FLAG, rich_help_panel=RUNS),
]
Json = Annotated[
    bool,
    typer.Option(
        "--json",
        help="The table at the end as one JSON document, and nothing else on standard output.",
        metavar=FLAG,
        rich_help_panel=SHOWN,
    ),
]
Figures = Annotated[bool, typer.Option(help="Draw figures.", metavar=FLAG, rich_help_panel=SHOWN)]
GateMet = Annotated[
    bool,
    typer.Option(
        "--gate",
        help="Exit with 1 if a bound of a case's gate is not met, or none of its bounds was checked.",
        metavar=FLAG,
        rich_help_panel=DEMANDS,
    ),
]
Required = Annotated[
    str | None,
    typer.Option(
        help="Solvers with commas: exit with 1 if one of them is wrong by its own fault in some reading, at its "
        "tightest setting, or is not judged in any.",
        metavar="NAMES",
        rich_help_panel=DEMANDS,
    ),
]


@app.command(help=HELP, epilog=examples(*EXAMPLES))
def main(
    cases: Cases,
    out: Annotated[Path, typer.Option(help="Folder of the reports.", parser=_folder, metavar="FOLDER")] = Path("out"),
    solvers: Solvers = None,
    tolerances: Tolerances = None,
    check: Check = False,
    timeout: Timeout = 10.0,
    repeats: Repeats = None,
    jobs: Processes = None,
    resume: Resume = False,
    json: Json = False,
    figures: Figures = True,
    gate: GateMet = False,
    require: Required = None,
) -> Request:
    """Run every solver on every case, score it against the truth, and write a report."""
    return Request(
        cases=tuple(cases),
        out=out,
        solvers=names(solvers),
        tolerances=None if tolerances is None else tuple(_tolerance(part) for part in names(tolerances) or ()),
        repeats=repeats,
        timeout=timeout,
        processes=jobs or min(2, os.cpu_count() or 1),
        resume=resume,
        gate=gate,
        figures=figures,
        required=names(require) or (),
        check=check,
        json=json,
    )


def names(text: str | None) -> tuple[str, ...] | None:
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
