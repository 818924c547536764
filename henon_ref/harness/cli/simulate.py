"""The command: ``henon-ref simulate CASE [--reading R] [--rtol X] [--csv]``, one run and its transitions.

A run that ends before its horizon says so on standard error and is no failure. For the exit statuses see
:mod:`henon_ref.harness.cli.exit_status`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from henon_ref.harness.cli.exit_status import DONE, exit_status, parsed, say
from henon_ref.harness.cli.typer_app import FLAG, application, examples

app = application()


@app.command(
    epilog=examples("simulate fig8", "simulate my_case.yaml --reading mine --rtol 1e-6", "simulate fig8 --csv")
)
def main(
    case: Annotated[Path, typer.Argument(help="A case file, or a case's name.", show_default=False, metavar="CASE")],
    reading: Annotated[
        str | None, typer.Option(help="Its reading; the first one if left out.", metavar="NAME", show_default=False)
    ] = None,
    rtol: Annotated[float, typer.Option(help="Tolerance, from 1e-16 to below 1.", metavar="NUMBER")] = 1e-10,
    csv: Annotated[bool, typer.Option("--csv", help="Print CSV, numbers in full.", metavar=FLAG)] = False,
) -> int:
    """Simulate a case with the reference, and print its transitions."""
    from henon_ref.simulation.simulate import simulate
    from henon_ref.simulation.system import System

    system = System.from_case(case, reading)
    assert system.initial is not None  # a case has one
    run = simulate(
        system,
        system.initial,
        start=system.start,
        until=system.until,
        mode=system.mode,
        rtol=rtol,
        dense_output=False,
    )
    if csv:
        from henon_ref.harness.rows import csv_text

        table = run.transitions
        print(csv_text(list(table.columns), table.itertuples(index=False)), end="")
    elif len(run.transitions):
        print(run.transitions.to_string(index=False, float_format=lambda value: f"{value:.12g}"))
    if not (csv and run.success):
        say(repr(run))
    return DONE


def command(arguments: Sequence[str] | None = None) -> int:
    """Run the command; the exit status."""
    return exit_status(lambda: int(parsed(app, arguments, name="simulate")), name="simulate", arguments=arguments)
