"""Commands ``cases``, ``solvers`` and ``schema``: list cases and solvers, and print the JSON Schema of a case file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from henon_ref.casefile.files import located, shipped_folder, yaml_files
from henon_ref.casefile.outline import Outline, outline
from henon_ref.commands.exit_status import DONE, command_of
from henon_ref.commands.typer_app import application, examples
from henon_ref.errors import CaseError, UnavailableError
from henon_ref.harness.table import Table
from henon_ref.text import did_you_mean, listed, message

cases_app, solvers_app, schema_app = application(), application(), application()


@cases_app.command(epilog=examples("cases", "cases --tag grazing", "cases hard my_cases"))
def cases(
    folders: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Case files, or folders of them. If omitted: the cases that come with the program.",
            show_default=False,
            metavar="CASE",
        ),
    ] = None,
    tag: Annotated[
        list[str] | None,
        typer.Option(help="List only cases with this tag; if repeated, cases with all these tags.", metavar="TAG"),
    ] = None,
) -> int:
    """List cases: names, numbers of readings, states and surfaces, titles, and tags."""
    # The files are read as YAML only; their expressions are not parsed.
    places = [located(path) for path in folders or [shipped_folder()]]
    files = [file for place in places for file in (yaml_files(place) if place.is_dir() else [place])]
    found = [outline(file) for file in files]
    tags = dict.fromkeys(own for case in found for own in case.tags)
    for wanted in tag or ():
        if wanted not in tags:
            raise CaseError(f"no case has the tag '{wanted}'{did_you_mean(wanted, tags)}; tags: {listed(tags, 60)}")
    lines = [_case(case) for case in found if set(tag or ()) <= set(case.tags)]
    print(Table(("name", "readings", "states", "surfaces", "title", "tags"), "lrrrll", lines).text)
    return DONE


def _case(case: Outline) -> tuple[str, ...]:
    sizes = _span(case.states), _span(case.surfaces)
    return case.name, str(case.readings), *sizes, case.title, ", ".join(case.tags)


def _span(sizes: Sequence[int]) -> str:
    """Format the number of one reading, or the range of several."""
    least, largest = min(sizes), max(sizes)
    return str(least) if least == largest else f"{least} to {largest}"


SOLVERS_HELP = (
    "List solvers: package, version, error control (tolerances or fixed step), restart after events, and the reason "
    "why a solver is unavailable."
    "\n\n"
    "A solver with a restart can be given another one: heyoka@direction. A solver that does not run by default runs if "
    "a case or --solvers names it."
)


@solvers_app.command(help=SOLVERS_HELP, epilog=examples("solvers"))
def solvers() -> int:
    """List solvers; a worker loads each third-party solver first, since its module may hang or crash."""
    from henon_ref.harness import registry
    from henon_ref.harness.campaign.case_files import fixed_step

    default = registry.default_names()
    rows = [
        (
            name,
            registry.distribution(name),
            registry.library_version(name) or "not installed",
            "step" if fixed_step(name) else "tolerances",
            registry.restart_of(name),
            "by default" if name in default else "when named",
        )
        for name in registry.names()
    ]
    print(Table(("solver", "package", "version", "driven by", "restart", "runs"), "llllll", rows).text)
    for name, *_ in rows:
        if why := unavailable(name):
            print(message(f"{name} is unavailable: {why}"))
    return DONE


def unavailable(name: str) -> str:
    """Return the reason why a solver is unavailable; empty if it is available."""
    from henon_ref.baselines.adapter import LibrarySolver
    from henon_ref.baselines.protocol.program import ProgramSolver
    from henon_ref.harness import registry

    try:
        solver = registry.solver(name)
        if isinstance(solver, LibrarySolver | ProgramSolver):
            solver.check()
    except UnavailableError as error:
        return str(error)
    return ""


SCHEMA_HELP = (
    "Print the JSON Schema of a case file, for editors that complete and check YAML.\n\n"
    "Save the schema as case.schema.json next to a case file, and begin the case file with the line "
    "'# yaml-language-server: $schema=case.schema.json': the editor then checks it while you write."
)


@schema_app.command(help=SCHEMA_HELP, epilog=examples("schema > case.schema.json"))
def schema() -> int:
    """Print the schema, and nothing else, on standard output."""
    from henon_ref.casefile.json_schema import schema_text

    print(schema_text(), end="")
    return DONE


cases_command = command_of(cases_app, "cases")
solvers_command = command_of(solvers_app, "solvers")
schema_command = command_of(schema_app, "schema")
