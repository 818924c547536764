"""What the command takes: its options, and what is wrong with them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from henon_ref.cli.request import Request

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)

LONGEST = 1e6
"""Seconds that may be given to one run."""
CI = "Continuous integration"
"""Panel of the help for what a test runner needs."""


def _folder(text: str | Path) -> Path:
    if not str(text).strip():
        raise typer.BadParameter("an empty path; the folder one stands in is .")
    return Path(text)


@app.command()
def main(
    cases: Annotated[list[Path], typer.Argument(help="Case files, or folders of them.", show_default=False)],
    out: Annotated[Path, typer.Option(help="Folder of the reports.", parser=_folder, metavar="PATH")] = Path("out"),
    solvers: Annotated[str | None, typer.Option(help="Names with commas; all that a case lists if left out.")] = None,
    tolerances: Annotated[str | None, typer.Option(help="Relative tolerances with commas, for the cases' own.")] = None,
    repeats: Annotated[int | None, typer.Option(min=1, help="Timing samples a row.")] = None,
    timeout: Annotated[
        float,
        typer.Option(
            min=0.01,
            max=LONGEST,
            help="Processor time one run may take [s]; preparing it 120 besides, a truth that is not stored 300.",
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
    junit: Annotated[
        Path | None,
        typer.Option(help="Write the rows as JUnit XML, a test case a row.", metavar="FILE", rich_help_panel=CI),
    ] = None,
    baseline: Annotated[
        Path | None,
        typer.Option(
            help="An earlier runs.csv, or a folder of reports: exit with 1 if a row's status got worse, or the digits "
            "of its times by more than 0.5.",
            metavar="PATH",
            rich_help_panel=CI,
        ),
    ] = None,
    known: Annotated[
        Path | None,
        typer.Option(
            help="A CSV file of failures that are expected: they are told, and count for none of the other options.",
            metavar="FILE",
            rich_help_panel=CI,
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
        junit=junit,
        baseline=baseline,
        known=known,
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
